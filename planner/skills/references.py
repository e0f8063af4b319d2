"""Reference of a release: the thing that the end of a motion is relative to."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ..geometry.pose import Pose
from .thing import Thing, touching

TOUCHES = 0.004
"""Distance [m] up to which things at rest touch: recorded shapes and places are not exact."""


class Reference(NamedTuple):
    """The thing that an end is relative to.

    Attributes:
        name: of the thing; "" if there is none.
        touched: all things that are touched at rest, the smallest first.
        others: other things that the end may be relative to.
        why: a sentence.
    """

    name: str
    touched: tuple[str, ...]
    others: tuple[str, ...]
    why: str


def reference_of(
    name: str, rest: Pose, places: Mapping[str, Pose], things: Mapping[str, Thing], usual: float = 0.15
) -> Reference:
    """Return what the rest of an object is relative to: the smallest thing that it touches there.

    Not the nearest origin, which may be far from the surface, and not the world: a table that an object merely stands
    on is touched by everything. Where shapes are unknown, it is the thing whose origin is nearest.

    Args:
        name: of the object.
        rest: its pose at rest in the world.
        places: poses of all other things at that moment.
        things: their shapes, as far as known.
        usual: largest distance [m] of the origin of a thing whose shape is unknown.
    """
    known = [(things[other], pose) for other, pose in places.items() if other in things and other != name]
    if name in things and known:
        near = touching(things[name], rest, known, TOUCHES)
        if near:
            names = tuple(thing.name for thing, _ in near)
            return Reference(
                names[0], names, names[1:], f"{names[0]} is the smallest thing that {name} touches at rest"
            )
        return Reference("", (), (), f"{name} touches nothing at rest")
    gaps = {
        other: float(np.linalg.norm(pose.position - rest.position)) for other, pose in places.items() if other != name
    }
    near_names = sorted((other for other in gaps if gaps[other] <= usual), key=lambda other: gaps[other])
    if not near_names:
        return Reference("", (), (), f"nothing is within {usual:g} m of {name} at rest")
    why = f"the origin of {near_names[0]} is nearest to {name}, {1e3 * gaps[near_names[0]]:.0f} mm; shapes are unknown"
    return Reference(near_names[0], (near_names[0],), tuple(near_names[1:]), why)
