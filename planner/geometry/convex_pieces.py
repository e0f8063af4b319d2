"""Convex pieces of a solid that is given by the triangles of its surface.

A piece is the hull of a part of the surface; planes cut the solid where a hull would stand off the surface. Not in
the paper: the paper moves a point.
"""

from __future__ import annotations

import math

import numpy as np

from ..errors import UnfitShape
from .convex_distance import PER_ROW, convex_distance
from .hulls import box_axes
from .shapes import MAX_VERTICES, SHAPE_KIND, hull_corners

FRACTIONS = np.linspace(0.05, 0.95, 16)
"""Positions of the planes that are tried, as fractions of the solid's extent."""
WORTH = 5e-4
"""Distance [m] by which hulls must recede, on average, for a cut to be worth a further piece."""
FEW = 64
"""Number of corners up to which a hull keeps all of them."""
_IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


def best_cut(triangles: np.ndarray, points: np.ndarray) -> list[np.ndarray]:
    """Cut a solid by the plane that makes the hulls of its parts recede most from some points.

    Args:
        triangles: (n, 3, 3) of its surface, without regard to their order [m].
        points: (k, 3) on its hull, off its surface [m].

    Returns:
        The triangles of both sides; empty if no plane is worth a further piece.
    """
    if not len(triangles):
        return []
    corners = np.unique(triangles.reshape(-1, 3), axis=0)
    best, most = [], WORTH
    for axis in box_axes(corners[hull_corners(corners)]):
        heights = corners @ axis
        for fraction in FRACTIONS:
            cut = heights.min() + fraction * np.ptp(heights)
            sides = [cut_off(triangles, sign * axis, sign * cut) for sign in (1.0, -1.0)]
            gain = float(np.minimum(*(_beyond(side, points) for side in sides)).mean())
            if gain > most:
                most, best = gain, sides
    return best


def _beyond(triangles: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Distances (k,) [m], or less, of points from the triangles' hull; 0 inside, negative if it has no volume."""
    corners = triangles.reshape(-1, 3)
    try:
        corners = corners[hull_corners(corners)]
    except UnfitShape:
        return np.full(len(points), -1.0)
    from scipy.spatial import ConvexHull

    planes = ConvexHull(corners).equations
    return np.maximum((points @ planes[:, :3].T + planes[:, 3]).max(axis=1), 0.0)


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


def to_triangles(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the distances (n,) [m] of points from a surface.

    Args:
        points: (n, 3) [m].
        triangles: (m, 3, 3) of the surface [m].
    """
    edges = [_to_segments(points[:, None], triangles[:, k], triangles[:, (k + 1) % 3]) for k in range(3)]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    above = np.broadcast_to(lengths > 0.0, edges[0].shape).copy()
    for k in range(3):
        along = triangles[:, (k + 1) % 3] - triangles[:, k]
        above &= np.einsum("nmd,md->nm", points[:, None] - triangles[:, k], np.cross(normals, along)) >= 0.0
    height = np.abs(np.einsum("nmd,md->nm", points[:, None] - triangles[:, 0], normals)) / np.maximum(lengths, 1e-300)
    return np.where(above, height, np.minimum.reduce(edges)).min(axis=1)


def _to_segments(points: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Distances (n, m) [m] of points (n, 1, 3) from segments (m, 3)."""
    along = b - a
    share = np.einsum("nmd,md->nm", points - a, along) / np.maximum((along * along).sum(axis=1), 1e-300)
    return np.linalg.norm(points - a - np.clip(share, 0.0, 1.0)[:, :, None] * along, axis=2)


def rounded_hull(points: np.ndarray, rounding: float) -> tuple[np.ndarray, float]:
    """Return few corners, and a radius, such that all points lie within the radius of the corners' hull.

    Args:
        points: (n, 3) [m].
        rounding: largest radius [m], unless even `MAX_VERTICES` corners need a larger one.

    Returns:
        Corners (k, 3) [m] and the radius [m], 0 if they are all corners of the points' hull.
    """
    try:
        points = points[hull_corners(points)]
    except UnfitShape:
        points = np.unique(points, axis=0)
    if len(points) <= FEW:
        return points, 0.0
    chosen = sorted({int((points @ axis).argmax()) for axis in np.vstack([np.eye(3), -np.eye(3)])})
    while True:
        corners = points[chosen]
        gaps = _to_hull(points, corners)
        if len(chosen) == len(points):
            return corners, 0.0
        if gaps.max() <= rounding or len(chosen) == MAX_VERTICES:
            return corners, float(gaps.max()) + 1e-6
        chosen.append(int(gaps.argmax()))


def _to_hull(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Distances (n,) [m] of points from the hull of corners, at most 1e-6 too small."""
    parts = [corners[first : first + PER_ROW].ravel() for first in range(0, len(corners), PER_ROW)]
    g, zero = np.array([np.pad(part, (0, 3 * PER_ROW - part.size)) for part in parts]), (0.0, 0.0, 0.0)
    count, ball = len(corners), SHAPE_KIND.sphere
    found = [
        convex_distance(g, 0, count, _IDENTITY, zero, ball, zero, 0, 0, _IDENTITY, tuple(point), math.inf)[0]
        for point in points.tolist()
    ]
    return np.array(found)
