"""The true shapes of a robot's links as objects of fcl, placed at the arm's joints by a library that is not ours."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from ...configs import BadConfig
from ...planner import Box, Capsule, Cylinder, Obstacle, Sphere
from ...planner.geometry.triangle_surface import is_inside, shells_of

RING, RINGS = 96, 24
"""Corners around a round shape, and circles along a round end, where its distance is measured: 0.05 % too narrow."""


class TrueShape(NamedTuple):
    """A collision element.

    Attributes:
        link: name of its link or body.
        exact: geometry of fcl: a mesh with its triangles, or a primitive.
        triangles: (n, 3, 3) of its surface in its own frame [m]; a round primitive's are a little inside.
    """

    link: str
    exact: Any
    triangles: np.ndarray


class TrueSolids(ABC):
    """The collision elements of a robot, placed at joints.

    Args:
        shapes: the elements.

    Attributes:
        links: name of the link of each element.
        solids: each element as an object of fcl, where `move` has put it.
        balls: (n,) radii of balls about the centers that `move` returns, which contain the elements [m].
    """

    def __init__(self, shapes: Iterable[TrueShape]):
        import fcl

        shapes = list(shapes)
        self.links = [shape.link for shape in shapes]
        self.solids = [fcl.CollisionObject(shape.exact) for shape in shapes]
        self._surfaces = [fcl.CollisionObject(mesh_of(shape.triangles)) for shape in shapes]
        boxes = [(shape.triangles.min(axis=(0, 1)), shape.triangles.max(axis=(0, 1))) for shape in shapes]
        self._triangles, self._boxes = [shape.triangles for shape in shapes], boxes
        self._shells = [shells_of(shape.triangles) for shape in shapes]
        self._places: list[tuple[np.ndarray, np.ndarray]] = []
        self._centers = [0.5 * (low + high) for low, high in boxes]
        self.balls = np.array([0.5 * np.linalg.norm(high - low) for low, high in boxes])

    @property
    @abstractmethod
    def moving(self) -> frozenset[int]:
        """Indices of the elements that the arm moves."""

    @abstractmethod
    def _poses(self, q: np.ndarray) -> Iterable[tuple[np.ndarray, np.ndarray]]:
        """Yield rotation (3, 3) and position (3,) [m] of each element in the world at joints q (dof,)."""

    def move(self, q: np.ndarray) -> np.ndarray:
        """Place all elements.

        Args:
            q: (dof,) joints of the arm [rad or m].

        Returns:
            Centers (n, 3) of the balls that contain them [m].
        """
        import fcl

        centers = np.empty((len(self.solids), 3))
        self._places = list(self._poses(q))
        for k, (rotation, position) in enumerate(self._places):
            place = fcl.Transform(rotation, position)
            self.solids[k].setTransform(place)
            self._surfaces[k].setTransform(place)
            centers[k] = rotation @ self._centers[k] + position
        return centers

    def distance(self, one: int, other: int) -> float:
        """Return the distance of the surfaces of two elements [m] where they are.

        Args:
            one: index of an element.
            other: index of another.

        Returns:
            Not above 0 if they cross, or if one lies inside the other.
        """
        import fcl

        surfaces = self._surfaces
        found = float(fcl.distance(surfaces[one], surfaces[other], fcl.DistanceRequest(), fcl.DistanceResult()))
        return 0.0 if found > 0.0 and self._nested(one, other) else found

    def touch(self, one: int, other: int) -> bool:
        """Return whether two elements touch where they are, or one lies inside the other.

        Args:
            one: index of an element.
            other: index of another.
        """
        import fcl

        return fcl.collide(self.solids[one], self.solids[other]) > 0 or self._nested(one, other)

    def _nested(self, one: int, other: int) -> bool:
        """Return whether one of two elements whose surfaces do not cross lies inside the other."""
        return self._holds(one, other) or self._holds(other, one)

    def _holds(self, outer: int, inner: int) -> bool:
        (rotation, position), (turn, place) = self._places[outer], self._places[inner]
        corner = (turn @ self._triangles[inner][0, 0] + place - position) @ rotation
        low, high = self._boxes[outer]
        in_box = bool(((low <= corner) & (corner <= high)).all())
        return in_box and any(is_inside(corner, shell) for shell in self._shells[outer])


def mesh_of(triangles: np.ndarray) -> Any:
    """Return triangles (n, 3, 3) [m] as a mesh of fcl."""
    import fcl

    mesh = fcl.BVHModel()
    mesh.beginModel(3 * len(triangles), len(triangles))
    mesh.addSubModel(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))
    mesh.endModel()
    return mesh


def box_shape(link: str, size: Iterable[float]) -> TrueShape:
    """Return a box.

    Args:
        link: name of its link.
        size: full extents (3) [m].
    """
    import fcl

    extents = [float(extent) for extent in size]
    signs = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    return TrueShape(link, fcl.Box(*extents), hull_triangles(signs * extents))


def round_shape(link: str, kind: str, radius: float, length: float) -> TrueShape:
    """Return a centered ball, capsule or cylinder along z.

    Args:
        link: name of its link.
        kind: "Sphere", "Capsule" or "Cylinder", as fcl names it.
        radius: [m].
        length: of the core [m]; a ball has none.
    """
    import fcl

    angle = 2.0 * np.pi * np.arange(RING) / RING
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    latitude = np.zeros(1) if kind == "Cylinder" else np.linspace(-0.5 * np.pi, 0.5 * np.pi, RINGS + 1)
    shell = np.vstack([np.column_stack([np.cos(turn) * ring, np.full(RING, np.sin(turn))]) for turn in latitude])
    ends = (0.0,) if kind == "Sphere" else (-0.5 * length, 0.5 * length)
    corners = np.vstack([radius * shell + [0.0, 0.0, end] for end in ends])
    form = fcl.Sphere(radius) if kind == "Sphere" else getattr(fcl, kind)(radius, length)
    return TrueShape(link, form, hull_triangles(corners))


def ellipsoid_shape(link: str, radii: Iterable[float]) -> TrueShape:
    """Return an ellipsoid.

    Args:
        link: name of its link.
        radii: (3) [m].
    """
    import fcl

    lengths = [float(radius) for radius in radii]
    return TrueShape(link, fcl.Ellipsoid(*lengths), round_shape(link, "Sphere", 1.0, 0.0).triangles * lengths)


def mesh_shape(link: str, triangles: np.ndarray) -> TrueShape:
    """Return a mesh.

    Args:
        link: name of its link.
        triangles: (n, 3, 3) of its surface [m].
    """
    return TrueShape(link, mesh_of(triangles), triangles)


def solid_of(obstacle: Obstacle) -> Any:
    """Return an obstacle as a placed object of fcl.

    Raises:
        BadConfig: it is a mesh.
    """
    import fcl

    return fcl.CollisionObject(_form_of(fcl, obstacle), fcl.Transform(obstacle.pose.rotation, obstacle.pose.position))


def _form_of(fcl: Any, obstacle: Obstacle) -> Any:
    match obstacle.shape:
        case Box(size):
            return fcl.Box(*size)
        case Cylinder(radius, length):
            return fcl.Cylinder(radius, length)
        case Sphere(radius):
            return fcl.Sphere(radius)
        case Capsule(radius, length):
            return fcl.Capsule(radius, length)
    raise BadConfig("problems", obstacle.name, f"is a {type(obstacle.shape).__name__}; judged are primitives")


def ball_of(obstacle: Obstacle) -> float:
    """Return the radius [m] of a ball about an obstacle's center that contains it."""
    match obstacle.shape:
        case Box(size):
            return 0.5 * float(np.linalg.norm(size))
        case Cylinder(radius, length):
            return float(np.hypot(radius, 0.5 * length))
        case Capsule(radius, length):
            return radius + 0.5 * length
        case Sphere(radius):
            return radius
    return np.inf


def hull_triangles(points: np.ndarray) -> np.ndarray:
    """Return the triangles (k, 3, 3) of the hull of points (n, 3) [m]."""
    from scipy.spatial import ConvexHull

    return points[ConvexHull(points).simplices]
