"""Time-optimal timing of a joint path under speed and acceleration limits: a cubic spline, then TOPP-RA.

Not in the paper, whose controller sets the speed. Reachability analysis after Pham and Pham 2018 (toppra) on a grid;
between grid points the limits are then made exact by one uniform stretch of time, which does not touch the geometry.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from ..arrays import FrozenArrays, checked_array, frozen, numbers
from ..deferred_imports import deferred
from ..errors import BadOption, BadShape, PlanFailed
from ..ranges import check_range

with deferred("matplotlib", "matplotlib.pyplot"):
    from toppra import SplineInterpolator
    from toppra.algorithm import TOPPRA
    from toppra.constraint import DiscretizationType, JointAccelerationConstraint, JointVelocityConstraint

REPEAT = 1e-8
"""Share of the whole path up to which a step counts as none: its ends are one waypoint."""
PARAMETER_RANGE = 5000.0
"""Value of the path parameter at the end, for toppra's absolute tolerances: at 1 and at 100 it fails on many paths with
very uneven steps, at 1000 on few, from 3000 on on none of 700 random ones."""
LEAST_CELLS = 200
"""Grid cells of a whole path."""
LEAST_CELLS_PER_STEP = 8
"""Grid cells between two waypoints."""
MAX_SAMPLES = 1_000_000
"""Samples beyond which dt is taken for a mistake."""


@dataclass(frozen=True, slots=True, eq=False)
class TimedPath(FrozenArrays):
    """A joint path with its timing, sampled evenly, from rest to rest.

    Attributes:
        time: (m,) [s], 0, dt, 2 dt, ...
        joints: (m, dof) [rad or m].
        velocities: (m, dof) [rad/s or m/s].
        deviation: no joint is ever farther than this from the straight lines between the waypoints [rad or m]: what
            a certificate of those lines does not cover. Samples lie on the spline; lines between samples cut it too.
    """

    time: np.ndarray
    joints: np.ndarray
    velocities: np.ndarray
    deviation: float

    def __post_init__(self):
        for name in ("time", "joints", "velocities"):
            object.__setattr__(self, name, frozen(numbers(name, getattr(self, name))))

    @property
    def duration(self) -> float:
        """Seconds from the first to the last sample."""
        return float(self.time[-1])


class _Profile(NamedTuple):
    """Grid (m,), speed along the path at it (m,), acceleration along the path in its cells (m - 1,)."""

    grid: np.ndarray
    speed: np.ndarray
    push: np.ndarray


def time_optimal(joints: ArrayLike, velocity_limits: ArrayLike, acceleration_limits: ArrayLike, dt: float) -> TimedPath:
    """Return the fastest motion along a joint path, from rest to rest, sampled every dt.

    A path of straight lines would have to stop at each corner, so a natural cubic spline is put through the
    waypoints: the closer they are, the closer it stays to the lines. Both limits hold at all times, not only at the
    samples; the duration is rounded up to a multiple of dt by going slower.

    Args:
        joints: (n, dof) waypoints [rad or m]; all are passed, repeated ones once.
        velocity_limits: (dof,) or scalar, largest speeds [rad/s or m/s].
        acceleration_limits: (dof,) or scalar, largest accelerations [rad/s^2 or m/s^2].
        dt: seconds between samples.

    Raises:
        WrongType, BadShape, NotFinite, BadOption: waypoints, limits or dt cannot be used.
        PlanFailed: "plan_failed", no timing was found.
    """
    waypoints = checked_array("joint path", joints, (None, None))
    if 0 in waypoints.shape:
        raise BadShape("joint path", waypoints.shape, "(n, dof) with n >= 1")
    speeds = _limits("velocity_limits", velocity_limits, waypoints.shape[1])
    accelerations = _limits("acceleration_limits", acceleration_limits, waypoints.shape[1])
    check_range("dt", dt, "(0, inf)")
    steps = np.linalg.norm(np.diff(waypoints, axis=0) / speeds, axis=1)
    waypoints = _without_repeats(waypoints, steps)
    if len(waypoints) == 1:
        return TimedPath(np.zeros(1), waypoints, np.zeros_like(waypoints), 0.0)
    # steps weigh as the time that they take at full speed, so that turning and sliding joints can be mixed
    knots = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(waypoints, axis=0) / speeds, axis=1))])
    knots *= PARAMETER_RANGE / knots[-1]
    spline = CubicSpline(knots, waypoints, bc_type="natural")
    profile = _fastest(spline, speeds, accelerations)
    stretch = _needed_stretch(spline, profile, speeds, accelerations)
    return _sampled(spline, profile, stretch, dt, waypoints[-1])


def _limits(name: str, value: ArrayLike, dof: int) -> np.ndarray:
    array = numbers(name, value)
    if array.shape not in ((), (dof,)):
        raise BadShape(name, array.shape, f"({dof},) or a scalar")
    if not ((array > 0.0) & (array < np.inf)).all():
        raise BadOption(name, f"{value} are not positive numbers")
    return np.broadcast_to(array, (dof,)).copy()


def _without_repeats(waypoints: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Waypoints that differ from the one before; the last one stays even if it repeats."""
    kept = waypoints[np.concatenate([[True], steps > REPEAT * steps.sum()])]
    kept[-1] = waypoints[-1] if len(kept) > 1 else kept[-1]
    return kept


def _fastest(spline: CubicSpline, speeds: np.ndarray, accelerations: np.ndarray) -> _Profile:
    """Fastest profile whose limits hold at the ends of every grid cell."""
    knots, waypoints = spline.x, spline(spline.x)
    cells = max(LEAST_CELLS_PER_STEP, math.ceil(LEAST_CELLS / (len(knots) - 1)))
    inside = knots[:-1, None] + np.diff(knots)[:, None] * np.arange(cells) / cells
    grid = np.append(inside.ravel(), knots[-1])
    # units of joints and time in which the limits of acceleration are one, and speeds along the path near one
    lengths = np.abs(np.diff(waypoints, axis=0)).sum(axis=0)
    unit = max(np.max(lengths / speeds), math.sqrt(np.max(lengths / accelerations))) / PARAMETER_RANGE
    top = speeds / (accelerations * unit)
    ones = np.ones_like(top)
    constraints = [
        JointVelocityConstraint(np.stack([-top, top], axis=1)),
        JointAccelerationConstraint(
            np.stack([-ones, ones], axis=1), discretization_scheme=DiscretizationType.Interpolation
        ),
    ]
    path = SplineInterpolator(knots, waypoints / (accelerations * unit**2), bc_type="natural")
    solver = TOPPRA(constraints, path, gridpoints=grid, solver_wrapper="seidel")
    speed = solver.compute_parameterization(0.0, 0.0)[1]
    if speed is None or not np.isfinite(speed).all() or (speed[:-1] + speed[1:] <= 0.0).any():
        raise PlanFailed("plan_failed", f"no timing of {len(waypoints)} waypoints was found under these limits")
    speed = speed / unit
    return _Profile(grid, speed, np.diff(speed**2) / (2.0 * np.diff(grid)))


def _needed_stretch(spline: CubicSpline, profile: _Profile, speeds: np.ndarray, accelerations: np.ndarray) -> float:
    """Factor >= 1 by which time must be stretched so that both limits hold between grid points too.

    In a cell the acceleration of a joint is a quadratic in the path parameter, so its extremes are known exactly;
    the extremes of the speed are at the roots of that quadratic.
    """
    length = np.diff(profile.grid)[:, None]
    slope, bend = spline(profile.grid[:-1], 1), spline(profile.grid[:-1], 2)
    twist = (spline(profile.grid[1:], 2) - bend) / length
    squared, push = profile.speed[:-1, None] ** 2, profile.push[:, None]
    c0, c1, c2 = bend * squared + slope * push, twist * squared + 3.0 * bend * push, 2.5 * twist * push
    with np.errstate(divide="ignore", invalid="ignore"):
        places = [np.zeros_like(c0), np.broadcast_to(length, c0.shape), -c1 / (2.0 * c2), *_roots(c0, c1, c2)]
    stretch = 1.0
    for place in places:
        at = np.clip(np.nan_to_num(place), 0.0, length)
        acceleration = np.abs(c0 + at * (c1 + at * c2))
        pace = np.sqrt(np.maximum(squared + 2.0 * push * at, 0.0))
        speed = np.abs(slope + at * (bend + 0.5 * at * twist)) * pace
        stretch = max(stretch, np.max(speed / speeds), math.sqrt(np.max(acceleration / accelerations)))
    return stretch


def _roots(c0: np.ndarray, c1: np.ndarray, c2: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both roots of `c0 + c1 x + c2 x^2`, also where c2 = 0; NaN or infinite where there are fewer."""
    with np.errstate(divide="ignore", invalid="ignore"):
        # the usual formula cancels where c2 is small
        q = -0.5 * (c1 + np.copysign(np.sqrt(c1**2 - 4.0 * c2 * c0), c1))
        return q / c2, c0 / q


def _deviation(spline: CubicSpline) -> float:
    """Largest distance of a joint from the line between its waypoints at the same parameter.

    In a step of length h the distance is `h^2 / 6 x (1 - x) (m_0 (2 - x) + m_1 (1 + x))`, m the second derivatives.
    """
    bend, square = spline(spline.x, 2), np.diff(spline.x)[:, None] ** 2
    a, b = 2.0 * bend[:-1] + bend[1:], bend[1:] - bend[:-1]
    places = [np.clip(np.nan_to_num(x), 0.0, 1.0) for x in _roots(a, 2.0 * (b - a), -3.0 * b)]
    return float(max(np.max(np.abs(square / 6.0 * x * (1.0 - x) * (a + b * x))) for x in places))


def _sampled(spline: CubicSpline, profile: _Profile, stretch: float, dt: float, end: np.ndarray) -> TimedPath:
    """The profile at multiples of dt, stretched by at least the given factor to a whole number of them."""
    grid, speed, push = profile
    until = np.concatenate([[0.0], np.cumsum(2.0 * np.diff(grid) / (speed[:-1] + speed[1:]))])
    count = max(1, math.ceil(until[-1] * stretch / dt - 1e-9))
    if count > MAX_SAMPLES:
        raise BadOption("dt", f"{dt} s would take {count} samples; allowed are {MAX_SAMPLES}")
    stretch = count * dt / until[-1]
    time = dt * np.arange(count + 1)
    unstretched = np.minimum(time / stretch, until[-1])
    cell = np.clip(np.searchsorted(until, unstretched, side="right") - 1, 0, len(push) - 1)
    since = unstretched - until[cell]
    place = np.minimum(grid[cell] + since * (speed[cell] + 0.5 * since * push[cell]), grid[-1])
    pace = np.maximum(speed[cell] + since * push[cell], 0.0) / stretch
    joints, velocities = spline(place), spline(place, 1) * pace[:, None]
    joints[-1], velocities[-1] = end, 0.0
    return TimedPath(time, joints, velocities, _deviation(spline))
