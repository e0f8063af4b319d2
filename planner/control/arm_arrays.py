"""One array that holds an arm, settings and scratch rows: what the compiled loops work on.

A kernel that is called fifty times a second from Python pays for each argument; one array instead of seven makes
a control step a third cheaper. Nothing is allocated in a loop. One per thread.
"""

from __future__ import annotations

import numpy as np

from ..jit import kernel
from ..robot.arm import Arm
from ..robot.kinematics import body_jacobian, forward

WIDTH = 16
# scratch
JACOBIAN, TASK, GRAM, FACTOR, FRAMES, BASIS = 0, 6, 12, 18, 24, 40
POSE, NEED, SOLUTION, NULL, SCRATCH = 46, 47, 48, 49, 50
# what is bound
CONTROL, PURSUIT, LIMITS, CHAIN = 51, 52, 53, 56
"""First rows: of the settings, of the limits (lower, upper, speed), of the chain; see `chain` for its rows."""


def arm_arrays(arm: Arm, control: tuple[float, ...] = (), pursuit: tuple[float, ...] = ()) -> np.ndarray:
    """A workspace for an arm with packed settings."""
    work = np.zeros((CHAIN + arm.dof + 1, WIDTH))
    work[CONTROL, : len(control)] = control
    work[PURSUIT, : len(pursuit)] = pursuit
    work[LIMITS : LIMITS + 3, : arm.dof] = arm.limits
    work[CHAIN:, :8] = arm.chain
    return work


@kernel
def pose_at(work, q):
    """Pose of the tcp as a tuple; the joints' frames are left behind in the workspace."""
    return forward(work[CHAIN:], q, work[FRAMES:BASIS])


@kernel
def pose_and_jacobian(work, q):
    """Pose of the tcp into row POSE, body Jacobian into the rows from JACOBIAN on; the pose as a tuple too."""
    chain, frames = work[CHAIN:], work[FRAMES:BASIS]
    x = forward(chain, q, frames)
    body_jacobian(chain, x, frames, work)
    for k in range(8):
        work[POSE, k] = x[k]
    return x


@kernel
def refresh(work, q):
    """`pose_and_jacobian` without the tuple, which costs a call from Python more than the arithmetic does."""
    pose_and_jacobian(work, q)
