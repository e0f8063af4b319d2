"""Shapes of obstacles and held objects, and the numbers that the compiled queries take.

A shape is described in its own frame, centered; boxes and cylinders by full extents as people measure them.
`pack` lays obstacles out as rows of floats:

| columns | meaning |
|---|---|
| 0 | kind: SPHERE, CAPSULE, BOX, CYLINDER or MESH |
| 1 | rounding radius [m]: the surface is this far from the core |
| 2 to 4 | center in the world [m] |
| 5 to 13 | rotation, row by row, `world_from_shape` |
| 14 to 16 | half extents of the core [m]; a capsule's core is the z axis between +- column 16 |
| 17 to 19 | linear velocity [m/s] |
| 20 | radius of a ball about the center that holds the shape [m] |
| 21, 22 | first vertex and number of vertices of a mesh |
| 23 | safety distance [m] to keep from this obstacle; negative: the general one |
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..errors import BadShape, NotFinite, UnfitShape
from .pose import Pose

SPHERE, CAPSULE, BOX, CYLINDER, MESH = 0.0, 1.0, 2.0, 3.0, 4.0
ROW = 24
SMALLEST, LARGEST = 1e-6, 100.0
"""Extents below or above these [m] are mistakes."""
MAX_VERTICES = 256
"""Of one convex mesh: the queries look at all of them."""


def _length(shape: str, name: str, value: float) -> float:
    number = float(value)
    if not math.isfinite(number) or not SMALLEST <= number <= LARGEST:
        raise UnfitShape(shape, name, f"{value!r} is not a length from {SMALLEST:g} to {LARGEST:g} m")
    return number


def _set(shape: object, **values: object) -> None:
    for name, value in values.items():
        object.__setattr__(shape, name, value)


@dataclass(frozen=True, slots=True)
class Sphere:
    """A ball.

    Attributes:
        radius: [m].
    """

    radius: float

    def __post_init__(self):
        _set(self, radius=_length("sphere", "radius", self.radius))


@dataclass(frozen=True, slots=True)
class Capsule:
    """All points within `radius` of a segment along z, centered.

    Attributes:
        radius: [m].
        length: of the segment [m], without the round ends.
    """

    radius: float
    length: float

    def __post_init__(self):
        _set(self, radius=_length("capsule", "radius", self.radius), length=_length("capsule", "length", self.length))


@dataclass(frozen=True, slots=True)
class Box:
    """A cuboid.

    Attributes:
        size: full extents (x, y, z) [m].
    """

    size: tuple[float, float, float]

    def __post_init__(self):
        if len(self.size) != 3:
            raise BadShape("box: size", np.shape(self.size), "(3,)")
        x, y, z = (_length("box", f"size[{k}]", extent) for k, extent in enumerate(self.size))
        _set(self, size=(x, y, z))


@dataclass(frozen=True, slots=True)
class Cylinder:
    """A cylinder along z, centered.

    Attributes:
        radius: [m].
        length: full height [m].
    """

    radius: float
    length: float

    def __post_init__(self):
        _set(self, radius=_length("cylinder", "radius", self.radius), length=_length("cylinder", "length", self.length))


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """A convex polyhedron: the hull of its vertices.

    Attributes:
        vertices: (n, 3) [m], n from 4 to 256, every one a corner of the hull.

    Raises:
        UnfitShape: a vertex lies inside the hull of the others (the mesh is not convex), or there is no volume.
    """

    vertices: np.ndarray

    def __post_init__(self):
        points = np.array(self.vertices, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 3:
            raise BadShape("mesh: vertices", points.shape, "(n, 3)")
        bad = np.argwhere(~np.isfinite(points))
        if len(bad):
            raise NotFinite("mesh: vertices", tuple(int(k) for k in bad[0]))
        if not 4 <= len(points) <= MAX_VERTICES:
            raise UnfitShape("mesh", "vertices", f"there are {len(points)}; allowed are 4 to {MAX_VERTICES}")
        if np.abs(points).max() > LARGEST:
            raise UnfitShape("mesh", "vertices", f"one is more than {LARGEST:g} m away: millimetres?")
        corners = hull_corners(points)
        if len(corners) < len(points):
            inside = int(np.setdiff1d(np.arange(len(points)), corners)[0])
            reason = f"vertex {inside} is no corner of the hull: the mesh is not convex; see Mesh.hull_of"
            raise UnfitShape("mesh", "vertices", reason)
        points.flags.writeable = False
        _set(self, vertices=points)

    def __eq__(self, other: object) -> bool:
        """The same vertices in the same order."""
        return isinstance(other, Mesh) and np.array_equal(self.vertices, other.vertices)

    def __hash__(self) -> int:
        """Of the vertices."""
        return hash(self.vertices.tobytes())

    @staticmethod
    def hull_of(points: np.ndarray) -> Mesh:
        """The convex hull of points (n, 3)."""
        points = np.asarray(points, dtype=np.float64)
        return Mesh(points[hull_corners(points)])


def hull_corners(points: np.ndarray) -> np.ndarray:
    """Indices, in order, of the points (n, 3) that are corners of their convex hull.

    Raises:
        UnfitShape: they lie in a plane, on a line or in a point.
    """
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        raise UnfitShape("mesh", "vertices", "they enclose no volume") from None
    extent = np.ptp(points, axis=0).max()
    if hull.volume < 1e-9 * extent**3:
        raise UnfitShape("mesh", "vertices", f"they enclose no volume ({hull.volume:.3g} m^3)")
    return np.sort(hull.vertices)


Shape = Sphere | Capsule | Box | Cylinder | Mesh


@dataclass(frozen=True, slots=True, eq=False)
class Obstacle:
    """A shape somewhere in the world, still or moving along a straight line.

    Attributes:
        shape: its form.
        pose: `world_from_shape` now.
        velocity: (3,) of its center in the world [m/s]; it does not turn.
        name: for messages, reports and allow-lists.
        margin: safety distance [m] to keep from this one; None: the general one. For the table, say, on which
            things are put down.
    """

    shape: Shape
    pose: Pose = field(default_factory=Pose.identity)
    velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))
    name: str = ""
    margin: float | None = None

    def __post_init__(self):
        velocity = np.array(self.velocity, dtype=np.float64)
        label = f"obstacle {self.name!r}"
        if velocity.shape != (3,):
            raise BadShape(f"{label}: velocity", velocity.shape, "(3,)")
        if not np.isfinite(velocity).all():
            raise NotFinite(f"{label}: velocity", int(np.argmin(np.isfinite(velocity))))
        if self.margin is not None and not 0.0 <= self.margin <= LARGEST:
            raise UnfitShape(label, "margin", f"{self.margin!r} is not a length from 0 to {LARGEST:g} m")
        velocity.flags.writeable = False
        _set(self, velocity=velocity)

    def at(self, seconds: float) -> Obstacle:
        """The obstacle some seconds later, if it goes on as it does."""
        moved = Pose.from_position_quaternion(seconds * self.velocity) @ self.pose
        return Obstacle(self.shape, moved, self.velocity, self.name, self.margin)


class Packed(NamedTuple):
    """Obstacles as the kernels take them.

    Attributes:
        rows: (k, 24), see the module.
        vertices: (n, 3) of all meshes, in their own frames [m]; at least one row.
    """

    rows: np.ndarray
    vertices: np.ndarray


def core_of(shape: Shape) -> tuple[float, float, tuple[float, float, float], float]:
    """Kind, rounding radius, half extents of the core, and radius of the ball that holds the shape."""
    if isinstance(shape, Sphere):
        return SPHERE, shape.radius, (0.0, 0.0, 0.0), shape.radius
    if isinstance(shape, Capsule):
        half = 0.5 * shape.length
        return CAPSULE, shape.radius, (0.0, 0.0, half), half + shape.radius
    if isinstance(shape, Box):
        x, y, z = (0.5 * extent for extent in shape.size)
        return BOX, 0.0, (x, y, z), math.sqrt(x * x + y * y + z * z)
    if isinstance(shape, Cylinder):
        half = 0.5 * shape.length
        return CYLINDER, 0.0, (shape.radius, shape.radius, half), math.hypot(shape.radius, half)
    x, y, z = np.abs(shape.vertices).max(axis=0)
    return MESH, 0.0, (float(x), float(y), float(z)), float(np.linalg.norm(shape.vertices, axis=1).max())


def pack(obstacles: Sequence[Obstacle]) -> Packed:
    """Obstacles as rows of floats, in their order."""
    rows = np.zeros((len(obstacles), ROW))
    vertices: list[np.ndarray] = []
    count = 0
    for row, obstacle in zip(rows, obstacles, strict=True):
        row[0], row[1], row[14:17], row[20] = core_of(obstacle.shape)
        row[2:5], row[5:14] = obstacle.pose.position, obstacle.pose.rotation.ravel()
        row[17:20] = obstacle.velocity
        row[23] = -1.0 if obstacle.margin is None else obstacle.margin
        if isinstance(obstacle.shape, Mesh):
            row[21], row[22] = count, len(obstacle.shape.vertices)
            vertices.append(obstacle.shape.vertices)
            count += len(obstacle.shape.vertices)
    return Packed(rows, np.concatenate(vertices) if vertices else np.zeros((1, 3)))


STILL = 1e-4
"""Speed [m/s] up to which an obstacle stands still."""


def moves(obstacle: Obstacle) -> bool:
    """True if an obstacle is faster than what counts as standing still."""
    return float(np.abs(obstacle.velocity).max()) > STILL
