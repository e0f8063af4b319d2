"""The seam between a task's program and how a leg is moved: plans in, plans followed.

A program says from where to where, along what, holding what, what may be touched. A mover plans such a leg and
follows it. The method's own is `SCREW`; the others of the comparison are in `opponents`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ...planner.geometry.pose import Pose, PosePath
from ...planner.geometry.shapes import Obstacle
from ...planner.imitation.tsia import GUIDE_START, final_path, guide_index
from ...planner.planning.plan import NextMotion, Plan
from ...planner.planning.planner import Planner
from ...planner.planning.settings import PlanSettings
from ...planner.reactive.command import Command, ReactiveSettings
from ...planner.reactive.reactive_planner import ReactivePlanner
from ...planner.robot.arm import Arm
from ...planner.robot.body import Body

DIRECT, ESCAPE, PATH, JOINTS = "direct", "escape", "path", "joints"
"""Of `Plan.how`: the last two are to be followed as they are."""
MADE = (PATH, JOINTS)


class MotionPlanner(Protocol):
    """Answers what `planner.planning.Planner` answers."""

    arm: Arm
    body: Body

    def plan(
        self,
        demonstrated: PosePath,
        start: ArrayLike,
        goal: Pose,
        obstacles: Sequence[Obstacle] = (),
        *,
        allowed: Sequence[tuple[str, str]] = (),
        leaving: PosePath | None = None,
        next_motion: NextMotion | None = None,
        seed: int = 0,
    ) -> Plan:
        """Plan a leg; see `Planner.plan`."""
        ...


class Follower(Protocol):
    """Does what `planner.reactive.ReactivePlanner` does."""

    body: Body
    settings: ReactiveSettings

    def hold(self, body: Body) -> None:
        """The body from now on; see `ReactivePlanner.hold`."""
        ...

    def see(self, obstacles: Sequence[Obstacle], allowed: Sequence[tuple[str, str]] = ()) -> None:
        """What is around now; see `ReactivePlanner.see`."""
        ...

    def go(
        self, path: PosePath, *, exact: bool = True, next_motion: NextMotion | None = None, detours: bool = True
    ) -> None:
        """Follow a path to its end; see `ReactivePlanner.go`."""
        ...

    def follow(self, plan: Plan, *, exact: bool = True) -> None:
        """Follow a plan that is to be followed as it is; see `ReactivePlanner.follow`."""
        ...

    def stop(self) -> None:
        """No leg; see `ReactivePlanner.stop`."""
        ...

    def step(self, q: ArrayLike) -> Command:
        """The command for joints q; see `ReactivePlanner.step`."""
        ...


class Relative(NamedTuple):
    """The motion of one hand seen from another.

    Attributes:
        path: from where it is now, to the end of what was shown.
        tail: how many of its last poses belong to the task; before, there is only the way to them.
    """

    path: PosePath
    tail: int


class MotionMethod(Protocol):
    """How a leg is moved."""

    def planner(self, arm: Arm, body: Body, settings: PlanSettings) -> MotionPlanner:
        """What plans legs."""
        ...

    def follower(self, arm: Arm, body: Body, settings: ReactiveSettings) -> Follower:
        """What follows them."""
        ...

    def skipped(self, done: int) -> int:
        """How many poses of a segment are left out that has been begun before the leg, as `MotionChoice.done` says."""
        ...

    def relative(self, shown: PosePath, start: Pose) -> Relative:
        """The same for what one hand does seen from another, far from obstacles.

        Args:
            shown: the relative path to its end.
            start: the relative pose now.
        """
        ...

    def dual_arm_path(
        self, arms: Sequence[Arm], q: np.ndarray, ends: Sequence[Pose], seen: Callable[[], np.ndarray], dt: float
    ) -> np.ndarray | str | None:
        """A way of two arms through joint space; None: they move along their paths.

        Args:
            arms: the arms.
            q: (2, dof) joints now.
            ends: where the two tcps must end.
            seen: gives both arms among obstacles, see `planner.robot_arrays`.
            dt: seconds per tick.

        Returns:
            (t, 2, dof) joints at every tick, or why there is no way.
        """
        ...


class ScrewMotion:
    """TSIA, REPET, the search in joint space, the safety layer; see `Planner` and `ReactivePlanner`."""

    def planner(self, arm: Arm, body: Body, settings: PlanSettings) -> MotionPlanner:
        """See `MotionMethod`."""
        return Planner(arm, body, settings)

    def follower(self, arm: Arm, body: Body, settings: ReactiveSettings) -> Follower:
        """See `MotionMethod`."""
        return ReactivePlanner(arm, body, settings)

    def skipped(self, done: int) -> int:
        """None: the guiding pose is behind them, at a fraction of the whole."""
        return 0

    def relative(self, shown: PosePath, start: Pose) -> Relative:
        """See `MotionMethod`."""
        guide = guide_index(shown, GUIDE_START)
        return Relative(final_path(start, shown, guide), len(shown) - guide)

    def dual_arm_path(self, arms, q, ends, seen, dt) -> None:
        """Along their paths."""


SCREW = ScrewMotion()
