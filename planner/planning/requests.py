"""Checks of a request before it is planned, and the bound on the length of its paths."""

from __future__ import annotations

import math

import numpy as np

from ..arrays import checked_kind
from ..constraints.request_constraint import fitted, remembered_constraint
from ..control.reachability import why_not_reached
from ..errors import BadOption, told_apart
from ..geometry.pose import METERS_PER_RADIAN, Pose, PosePath
from ..imitation.constraint import KEEPING, Constraint, Keeping
from ..imitation.reduction import reduced
from ..imitation.tsia import imitated_path
from ..ranges import check_choice, check_count
from ..robot.arm import Arm
from ..robot.joint_limits import beyond_limit, within_limits
from ..safety.robot_checks import checked_contacts
from .joint_goal import checked_goal
from .joint_space_motion import IK_OR_LIMIT, NextMotionCheck
from .plan import NextMotion, PlanRequest
from .planning_scene import PlanningScene, SceneTemplate, checked_obstacles
from .settings import PlanSettings

LEAVING_TOLERANCE = 0.01
"""Largest weighted distance [m] from the tool at the start to the beginning of the path by which the start is left."""


def checked_request(request: PlanRequest, arm: Arm) -> PlanRequest:
    """Return a request that can be planned: its start, and a goal of joints, as arrays of their own, its seed an int.

    Joints that are beyond a limit by rounding are at the limit, see `within_limits`. Allowed contacts become tuples.

    Args:
        request: the request.
        arm: the arm that moves.

    Raises:
        WrongType, BadShape, NotFinite: a part of the request is of a wrong class; the start, or a goal given as joints,
            is not (dof,) finite numbers.
        BadOption: there are too many obstacles, `leaving` begins elsewhere than at the tool, or the seed is no whole
            number.
    """
    checked_kind("request", request, PlanRequest)
    checked_kind("demonstrated", request.demonstrated, PosePath)
    goal = request.goal
    if not isinstance(goal, Pose):
        goal = within_limits(arm, checked_goal(arm, goal))
    check_count("seed", request.seed, "(-inf, inf)")
    then = request.next_motion
    if then is not None:
        checked_kind("next_motion", then, NextMotion)
        checked_kind("next_motion.path", then.path, PosePath)
        then = then._replace(allowed=checked_contacts(then.allowed, "next_motion.allowed"))
    if request.constraint is not None:
        count = checked_kind("constraint", request.constraint, Constraint).count
        if count != len(request.demonstrated):
            raise BadOption("constraint", f"is of a path of {count} poses; the path has {len(request.demonstrated)}")
    if request.keeping is not None:
        check_choice("keeping", request.keeping, KEEPING)
    start = within_limits(arm, arm.checked(request.start))
    if request.leaving is not None:
        _check_leaving(arm, start, checked_kind("leaving", request.leaving, PosePath))
    return request._replace(
        start=start,
        goal=goal,
        obstacles=checked_obstacles(request.obstacles),
        allowed=checked_contacts(request.allowed),
        next_motion=then,
        seed=int(request.seed),  # numpy's small whole numbers overflow where Python's do not
    )


def reduced_request(request: PlanRequest, most: int) -> tuple[PlanRequest, float]:
    """Return a request with a bounded number of poses in each of its paths.

    Args:
        request: a checked request.
        most: largest number of poses.

    Returns:
        The request, and the deviation [m] of its demonstrated path, see `ReducedPath`; the same request and 0 if it is
        short enough.
    """
    demonstrated, deviation = reduced(request.demonstrated, most)
    constraint = request.constraint
    if constraint is not None and len(demonstrated) < constraint.count:
        constraint = constraint.of_lengths(request.demonstrated.lengths(), demonstrated.lengths())
    leaving, then = request.leaving, request.next_motion
    return request._replace(
        demonstrated=demonstrated,
        constraint=constraint,
        leaving=None if leaving is None else reduced(leaving, most).path,
        next_motion=None if then is None else then._replace(path=reduced(then.path, most).path),
    ), deviation


def unfit(arm: Arm, scene: PlanningScene, request: PlanRequest, settings: PlanSettings) -> tuple[str, str]:
    """Return reason and detail why the start or the goal of a request is impossible; "" if both are possible.

    Args:
        arm: the arm.
        scene: the arm among the obstacles.
        request: a checked request.
        settings: of the planner.
    """
    start, goal = np.asarray(request.start), request.goal
    if beyond := beyond_limit(arm, start):
        return "start beyond a joint limit", beyond
    if settings.guard and scene.slack(start) < 0.0:
        return "start in collision", str(scene.tightest(start))
    # a planner without detours, search and guard ignores obstacles
    careful = settings.guard or settings.avoids
    if not isinstance(goal, Pose):
        if beyond := beyond_limit(arm, np.asarray(goal)):
            return "goal beyond a joint limit", beyond
        if careful and scene.slack(np.asarray(goal)) < 0.0:
            return "goal in collision", str(scene.tightest(np.asarray(goal)))
        return "", ""
    if far := why_not_reached(arm, goal, start, search=False):
        return IK_OR_LIMIT, far
    if careful and scene.tool_slack(goal) < 0.0:
        return "goal in collision", str(scene.tightest_of_tool(goal))
    return "", ""


def _check_leaving(arm: Arm, start: np.ndarray, leaving: PosePath) -> None:
    distance, angle = arm.fk(start).distance_to(leaving[0])
    away = math.hypot(distance, METERS_PER_RADIAN * angle)
    if not away <= LEAVING_TOLERANCE:
        found, most = told_apart(1e3 * away, 1e3 * LEAVING_TOLERANCE, 1)
        reason = (
            f"begins {1e3 * distance:.1f} mm and {math.degrees(angle):.1f} degrees from the tool at the start: "
            f"{found} mm, a radian counted as {METERS_PER_RADIAN:g} m; allowed are {most}"
        )
        raise BadOption("leaving", reason)


def keeping_of(request: PlanRequest, settings: PlanSettings) -> Keeping:
    """Return how a constraint is kept.

    Args:
        request: the request.
        settings: of the planner.
    """
    return settings.keeping if request.keeping is None else request.keeping


def constraint_of(request: PlanRequest, settings: PlanSettings, start: Pose, *, holds: bool) -> Constraint | None:
    """Return what is to be kept of the demonstrated path, at this start and goal; None: nothing.

    Args:
        request: a checked request.
        settings: of the planner.
        start: pose of the tcp at the start.
        holds: whether the body holds something: without, only a given constraint is kept.
    """
    found, given = request.constraint, request.demonstrated
    if keeping_of(request, settings) == "free" or not isinstance(request.goal, Pose):
        return None
    if found is None and holds:
        found = remembered_constraint(given, settings.constraint)
    if found is None or found.keeps_nothing:
        return None
    return fitted(found, imitated_path(given, request.goal), start)


def check_of(
    template: SceneTemplate, scene: PlanningScene, request: PlanRequest, settings: PlanSettings
) -> NextMotionCheck | None:
    """Return the check of the motion that follows; None: there is none.

    Args:
        template: the arm and its body.
        scene: the arm among the obstacles, with the contacts of this motion.
        request: a checked request.
        settings: of the planner.
    """
    then = request.next_motion
    if then is None:
        return None
    if then.required:
        scene = PlanningScene(template, request.obstacles, settings.repet.distance, then.allowed)
    return NextMotionCheck(scene, then.path, then.required)
