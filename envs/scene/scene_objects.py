"""Scene contents besides the robot: descriptions, independent of the simulator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...planner import Box, Capsule, Cylinder, Mesh, Pose, Shape, Sphere

TABLE_HEIGHT = 0.8
"""Height (z) of the table top [m]."""
TABLE_HALF_SIZE = 0.4
"""Half size of the table top in x and y [m]."""
Color = tuple[float, float, float, float]
"""Red, green, blue and opacity, in [0, 1]."""
GLASS: Color = (0.72, 0.86, 0.95, 0.32)
MATT: Color = (0.62, 0.60, 0.57, 1.0)


@dataclass(frozen=True)
class FreeBody:
    """A free body of one shape.

    Attributes:
        name: unique name.
        shape: box, sphere, capsule or cylinder, centered on the body's frame.
        texture: robosuite's name of a texture, for boxes only; "" for none.
        color: color used without a texture.
        density: density [kg/m3].
        condim: MuJoCo's number of contact dimensions: 4 resists twisting in the grasp.
        yaw_symmetry: smallest yaw [rad] after which the body looks the same; 2 pi without symmetry, 0 for a round body.
    """

    name: str
    shape: Shape
    texture: str = ""
    color: Color = MATT
    density: float = 600.0
    condim: int = 3
    yaw_symmetry: float = np.pi


@dataclass(frozen=True)
class Glass:
    """A free, straight-walled, round cup; its frame is at the center of its axis, z up.

    Attributes:
        name: unique name.
        radius: outer radius [m].
        height: outer height [m].
        wall: thickness of wall and bottom [m].
        mass: mass [kg].
        color: color of the glass.
    """

    name: str
    radius: float = 0.033
    height: float = 0.1
    wall: float = 0.003
    mass: float = 0.08
    color: Color = GLASS
    yaw_symmetry = 0.0

    @property
    def shape(self) -> Cylinder:
        """The cup as a solid cylinder."""
        return Cylinder(self.radius, self.height)


@dataclass(frozen=True)
class Book:
    """A free, closed book: one box to the physics, a cover around paper in images.

    Its frame is at its center: x from the spine to the opening edge, y across its thickness, z along the spine.

    Attributes:
        name: unique name.
        size: depth, thickness, height [m].
        color: color of the cover.
        density: density [kg/m3].
    """

    name: str
    size: tuple[float, float, float]
    color: Color
    density: float = 243.5
    yaw_symmetry = 2.0 * np.pi

    @property
    def shape(self) -> Box:
        """The book's box."""
        return Box(self.size)


@dataclass(frozen=True)
class Beads:
    """Small balls that represent a liquid; each slides without turning, which makes them cheap.

    Attributes:
        count: number of beads.
        radius: radius of a bead [m].
        mass: mass of a bead [kg].
        color: color of all beads.
    """

    count: int = 30
    radius: float = 0.006
    mass: float = 0.001
    color: Color = (0.16, 0.47, 0.86, 1.0)


@dataclass(frozen=True)
class FixedShape:
    """A solid part of furniture or of a compound body.

    Attributes:
        shape: any shape; a mesh has its own frame, the others are centered on theirs.
        place: (7,) pose of the shape's frame in that of the whole, x y z [m] and wxyz.
        color: color of the part.
    """

    shape: Shape
    place: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    color: Color = MATT

    @property
    def pose(self) -> Pose:
        """Pose in the furniture's frame."""
        return Pose.from_vector(self.place)


@dataclass(frozen=True)
class CompoundBody:
    """A free body of several solid parts.

    Attributes:
        name: unique name.
        parts: solid parts.
        shape: convex hull of all parts, in the body's frame.
        density: density [kg/m3].
        friction: sliding friction coefficient.
        yaw_symmetry: see `FreeBody`.
    """

    name: str
    parts: tuple[FixedShape, ...]
    shape: Shape
    density: float = 600.0
    friction: float = 1.0
    yaw_symmetry: float = 2.0 * np.pi


@dataclass(frozen=True)
class Furniture:
    """Furniture: fixed within an episode, possibly moved between episodes.

    Attributes:
        name: unique name.
        parts: solid parts.
        friction: sliding friction coefficient.
    """

    name: str
    parts: tuple[FixedShape, ...]
    friction: float = 1.0


FreeThing = FreeBody | Glass | Book | CompoundBody
"""Any free body of a scene."""


@dataclass(frozen=True)
class SceneSpec:
    """Scene contents besides robot and table.

    Attributes:
        objects: free bodies, in the order of `object_pose`.
        furniture: furniture, in the order of `furniture_pose`.
        beads: the liquid, or None.
        obstacles: largest number of obstacles, of any shape, at once.
    """

    objects: tuple[FreeThing, ...] = ()
    furniture: tuple[Furniture, ...] = ()
    beads: Beads | None = None
    obstacles: int = 0


NOTHING = SceneSpec()


def half_sizes(shape: Shape) -> tuple[str, tuple[float, float, float]]:
    """Return MuJoCo's name and half sizes [m] of a shape.

    Raises:
        TypeError: the shape is a mesh.
    """
    if isinstance(shape, Box):
        x, y, z = shape.size
        return "box", (0.5 * x, 0.5 * y, 0.5 * z)
    if isinstance(shape, Sphere):
        return "sphere", (shape.radius, 0.0, 0.0)
    if isinstance(shape, Cylinder | Capsule):
        return type(shape).__name__.lower(), (shape.radius, 0.5 * shape.length, 0.0)
    raise TypeError("a mesh is not one of MuJoCo's primitives")


def extents(shape: Shape) -> np.ndarray:
    """Return the full extents (3,) [m] along the shape's own axes."""
    if isinstance(shape, Mesh):
        return np.ptp(shape.vertices, axis=0)
    kind, half = half_sizes(shape)
    if kind == "box":
        return 2.0 * np.array(half)
    radius, long = half[0], half[1] if kind == "cylinder" else half[1] + half[0]
    return 2.0 * np.array([radius, radius, long])
