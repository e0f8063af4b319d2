"""Compiled forward kinematics and body Jacobian of a serial chain.

A chain is an array (dof + 1, 8): per joint the fixed displacement from the preceding frame to the joint's own
frame, whose z axis is the joint axis, as quaternion wxyz, position [m] and kind (0 revolute, 1 prismatic); the last
row is the tool frame (tcp).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ..geometry import screw
from ..jit import kernel

REVOLUTE, PRISMATIC = 0.0, 1.0


class ChainColumns(NamedTuple):
    """Columns of a chain."""

    rotation: int = 0  # quaternion (4) wxyz
    offset: int = 4  # (3) [m]
    kind: int = 7  # REVOLUTE or PRISMATIC
    width: int = 8


class FrameColumns(NamedTuple):
    """Columns of the frame of a joint in the world, once the joint has moved: the pose of its link."""

    axis: int = 0  # (3) unit
    origin: int = 3  # (3) [m]
    rotation: int = 6  # quaternion (4) wxyz
    width: int = 10


CHAIN, FRAME = ChainColumns(), FrameColumns()


@kernel
def forward(chain, q, frames):
    """Return the pose of the tcp as a tuple, and store the pose of every joint.

    Args:
        chain: (dof + 1, 8), see CHAIN.
        q: (dof,) joint positions [rad or m].
        frames: (dof, 10), written: each joint's frame after the joint has moved, see FRAME.
    """
    r = (1.0, 0.0, 0.0, 0.0)
    p = (0.0, 0.0, 0.0)
    n = len(chain) - 1
    for i in range(n + 1):
        step = screw.rotate(r, (chain[i, CHAIN.offset], chain[i, CHAIN.offset + 1], chain[i, CHAIN.offset + 2]))
        p = (p[0] + step[0], p[1] + step[1], p[2] + step[2])
        k = CHAIN.rotation
        r = screw.qmul(r, (chain[i, k], chain[i, k + 1], chain[i, k + 2], chain[i, k + 3]))
        if i < n:
            w, x, y, z = r
            axis = (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), w * w - x * x - y * y + z * z)
            if chain[i, CHAIN.kind] == REVOLUTE:
                s, c = math.sin(0.5 * q[i]), math.cos(0.5 * q[i])
                r = (w * c - z * s, x * c + y * s, y * c - x * s, z * c + w * s)
            else:
                p = (p[0] + q[i] * axis[0], p[1] + q[i] * axis[1], p[2] + q[i] * axis[2])
            for k in range(3):
                frames[i, FRAME.axis + k] = axis[k]
                frames[i, FRAME.origin + k] = p[k]
            for k in range(4):
                frames[i, FRAME.rotation + k] = r[k]
    return screw.from_pose(p, r)


@kernel
def body_jacobian(chain, x, frames, jacobian):
    """Compute the body Jacobian, rows (v, omega).

    Args:
        chain: (dof + 1, 8), see the module.
        x: dual quaternion of the tcp, as returned by `forward`.
        frames: (dof, 10), as stored by `forward`.
        jacobian: (6 or more, dof); its first six rows are written.
    """
    inverse = (x[0], -x[1], -x[2], -x[3])
    p = screw.translation(x)
    for i in range(len(chain) - 1):
        axis = (frames[i, FRAME.axis], frames[i, FRAME.axis + 1], frames[i, FRAME.axis + 2])
        w = screw.rotate(inverse, axis)
        if chain[i, CHAIN.kind] == REVOLUTE:
            k = FRAME.origin
            lever = (p[0] - frames[i, k], p[1] - frames[i, k + 1], p[2] - frames[i, k + 2])
            v = screw.rotate(inverse, screw.cross(axis, lever))
        else:
            v = w
            w = (0.0, 0.0, 0.0)
        for k in range(3):
            jacobian[k, i] = v[k]
            jacobian[3 + k, i] = w[k]


@kernel
def forward_into(chain, q, frames, out):
    """Store the pose of the tcp.

    Args:
        chain: (dof + 1, 8), see the module.
        q: (dof,) joint positions [rad or m].
        frames: (dof, 10), written as by `forward`.
        out: (8,) dual quaternion, written.
    """
    x = forward(chain, q, frames)
    for k in range(8):
        out[k] = x[k]


@kernel
def forward_jacobian_into(chain, q, frames, jacobian, out):
    """Store the pose of the tcp and the body Jacobian.

    Args:
        chain: (dof + 1, 8), see the module.
        q: (dof,) joint positions [rad or m].
        frames: (dof, 10), written as by `forward`.
        jacobian: (6 or more, dof), written as by `body_jacobian`.
        out: (8,) dual quaternion, written.
    """
    x = forward(chain, q, frames)
    body_jacobian(chain, x, frames, jacobian)
    for k in range(8):
        out[k] = x[k]
