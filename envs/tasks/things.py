"""Contents of a user's scene: movable things and fixtures, each of one or several convex parts."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from ...planner import Box, Capsule, Cylinder, Mesh, Obstacle, Shape, Sphere
from ...planner.errors import BadOption, OneDemoError
from ..guests.solids import hull_of
from ..scene.scene_objects import MATT, Color, CompoundBody, FixedShape, Furniture

Triple = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
UPRIGHT: Quaternion = (1.0, 0.0, 0.0, 0.0)
WOOD: Color = (0.76, 0.57, 0.36, 1.0)


@dataclass(frozen=True)
class Part:
    """A convex solid, placed in the frame of a thing.

    Attributes:
        shape: box, sphere, capsule, cylinder or convex mesh.
        at: position (x, y, z) [m].
        rotation: quaternion wxyz.
        color: red, green, blue and opacity, in [0, 1]; None: that of the thing.
    """

    shape: Shape
    at: Triple = (0.0, 0.0, 0.0)
    rotation: Quaternion = UPRIGHT
    color: Color | None = None

    def fixed(self, color: Color) -> FixedShape:
        """Return the part as the scene has it, with this color if it has none of its own."""
        w, x, y, z = self.rotation
        norm = math.sqrt(w * w + x * x + y * y + z * z)
        if abs(norm - 1.0) > 1e-3:
            raise BadOption("rotation", f"{self.rotation} has norm {norm:.6g}; expected 1 (wxyz)")
        place = (*map(float, self.at), w / norm, x / norm, y / norm, z / norm)
        return FixedShape(self.shape, place, self.color or color)


Parts = Shape | Part | Iterable[Shape | Part]
"""A thing's solids: one shape, one part, or several."""


@dataclass(frozen=True)
class Movable:
    """A free body that the robot can move.

    Attributes:
        name: unique in the task.
        parts: its solids: a shape, a part, or several.
        density: density [kg/m3].
        friction: sliding friction coefficient; of two things that touch, the larger one counts.
        color: color of the parts that have none of their own.
        yaw_symmetry: smallest turn [rad] about its z axis after which it looks the same, 0 for a round one; None: that
            of its shape if it is a single one, else no symmetry (2 pi).
    """

    name: str
    parts: Parts
    density: float = 600.0
    friction: float = 1.0
    color: Color = WOOD
    yaw_symmetry: float | None = None

    def __post_init__(self):
        object.__setattr__(self, "parts", checked_parts(self.name, self.parts))

    @property
    def body(self) -> CompoundBody:
        """The body as the scene has it."""
        parts = tuple(part.fixed(self.color) for part in self.parts)  # type: ignore[union-attr]
        shape = hull_of([Obstacle(part.shape, part.pose) for part in parts])
        symmetry = _symmetry_of(parts) if self.yaw_symmetry is None else self.yaw_symmetry
        return CompoundBody(self.name, parts, shape, self.density, self.friction, symmetry)


@dataclass(frozen=True)
class Fixture:
    """A body that the robot cannot move; between episodes it may stand elsewhere.

    Attributes:
        name: unique in the task.
        parts: its solids: a shape, a part, or several.
        friction: sliding friction coefficient; of two things that touch, the larger one counts.
        color: color of the parts that have none of their own.
    """

    name: str
    parts: Parts
    friction: float = 1.0
    color: Color = MATT

    def __post_init__(self):
        object.__setattr__(self, "parts", checked_parts(self.name, self.parts))

    @property
    def furniture(self) -> Furniture:
        """The fixture as the scene has it."""
        parts = tuple(part.fixed(self.color) for part in self.parts)  # type: ignore[union-attr]
        return Furniture(self.name, parts, self.friction)


def checked_parts(name: str, parts: Any) -> tuple[Part, ...]:
    """Return the parts of a thing.

    Args:
        name: of the thing, for messages.
        parts: a shape, a part, or several of them.

    Raises:
        BadOption: something else, or none.
    """
    several = [parts] if isinstance(parts, Shape | Part) else parts
    if not isinstance(several, Iterable) or isinstance(several, str):
        raise BadOption("parts", f"of {name!r} are {parts!r}; expected a shape, a Part, or several of them")
    found = tuple(Part(each) if isinstance(each, Shape) else each for each in several)
    for part in found:
        if not isinstance(part, Part) or not isinstance(part.shape, Shape):
            raise BadOption("parts", f"of {name!r} hold {part!r}; expected a shape, a Part, or several of them")
        try:
            part.fixed(MATT)
        except (OneDemoError, TypeError, ValueError) as error:
            raise BadOption("parts", f"of {name!r}: {getattr(error, 'reason', error)}") from None
    if not found:
        raise BadOption("parts", f"of {name!r} are none; expected a shape, a Part, or several of them")
    return found


def _symmetry_of(parts: tuple[FixedShape, ...]) -> float:
    """Return the yaw symmetry of a thing of one centered, upright shape; no symmetry for any other."""
    shape, place = parts[0].shape, parts[0].place
    if len(parts) > 1 or any(place[:3]) or any(place[4:]) or isinstance(shape, Mesh):
        return 2.0 * math.pi
    if isinstance(shape, Cylinder | Capsule | Sphere):
        return 0.0
    assert isinstance(shape, Box)
    return 0.5 * math.pi if math.isclose(shape.size[0], shape.size[1]) else math.pi
