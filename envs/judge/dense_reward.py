"""Dense rewards of the single-object tasks: one closeness measure, and the stages before and after it."""

from __future__ import annotations

import numpy as np

from ...planner.geometry.pose import METERS_PER_RADIAN

FAR, MIDDLE, NEAR = 2.0, 10.0, 40.0
"""Slopes [1/m]: the first is felt anywhere on the table, the second bridges to the range of the third, which still
distinguishes 5 mm from 10 mm."""


def near(length):
    """Return the closeness in (0, 1] of a length [m], 1 for zero length; accepts a number or an array."""
    return 1.0 - (np.tanh(FAR * length) + np.tanh(MIDDLE * length) + np.tanh(NEAR * length)) / 3.0


def closeness(distance, angle):
    """Return the closeness in (0, 1] of a pose error, 1 without error; accepts numbers or arrays.

    Distance and angle count separately: in a single path length the larger error hides what the smaller one gains, and
    nothing is learned about the smaller one.

    Args:
        distance: position error [m].
        angle: rotation error [rad].
    """
    return 0.5 * (near(distance) + near(METERS_PER_RADIAN * angle))


def placing(reach, distance, angle, held, done, away):
    """Return the reward in [0, 1] for placing one object.

    Args:
        reach: distance from the tcp to the object [m].
        distance: position error of the object at its goal [m].
        angle: rotation error of the object at its goal [rad].
        held: whether the object is in the hand.
        done: whether the object is at its goal and released.
        away: share, in [0, 1], of the required distance by which the hand has withdrawn.
    """
    if done:
        return 0.75 + 0.25 * away
    if held:
        # the rotation is mostly right already: weighted like the distance, it would be all that is learned
        return 0.15 + 0.45 * near(distance) + 0.15 * near(METERS_PER_RADIAN * angle)
    return 0.1 * near(reach) + 0.05 * closeness(distance, angle)


def tilting(distance, tilt, held, poured):
    """Return the reward in [0, 1] for emptying one glass into another.

    Args:
        distance: horizontal distance [m] of the source's rim center outside the target's rim; 0 above the target.
        tilt: share of the pouring tilt, in [0, 1].
        held: whether the glass is in the hand.
        poured: share of the beads in the other glass.
    """
    if not held:
        return 0.5 * poured
    there = near(distance)
    return 0.1 + 0.2 * there + 0.2 * there * tilt + 0.5 * poured


def turned_by(achieved: np.ndarray, desired: np.ndarray, *, half_turns: bool) -> np.ndarray:
    """Return the angles (...) [rad] between quaternions, wxyz.

    Args:
        achieved: (..., 4) quaternions.
        desired: (..., 4) quaternions.
        half_turns: whether half turns about the own z axis are ignored.
    """
    w = np.abs((achieved * desired).sum(axis=-1))
    if half_turns:
        # the last entry of the product conj(achieved) desired
        a, b = np.moveaxis(achieved, -1, 0), np.moveaxis(desired, -1, 0)
        w = np.maximum(w, np.abs(a[0] * b[3] - a[3] * b[0] - a[1] * b[2] + a[2] * b[1]))
    norms = np.linalg.norm(achieved, axis=-1) * np.linalg.norm(desired, axis=-1)
    return 2.0 * np.arccos(np.clip(w / np.maximum(norms, 1e-12), 0.0, 1.0))


def gaps(achieved: np.ndarray, desired: np.ndarray, *, half_turns: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return the distances (...) [m] and angles (...) [rad] between poses.

    Args:
        achieved: (..., 7) poses, x y z [m] and wxyz.
        desired: (..., 7) poses, likewise.
        half_turns: whether half turns about the own z axis are ignored.
    """
    angle = turned_by(achieved[..., 3:7], desired[..., 3:7], half_turns=half_turns)
    distance = np.linalg.norm(achieved[..., :3] - desired[..., :3], axis=-1)
    return distance, angle
