"""Convex pieces of a solid that is given by the triangles of its surface.

A piece is the hull of a part of the surface; planes cut the solid where a hull would stand off the surface. Not in
the paper: the paper moves a point.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ..errors import UnfitShape
from ..jit import inner, kernel
from .convex_distance import PER_ROW, convex_distance
from .hulls import box_axes
from .shapes import MAX_VERTICES, SHAPE_KIND, hull_corners
from .triangle_surface import nearest_on_triangles

FRACTIONS = np.linspace(0.05, 0.95, 16)
"""Positions of the planes that are tried, as fractions of the solid's extent."""
WORTH = 5e-4
"""Distance [m] by which hulls must recede, on average, for a cut to be worth a further piece."""
FEW = 64
"""Number of corners up to which a hull keeps all of them."""
MANY = 1200
"""Number of triangles from which on a surface is thinned to choose a plane."""
DEEPEST, TURNS = 3, 6
"""Number of deepest points that planes are laid through, and of such planes per point."""
FLAT = 1e-4
"""Share of the largest extent below which the smallest one is none."""


def best_cut(triangles: np.ndarray, points: np.ndarray) -> list[np.ndarray]:
    """Cut a solid by the plane that makes the hulls of its parts recede most from some points.

    Planes lie across the axes of the solid's box, and along the straight lines from the deepest points to the surface
    below them, where they cut at the bottom of a hollow.

    Args:
        triangles: (n, 3, 3) of its surface, without regard to their order [m].
        points: (k, 3) on or in its hull, off its surface [m].

    Returns:
        The triangles of both sides; empty if no plane is worth a further piece.
    """
    if not len(triangles):
        return []
    thin, best, most = thinned(triangles), None, WORTH
    for plane in (*_across(thin), *_along(thin, points)):
        gain = _gain(_both_sides(thin, plane), points)
        if gain > most:
            most, best = gain, plane
    if best is None:
        return []
    sides = _both_sides(triangles, best)
    try:
        for side in sides:
            hull_corners(side.reshape(-1, 3))
    except UnfitShape:  # a sliver
        return []
    return sides if len(thin) == len(triangles) or _gain(sides, points) > 0.0 else []


def _both_sides(triangles: np.ndarray, plane: tuple[np.ndarray, float]) -> list[np.ndarray]:
    """Return the parts of triangles below and above a plane, given by its normal (3,) and height [m]."""
    return [cut_off(triangles, sign * plane[0], sign * plane[1]) for sign in (1.0, -1.0)]


def thinned(triangles: np.ndarray) -> np.ndarray:
    """Return triangles (k, 3, 3) that stand for a surface of many (n, 3, 3): its long ones, and some of the others."""
    if len(triangles) <= MANY:
        return triangles
    longest = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
    is_long = longest >= np.partition(longest, -MANY // 2)[-MANY // 2]
    others = triangles[~is_long]
    return np.concatenate([triangles[is_long], others[:: -(-len(others) // (MANY // 2))]])


def _gain(sides: list[np.ndarray], points: np.ndarray) -> float:
    """Mean distance [m] by which the hulls of two sides recede from points (k, 3) in their common hull."""
    return float(np.minimum(*(_beyond(side, points) for side in sides)).mean())


def _across(triangles: np.ndarray) -> Iterator[tuple[np.ndarray, float]]:
    """Yield normals (3,) and heights [m] of planes across the axes of a solid's box."""
    corners = np.unique(triangles.reshape(-1, 3), axis=0)
    for axis in box_axes(corners[hull_corners(corners)]):
        heights = corners @ axis
        for fraction in FRACTIONS:
            yield axis, float(heights.min() + fraction * np.ptp(heights))


def _along(triangles: np.ndarray, points: np.ndarray) -> Iterator[tuple[np.ndarray, float]]:
    """Yield normals (3,) and heights [m] of planes through the deepest points and the nearest points of the surface."""
    near = [nearest_on_triangles(point, triangles) for point in points]
    gaps = np.array([np.linalg.norm(point - foot) for point, foot in zip(points, near, strict=True)])
    for k in np.argsort(-gaps, kind="stable")[:DEEPEST]:
        if gaps[k] > WORTH:
            across = np.linalg.svd(((points[k] - near[k]) / gaps[k])[None])[2][1:]
            for angle in np.pi * np.arange(TURNS) / TURNS:
                normal = math.cos(angle) * across[0] + math.sin(angle) * across[1]
                yield normal, float(normal @ near[k])


def _beyond(triangles: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Distances (k,) [m] of points from the triangles' hull; 0 inside, negative if it has no volume."""
    if not len(triangles):
        return np.full(len(points), -1.0)
    corners = triangles.reshape(-1, 3)
    extents = np.linalg.svd(corners - corners.mean(axis=0), compute_uv=False)
    return np.full(len(points), -1.0) if extents[2] < FLAT * extents[0] else _to_hull(points, corners)


def cut_off(triangles: np.ndarray, normal: np.ndarray, height: float) -> np.ndarray:
    """Return the part of triangles that lies below a plane.

    Args:
        triangles: (n, 3, 3) [m].
        normal: (3,) unit normal of the plane.
        height: of the plane along the normal [m].

    Returns:
        Triangles (k, 3, 3) [m].
    """
    heights = triangles @ normal - height
    below = (heights <= 0.0).sum(axis=1)
    parts = [triangles[below == 3]]
    for count in (1, 2):
        some = below == count
        # the corner that is alone on its side comes first
        alone = (heights[some] <= 0.0).argmax(axis=1) if count == 1 else (heights[some] > 0.0).argmax(axis=1)
        order = (alone[:, None] + np.arange(3)) % 3
        corners = np.take_along_axis(triangles[some], order[:, :, None], axis=1)
        high = np.take_along_axis(heights[some], order, axis=1)
        share = high[:, :1] / (high[:, :1] - high[:, 1:])
        on_plane = corners[:, :1] + share[:, :, None] * (corners[:, 1:] - corners[:, :1])
        if count == 1:
            parts.append(np.concatenate([corners[:, :1], on_plane], axis=1))
        else:
            parts.append(np.stack([corners[:, 1], corners[:, 2], on_plane[:, 0]], axis=1))
            parts.append(np.stack([corners[:, 2], on_plane[:, 0], on_plane[:, 1]], axis=1))
    return np.concatenate(parts)


def rounded_hull(points: np.ndarray, rounding: float) -> tuple[np.ndarray, float]:
    """Return few corners, and a radius, such that all points lie within the radius of the corners' hull.

    Args:
        points: (n, 3) [m]; quickest if they are the corners of their hull.
        rounding: largest radius [m], unless even `MAX_VERTICES` corners need a larger one.

    Returns:
        Corners (k, 3) [m] and the radius [m], 0 if they are all corners of the points' hull.
    """
    if len(points) <= FEW:
        return points, 0.0
    first = np.array(sorted({int((points @ axis).argmax()) for axis in np.vstack([np.eye(3), -np.eye(3)])}))
    corners = np.zeros((-(-MAX_VERTICES // PER_ROW), 3 * PER_ROW))
    chosen, work = np.empty(MAX_VERTICES, dtype=np.int64), np.zeros((2, len(points)), dtype=np.int64)
    bounds = np.full(len(points), math.inf)
    count, gap = _grow(np.ascontiguousarray(points), first, rounding, corners, chosen, bounds, work)
    return points[chosen[:count]], 0.0 if count == len(points) else gap + 1e-6


@kernel
def _grow(points, first, rounding, g, chosen, bounds, work):
    """Add to the first of points (n, 3) always the one farthest from the hull, until all are within the rounding.

    Distances only shrink as the hull grows: known ones are bounds, and only the largest, on top of a heap, is asked
    for again.

    Returns:
        The number of points chosen, and the largest distance [m] of any from their hull.
    """
    count, heap, asked = len(first), work[0], work[1]
    for k in range(count):
        _put(g, k, points[first[k]])
        chosen[k] = first[k]
    for k in range(len(points)):
        heap[k] = k
    while True:
        farthest = heap[0]
        if asked[farthest] < count:
            asked[farthest] = count
            bounds[farthest] = _gap(g, count, points[farthest])
            _sink(heap, bounds)
        elif bounds[farthest] <= rounding or count == min(len(chosen), len(points)):
            return count, bounds[farthest]
        else:
            _put(g, count, points[farthest])
            chosen[count] = farthest
            count += 1


@inner
def _sink(heap, keys):
    """Restore a heap of indices, the largest key first, after the key of the first became smaller."""
    top, k = heap[0], 0
    while 2 * k + 1 < len(heap):
        child = 2 * k + 1
        if child + 1 < len(heap) and keys[heap[child + 1]] > keys[heap[child]]:
            child += 1
        if keys[heap[child]] <= keys[top]:
            break
        heap[k] = heap[child]
        k = child
    heap[k] = top


@inner
def _put(g, k, point):
    """Write a point (3,) as corner k of a hull."""
    for axis in range(3):
        g[k // PER_ROW, 3 * (k % PER_ROW) + axis] = point[axis]


@inner
def _gap(g, count, point):
    """Distance of a point (3,) from the hull of corners, at most 1e-6 too small."""
    zero, identity = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    at = (point[0], point[1], point[2])
    found = convex_distance(g, 0, count, identity, zero, SHAPE_KIND.sphere, zero, 0, 0, identity, at, math.inf)
    return found[0]


def _to_hull(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Distances (n,) [m] of points from the hull of corners, at most 1e-6 too small."""
    g = np.zeros((-(-len(corners) // PER_ROW), 3 * PER_ROW))
    g.reshape(-1)[: corners.size] = corners.ravel()
    out = np.empty(len(points))
    _write_distances(g, len(corners), np.ascontiguousarray(points), out)
    return out


@kernel
def _write_distances(g, count, points, out):
    """Write the distances (n,) of points (n, 3) from the hull of the corners in `g`."""
    for k in range(len(points)):
        out[k] = _gap(g, count, points[k])
