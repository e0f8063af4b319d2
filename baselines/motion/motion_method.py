"""The interface between a task's program and the method of moving: motions are planned, and plans followed.

A program states start, goals, demonstrated segment, held object and allowed contacts. A motion method plans such a
motion and follows it. The project's own method is `SCREW`; the baselines are in `baseline_motions`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ...planner import (
    Arm,
    Body,
    Command,
    NextMotion,
    Obstacle,
    Plan,
    Planner,
    PlanSettings,
    Pose,
    PosePath,
    ReactivePlanner,
    ReactiveSettings,
    final_path,
    guide_index,
)
from ...planner.imitation.constraint import Constraint, Keeping
from ...planner.imitation.tsia import GUIDE_START
from ...planner.planning.plan import MotionPlanner

DIRECT, ESCAPE, PATH, JOINTS = "direct", "escape", "path", "joints"
"""Values of `Plan.how`; the last two are of generated paths and of RRT-Connect. A plan of `Planner` found by its own
search in joint space has "joint search"."""
NO_PATH = "no way found"
"""Reason of a plan whose generator or search found no path."""
MADE = (PATH, JOINTS)


class Follower(Protocol):
    """Interface of `planner.reactive.ReactivePlanner`."""

    body: Body
    settings: ReactiveSettings

    def hold(self, body: Body) -> None:
        """Set the body; see `ReactivePlanner.hold`."""
        ...

    def see(self, obstacles: Sequence[Obstacle], allowed: Sequence[tuple[str, str]] = ()) -> None:
        """See `ReactivePlanner.see`: set the present obstacles and allowed contacts."""
        ...

    def go(
        self,
        path: PosePath,
        *,
        exact: bool = True,
        next_motion: NextMotion | None = None,
        detours: bool = True,
        must_keep: bool = False,
        constraint: Constraint | None = None,
        keeping: Keeping | None = None,
    ) -> None:
        """See `ReactivePlanner.go`: follow a path to its end."""
        ...

    def follow(self, plan: Plan, *, exact: bool = True) -> None:
        """See `ReactivePlanner.follow`: follow the path of a plan."""
        ...

    def stop(self) -> None:
        """End the motion; see `ReactivePlanner.stop`."""
        ...

    def step(self, q: ArrayLike) -> Command:
        """Return the command for joints q (dof,); see `ReactivePlanner.step`."""
        ...

    def stand(self, q: ArrayLike) -> Command:
        """Return the command of standing still during a motion at joints q (dof,); see `ReactivePlanner.stand`."""
        ...


class Relative(NamedTuple):
    """Motion of one hand in the frame of another.

    Attributes:
        path: path from the present relative pose to the end of the demonstrated one.
        tail: number of last poses that belong to the task; the poses before are the approach.
    """

    path: PosePath
    tail: int


class MotionMethod(Protocol):
    """Method of executing a motion."""

    def planner(self, arm: Arm, body: Body, settings: PlanSettings) -> MotionPlanner:
        """Create a planner of motions.

        Args:
            arm: the arm.
            body: its capsules, held objects included.
            settings: see `PlanSettings`.
        """
        ...

    def follower(self, arm: Arm, body: Body, settings: ReactiveSettings) -> Follower:
        """Create a follower of motions.

        Args:
            arm: the arm.
            body: its capsules, held objects included.
            settings: see `ReactiveSettings`.
        """
        ...

    def skipped(self, done: int) -> int:
        """Return the number of poses to skip of a segment already begun, see `MotionChoice.done`."""
        ...

    def relative(self, shown: PosePath, start: Pose) -> Relative:
        """Return the relative motion of two hands, far from obstacles.

        Args:
            shown: the demonstrated relative path to its end.
            start: the present relative pose.
        """
        ...

    def dual_arm_path(
        self, arms: Sequence[Arm], q: np.ndarray, ends: Sequence[Pose], seen: Callable[[], np.ndarray], dt: float
    ) -> np.ndarray | str | None:
        """Plan a path of two arms through joint space; None: the arms move along their paths.

        Args:
            arms: the arms.
            q: (2, dof) present joints [rad].
            ends: goals of the two tcps.
            seen: returns both arms among obstacles, see `planner.collision.robot_arrays`.
            dt: seconds per tick.

        Returns:
            (t, 2, dof) joints at every tick, or the reason of failure.
        """
        ...


class ScrewMotion:
    """TSIA, REPET, search in joint space and safety layer; see `Planner` and `ReactivePlanner`."""

    def planner(self, arm: Arm, body: Body, settings: PlanSettings) -> MotionPlanner:
        """See `MotionMethod`."""
        return Planner(arm, body, settings)

    def follower(self, arm: Arm, body: Body, settings: ReactiveSettings) -> Follower:
        """See `MotionMethod`."""
        return ReactivePlanner(arm, body, settings)

    def skipped(self, done: int) -> int:
        """Return 0: the guiding pose, at a fraction of the whole, lies beyond the poses already done."""
        return 0

    def relative(self, shown: PosePath, start: Pose) -> Relative:
        """See `MotionMethod`."""
        guide = guide_index(shown, GUIDE_START)
        return Relative(final_path(start, shown, guide), len(shown) - guide)

    def dual_arm_path(self, arms, q, ends, seen, dt) -> None:
        """See `MotionMethod`: the arms follow their paths."""


SCREW = ScrewMotion()
