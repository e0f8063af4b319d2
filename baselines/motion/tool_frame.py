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
from ...planner.planning.plan import Onward, Plan
from ...planner.planning.settings import PlanSettings
from ...planner.reactive.command import Command, ReactiveSettings
from ...planner.robot.arm import Arm
from ...planner.robot.body import Body
from .motion_method import Follower, LegPlanner, Mover, Relative


def seen_from(plan: Plan, arm: Arm, tcp_from_other: Pose) -> Plan:
    """A plan with its poses those of another frame of the hand, which is the tcp of the given arm.

    Its tree is left out: the planes of that are laid where the tcp was.
    """
    shown = plan.asked.demonstrated
    asked = plan.asked._replace(
        arm=arm,
        goal=plan.asked.goal @ tcp_from_other,
        demonstrated=None if shown is None else shown.with_tool(tcp_from_other),
    )
    imitated, path = (dq.mul(poses, tcp_from_other.dq) for poses in (plan.imitated_poses, plan.path_poses))
    return plan._replace(imitated_poses=imitated, path_poses=path, tree_rows=plan.tree_rows[:0], asked=asked)


class ToolPlanner:
    """Plans legs in another frame of the hand; see `mover.LegPlanner`.

    Args:
        planner: of the arm whose tcp is that frame.
        arm: with the true tcp.
        tcp_from_tool: the frame.
    """

    def __init__(self, planner: LegPlanner, arm: Arm, tcp_from_tool: Pose):
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
        onward: Onward | None = None,
        seed: int = 0,
    ) -> Plan:
        """Plan a leg; see `Planner.plan`."""
        tool, away = self._tool, None if leaving is None else leaving.with_tool(self._tool)
        plan = self._planner.plan(
            demonstrated.with_tool(tool), start, goal @ tool, obstacles,
            allowed=allowed, leaving=away, onward=_onward(onward, tool), seed=seed,
        )  # fmt: skip
        return seen_from(plan, self.arm, tool.inverse())


class ToolFollower:
    """Follows legs in another frame of the hand; see `mover.Follower`.

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
        self, path: PosePath, *, loosely: bool = False, onward: Onward | None = None, strictly: bool = False
    ) -> None:
        """See `Follower`."""
        there = _onward(onward, self._tool)
        self._follower.go(path.with_tool(self._tool), loosely=loosely, onward=there, strictly=strictly)

    def follow(self, plan: Plan, *, loosely: bool = False) -> None:
        """See `Follower`."""
        self._follower.follow(seen_from(plan, self._arm, self._tool), loosely=loosely)

    def step(self, q: ArrayLike) -> Command:
        """See `Follower`."""
        return self._follower.step(q)


class ToolMover:
    """A mover whose legs are moved in another frame of the hand.

    With two hands this is the frame in which the way of the one is made, seen from the other; both follow it by their
    true tcps.

    Args:
        mover: how legs are moved.
        tcp_from_tool: the frame; turned about the tcp's z axis at most, along which the sampler takes things.
    """

    def __init__(self, mover: Mover, tcp_from_tool: Pose):
        self._mover, self._tool = mover, tcp_from_tool

    def planner(self, arm: Arm, body: Body, settings: PlanSettings) -> LegPlanner:
        """See `Mover`."""
        return ToolPlanner(self._mover.planner(arm.with_tool(self._tool), body, settings), arm, self._tool)

    def follower(self, arm: Arm, body: Body, settings: ReactiveSettings) -> Follower:
        """See `Mover`."""
        there = arm.with_tool(self._tool)
        return ToolFollower(self._mover.follower(there, body, settings), there, self._tool)

    def skipped(self, done: int) -> int:
        """See `Mover`."""
        return self._mover.skipped(done)

    def relative(self, shown: PosePath, start: Pose) -> Relative:
        """See `Mover`."""
        found = self._mover.relative(shown.with_tool(self._tool), start @ self._tool)
        return found._replace(path=found.path.with_tool(self._tool.inverse()))

    def way_of_two(
        self, arms: Sequence[Arm], q: np.ndarray, ends: Sequence[Pose], seen: Callable[[], np.ndarray], dt: float
    ) -> np.ndarray | str | None:
        """See `Mover`."""
        there = [arm.with_tool(self._tool) for arm in arms]
        return self._mover.way_of_two(there, q, [end @ self._tool for end in ends], seen, dt)


def _onward(onward: Onward | None, tcp_from_tool: Pose) -> Onward | None:
    return None if onward is None else onward._replace(path=onward.path.with_tool(tcp_from_tool))
