"""Starts at which the hand already holds something."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...planner.control.inverse_kinematics import inverse_kinematics
from ...planner.geometry.pose import Pose
from ...planner.robot.arm import Arm

MARGIN = 0.1
"""Least distance of a joint to its limit [rad]."""
SQUEEZE = 0.0005
"""By how much less than what they hold the finger pads are apart at the start [m]: they press at once."""
SAME_POSTURE = 0.5
"""Largest change of a joint [rad] from pose to pose of a way."""


def holding_joints(arm: Arm, hands: Sequence[Pose], seed: np.ndarray) -> np.ndarray | None:
    """Joints (dof,) nearest to a seed at which the tcp is at one of the hands, or None."""
    found = [inverse_kinematics(arm, hand, seed) for hand in hands]
    possible = [q for q in found if q is not None and arm.margin(q) >= MARGIN]
    return min(possible, key=lambda q: float(np.abs(q - seed).max())) if possible else None


def can_follow(arm: Arm, q: np.ndarray, poses: Sequence[Pose]) -> bool:
    """Whether the arm can go from joints q (dof,) from pose to pose of a way without changing its posture."""
    for pose in poses:
        reached = inverse_kinematics(arm, pose, q)
        if reached is None or arm.margin(reached) < MARGIN or np.abs(reached - q).max() > SAME_POSTURE:
            return False
        q = reached
    return True
