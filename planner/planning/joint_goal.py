"""Motions to given joints: a search in joint space to the one posture, asked again with other random numbers.

Not in the paper, whose goals are poses of the end effector.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import numbers
from ..errors import BadShape, NotFinite
from ..resumable import Resumable
from ..robot.arm import Arm
from ..robot.kinematics import FRAME, forward_into
from ..search.joint_paths import JointPaths
from ..search.joint_space_rrt import joint_edge_is_clear
from .joint_space_motion import timed_on_lines
from .planning_scene import PlanningScene

if TYPE_CHECKING:
    from .settings import PlanSettings

CLOSE = 0.1
"""Largest distance [rad or m] of any joint from the goal at which a path of the tool is said to end there."""
MOST_POSES = 100
"""Number of poses of the tool's path that are kept."""


def checked_goal(arm: Arm, goal: ArrayLike) -> np.ndarray:
    """Return goal joints (dof,) as float64, in an array of their own.

    Args:
        arm: the arm.
        goal: (dof,) joints.

    Raises:
        WrongType, BadShape, NotFinite: neither a pose nor numbers, another shape, or a number that is not finite.
    """
    q = numbers(f"{arm.name}: goal", goal).copy()
    if q.shape != (arm.dof,):
        raise BadShape(f"{arm.name}: goal", q.shape, f"a Pose, or joints ({arm.dof},)")
    if not np.isfinite(q).all():
        raise NotFinite(f"{arm.name}: goal", int(np.argmin(np.isfinite(q))))
    return q


def line_to(
    arm: Arm, scene: PlanningScene, q: np.ndarray, goal: np.ndarray, settings: PlanSettings
) -> np.ndarray | None:
    """Return joints (t, dof) at every tick on the straight line to near goal joints; None if far, or not clear.

    Args:
        arm: the arm.
        scene: the arm among obstacles.
        q: (dof,) joints at the start.
        goal: (dof,) joints at the end.
        settings: of the planner.
    """
    if np.abs(goal - q).max() > CLOSE or not joint_edge_is_clear(scene.with_contacts_as_at(q, goal), q, goal):
        return None
    return _timed(arm, np.array([q, goal]), settings)


def plan_to_joints(
    arm: Arm, scene: PlanningScene, q: np.ndarray, goal: np.ndarray, settings: PlanSettings, seed: int
) -> Resumable[np.ndarray | None]:
    """Search a motion to goal joints, from rest to rest on straight lines; None without success.

    Args:
        arm: the arm.
        scene: the arm among obstacles.
        q: (dof,) joints at the start.
        goal: (dof,) joints at the end, clear.
        settings: see `PlanSettings`; its `search` must be given.
        seed: of all random choices.

    Returns:
        Joints (t, dof) at every tick; the last are the goal.
    """
    search = settings.search
    assert search is not None
    seen, paths = scene.with_contacts_as_at(q, goal), JointPaths(len(q), search.nodes, seed)
    for _ in range(search.to_joints):  # the state of the random numbers is another each time
        points = yield from paths.connected(seen, q, goal, search.step, search.iterations, search.shortcuts_to_joints)
        if points is not None:
            return _timed(arm, points, settings)
    return None


def _timed(arm: Arm, points: np.ndarray, settings: PlanSettings) -> np.ndarray:
    speed = settings.search.speed if settings.search is not None else 1.0
    joints = timed_on_lines(points, speed * arm.velocity_limits, settings.motion.dt)
    joints[-1] = points[-1]  # to the last digit
    return joints


def tool_path(arm: Arm, joints: np.ndarray) -> np.ndarray:
    """Return poses (n, 8) of the tool along a motion, at most `MOST_POSES` and the last.

    Args:
        arm: the arm.
        joints: (t, dof) at every tick.
    """
    before = joints[:-1]
    rows = np.vstack([before[:: max(1, math.ceil(len(before) / MOST_POSES))], joints[-1]])
    poses, frames = np.empty((len(rows), 8)), np.empty((arm.dof, FRAME.width))
    for q, pose in zip(rows, poses, strict=True):
        forward_into(arm.chain, q, frames, pose)
    return poses
