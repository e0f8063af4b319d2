"""The baseline policies: identical programs, other methods of executing a motion.

By default none has a guard, since the original methods have none; `guard: true` gives each the project's own, which
shows the guard's share of the method's success.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field, replace

import numpy as np

from ...planner import Arm, Body, PlanSettings, Pose, PosePath, ReactiveSettings, guide_index
from ...planner.imitation.tsia import GUIDE_START
from .dmp import Dmp, DmpSettings
from .generated_follower import GeneratedFollower
from .generated_plan import GeneratedPlanner
from .motion_method import Follower, MotionMethod, MotionPlanner, Relative, ScrewMotion
from .path_generators import Decoupled, PathGenerator, Replay
from .potential import FieldSettings, Potential
from .settings import ProgramSettings
from .tool_obstacles import ToolObstacles


class GeneratedMotion:
    """Motions along the paths of a generator."""

    def __init__(self, generator: PathGenerator):
        self._generator = generator

    def planner(self, arm: Arm, body: Body, settings: PlanSettings) -> MotionPlanner:
        """See `MotionMethod`."""
        return GeneratedPlanner(arm, body, settings, self._generator)

    def follower(self, arm: Arm, body: Body, settings: ReactiveSettings) -> Follower:
        """See `MotionMethod`."""
        return GeneratedFollower(arm, body, settings, self._generator)

    def skipped(self, done: int) -> int:
        """Return `done` if the whole segment would be repeated; 0 if a guiding pose lies beyond the poses done."""
        return 0 if self._generator.guided else done

    def relative(self, shown: PosePath, start: Pose) -> Relative:
        """See `MotionMethod`. If the path never follows the demonstration, the same fraction counts as the approach."""
        guide = guide_index(shown, GUIDE_START)
        path = self._generator.make(shown, start, shown[-1], guide, ToolObstacles(np.empty((0, 7)), ())).path
        tail = len(path) - guide_index(path, GUIDE_START) if self._generator.avoids else len(shown)
        return Relative(path, len(shown) - guide if self._generator.guided else min(tail, len(path)))

    def dual_arm_path(self, arms, q, ends, seen, dt) -> None:
        """See `MotionMethod`: the arms follow their paths."""


class DecoupledMotion(ScrewMotion):
    """The project's own method; the relative motion of two hands is interpolated decoupled, too."""

    def relative(self, shown: PosePath, start: Pose) -> Relative:
        """See `MotionMethod`."""
        return GeneratedMotion(Decoupled()).relative(shown, start)


@dataclass(frozen=True, slots=True)
class GeneratedMotionSettings(ProgramSettings):
    """Settings of a policy that moves along the paths of a generator."""

    guard: bool = False

    @property
    @abstractmethod
    def generator(self) -> PathGenerator:
        """Generator of the paths."""

    @property
    def motion_method(self) -> MotionMethod:
        """See `ProgramSettings`."""
        return GeneratedMotion(self.generator)

    @property
    def plan(self) -> PlanSettings:
        """See `ProgramSettings`."""
        return PlanSettings(motion=self.motion, safety=self.safety, search=None, trees=False, guard=self.guard)


@dataclass(frozen=True, slots=True)
class DecoupledSettings(GeneratedMotionSettings):
    """Settings of `decoupled`: the method without escape trees, search and guard, position and orientation decoupled.

    The blend is produced by the controller's pull, as in the method, not by a path to follow: deviations from a path
    would be less free, and the comparison would not be of the screw alone.
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
        return PlanSettings(motion=motion, safety=self.safety, search=None, trees=False, guard=self.guard)


@dataclass(frozen=True, slots=True)
class ReplaySettings(GeneratedMotionSettings):
    """Settings of `replay`: the demonstration moved rigidly, after a straight path to its beginning."""

    @property
    def generator(self) -> PathGenerator:
        """See `GeneratedMotionSettings`."""
        return Replay()


@dataclass(frozen=True, slots=True)
class PotentialSettings(GeneratedMotionSettings):
    """Settings of `potential`: TSIA in a potential field.

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
    """Settings of `dmp-world`: a movement primitive learned in the world frame.

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
    """Settings of `dmp-goal`: a movement primitive learned in the goal's frame."""

    @property
    def generator(self) -> PathGenerator:
        """See `GeneratedMotionSettings`."""
        return Dmp(self.dmp, in_goal_frame=True)
