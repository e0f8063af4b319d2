"""Capsule covers: few capsules whose union contains a shape, for held objects and for links.

Not in the paper: the paper moves a point. A capsule is cheap to query, and a union that contains the shape misses no
collision; protruding capsules only cost clearance.
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
"""Maximum number of capsules for one shape."""
ABOUT = 1.5
"""Accepted protrusion of a cover, as a multiple of the requested excess; the smallest accepted cover is taken."""
WORTH = 1.1
"""If no cover is accepted: take the fewest capsules that protrude by at most this multiple of the least protrusion."""
SAFETY = 1e-9
"""Increment [m] of every fitted radius, larger than rounding."""
FACTORS = np.concatenate([[1.0, 1.01, 1.02, 1.035], np.arange(1.05, 1.65, 0.05)])
"""Radii tried, as multiples of the radius of the narrowest enclosing cylinder: a wider capsule has a shorter core."""
SLACKS = np.array([0.0, 0.06, 0.15, 0.3])
"""Relative increases of that radius tried for an initial guess."""
CLOSE = 1.15
"""The second initial guess is optimized too if its volume is at most this multiple of the smallest one."""
FRACTIONS = (0.3, 0.4, 0.5, 0.6, 0.7)
"""Positions of the cutting planes of a hull, as fractions of its extent."""


@lru_cache(maxsize=64)
def covering_capsules(shape: Shape, excess: float = 0.01) -> Cover:
    """Cover a shape with as few capsules as possible that hardly protrude from the shape.

    Args:
        shape: the shape in its own frame.
        excess: largest protrusion [m] of a capsule; 1.5 times this is accepted. If 8 capsules do not suffice, the
            protrusion is about the smallest that 8 capsules can reach.

    Returns:
        Capsules in the shape's frame; a sphere or a capsule is covered by exactly itself.

    Raises:
        UnfitShape: the excess is not a positive length.
    """
    if isinstance(shape, Sphere):
        return [(np.zeros(3), np.zeros(3), shape.radius)]
    if isinstance(shape, Capsule):
        end = np.array([0.0, 0.0, 0.5 * shape.length])
        return [(-end, end, shape.radius)]
    points = corner_points(shape)
    return strips(points, excess, None if isinstance(shape, Mesh) else np.eye(3))


def strips(points: np.ndarray, excess: float, axes: np.ndarray | None = None) -> Cover:
    """Cover the convex hull of points with parallel capsules, as in `covering_capsules`.

    Args:
        points: (n, 3) [m].
        excess: largest protrusion [m] of a capsule.
        axes: (3, 3) rows, the directions the strips may have; default: the axes of the smallest enclosing box.

    Raises:
        UnfitShape: the excess is not a positive length, or the points enclose no volume.
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
    """Cover the convex hull of points with capsules of small volume.

    Args:
        points: (n, 3) [m].
        count: number of capsules, 1 to 3; parallel planes cut the hull into as many pieces.

    Raises:
        UnfitShape: another count, or the points enclose no volume.
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


def rough_capsule(points: np.ndarray) -> Cover:
    """Cover the convex hull of points (n, 3) [m] with one capsule that is found at once, not the smallest."""
    _, parameters, frames = _starts(points, np.eye(3))
    a, b, radius = _about(parameters[0], points @ frames[0].T)
    return [(a @ frames[0], b @ frames[0], radius + SAFETY)]


def _grid(points: np.ndarray, along: int, rows: int, columns: int) -> list[np.ndarray]:
    """Cut a hull into equal rows and columns of bars along an axis."""
    pieces = [points]
    for axis, count in (((along + 1) % 3, rows), ((along + 2) % 3, columns)):
        pieces = [part for piece in pieces for part in slices(piece, np.eye(3)[axis], _even(piece[:, axis], count))]
    return pieces


def _even(heights: np.ndarray, count: int) -> list[float]:
    """Return the heights that cut points of the given heights into layers of equal thickness."""
    low, high = float(heights.min()), float(heights.max())
    return [low + (high - low) * k / count for k in range(1, count)]


def _along(piece: np.ndarray, along: int, normals: np.ndarray, support: np.ndarray) -> tuple[float, tuple]:
    """Find the capsule along an axis around points that protrudes least from the hull with the given support.

    Returns:
        The protrusion [m] and the capsule.
    """
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
    """Return volumes (k,), parameters of `_about` (k, 5), frames (k, 3, 3) of capsules along k axes, smallest first."""
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
    """Return the capsule of about the smallest volume around points (n, 3)."""
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
    """Minimize the volume over the parameters of `_about` in two rounds: one round often stops early at an edge."""
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
    """Return the capsule whose axis passes through (x2, x3, 0) along (x0, x1, 1); x4 is its relative excess radius."""
    axis = np.array([x[0], x[1], 1.0]) / math.sqrt(x[0] ** 2 + x[1] ** 2 + 1.0)
    foot = np.array([x[2], x[3], 0.0])
    arms = points - foot
    heights = arms @ axis
    squares = np.maximum((arms**2).sum(axis=1) - heights**2, 0.0)
    radius = math.sqrt(squares.max()) * (1.0 + abs(x[4]))
    low, high = core(heights, squares, radius)
    return foot + low * axis, foot + high * axis, radius
