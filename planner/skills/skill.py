"""A skill as data: phases, each a path of a moving body that ends somewhere relative to a thing."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from ..geometry.pose import Pose, PosePath

Kind = Literal["reach", "carry", "slide", "articulate", "withdraw"]
START = ""
"""Reference of an end that is relative to where the moving body was at the beginning."""
SAME = (Pose.identity(),)


@dataclass(frozen=True, slots=True, eq=False)
class Phase:
    """One motion: the hand goes to a thing, carries it, slides it along another, moves it on its hinge, or withdraws.

    The moving body is the thing in the hand in "carry" and "slide", else the hand. It may end at `reference` @ left @
    goal @ right for every goal and every pair of turns: all of them look alike.

    Attributes:
        name: unique in the skill.
        kind: what is done.
        thing: the thing that is reached, carried, slid or moved on its hinge; "" for "withdraw".
        reference: the thing that the end is relative to; `START`: where the body was at the beginning.
        path: n poses of the moving body in the world of the demonstration.
        goals: `reference_from_body` at the end, the likeliest first.
        left: turns of the reference after which it looks the same, in its frame; the first is none.
        right: turns of the moving body likewise, in the body's frame.
        object_from_tcp: how the hand holds the thing; None if it holds none.
        gripper: action at the end: "close", "open" or "none".
        touching: names of things that the moving body touches at the end.
        exact: whether the path is followed as it is, without detours: a motion in contact.
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
    """

    name: str
    robot: str
    phases: tuple[Phase, ...]
    choices: tuple[Choice, ...] = field(default=())
    notes: tuple[str, ...] = field(default=())

    @property
    def things(self) -> tuple[str, ...]:
        """Names of all things that the phases need, each once, in order."""
        names = [name for phase in self.phases for name in (phase.thing, phase.reference) if name]
        return tuple(dict.fromkeys(names))
