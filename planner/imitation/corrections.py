"""Corrections of a skill: what a person says where the demonstration leaves a choice, or shows it wrongly.

Not in the paper, where a person says everything.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Literal


@dataclass(frozen=True, slots=True)
class PhaseCorrection:
    """Corrections of one phase; what is None stays as it is found.

    Attributes:
        reference: the thing that the end of a carry is relative to; "start": where the object was at the beginning.
        goal: whether a carry ends where the object was let go, "release", or where it came to rest, "rest".
        turns: False: it ends as shown, and nothing that looks alike will do.
        grasp: sample of the demonstration at which the hand holds the thing as it should.
        path: whether a push follows the "measured" or the "commanded" path.
        gripper: action at the end.
        skip: True: it is left out, with all that is done with the thing, from reaching it on.
    """

    reference: str | None = None
    goal: Literal["release", "rest"] | None = None
    turns: bool | None = None
    grasp: int | None = None
    path: Literal["measured", "commanded"] | None = None
    gripper: Literal["open", "close", "none"] | None = None
    skip: bool | None = None

    def said(self) -> tuple[str, ...]:
        """Return the names of what is said."""
        return tuple(each.name for each in fields(self) if getattr(self, each.name) is not None)


NOTHING = PhaseCorrection()
FROM_START = "start"
"""Reference of an end that is relative to where the object was at the beginning."""


@dataclass(frozen=True, slots=True)
class Corrections:
    """Corrections of a skill.

    Attributes:
        names: a task's names of things that have others in the demonstration.
        phases: what is said of phases, by their names, as `onedemo demo check` prints them.
        source: file in which it is said, for messages.
    """

    names: Mapping[str, str] = field(default_factory=dict)
    phases: Mapping[str, PhaseCorrection] = field(default_factory=dict)
    source: str = ""

    def of(self, phase: str) -> PhaseCorrection:
        """Return what is said of a phase."""
        return self.phases.get(phase, NOTHING)
