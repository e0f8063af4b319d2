"""Smooth (C1) paths through given poses, and thinning of dense paths; built of screw motions only.

A Hermite segment is a Bezier curve on the group: four control poses, joined by de Casteljau's scheme with ScLERP
in place of the straight line. Body twists at the knots are averages of the adjacent screws. All of it is
equivariant to changes of world and of tool frame as long as the knots are; see `knots_of`.

Not in the paper: its paths have corners in the twist. Method reference section 9; compare Allmendinger,
Charaf Eddine and Corves 2018. Smoothing moves the path between the knots: collisions must be checked again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import FrozenArrays, frozen, numbers
from ..errors import BadOption, BadShape, NotFinite
from ..jit import kernel
from ..ranges import check_choice, check_range
from . import dualquat as dq
from . import screw
from .pose import METERS_PER_RADIAN, PosePath

REPEAT = 1e-9
"""Path length [m] below which neighbors count as the same pose."""
SERIES_TERMS = 40
"""Terms of the Jacobian of exp: the truncation error is below rounding for rotations up to a full turn."""


@kernel
def _between(a, b, tau):
    """ScLERP with the signs as given: no jump where a control polygon turns by more than a half turn."""
    xi = screw.twist_along(screw.mul(screw.conj(a), b))
    return screw.mul(a, screw.from_twist(screw.scaled(xi, tau)))


@kernel
def _bezier_rows(controls, segment, tau, out):
    for i in range(len(out)):
        k = 4 * segment[i]
        b0, b1 = screw.load8(controls, k), screw.load8(controls, k + 1)
        b2, b3 = screw.load8(controls, k + 2), screw.load8(controls, k + 3)
        c0, c1, c2 = _between(b0, b1, tau[i]), _between(b1, b2, tau[i]), _between(b2, b3, tau[i])
        d0, d1 = _between(c0, c1, tau[i]), _between(c1, c2, tau[i])
        screw.store8(out, i, _between(d0, d1, tau[i]))


@kernel
def _worst_between(dqs, lengths, first, last, lever):
    """Return the largest weighted distance [m] of poses to the screw between two of them, and the index of that pose.

    Poses are compared at equal fractions of the path length.
    """
    worst, where = 0.0, first
    a, b = screw.load8(dqs, first), screw.load8(dqs, last)
    whole = lengths[last] - lengths[first]
    for k in range(first + 1, last):
        tau = (lengths[k] - lengths[first]) / whole if whole > 0.0 else 0.0
        distance, angle = screw.pose_distance(screw.sclerp(a, b, tau), screw.load8(dqs, k))
        off = (distance**2 + (lever * angle) ** 2) ** 0.5
        if off > worst:
            worst, where = off, k
    return worst, where


@dataclass(frozen=True, slots=True, eq=False)
class SmoothPath(FrozenArrays):
    """A C1 curve through poses with given body twists; the parameter u has the unit of the knots.

    Attributes:
        knots: (n,) values of u, increasing, n >= 2.
        dqs: (n, 8) poses at the knots.
        twists: (n, 6) body twists (v, omega) at the knots [m and rad per unit of u].
    """

    knots: np.ndarray
    dqs: np.ndarray
    twists: np.ndarray

    def __post_init__(self):
        poses = PosePath(self.dqs).dqs
        knots, twists = frozen(numbers("knots", self.knots)), frozen(numbers("twists", self.twists))
        if len(poses) < 2:
            raise BadShape("path", poses.shape, "(n, 8) with n >= 2 different poses")
        _check_knots(knots, len(poses))
        if twists.shape != (len(poses), 6):
            raise BadShape("twists", twists.shape, f"({len(poses)}, 6)")
        if not np.isfinite(twists).all():
            raise NotFinite("twists", int(np.argwhere(~np.isfinite(twists))[0, 0]))
        for name, value in (("knots", knots), ("dqs", poses), ("twists", twists)):
            object.__setattr__(self, name, value)

    def poses(self, u: ArrayLike) -> np.ndarray:
        """Return poses (m, 8) at parameters u (m,); exactly the given ones at the knots."""
        segment, tau = self._located(u)
        out = np.empty((len(tau), 8))
        _bezier_rows(self._controls().reshape(-1, 8), segment, tau, out)
        at_end = tau == 1.0
        out[at_end] = self.dqs[segment[at_end] + 1]
        return out

    def body_twists(self, u: ArrayLike) -> np.ndarray:
        """Return body twists (m, 6), (v, omega), per unit of u, at parameters u (m,): exact derivatives of `poses`."""
        segment, tau = self._located(u)
        poses = [self._controls()[segment, k] for k in range(4)]
        twists = [np.zeros((len(tau), 6)) for _ in range(4)]
        for level in (3, 2, 1):
            pairs = range(level)
            twists = [_twist_between(poses[k], twists[k], poses[k + 1], twists[k + 1], tau) for k in pairs]
            poses = [dq.sclerp(poses[k], poses[k + 1], tau, shortest=False) for k in pairs]
        return twists[0] / np.diff(self.knots)[segment, None]

    def _located(self, u: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Return the segment (m,) and the fraction of the segment (m,) of parameters u (m,)."""
        u = numbers("u", u)
        low, high = self.knots[[0, -1]]
        if u.ndim != 1:
            raise BadShape("u", u.shape, "(m,)")
        if not ((low <= u) & (u <= high)).all():
            raise BadOption("u", f"a value is outside the knots [{low:g}, {high:g}]")
        segment = np.clip(np.searchsorted(self.knots, u, side="right") - 1, 0, len(self.knots) - 2)
        return segment, (u - self.knots[segment]) / (self.knots[segment + 1] - self.knots[segment])

    def _controls(self) -> np.ndarray:
        """Return control poses (n - 1, 4, 8): the inner ones a third of a step along the twists at both ends."""
        third = np.diff(self.knots)[:, None] / 3.0
        after = dq.mul(self.dqs[:-1], dq.dq_from_twist(third * self.twists[:-1]))
        before = dq.mul(self.dqs[1:], dq.dq_from_twist(-third * self.twists[1:]))
        return np.stack([self.dqs[:-1], after, before, self.dqs[1:]], axis=1)


def knots_of(path: PosePath, knots: str | ArrayLike = "length") -> np.ndarray:
    """Return the knots (n,) of a path.

    Args:
        path: n poses.
        knots: "length" (path length [m]: left-invariant, depends on the body origin), "index" (invariant to both
            world and tool changes, but uneven steps overshoot), or (n,) increasing numbers, such as times [s].

    Raises:
        BadOption, BadShape: unknown name, knots that do not increase, or another number of knots.
    """
    if isinstance(knots, str):
        if knots not in ("length", "index"):
            raise BadOption("knots", f"{knots!r} is not one of length, index, nor an array")
        return path.lengths() if knots == "length" else np.arange(float(len(path)))
    array = numbers("knots", knots)
    _check_knots(array, len(path))
    return array


def smooth(path: PosePath, *, knots: str | ArrayLike = "length", ends: str = "one-sided") -> SmoothPath:
    """Lay a C1 curve through the poses of a path.

    The twist at a knot averages the screws before and after it, as a parabola through three points does: even steps
    give the method's `2 log(x_{i-1}* x_{i+1}) / (h_{i-1} + h_i)` up to third order, but without its half-turn limit.

    Args:
        path: at least two different poses.
        knots: see `knots_of`; with "length", repeated poses are dropped.
        ends: twist at the ends, "one-sided" (that of the first and the last screw) or "zero" (at rest).

    Raises:
        BadOption, BadShape: an unknown option, unfit knots, or fewer than two different poses.
    """
    check_choice("ends", ends, ("one-sided", "zero"))
    if isinstance(knots, str) and knots == "length":
        path = PosePath(path.dqs[np.diff(path.lengths(), prepend=-1.0) > REPEAT])
    u = knots_of(path, knots)
    steps = np.diff(u)[:, None]
    slopes = _along(path.dqs[:-1], path.dqs[1:]) / steps
    inner = (steps[1:] * slopes[:-1] + steps[:-1] * slopes[1:]) / (steps[1:] + steps[:-1])
    still = 0.0 if ends == "zero" else 1.0
    return SmoothPath(u, path.dqs, np.concatenate([still * slopes[:1], inner, still * slopes[-1:]]))


def smooth_path(
    path: PosePath, *, knots: str | ArrayLike = "length", per_segment: int = 8, ends: str = "one-sided"
) -> PosePath:
    """Sample the C1 curve through a path, including the given poses.

    Args:
        path: at least two different poses.
        knots: see `knots_of`; with "length", repeated poses are dropped.
        per_segment: number of steps between neighbors, at least 1.
        ends: twist at the ends, "one-sided" or "zero"; see `smooth`.

    Returns:
        Path whose pose `k * per_segment` is pose k of the given path without repeats.

    Raises:
        BadOption, BadShape: as `smooth`.
    """
    if per_segment < 1:
        raise BadOption("per_segment", f"{per_segment} is not at least 1")
    curve = smooth(path, knots=knots, ends=ends)
    inside = curve.knots[:-1, None] + np.diff(curve.knots)[:, None] * np.arange(per_segment) / per_segment
    return PosePath(curve.poses(np.append(inside.ravel(), curve.knots[-1])))


def thinned(path: PosePath, tolerance: float, *, meters_per_radian: float = METERS_PER_RADIAN) -> PosePath:
    """Thin a path such that the screws between the kept poses stay near the path: Douglas-Peucker on the group.

    Every pose of the path is within the tolerance of the screw between the kept poses around it, at the same
    fraction of the path length. Ends are kept. Few poses, not proved to be the fewest. Left-invariant only.

    Args:
        path: n poses.
        tolerance: weighted distance [m], `sqrt(|dp|^2 + (l theta)^2)`.
        meters_per_radian: the lever l [m/rad].

    Raises:
        BadOption: the tolerance is negative or not a number.
    """
    check_range("tolerance", tolerance, "[0, inf]")
    lengths = path.lengths(meters_per_radian)
    keep = np.zeros(len(path), dtype=bool)
    keep[[0, -1]] = True
    spans = [(0, len(path) - 1)]
    while spans:
        first, last = spans.pop()
        worst, where = _worst_between(path.dqs, lengths, first, last, meters_per_radian)
        if worst > tolerance:
            keep[where] = True
            spans += [(first, where), (where, last)]
    return PosePath(path.dqs[keep])


def _check_knots(knots: np.ndarray, count: int) -> None:
    if knots.shape != (count,):
        raise BadShape("knots", knots.shape, f"({count},), one per pose")
    if not (np.isfinite(knots).all() and (np.diff(knots) > 0.0).all()):
        raise BadOption("knots", "they do not increase from pose to pose")


def _along(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return body twists (m, 6) of the screws from a to b (m, 8) in unit time, signs as given."""
    # the rotation halfway is at most a half turn, so that the shortest motion is the intended one
    return 2.0 * dq.twist_from_dq(dq.sclerp(dq.identity(), dq.mul(dq.conj(a), b), 0.5, shortest=False))


def _twist_between(a: np.ndarray, xi_a: np.ndarray, b: np.ndarray, xi_b: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Return the body twist (m, 6) of `S(tau; a, b)` by tau while a and b move with body twists xi_a and xi_b (m, 6).

    With z = a* b, L = log z and J the right Jacobian of exp: `Ad(z^-tau) xi_a + L + tau J(tau L) L'`,
    `L' = J(L)^-1 (xi_b - Ad(z*) xi_a)`.
    """
    along = _along(a, b)
    part = tau[:, None] * along
    change = xi_b - _carried(dq.dq_from_twist(-along), xi_a)
    slope = np.linalg.solve(_exp_jacobian(along), change[..., None])
    turned = (_exp_jacobian(part) @ slope)[..., 0]
    return _carried(dq.dq_from_twist(-part), xi_a) + along + tau[:, None] * turned


def _carried(x: np.ndarray, twists: np.ndarray) -> np.ndarray:
    """Return the adjoint `x xi x*` of twists (m, 6)."""
    zero = np.zeros((len(twists), 1))
    pure = np.concatenate([zero, twists[:, 3:], zero, twists[:, :3]], axis=1)
    out = dq.mul(dq.mul(x, pure), dq.conj(x))
    return np.concatenate([out[:, 5:], out[:, 1:4]], axis=1)


def _exp_jacobian(twists: np.ndarray) -> np.ndarray:
    """Return the right Jacobian (m, 6, 6) of exp at twists (m, 6): `sum_k (-ad)^k / (k + 1)!`."""
    v, w = (np.cross(np.eye(3), part[:, None, :]) for part in (twists[:, :3], twists[:, 3:]))
    ad = np.block([[w, v], [np.zeros_like(w), w]])
    out = np.broadcast_to(np.eye(6), ad.shape)
    for k in range(SERIES_TERMS, 0, -1):
        out = np.eye(6) - ad @ out / (k + 1)
    return out
