"""A skill as data: phases, each a path of a moving body that ends somewhere relative to a thing.

It is inferred from a demonstration, or made of its named segments, whose meaning is data beside a task.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

from ..geometry.pose import Pose, PosePath
from ..imitation.constraint import Keeping

Kind = Literal["reach", "lift", "carry", "slide", "articulate", "leave", "withdraw"]
START = ""
"""Reference of an end that is relative to where the moving body was at the beginning."""
TASK_GOAL = "goal of the task"
"""Reference of an end that is relative to the goal that the task gives to the thing."""
SAME = (Pose.identity(),)
Pair = tuple[str, str]
Anchor = tuple[float, float, float]
THING, PREVIOUS, OTHERS = "the thing", "the one before", "the others"
"""Names in `SegmentMeaning.touch` of the thing itself, of the one that was moved before it, and of the others."""
DEMONSTRATED = "demonstrated"
"""Action of the gripper at the end of a segment: it opens as far as the recorded one."""


@dataclass(frozen=True, slots=True, eq=False)
class Phase:
    """One motion: the hand goes to a thing, lifts, carries or slides it, moves it on its hinge, leaves or withdraws.

    "lift" and "leave" follow their paths from where the hand is; "withdraw" is the last of all, and may end early.

    The moving body is the thing in the hand in "carry" and "slide", else the hand. It may end at `reference` @ left @
    goal @ right for every goal and every pair of turns: all of them look alike.

    Attributes:
        name: unique in the skill.
        kind: what is done.
        thing: the thing that is reached, carried, slid or moved on its hinge; "" for "withdraw".
        reference: the thing that the end is relative to; `START`: where the body was at the beginning; `TASK_GOAL`:
            the goal of the thing.
        path: n poses of the moving body in the world of the demonstration.
        goals: `reference_from_body` at the end, the likeliest first.
        left: turns of the reference after which it looks the same, in its frame; the first is none.
        right: turns of the moving body likewise, in the body's frame.
        object_from_tcp: how the hand holds the thing; None if it holds none.
        gripper: action at the end: "close", "open" or "none".
        touching: names of things that the moving body touches at the end.
        exact: whether the path is followed as it is, without detours: a motion in contact.
        by_hand: whether the path of a carry is the hand's, because that of the thing was not recorded.
        as_shown: whether nothing else is tried than what was shown: no higher grasp, no lean, no shorter carry.
        touch: contacts that are wanted, of parts of the hand or "held" with a thing; None: of the hand with the thing,
            and of both with `touching` and, while something is carried, with all that is fixed.
        speed: share of the joints' speed limits that is used.
        before: path of the hand to where `path` begins, a free motion of its own; None: there is none.
        touch_within: distance [m] of the hand, and of what it holds, from the reference, from which on contacts are
            wanted; infinite: on the whole path.
        straight: distance [m] of the hand from where a motion begins up to which there are no detours.
        clearance: margin [m] of objects in the motion `before`, if there is room; 0: that of all motions.
        must_keep: whether something of the path must be kept on any way: a full glass is not tilted otherwise.
        keeping: how the constraint of the path is kept, see `PlanRequest.keeping`; None: as the settings say.
        round: whether thing and reference are round and stand: their yaws mean nothing.
        anchor: point of the thing whose pose `goals` are, in shares of its half size; its middle by default.
        reference_anchor: point of the reference that they are relative to, likewise.
        opening: action that opens the hand.
        rise: height [m] of a lift straight up, if none was shown; 0: `path` is followed.
        pause: setting with the time to stand still at the end.
        tries: number of ways that are tried where one proves blocked.
        awaited_on: the thing on which the object must lie before it is reached; "": it is there.
        evidence: sentences on why this was inferred.
    """

    name: str
    kind: Kind
    thing: str
    reference: str
    path: PosePath
    goals: tuple[Pose, ...]
    left: tuple[Pose, ...] = SAME
    right: tuple[Pose, ...] = SAME
    object_from_tcp: Pose | None = None
    gripper: str = "none"
    touching: tuple[str, ...] = ()
    exact: bool = False
    by_hand: bool = False
    as_shown: bool = False
    touch: tuple[Pair, ...] | None = None
    speed: float = 1.0
    before: PosePath | None = None
    touch_within: float = math.inf
    straight: float = 0.0
    clearance: float = 0.0
    must_keep: bool = False
    keeping: Keeping | None = None
    round: bool = False
    anchor: Anchor = (0.0, 0.0, 0.0)
    reference_anchor: Anchor = (0.0, 0.0, 0.0)
    opening: float = -1.0
    rise: float = 0.0
    pause: Literal["settle", "drain"] = "settle"
    tries: int = 1
    awaited_on: str = ""
    evidence: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Choice:
    """A choice that a demonstration leaves open, and what was taken.

    Attributes:
        phase: name of the phase.
        what: what is chosen, like "reference".
        chosen: the likeliest.
        others: what it might be as well.
        why: the evidence.
    """

    phase: str
    what: str
    chosen: str
    others: tuple[str, ...]
    why: str


@dataclass(frozen=True, slots=True, eq=False)
class Skill:
    """All that a demonstration shows, as data.

    Attributes:
        name: of the demonstration.
        robot: that was recorded.
        phases: in order.
        choices: what the demonstration leaves open.
        notes: what was left out, and why.
        in_hand: whether the first thing is in the hand from the start.
    """

    name: str
    robot: str
    phases: tuple[Phase, ...]
    choices: tuple[Choice, ...] = field(default=())
    notes: tuple[str, ...] = field(default=())
    in_hand: bool = False

    @property
    def things(self) -> tuple[str, ...]:
        """Names of all things that the phases need, each once, in order."""
        names = [name for phase in self.phases for name in (phase.thing, phase.reference) if name and name != TASK_GOAL]
        return tuple(dict.fromkeys(names))


class SegmentMeaning(NamedTuple):
    """Meaning of a segment, for any of the things that the skill is done with.

    Attributes:
        segment: its name.
        kind: what is done.
        reference: what its end is relative to: `THING`, `TASK_GOAL`, or the name of an object.
        touch: contacts that are wanted, see `Phase`.
        gripper: action at its end, see `Phase`, or `DEMONSTRATED`.
        turns: what looks the same after a turn: the "thing", by its symmetry, the "hand", or a thing and a reference
            that are "round".
        trimmed: whether its end is cut, where people fumble.
        before: segment of the free motion to where this one begins; "": there is none.
        optional: whether a demonstration may lack the segment.
        rise: height [m] of a lift straight up in place of a segment that is lacking.
        sized: the thing and the reference, whose sizes the demonstration must give, if the end is that of the thing's
            lip relative to the reference's rim; (): of their origins.
        how: further attributes of the phase.
    """

    segment: str
    kind: Kind
    reference: str = ""
    touch: tuple[Pair, ...] = ()
    gripper: str = "none"
    turns: Literal["", "thing", "hand", "round"] = ""
    trimmed: bool = False
    before: str = ""
    optional: bool = False
    rise: float = 0.0
    sized: tuple[str, ...] = ()
    how: dict[str, Any] | None = None


class SegmentedSkill(NamedTuple):
    """A skill as its author has written it down.

    Attributes:
        parts: the meaning of each segment, in order.
        each: whether the demonstration of ONE thing is done with each object that has a goal, in order.
    """

    parts: tuple[SegmentMeaning, ...]
    each: bool = False

    @property
    def required(self) -> tuple[str, ...]:
        """Segments that a demonstration must have."""
        parts = [part for part in self.parts if not part.optional]
        return tuple(name for part in parts for name in (part.before, part.segment) if name)

    @property
    def sized(self) -> tuple[str, ...]:
        """Objects whose sizes a demonstration must give."""
        return tuple(dict.fromkeys(name for part in self.parts for name in part.sized))

    @property
    def releases(self) -> tuple[str, ...]:
        """Segments after which the recorded gripper decides how far this one opens."""
        return tuple(part.segment for part in self.parts if part.gripper == DEMONSTRATED)
