"""Articulations: spans in which the hand moved hinges and slides of the scene, and no free object."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..geometry.pose import Pose
from ..imitation.demonstration import Demonstration
from .grips import Grip, closings, joint_events

FINGERS = re.compile(r"finger|gripper|knuckle|thumb|jaw", re.IGNORECASE)
"""Names of joints that are the hand's own."""
BEFORE = 0.03
"""Path length [m] of the hand before a joint moves that belongs to the push."""
TOGETHER = 1.0
"""Time [s] between the motions of two joints, as of a handle and its door, that are one push."""


class Articulation(NamedTuple):
    """A span in which the hand moved joints of the scene.

    Attributes:
        joints: their names.
        held: first sample of the push.
        released: last sample.
        closed: whether the hand was closed.
        reference: the fixture that the push is relative to; "" for the world.
        place: its pose.
    """

    joints: tuple[str, ...]
    held: int
    released: int
    closed: bool
    reference: str
    place: Pose


def articulations(demonstration: Demonstration, held: Sequence[Grip]) -> list[Articulation]:
    """Return the pushes of a demonstration in order; what joints do while an object is carried is none of them.

    Args:
        demonstration: the demonstration.
        held: the spans in which objects were carried.
    """
    scene = {name: values for name, values in demonstration.other_joints.items() if not FINGERS.search(name)}
    spans = sorted((start, stop, name) for name, (start, stop) in joint_events(scene).items())
    spans = [span for span in spans if not any(grip.held <= span[1] and span[0] <= grip.released for grip in held)]
    merged: list[tuple[int, int, tuple[str, ...]]] = []
    for start, stop, name in spans:
        if merged and demonstration.time[start] - demonstration.time[merged[-1][1]] < TOGETHER:
            first, last, names = merged[-1]
            merged[-1] = first, max(last, stop), (*names, name)
        else:
            merged.append((start, stop, (name,)))
    return [_articulation(demonstration, *span) for span in merged]


def _articulation(demonstration: Demonstration, start: int, stop: int, names: tuple[str, ...]) -> Articulation:
    lengths = demonstration.path.lengths()
    first = max(1, int(np.searchsorted(lengths, lengths[start] - BEFORE)))
    assert demonstration.gripper is not None
    shut = [each for each in closings(demonstration.gripper) if each.start <= stop and start <= each.stop]
    if shut:
        first = max(1, min(shut[0].start - 1, start) if shut[0].start > first else first)
    here = demonstration.path[start].position
    gaps = {name: float(np.linalg.norm(pose.position - here)) for name, pose in demonstration.fixtures.items()}
    reference = min(gaps, key=lambda name: gaps[name]) if gaps else ""
    place = demonstration.fixtures.get(reference, Pose.identity())
    return Articulation(names, first, stop, bool(shut), reference, place)
