"""Blocks on the table, and grasps of them."""

from __future__ import annotations

import numpy as np

from ...planner import Pose
from ...planner.errors import BadOption
from ..scene.scene_objects import TABLE_HEIGHT
from .layout import TABLE_EDGE, StackLayout
from .rules import BLOCK, BLOCK_SIZE

DOWN = (0.0, 1.0, 0.0, 0.0)
"""Rotation (wxyz) of a hand that points down, fingers closing along world x."""


def block_grasps(block: np.ndarray, up: float = 0.0) -> list[Pose]:
    """Return the tcp poses that grasp a block from above across its narrow side, half a turn apart.

    Args:
        block: (7,) pose of the block, x y z [m] and wxyz.
        up: height of the tcp above the block's center [m].
    """
    pose = Pose.from_vector(block) @ Pose.from_position_quaternion([0.0, 0.0, up])
    yaws = (0.5 * np.pi, -0.5 * np.pi)
    return [pose @ Pose.from_yaw([0, 0, 0], yaw) @ Pose.from_position_quaternion([0, 0, 0], DOWN) for yaw in yaws]


def above(pose: Pose, height: float) -> Pose:
    """Return a pose moved upwards.

    Args:
        pose: pose in the world.
        height: vertical displacement [m].
    """
    return Pose.from_position_quaternion([0, 0, height]) @ pose


def block_poses(layout: StackLayout) -> tuple[np.ndarray, np.ndarray]:
    """Return the world poses (n, 7) of the blocks, and the pose (7,) of the lowest goal."""
    rows = np.vstack([layout.blocks, layout.base])
    height = TABLE_HEIGHT + 0.5 * BLOCK_SIZE[2]
    zeros = np.zeros(len(rows))
    half = 0.5 * rows[:, 2]
    poses = np.column_stack([rows[:, :2], zeros + height, np.cos(half), zeros, zeros, np.sin(half)])
    return poses[:-1], poses[-1]


def check_places(poses: np.ndarray, base: np.ndarray) -> None:
    """Refuse blocks that are off the table or overlap, and a base place that is off the table or tilted.

    Args:
        poses: (n, 7) poses of the blocks, x y z [m] and wxyz.
        base: (7,) pose of the lowest goal.

    Raises:
        BadOption: a pose is refused.
    """
    for k, pose in enumerate(poses):
        if np.abs(pose[:2]).max() > TABLE_EDGE or pose[2] < TABLE_HEIGHT + 0.4 * BLOCK_SIZE[2]:
            raise BadOption("object_poses", f"block {k} at {np.round(pose[:3], 3).tolist()} is not on the table")
        for j in range(k):
            apart = poses[j, :3] - pose[:3]
            if np.hypot(*apart[:2]) < BLOCK and abs(apart[2]) < 0.9 * BLOCK_SIZE[2]:
                raise BadOption("object_poses", f"blocks {j} and {k} are inside each other")
    if np.abs(base[:2]).max() > TABLE_EDGE or abs(base[2] - TABLE_HEIGHT - 0.5 * BLOCK_SIZE[2]) > 0.005:
        raise BadOption("base_pose", f"{np.round(base[:3], 3).tolist()} is not a place on the table")
    if np.hypot(base[4], base[5]) > 0.01:
        raise BadOption("base_pose", "is tilted; only a yaw is possible")
