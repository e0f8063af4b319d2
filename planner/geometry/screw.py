"""Compiled kernels of quaternions, dual quaternions and screw motions on tuples of floats.

A quaternion is `(w, x, y, z)`, a unit dual quaternion `(primary wxyz, dual wxyz)`, a twist `(v, omega)` in
the body frame [m and rad per unit of time]. Tuples live in registers: nothing is allocated. `dualquat` wraps these
kernels for arrays. Formulas: the screw (not the decoupled) logarithm, with series where closed forms lose digits.
"""

from __future__ import annotations

import math

from ..jit import kernel

IDENTITY = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
HALF_TURN = 1e-12
"""Absolute scalar part below which the shortest rotation is ambiguous (a half turn in either sense)."""


@kernel
def load8(array, row):
    """Return a row of an array as a tuple.

    Args:
        array: (n, 8).
        row: index of the row.
    """
    return (
        array[row, 0], array[row, 1], array[row, 2], array[row, 3],
        array[row, 4], array[row, 5], array[row, 6], array[row, 7],
    )  # fmt: skip


@kernel
def store8(array, row, x):
    """Write a tuple into a row of an array.

    Args:
        array: (n, 8), changed in place.
        row: index of the row.
        x: 8 numbers.
    """
    for k in range(8):
        array[row, k] = x[k]


@kernel
def cross(a, b):
    """Return the cross product of two vectors.

    Args:
        a: left factor, 3 numbers.
        b: right factor.
    """
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@kernel
def qmul(a, b):
    """Return the Hamilton product of two quaternions.

    Args:
        a: left factor.
        b: right factor.
    """
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


@kernel
def rotate(r, p):
    """Rotate a vector from the body to the world frame.

    Args:
        r: unit quaternion, `world_from_body`.
        p: 3 numbers.
    """
    u = (r[1], r[2], r[3])
    t = cross(u, p)
    t = (2.0 * t[0], 2.0 * t[1], 2.0 * t[2])
    s = cross(u, t)
    return (p[0] + r[0] * t[0] + s[0], p[1] + r[0] * t[1] + s[1], p[2] + r[0] * t[2] + s[2])


@kernel
def mul(a, b):
    """Multiply two dual quaternions, which composes poses: `world_from_b` times `b_from_c`.

    Args:
        a: left factor.
        b: right factor.
    """
    r = qmul(a[:4], b[:4])
    d = qmul(a[:4], b[4:])
    e = qmul(a[4:], b[:4])
    return (r[0], r[1], r[2], r[3], d[0] + e[0], d[1] + e[1], d[2] + e[2], d[3] + e[3])


@kernel
def conj(x):
    """Return the conjugate, the inverse of a unit dual quaternion."""
    return (x[0], -x[1], -x[2], -x[3], x[4], -x[5], -x[6], -x[7])


@kernel
def neg(x):
    """Return the other dual quaternion of the same pose."""
    return (-x[0], -x[1], -x[2], -x[3], -x[4], -x[5], -x[6], -x[7])


@kernel
def from_pose(p, r):
    """Return the unit dual quaternion of a position and a unit quaternion.

    Args:
        p: position, 3 numbers [m].
        r: unit quaternion.
    """
    d = qmul((0.0, p[0], p[1], p[2]), r)
    return (r[0], r[1], r[2], r[3], 0.5 * d[0], 0.5 * d[1], 0.5 * d[2], 0.5 * d[3])


@kernel
def translation(x):
    """Return the position [m] of a unit dual quaternion."""
    t = qmul(x[4:], (x[0], -x[1], -x[2], -x[3]))
    return (2.0 * t[1], 2.0 * t[2], 2.0 * t[3])


@kernel
def normalized(x):
    """Return the nearest unit dual quaternion: unit primary part, dual part orthogonal to the primary part."""
    n = math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + x[3] * x[3])
    r = (x[0] / n, x[1] / n, x[2] / n, x[3] / n)
    s = r[0] * x[4] + r[1] * x[5] + r[2] * x[6] + r[3] * x[7]
    return (
        r[0], r[1], r[2], r[3],
        (x[4] - s * r[0]) / n, (x[5] - s * r[1]) / n, (x[6] - s * r[2]) / n, (x[7] - s * r[3]) / n,
    )  # fmt: skip


@kernel
def shorter(x):
    """Return x or -x, whichever rotates by at most a half turn.

    At a half turn both are equally short; then the first non-zero component of the axis is positive.
    """
    flip = x[0] < 0.0
    if abs(x[0]) < HALF_TURN:
        flip = False
        for k in range(1, 4):
            if abs(x[k]) > HALF_TURN:
                flip = x[k] < 0.0
                break
    return neg(x) if flip else x


@kernel
def twist_along(x):
    """Return the body twist (v, omega) that reaches x from the identity in unit time, with the sign of x as given.

    Not the shortest motion where the scalar part is negative. At x = -1 the full turn has no axis: no
    rotation is returned.
    """
    s = math.sqrt(x[1] * x[1] + x[2] * x[2] + x[3] * x[3])
    theta = 2.0 * math.atan2(s, x[0])
    p = translation(x)
    if s < 1e-6:
        if x[0] < 0.0:
            return (p[0], p[1], p[2], 0.0, 0.0, 0.0)
        ratio = 2.0 * (1.0 + s * s * (1.0 / 6.0 + 3.0 / 40.0 * s * s))
    else:
        ratio = theta / s
    w = (ratio * x[1], ratio * x[2], ratio * x[3])
    if theta < 1e-2:
        t2 = theta * theta
        c = 1.0 / 12.0 + t2 * (1.0 / 720.0 + t2 / 30240.0)
    else:
        # s and x[0] are sin and cos of theta / 2
        c = (1.0 - 0.5 * theta * x[0] / s) / (theta * theta)
    wp = cross(w, p)
    wwp = cross(w, wp)
    return (
        p[0] - 0.5 * wp[0] + c * wwp[0],
        p[1] - 0.5 * wp[1] + c * wwp[1],
        p[2] - 0.5 * wp[2] + c * wwp[2],
        w[0], w[1], w[2],
    )  # fmt: skip


@kernel
def twist_of(x):
    """Return the body twist (v, omega) of the shortest screw motion to x: twice the screw logarithm."""
    return twist_along(shorter(x))


@kernel
def from_twist(xi):
    """Return the unit dual quaternion reached by a constant body twist (v, omega) in unit time."""
    v = (xi[0], xi[1], xi[2])
    w = (xi[3], xi[4], xi[5])
    theta = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    t2 = theta * theta
    if theta < 1e-2:
        half_sinc = 0.5 - t2 * (1.0 / 48.0 - t2 / 3840.0)
        b = 1.0 / 6.0 - t2 * (1.0 / 120.0 - t2 / 5040.0)
    else:
        half_sinc = math.sin(0.5 * theta) / theta
        b = (theta - math.sin(theta)) / (theta * t2)
    a = 2.0 * half_sinc * half_sinc
    wv = cross(w, v)
    wwv = cross(w, wv)
    p = (v[0] + a * wv[0] + b * wwv[0], v[1] + a * wv[1] + b * wwv[1], v[2] + a * wv[2] + b * wwv[2])
    r = (math.cos(0.5 * theta), half_sinc * w[0], half_sinc * w[1], half_sinc * w[2])
    return from_pose(p, r)


@kernel
def scaled(xi, tau):
    """Multiply a twist by a number.

    Args:
        xi: twist.
        tau: the number.
    """
    return (tau * xi[0], tau * xi[1], tau * xi[2], tau * xi[3], tau * xi[4], tau * xi[5])


@kernel
def sclerp(a, b, tau):
    """Interpolate along the shorter screw motion from one pose to another.

    Args:
        a: dual quaternion at tau = 0.
        b: dual quaternion at tau = 1.
        tau: fraction of the motion.
    """
    return mul(a, from_twist(scaled(twist_of(mul(conj(a), b)), tau)))


@kernel
def pose_distance(a, b):
    """Return the distance of the origins [m] and the rotation angle [rad] between two poses.

    Args:
        a: dual quaternion of one pose; its sign does not matter.
        b: dual quaternion of the other pose.
    """
    z = mul(conj(a), b)
    t = translation(z)
    s = math.sqrt(z[1] * z[1] + z[2] * z[2] + z[3] * z[3])
    return math.sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]), 2.0 * math.atan2(s, abs(z[0]))
