"""Requests and plans: what a planner is asked, and what it answers.

A failed plan has a `reason`, the kind of failure, and a `detail`, the facts of this case for the reader. Where a
search in joint space was the last to fail, the reason is the search's.

| reason | meaning | detail |
|---|---|---|
| start beyond a joint limit | a joint of the start lies outside its limits | the joint |
| start in collision | at the start the arm is closer to something than its margin | part, obstacle, distance |
| goal beyond a joint limit | a joint of a goal given as joints lies outside its limits | the joint |
| goal in collision | as at the start, for the tool at a pose, for the arm at joints | part, obstacle, distance |
| no room for a detour at the start | the start is clear, but too close for detours | part, obstacle, distance |
| no room for a detour at the goal | the goal is clear, but too close for detours | part, obstacle, distance |
| no escape found | no escape tree saw the path again | number of nodes |
| node limit reached | an escape tree stopped at `RepetSettings.nodes`: more nodes may help | the limit |
| the detours do not fit into the longest path allowed | see `RepetSettings.longest` | the limit |
| ik_or_limit | the goal is out of reach, or the arm follows no path to it | how far it reaches, or what limits it |
| no clear posture | all postures that a search in joint space found are in collision | part, obstacle, distance |
| no path in joint space | a search in joint space found postures, but no path | number of postures |
| nothing of the demonstration is kept | though the request asks for it, see `PlanRequest.must_keep` | the way found |
| what the demonstration keeps is violated | though it must be kept | what would have to give, by how much |
| an allowed contact is deeper on the way | than at the motion's ends, by more than 5 mm | |
| no path to the goal joints | neither the tool's path nor a search in joint space leads there | number of searches |
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import checked_items, checked_kind
from ..constraints.violation import NONE_VIOLATED, Violation
from ..errors import BadOption, PlanFailed
from ..escape.detour import GOAL_IN_COLLISION, START_IN_COLLISION
from ..escape.repet import REASONS, EscapeTree
from ..geometry.pose import Pose, PosePath
from ..geometry.shapes import Obstacle
from ..imitation.constraint import Constraint, Keeping
from ..imitation.demonstration import Demonstration
from ..imitation.segment_path import segment_of
from ..log.motion_log import MotionLog
from ..resumable import Resumable, finished
from ..robot.arm import Arm
from ..robot.body import Body
from ..safety.robot_checks import checked_contacts
from .settings import PlanSettings

WHY = {
    **REASONS,
    START_IN_COLLISION: "no room for a detour at the start",
    GOAL_IN_COLLISION: "no room for a detour at the goal",
}
"""Reason of a plan for each status of an escape that failed; start and goal were found clear before."""


class NextMotion(NamedTuple):
    """The motion that follows a plan, with the same body.

    Attributes:
        path: of the tcp.
        allowed: contacts that are wanted during it; see `PlanRequest.allowed`.
        required: a plan from whose end the motion cannot be followed is only a fallback; else such ends are merely
            less preferred by the search in joint space.
    """

    path: PosePath
    allowed: tuple[tuple[str, str], ...] = ()
    required: bool = False


class PlanRequest(NamedTuple):
    """A motion to plan.

    Attributes:
        demonstrated: the path of the tcp to imitate, any number of poses; of very long paths poses at even steps of
            their length are taken, see `Plan.reduction`.
        start: (dof,) joints now.
        goal: pose of the tcp at the end, or (dof,) joints at the end.
        obstacles: as they are now; they are taken to stand still.
        allowed: pairs of names (part of the body or held object, obstacle) that may touch, but for 5 mm no deeper than
            at the motion's ends.
        leaving: path of the tcp from its pose at `start` on, by which the start is left; None: blend at once.
        next_motion: the motion that follows, if it is known.
        seed: of all random choices; the same seed gives the same plan.
        must_keep: a plan that keeps nothing of the demonstrated path behind the guiding pose is a failure: how things
            are moved matters, not only where they end.
        constraint: what the demonstrated path keeps; None: what is found in it if the body holds something.
        keeping: how it is kept, see `PlanSettings.keeping`; None: as the settings say.
    """

    demonstrated: PosePath
    start: ArrayLike
    goal: Pose | ArrayLike
    obstacles: tuple[Obstacle, ...] = ()
    allowed: tuple[tuple[str, str], ...] = ()
    leaving: PosePath | None = None
    next_motion: NextMotion | None = None
    seed: int = 0
    must_keep: bool = False
    constraint: Constraint | None = None
    keeping: Keeping | None = None


def pose_goal(request: PlanRequest) -> Pose:
    """Return the goal of a request to a planner that only takes poses.

    Raises:
        BadOption: the goal is given as joints.
    """
    if not isinstance(request.goal, Pose):
        raise BadOption("goal", "is given as joints; this planner takes a Pose of the tcp")
    return request.goal


class Plan(NamedTuple):
    """A planned motion, with all that is needed to check it.

    Attributes:
        joints: (t, dof) joints at every tick, from the start; only the start if the plan failed.
        dt: seconds between them.
        reason: "" if the plan arrives and every step of it is proven clear; else the kind of failure, see the module.
        how: "direct", "escape" or "joint search"; other planners have other words, see `onedemo.baselines`.
        imitated_poses: (n, 8) of the demonstrated path moved to the goal.
        path_poses: (m, 8) of the path that was followed: the imitated path from the guiding pose on, or a detour.
        tree_rows: rows of the last escape tree; none if none was grown.
        detours: number of detours.
        margin: smallest joint margin [rad] on the motion.
        changed: number of ticks in which the safety layer changed the command.
        tries: number of closed loops that were tried.
        seconds: planning time.
        request: the request that the plan answers.
        arm: whose joints these are.
        body: its capsules, held object included.
        settings: of the planner.
        detail: the facts of the failure; "" if there is no more to say.
        guide: index of the guiding pose in the imitated path.
        imitated_share: share of the imitated path behind the wanted guiding pose that is followed, by path length;
            above 1 where the plan joins the path earlier.
        refined: refinements made since: "smooth", "timed".
        next_feasible: False if a required next motion cannot be followed from the end of the plan.
        reduction: largest weighted distance [m] of the demonstrated path from the poses of it that were planned with,
            see `planner.imitation.reduction`; 0: all of them were, see `RepetSettings.longest`.
        constraint: what should be kept of the demonstrated path; None: nothing.
        violation: how far the motion violates it; of a failed plan that of the best motion found, if there was one.
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
    arm: Arm
    body: Body
    settings: PlanSettings
    detail: str = ""
    guide: int = 0
    imitated_share: float = 1.0
    refined: tuple[str, ...] = ()
    next_feasible: bool = True
    reduction: float = 0.0
    constraint: Constraint | None = None
    violation: Violation = NONE_VIOLATED

    @property
    def success(self) -> bool:
        """True if the plan arrives and every step of it is proven clear."""
        return not self.reason

    @property
    def keeps(self) -> bool:
        """True unless nothing of the demonstrated path is kept though some of it must be."""
        return not self.request.must_keep or self.imitated_share > 0.0

    @property
    def keeps_all(self) -> bool:
        """True if something of the demonstrated path is kept, where it must be, and the constraint is, too."""
        return self.keeps and self.violation.kept

    @property
    def why(self) -> str:
        """Reason and detail in one line."""
        return f"{self.reason}: {self.detail}" if self.detail else self.reason

    @property
    def end_margin(self) -> float:
        """Joint margin [rad] at the end."""
        return self.arm.margin(self.joints[-1])

    def kept_along(self, path: PosePath) -> dict[str, Any]:
        """Return what is kept along the last part of the plan's path, as arguments of `ReactivePlanner.go`."""
        kept = None if self.constraint is None else self.constraint.ending(len(path))
        return {"constraint": kept, "keeping": self.request.keeping}

    @property
    def goal_pose(self) -> Pose:
        """Pose of the tcp at the goal."""
        goal = self.request.goal
        return goal if isinstance(goal, Pose) else self.arm.fk(goal)

    @property
    def imitated(self) -> PosePath:
        """The demonstrated path moved to the goal."""
        return PosePath(self.imitated_poses)

    @property
    def path(self) -> PosePath:
        """The path that was followed: the imitated path from the guiding pose on, or a detour."""
        return PosePath(self.path_poses)

    @property
    def tree(self) -> EscapeTree | None:
        """The last escape tree; None if none was grown."""
        return EscapeTree.from_rows(self.tree_rows) if len(self.tree_rows) else None

    def log(self) -> MotionLog:
        """Return the motion and its world as `certify` takes them; a failed plan claims nothing."""
        request, claims = self.request, {"joint_margin": self.margin}
        if not isinstance(request.goal, Pose):  # joints are met, not neared
            claims |= {"position_error": 0.0, "angle_error": 0.0}
        return MotionLog(
            arm=self.arm,
            body=self.body,
            obstacles=request.obstacles,
            time=self.dt * np.arange(len(self.joints)),
            joints=self.joints,
            safety=self.settings.safety.distance,
            goal=self.goal_pose,
            demonstrated=self.imitated if self.success else None,
            allowed=request.allowed,
            claims=claims if self.success else {},
        )


def check_success(plan: Plan, what: str) -> None:
    """Refuse a plan that failed.

    Args:
        plan: the plan.
        what: the use it is for, for the message: "follow".

    Raises:
        WrongType: no plan.
        PlanFailed: "plan_failed", the plan failed.
    """
    if not checked_kind("plan", plan, Plan).success:
        raise PlanFailed("plan_failed", f"there is no plan to {what}: {plan.why}")


class MotionPlanner(ABC):
    """Plans motions of one arm; a planner implements `answering`.

    Attributes:
        arm: the arm.
        body: its capsules, held object included.
        settings: of the planner.
    """

    arm: Arm
    body: Body
    settings: PlanSettings

    @abstractmethod
    def answering(self, request: PlanRequest) -> Resumable[Plan]:
        """Plan a motion in slices, see `planner.resumable`; a failed plan says why."""

    def answer(self, request: PlanRequest) -> Plan:
        """Plan a motion; a failed plan says why. Errors are those of `answering`."""
        return finished(self.answering(request))

    def plan(
        self,
        demonstrated: Demonstration | PosePath,
        start: ArrayLike,
        goal: Pose | ArrayLike,
        obstacles: Sequence[Obstacle] = (),
        *,
        segment: str | None = None,
        allowed: Sequence[tuple[str, str]] = (),
        leaving: PosePath | None = None,
        next_motion: NextMotion | None = None,
        seed: int = 0,
        must_keep: bool = False,
        constraint: Constraint | None = None,
        keeping: Keeping | None = None,
    ) -> Plan:
        """Plan a motion.

        Args:
            demonstrated: a demonstration, or the path of the tcp to imitate.
            start: (dof,) joints now [rad or m].
            goal: pose of the tcp at the end, or (dof,) joints [rad or m] at the end, which are then met exactly.
            obstacles: as they are now; they are taken to stand still.
            segment: name of the demonstration's segment to imitate; not needed if there is only one, or none.
            allowed: pairs of names (part of the body or held object, obstacle) that may touch.
            leaving: path of the tcp from its pose at `start` on, by which the start is left; None: blend at once.
            next_motion: the motion that follows, if it is known.
            seed: of all random choices; the same seed gives the same plan.
            must_keep: a plan that keeps nothing of the demonstration is a failure; see `PlanRequest.must_keep`.
            constraint: what the demonstrated path keeps; None: what is found in it if the body holds something.
            keeping: how it is kept, see `PlanSettings.keeping`; None: as the settings say.

        Returns:
            The plan; if it failed, its `reason` says why.

        Raises:
            BadOption: the demonstration has several segments and none is named, or `segment` is given with a path.
            UnknownName: the demonstration has no segment of that name.
            WrongType, BadShape, NotFinite: an argument is of a wrong class; `start`, or a goal given as joints, is not
                (dof,) finite numbers.
        """
        path = segment_of(demonstrated, segment)
        around, contacts = checked_items("obstacles", obstacles, Obstacle), checked_contacts(allowed)
        request = PlanRequest(
            path, start, goal, around, contacts, leaving, next_motion, seed, must_keep, constraint, keeping
        )
        return self.answer(request)
