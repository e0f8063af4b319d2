"""Numbers of a path without physics, equal for every method."""

from __future__ import annotations

import numpy as np

from ...planner import Pose, PosePath, guide_index, imitated_path
from ...planner.geometry import dualquat as dq
from ...planner.geometry.pose import METERS_PER_RADIAN
from .parts import POURING, CarriedPart

REACHED, TURNED = 0.005, 0.05
"""Largest error [m], [rad] of a path's end that counts as reaching the goal; equal to the judge's of plans."""
SAMPLES = 200
"""Number of points, at equal steps of the tcp's path length, used for smoothness."""
FINE, COARSE = 45, 15
"""Steps of the search for the nearest point on a screw: to rounding error, and to some micrometers."""
GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
"""Ratio of the golden section."""


def ending(path: PosePath, goal: Pose) -> tuple[float, float]:
    """Return distance [m] and angle [rad] of a path's end to the goal.

    Args:
        path: path of the tcp.
        goal: goal pose of the tcp.
    """
    distance, angle = path[-1].distance_to(goal)
    return float(distance), float(angle)


def is_reached(distance: float, angle: float) -> bool:
    """Return whether a path with these errors at its end reaches the goal.

    Args:
        distance: distance to the goal [m].
        angle: angle to the goal [rad].
    """
    return distance <= REACHED and angle <= TURNED


def tilt(part: CarriedPart, path: PosePath) -> float:
    """Return the largest tilt while carrying [degrees]; if the part is a pour, before pouring begins.

    Args:
        part: the carried part.
        path: path of the tcp.
    """
    return float(np.degrees(part.tilts(part.carried(path)).max()))


def rim_drift(part: CarriedPart, path: PosePath, goal: Pose) -> float | None:
    """Return the largest distance [m] of the lip from its demonstrated place while pouring.

    Pouring means a tilt of more than 60 degrees. Both lips are expressed relative to the goal, which represents the
    target glass. The demonstrated lip moves along a curve, whose nearest point counts.

    Args:
        part: the carried part.
        path: path of the tcp.
        goal: goal pose of the tcp.

    Returns:
        The drift; None if nothing is poured, NaN if the path never tilts that far.
    """
    if part.lip is None:
        return None
    tilted = part.tilts(path) > POURING
    if not tilted.any():
        return float("nan")
    seen = part.lips(path.moved(goal.inverse()))[tilted]
    return float(max(_to_line(point, part.lip_curve) for point in seen))


def _to_line(point: np.ndarray, line: np.ndarray) -> float:
    """Return the distance [m] of a point (3,) to the polyline through points (n, 3)."""
    a, along = line[:-1], np.diff(line, axis=0)
    share = ((point - a) * along).sum(axis=1) / np.maximum((along * along).sum(axis=1), 1e-300)
    nearest = a + np.clip(share, 0.0, 1.0)[:, None] * along
    return float(np.linalg.norm(point - nearest, axis=1).min())


def path_length(path: PosePath) -> float:
    """Return the length of the tcp's path [m]; rotations do not count."""
    return float(np.linalg.norm(np.diff(path.positions, axis=0), axis=1).sum())


def turning(path: PosePath) -> float:
    """Return the sum of all rotations [rad]."""
    return float(dq.pose_distance(path.dqs[:-1], path.dqs[1:])[1].sum())


def jerk(path: PosePath) -> float:
    """Return the natural logarithm of the dimensionless jerk of the tcp at constant speed; less is smoother.

    A path has no time: its points are sampled at equal steps of its length, and jerk is their third difference. NaN if
    the tcp does not move.
    """
    positions = path.positions
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    if along[-1] < 1e-6:
        return float("nan")
    at = np.linspace(0.0, along[-1], SAMPLES)
    points = np.column_stack([np.interp(at, along, positions[:, k]) for k in range(3)])
    third = np.diff(points, n=3, axis=0) * (SAMPLES - 1) ** 3
    return float(np.log(max((third**2).sum(axis=1).mean(), 1e-300) ** 0.5 / along[-1]))


def aligned_deviation(part: CarriedPart, path: PosePath, goal: Pose, guide: float) -> float:
    """Return the largest distance [m] of the goal-aligned demonstration after the guiding pose to a path.

    Weighted distance (0.2 m/rad). "Method-aligned": for methods that follow the imitated path it is zero by
    construction, so it is no measure of merit.

    Args:
        part: the carried part.
        path: path of the tcp.
        goal: goal pose of the tcp.
        guide: fraction of the path length at the guiding pose.
    """
    imitated = imitated_path(part.shown, goal)
    return curve_gap(imitated[guide_index(imitated, guide) :], path, COARSE)


def curve_gap(poses: PosePath, path: PosePath, refinements: int = FINE) -> float:
    """Return the largest weighted distance [m] of poses to a path; between its poses the path is a screw.

    Args:
        poses: the poses.
        path: the path.
        refinements: steps of the search on each screw.
    """
    if len(path) == 1:
        return float(_gap(poses.dqs, path.dqs).max())
    distance = np.linalg.norm(poses.positions[:, None] - path.positions, axis=-1)
    cosine = np.minimum(np.abs(poses.quaternions @ path.quaternions.T), 1.0)
    nearest = np.hypot(distance, METERS_PER_RADIAN * 2.0 * np.arccos(cosine)).argmin(axis=1)
    found = _gap(poses.dqs, path.dqs[nearest])
    for first in (np.maximum(nearest - 1, 0), np.minimum(nearest, len(path) - 2)):
        found = np.minimum(found, _to_screws(poses.dqs, path.dqs[first], path.dqs[first + 1], refinements))
    return float(found.max())


def _gap(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    distance, angle = dq.pose_distance(a, b)
    return np.hypot(distance, METERS_PER_RADIAN * angle)


def _to_screws(poses: np.ndarray, first: np.ndarray, last: np.ndarray, refinements: int) -> np.ndarray:
    """Return the distances (n,) [m] of poses (n, 8) to screws, by golden-section search."""
    low, high = np.zeros(len(poses)), np.ones(len(poses))
    for _ in range(refinements):
        left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        nearer = _gap(poses, dq.sclerp(first, last, left)) < _gap(poses, dq.sclerp(first, last, right))
        low, high = np.where(nearer, low, left), np.where(nearer, right, high)
    return _gap(poses, dq.sclerp(first, last, 0.5 * (low + high)))
