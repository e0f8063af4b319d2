"""What a planner is asked, how, and what it answers: settings, problems, plans.

A plan that is none has a `reason`, the kind of failure, and a `detail`, what in this case, for the reader:

| reason | what it says | detail |
|---|---|---|
| start beyond a joint limit | the arm stands where it may not | the joint |
| start in collision | the arm is closer to something than it must keep | part of the body, obstacle, distance |
| goal in collision | the tool would be, at the goal | the same |
| no room for a detour at the start | clear, but closer than detours are planned | the same |
| no room for a detour at the goal | the same of the goal | the same |
| no escape found | all escape trees have come to their end without seeing the path again | how many nodes |
| node limit reached | an escape tree was stopped at `RepetSettings.nodes`: more of them may help | the limit |
| the detours do not fit into the longest path allowed | see `RepetSettings.longest` | |
| ik_or_limit | there is a way for the tool that the arm does not follow to its end | |
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..control.arm_arrays import arm_arrays
from ..errors import PlanFailed
from ..escape.detour import GOAL_IN_COLLISION, START_IN_COLLISION
from ..escape.repet import REASONS, EscapeTree
from ..geometry.pose import Pose, PosePath
from ..geometry.shapes import Obstacle
from ..robot.arm import Arm
from ..robot.body import Body
from .planning_scene import PlanningScene
from .refine import SMOOTH_TOLERANCE, retimed, smoothed
from .settings import PlanSettings

ACCELERATION = 5.0
"""Limit of the joints' acceleration [rad/s^2] where none is given: about a third of what a Panda can do."""

WHY = {
    **REASONS,
    START_IN_COLLISION: "no room for a detour at the start",
    GOAL_IN_COLLISION: "no room for a detour at the goal",
}
"""Of an escape that was not found: start and goal have been seen to be clear before."""


class NextMotion(NamedTuple):
    """What comes after a leg, with the same body.

    Attributes:
        path: of the tcp.
        allowed: contacts that are wanted then, see `Planner.plan`.
        required: a plan from whose end it cannot be followed is only a fallback; else such ends are preferred in
            a search.
    """

    path: PosePath
    allowed: tuple[tuple[str, str], ...] = ()
    required: bool = False


class PlanRequest(NamedTuple):
    """What a plan is the answer to, besides the path.

    Attributes:
        arm: whose joints these are.
        body: its capsules, held object included.
        goal: of the tcp.
        obstacles: as they were.
        allowed: pairs of names that may touch.
        settings: of the planner.
        demonstrated: the segment that was to be imitated, where it was shown.
    """

    arm: Arm
    body: Body
    goal: Pose
    obstacles: tuple[Obstacle, ...]
    allowed: tuple[tuple[str, str], ...]
    settings: PlanSettings
    demonstrated: PosePath | None = None

    @property
    def scene(self) -> PlanningScene:
        """The arm among the obstacles."""
        return PlanningScene.of(self.arm, self.body, self.obstacles, self.settings, self.allowed)


class Plan(NamedTuple):
    """A planned leg.

    Attributes:
        joints: (t, dof) joints at every tick, from the start; only the start where nothing was found.
        dt: seconds between them.
        reason: "" if the plan arrives and every step of it is proven clear; else why there is none, see the module.
        how: "direct", "escape" or "joint search"; other makers of plans have other words, see `onedemo.baselines`.
        imitated_poses: (n, 8) of the demonstration moved to the goal.
        path_poses: (m, 8) of what was followed: the imitated path behind the guiding pose, or a detour.
        tree_rows: of the last escape tree; none if none was grown.
        detours: number of them.
        margin: smallest joint margin on the way [rad].
        changed: ticks in which the safety layer changed the command.
        tries: closed loops that were tried.
        seconds: that planning took.
        request: what it is the answer to.
        detail: what the reason is in this case; "" if there is no more to say.
        guide: index in the imitated path from which on it was to be followed.
        imitated_share: share of the imitated path behind the wanted guiding pose that is followed, by path length;
            above 1 where the plan joins it earlier.
        refined: what has been done to it since: "smooth", "timed".
        next_feasible: what must come next can be followed from its end.
    """

    joints: np.ndarray
    dt: float
    reason: str
    how: str
    imitated_poses: np.ndarray
    path_poses: np.ndarray
    tree_rows: np.ndarray
    detours: int
    margin: float
    changed: int
    tries: int
    seconds: float
    request: PlanRequest
    detail: str = ""
    guide: int = 0
    imitated_share: float = 1.0
    refined: tuple[str, ...] = ()
    next_feasible: bool = True

    @property
    def success(self) -> bool:
        """The plan arrives, and every step of it is proven clear."""
        return not self.reason

    @property
    def why(self) -> str:
        """Reason and detail in one line."""
        return f"{self.reason}: {self.detail}" if self.detail else self.reason

    @property
    def end_margin(self) -> float:
        """Distance of the last joints to a joint limit [rad]."""
        return self.request.arm.margin(self.joints[-1])

    @property
    def imitated(self) -> PosePath:
        """The demonstration moved to the goal."""
        return PosePath(self.imitated_poses)

    @property
    def path(self) -> PosePath:
        """What was followed: the imitated path behind the guiding pose, or a detour."""
        return PosePath(self.path_poses)

    @property
    def tree(self) -> EscapeTree | None:
        """The last escape tree, None if none was grown."""
        return EscapeTree.from_rows(self.tree_rows) if len(self.tree_rows) else None

    def smoothed(self, *, tolerance: float = SMOOTH_TOLERANCE) -> Plan:
        """The plan along a C1 curve of the tool that stays near its path, proven clear again.

        Args:
            tolerance: screw length [m] that poses of the path may be away from those the curve is laid through.

        Raises:
            PlanFailed: "plan_failed", there is no plan, it leads through joint space, or the curve is not clear or
                not followed to its end.
        """
        self._must_be_there("make smooth")
        if self.how == "joint search":
            raise PlanFailed("plan_failed", "a way through joint space has no path of the tool to make smooth")
        arm, motion = self.request.arm, self.request.settings.motion
        here = arm.fk(self.joints[0])
        path = PosePath(here.dq[None]).joined(self.path)
        work = arm_arrays(arm, motion.controller.packed(), motion.pursuit.packed())
        curve, joints, margin, changed = smoothed(
            path, self.joints[0], self.request.scene, work, motion.dt, self.request.settings.max_seconds, tolerance
        )
        return self._replace(
            joints=joints, path_poses=curve.dqs, margin=margin, changed=changed, refined=(*self.refined, "smooth")
        )

    def timed(self, acceleration_limits: ArrayLike = ACCELERATION) -> Plan:
        """The plan's joints on a C2 spline, as fast as velocity and acceleration limits allow, from rest to rest.

        Args:
            acceleration_limits: (dof,) or one number [rad/s^2].

        Raises:
            PlanFailed: "plan_failed", there is no plan, or the spline between its points is not clear.
        """
        self._must_be_there("time")
        joints = retimed(self.joints, self.dt, acceleration_limits, self.request.arm, self.request.scene).joints
        margin = min(self.request.arm.margin(q) for q in joints)
        # what is timed is no closed loop any more
        return self._replace(joints=joints, margin=margin, changed=0, refined=(*self.refined, "timed"))

    def refused(self, failure: PlanFailed) -> Plan:
        """What is left of the plan after its refinement has failed: no plan, with the reason."""
        return self._replace(joints=self.joints[:1], reason=failure.reason, detail=failure.detail)

    def _must_be_there(self, what: str) -> None:
        if not self.success:
            raise PlanFailed("plan_failed", f"there is no plan to {what}: {self.why}")


class Problem(NamedTuple):
    """A leg to plan; see `Planner.plan`."""

    demonstrated: PosePath
    start: np.ndarray
    goal: Pose
    obstacles: tuple[Obstacle, ...] = ()
    seed: int = 0
