"""Convex pieces of a solid that is given by the triangles of its surface.

A piece is the hull of a part of the surface; planes cut the solid where a hull would stand off the surface. Not in
the paper: the paper moves a point.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import islice
from typing import NamedTuple

import numpy as np

from ..errors import UnfitShape
from ..jit import inner, kernel
from .convex_distance import PER_ROW, convex_distance
from .hulls import box_axes
from .shapes import MAX_VERTICES, SHAPE_KIND, hull_corners
from .triangle_surface import cut_off, nearest_on_triangles

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
DEEP = 0.004
"""Distance [m] of a point from the surface from which on it may lie in a hollow that takes sectors to open."""
FANS, SHIFTS, HOLLOWS = (3, 4), 2, 2
"""Numbers of sectors that are tried around a hollow, number of their turns, and of deepest points."""
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
    return sides if _are_solids(sides) and (len(thin) == len(triangles) or _gain(sides, points) > 0.0) else []


def _are_solids(parts: list[np.ndarray]) -> bool:
    """Return whether all parts enclose a volume: slivers do not."""
    try:
        for part in parts:
            hull_corners(part.reshape(-1, 3))
    except UnfitShape:
        return False
    return True


def best_parts(triangles: np.ndarray, points: np.ndarray) -> list[np.ndarray]:
    """Cut a solid by a plane, or into sectors around a hollow: by what frees points more for every further part.

    The plane that seems best at first may cut through a hollow, so that every part of it has to be opened by itself.

    Args:
        triangles: (n, 3, 3) of its surface, without regard to their order [m].
        points: (k, 3) on or in its hull, off its surface [m].

    Returns:
        The triangles of the parts; empty if no cut is worth further pieces.
    """
    found = [parts for parts in (best_cut(triangles, points), fan_cut(triangles, points)) if parts]
    return max(found, key=lambda parts: _gain(parts, points) / (len(parts) - 1), default=[])


def fan_cut(triangles: np.ndarray, points: np.ndarray) -> list[np.ndarray]:
    """Cut a solid into sectors around a hollow that no single plane opens, as that of a ring or below a roof.

    One plane through a ring leaves two halves whose hulls still fill it; sectors about a line in the hollow do not.
    What lies beyond the hollow's roof is cut off first: sectors of it would be of no use.

    Args:
        triangles: (n, 3, 3) of its surface, without regard to their order [m].
        points: (k, 3) on or in its hull, off its surface [m].

    Returns:
        The triangles of the parts; empty if no sectors are worth further pieces.
    """
    if not len(triangles):
        return []
    thin, best, most = thinned(triangles), None, 0.0
    for fan in _fans(thin, points):
        parts = _sectors(thin, fan)
        gain = _gain(parts, points) - WORTH * (len(parts) - 1)
        if gain > most:
            most, best = gain, fan
    if best is None:
        return []
    parts = _sectors(triangles, best)
    return parts if _are_solids(parts) and (len(thin) == len(triangles) or _gain(parts, points) > 0.0) else []


class _Fan(NamedTuple):
    """Planes about a line.

    Attributes:
        roof: normal (3,) and height [m] of a plane, beyond which nothing is cut further; None: there is none.
        normals: (k, 3) of the planes through the line; a sector lies between one and the next.
        point: (3,) on the line [m].
    """

    roof: tuple[np.ndarray, float] | None
    normals: np.ndarray
    point: np.ndarray


def _fans(triangles: np.ndarray, points: np.ndarray) -> Iterator[_Fan]:
    """Yield fans about the deepest points and their middle: below the nearest surface as a roof, or beside it."""
    middle = points.mean(axis=0, keepdims=True)
    centers = (*_deepest(triangles, middle, DEEP), *islice(_deepest(triangles, points, DEEP), HOLLOWS))
    for point, foot, out in centers:
        sides = np.linalg.svd(out[None])[2][1:]
        for axis, roof in ((out, (out, float(out @ foot))), (sides[0], None), (sides[1], None)):
            one, other = np.linalg.svd(axis[None])[2][1:]
            for count in FANS:
                for shift in np.arange(SHIFTS) / SHIFTS:
                    angles = 2.0 * np.pi / count * (np.arange(count) + shift)
                    yield _Fan(roof, np.outer(np.cos(angles), one) + np.outer(np.sin(angles), other), point)


def _sectors(triangles: np.ndarray, fan: _Fan) -> list[np.ndarray]:
    """Return the parts of triangles beyond a fan's roof and in its sectors, as far as there are any."""
    beyond, rest = (triangles[:0], triangles) if fan.roof is None else _both_sides(triangles, fan.roof)[::-1]
    heights, parts = fan.normals @ fan.point, [beyond]
    for k in range(len(heights)):
        side = cut_off(rest, -fan.normals[k], -heights[k])
        parts.append(cut_off(side, fan.normals[(k + 1) % len(heights)], heights[(k + 1) % len(heights)]))
    return [part for part in parts if len(part)]


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


def _gain(parts: list[np.ndarray], points: np.ndarray) -> float:
    """Mean distance [m] by which the hulls of parts recede from points (k, 3) in their common hull."""
    return float(np.minimum.reduce([_beyond(part, points) for part in parts]).mean())


def _across(triangles: np.ndarray) -> Iterator[tuple[np.ndarray, float]]:
    """Yield normals (3,) and heights [m] of planes across the axes of a solid's box."""
    corners = np.unique(triangles.reshape(-1, 3), axis=0)
    for axis in box_axes(corners[hull_corners(corners)]):
        heights = corners @ axis
        for fraction in FRACTIONS:
            yield axis, float(heights.min() + fraction * np.ptp(heights))


def _along(triangles: np.ndarray, points: np.ndarray) -> Iterator[tuple[np.ndarray, float]]:
    """Yield normals (3,) and heights [m] of planes through the deepest points and the nearest points of the surface."""
    for _, foot, out in _deepest(triangles, points, WORTH):
        across = np.linalg.svd(out[None])[2][1:]
        for angle in np.pi * np.arange(TURNS) / TURNS:
            normal = math.cos(angle) * across[0] + math.sin(angle) * across[1]
            yield normal, float(normal @ foot)


def _deepest(
    triangles: np.ndarray, points: np.ndarray, least: float
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield the points (3,) farthest from a surface, its points nearest to them, and the directions to these."""
    near = [nearest_on_triangles(point, triangles) for point in points]
    gaps = np.array([np.linalg.norm(point - foot) for point, foot in zip(points, near, strict=True)])
    for k in np.argsort(-gaps, kind="stable")[:DEEPEST]:
        if gaps[k] > least:
            yield points[k], near[k], (near[k] - points[k]) / gaps[k]


def _beyond(triangles: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Distances (k,) [m] of points from the triangles' hull; 0 inside, negative if it has no volume."""
    if not len(triangles):
        return np.full(len(points), -1.0)
    corners = triangles.reshape(-1, 3)
    extents = np.linalg.svd(corners - corners.mean(axis=0), compute_uv=False)
    return np.full(len(points), -1.0) if extents[2] < FLAT * extents[0] else _to_hull(points, corners)


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
