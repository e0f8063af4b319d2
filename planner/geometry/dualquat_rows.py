"""Dual quaternions row by row: the compiled loops of `dualquat`."""

from __future__ import annotations

import math

from ..jit import inlined, kernel
from . import screw

ON_MANIFOLD = 1e-14
"""Deviation from a unit dual quaternion that is rounding: such rows stay as they are, to the last bit."""


@kernel
def mul_rows(a, b, out):
    """Write the products of rows, see `screw.mul`.

    Args:
        a: (n, 8).
        b: (n, 8).
        out: (n, 8), the result.
    """
    for i in range(len(out)):
        screw.store8(out, i, screw.mul(screw.load8(a, i), screw.load8(b, i)))


@kernel
def sclerp_rows(a, b, tau, shortest, out):
    """Write poses on the screws between rows.

    Args:
        a: (n, 8) poses at the start.
        b: (n, 8) poses at the end.
        tau: (n,) parts of the way.
        shortest: False: the sign of b tells the direction of rotation.
        out: (n, 8), the result.
    """
    for i in range(len(out)):
        x = screw.load8(a, i)
        z = screw.mul(screw.conj(x), screw.load8(b, i))
        xi = screw.twist_of(z) if shortest else screw.twist_along(z)
        screw.store8(out, i, screw.mul(x, screw.from_twist(screw.scaled(xi, tau[i]))))


@kernel
def twist_rows(x, out):
    """Write the twists of the shortest screw motions to rows.

    Args:
        x: (n, 8).
        out: (n, 6), the result.
    """
    for i in range(len(out)):
        xi = screw.twist_of(screw.load8(x, i))
        for k in range(6):
            out[i, k] = xi[k]


@kernel
def exp_rows(xi, out):
    """Write the displacements by constant twists.

    Args:
        xi: (n, 6).
        out: (n, 8), the result.
    """
    for i in range(len(out)):
        t = (xi[i, 0], xi[i, 1], xi[i, 2], xi[i, 3], xi[i, 4], xi[i, 5])
        screw.store8(out, i, screw.from_twist(t))


@kernel
def normalize_rows(x, out):
    """Write the nearest unit dual quaternions.

    Args:
        x: (n, 8).
        out: (n, 8), the result.
    """
    for i in range(len(out)):
        screw.store8(out, i, screw.normalized(screw.load8(x, i)))


@inlined
def _norm_and_slant(x, i):
    """Norm of the primary part of a row, and the size of its product with the dual part."""
    r = x[i, 0] * x[i, 0] + x[i, 1] * x[i, 1] + x[i, 2] * x[i, 2] + x[i, 3] * x[i, 3]
    d = x[i, 0] * x[i, 4] + x[i, 1] * x[i, 5] + x[i, 2] * x[i, 6] + x[i, 3] * x[i, 7]
    return math.sqrt(r), abs(d)


@kernel
def worst_rows(x):
    """Return how far rows are from unit dual quaternions.

    Returns:
        (row, off, slant, farthest): the row farthest from the unit norm and by how much, the largest product of its
        parts, the largest dual number; NaN where a number is not finite.
    """
    worst, off, slant, farthest = 0, 0.0, 0.0, 0.0
    for i in range(len(x)):
        for k in range(8):
            if not math.isfinite(x[i, k]):
                return i, math.nan, math.nan, math.nan
        norm, product = _norm_and_slant(x, i)
        if abs(norm - 1.0) > off:
            worst, off = i, abs(norm - 1.0)
        slant = max(slant, product)
        for k in range(4, 8):
            farthest = max(farthest, abs(x[i, k]))
    return worst, off, slant, farthest


@kernel
def project_rows(x):
    """Project the rows to the manifold that are not on it."""
    for i in range(len(x)):
        norm, product = _norm_and_slant(x, i)
        if abs(norm - 1.0) > ON_MANIFOLD or product > ON_MANIFOLD:
            screw.store8(x, i, screw.normalized(screw.load8(x, i)))


@kernel
def from_pose_rows(p, r, out):
    """Write the dual quaternions of positions and rotations.

    Args:
        p: (n, 3) positions [m].
        r: (n, 4) quaternions wxyz.
        out: (n, 8), the result.
    """
    for i in range(len(out)):
        screw.store8(out, i, screw.from_pose((p[i, 0], p[i, 1], p[i, 2]), (r[i, 0], r[i, 1], r[i, 2], r[i, 3])))


@kernel
def translation_rows(x, out):
    """Write the positions of rows.

    Args:
        x: (n, 8).
        out: (n, 3), the result [m].
    """
    for i in range(len(out)):
        t = screw.translation(screw.load8(x, i))
        for k in range(3):
            out[i, k] = t[k]
