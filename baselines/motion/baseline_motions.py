"""The other policies of the comparison: the same programs, other ways to move a leg.

None has a guard by default, since their authors have none; `guard: true` gives each the method's, which shows how
much of the method the guard alone is.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field, replace

import numpy as np

from ...planner.geometry.pose import Pose, PosePath
from ...planner.imitation.tsia import GUIDE_START, guide_index
from ...planner.planning.settings import PlanSettings
from ...planner.reactive.command import ReactiveSettings
from ...planner.robot.arm import Arm
from ...planner.robot.body import Body
from .dmp import Dmp, DmpSettings
from .generated_follower import GeneratedFollower
from .generated_plan import GeneratedPlanner
from .motion_method import Follower, MotionMethod, MotionPlanner, Relative, ScrewMotion
from .path_generators import Decoupled, PathGenerator, Replay
from .potential import FieldSettings, Potential
from .settings import ProgramSettings
from .tool_obstacles import ToolObstacles


class GeneratedMotion:
    """Legs moved along the paths of a maker."""

    def __init__(self, generator: PathGenerator):
        self._generator = generator

    def planner(self, arm: Arm, body: Body, settings: PlanSettings) -> MotionPlanner:
        """See `MotionMethod`."""
        return GeneratedPlanner(arm, body, settings, self._generator)

    def follower(self, arm: Arm, body: Body, settings: ReactiveSettings) -> Follower:
        """See `MotionMethod`."""
        return GeneratedFollower(arm, body, settings, self._generator)

    def skipped(self, done: int) -> int:
        """All where the whole segment would be done again; none where there is a guiding pose behind them."""
        return 0 if self._generator.guided else done

    def relative(self, shown: PosePath, start: Pose) -> Relative:
        """See `MotionMethod`. Of a path that is nowhere what was shown, the same share counts as the way to it."""
        guide = guide_index(shown, GUIDE_START)
        path = self._generator.make(shown, start, shown[-1], guide, ToolObstacles(np.empty((0, 7)), ())).path
        tail = len(path) - guide_index(path, GUIDE_START) if self._generator.avoids else len(shown)
        return Relative(path, len(shown) - guide if self._generator.guided else min(tail, len(path)))

    def dual_arm_path(self, arms, q, ends, seen, dt) -> None:
        """Along their paths."""


class DecoupledMotion(ScrewMotion):
    """The method's mover; what one hand does seen from another is interpolated apart, too."""

    def relative(self, shown: PosePath, start: Pose) -> Relative:
        """See `MotionMethod`."""
        return GeneratedMotion(Decoupled()).relative(shown, start)


@dataclass(frozen=True, slots=True)
class GeneratedMotionSettings(ProgramSettings):
    """Of a policy that moves along the paths of a maker."""

    guard: bool = False

    @property
    @abstractmethod
    def generator(self) -> PathGenerator:
        """Of the paths."""

    @property
    def motion_method(self) -> MotionMethod:
        """See `ProgramSettings`."""
        return GeneratedMotion(self.generator)

    @property
    def plan(self) -> PlanSettings:
        """See `ProgramSettings`."""
        return PlanSettings(motion=self.motion, safety=self.safety, search=None, avoid=False, guard=self.guard)


@dataclass(frozen=True, slots=True)
class DecoupledSettings(GeneratedMotionSettings):
    """Of `decoupled`: the method without escape trees, search and guard, position and orientation apart.

    The blend is the controller's pull, as the method's is, not a path that is followed: a path would be left less
    freely, and the comparison would not be of the screw alone.
    """

    @property
    def generator(self) -> PathGenerator:
        """See `GeneratedMotionSettings`."""
        return Decoupled()

    @property
    def motion_method(self) -> MotionMethod:
        """See `ProgramSettings`."""
        return DecoupledMotion()

    @property
    def plan(self) -> PlanSettings:
        """See `ProgramSettings`."""
        motion = replace(self.motion, pursuit=replace(self.motion.pursuit, interpolation="decoupled"))
        return PlanSettings(motion=motion, safety=self.safety, search=None, avoid=False, guard=self.guard)


@dataclass(frozen=True, slots=True)
class ReplaySettings(GeneratedMotionSettings):
    """Of `replay`: the demonstration moved rigidly, a straight way to its beginning."""

    @property
    def generator(self) -> PathGenerator:
        """See `GeneratedMotionSettings`."""
        return Replay()


@dataclass(frozen=True, slots=True)
class PotentialSettings(GeneratedMotionSettings):
    """Of `potential`: TSIA in a potential field.

    Attributes:
        field: see `FieldSettings`.
    """

    field: FieldSettings = field(default_factory=FieldSettings)

    @property
    def generator(self) -> PathGenerator:
        """See `GeneratedMotionSettings`."""
        return Potential(self.field)


@dataclass(frozen=True, slots=True)
class DmpWorldSettings(GeneratedMotionSettings):
    """Of `dmp-world`: a primitive learned in the world's frame.

    Attributes:
        dmp: see `DmpSettings`.
    """

    dmp: DmpSettings = field(default_factory=DmpSettings)

    @property
    def generator(self) -> PathGenerator:
        """See `GeneratedMotionSettings`."""
        return Dmp(self.dmp, in_goal_frame=False)


@dataclass(frozen=True, slots=True)
class DmpGoalSettings(DmpWorldSettings):
    """Of `dmp-goal`: a primitive learned in the goal's frame."""

    @property
    def generator(self) -> PathGenerator:
        """See `GeneratedMotionSettings`."""
        return Dmp(self.dmp, in_goal_frame=True)
