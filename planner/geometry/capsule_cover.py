"""Capsules that together contain a shape: for what an arm holds, and for its links.

Not in the paper: it moves a point. A capsule is cheap to query, and a union that contains a shape never lets a
collision pass; what it sticks out only costs room.
"""

from __future__ import annotations

import itertools
import math
from functools import lru_cache

import numpy as np

from ..errors import UnfitShape
from .hulls import Cover, box_axes, capsule_volume, circle_centers, core, corner_points, corners, directions, slices
from .shapes import Capsule, Mesh, Shape, Sphere

MOST = 8
"""Capsules for one shape."""
ABOUT = 1.5
"""Fewer capsules are taken if they stick out by no more than this times what was asked."""
WORTH = 1.1
"""Where none suffice: more capsules are taken only if they stick out less by this factor."""
SAFETY = 1e-9
"""Added to every fitted radius [m], above rounding."""
FACTORS = np.concatenate([[1.0, 1.01, 1.02, 1.035], np.arange(1.05, 1.65, 0.05)])
"""Radii tried, in radii of the narrowest cylinder around: a wider capsule has a shorter core."""
SLACKS = np.array([0.0, 0.06, 0.15, 0.3])
"""The same for a first try, less one."""
CLOSE = 1.15
"""A second try is polished too if it is at most this times the best one."""
FRACTIONS = (0.3, 0.4, 0.5, 0.6, 0.7)
"""Where a hull is cut, of its extent."""


@lru_cache(maxsize=64)
def covering_capsules(shape: Shape, excess: float = 0.01) -> Cover:
    """As few capsules as possible that contain a shape and hardly stick out of it.

    Args:
        shape: in its own frame.
        excess: how far [m] a capsule may stick out; one and a half times that is let pass. Where 8 capsules do
            not suffice, about the least that 8 can.

    Returns:
        Capsules in the shape's frame; a sphere or a capsule is covered by exactly itself.
    """
    if isinstance(shape, Sphere):
        return [(np.zeros(3), np.zeros(3), shape.radius)]
    if isinstance(shape, Capsule):
        end = np.array([0.0, 0.0, 0.5 * shape.length])
        return [(-end, end, shape.radius)]
    points = corner_points(shape)
    return strips(points, excess, None if isinstance(shape, Mesh) else np.eye(3))


def strips(points: np.ndarray, excess: float, axes: np.ndarray | None = None) -> Cover:
    """Parallel capsules that contain the convex hull of points, as `covering_capsules`.

    Args:
        points: (n, 3) [m].
        excess: how far [m] a capsule may stick out.
        axes: (3, 3) rows along which the strips may lie; default those of the smallest box around.
    """
    if not (math.isfinite(excess) and excess > 0):
        raise UnfitShape("cover", "excess", f"{excess!r} is not a length above 0")
    points = corners(points)
    axes = box_axes(points) if axes is None else axes
    points = points @ axes.T
    normals = directions()
    support = (points @ normals.T).max(axis=0)
    tried: list[tuple[float, Cover]] = []
    for count in range(1, MOST + 1):
        tried.append((math.inf, []))
        rows = [rows for rows in range(1, count + 1) if count % rows == 0]
        for along, across in itertools.product(range(3), rows):
            found = [_along(piece, along, normals, support) for piece in _grid(points, along, across, count // across)]
            worst = max(sticks for sticks, _ in found)
            if worst < tried[-1][0] - 1e-12:
                tried[-1] = (worst, [capsule for _, capsule in found])
        if tried[-1][0] <= ABOUT * excess:
            break
    least = min(worst for worst, _ in tried)
    enough = ABOUT * excess if least <= ABOUT * excess else WORTH * least
    chosen = next(cover for worst, cover in tried if worst <= enough)
    return [(a @ axes, b @ axes, radius + SAFETY) for a, b, radius in chosen]


def fitted_capsules(points: np.ndarray, count: int) -> Cover:
    """Capsules of small volume that contain the convex hull of points.

    Args:
        points: (n, 3) [m].
        count: 1 to 3; the hull is cut by parallel planes into as many pieces.
    """
    if count not in (1, 2, 3):
        raise UnfitShape("cover", "count", f"{count!r} is not 1, 2 or 3")
    points = corners(points)
    axes = box_axes(points)
    best, pieces = math.inf, [points]
    for axis in axes if count > 1 else ():
        heights = points @ axis
        for fractions in itertools.combinations(FRACTIONS, count - 1):
            cut = slices(points, axis, [heights.min() + f * np.ptp(heights) for f in fractions])
            volume = sum(_starts(piece, axes)[0][0] for piece in cut)
            if volume < best:
                best, pieces = volume, cut
    return [_tightest(piece) for piece in pieces]


def _grid(points: np.ndarray, along: int, rows: int, columns: int) -> list[np.ndarray]:
    """A hull cut into equal rows and columns of bars that lie along an axis."""
    pieces = [points]
    for axis, count in (((along + 1) % 3, rows), ((along + 2) % 3, columns)):
        pieces = [part for piece in pieces for part in slices(piece, np.eye(3)[axis], _even(piece[:, axis], count))]
    return pieces


def _even(heights: np.ndarray, count: int) -> list[float]:
    """Where to cut points of these heights into layers of the same thickness."""
    low, high = float(heights.min()), float(heights.max())
    return [low + (high - low) * k / count for k in range(1, count)]


def _along(piece: np.ndarray, along: int, normals: np.ndarray, support: np.ndarray) -> tuple[float, tuple]:
    """The capsule along an axis around points that sticks least out of the hull with that support."""
    heights, flat = piece[:, along], np.delete(piece, along, axis=1)
    center = circle_centers(flat[None])[0]
    squares = ((flat - center) ** 2).sum(axis=1)
    across = np.delete(normals, along, axis=1) @ center - support
    best = (math.inf, (0.0, 0.0, 0.0))
    for radius in FACTORS * math.sqrt(squares.max()):
        low, high = core(heights, squares, radius)
        sticks = (across + np.maximum(normals[:, along] * low, normals[:, along] * high)).max() + radius
        if sticks < best[0]:
            best = (float(sticks), (low, high, float(radius)))
    low, high, radius = best[1]
    return best[0], (np.insert(center, along, low), np.insert(center, along, high), radius)


def _starts(points: np.ndarray, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Volumes (k,), parameters of `_about` (k, 5) and frames (k, 3, 3) of capsules along k axes, smallest first."""
    axes = np.vstack([axes, np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]])
    frames = np.roll(np.linalg.svd(axes[:, None, :])[2], -1, axis=1)
    local = points @ frames.transpose(0, 2, 1)
    centers = circle_centers(local[:, :, :2])
    squares = ((local[:, :, :2] - centers[:, None]) ** 2).sum(axis=2)[:, None]
    radii = np.sqrt(squares.max(axis=2)) * (1.0 + SLACKS)
    reach = np.sqrt(np.maximum(radii[:, :, None] ** 2 - squares, 0.0))
    heights = local[:, None, :, 2]
    lengths = np.maximum((heights - reach).max(axis=2) - (heights + reach).min(axis=2), 0.0)
    volumes = radii**2 * (lengths + 4.0 / 3.0 * radii)
    chosen = volumes.argmin(axis=1)
    parameters = np.column_stack([np.zeros((len(axes), 2)), centers, SLACKS[chosen]])
    order = volumes.min(axis=1).argsort(kind="stable")
    return math.pi * volumes.min(axis=1)[order], parameters[order], frames[order]


def _tightest(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """The capsule of about the smallest volume around points (n, 3)."""
    volumes, parameters, frames = _starts(points, box_axes(points))
    found = []
    for volume, start, frame in zip(volumes[:2], parameters[:2], frames[:2], strict=True):
        if volume > CLOSE * volumes[0]:
            continue
        local = points @ frame.T
        a, b, radius = _about(_polished(start, local), local)
        found.append((a @ frame, b @ frame, radius + SAFETY))
    return min(found, key=capsule_volume)


def _polished(start: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Parameters of `_about` that make the volume smaller, in two rounds: one often stops early at an edge."""
    from scipy.optimize import minimize

    steps = np.diag([0.15, 0.15, *(0.1 * (points[:, :2].max(axis=0) - points[:, :2].min(axis=0))), 0.1])
    for size, tries in ((1.0, 240), (0.2, 160)):
        start = minimize(
            lambda x: capsule_volume(_about(x, points)),
            start,
            method="Nelder-Mead",
            options={"initial_simplex": np.vstack([start, start + size * steps]), "maxfev": tries},
        ).x
    return start


def _about(x: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """The capsule about the line through (x2, x3, 0) along (x0, x1, 1), by x4 wider than needed."""
    axis = np.array([x[0], x[1], 1.0]) / math.sqrt(x[0] ** 2 + x[1] ** 2 + 1.0)
    foot = np.array([x[2], x[3], 0.0])
    arms = points - foot
    heights = arms @ axis
    squares = np.maximum((arms**2).sum(axis=1) - heights**2, 0.0)
    radius = math.sqrt(squares.max()) * (1.0 + abs(x[4]))
    low, high = core(heights, squares, radius)
    return foot + low * axis, foot + high * axis, radius
