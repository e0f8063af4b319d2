"""Skills whose demonstrations name their segments: what each segment means is written down, not inferred."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..geometry.pose import Pose, PosePath
from ..imitation.demonstration import Demonstration
from ..imitation.segmentation import trimmed
from .alike import hand_turns, standing
from .skill import DEMONSTRATED, OTHERS, PREVIOUS, SAME, THING, Anchor, Pair, Phase, SegmentedSkill, SegmentMeaning

ROUND = tuple(np.deg2rad([0.0, *(sign * turn for turn in range(15, 91, 15) for sign in (1, -1))]))
"""Turns [rad] of what is round about its axis that are tried, the demonstrated direction first."""
RIM = (0.0, 0.0, 1.0)
"""Middle of the rim of a thing, in shares of its half size."""


class Moved(NamedTuple):
    """The thing that is moved.

    Attributes:
        name: of the object.
        size: (3,) its full extents [m].
        yaws: turns [rad] about its upright axis after which it looks the same.
        previous: name of the object that was moved before; "" for none.
        others: names of all other objects.
        held: `tcp_from_object` of one that is in the hand from the start; None: it is not.
    """

    name: str
    size: np.ndarray
    yaws: tuple[float, ...]
    previous: str
    others: tuple[str, ...]
    held: Pose | None = None


def phases_of(skill: SegmentedSkill, demonstration: Demonstration, moved: Moved, trim: float) -> list[Phase]:
    """Return the phases that a demonstration shows, for one of the things.

    Args:
        skill: the meaning of its segments.
        demonstration: with the segments, apart from those that it may lack.
        moved: the thing.
        trim: radius [m] about the end of a motion within which what people do is left out.
    """
    shown = {segment.name for segment in demonstration.segments}
    phases: list[Phase] = []
    held = moved.held
    for part in skill.parts:
        if part.segment in shown:
            phase = _shown(part, demonstration, moved, held, trim)
            held = held if phase.object_from_tcp is None else phase.object_from_tcp.inverse()
            phases.append(phase)
        elif part.rise:
            up = Pose.from_position_quaternion([0.0, 0.0, part.rise])
            path = PosePath(np.array([Pose.identity().dq, up.dq]))
            phases.append(replace(_phase(part, moved, path), rise=part.rise))
    return phases


def _shown(part: SegmentMeaning, demonstration: Demonstration, moved: Moved, held: Pose | None, trim: float) -> Phase:
    """Return the phase that a segment shows; `held` is `tcp_from_object`, as far as it is known."""
    segment, path = demonstration.segment(part.segment), demonstration.segment_path(part.segment)
    place = standing(segment.reference_pose) if part.turns == "round" else segment.reference_pose
    phase = _phase(part, moved, trimmed(path, trim) if part.trimmed else path)
    if part.before:
        phase = replace(phase, before=demonstration.segment_path(part.before))
    if part.reference == THING:
        grasp = _across_the_narrow_side(place.inverse() @ path[-1], moved.size)
        return replace(phase, goals=(grasp,), object_from_tcp=grasp)
    if part.gripper == DEMONSTRATED and demonstration.gripper is not None:
        phase = replace(phase, gripper="open", opening=float(demonstration.gripper[segment.stop + 1]))
    if part.sized and held is not None:
        end, sizes = path[-1] @ held, [demonstration.object_sizes[name] for name in part.sized]
        lip = lip_of(end)
        goal = (place @ anchored(RIM, sizes[1])).inverse() @ end @ anchored(lip, sizes[0])
        phase = replace(phase, goals=(goal,), anchor=lip, reference_anchor=RIM, object_from_tcp=held.inverse())
    return phase


def _phase(part: SegmentMeaning, moved: Moved, path: PosePath) -> Phase:
    """Return a phase, as far as the meaning of its segment determines it."""
    yaws = {"thing": moved.yaws, "round": ROUND}.get(part.turns, (0.0,))
    turns = hand_turns() if part.turns == "hand" else tuple(Pose.from_yaw([0.0, 0.0, 0.0], yaw) for yaw in yaws)
    of_reference = part.reference == THING or part.turns == "round"
    return Phase(
        name=f"{part.segment} {moved.name}",
        kind=part.kind,
        thing=moved.name,
        reference=moved.name if part.reference == THING else part.reference,
        path=path,
        goals=SAME,
        left=turns if of_reference else SAME,
        right=SAME if of_reference else turns,
        gripper=part.gripper,
        round=part.turns == "round",
        by_hand=True,
        as_shown=True,
        touch=tuple(pair for each in part.touch for pair in _named(each, moved)),
        **(part.how or {}),
    )


def _named(pair: Pair, moved: Moved) -> list[Pair]:
    """Return a wanted contact with the names of the objects that it stands for."""
    part, name = pair
    meant = {THING: (moved.name,), PREVIOUS: (moved.previous,), OTHERS: moved.others}.get(name, (name,))
    return [(part, each) for each in meant if each]


def _across_the_narrow_side(object_from_tcp: Pose, size: np.ndarray) -> Pose:
    """Return a grasp turned so that the fingers, which close along x of the tcp, close across the narrower side."""
    narrow = int(np.argmin(size[:2]))
    along = int(np.argmax(np.abs(object_from_tcp.rotation[:2, 0])))
    if along == narrow or np.isclose(size[0], size[1]):
        return object_from_tcp
    return Pose.from_yaw([0.0, 0.0, 0.0], 0.5 * np.pi) @ object_from_tcp


def lip_of(thing: Pose) -> Anchor:
    """Return where the lip of a tilted round thing is: the lowest point of its rim, in shares of its half size."""
    down = -thing.rotation[2, :2]
    x, y = down / np.linalg.norm(down)
    return float(x), float(y), 1.0


def anchored(anchor: Anchor, size: np.ndarray) -> Pose:
    """Return a point of a thing in the thing's frame.

    Args:
        anchor: the point, in shares of half the thing's size.
        size: (3,) full extents [m].
    """
    return Pose.from_position_quaternion(0.5 * np.array(anchor) * size)
