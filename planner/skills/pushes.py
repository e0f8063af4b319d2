"""Pushes: the phases in which the hand reaches what turns on a hinge, or slides, and moves it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..geometry.pose import Pose, PosePath
from ..imitation.demonstration import Demonstration
from .articulations import Articulation
from .corrected import said_path
from .skill import Phase


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
