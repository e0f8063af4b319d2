"""Starts with an object already in the hand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...planner import Arm, Pose
from ...planner.control.inverse_kinematics import inverse_kinematics

MARGIN = 0.1
"""Least distance of a joint to its limit [rad]."""
SQUEEZE = 0.0005
"""Squeeze [m]: the finger pads start this much closer than the object is wide, so they press at once."""
SAME_POSTURE = 0.5
"""Largest change of a joint [rad] between successive poses of a motion."""


def holding_joints(arm: Arm, hands: Sequence[Pose], seed: np.ndarray) -> np.ndarray | None:
    """Return the joints (dof,) nearest to a seed that put the tcp at one of the given poses, or None.

    Args:
        arm: kinematics of the arm.
        hands: alternative tcp poses in the world.
        seed: (dof,) joints [rad] from which inverse kinematics starts.
    """
    found = [inverse_kinematics(arm, hand, seed) for hand in hands]
    possible = [q for q in found if q is not None and arm.margin(q) >= MARGIN]
    return min(possible, key=lambda q: float(np.abs(q - seed).max())) if possible else None


def can_follow(arm: Arm, q: np.ndarray, poses: Sequence[Pose]) -> bool:
    """Return whether the arm can follow tcp poses one after another without changing its posture.

    Args:
        arm: kinematics of the arm.
        q: (dof,) joints [rad] at the start.
        poses: tcp poses in the world, in order.
    """
    for pose in poses:
        reached = inverse_kinematics(arm, pose, q)
        if reached is None or arm.margin(reached) < MARGIN or np.abs(reached - q).max() > SAME_POSTURE:
            return False
        q = reached
    return True
