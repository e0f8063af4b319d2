"""The planner as a policy: one demonstration, the observation, no training."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from ..envs import TaskDescription
from ..planner import Demonstration, PlanSettings, Pose, RepetSettings
from ..planner.imitation.constraint import ConstraintSettings, Keeping
from ..planner.planning.settings import JointSearchSettings
from .motion.motion_method import SCREW, MotionMethod
from .motion.settings import GUARDED, ProgramSettings
from .program_policy import ProgramPolicy


@dataclass(frozen=True, slots=True)
class ScrewSettings(ProgramSettings):
    """Settings of the method's motions; a switch set to False makes an ablation.

    Attributes:
        repet: settings of detours around obstacles; see `RepetSettings`.
        trees: False: no escape trees, so no detours of the tool around obstacles.
        search: False: no RRT-Connect in joint space where nothing else leads to a goal. With neither trees nor search,
            obstacles are left to the safety layer.
        constraint: tolerances of what is kept while something is carried; see `ConstraintSettings`.
        keeping: how it is kept: "must", "prefer" or "free"; see `PlanSettings`.
        whole_arm: False: only the hand and the held object are checked, as in the paper.
        hold: as in `ProgramSettings`, guarded by default.
    """

    repet: RepetSettings = field(default_factory=RepetSettings)
    trees: bool = field(default=True, metadata={"formerly": "avoid"})
    search: bool = field(default=True, metadata={"formerly": "avoid"})
    constraint: ConstraintSettings = field(default_factory=ConstraintSettings)
    keeping: Keeping = "prefer"
    whole_arm: bool = True
    hold: str = GUARDED

    @property
    def motion_method(self) -> MotionMethod:
        """See `ProgramSettings`."""
        return SCREW

    @property
    def plan(self) -> PlanSettings:
        """See `ProgramSettings`."""
        search = JointSearchSettings() if self.search else None
        return PlanSettings(
            motion=self.motion,
            repet=self.repet,
            safety=self.safety,
            search=search,
            trees=self.trees,
            guard=self.guard,
            constraint=self.constraint,
            keeping=self.keeping,
        )

    def visible_part(self, task: TaskDescription) -> TaskDescription:
        """See `ProgramSettings`."""
        if self.whole_arm:
            return task
        bodies = tuple(body.at_tool(arm) for body, arm in zip(task.bodies, task.arms, strict=True))
        names = {name for body in bodies for name in body.names}
        return replace(task, bodies=bodies, touching=tuple(pair for pair in task.touching if pair[0] in names))


class ScrewPolicy(ProgramPolicy):
    """TSIA with screw interpolation and the dual-quaternion controller, from ONE demonstration.

    Args:
        task: see `ProgramPolicy`.
        demonstration: see `ProgramPolicy`.
        settings: settings of the method; None: the defaults.
        tool: see `ProgramPolicy`.
    """

    def __init__(
        self,
        task: TaskDescription,
        demonstration: Demonstration,
        settings: ScrewSettings | None = None,
        tool: Pose | None = None,
    ):
        super().__init__(task, demonstration, settings or ScrewSettings(), tool)
