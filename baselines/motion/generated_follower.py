"""Following of generated paths, without replanning and by default without guard, by the method's own controller.

A generator that avoids obstacles works online, as its authors intend: while obstacles move or appear, the rest of the
path is generated anew ten times a second from its present state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...planner import (
    Arm,
    Body,
    Command,
    NextMotion,
    Obstacle,
    Plan,
    Pose,
    PosePath,
    ReactivePlanner,
    ReactiveSettings,
    guide_index,
)
from ...planner.control.arm_arrays import PURSUIT_STATE
from ...planner.imitation.constraint import Constraint, Keeping
from ...planner.planning.plan import check_success
from ...planner.reactive.motion_state import MotionState
from ...planner.resumable import CALL, Resumable
from .motion_method import PATH
from .path_generators import GeneratedPath, PathGenerator
from .tool_obstacles import ToolObstacles

RENEWED = 0.1
"""Time [s] between two paths while obstacles move."""


class _Generation(NamedTuple):
    """Arguments of a path generator for one motion: demonstrated path, goal, index of the guiding pose."""

    demonstrated: PosePath
    goal: Pose
    guide: int


class GeneratedFollower(ReactivePlanner):
    """Follows the paths of a path generator, without detours of its own.

    Args:
        arm: the arm.
        body: its capsules, held object included.
        settings: see `ReactiveSettings`; detours, search and prediction are switched off.
        generator: generator of the paths.
    """

    def __init__(self, arm: Arm, body: Body, settings: ReactiveSettings, generator: PathGenerator):
        self._generator = generator
        self._task: _Generation | None = None
        self._generated: GeneratedPath | None = None
        self._outdated, self._age = False, 0.0
        plan = replace(settings.plan, trees=False, search=None)
        super().__init__(arm, body, replace(settings, plan=plan, horizon=0.0))

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
        """See `ReactivePlanner`: the path, from about where the arm is, is the demonstrated path, its end the goal."""
        super().go(path, exact=exact, detours=detours)
        self._task, self._generated = _Generation(path, path[-1], guide_index(path, 0.0)), None

    def follow(self, plan: Plan, *, exact: bool = True) -> None:
        """See `Follower`: as planned, with the path generated anew from the present pose of the arm."""
        if plan.how != PATH:  # a generated path is tried even if the arm did not follow it when planning
            check_success(plan, "follow")
        super().go(plan.path, exact=exact)
        self._task, self._generated = _Generation(plan.request.demonstrated, plan.goal_pose, plan.guide), None

    def stop(self) -> None:
        """See `ReactivePlanner`."""
        super().stop()
        self._task = self._generated = None

    def step(self, q: ArrayLike) -> Command:
        """See `ReactivePlanner`."""
        motion = self.motion
        if motion is not None and self._generated is None:
            self._begin(motion, np.asarray(q, dtype=np.float64))
        elif motion is not None and self._generator.avoids:
            self._renew(motion)
        return super().step(q)

    def _begin(self, motion: MotionState, q: np.ndarray) -> None:
        assert self._task is not None
        shown, goal, guide = self._task
        self._generated = self._generator.make(shown, self.arm.fk(q), goal, guide, self._near())
        self._outdated, self._age, motion.plan_now = False, 0.0, False
        motion.pursue(self._generated.path, detour=False)

    def _renew(self, motion: MotionState) -> None:
        """Generate the rest of the path anew, if an obstacle has moved since and it is time."""
        self._age += self.settings.plan.motion.dt
        if (self._outdated or self._moving) and self._age >= RENEWED:
            assert self._generated is not None
            index = min(int(motion.pursuit[PURSUIT_STATE.reference]), len(self._generated.path) - 1)
            self._generated = self._generator.renewed(self._generated, index, self._near())
            motion.path, self._outdated, self._age = self._generated.path, False, 0.0

    def _near(self) -> ToolObstacles:
        return ToolObstacles.of(self.arm, self.body, self._obstacles, self._known_allowed(self._obstacles))

    def _replan(self, q: np.ndarray, obstacles: Sequence[Obstacle]) -> Resumable[None]:
        yield CALL
        self._outdated = True
