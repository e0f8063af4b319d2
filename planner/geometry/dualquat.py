"""Unit dual quaternions on arrays `(..., 8)`: primary wxyz, dual wxyz; products compose poses.

All functions broadcast over leading axes and return new float64 arrays. x and -x are the same pose; each function
states how it treats the sign. Logarithm, power and interpolation are the screw versions: rotation and translation
share one axis. (DQ Robotics' `log` and `pow` decouple them: see `decoupled_lerp`.) Conventions: method reference
section 1, twists `(v, omega)` in the body frame.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import broadcast_shape, checked_array, numbers
from ..errors import BadShape, NotFinite, NotUnit
from . import screw
from .dualquat_rows import (
    ON_MANIFOLD,
    exp_rows,
    from_pose_rows,
    mul_rows,
    normalize_rows,
    project_rows,
    sclerp_rows,
    translation_rows,
    twist_rows,
    worst_rows,
)

Array = np.ndarray
CONJUGATE_8 = np.diag([1.0, -1.0, -1.0, -1.0, 1.0, -1.0, -1.0, -1.0])
CONJUGATE_8.flags.writeable = False
UNIT_TOLERANCE = 1e-6
"""Deviation from a unit dual quaternion beyond which numbers are refused."""


class ScrewParameters(NamedTuple):
    """The screw of a displacement (Chasles): rotation by `angle` about an axis, translation by `travel` along it.

    Attributes:
        axis: (3,) unit direction; zero for the identity.
        moment: (3,) moment of the axis about the origin [m]; zero for a pure translation.
        angle: rotation [rad] in [0, pi].
        travel: translation along the axis [m]; the whole translation if angle = 0.
    """

    axis: Array
    moment: Array
    angle: float
    travel: float

    @property
    def point(self) -> Array:
        """Point (3,) of the axis closest to the origin [m]."""
        return np.cross(self.axis, self.moment)

    @property
    def pitch(self) -> float:
        """Travel per radian [m/rad]; infinite for a pure translation."""
        return self.travel / self.angle if self.angle > 0 else math.inf


def _rows(name: str, value: ArrayLike, width: int) -> Array:
    array = numbers(name, value)
    if array.ndim == 0 or array.shape[-1] != width:
        raise BadShape(name, array.shape, f"(..., {width})")
    return array


def _flat(array: Array, shape: tuple[int, ...], width: int) -> Array:
    spread = array if array.shape == (*shape, width) else np.broadcast_to(array, (*shape, width))
    return np.ascontiguousarray(spread.reshape(-1, width))


def _mapped(rows, x: ArrayLike, width_in: int, width_out: int, name: str) -> Array:
    array = _rows(name, x, width_in)
    out = np.empty((array.size // width_in, width_out))
    rows(_flat(array, array.shape[:-1], width_in), out)
    return out.reshape(*array.shape[:-1], width_out)


def identity() -> Array:
    """Return the dual quaternion (8,) of no displacement."""
    return np.array(screw.IDENTITY)


def mul(a: ArrayLike, b: ArrayLike) -> Array:
    """See `screw.mul`; the arrays (..., 8) broadcast."""
    a, b = _rows("a", a, 8), _rows("b", b, 8)
    shape = broadcast_shape("a and b", a.shape[:-1], b.shape[:-1])
    out = np.empty((math.prod(shape), 8))
    mul_rows(_flat(a, shape, 8), _flat(b, shape, 8), out)
    return out.reshape(*shape, 8)


def conj(x: ArrayLike) -> Array:
    """Return the conjugate (..., 8), the inverse of a unit dual quaternion."""
    return _rows("dual quaternion", x, 8) * np.diag(CONJUGATE_8)


def normalized(x: ArrayLike) -> Array:
    """Return the nearest unit dual quaternion (..., 8) of the same sign."""
    return _mapped(normalize_rows, x, 8, 8, "dual quaternion")


def checked_unit(x: ArrayLike, name: str = "dual quaternion") -> Array:
    """Check unit dual quaternions and project them to the manifold; exact ones stay bit-identical.

    Args:
        x: (..., 8) unit up to rounding.
        name: subject of error messages.

    Raises:
        BadShape, NotFinite, NotUnit: x is not a unit dual quaternion within 1e-6.
    """
    array = _rows(name, x, 8)
    rows = _flat(array, array.shape[:-1], 8)
    worst, off, slant, farthest = worst_rows(rows)
    if math.isnan(off):
        bad = np.argwhere(~np.isfinite(array))[0]
        raise NotFinite(name, tuple(int(k) for k in bad))
    if off > UNIT_TOLERANCE:
        raise NotUnit(name, float(np.linalg.norm(rows[worst, :4])))
    if slant > UNIT_TOLERANCE * (1.0 + farthest):
        what = f"{name}, whose dual part is not orthogonal to its primary part,"
        raise NotUnit(what, float(np.sqrt(1 + slant)))
    if off <= ON_MANIFOLD and slant <= ON_MANIFOLD:
        return array
    out = rows.copy()
    project_rows(out)
    return out.reshape(array.shape)


def from_position_quaternion(position: ArrayLike, wxyz: ArrayLike) -> Array:
    """See `screw.from_pose`: (..., 8) of positions (..., 3) [m] and unit quaternions (..., 4) wxyz."""
    p, r = _rows("position", position, 3), _rows("quaternion", wxyz, 4)
    shape = broadcast_shape("position and quaternion", p.shape[:-1], r.shape[:-1])
    out = np.empty((math.prod(shape), 8))
    from_pose_rows(_flat(p, shape, 3), _flat(r, shape, 4), out)
    return out.reshape(*shape, 8)


def translation(x: ArrayLike) -> Array:
    """Return positions (..., 3) [m]; the sign of x does not matter."""
    return _mapped(translation_rows, x, 8, 3, "dual quaternion")


def twist_from_dq(x: ArrayLike) -> Array:
    """Return the body twist (..., 6), (v, omega), of the shortest screw motion to x in unit time (`pinocchio.log6`)."""
    return _mapped(twist_rows, x, 8, 6, "dual quaternion")


def dq_from_twist(twist: ArrayLike) -> Array:
    """Return the unit dual quaternion (..., 8) reached by a constant body twist (..., 6), (v, omega), in unit time."""
    return _mapped(exp_rows, twist, 6, 8, "twist")


def log(x: ArrayLike) -> Array:
    """Return the screw logarithm (..., 8), a pure dual quaternion `(0, omega / 2, 0, v / 2)`; sign-free (shortest)."""
    twist = 0.5 * twist_from_dq(x)
    zero = np.zeros((*twist.shape[:-1], 1))
    return np.concatenate([zero, twist[..., 3:], zero, twist[..., :3]], axis=-1)


def exp(pure: ArrayLike) -> Array:
    """Return the exponential (..., 8) of a pure dual quaternion (..., 8), the inverse of `log`."""
    pure = _rows("pure dual quaternion", pure, 8)
    return dq_from_twist(2.0 * np.concatenate([pure[..., 5:], pure[..., 1:4]], axis=-1))


def power(x: ArrayLike, tau: ArrayLike) -> Array:
    """See `sclerp`: x^tau (..., 8), the fraction tau of the shortest screw motion from the identity to x."""
    twist, fraction = twist_from_dq(x), numbers("tau", tau)
    broadcast_shape("x and tau", twist.shape[:-1], fraction.shape)
    return dq_from_twist(fraction[..., None] * twist)


def sclerp(start: ArrayLike, end: ArrayLike, tau: ArrayLike, *, shortest: bool = True) -> Array:
    """Interpolate along a screw: `start (start* end)^tau` (..., 8), a constant body twist along tau.

    Args:
        start: (..., 8) pose at tau = 0.
        end: (..., 8) pose at tau = 1.
        tau: (...) fraction; outside [0, 1] the screw motion is extrapolated.
        shortest: True for the shorter rotation; False keeps the signs as given (deliberately the longer one).

    Paper: section II-A (ScLERP). The "minimum length" it claims does not hold; the equivariance does.
    """
    a, b, t = _rows("start", start, 8), _rows("end", end, 8), numbers("tau", tau)
    shape = broadcast_shape("start, end and tau", a.shape[:-1], b.shape[:-1], t.shape)
    out = np.empty((math.prod(shape), 8))
    flat_tau = np.ascontiguousarray(np.broadcast_to(t, shape).reshape(-1))
    sclerp_rows(_flat(a, shape, 8), _flat(b, shape, 8), flat_tau, shortest, out)
    return out.reshape(*shape, 8)


def is_half_turn(x: ArrayLike) -> Array:
    """Return True (...) at a half turn: both rotations are equally short, so the sign of the axis is arbitrary."""
    return np.abs(_rows("dual quaternion", x, 8)[..., 0]) < screw.HALF_TURN


def screw_parameters(x: ArrayLike) -> ScrewParameters:
    """Return the screw of the shorter motion to a displacement (8,); a pure translation has angle 0 and no moment."""
    twist = twist_from_dq(checked_array("dual quaternion", x, (8,)))
    v, omega = twist[:3], twist[3:]
    angle = float(np.linalg.norm(omega))
    if angle == 0.0:
        travel = float(np.linalg.norm(v))
        return ScrewParameters(v / travel if travel else np.zeros(3), np.zeros(3), 0.0, travel)
    axis = omega / angle
    travel = float(axis @ v)
    return ScrewParameters(axis, (v - travel * axis) / angle, angle, travel)


def dq_from_screw_parameters(screw_: ScrewParameters) -> Array:
    """Return the displacement (8,) of a screw; inverse of `screw_parameters` up to sign."""
    half = 0.5 * screw_.angle
    sine, cosine = math.sin(half), math.cos(half)
    dual = screw_.moment * sine + 0.5 * screw_.travel * cosine * screw_.axis
    return np.concatenate([[cosine], sine * screw_.axis, [-0.5 * screw_.travel * sine], dual])


def hamilton_plus(a: ArrayLike) -> Array:
    """Return the matrix H+ (8, 8) of multiplication from the left, `vec(a b) = H+(a) vec(b)`."""
    return _hamilton(a, 1.0)


def hamilton_minus(b: ArrayLike) -> Array:
    """Return the matrix H- (8, 8) of multiplication from the right, `vec(a b) = H-(b) vec(a)`."""
    return _hamilton(b, -1.0)


def _hamilton(x: ArrayLike, sign: float) -> Array:
    def block(w: float, i: float, j: float, k: float) -> Array:
        s = sign
        return np.array([[w, -i, -j, -k], [i, w, -s * k, s * j], [j, s * k, w, -s * i], [k, -s * j, s * i, w]])

    x = checked_array("dual quaternion", x, (8,))
    out = np.zeros((8, 8))
    out[:4, :4] = out[4:, 4:] = block(*x[:4])
    out[4:, :4] = block(*x[4:])
    return out


def pose_error(current: ArrayLike, target: ArrayLike) -> Array:
    """Return the distance (...) between poses, `min(|1 - c*x|, |1 + c*x|)` in R^8; zero iff the poses are equal.

    Left-invariant and sign-free.

    Args:
        current: (..., 8) pose c.
        target: (..., 8) pose x.

    Not in the paper: the norm printed there, of a pair of vectors, depends on the world origin and on the sign.
    """
    z = mul(conj(current), target)
    one = identity()
    return np.minimum(np.linalg.norm(one - z, axis=-1), np.linalg.norm(one + z, axis=-1))


def pose_distance(current: ArrayLike, target: ArrayLike) -> tuple[Array, Array]:
    """See `screw.pose_distance`: distance of the origins (...) [m] and rotation angle (...) [rad]; sign-free."""
    z = mul(conj(current), target)
    angle = 2.0 * np.arctan2(np.linalg.norm(z[..., 1:4], axis=-1), np.abs(z[..., 0]))
    return np.linalg.norm(translation(z), axis=-1), angle


def continuous(path: ArrayLike) -> Array:
    """Return the path (n, 8) with signs flipped so that neighbors lie on the same side of the double cover."""
    path = checked_array("path", path, (None, 8), finite=False)
    if len(path) < 2:
        return path.copy()
    turns = np.where(np.sum(path[1:, :4] * path[:-1, :4], axis=1) < 0.0, -1.0, 1.0)
    return path * np.concatenate([[1.0], np.cumprod(turns)])[:, None]


def decoupled_lerp(start: ArrayLike, end: ArrayLike, tau: ArrayLike) -> Array:
    """See `sclerp` (shortest) for the arguments: here the position moves on a straight line, the rotation by slerp.

    Not a screw motion: the result depends on the choice of the tool frame. For comparison only.
    """
    start, end = _rows("start", start, 8), _rows("end", end, 8)
    tau, a, b = numbers("tau", tau), start.copy(), end.copy()
    a[..., 4:], b[..., 4:] = 0.0, 0.0
    turn, p, q = sclerp(a, b, tau)[..., :4], translation(start), translation(end)
    return from_position_quaternion(p + tau[..., None] * (q - p), turn)
