"""Motions executed as if another frame of the hand were the tcp: level T.

The task's program stays in the frame of the true tcp, along which the fingers close. Planner and follower of a motion
get an arm with another tcp, and paths and goals converted to that frame; their results are converted back. Screw
motions are invariant to this; methods that decouple position and orientation of the hand move differently.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from ...planner import Arm, Body, Command, NextMotion, Plan, PlanRequest, PlanSettings, Pose, PosePath, ReactiveSettings
from ...planner.geometry import dualquat as dq
from ...planner.imitation.constraint import Constraint, Keeping
from ...planner.planning.plan import MotionPlanner
from ...planner.resumable import Resumable
from .motion_method import Follower, MotionMethod, Relative


def seen_from(plan: Plan, arm: Arm, tcp_from_other: Pose) -> Plan:
    """Convert a plan's poses to another frame of the hand.

    The escape tree is dropped: its planes refer to the original tcp.

    Args:
        plan: the plan.
        arm: the arm with the other frame as its tcp.
        tcp_from_other: the other frame in the frame of the plan's tcp.
    """
    asked = plan.request
    request = asked._replace(
        demonstrated=asked.demonstrated.with_tool(tcp_from_other),
        goal=_goal(asked, tcp_from_other),
        leaving=None if asked.leaving is None else asked.leaving.with_tool(tcp_from_other),
        next_motion=_next_motion(asked.next_motion, tcp_from_other),
    )
    imitated, path = (dq.mul(poses, tcp_from_other.dq) for poses in (plan.imitated_poses, plan.path_poses))
    return plan._replace(
        imitated_poses=imitated, path_poses=path, tree_rows=plan.tree_rows[:0], request=request, arm=arm
    )


def _goal(request: PlanRequest, tcp_from_other: Pose) -> Pose | ArrayLike:
    """Return the same goal for another tcp; joints are the same."""
    return request.goal @ tcp_from_other if isinstance(request.goal, Pose) else request.goal


class ToolFramePlanner(MotionPlanner):
    """Planner of motions in another frame of the hand; see `planner.planning.plan.MotionPlanner`.

    Args:
        planner: planner of the arm with that frame as its tcp.
        arm: arm with the true tcp.
        tcp_from_tool: the frame.
    """

    def __init__(self, planner: MotionPlanner, arm: Arm, tcp_from_tool: Pose):
        self.arm, self.body, self.settings = arm, planner.body, planner.settings
        self._planner, self._tool = planner, tcp_from_tool

    def answering(self, request: PlanRequest) -> Resumable[Plan]:
        """Plan a motion; see `MotionPlanner`."""
        tool, leaving = self._tool, request.leaving
        there = request._replace(
            demonstrated=request.demonstrated.with_tool(tool),
            goal=_goal(request, tool),
            leaving=None if leaving is None else leaving.with_tool(tool),
            next_motion=_next_motion(request.next_motion, tool),
        )
        plan = yield from self._planner.answering(there)
        return seen_from(plan, self.arm, tool.inverse())


class ToolFrameFollower:
    """Follower of motions in another frame of the hand; see `motion_method.Follower`.

    Args:
        follower: follower of the arm with that frame as its tcp.
        arm: that arm.
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
        """See `Follower`."""
        there, path = _next_motion(next_motion, self._tool), path.with_tool(self._tool)
        kept = None if constraint is None else constraint.with_tool(self._tool)
        self._follower.go(
            path,
            exact=exact,
            next_motion=there,
            detours=detours,
            must_keep=must_keep,
            constraint=kept,
            keeping=keeping,
        )

    def follow(self, plan: Plan, *, exact: bool = True) -> None:
        """See `Follower`."""
        self._follower.follow(seen_from(plan, self._arm, self._tool), exact=exact)

    def step(self, q: ArrayLike) -> Command:
        """See `Follower`."""
        return self._follower.step(q)

    def stand(self, q: ArrayLike) -> Command:
        """See `Follower`."""
        return self._follower.stand(q)


class ToolFrameMotion:
    """A motion method applied in another frame of the hand.

    With two hands, the relative path of one hand to the other is generated in this frame; both hands follow it by their
    true tcps.

    Args:
        motion_method: method of executing motions.
        tcp_from_tool: the frame; rotated at most about the tcp's z axis, the grasping direction of the sampler.
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
