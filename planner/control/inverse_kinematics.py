"""Inverse kinematics by the controller's own law."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..geometry import screw
from ..geometry.pose import Pose
from ..jit import kernel
from ..robot.arm import Arm
from .arm_arrays import LIMITS, arm_arrays, pose_and_jacobian
from .controller import ControllerSettings, joint_velocity

POSITION_TOLERANCE, ANGLE_TOLERANCE = 1e-4, 1e-3
_STEP = ControllerSettings(
    gain=0.5, max_linear=0.15, max_angular=0.5, null_gain=0.3, limit_gain=1.0, damping_threshold=0.03
).packed()
"""Settings of one iteration, which is a control step of one second."""


@kernel
def _solve(work, target, q, iterations, qdot):
    """Move q to a solution; False where it is not reached."""
    for _ in range(iterations):
        x = pose_and_jacobian(work, q)
        distance, angle = screw.pose_distance(x, target)
        if distance < POSITION_TOLERANCE and angle < ANGLE_TOLERANCE:
            return True
        joint_velocity(work, q, screw.shorter(screw.mul(screw.conj(x), target)), qdot)
        for i in range(len(q)):
            q[i] += qdot[i]
    return False


def inverse_kinematics(arm: Arm, target: Pose, seed: ArrayLike, *, iterations: int = 300) -> np.ndarray | None:
    """Joints (dof,) that reach the pose within 0.1 mm and 1 mrad from a seed (dof,), or None.

    Local: another seed may lead to another posture, or succeed where this one fails.
    """
    q = np.array(seed, dtype=np.float64)
    goal = tuple(float(value) for value in target.dq)
    return q if _solve(_unhurried(arm), goal, q, iterations, np.empty(arm.dof)) else None


def _unhurried(arm: Arm) -> np.ndarray:
    """A workspace in which an iteration moves no joint by more than half a radian."""
    work = arm_arrays(arm, _STEP)
    work[LIMITS + 2] = 0.5
    return work
