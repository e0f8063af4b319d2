"""Compiled forward kinematics and body Jacobian of a serial chain.

A chain is an array (dof + 1, 8): per joint the fixed displacement from the frame before it to the joint's own
frame, whose z axis is the joint axis, as quaternion wxyz, position [m] and kind (0 turns, 1 slides); the last
row is the tool frame (tcp).
"""

from __future__ import annotations

import math

from ..geometry import screw
from ..jit import kernel

REVOLUTE, PRISMATIC = 0.0, 1.0
FRAME = 10
"""Numbers that `forward` leaves behind per joint."""


@kernel
def forward(chain, q, frames):
    """Pose of the tcp as a tuple; each joint's axis (0..2), origin (3..5) and turn (6..9) into `frames` (dof, 10).

    Origin and turn are those of the frame that has moved with the joint: the pose of its link.
    """
    r = (1.0, 0.0, 0.0, 0.0)
    p = (0.0, 0.0, 0.0)
    n = len(chain) - 1
    for i in range(n + 1):
        step = screw.rotate(r, (chain[i, 4], chain[i, 5], chain[i, 6]))
        p = (p[0] + step[0], p[1] + step[1], p[2] + step[2])
        r = screw.qmul(r, (chain[i, 0], chain[i, 1], chain[i, 2], chain[i, 3]))
        if i < n:
            w, x, y, z = r
            axis = (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), w * w - x * x - y * y + z * z)
            if chain[i, 7] == 0.0:
                s, c = math.sin(0.5 * q[i]), math.cos(0.5 * q[i])
                r = (w * c - z * s, x * c + y * s, y * c - x * s, z * c + w * s)
            else:
                p = (p[0] + q[i] * axis[0], p[1] + q[i] * axis[1], p[2] + q[i] * axis[2])
            for k in range(3):
                frames[i, k] = axis[k]
                frames[i, 3 + k] = p[k]
            for k in range(4):
                frames[i, 6 + k] = r[k]
    return screw.from_pose(p, r)


@kernel
def body_jacobian(chain, x, frames, jacobian):
    """Body Jacobian (v, omega) into the first six rows of `jacobian`, from the `frames` of `forward`."""
    inverse = (x[0], -x[1], -x[2], -x[3])
    p = screw.translation(x)
    for i in range(len(chain) - 1):
        axis = (frames[i, 0], frames[i, 1], frames[i, 2])
        w = screw.rotate(inverse, axis)
        if chain[i, 7] == 0.0:
            lever = (p[0] - frames[i, 3], p[1] - frames[i, 4], p[2] - frames[i, 5])
            v = screw.rotate(inverse, screw.cross(axis, lever))
        else:
            v = w
            w = (0.0, 0.0, 0.0)
        for k in range(3):
            jacobian[k, i] = v[k]
            jacobian[3 + k, i] = w[k]


@kernel
def forward_into(chain, q, frames, out):
    """Pose of the tcp into `out` (8,)."""
    x = forward(chain, q, frames)
    for k in range(8):
        out[k] = x[k]


@kernel
def forward_jacobian_into(chain, q, frames, jacobian, out):
    """Pose of the tcp into `out` (8,), body Jacobian into `jacobian` (6, dof)."""
    x = forward(chain, q, frames)
    body_jacobian(chain, x, frames, jacobian)
    for k in range(8):
        out[k] = x[k]
