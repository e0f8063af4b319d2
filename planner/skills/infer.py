"""A skill from ONE demonstration, by rules that name no task.

Not in the paper, where a person cuts the demonstration and says what each motion refers to.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..errors import BadDemonstration
from ..geometry.pose import Pose, PosePath
from ..imitation.demonstration import Demonstration
from ..imitation.segmentation import trimmed
from .alike import hand_turns, own_turns, reference_turns
from .articulations import Articulation, articulations, at_time, phases_of_push, same_sign
from .corrected import corrected, regrasped, said_reference
from .grips import BRIEF, Closing, Grip, grips
from .references import Reference, reference_of
from .skill import START, Choice, Phase, Skill
from .slides import slide_of, slides_from
from .thing import Thing

TRIM = 0.02
"""Radius [m] about the end of a motion within which what people do before they let go or grasp is left out."""
RISE = 0.005
"""Height [m] above its rest at which an object is let go: pressed on its support, a tilted one is thrown aside."""
DROP = 0.02
"""Height [m] of a fall from which the released pose is the goal, not the rest."""
WITHDRAWAL = 0.03
"""Path length [m] after the last release from which the hand's motion is a withdrawal of its own."""


class Scene(NamedTuple):
    """Knowledge besides the demonstration.

    Attributes:
        things: shapes by name, as the demonstration names them; may be empty.
    """

    things: Mapping[str, Thing]

    def thing(self, name: str) -> Thing | None:
        """Return the shape of a thing; None if it is unknown."""
        return self.things.get(name)


def infer_skill(demonstration: Demonstration, things: Mapping[str, Thing] | None = None) -> Skill:
    """Infer what a demonstration shows, with its corrections.

    Args:
        demonstration: with a gripper command and the paths of objects.
        things: shapes of objects and fixtures by the names of the demonstration; they make references and symmetries
            sharper.

    Raises:
        BadDemonstration: no skill is found in it, or a correction does not fit; the error says what is missing.
        UnknownName: a correction is said of no phase.
    """
    scene = Scene(things or {})
    _check(demonstration)
    held, empty = grips(demonstration)
    hinged = articulations(demonstration, held)
    if not held and not hinged:
        raise BadDemonstration(demonstration.name, "object_paths", _nothing_moves(demonstration, empty))
    phases: list[Phase] = []
    choices: list[Choice] = []
    notes: list[str] = []
    begin, last = 0, None
    done: list[str] = []
    for event in sorted([*held, *hinged], key=lambda event: event.held):
        done.append(event.name if isinstance(event, Grip) else event.reference)
        number = done.count(done[-1])
        if isinstance(event, Grip):
            new, open_choices = _fetch_and_carry(demonstration, scene, event, begin, number)
            choices += open_choices
        else:
            new = phases_of_push(demonstration, event, begin, number)
        phases += new
        begin, last = event.released, event
    notes += [_left_out(demonstration, closing) for closing in empty if not _belongs(closing, hinged)]
    phases = corrected([*phases, *_withdrawal(demonstration, begin, last)], demonstration)
    still_open = tuple(each for each in choices if each.phase in {phase.name for phase in phases})
    return Skill(demonstration.name, demonstration.robot, tuple(phases), still_open, tuple(notes))


def _check(demonstration: Demonstration) -> None:
    if not demonstration.object_paths and not demonstration.other_joints:
        reason = "none is recorded: a skill is found from what moves; record the poses of the objects, or name segments"
        raise BadDemonstration(demonstration.name, "object_paths", reason)
    if demonstration.gripper is None:
        reason = "is not recorded: without it nobody knows when the hand held something"
        raise BadDemonstration(demonstration.name, "gripper", reason)


def _nothing_moves(demonstration: Demonstration, empty: Sequence[Closing]) -> str:
    moved = {
        name: float(np.linalg.norm(path.positions - path.positions[0], axis=1).max())
        for name, path in demonstration.object_paths.items()
    }
    most = max(moved, key=lambda name: moved[name]) if moved else ""
    closed = f"the hand closes {len(empty)} times" if empty else "the hand never closes"
    return f"none was carried: {closed}" + (f", {most} moves {1e3 * moved[most]:.0f} mm at most" if most else "")


def _left_out(demonstration: Demonstration, closing: Closing) -> str:
    since = demonstration.time[closing.start] - demonstration.time[0]
    seconds = demonstration.time[closing.stop] - demonstration.time[closing.start]
    brief = ", opened again at once" if seconds < BRIEF and closing.opens else ""
    return f"the hand closes on nothing at {since:.1f} s{brief}: left out"


def _belongs(closing: Closing, hinged: Sequence[Articulation]) -> bool:
    return any(closing.start <= each.released and each.held <= closing.stop for each in hinged)


def _fetch_and_carry(
    demonstration: Demonstration, scene: Scene, grip: Grip, begin: int, number: int
) -> tuple[list[Phase], list[Choice]]:
    """Return the phases of reaching an object and carrying it away."""
    thing = scene.thing(grip.name)
    name = f"reach {grip.name}" if number == 1 else f"reach {grip.name} ({number})"
    grip = regrasped(demonstration, grip, name)
    shown = trimmed(demonstration.path[begin : max(grip.closed, begin + 1) + 1], TRIM)
    ends = grip.undisturbed @ grip.object_from_tcp
    reach = Phase(
        name=name,
        kind="reach",
        thing=grip.name,
        reference=grip.name,
        path=PosePath(np.concatenate([shown.dqs[:-1], same_sign(shown.dqs[-1], ends)[None]])),
        goals=(grip.object_from_tcp,),
        left=own_turns(thing, grip.undisturbed),
        right=hand_turns(),
        object_from_tcp=grip.object_from_tcp,
        gripper="close",
        touching=(grip.name,),
        evidence=(f"{grip.name} moves with the hand from {at_time(demonstration, grip.held)} on",),
    )
    carry, choices = _carry(demonstration, scene, grip, number)
    begins = slides_from(demonstration, grip, carry)
    if begins is None:
        return [reach, carry], choices
    return [reach, *slide_of(demonstration, grip, carry, begins, TRIM)], choices


def _carry(demonstration: Demonstration, scene: Scene, grip: Grip, number: int) -> tuple[Phase, list[Choice]]:
    path = demonstration.object_paths[grip.name][grip.held : grip.released + 1]
    released = path[-1]
    rest = grip.rested or released
    places = {
        **{name: other[grip.released] for name, other in demonstration.object_paths.items() if name != grip.name},
        **demonstration.fixtures,
    }
    name = f"carry {grip.name}" if number == 1 else f"carry {grip.name} ({number})"
    said = said_reference(demonstration, name, places)
    reference = reference_of(grip.name, rest, places, scene.things)
    if said is not None:
        touched = tuple(dict.fromkeys([said, *reference.touched])) if said else ()
        reference = Reference(said, touched, (), "ends where it is said")
    if not reference.name or (not grip.opens and said is None):
        why = "is in the hand to the end" if not grip.opens else reference.why
        ends = (grip.undisturbed.inverse() @ released,)
        return _carried(name, grip, START, path, ends, (f"{grip.name} {why}",)), []
    at = places[reference.name]
    ends = _ends(released, rest, demonstration.corrections.of(name).goal, lets_go=grip.opens)
    goals = tuple(at.inverse() @ pose for pose in ends)
    phase = _carried(name, grip, reference.name, trimmed(path, TRIM), goals, (reference.why,))
    left = reference_turns(scene.thing(reference.name), at, goals[0], scene.thing(grip.name))
    phase = _with(phase, left, own_turns(scene.thing(grip.name), rest), reference)
    return phase, _open_choice(phase, reference)


def _ends(released: Pose, rest: Pose, goal: str | None, *, lets_go: bool) -> tuple[Pose, ...]:
    """Return where a carried object may end, the likeliest first."""
    if not lets_go:
        return (released,)
    fall = float(released.position[2] - rest.position[2])
    lifted = Pose.from_position_quaternion([0.0, 0.0, RISE]) @ rest
    shown = released if fall > RISE else Pose.from_position_quaternion([0.0, 0.0, RISE - fall]) @ released
    if goal is not None:
        return (shown,) if goal == "release" else (lifted,)
    return (shown, lifted) if fall > DROP else (lifted, shown)


def _carried(
    name: str, grip: Grip, reference: str, path: PosePath, goals: tuple[Pose, ...], evidence: tuple[str, ...]
) -> Phase:
    return Phase(
        name=name,
        kind="carry",
        thing=grip.name,
        reference=reference,
        path=path,
        goals=goals,
        object_from_tcp=grip.object_from_tcp,
        gripper="open" if grip.opens else "none",
        evidence=evidence,
    )


def _with(phase: Phase, left: tuple[Pose, ...], right: tuple[Pose, ...], reference: Reference) -> Phase:
    from dataclasses import replace

    return replace(phase, left=left, right=right, touching=reference.touched)


def _open_choice(phase: Phase, reference: Reference) -> list[Choice]:
    if not reference.others:
        return []
    return [Choice(phase.name, "reference", reference.name, reference.others, reference.why)]


def _withdrawal(demonstration: Demonstration, begin: int, last: Grip | Articulation | None) -> list[Phase]:
    """Return the hand's motion after the last release, if it was shown."""
    rest = demonstration.path[begin:]
    if last is None or (isinstance(last, Grip) and not last.opens) or rest.lengths()[-1] < WITHDRAWAL:
        return []
    path = PosePath(rest.dqs)
    return [
        Phase(
            name="withdraw",
            kind="withdraw",
            thing="",
            reference=START,
            path=path,
            goals=(path[0].inverse() @ path[-1],),
            evidence=(f"the hand moves on from {at_time(demonstration, begin)}",),
        )
    ]
