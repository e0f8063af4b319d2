"""Refinement of plans: a curve or a time law is proven clear again, or refused.

Not in the paper, which names smooth curves as future work.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from ..collision.edge_certificates import is_clear
from ..control.arm_arrays import arm_arrays
from ..control.pursuit import ARRIVED
from ..control.time_optimal import time_optimal
from ..errors import PlanFailed
from ..geometry.pose import Pose, PosePath
from ..geometry.smooth_path import smooth, thinned
from ..ranges import check_range, ticks_of
from ..resumable import finished
from ..safety.guarded_pursuit import roll_out
from ..search.joint_space_rrt import joint_edge_is_clear
from .plan import Plan, check_success
from .planning_scene import PlanningScene

ACCELERATION = 5.0
"""Default limit of the joints' acceleration [rad/s^2]: about a third of what a Panda can do."""
SMOOTH_TOLERANCE = 0.002
"""Path length [m] by which a path may be thinned before a curve is laid through it: the tremor of a hand."""
CURVE_SPACING = 0.005
"""Path length [m] between poses of a curve."""


def smoothed(plan: Plan, *, tolerance: float = SMOOTH_TOLERANCE) -> Plan:
    """Return the plan along a C1 curve of the tool near its path, proven clear again.

    Args:
        plan: a plan along a path of the tool.
        tolerance: path length [m] by which poses may be off those the curve is laid through; 0 where the curve would
            not be clear otherwise.

    Raises:
        WrongType: no plan.
        BadOption: the tolerance is negative or not a number.
        PlanFailed: "plan_failed": the plan failed, it leads through joint space or to given joints, or the curve is not
            clear, not followed to its end, or deeper in an allowed contact than at its ends.
    """
    check_success(plan, "make smooth")
    check_range("tolerance", tolerance, "[0, inf]")
    if plan.how == "joint search":
        raise PlanFailed("plan_failed", "a way through joint space has no path of the tool to make smooth")
    if not isinstance(plan.request.goal, Pose):
        raise PlanFailed("plan_failed", "a smooth path of the tool would not end at the given joints")
    arm, motion, scene = plan.arm, plan.settings.motion, scene_of(plan)
    start = scene.checked_joints(plan.joints)[0].copy()
    path = PosePath(arm.fk(start).dq[None]).joined(plan.path)
    curve = _clear_curve(path, scene, tolerance)
    work = arm_arrays(arm, motion.controller.packed(), motion.pursuit.packed())
    trace = np.empty((ticks_of(plan.settings.max_seconds, motion.dt) + 1, arm.dof))
    found = finished(roll_out(work, scene.robot, curve.dqs, start, motion.dt, trace))
    if found.status != ARRIVED:
        until = (len(found.joints) - 1) * motion.dt
        raise PlanFailed("plan_failed", f"the arm does not follow the smooth path beyond {until:.2f} s")
    _check_contacts(scene, found.joints)
    return plan._replace(
        joints=found.joints.copy(),
        path_poses=curve.dqs,
        margin=float(found.margin),
        changed=int(found.changed),
        refined=(*plan.refined, "smooth"),
    )


def _clear_curve(path: PosePath, scene: PlanningScene, tolerance: float) -> PosePath:
    """A clear curve near a path; through every pose of the path where one through fewer cuts a corner."""
    tool, widest = scene.safe_tool(), scene.widest_safe
    try:
        return smooth_clear_path(path, tool, widest, tolerance=tolerance)
    except PlanFailed:
        return smooth_clear_path(path, tool, widest, tolerance=0.0)


def timed(plan: Plan, acceleration_limits: ArrayLike = ACCELERATION) -> Plan:
    """Return the plan's joints on a C2 spline, from rest to rest, as fast as velocity and acceleration limits allow.

    Args:
        plan: a plan.
        acceleration_limits: (dof,) or one number [rad/s^2].

    Raises:
        WrongType, BadShape, BadOption: no plan, or limits that are not (dof,) positive numbers.
        PlanFailed: "plan_failed": the plan failed, the spline between its points is not clear, or it goes deeper into
            an allowed contact than at its ends.
    """
    check_success(plan, "time")
    result = time_optimal(plan.joints, plan.arm.velocity_limits, acceleration_limits, plan.dt)
    scene = scene_of(plan)
    check_joints_are_clear(result.joints, result.time, scene)
    _check_contacts(scene, result.joints)
    margin = min(plan.arm.margin(q) for q in result.joints)
    # a timed motion is no closed loop any more
    return plan._replace(joints=result.joints, margin=margin, changed=0, refined=(*plan.refined, "timed"))


def _check_contacts(scene: PlanningScene, joints: np.ndarray) -> None:
    if not scene.keeps_contacts(joints):
        raise PlanFailed("plan_failed", "the refined motion goes deeper into an allowed contact than at its ends")


def refused(plan: Plan, failure: PlanFailed) -> Plan:
    """Return the plan as a failed one, after its refinement failed.

    Args:
        plan: the plan.
        failure: of its refinement.
    """
    return plan._replace(joints=plan.joints[:1], reason=failure.reason, detail=failure.detail)


def scene_of(plan: Plan) -> PlanningScene:
    """Return the plan's arm among its obstacles."""
    return PlanningScene.of(plan.arm, plan.body, plan.request.obstacles, plan.settings, plan.request.allowed)


def check_joints_are_clear(joints: np.ndarray, time: np.ndarray, scene: PlanningScene) -> None:
    """Refuse joints between which the motion is not proven clear.

    Args:
        joints: (t, dof) at every tick.
        time: (t,) [s], for the message.
        scene: the arm among the obstacles.

    Raises:
        PlanFailed: "plan_failed", with the time.
    """
    for k, (a, b) in enumerate(pairwise(scene.checked_joints(joints))):
        if not joint_edge_is_clear(scene.seen, a, b):
            detail = f"the timed motion is not clear at {time[k]:.2f} s: the spline leaves the plan there"
            raise PlanFailed("plan_failed", detail)


def smooth_clear_path(
    path: PosePath, tool: np.ndarray, widest: float, *, tolerance: float = 0.0, spacing: float = CURVE_SPACING
) -> PosePath:
    """Return a C1 dual-quaternion curve along a tool path, with every edge proven clear.

    Args:
        path: proven clear as it is, like `Escape.path`.
        tool: the tool among obstacles, see `edge_certificates.tool_arrays`.
        widest: largest margin [m] in it.
        tolerance: path length [m] that poses of the path may be away from those the curve is laid through.
        spacing: path length [m] between poses of the curve.

    Raises:
        PlanFailed: "plan_failed", the curve is not clear somewhere.
    """
    curve = smooth(thinned(path, tolerance))
    steps = max(1, math.ceil(curve.knots[-1] / spacing))
    result = PosePath(curve.poses(np.linspace(0.0, curve.knots[-1], steps + 1)))
    poses = [tuple(float(v) for v in row) for row in result.dqs]
    for k, (a, b) in enumerate(pairwise(poses)):
        if not is_clear(tool, a, b, widest):
            raise PlanFailed("plan_failed", f"the smooth path is not clear behind pose {k} of {len(poses)}")
    return result
