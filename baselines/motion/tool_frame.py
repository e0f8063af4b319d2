"""Legs as they would be moved if another frame of the hand were its tcp: level T.

The task's program stays in the true tcp's frame, which its fingers close along. What plans and follows a leg gets an
arm whose tcp is elsewhere, and paths and goals as they are seen from there; what it answers is seen from the true tcp
again. Screws do not care; what moves a point of the hand straight, and its orientation apart, moves another point.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from ...planner.geometry import dualquat as dq
from ...planner.geometry.pose import Pose, PosePath
from ...planner.geometry.shapes import Obstacle
from ...planner.planning.plan import NextMotion, Plan
from ...planner.planning.settings import PlanSettings
from ...planner.reactive.command import Command, ReactiveSettings
from ...planner.robot.arm import Arm
from ...planner.robot.body import Body
from .motion_method import Follower, MotionMethod, MotionPlanner, Relative


def seen_from(plan: Plan, arm: Arm, tcp_from_other: Pose) -> Plan:
    """A plan with its poses those of another frame of the hand, which is the tcp of the given arm.

    Its tree is left out: the planes of that are laid where the tcp was.
    """
    shown = plan.request.demonstrated
    asked = plan.request._replace(
        arm=arm,
        goal=plan.request.goal @ tcp_from_other,
        demonstrated=None if shown is None else shown.with_tool(tcp_from_other),
    )
    imitated, path = (dq.mul(poses, tcp_from_other.dq) for poses in (plan.imitated_poses, plan.path_poses))
    return plan._replace(imitated_poses=imitated, path_poses=path, tree_rows=plan.tree_rows[:0], asked=asked)


class ToolFramePlanner:
    """Plans legs in another frame of the hand; see `motion_method.MotionPlanner`.

    Args:
        planner: of the arm whose tcp is that frame.
        arm: with the true tcp.
        tcp_from_tool: the frame.
    """

    def __init__(self, planner: MotionPlanner, arm: Arm, tcp_from_tool: Pose):
        self.arm, self.body, self._planner, self._tool = arm, planner.body, planner, tcp_from_tool

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
        tool, away = self._tool, None if leaving is None else leaving.with_tool(self._tool)
        plan = self._planner.plan(
            demonstrated.with_tool(tool), start, goal @ tool, obstacles,
            allowed=allowed, leaving=away, next_motion=_next_motion(next_motion, tool), seed=seed,
        )  # fmt: skip
        return seen_from(plan, self.arm, tool.inverse())


class ToolFrameFollower:
    """Follows legs in another frame of the hand; see `motion_method.Follower`.

    Args:
        follower: of the arm whose tcp is that frame.
        arm: this arm.
        tcp_from_tool: the frame.
    """

    def __init__(self, follower: Follower, arm: Arm, tcp_from_tool: Pose):
        self._follower, self._arm, self._tool = follower, arm, tcp_from_tool
        self.body, self.settings = follower.body, follower.settings
        self.see, self.stop = follower.see, follower.stop

    def hold(self, body: Body) -> None:
        """See `Follower`."""
        self.body = body
        self._follower.hold(body)

    def go(
        self, path: PosePath, *, exact: bool = True, next_motion: NextMotion | None = None, detours: bool = True
    ) -> None:
        """See `Follower`."""
        there = _next_motion(next_motion, self._tool)
        self._follower.go(path.with_tool(self._tool), exact=exact, next_motion=there, detours=detours)

    def follow(self, plan: Plan, *, exact: bool = True) -> None:
        """See `Follower`."""
        self._follower.follow(seen_from(plan, self._arm, self._tool), exact=exact)

    def step(self, q: ArrayLike) -> Command:
        """See `Follower`."""
        return self._follower.step(q)


class ToolFrameMotion:
    """A mover whose legs are moved in another frame of the hand.

    With two hands this is the frame in which the way of the one is made, seen from the other; both follow it by their
    true tcps.

    Args:
        motion_method: how legs are moved.
        tcp_from_tool: the frame; turned about the tcp's z axis at most, along which the sampler takes things.
    """

    def __init__(self, motion_method: MotionMethod, tcp_from_tool: Pose):
        self._motion_method, self._tool = motion_method, tcp_from_tool

    def planner(self, arm: Arm, body: Body, settings: PlanSettings) -> MotionPlanner:
        """See `MotionMethod`."""
        return ToolFramePlanner(self._motion_method.planner(arm.with_tool(self._tool), body, settings), arm, self._tool)

    def follower(self, arm: Arm, body: Body, settings: ReactiveSettings) -> Follower:
        """See `MotionMethod`."""
        there = arm.with_tool(self._tool)
        return ToolFrameFollower(self._motion_method.follower(there, body, settings), there, self._tool)

    def skipped(self, done: int) -> int:
        """See `MotionMethod`."""
        return self._motion_method.skipped(done)

    def relative(self, shown: PosePath, start: Pose) -> Relative:
        """See `MotionMethod`."""
        found = self._motion_method.relative(shown.with_tool(self._tool), start @ self._tool)
        return found._replace(path=found.path.with_tool(self._tool.inverse()))

    def dual_arm_path(
        self, arms: Sequence[Arm], q: np.ndarray, ends: Sequence[Pose], seen: Callable[[], np.ndarray], dt: float
    ) -> np.ndarray | str | None:
        """See `MotionMethod`."""
        there = [arm.with_tool(self._tool) for arm in arms]
        return self._motion_method.dual_arm_path(there, q, [end @ self._tool for end in ends], seen, dt)


def _next_motion(next_motion: NextMotion | None, tcp_from_tool: Pose) -> NextMotion | None:
    return None if next_motion is None else next_motion._replace(path=next_motion.path.with_tool(tcp_from_tool))
