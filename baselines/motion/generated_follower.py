"""Following what a path maker makes: no planning anew, by default no guard; the same controller as the method's.

A maker that avoids works online, as its authors mean it: while obstacles move or appear, the rest of the path is made
anew ten times a second from the state it is in.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ...planner.control.pursuit import INDEX
from ...planner.geometry.pose import Pose, PosePath
from ...planner.geometry.shapes import Obstacle
from ...planner.imitation.tsia import guide_index
from ...planner.planning.plan import NextMotion, Plan
from ...planner.reactive.command import Command, ReactiveSettings
from ...planner.reactive.reactive_planner import ReactivePlanner
from ...planner.robot.arm import Arm
from ...planner.robot.body import Body
from .path_generators import GeneratedPath, PathGenerator
from .tool_obstacles import ToolObstacles

RENEWED = 0.1
"""Seconds between two paths while obstacles move."""


class GeneratedFollower(ReactivePlanner):
    """A `ReactivePlanner` that follows the paths of a maker, and leads them round nothing."""

    def __init__(self, arm: Arm, body: Body, settings: ReactiveSettings, generator: PathGenerator):
        self._generator, self._leg, self._made, self._old, self._age = generator, None, None, False, 0.0
        plan = replace(settings.plan, avoid=False, search=None)
        super().__init__(arm, body, replace(settings, plan=plan, horizon=0.0))

    def go(
        self, path: PosePath, *, exact: bool = True, next_motion: NextMotion | None = None, detours: bool = True
    ) -> None:
        """A leg along a path that begins about where the arm is: it is what is shown, and its end is the goal."""
        super().go(path, exact=exact, detours=detours)
        self._leg, self._made = (path, path[-1], guide_index(path, 0.0)), None

    def follow(self, plan: Plan, *, exact: bool = True) -> None:
        """A leg as it was planned, made anew from exactly where the arm is."""
        super().go(plan.path, exact=exact)
        assert plan.request.demonstrated is not None
        self._leg, self._made = (plan.request.demonstrated, plan.request.goal, plan.guide), None

    def stop(self) -> None:
        """See `ReactivePlanner`."""
        super().stop()
        self._leg = None

    def step(self, q: ArrayLike) -> Command:
        """See `ReactivePlanner`."""
        if self._leg is not None and self._made is None:
            self._restart(self._begun(self._leg, np.asarray(q, dtype=np.float64)).path)
        elif self._made is not None and self._generator.avoids:
            self._renew()
        return super().step(q)

    def _begun(self, leg: tuple[PosePath, Pose, int], q: np.ndarray) -> GeneratedPath:
        shown, goal, guide = leg
        made = self._generator.make(shown, self.arm.fk(q), goal, guide, self._near())
        self._made, self._plan_now, self._old, self._age = made, False, False, 0.0
        return made

    def _renew(self) -> None:
        """The rest of the path anew, if something has moved since and it is time."""
        self._age += self.settings.plan.motion.dt
        if (self._old or self._moving) and self._age >= RENEWED:
            assert self._made is not None
            index = min(int(self._pursuit_state[INDEX]), len(self._made.path) - 1)
            self._made = self._generator.renewed(self._made, index, self._near())
            self._path, self._old, self._age = self._made.path, False, 0.0

    def _near(self) -> ToolObstacles:
        return ToolObstacles.of(self.arm, self.body, self._obstacles, self._known_allowed(self._obstacles))

    def _replan(self, q: np.ndarray, obstacles: Sequence[Obstacle]) -> None:
        self._plan_now, self._old = False, True
