"""Motions made smooth: what a curve or a time law changes is proven clear again, or refused.

Not in the paper, which names smooth curves as future work.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from ..collision.edge_certificates import is_clear
from ..control.pursuit import ARRIVED
from ..errors import PlanFailed
from ..geometry.pose import PosePath
from ..geometry.smooth_path import smooth, thinned
from ..robot.arm import Arm
from ..safety.guarded_pursuit import guarded_roll_out
from .joint_space_rrt import joint_edge_is_clear
from .planning_scene import PlanningScene
from .time_optimal import TimedPath, timed

SMOOTH_TOLERANCE = 0.002
"""Screw length [m] by which a path may be thinned before a curve is laid through it: the trembling of a hand."""
CURVE_SPACING = 0.005
"""Screw length [m] between poses of a curve."""


def retimed(joints: np.ndarray, dt: float, acceleration_limits: ArrayLike, arm: Arm, scene: PlanningScene) -> TimedPath:
    """Joints (t, dof) on a C2 spline, as fast as velocity and acceleration limits allow, from rest to rest.

    Args:
        joints: proven clear as they are.
        dt: seconds between samples of the result.
        acceleration_limits: (dof,) or one number [rad/s^2].
        arm: whose joints these are.
        scene: it among the obstacles.

    Raises:
        PlanFailed: "plan_failed", the spline between the joints is not clear.
    """
    limits = np.broadcast_to(np.asarray(acceleration_limits, dtype=np.float64), (arm.dof,))
    result = timed(joints, arm.velocity_limits, limits, dt)
    for k, (a, b) in enumerate(pairwise(result.joints)):
        if not joint_edge_is_clear(scene.seen, np.ascontiguousarray(a), np.ascontiguousarray(b)):
            detail = f"the timed motion is not clear at {result.time[k]:.2f} s: the spline leaves the plan there"
            raise PlanFailed("plan_failed", detail)
    return result


def smooth_clear_path(
    path: PosePath, tool: np.ndarray, widest: float, *, tolerance: float = 0.0, spacing: float = CURVE_SPACING
) -> PosePath:
    """A C1 dual-quaternion curve along a tool path, every edge of it proven clear.

    Args:
        path: proven clear as it is, like `Escape.path`.
        tool: the tool among obstacles, see `edges.tool_arrays`.
        widest: largest distance to keep [m] in it.
        tolerance: screw length [m] that poses of the path may be away from those the curve is laid through.
        spacing: screw length [m] between poses of the curve.

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


def smoothed(
    path: PosePath,
    start: np.ndarray,
    scene: PlanningScene,
    work: np.ndarray,
    dt: float,
    seconds: float,
    tolerance: float,
) -> tuple[PosePath, np.ndarray, float, int]:
    """A motion along a smooth path: the curve, the joints of every tick, smallest joint margin, ticks changed.

    Args:
        path: of the tcp, from where it is.
        start: (dof,) joints.
        scene: the arm among the obstacles.
        work: the arm, controller and pursuit, see `workspace`.
        dt: seconds per tick.
        seconds: longest motion.
        tolerance: see `smooth_clear_path`.

    Raises:
        PlanFailed: "plan_failed", the curve is not clear, or the arm does not follow it to its end.
    """
    curve = smooth_clear_path(path, scene.safe_tool(), scene.widest_safe, tolerance=tolerance)
    dof, pursuit_state = len(start), np.array([0.0, 0.0, np.inf, 0.0])
    trace = np.empty((round(seconds / dt) + 1, dof))
    status, last, margin, changed = guarded_roll_out(
        work, scene.robot, curve.dqs, start.copy(), dt, pursuit_state, np.empty(dof), np.empty(dof), trace, 0
    )
    if status != ARRIVED:
        raise PlanFailed("plan_failed", f"the arm does not follow the smooth path beyond {last * dt:.2f} s")
    return curve, trace[: last + 1].copy(), float(margin), int(changed)
