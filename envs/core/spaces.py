"""Observation and action spaces: bounded float64 boxes."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

from ...planner import Arm
from ..errors import BadAction

REACH = 3.0
"""Bound of world coordinates [m]; an object beyond it has long fallen off the table."""
JOINT_SLACK = 0.1
"""Bound of a joint's excursion beyond its soft limit [rad]."""
LARGEST_OBSTACLE, FASTEST_OBSTACLE = 1.0, 2.0
"""Bounds of an obstacle's extents [m] and speed [m/s]."""
LOOSE = 1.5
"""Bound of the gap between the pads relative to the widest gap: fingers on linkages give way when the hand swings."""
MAX_SPEED = 20.0
"""Bound of measured joint speeds [rad/s]; the servos command at most 5."""


def box(low: np.ndarray | float, high: np.ndarray | float, shape: tuple[int, ...]) -> spaces.Box:
    """Return a float64 box of a given shape.

    Args:
        low: lower bounds, a number or an array that broadcasts to the shape.
        high: upper bounds, likewise.
        shape: shape of the box.
    """
    return spaces.Box(
        np.broadcast_to(np.asarray(low, dtype=np.float64), shape).copy(),
        np.broadcast_to(np.asarray(high, dtype=np.float64), shape).copy(),
        dtype=np.float64,
    )


def pose_box(count: int) -> spaces.Box:
    """Return the space of poses (count, 7): x y z [m] and wxyz."""
    bound = np.array([REACH] * 3 + [1.0] * 4)
    return box(-bound, bound, (count, 7))


def observation_space(
    arms: tuple[Arm, ...],
    gripper_width: tuple[float, ...],
    objects: int,
    goals: int,
    motions: int,
    obstacles: int,
    **more: spaces.Box,
) -> spaces.Space[Any]:
    """Return the observation space of a task; the environment's docstring describes its entries.

    Args:
        arms: kinematics of the arms, with their joint limits.
        gripper_width: widest gaps between the finger pads [m], one per arm.
        objects: number of free objects.
        goals: number of goal poses.
        motions: largest motion index.
        obstacles: largest number of obstacles.
        more: task-specific entries.
    """
    shape = (len(arms), arms[0].dof)
    lower = np.stack([arm.lower for arm in arms]) - JOINT_SLACK
    upper = np.stack([arm.upper for arm in arms]) + JOINT_SLACK
    return spaces.Dict(
        {
            "joint_positions": box(lower, upper, shape),
            "joint_velocities": box(-MAX_SPEED, MAX_SPEED, shape),
            "tcp_pose": pose_box(len(arms)),
            "gripper_opening": box(0.0, LOOSE * np.array(gripper_width), (len(arms),)),
            "object_pose": pose_box(objects),
            "goal_pose": pose_box(goals),
            "motion_index": box(0.0, float(motions), (1,)),
            "obstacle_active": box(0.0, 1.0, (obstacles,)),
            "obstacle_shape": box(0.0, 3.0, (obstacles,)),
            "obstacle_size": box(0.0, LARGEST_OBSTACLE, (obstacles, 3)),
            "obstacle_pose": pose_box(obstacles),
            "obstacle_velocity": box(-FASTEST_OBSTACLE, FASTEST_OBSTACLE, (obstacles, 3)),
            **more,
        }
    )


def action_space(entries_per_arm: int, arms: int) -> spaces.Box:
    """Return the space of normalized actions: per arm the entries of the control mode, then its gripper.

    Args:
        entries_per_arm: number of entries of the control mode, the gripper excluded.
        arms: number of arms.
    """
    return box(-1.0, 1.0, (arms * (entries_per_arm + 1),))


def take_action(action: Any, into: np.ndarray) -> None:
    """Copy an action of any array type into the buffer that the compiled code reads.

    Args:
        action: the action.
        into: the buffer.

    Raises:
        BadAction: not an array of real numbers, or of the wrong shape.
    """
    if type(action) is not np.ndarray or action.dtype != np.float64:
        try:
            action = np.asarray(action)
        except ValueError:
            raise BadAction("is not an array of numbers") from None
        if action.dtype.kind not in "fiub":
            raise BadAction(f"is not an array of real numbers, but of {action.dtype.name}")
    if action.shape != into.shape:
        raise BadAction(f"has shape {action.shape}; expected {into.shape}")
    into[:] = action
