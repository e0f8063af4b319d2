"""Shapes of obstacles and held objects, and their encoding for the compiled queries.

A shape is described in its own frame, centered; boxes and cylinders by full extents, as measured.
`pack` encodes obstacles as rows of floats, see OBSTACLE.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..arrays import FrozenArrays, checked_array, checked_kind, frozen, numbers
from ..errors import BadShape, UnfitShape, WrongType
from .pose import Pose

SMALLEST, LARGEST = 1e-6, 100.0
"""Plausible range of extents [m]."""
MAX_VERTICES = 256
"""Maximum number of vertices of a convex mesh: every query visits all of them."""


class ShapeKinds(NamedTuple):
    """Numbers of the kinds of shapes, in the arrays of the planner and in observations; 0: no shape."""

    sphere: float = 1.0
    box: float = 2.0
    capsule: float = 3.0
    cylinder: float = 4.0
    mesh: float = 5.0


class ObstacleColumns(NamedTuple):
    """Columns of an obstacle; `pack` fills those before `packed`, `robot_arrays` the others."""

    kind: int = 0  # see SHAPE_KIND
    rounding: int = 1  # rounding radius [m]: distance of the surface from the core
    center: int = 2  # (3) in the world [m]
    rotation: int = 5  # (9) row by row, `world_from_shape`
    half_extents: int = 14  # (3) of the core [m]; of a capsule (0, 0, half its length)
    velocity: int = 17  # (3) [m/s]
    ball: int = 20  # radius of a ball about the center that contains the shape [m]
    first_vertex: int = 21  # of a mesh
    vertices: int = 22  # number of vertices of a mesh
    own_margin: int = 23  # margin [m] of this obstacle; negative: the general margin
    packed: int = 24  # number of columns that `pack` fills
    mask: int = 24  # capsules that may touch the obstacle, as bits of numbers: 32 capsules in each of two columns
    margin: int = 26  # distance to keep [m]


SHAPE_KIND, OBSTACLE = ShapeKinds(), ObstacleColumns()


def _number(what: str, value: float) -> float:
    try:
        if not isinstance(value, str):
            return float(value)
    except TypeError:
        pass
    raise WrongType(what, value, "a length [m]")


def _length(shape: str, name: str, value: float) -> float:
    number = _number(f"{shape}: {name}", value)
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
    """A centered capsule: all points within `radius` of a segment along z.

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
        size = numbers("box: size", self.size)
        if size.shape != (3,):
            raise BadShape("box: size", size.shape, "(3,)")
        x, y, z = (_length("box", f"size[{k}]", extent) for k, extent in enumerate(self.size))
        _set(self, size=(x, y, z))


@dataclass(frozen=True, slots=True)
class Cylinder:
    """A centered cylinder along z.

    Attributes:
        radius: [m].
        length: full height [m].
    """

    radius: float
    length: float

    def __post_init__(self):
        _set(self, radius=_length("cylinder", "radius", self.radius), length=_length("cylinder", "length", self.length))


@dataclass(frozen=True, slots=True, eq=False)
class Mesh(FrozenArrays):
    """A convex polyhedron: the hull of its vertices.

    Attributes:
        vertices: (n, 3) [m], n from 4 to 256, every one a corner of the hull.

    Raises:
        UnfitShape: a vertex lies inside the hull of the others (the mesh is not convex), or there is no volume.
    """

    vertices: np.ndarray

    def __post_init__(self):
        points = frozen(checked_array("mesh: vertices", self.vertices, (None, 3)))
        if not 4 <= len(points) <= MAX_VERTICES:
            raise UnfitShape("mesh", "vertices", f"there are {len(points)}; allowed are 4 to {MAX_VERTICES}")
        if np.abs(points).max() > LARGEST:
            raise UnfitShape("mesh", "vertices", f"one is more than {LARGEST:g} m away: millimetres?")
        corners = hull_corners(points)
        if len(corners) < len(points):
            inside = int(np.setdiff1d(np.arange(len(points)), corners)[0])
            reason = f"vertex {inside} is no corner of the hull: the mesh is not convex; see Mesh.hull_of"
            raise UnfitShape("mesh", "vertices", reason)
        _set(self, vertices=points)

    def __eq__(self, other: object) -> bool:
        """Compare vertices, including their order."""
        return isinstance(other, Mesh) and np.array_equal(self.vertices, other.vertices)

    def __hash__(self) -> int:
        """Hash of the vertices."""
        return hash(self.vertices.tobytes())

    @staticmethod
    def hull_of(points: np.ndarray) -> Mesh:
        """Return the convex hull of points (n, 3) [m]."""
        points = checked_array("mesh: vertices", points, (None, 3))
        return Mesh(points[hull_corners(points)])


def hull_corners(points: np.ndarray) -> np.ndarray:
    """Return the indices, in order, of the points (n, 3) that are corners of their convex hull.

    Raises:
        UnfitShape: the points enclose no volume (coplanar, collinear or coincident).
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
class Obstacle(FrozenArrays):
    """A shape in the world, at rest or moving along a straight line.

    Attributes:
        shape: form and size.
        pose: `world_from_shape` now.
        velocity: (3,) of the center in the world [m/s]; the obstacle does not rotate.
        name: for messages, reports and allow-lists.
        margin: clearance [m] required from this obstacle; None: the general margin. Of use for a table, for example,
            on which objects are placed.
    """

    shape: Shape
    pose: Pose = field(default_factory=Pose.identity)
    velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))
    name: str = ""
    margin: float | None = None

    def __post_init__(self):
        label = f"obstacle {self.name!r}"
        velocity = frozen(checked_array(f"{label}: velocity", self.velocity, (3,)))
        if not isinstance(self.shape, Shape):
            raise WrongType(f"{label}: shape", self.shape, "a Sphere, Capsule, Box, Cylinder or Mesh")
        checked_kind(f"{label}: pose", self.pose, Pose)
        if self.margin is not None and not 0.0 <= _number(f"{label}: margin", self.margin) <= LARGEST:
            raise UnfitShape(label, "margin", f"{self.margin!r} is not a length from 0 to {LARGEST:g} m")
        _set(self, velocity=velocity)

    def at(self, seconds: float) -> Obstacle:
        """Return the obstacle after some seconds at constant velocity."""
        moved = Pose.from_position_quaternion(seconds * self.velocity) @ self.pose
        return Obstacle(self.shape, moved, self.velocity, self.name, self.margin)


class Packed(NamedTuple):
    """Obstacles in the form the kernels take.

    Attributes:
        rows: (k, 24), see OBSTACLE.
        vertices: (n, 3) of all meshes, in their own frames [m]; at least one row.
    """

    rows: np.ndarray
    vertices: np.ndarray


def core_of(shape: Shape) -> tuple[float, float, tuple[float, float, float], float]:
    """Return the core of a shape.

    Returns:
        Kind, rounding radius [m], half extents of the core [m] and radius of the ball that contains the shape [m].
    """
    if isinstance(shape, Sphere):
        return SHAPE_KIND.sphere, shape.radius, (0.0, 0.0, 0.0), shape.radius
    if isinstance(shape, Capsule):
        half = 0.5 * shape.length
        return SHAPE_KIND.capsule, shape.radius, (0.0, 0.0, half), half + shape.radius
    if isinstance(shape, Box):
        x, y, z = (0.5 * extent for extent in shape.size)
        return SHAPE_KIND.box, 0.0, (x, y, z), math.sqrt(x * x + y * y + z * z)
    if isinstance(shape, Cylinder):
        half = 0.5 * shape.length
        return SHAPE_KIND.cylinder, 0.0, (shape.radius, shape.radius, half), math.hypot(shape.radius, half)
    x, y, z = np.abs(shape.vertices).max(axis=0)
    return SHAPE_KIND.mesh, 0.0, (float(x), float(y), float(z)), float(np.linalg.norm(shape.vertices, axis=1).max())


def pack(obstacles: Sequence[Obstacle]) -> Packed:
    """Encode obstacles as rows of floats, in order."""
    rows = np.zeros((len(obstacles), OBSTACLE.packed))
    vertices: list[np.ndarray] = []
    count = 0
    for row, obstacle in zip(rows, obstacles, strict=True):
        kind, rounding, half_extents, ball = core_of(obstacle.shape)
        row[OBSTACLE.kind], row[OBSTACLE.rounding], row[OBSTACLE.ball] = kind, rounding, ball
        row[OBSTACLE.half_extents : OBSTACLE.velocity] = half_extents
        row[OBSTACLE.center : OBSTACLE.rotation] = obstacle.pose.position
        row[OBSTACLE.rotation : OBSTACLE.half_extents] = obstacle.pose.rotation.ravel()
        row[OBSTACLE.velocity : OBSTACLE.ball] = obstacle.velocity
        row[OBSTACLE.own_margin] = -1.0 if obstacle.margin is None else obstacle.margin
        if isinstance(obstacle.shape, Mesh):
            row[OBSTACLE.first_vertex], row[OBSTACLE.vertices] = count, len(obstacle.shape.vertices)
            vertices.append(obstacle.shape.vertices)
            count += len(obstacle.shape.vertices)
    return Packed(rows, np.concatenate(vertices) if vertices else np.zeros((1, 3)))


STILL = 1e-4
"""Largest velocity component [m/s] of an obstacle that counts as standing."""


def moves(obstacle: Obstacle) -> bool:
    """Return True if an obstacle moves faster than `STILL`."""
    return float(np.abs(obstacle.velocity).max()) > STILL
