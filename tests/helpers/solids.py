"""Obstacles for tests: random ones of every shape, and distances by other means than the planner's."""

from __future__ import annotations

import fcl
import numpy as np
from helpers.strategies import random_dq
from scipy.optimize import minimize_scalar
from scipy.spatial import ConvexHull

from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import Box, Capsule, Cylinder, Mesh, Obstacle, Shape, Sphere
from onedemo.planner.robot.resting_pairs import segment_distance

KINDS = ("sphere", "capsule", "box", "cylinder", "mesh")


def random_shape(rng: np.random.Generator, kind: str, size: float = 0.2) -> Shape:
    """Of extents between a tenth of the size and the size: flat, long and round ones."""
    x, y, z = size * rng.uniform(0.1, 1.0, 3)
    if kind == "sphere":
        return Sphere(0.5 * x)
    if kind == "capsule":
        return Capsule(0.5 * x, y)
    if kind == "box":
        return Box((x, y, z))
    if kind == "cylinder":
        return Cylinder(0.5 * x, y)
    points = rng.normal(size=(int(rng.integers(6, 40)), 3))
    return Mesh.hull_of(0.5 * points / np.linalg.norm(points, axis=1)[:, None] * [x, y, z])


def random_pose(rng: np.random.Generator, center=(0.0, 0.0, 0.0)) -> Pose:
    turn = Pose(random_dq(rng))
    return Pose.from_position_quaternion(np.asarray(center, dtype=float), turn.quaternion)


def of_length(shape: Shape, points: np.ndarray) -> np.ndarray:
    """(n,) signed distance outwards of points in a round or square shape's frame from its surface; 0 in a core."""
    if isinstance(shape, Sphere):
        return np.linalg.norm(points, axis=1) - shape.radius
    half = 0.5 * np.asarray(shape.size if isinstance(shape, Box) else (0.0, 0.0, shape.length))
    beyond = points - np.clip(points, -half, half)
    if isinstance(shape, Cylinder):
        beyond = np.column_stack([np.maximum(np.linalg.norm(points[:, :2], axis=1) - shape.radius, 0.0), beyond[:, 2]])
    return np.linalg.norm(beyond, axis=1) - (shape.radius if isinstance(shape, Capsule) else 0.0)


def true_distance(obstacle: Obstacle, a: np.ndarray, b: np.ndarray) -> float:
    """Distance [m] of a segment from an obstacle, by minimizing the distance of its points; of meshes exactly."""
    a, b = (obstacle.pose.rotation.T @ (end - obstacle.pose.position) for end in (a, b))
    if isinstance(obstacle.shape, Mesh):
        return _mesh_distance(obstacle.shape.vertices, a, b)

    def at(t):
        return float(of_length(obstacle.shape, (a + t * (b - a))[None])[0])

    grid = of_length(obstacle.shape, a + np.linspace(0, 1, 41)[:, None] * (b - a))
    middle = np.argmin(grid) / 40
    low, high = max(0.0, middle - 0.025), min(1.0, middle + 0.025)
    best = minimize_scalar(at, bounds=(low, high), method="bounded", options={"xatol": 1e-13})
    return min(float(grid.min()), float(best.fun))


def _mesh_distance(vertices: np.ndarray, a: np.ndarray, b: np.ndarray) -> float:
    """Over all edges and facets; 0 if the segment enters."""
    hull = ConvexHull(vertices)
    normals, offsets = hull.equations[:, :3], hull.equations[:, 3]
    at_a, rise = normals @ a + offsets, normals @ (b - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossings = -at_a / rise
    low = max([0.0, *crossings[rise < 0]])
    high = min([1.0, *crossings[rise > 0]])
    if low <= high and not (at_a[rise == 0] > 0).any():
        return 0.0
    least = np.inf
    for corners, normal, offset in zip(vertices[hull.simplices], normals, offsets, strict=True):
        for k in range(3):
            least = min(least, segment_distance(a, b, corners[k], corners[k - 1]))
        for end in (a, b):
            height = normal @ end + offset
            foot = [*(end - height * normal), 1.0]
            weights = np.linalg.lstsq(np.vstack([corners.T, np.ones(3)]), foot, rcond=None)[0]
            if height > 0 and (weights >= 0).all():
                least = min(least, float(height))
    return least


def fcl_solid(shape: Shape):
    """The shape in python-fcl."""
    if isinstance(shape, Sphere):
        return fcl.Sphere(shape.radius)
    if isinstance(shape, Box):
        return fcl.Box(*shape.size)
    if isinstance(shape, Mesh):
        faces = ConvexHull(shape.vertices).simplices
        model = fcl.BVHModel()
        model.beginModel(len(shape.vertices), len(faces))
        model.addSubModel(shape.vertices, faces)
        model.endModel()
        return model
    return (fcl.Capsule if isinstance(shape, Capsule) else fcl.Cylinder)(shape.radius, shape.length)


def fcl_capsule(a: np.ndarray, b: np.ndarray, radius: float):
    """A capsule between two points."""
    way = b - a
    length = float(np.linalg.norm(way))
    z = way / length if length > 0 else np.array([0.0, 0.0, 1.0])
    x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
    x /= np.linalg.norm(x)
    turn = np.column_stack([x, np.cross(z, x), z])
    return fcl.CollisionObject(fcl.Capsule(radius, length), fcl.Transform(turn, 0.5 * (a + b)))


def fcl_obstacle(obstacle: Obstacle):
    placed = fcl.Transform(obstacle.pose.rotation, obstacle.pose.position)
    return fcl.CollisionObject(fcl_solid(obstacle.shape), placed)


def fcl_distance(one, other) -> float:
    """Distance [m]; a negative number, of no meaning, if they touch."""
    return float(fcl.distance(one, other, fcl.DistanceRequest(gjk_solver_type=fcl.GJKSolverType.GST_INDEP)))
