"""Turns after which a solid looks the same, from its geometry.

Not in the paper, where each object has one goal: equivalent goals let an arm reach what one of them denies it.
"""

from __future__ import annotations

import math

import numpy as np

DIRECTIONS = 360
"""Directions per turn in which the outline is measured."""
SLACK, GRAIN = 0.05, 0.0005
"""Difference of two outlines that counts as none: a share of the radius about the axis, and a length [m]."""
FOLDS = (8, 6, 5, 4, 3, 2)
"""Numbers of equal turns that are looked for, beside any angle."""
CLEARLY = 0.2
"""Share of the tolerance by which one number of turns must fit worse than another to be left out."""
ROUND = 16
"""Turns that stand for those of a round solid."""


def turns_alike(points: np.ndarray, axis: np.ndarray, about: np.ndarray) -> tuple[float, ...]:
    """Return the turns [rad] about an axis after which the hull of points looks the same; 0 is the first.

    Hulls are compared by their support in level and slanted directions. The tolerance grows with the radius about that
    axis, not with the whole size: else a long square bar is round.

    Args:
        points: (n, 3) [m].
        axis: (3,) direction of the axis, of any length.
        about: (3,) a point on the axis [m].
    """
    around = _in_axis_frame(points, axis, about)
    radius = float(np.linalg.norm(around[:, :2], axis=1).max())
    allowed = SLACK * radius + GRAIN
    outlines = _outlines(around)
    if np.ptp(outlines, axis=1).max() <= allowed:
        return tuple(2.0 * math.pi * k / ROUND for k in range(ROUND))
    apart = {fold: _difference(outlines, fold) for fold in FOLDS}
    best = min(apart.values())
    if best > allowed:
        return (0.0,)
    # of a small solid many numbers of turns are within the tolerance: the most turns that fit about as well as the best
    fold = max(fold for fold in FOLDS if apart[fold] <= best + CLEARLY * allowed)
    return tuple(2.0 * math.pi * k / fold for k in range(fold))


def _difference(outlines: np.ndarray, fold: int) -> float:
    """Return the largest difference [m] of outlines from themselves after one of a number of equal turns."""
    return float(np.abs(outlines - np.roll(outlines, DIRECTIONS // fold, axis=1)).max())


def is_round(turns: tuple[float, ...]) -> bool:
    """Return whether turns stand for those of a round solid."""
    return len(turns) == ROUND


def _in_axis_frame(points: np.ndarray, axis: np.ndarray, about: np.ndarray) -> np.ndarray:
    """Return points (n, 3) in a frame on the axis, z along it."""
    z = np.asarray(axis, dtype=np.float64) / np.linalg.norm(axis)
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x /= np.linalg.norm(x)
    return (points - about) @ np.column_stack([x, np.cross(z, x), z])


def _outlines(points: np.ndarray) -> np.ndarray:
    """Return the support [m] of points in rings of directions, (slopes, `DIRECTIONS`)."""
    angles = 2.0 * math.pi * np.arange(DIRECTIONS) / DIRECTIONS
    rings = []
    for slope in np.deg2rad([-60.0, -30.0, 0.0, 30.0, 60.0]):
        level = np.column_stack([np.cos(angles), np.sin(angles)]) * math.cos(slope)
        rings.append((points[:, :2] @ level.T + math.sin(slope) * points[:, 2:]).max(axis=0))
    return np.array(rings)
