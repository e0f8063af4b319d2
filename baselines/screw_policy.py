"""The planner as a policy: one demonstration, the observation, no training."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from ..envs.core.description import TaskDescription
from ..planner.escape.repet import RepetSettings
from ..planner.geometry.pose import Pose
from ..planner.imitation.demonstration import Demonstration
from ..planner.planning.settings import PlanSettings
from .motion.motion_method import SCREW, MotionMethod
from .motion.settings import ProgramSettings
from .program_policy import PROGRAMS, ProgramPolicy

__all__ = ["PROGRAMS", "ScrewPolicy", "ScrewSettings"]


@dataclass(frozen=True, slots=True)
class ScrewSettings(ProgramSettings):
    """How the method moves the legs of a program; what is False is an ablation of it.

    Attributes:
        repet: detours round obstacles; see `RepetSettings`.
        avoid: False: no detours and no search in joint space, the safety layer alone.
        whole_arm: False: only the hand and what it holds are looked at, as in the paper.
    """

    repet: RepetSettings = field(default_factory=RepetSettings)
    avoid: bool = True
    whole_arm: bool = True

    @property
    def motion_method(self) -> MotionMethod:
        """See `ProgramSettings`."""
        return SCREW

    @property
    def plan(self) -> PlanSettings:
        """See `ProgramSettings`."""
        return PlanSettings(
            motion=self.motion, repet=self.repet, safety=self.safety, avoid=self.avoid, guard=self.guard
        )

    def visible_part(self, task: TaskDescription) -> TaskDescription:
        """See `ProgramSettings`."""
        if self.whole_arm:
            return task
        bodies = tuple(body.at_tool(arm) for body, arm in zip(task.bodies, task.arms, strict=True))
        names = {name for body in bodies for name in body.names}
        return replace(task, bodies=bodies, touching=tuple(pair for pair in task.touching if pair[0] in names))


class ScrewPolicy(ProgramPolicy):
    """TSIA with screw interpolation and the dual-quaternion controller, from ONE demonstration."""

    def __init__(
        self,
        task: TaskDescription,
        demonstration: Demonstration,
        settings: ScrewSettings | None = None,
        tool: Pose | None = None,
    ):
        super().__init__(task, demonstration, settings or ScrewSettings(), tool)
