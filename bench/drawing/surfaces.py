"""Surfaces of shapes as polygons, for figures."""

from __future__ import annotations

import numpy as np

from ...planner import Box, Capsule, Cylinder, Pose, Shape, Sphere
from ...planner.geometry.hulls import corner_points

SIDES, RINGS = 24, 6
"""Resolution of round shapes: pieces of a full turn, and points of a quarter turn from rim to pole."""
_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_FACES = ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))


def surface(shape: Shape, pose: Pose) -> list[np.ndarray]:
    """Return the polygons (k, 3) of a shape's surface in the world [m].

    Args:
        shape: the shape.
        pose: its pose in the world.
    """
    return [piece @ pose.rotation.T + pose.position for piece in _pieces(shape)]


def _pieces(shape: Shape) -> list[np.ndarray]:
    if isinstance(shape, Box):
        return [_CORNERS[list(face)] * shape.size for face in _FACES]
    if isinstance(shape, Cylinder):
        half = 0.5 * shape.length
        return _turned(np.array([[0.0, -half], [shape.radius, -half], [shape.radius, half], [0.0, half]]))
    if isinstance(shape, Sphere | Capsule):
        half = 0.5 * shape.length if isinstance(shape, Capsule) else 0.0
        angle = np.linspace(0.0, 0.5 * np.pi, RINGS)
        quarter = shape.radius * np.column_stack([np.cos(angle), np.sin(angle)])
        up = np.array([0.0, half])
        return _turned(np.vstack([quarter[::-1] * [1.0, -1.0] - up, quarter + up]))
    from scipy.spatial import ConvexHull

    points = corner_points(shape)
    return [points[triangle] for triangle in ConvexHull(points).simplices]


def _turned(profile: np.ndarray) -> list[np.ndarray]:
    """Return the quadrilaterals of a profile (n, 2), radius and height [m], revolved about z."""
    angle = 2.0 * np.pi * np.arange(SIDES + 1) / SIDES
    around = np.column_stack([np.cos(angle), np.sin(angle)])
    rings = np.array([np.column_stack([radius * around, np.full(SIDES + 1, z)]) for radius, z in profile])
    return [
        np.stack([rings[j, i], rings[j, i + 1], rings[j + 1, i + 1], rings[j + 1, i]])
        for j in range(len(profile) - 1)
        for i in range(SIDES)
    ]
