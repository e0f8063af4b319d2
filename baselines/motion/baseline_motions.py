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
from .generated_follower import MadeFollower
from .generated_plan import MadePlanner
from .motion_method import Follower, LegPlanner, Mover, Relative, ScrewMover
from .path_generators import Decoupled, Maker, Replay
from .potential import FieldSettings, Potential
from .settings import ProgramSettings
from .tool_obstacles import NearTool


class MadeMover:
    """Legs moved along the paths of a maker."""

    def __init__(self, maker: Maker):
        self._maker = maker

    def planner(self, arm: Arm, body: Body, settings: PlanSettings) -> LegPlanner:
        """See `Mover`."""
        return MadePlanner(arm, body, settings, self._maker)

    def follower(self, arm: Arm, body: Body, settings: ReactiveSettings) -> Follower:
        """See `Mover`."""
        return MadeFollower(arm, body, settings, self._maker)

    def skipped(self, done: int) -> int:
        """All where the whole segment would be done again; none where there is a guiding pose behind them."""
        return 0 if self._maker.guided else done

    def relative(self, shown: PosePath, start: Pose) -> Relative:
        """See `Mover`. Of a path that is nowhere what was shown, the same share counts as the way to it."""
        guide = guide_index(shown, GUIDE_START)
        path = self._maker.make(shown, start, shown[-1], guide, NearTool(np.empty((0, 7)), ())).path
        tail = len(path) - guide_index(path, GUIDE_START) if self._maker.avoids else len(shown)
        return Relative(path, len(shown) - guide if self._maker.guided else min(tail, len(path)))

    def way_of_two(self, arms, q, ends, seen, dt) -> None:
        """Along their paths."""


class DecoupledMover(ScrewMover):
    """The method's mover; what one hand does seen from another is interpolated apart, too."""

    def relative(self, shown: PosePath, start: Pose) -> Relative:
        """See `Mover`."""
        return MadeMover(Decoupled()).relative(shown, start)


@dataclass(frozen=True, slots=True)
class MadeSettings(ProgramSettings):
    """Of a policy that moves along the paths of a maker."""

    guard: bool = False

    @property
    @abstractmethod
    def maker(self) -> Maker:
        """Of the paths."""

    @property
    def mover(self) -> Mover:
        """See `ProgramSettings`."""
        return MadeMover(self.maker)

    @property
    def plan(self) -> PlanSettings:
        """See `ProgramSettings`."""
        return PlanSettings(motion=self.motion, safety=self.safety, search=None, avoid=False, guard=self.guard)


@dataclass(frozen=True, slots=True)
class DecoupledSettings(MadeSettings):
    """Of `decoupled`: the method without escape trees, search and guard, position and orientation apart.

    The blend is the controller's pull, as the method's is, not a path that is followed: a path would be left less
    freely, and the comparison would not be of the screw alone.
    """

    @property
    def maker(self) -> Maker:
        """See `MadeSettings`."""
        return Decoupled()

    @property
    def mover(self) -> Mover:
        """See `ProgramSettings`."""
        return DecoupledMover()

    @property
    def plan(self) -> PlanSettings:
        """See `ProgramSettings`."""
        motion = replace(self.motion, pursuit=replace(self.motion.pursuit, pull="apart"))
        return PlanSettings(motion=motion, safety=self.safety, search=None, avoid=False, guard=self.guard)


@dataclass(frozen=True, slots=True)
class ReplaySettings(MadeSettings):
    """Of `replay`: the demonstration moved rigidly, a straight way to its beginning."""

    @property
    def maker(self) -> Maker:
        """See `MadeSettings`."""
        return Replay()


@dataclass(frozen=True, slots=True)
class PotentialSettings(MadeSettings):
    """Of `potential`: TSIA in a potential field.

    Attributes:
        field: see `FieldSettings`.
    """

    field: FieldSettings = field(default_factory=FieldSettings)

    @property
    def maker(self) -> Maker:
        """See `MadeSettings`."""
        return Potential(self.field)


@dataclass(frozen=True, slots=True)
class DmpWorldSettings(MadeSettings):
    """Of `dmp-world`: a primitive learned in the world's frame.

    Attributes:
        dmp: see `DmpSettings`.
    """

    dmp: DmpSettings = field(default_factory=DmpSettings)

    @property
    def maker(self) -> Maker:
        """See `MadeSettings`."""
        return Dmp(self.dmp, in_goal_frame=False)


@dataclass(frozen=True, slots=True)
class DmpGoalSettings(DmpWorldSettings):
    """Of `dmp-goal`: a primitive learned in the goal's frame."""

    @property
    def maker(self) -> Maker:
        """See `MadeSettings`."""
        return Dmp(self.dmp, in_goal_frame=True)
