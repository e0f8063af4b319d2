"""Dense rewards of the tasks of one object: one measure of closeness, and what comes before and after it."""

from __future__ import annotations

import math

from ..planner.jit import kernel

FAR, NEAR = 5.0, 40.0
"""Slopes [1/m]: one that is felt from anywhere on the table, one that still tells 5 mm from 10 mm."""


@kernel
def closeness(error):
    """In (0, 1], 1 where nothing is missing; `error` is a screw length [m], see `METERS_PER_RADIAN`."""
    return 1.0 - 0.5 * (math.tanh(FAR * error) + math.tanh(NEAR * error))


@kernel
def placing(reach, error, held, done, away):
    """Reward in [0, 1] for one object that is to be put somewhere.

    Args:
        reach: from the tool to the object [m].
        error: screw length of the object to its place [m].
        held: it is in the hand.
        done: it is in its place and let go.
        away: in [0, 1], how much of the way the hand has withdrawn.
    """
    if done:
        return 0.75 + 0.25 * away
    if held:
        return 0.15 + 0.6 * closeness(error)
    return 0.1 * (1.0 - math.tanh(FAR * reach)) + 0.05 * closeness(error)


@kernel
def tilting(way, tilt, held, poured):
    """Reward in [0, 1] for one glass that is to be emptied into another.

    Args:
        way: horizontal distance of the rims' middles beyond which nothing falls in [m]; 0 where it does.
        tilt: share of the pouring tilt, in [0, 1].
        held: the glass is in the hand.
        poured: share of the beads in the other glass.
    """
    if not held:
        return 0.5 * poured
    there = 1.0 - math.tanh(FAR * way)
    return 0.1 + 0.2 * there + 0.2 * there * tilt + 0.5 * poured
