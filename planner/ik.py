"""Inverse kinematics by the controller's own law, and which part of a path an arm can reach."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from . import screw
from .arm import Arm
from .chain import body_jacobian, forward
from .controller import FRAMES, ControllerSettings, joint_velocity, workspace
from .jit import kernel
from .pose import Pose, PosePath

POSITION_TOLERANCE, ANGLE_TOLERANCE = 1e-4, 1e-3
_STEP = ControllerSettings(
    gain=0.5, max_linear=0.15, max_angular=0.5, null_gain=0.3, limit_gain=1.0, damping_threshold=0.03
).packed()
"""Settings of one iteration, which is a control step of one second."""


@kernel
def _solve(chain, limits, target, q, iterations, settings, work, qdot):
    """Move q to a solution; False where it is not reached."""
    frames = work[FRAMES : FRAMES + 16]
    for _ in range(iterations):
        x = forward(chain, q, frames)
        distance, angle = screw.gap(x, target)
        if distance < POSITION_TOLERANCE and angle < ANGLE_TOLERANCE:
            return True
        body_jacobian(chain, x, frames, work)
        error = screw.shorter(screw.mul(screw.conj(x), target))
        joint_velocity(limits, q, error, settings, work, qdot)
        for i in range(len(q)):
            q[i] += qdot[i]
    return False


@kernel
def _margins(chain, limits, path, q, settings, work, qdot, margins):
    """Joint margin at each pose, walking backwards from a solution q of the last one."""
    margins[:] = -np.inf
    for k in range(len(path) - 1, -1, -1):
        if not _solve(chain, limits, screw.load8(path, k), q, 60, settings, work, qdot):
            return
        margins[k] = np.inf
        for i in range(len(q)):
            margins[k] = min(margins[k], q[i] - limits[0, i], limits[1, i] - q[i])


def inverse_kinematics(arm: Arm, target: Pose, seed: ArrayLike, *, iterations: int = 300) -> np.ndarray | None:
    """Joints (dof,) that reach the pose within 0.1 mm and 1 mrad from a seed (dof,), or None.

    Local: another seed may lead to another posture, or succeed where this one fails.
    """
    q = np.array(seed, dtype=np.float64)
    limits = _unhurried(arm)
    goal = tuple(float(value) for value in target.dq)
    found = _solve(arm.chain, limits, goal, q, iterations, _STEP, workspace(), np.empty(arm.dof))
    return q if found else None


def path_margins(arm: Arm, path: PosePath, goal_joints: ArrayLike) -> np.ndarray:
    """Joint margins (n,) [rad] of a path walked backwards from joints (dof,) that reach its last pose.

    -inf from the first pose on, seen from the end, that has no solution near the one before.
    """
    margins = np.empty(len(path))
    q = np.array(goal_joints, dtype=np.float64)
    _margins(arm.chain, _unhurried(arm), path.dqs, q, _STEP, workspace(), np.empty(arm.dof), margins)
    return margins


def _unhurried(arm: Arm) -> np.ndarray:
    """Limits with a joint step of at most 0.5 rad per iteration."""
    limits = arm.limits
    limits[2] = 0.5
    return limits
