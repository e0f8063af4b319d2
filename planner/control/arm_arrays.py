"""The packed array of an arm, which the compiled control loops work on: settings, limits, chain and scratch.

A kernel called fifty times a second from Python pays for each argument; one array instead of seven makes a control
step a third cheaper. Nothing is allocated in a loop. Use one array per thread.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..jit import kernel
from ..robot.arm import Arm
from ..robot.kinematics import CHAIN, body_jacobian, forward

WIDTH = 16


class ArmRows(NamedTuple):
    """First rows of the parts; "per joint" means one column per joint."""

    jacobian: int = 0  # (6) body Jacobian, rows (v, omega), per joint
    task: int = 6  # (6) scratch: task matrix M, per joint
    gram: int = 12  # (6) scratch: M M^T
    factor: int = 18  # (6) scratch: Cholesky factor
    frames: int = 24  # (16) frames of the joints, see `kinematics.FRAME`
    basis: int = 40  # (6) scratch: basis of the paper's task
    pose: int = 46  # pose (8) of the tcp
    task_velocity: int = 47  # scratch: task velocity b (6)
    solution: int = 48  # scratch: right-hand side (6) of the damped least squares
    null: int = 49  # scratch: joint speeds z for the null space
    scratch: int = 50
    control: int = 51  # settings of the controller, see CONTROL
    pursuit: int = 52  # settings of the pursuit, see PURSUIT
    lower: int = 53  # lower joint limits [rad or m], per joint
    upper: int = 54  # upper joint limits
    speed: int = 55  # largest joint speeds [rad/s or m/s]
    chain: int = 56  # see `kinematics.CHAIN`


class ControlColumns(NamedTuple):
    """Columns of the controller's settings, see `controller.ControllerSettings`."""

    law: int = 0  # index into `controller.LAWS`
    gain: int = 1  # [1/s]
    max_linear: int = 2  # [m/s]
    max_angular: int = 3  # [rad/s]
    damping_threshold: int = 4
    max_damping: int = 5
    null_gain: int = 6  # [1/s]
    limit_gain: int = 7  # [1/s]
    width: int = 8


class PursuitColumns(NamedTuple):
    """Columns of the pursuit's settings, see `pursuit.PursuitSettings`."""

    tau: int = 0
    capture_radius: int = 1  # path length [m]
    position_tolerance: int = 2  # [m]
    angle_tolerance: int = 3  # [rad]
    patience: int = 4  # [s]
    every_tick: int = 5  # 1 if the reference advances at every tick (the paper)
    decoupled: int = 6  # 1 if position and orientation are interpolated separately
    width: int = 7


class PursuitStatePlaces(NamedTuple):
    """Places in the state of a pursuit, an array of its own."""

    reference: int = 0  # index of the reference in the path
    sign: int = 1  # direction of rotation, see `controller.choose_sign`
    best: int = 2  # smallest path length [m] to the present reference so far
    waited: int = 3  # time without progress [s]
    width: int = 4


ARM, CONTROL, PURSUIT, PURSUIT_STATE = ArmRows(), ControlColumns(), PursuitColumns(), PursuitStatePlaces()


def arm_arrays(arm: Arm, control: ArrayLike = (), pursuit: ArrayLike = ()) -> np.ndarray:
    """Return the packed array of an arm.

    Args:
        arm: the arm.
        control: (8,) settings of the controller, see CONTROL; may be empty.
        pursuit: (7,) settings of the pursuit, see PURSUIT; may be empty.
    """
    work = np.zeros((ARM.chain + arm.dof + 1, WIDTH))
    work[ARM.control, : np.size(control)] = control
    work[ARM.pursuit, : np.size(pursuit)] = pursuit
    work[ARM.lower : ARM.chain, : arm.dof] = arm.limits
    work[ARM.chain :, : CHAIN.width] = arm.chain
    return work


@kernel
def pose_at(work, q):
    """Return the pose of the tcp as a tuple of 8; the frames of the joints are left in the array.

    Args:
        work: array of the arm, see `arm_arrays`.
        q: (dof,) joints.
    """
    return forward(work[ARM.chain :], q, work[ARM.frames : ARM.basis])


@kernel
def pose_and_jacobian(work, q):
    """Compute pose and body Jacobian of the tcp into the array; returns the pose as a tuple of 8, too.

    Args:
        work: array of the arm, see `arm_arrays`.
        q: (dof,) joints.
    """
    chain, frames = work[ARM.chain :], work[ARM.frames : ARM.basis]
    x = forward(chain, q, frames)
    body_jacobian(chain, x, frames, work)
    for k in range(8):
        work[ARM.pose, k] = x[k]
    return x


@kernel
def refresh(work, q):
    """Do as `pose_and_jacobian` without the tuple, which costs a call from Python more than the arithmetic does.

    Args:
        work: array of the arm, see `arm_arrays`.
        q: (dof,) joints.
    """
    pose_and_jacobian(work, q)
