"""The skill of a demonstration in the words of a task: its names, its shapes, only what it has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from ...envs import TaskDescription
from ...planner import Demonstration, Obstacle
from ...planner.errors import BadDemonstration, UnknownName
from ...planner.skills.infer import infer_skill
from ...planner.skills.names import matched_names
from ...planner.skills.skill import Phase, Skill
from ...planner.skills.thing import Thing


def skill_of(
    demonstration: Demonstration, task: TaskDescription | None = None, names: Mapping[str, str] | None = None
) -> Skill:
    """Return what a demonstration shows.

    Args:
        demonstration: with a gripper command, and the paths of objects or of joints of the scene.
        task: a task to do it in, `env.unwrapped.task`: its shapes make references and symmetries sharper, and the
            skill has its names; what it does not have is left out, with a note. None: names as demonstrated, no shapes.
        names: the task's names of things that have others in the demonstration; stronger than its corrections.

    Raises:
        BadDemonstration: no skill is found in it, or none whose things the task has; or a correction does not fit.
        UnknownName: a phase refers to a thing that the task does not have, or a correction to no phase.
    """
    if task is None:
        return infer_skill(demonstration)
    solid, frames = things_of(task), [each.name for each in task.furniture if not each.parts]
    found = _counterparts(demonstration, [*solid, *frames], {**demonstration.corrections.names, **(names or {})})
    skill = infer_skill(demonstration, {shown: solid[name] for shown, name in found.items() if name in solid})
    return _in_task(skill, found, task)


def things_of(task: TaskDescription) -> dict[str, Thing]:
    """Return the shapes of a task's objects, furniture and fixtures by name."""
    things = {each.name: Thing(each.name, each.parts) for each in task.objects}
    things |= {each.name: Thing(each.name, each.parts, free=False) for each in task.furniture if each.parts}
    for each in task.fixtures:
        things.setdefault(each.name, Thing(each.name, (Obstacle(each.shape),), free=False))
    return things


def _counterparts(demonstration: Demonstration, known: Sequence[str], given: Mapping[str, str]) -> dict[str, str]:
    """Return the task's names of the things in a demonstration that it has."""
    shown = [*demonstration.object_paths, *demonstration.fixtures]
    for name in given:
        if name not in shown:
            raise UnknownName("thing of the demonstration", name, shown)
    found: dict[str, str] = {}
    for name in shown:
        options = {name: given[name]} if name in given else {}
        try:
            found |= matched_names([name], known, options)
        except UnknownName:
            if name in given:
                raise
    return found


def _in_task(skill: Skill, found: Mapping[str, str], task: TaskDescription) -> Skill:
    """Return a skill with a task's names, without the phases whose thing the task does not have."""
    absent = {phase.thing for phase in skill.phases if phase.thing and phase.thing not in found}
    phases = tuple(_renamed(phase, found, task) for phase in skill.phases if phase.thing not in absent)
    if not any(phase.thing for phase in phases):
        known = ", ".join(_names(task))
        reason = f"shows {', '.join(sorted(absent))}, none of which the task has; it has {known}: give names"
        raise BadDemonstration(skill.name, "object_paths", reason)
    notes = tuple(f"{name} is not in the task: what was shown with it is left out" for name in sorted(absent))
    return replace(skill, phases=phases, notes=(*skill.notes, *notes))


def _renamed(phase: Phase, found: Mapping[str, str], task: TaskDescription) -> Phase:
    if phase.reference and phase.reference not in found:
        raise UnknownName(f"thing of the task, to which {phase.name!r} refers,", phase.reference, _names(task))
    touching = [found[name] for name in phase.touching if name in found]
    return replace(
        phase,
        thing=found.get(phase.thing, ""),
        reference=found.get(phase.reference, ""),
        touching=tuple(dict.fromkeys(name for each in touching for name in _assembly(each, task))),
    )


def _assembly(name: str, task: TaskDescription) -> tuple[str, ...]:
    """Return the names of a thing and of all that belong to the same assembly: a hand opens a door by its latch."""
    whole = next((each.assembly or each.name for each in task.furniture if each.name == name), name)
    return (name, *(each.name for each in task.furniture if whole in (each.name, each.assembly) and each.parts))


def _names(task: TaskDescription) -> list[str]:
    return [each.name for each in (*task.objects, *task.furniture, *task.fixtures)]
