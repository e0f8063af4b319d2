"""What scenes are made of besides the robot: descriptions, no simulator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...planner.geometry.pose import Pose
from ...planner.geometry.shapes import Box, Capsule, Cylinder, Shape, Sphere

TABLE_HEIGHT = 0.8
"""z of the table top [m]."""
TABLE_HALF_SIZE = 0.4
"""Of the table top, in x and y [m]."""
Color = tuple[float, float, float, float]
"""Red, green, blue and opacity, from 0 to 1."""
GLASS: Color = (0.72, 0.86, 0.95, 0.32)
MATT: Color = (0.62, 0.60, 0.57, 1.0)


@dataclass(frozen=True)
class FreeBody:
    """A free body of one shape.

    Attributes:
        name: unique.
        shape: a box, sphere, capsule or cylinder, centered on the body's frame.
        texture: robosuite's name of one; "" for none. Boxes only.
        color: used where there is no texture.
        density: [kg/m3].
        condim: MuJoCo's number of contact dimensions: 4 resists twisting in the grasp.
        yaw_symmetry: smallest yaw [rad] after which it looks the same; 2 pi if it never does, 0 if it always does.
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
    """A free, straight-walled, round cup; its frame is in the middle of its axis, z up.

    Attributes:
        name: unique.
        radius: outside [m].
        height: outside [m].
        wall: thickness [m] of the wall and the bottom.
        mass: [kg].
        color: of the glass.
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
        """The cup, filled up."""
        return Cylinder(self.radius, self.height)


@dataclass(frozen=True)
class Book:
    """A free, closed book: to the physics one box, to the eye a cover around paper.

    Its frame is in its middle: x from the spine to the edge that opens, y across its thickness, z along the spine.

    Attributes:
        name: unique.
        size: depth, thickness, height [m].
        color: of the cover.
        density: [kg/m3].
    """

    name: str
    size: tuple[float, float, float]
    color: Color
    density: float = 243.5
    yaw_symmetry = 2.0 * np.pi

    @property
    def shape(self) -> Box:
        """It."""
        return Box(self.size)


@dataclass(frozen=True)
class Beads:
    """Small balls that stand for a liquid; each slides without turning, which is what makes them cheap.

    Attributes:
        count: how many.
        radius: [m].
        mass: of one [kg].
        color: of all.
    """

    count: int = 30
    radius: float = 0.006
    mass: float = 0.001
    color: Color = (0.16, 0.47, 0.86, 1.0)


@dataclass(frozen=True)
class FixedShape:
    """A piece of furniture.

    Attributes:
        shape: a box, sphere, capsule or cylinder.
        place: (7,) its center in the furniture's frame, x y z [m] and wxyz.
        color: of it.
    """

    shape: Shape
    place: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    color: Color = MATT

    @property
    def pose(self) -> Pose:
        """In the furniture's frame."""
        return Pose.from_vector(self.place)


@dataclass(frozen=True)
class Furniture:
    """Does not move within an episode, but may stand elsewhere in the next.

    Attributes:
        name: unique.
        parts: its pieces.
    """

    name: str
    parts: tuple[FixedShape, ...]


@dataclass(frozen=True)
class SceneSpec:
    """Everything in a scene besides robot and table.

    Attributes:
        objects: free bodies, in the order of `object_pose`.
        furniture: in the order of `furniture_pose`.
        beads: None, or the liquid.
        obstacles: how many bodies of any shape may be in the way at once.
    """

    objects: tuple[FreeBody | Glass | Book, ...] = ()
    furniture: tuple[Furniture, ...] = ()
    beads: Beads | None = None
    obstacles: int = 0


NOTHING = SceneSpec()


def half_sizes(shape: Shape) -> tuple[str, tuple[float, float, float]]:
    """MuJoCo's name and sizes of a shape.

    Raises:
        TypeError: it is a mesh.
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
    """Full extents (3,) [m] along the shape's own axes."""
    kind, half = half_sizes(shape)
    if kind == "box":
        return 2.0 * np.array(half)
    radius, long = half[0], half[1] if kind == "cylinder" else half[1] + half[0]
    return 2.0 * np.array([radius, radius, long])
