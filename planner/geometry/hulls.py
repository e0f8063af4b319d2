"""Convex hulls of points, and the geometry of capsules around them.

Not in the paper: the paper moves a point.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from ..errors import BadShape, NotFinite
from .shapes import Box, Cylinder, Mesh, Shape, Sphere, hull_corners

Cover = list[tuple[np.ndarray, np.ndarray, float]]
"""Capsules: ends a (3,) and b (3,) of the core, radius [m]; a equals b for a ball."""
RING = 24
"""Corners of the prism around a cylinder: the prism is 0.9 % wider."""
FACETS = 48
"""Number of largest hull facets tried as a side of the smallest box."""
SAMPLES = 20000
"""Number of sample points of a volume estimate, accurate to about 1 %."""


def corner_points(shape: Shape) -> np.ndarray:
    """Return points (n, 3) [m] whose hull contains a shape: exactly for a box or a mesh, else slightly larger."""
    if isinstance(shape, Mesh):
        return shape.vertices
    if isinstance(shape, Box):
        return 0.5 * np.array(list(itertools.product((-1.0, 1.0), repeat=3))) * shape.size
    angle = 2.0 * math.pi * np.arange(RING) / RING
    ring = np.column_stack([np.cos(angle), np.sin(angle)]) / math.cos(math.pi / RING)
    if isinstance(shape, Cylinder):
        heights = (-0.5 * shape.length, 0.5 * shape.length)
        return np.vstack([np.column_stack([shape.radius * ring, np.full(RING, height)]) for height in heights])
    # rings at the latitudes of the corners of the polygon circumscribed about the profile
    latitude = math.pi * (np.arange(7) - 3.0) / 6.0
    profile = shape.radius * np.column_stack([np.cos(latitude), np.sin(latitude)]) / math.cos(math.pi / 12)
    ball = np.vstack([np.column_stack([radius * ring, np.full(RING, height)]) for radius, height in profile])
    if isinstance(shape, Sphere):
        return ball
    return np.vstack([ball + np.array([0.0, 0.0, shift]) for shift in (-0.5 * shape.length, 0.5 * shape.length)])


def corners(points: np.ndarray) -> np.ndarray:
    """Return the points (k, 3) that are corners of the hull of points (n, 3).

    Raises:
        BadShape, NotFinite, UnfitShape: wrong shape, numbers that are not finite, or points that enclose no volume.
    """
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise BadShape("cover: points", points.shape, "(n, 3)")
    if not np.isfinite(points).all():
        raise NotFinite("cover: points", tuple(int(k) for k in np.argwhere(~np.isfinite(points))[0]))
    return points[hull_corners(points)]


def box_axes(points: np.ndarray) -> np.ndarray:
    """Return the axes of about the smallest box around points (n, 3), which has a facet of their hull on one side.

    Returns:
        (3, 3) unit rows, the longest side first.
    """
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    triangles = points[hull.simplices]
    areas = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    facets = np.argsort(-areas, kind="stable")[:FACETS]
    # the box's other sides are aligned with an edge of the facet, nearly always the optimum
    normals = np.repeat(hull.equations[facets, :3], 3, axis=0)
    sides = (np.roll(triangles[facets], 1, axis=1) - triangles[facets]).reshape(-1, 3)
    sides = sides - np.einsum("ij,ij->i", sides, normals)[:, None] * normals
    lengths = np.linalg.norm(sides, axis=1)
    good = lengths > 1e-9
    normals, sides = normals[good], sides[good] / lengths[good, None]
    frames = np.stack([normals, sides, np.cross(normals, sides)], axis=1)
    heights = frames @ points.T
    extents = heights.max(axis=2) - heights.min(axis=2)
    best = int(extents.prod(axis=1).argmin())
    return frames[best][np.argsort(-extents[best], kind="stable")]


def slices(points: np.ndarray, axis: np.ndarray, cuts: list[float]) -> list[np.ndarray]:
    """Cut a hull by parallel planes into pieces.

    Args:
        points: (n, 3) corners of the hull [m].
        axis: (3,) unit normal of the planes.
        cuts: increasing positions of the planes along the axis [m], within the hull.

    Returns:
        Corners (k, 3) of each piece, those of its cross-sections included.
    """
    from scipy.spatial import ConvexHull

    if not cuts:
        return [points]
    heights = points @ axis
    triangles = ConvexHull(points).simplices
    edges = np.unique(np.sort(np.vstack([triangles[:, :2], triangles[:, 1:], triangles[:, ::2]]), axis=1), axis=0)
    sections = []
    for cut in cuts:
        low, high = edges[(heights[edges] < cut).sum(axis=1) == 1].T
        share = (cut - heights[low]) / (heights[high] - heights[low])
        sections.append(points[low] + share[:, None] * (points[high] - points[low]))
    bounds = [-math.inf, *cuts, math.inf]
    pieces = []
    for k in range(len(cuts) + 1):
        inside = points[(heights >= bounds[k]) & (heights <= bounds[k + 1])]
        pieces.append(np.vstack([inside, *sections[max(k - 1, 0) : k + 1]]))
    return pieces


def directions(count: int = 600) -> np.ndarray:
    """Return unit vectors (count + 6, 3) spread evenly over the sphere, including both directions of each axis."""
    height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    angle = math.pi * (3.0 - math.sqrt(5.0)) * np.arange(count)
    flat = np.sqrt(1.0 - height**2)
    spiral = np.column_stack([flat * np.cos(angle), flat * np.sin(angle), height])
    return np.vstack([np.eye(3), -np.eye(3), spiral])


def circle_centers(flat: np.ndarray) -> np.ndarray:
    """Return centers (k, 2) of about the smallest circles around k sets of points (k, n, 2) [m]."""
    center = 0.5 * (flat.min(axis=1) + flat.max(axis=1))
    best, least = center, np.full(len(flat), math.inf)
    every = np.arange(len(flat))
    for step in range(2, 26):
        squares = ((flat - center[:, None]) ** 2).sum(axis=2)
        farthest = squares.argmax(axis=1)
        largest = squares[every, farthest]
        best = np.where((largest < least)[:, None], center, best)
        least = np.minimum(largest, least)
        center = center + (flat[every, farthest] - center) / (2 * step)
    return best


def core(heights: np.ndarray, squares: np.ndarray, radius: float) -> tuple[float, float]:
    """Return the ends of the shortest core on a line such that the capsule around the core contains points.

    Args:
        heights: (n,) positions of the points along the line [m].
        squares: (n,) squared distances of the points from the line [m^2].
        radius: of the capsule [m].

    Returns:
        Lower and upper end along the line [m]; equal if a ball suffices.
    """
    reach = np.sqrt(np.maximum(radius**2 - squares, 0.0))
    low, high = float((heights + reach).min()), float((heights - reach).max())
    middle = 0.5 * (low + high)
    return (low, high) if low < high else (middle, middle)


def capsule_volume(capsule: tuple[np.ndarray, np.ndarray, float]) -> float:
    """Return the volume [m^3] of a capsule (a, b, radius)."""
    a, b, radius = capsule
    return math.pi * radius**2 * (float(np.linalg.norm(b - a)) + 4.0 / 3.0 * radius)


def sticks_out(cover: Cover, points: np.ndarray) -> float:
    """Return the largest protrusion [m] of capsules from a hull, accurate to a few per cent of their radius.

    Args:
        cover: the capsules.
        points: (n, 3) points that span the hull [m].
    """
    normals = directions()
    support = (points @ normals.T).max(axis=0)
    return max(float((np.maximum(normals @ a, normals @ b) - support).max()) + radius for a, b, radius in cover)


def union_volume(cover: Cover) -> float:
    """Estimate the volume [m^3] of a union of capsules from evenly spread, always identical sample points."""
    low = np.min([np.minimum(a, b) - radius for a, b, radius in cover], axis=0)
    high = np.max([np.maximum(a, b) + radius for a, b, radius in cover], axis=0)
    # powers of the real root of x^4 = x + 1 give the most even sequence in three dimensions
    steps = 1.2207440846057596 ** -np.arange(1.0, 4.0)
    points = low + (high - low) * ((0.5 + np.outer(np.arange(SAMPLES), steps)) % 1.0)
    inside = np.zeros(SAMPLES, dtype=bool)
    for a, b, radius in cover:
        share = np.clip((points - a) @ (b - a) / max(float((b - a) @ (b - a)), 1e-300), 0.0, 1.0)
        inside |= ((points - a - share[:, None] * (b - a)) ** 2).sum(axis=1) <= radius**2
    return float((high - low).prod() * inside.mean())
