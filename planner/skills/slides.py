"""Slides: an object that is moved along what it comes to rest on, as a sponge is along a board."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..imitation.demonstration import Demonstration
from ..imitation.segmentation import trimmed
from .corrected import said_path
from .grips import Grip
from .skill import Phase

SLIDE, LEVEL = 0.05, 0.002
"""Length [m] of a path along which an object slides on its support until it is let go, and height [m] above its rest up
to which it is on it; a shorter one is left out."""
SOME = 2
"""Least number of samples of the carry to where a slide begins: what is pushed from where it lay is no slide."""


def slides_from(demonstration: Demonstration, grip: Grip, carry: Phase) -> int | None:
    """Return the sample from which an object slides on what it comes to rest on until it is let go; None: it is put.

    Args:
        demonstration: the demonstration.
        grip: of the object.
        carry: the whole carry.
    """
    if grip.rested is None or not carry.touching:
        return None
    path = demonstration.object_paths[grip.name][grip.held : grip.released + 1]
    above = np.flatnonzero(path.positions[:, 2] - grip.rested.position[2] > LEVEL)
    first = int(above[-1]) + 1 if len(above) else 0
    level = path.positions[first:, :2]
    if first < SOME or len(level) < 2 or np.linalg.norm(level - level[-1], axis=1).max() < SLIDE:
        return None
    return grip.held + first


def slide_of(demonstration: Demonstration, grip: Grip, carry: Phase, begins: int, trim: float) -> list[Phase]:
    """Return the carry to where a slide begins, and the slide; where it presses, what was commanded is followed.

    Args:
        demonstration: the demonstration.
        grip: of the object.
        carry: the whole carry.
        begins: sample from which it slides.
        trim: radius [m] about the end of a motion within which what people do is left out.
    """
    measured = demonstration.object_paths[grip.name]
    at = {**{name: path[begins] for name, path in demonstration.object_paths.items()}, **demonstration.fixtures}
    to_reference = at[carry.reference].inverse()
    there = replace(
        carry,
        path=trimmed(measured[grip.held : begins + 1], trim),
        goals=(to_reference @ measured[begins],),
        gripper="none",
    )
    name, since = carry.name.replace("carry", "slide", 1), demonstration.time[begins] - demonstration.time[0]
    hand, why = said_path(demonstration, name)
    path = hand[begins : grip.released + 1].with_tool(grip.object_from_tcp.inverse())
    slide = replace(
        carry,
        name=name,
        kind="slide",
        path=path,
        goals=(to_reference @ path[-1],),
        exact=True,
        evidence=(f"{grip.name} slides on {carry.reference} from {since:.1f} s on; {why}",),
    )
    return [there, slide]
