"""Plans made smooth: what a curve or a time law changes is proven clear again, or refused.

Not in the paper, which names smooth curves as future work.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from .arm import Arm
from .body import Body
from .edges import is_clear, tool_work
from .errors import PlanFailed
from .joint_search import joint_edge_is_clear
from .planning import Plan, PlanSettings
from .pose import PosePath
from .scene_work import SceneWork
from .shapes import Obstacle, pack
from .smooth import smooth_path
from .timing import TimedPath, timed


def retimed(
    plan: Plan,
    acceleration_limits: ArrayLike,
    arm: Arm,
    body: Body,
    obstacles: Sequence[Obstacle],
    settings: PlanSettings | None = None,
    *,
    allowed: Sequence[tuple[str, str]] = (),
) -> TimedPath:
    """The plan's joints on a C2 spline, as fast as velocity and acceleration limits allow, from rest to rest.

    Args:
        plan: with success.
        acceleration_limits: (dof,) or one number [rad/s^2].
        arm: of the plan.
        body: of the plan.
        obstacles: of the plan.
        settings: of the plan.
        allowed: of the plan.

    Raises:
        PlanFailed: "plan_failed", there is no plan, or the spline between its points is not clear.
    """
    if not plan.success:
        raise PlanFailed("plan_failed", f"there is no plan to time: {plan.reason}")
    settings = settings or PlanSettings()
    limits = np.broadcast_to(np.asarray(acceleration_limits, dtype=np.float64), (arm.dof,))
    result = timed(plan.joints, arm.velocity_limits, limits, plan.dt)
    robot = SceneWork.of(arm, body, obstacles, settings, allowed).robot
    for k, (a, b) in enumerate(pairwise(result.joints)):
        if not joint_edge_is_clear(robot, np.ascontiguousarray(a), np.ascontiguousarray(b)):
            detail = f"the timed motion is not clear at {result.time[k]:.2f} s: the spline leaves the plan there"
            raise PlanFailed("plan_failed", detail)
    return result


def smooth_clear_path(
    path: PosePath, tool: np.ndarray, obstacles: Sequence[Obstacle], distance: float, *, per_segment: int = 4
) -> PosePath:
    """A C1 dual-quaternion curve through a tool path, every edge of it proven clear.

    Args:
        path: proven clear as it is, like `Escape.path`.
        tool: (m, 7) capsules, see `Body.tool`.
        obstacles: that stand still.
        distance: to keep [m] from those without a margin of their own.
        per_segment: poses of the curve per pose of the path.

    Raises:
        PlanFailed: "plan_failed", the curve is not clear somewhere.
    """
    curve = smooth_path(path, per_segment=per_segment)
    work = tool_work(tool, pack(obstacles), margin=distance)
    widest = max([distance, *(o.margin for o in obstacles if o.margin is not None)])
    poses = [tuple(float(v) for v in row) for row in curve.dqs]
    for k, (a, b) in enumerate(pairwise(poses)):
        if not is_clear(work, a, b, widest):
            raise PlanFailed("plan_failed", f"the smooth path is not clear behind pose {k} of {len(poses)}")
    return curve
