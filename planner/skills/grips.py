"""Grips: when the hand held an object, how, where the object lay before, and where it came to rest after."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..geometry import dualquat as dq
from ..geometry.pose import Pose, PosePath
from ..imitation.demonstration import Demonstration

RIGID, TURN = 0.002, 0.05
"""Motion [m] and angle [rad] in the hand within `WINDOW` up to which an object moves with the hand."""
WINDOW = 0.25
"""Time [s] that fingers need to close, and over which motions are compared."""
SLIPPED, ROLLED = 0.03, 0.4
"""Motion [m] and angle [rad] in the hand since the grasp beyond which an object has left the hand."""
CARRIED = 0.015
"""Least displacement [m] of an object that was carried; less is a nudge."""
BACK = 0.05
"""Distance [m] by which the hand is farther from an object than at the grasp while the object is undisturbed."""
BRIEF = 0.6
"""Longest time [s] for which the hand closes on nothing, or opens and closes again on the same object, by mistake."""
LAGS = 0.6
"""Longest time [s] between the command to open and the moment at which the object leaves the hand."""
RESTS, QUIET = 0.001, 0.3
"""Motion [m] within a time [s] below which an object is at rest."""


class Grip(NamedTuple):
    """A span of a recording in which an object moved with the hand.

    Attributes:
        name: of the object.
        closed: sample of the command to close.
        held: first sample from which the object moves with the hand.
        released: last sample in which it does.
        open: sample of the command to open; the last sample if there is none.
        opens: whether the hand opens at the end.
        object_from_tcp: pose of the hand in the object's frame, as it held.
        undisturbed: pose of the object before the hand came near.
        rested: pose of the object at rest after the release; None if that was not recorded.
    """

    name: str
    closed: int
    held: int
    released: int
    open: int
    opens: bool
    object_from_tcp: Pose
    undisturbed: Pose
    rested: Pose | None


class Closing(NamedTuple):
    """A span in which the hand was closed.

    Attributes:
        start: first sample of the command to close.
        stop: last sample before the command to open, or the last one.
        opens: whether the hand opens after it.
    """

    start: int
    stop: int
    opens: bool


def closings(gripper: np.ndarray) -> list[Closing]:
    """Return the spans in which a gripper command (n,) closes, in order."""
    closed = np.concatenate([[False], np.asarray(gripper) > 0.0, [False]])
    edges = np.flatnonzero(np.diff(closed.astype(int)))
    last = len(gripper) - 1
    return [Closing(int(a), int(b) - 1, int(b) <= last) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def grips(demonstration: Demonstration) -> tuple[list[Grip], list[Closing]]:
    """Return the grips of a demonstration in order, and the closings of the hand that took no object.

    Of several objects that move along, as when one stands on another, the one nearest to the hand is held.
    """
    assert demonstration.gripper is not None
    found: list[Grip] = []
    empty: list[Closing] = []
    for closing in closings(demonstration.gripper):
        options = [
            grip
            for name, path in demonstration.object_paths.items()
            if (grip := _grip(demonstration, name, path, closing)) is not None
        ]
        if options:
            found.append(min(options, key=lambda grip: float(np.linalg.norm(grip.object_from_tcp.position))))
        else:
            empty.append(closing)
    return found, empty


def _grip(demonstration: Demonstration, name: str, path: PosePath, closing: Closing) -> Grip | None:
    """Return how an object was held while the hand was closed; None if it was not carried."""
    time, hand = demonstration.time, demonstration.path
    window = _samples(time, WINDOW)
    relative = hand_from(hand, path)
    stop = min(len(time) - 1, closing.stop + (_samples(time, LAGS) if closing.opens else 0))
    held = _first_held(relative, path, closing.start, stop, window)
    if held is None:
        return None
    released = _last_held(relative, held, closing.stop, stop)
    here = Pose(relative[held])
    return Grip(
        name=name,
        closed=closing.start,
        held=held,
        released=released,
        open=closing.stop,
        opens=closing.opens,
        object_from_tcp=here.inverse(),
        undisturbed=_undisturbed(hand, path, closing.start, here),
        rested=_rested(time, path, released) if closing.opens else None,
    )


def hand_from(hand: PosePath, path: PosePath) -> np.ndarray:
    """Return the poses (n, 8) of an object in the hand, as dual quaternions.

    Args:
        hand: n poses of the tcp.
        path: n poses of the object.
    """
    return dq.mul(dq.conj(hand.dqs), path.dqs)


def _first_held(relative: np.ndarray, path: PosePath, start: int, stop: int, window: int) -> int | None:
    """Return the first sample in which an object moves along with the hand that carries it; None if there is none."""
    samples = np.arange(start, stop)
    gaps, angles = dq.pose_distance(relative[samples], relative[np.minimum(samples + window, stop)])
    for i in samples[(gaps <= RIGID) & (angles <= TURN)]:
        ways = np.linalg.norm(path.positions[i : _lost(relative, int(i), stop) + 1] - path.positions[i], axis=1)
        if ways.max() > CARRIED:
            return int(i) + int(np.argmax(ways > RIGID)) - 1
    return None


def _lost(relative: np.ndarray, held: int, stop: int) -> int:
    """Return the last sample in which an object is in the hand about as it was held; it may drift there."""
    return _near(relative, held, held, stop, SLIPPED, ROLLED)


def _last_held(relative: np.ndarray, held: int, opening: int, stop: int) -> int:
    """Return the last sample before an object left the hand: when the fingers opened, or earlier if it was lost."""
    last = _lost(relative, held, stop)
    parts = _near(relative, opening, opening, last, RIGID, TURN)
    return parts if parts < last else min(last, opening)


def _near(relative: np.ndarray, place: int, start: int, stop: int, gap: float, angle: float) -> int:
    """Return the last sample after a start up to which an object stays within a gap [m] and angle [rad] of a place."""
    if stop <= start:
        return stop
    gaps, angles = dq.pose_distance(relative[place], relative[start + 1 : stop + 1])
    away = np.flatnonzero((gaps > gap) | (angles > angle))
    return start + int(away[0]) if len(away) else stop


def _undisturbed(hand: PosePath, path: PosePath, start: int, held: Pose) -> Pose:
    """Return the object's pose when the hand was last well away from it before it closed."""
    gaps = np.linalg.norm(path.positions[: start + 1] - hand.positions[: start + 1], axis=1)
    away = np.flatnonzero(gaps > float(np.linalg.norm(held.position)) + BACK)
    return path[int(away[-1])] if len(away) else path[0]


def _rested(time: np.ndarray, path: PosePath, released: int) -> Pose | None:
    """Return the pose of an object when it came to rest after its release."""
    window = _samples(time, QUIET)
    positions = path.positions
    for i in range(released, len(path) - window):
        if np.linalg.norm(positions[i : i + window + 1] - positions[i], axis=1).max() < RESTS:
            return path[i]
    return None


def _samples(time: np.ndarray, seconds: float) -> int:
    return max(1, round(seconds / float(np.median(np.diff(time)))))
