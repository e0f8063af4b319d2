"""Steps of a skill: phases that are done together, and the ways in which they may differ from what was shown."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np

from ...planner import Pose
from ...planner.skills.alike import UP, turned_about
from ...planner.skills.skill import Phase, Skill

TAILS = (math.inf, 0.06, 0.03)
"""Path lengths [m] at the end of a carry that are imitated: all, or less where the demonstrated way is out of reach."""
LEANS = tuple(np.deg2rad([0.0, 15.0, -15.0, 30.0, -30.0]))
"""Angles [rad] about the line on which the fingers close by which the hand may lean to reach farther."""
TURNS = (0.0, 0.5 * math.pi)
"""Turns [rad] of the hand about its approach axis: a wall beside the object may leave no room for the hand as shown."""
RAISED = (0.0, 0.003, 0.006, 0.010, 0.015)
"""Heights [m] above the demonstrated grasp that are tried: another hand, or another object, leaves less room."""


class Way(NamedTuple):
    """Changes of what was shown, where that cannot be done.

    Attributes:
        brushed: whether other objects may be touched.
        turn: of the hand about its approach axis [rad].
        lean: angle [rad] about the line on which the fingers close.
        tail: path length [m] at the end of the carry that is imitated.
        height: [m] above the demonstrated grasp.
    """

    brushed: bool = False
    turn: float = 0.0
    lean: float = 0.0
    tail: float = math.inf
    height: float = 0.0

    @property
    def hand(self) -> Pose:
        """The hand, in the frame of the hand as shown."""
        origin = np.zeros(3)
        return turned_about(UP, origin, self.turn) @ turned_about(np.array([1.0, 0.0, 0.0]), origin, self.lean)


AS_SHOWN = Way()
WAYS = tuple(Way(*way) for way in product((False, True), TURNS, LEANS, TAILS, RAISED))
"""All ways to take an object, the likest to the demonstration first."""


class Transfer(NamedTuple):
    """Fetching a thing, lifting it and carrying it away.

    Attributes:
        reach: the phase in which the hand goes to it; None: it is in the hand.
        lift: the phase in which it is lifted; None: as the carry begins.
        carry: the phase in which it is carried.
    """

    reach: Phase | None
    lift: Phase | None
    carry: Phase

    @property
    def ways(self) -> tuple[Way, ...]:
        """Ways to do it without a search, the likest to the demonstration first."""
        return () if self.carry.as_shown else WAYS

    @property
    def raised(self) -> tuple[Way, ...]:
        """Ways to do it with a search in joint space."""
        return (AS_SHOWN,) if self.carry.as_shown else tuple(Way(height=height) for height in RAISED)

    @property
    def tails(self) -> tuple[float, ...]:
        """Path lengths [m] at the end of the carry that are imitated without a search."""
        return () if self.carry.as_shown else TAILS


def steps_of(skill: Skill) -> Iterator[Phase | Transfer]:
    """Yield the phases of a skill in order; those of one transfer together."""
    reach, lift = None, None
    for phase, following in zip(skill.phases, [*skill.phases[1:], None], strict=True):
        if phase.kind == "reach" and following is not None and following.kind in ("lift", "carry"):
            reach = phase
        elif phase.kind == "lift":
            lift = phase
        elif phase.kind == "carry":
            yield Transfer(reach, lift, phase)
            reach, lift = None, None
        else:
            yield phase
