"""A skill corrected by what a person says: grasps, references, ends, and phases that are left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from ..errors import BadDemonstration, UnknownName
from ..geometry.pose import Pose, PosePath
from ..imitation.corrections import FROM_START, PhaseCorrection
from ..imitation.demonstration import Demonstration
from .grips import Grip
from .skill import SAME, START, Kind, Phase

APPLIES: dict[str, tuple[Kind, ...]] = {
    "reference": ("carry",),
    "goal": ("carry",),
    "turns": ("reach", "carry"),
    "grasp": ("reach",),
    "path": ("articulate", "slide"),
    "gripper": ("reach", "carry", "slide", "articulate"),
    "skip": ("reach", "carry", "slide", "articulate", "withdraw"),
}
"""Kinds of phases of which each correction can be said."""


def regrasped(demonstration: Demonstration, grip: Grip, phase: str) -> Grip:
    """Return a grip with the hand where it is at the sample that is said.

    Args:
        demonstration: the demonstration.
        grip: as it was found.
        phase: name of the phase that reaches the thing.

    Raises:
        BadDemonstration: the demonstration has no such sample.
    """
    sample = demonstration.corrections.of(phase).grasp
    if sample is None:
        return grip
    last = len(demonstration.path) - 1
    if not 0 <= sample <= last:
        raise _wrong(demonstration, phase, "grasp", f"{sample} is no sample: there are 0 to {last}")
    held = demonstration.object_paths[grip.name][sample].inverse() @ demonstration.path[sample]
    return grip._replace(object_from_tcp=held)


def said_reference(demonstration: Demonstration, phase: str, places: Mapping[str, Pose]) -> str | None:
    """Return the thing that a carry is said to end at, "" for where it began; None if nothing is said.

    Args:
        demonstration: the demonstration.
        phase: name of the phase.
        places: poses of what the demonstration has besides the carried object.

    Raises:
        BadDemonstration: the demonstration has no such thing.
    """
    name = demonstration.corrections.of(phase).reference
    if name is None or name in places:
        return name
    if name == FROM_START:
        return START
    known = ", ".join([*places, FROM_START])
    raise _wrong(demonstration, phase, "reference", f"{name!r} is not recorded; there are: {known}")


def said_path(demonstration: Demonstration, phase: str) -> tuple[PosePath, str]:
    """Return the path of the hand that a push follows, and a sentence on why that one.

    Args:
        demonstration: the demonstration.
        phase: name of the phase.

    Raises:
        BadDemonstration: the commanded path is asked for, and was not recorded.
    """
    said = demonstration.corrections.of(phase).path
    if demonstration.commanded is None:
        if said == "commanded":
            raise _wrong(demonstration, phase, "path", "what was commanded is not recorded")
        return demonstration.path, "the measured path is followed: what was commanded is not recorded"
    if said == "measured":
        return demonstration.path, "the measured path is followed"
    return demonstration.commanded, "where it pushes, the commanded path is followed"


def corrected(phases: list[Phase], demonstration: Demonstration) -> list[Phase]:
    """Return phases with what can be said of them once they are found.

    Args:
        phases: as they were found, with grasps and references as they are said.
        demonstration: the demonstration.

    Raises:
        UnknownName, BadDemonstration: a correction is of no phase, or of one of another kind.
    """
    said = demonstration.corrections
    _check(demonstration, {phase.name: phase for phase in phases})
    skipped: set[str] = set()
    for together in _together(phases):
        if any(said.of(each.name).skip for each in together):
            skipped |= {each.name for each in together}
    return [_changed(phase, said.of(phase.name)) for phase in phases if phase.name not in skipped]


def _together(phases: Sequence[Phase]) -> list[list[Phase]]:
    """Return what is done with one thing: reaching it, and all that follows until another one is reached."""
    found: list[list[Phase]] = []
    for phase in phases:
        if phase.kind in ("reach", "withdraw") or not found:
            found.append([])
        found[-1].append(phase)
    return found


def _changed(phase: Phase, said: PhaseCorrection) -> Phase:
    words = tuple(f"{key} as said" for key in said.said())
    if words:
        phase = replace(phase, evidence=(*phase.evidence, *words))
    if said.turns is False:
        phase = replace(phase, left=SAME, right=SAME)
    return phase if said.gripper is None else replace(phase, gripper=said.gripper)


def _check(demonstration: Demonstration, phases: Mapping[str, Phase]) -> None:
    """Refuse what is said of no phase, or of one of which it cannot be said."""
    for name, said in demonstration.corrections.phases.items():
        if name not in phases:
            raise UnknownName("phase", name, phases)
        for key in said.said():
            if phases[name].kind not in APPLIES[key]:
                able = ", ".join(each for each, phase in phases.items() if phase.kind in APPLIES[key])
                reason = f"cannot be said of it, but of {able}" if able else "cannot be said of any phase here"
                raise _wrong(demonstration, name, key, reason)
        if said.goal is not None and phases[name].gripper != "open":
            raise _wrong(demonstration, name, "goal", f"{phases[name].thing} stays in the hand: it has one end")


def _wrong(demonstration: Demonstration, phase: str, key: str, reason: str) -> BadDemonstration:
    return BadDemonstration(demonstration.corrections.source or demonstration.name, f"phases.{phase}.{key}", reason)
