"""Dense rewards of the tasks of one object: one measure of closeness, and what comes before and after it."""

from __future__ import annotations

import numpy as np

from ...planner.geometry.pose import METERS_PER_RADIAN

FAR, MIDDLE, NEAR = 2.0, 10.0, 40.0
"""Slopes [1/m]: one that is felt from anywhere on the table, one that leads from there to where the last one, which
still tells 5 mm from 10 mm, is felt."""


def near(length):
    """In (0, 1], 1 where no length [m] is left; of a number, or of each of an array."""
    return 1.0 - (np.tanh(FAR * length) + np.tanh(MIDDLE * length) + np.tanh(NEAR * length)) / 3.0


def closeness(distance, angle):
    """In (0, 1], 1 where nothing is missing; of numbers [m, rad], or of each of two arrays.

    Distance and turn count apart: in one screw length the larger hides what the smaller gains, and nothing is learned
    of it.
    """
    return 0.5 * (near(distance) + near(METERS_PER_RADIAN * angle))


def placing(reach, distance, angle, held, done, away):
    """Reward in [0, 1] for one object that is to be put somewhere.

    Args:
        reach: from the tool to the object [m].
        distance: of the object from its place [m].
        angle: by which it is turned from it [rad].
        held: it is in the hand.
        done: it is in its place and let go.
        away: in [0, 1], how much of the way the hand has withdrawn.
    """
    if done:
        return 0.75 + 0.25 * away
    if held:
        # turned right it mostly is already: told as loudly as the way, it is all that is learned
        return 0.15 + 0.45 * near(distance) + 0.15 * near(METERS_PER_RADIAN * angle)
    return 0.1 * near(reach) + 0.05 * closeness(distance, angle)


def tilting(distance, tilt, held, poured):
    """Reward in [0, 1] for one glass that is to be emptied into another.

    Args:
        distance: horizontal distance of the rims' middles beyond which nothing falls in [m]; 0 where it does.
        tilt: share of the pouring tilt, in [0, 1].
        held: the glass is in the hand.
        poured: share of the beads in the other glass.
    """
    if not held:
        return 0.5 * poured
    there = near(distance)
    return 0.1 + 0.2 * there + 0.2 * there * tilt + 0.5 * poured
