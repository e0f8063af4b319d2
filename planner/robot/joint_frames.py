"""Poses of an arm's joint frames, for code that is not compiled."""

from __future__ import annotations

import numpy as np

from ..geometry.pose import Pose
from .arm import Arm
from .kinematics import CHAIN, REVOLUTE


def joint_frames(arm: Arm, q: np.ndarray) -> list[Pose]:
    """Return `world_from_frame` of every joint's frame after the joint has moved.

    Args:
        arm: the arm.
        q: (dof,) joint positions [rad or m].
    """
    poses, pose = [], Pose.identity()
    for row, value in zip(arm.chain[:-1], q, strict=True):
        turned = Pose.from_yaw([0.0, 0.0, 0.0], value)
        step = turned if row[CHAIN.kind] == REVOLUTE else Pose.from_position_quaternion([0.0, 0.0, value])
        fixed = Pose.from_position_quaternion(row[CHAIN.offset : CHAIN.kind], row[CHAIN.rotation : CHAIN.offset])
        pose = pose @ fixed @ step
        poses.append(pose)
    return poses


def moved(a_from_b: Pose, points: np.ndarray) -> np.ndarray:
    """Transform points from frame b to frame a.

    Args:
        a_from_b: pose of b in a.
        points: (..., 3) [m].
    """
    return points @ a_from_b.rotation.T + a_from_b.position
