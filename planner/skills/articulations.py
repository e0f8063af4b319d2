"""Articulations: spans in which the hand moved hinges and slides of the scene, and no free object, and their phases."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..geometry.pose import Pose, PosePath
from ..imitation.demonstration import Demonstration
from .corrected import said_path
from .grips import Grip, closings
from .names import plain
from .skill import Phase

FINGERS = re.compile(r"finger|gripper|knuckle|thumb|jaw", re.IGNORECASE)
"""Names of joints that are the hand's own."""
BEFORE = 0.03
"""Path length [m] of the hand before a joint moves that belongs to the push."""
HOLDS = 0.10
"""Path length [m] before a push from which a hand that closes takes hold of what it moves; farther off it makes a fist.
"""
STIRS = 0.02
"""Fraction of a joint's whole motion that it moves by itself, or as fingers close about what it carries."""
TOGETHER = 1.0
"""Time [s] between the motions of two joints, as of a handle and its door, that are one push."""


class Articulation(NamedTuple):
    """A span in which the hand moved joints of the scene.

    Attributes:
        joints: their names.
        held: first sample of the push.
        released: last sample.
        grips: (sample, "close" or "open") of the hand's actions from before the push to its end, in order.
        opens: whether the hand opens after the push, so that it lets go.
        reference: the fixture that the push is relative to; "" for the world.
        place: its pose.
    """

    joints: tuple[str, ...]
    held: int
    released: int
    grips: tuple[tuple[int, str], ...]
    opens: bool
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


def joint_events(joints: Mapping[str, np.ndarray], still: float = 0.02) -> dict[str, tuple[int, int]]:
    """Return the first and the last sample of the motion of each joint that moved.

    Args:
        joints: (n,) positions [rad or m] by name.
        still: change below which a joint has not moved.
    """
    moved = {}
    for name, values in joints.items():
        whole = float(np.ptp(values))
        if whole > still:
            away = np.flatnonzero(np.abs(values - values[0]) > max(0.1 * still, STIRS * whole))
            back = np.flatnonzero(np.abs(values - values[-1]) > 0.1 * still)
            last = int(back[-1]) + 1 if len(back) else len(values) - 1
            moved[name] = (max(0, int(away[0]) - 1), min(len(values) - 1, last))
    return moved


def _articulation(demonstration: Demonstration, start: int, stop: int, names: tuple[str, ...]) -> Articulation:
    lengths = demonstration.path.lengths()
    held = max(1, int(np.searchsorted(lengths, lengths[start] - BEFORE)))
    assert demonstration.gripper is not None
    shut = [each for each in closings(demonstration.gripper) if each.start <= stop and held <= each.stop]
    actions = [(each.start, "close") for each in shut]
    actions += [(each.stop + 1, "open") for each in shut if each.opens and each.stop < stop]
    taken = [sample for sample, action in actions if action == "close" and sample <= start]
    if taken and taken[-1] > 0 and lengths[start] - lengths[taken[-1]] < HOLDS:
        held = taken[-1]
    reference = _reference(names, demonstration.path[start].position, demonstration.fixtures)
    place = demonstration.fixtures.get(reference, Pose.identity())
    opens = bool(shut) and shut[-1].opens and shut[-1].stop >= stop
    return Articulation(names, held, stop, tuple(sorted(actions)), opens, reference, place)


def _reference(joints: tuple[str, ...], here: np.ndarray, fixtures: Mapping[str, Pose]) -> str:
    """Return the fixture that joints belong to: of those whose names begin with the same word, or of all, the nearest.

    Args:
        joints: names of the joints.
        here: (3,) position of the hand [m].
        fixtures: poses of the fixtures.
    """
    words = {plain(joint.split("_")[0]) for joint in joints}
    alike = [name for name in fixtures if plain(name.split("_")[0]) in words]
    gaps = {name: float(np.linalg.norm(fixtures[name].position - here)) for name in alike or fixtures}
    return min(gaps, key=lambda name: gaps[name]) if gaps else ""


def phases_of_push(demonstration: Demonstration, event: Articulation, begin: int, number: int) -> list[Phase]:
    """Return the phases of reaching what moves on its joints, and of moving it.

    Each ends where the hand closes or opens; where it pushes, what was commanded is followed.

    Args:
        demonstration: the demonstration.
        event: the push.
        begin: sample from which the hand reaches for it.
        number: of this thing among all that are reached, from 1.
    """
    name, suffix = event.reference or "the world", "" if number == 1 else f" ({number})"
    move = f"move {name}{suffix}"
    commanded, why = said_path(demonstration, move)
    measured, since = demonstration.path, at_time(demonstration, event.held)
    reach = Phase(
        name=f"reach {name}{suffix}",
        kind="reach",
        thing=event.reference,
        reference=event.reference,
        path=measured,
        goals=(),
        touching=(event.reference,) if event.reference else (),
        evidence=(f"{', '.join(event.joints)} moves from {since} on",),
    )
    push = replace(reach, name=move, kind="articulate", exact=True, evidence=(why,))
    phases: list[Phase] = []
    for start, stop, action in _parts(event, begin):
        kind, path = (push, commanded) if stop > event.held else (reach, measured)
        path = path[start : stop + 1]
        path = PosePath(np.concatenate([same_sign(path.dqs[0], measured[start])[None], path.dqs[1:]]))
        before = sum(each.kind == kind.kind for each in phases)
        name = f"{kind.name} part {before + 1}" if before else kind.name
        goals = (event.place.inverse() @ path[-1],)
        phases.append(replace(kind, name=name, path=path, goals=goals, gripper=action))
    return phases


def _parts(event: Articulation, begin: int) -> Iterator[tuple[int, int, str]]:
    """Yield the first and the last sample of each part, and what the hand does at its end."""
    actions = {sample: action for sample, action in event.grips if begin < sample < event.released}
    start = min(begin, event.held - 1)
    for stop in sorted({event.held, *actions}):
        if stop > start:
            yield start, stop, actions.get(stop, "none")
            start = stop
    yield start, event.released, "open" if event.opens else "none"


def same_sign(dq: np.ndarray, pose: Pose) -> np.ndarray:
    """Return the dual quaternion (8,) of a pose with the sign that is nearer to another one.

    Args:
        dq: (8,) the other one.
        pose: the pose.
    """
    return pose.dq if dq[:4] @ pose.dq[:4] >= 0.0 else -pose.dq


def at_time(demonstration: Demonstration, sample: int) -> str:
    """Return the time of a sample since the beginning, for messages.

    Args:
        demonstration: the demonstration.
        sample: its index.
    """
    return f"{demonstration.time[sample] - demonstration.time[0]:.1f} s"
