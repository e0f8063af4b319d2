"""Task facts that running and reporting need besides the environment."""

from __future__ import annotations

from dataclasses import dataclass

from ..envs import IDS
from ..envs.dotted_names import is_dotted
from ..envs.pour.geometry import TARGET
from ..envs.pour.skill import BIMANUAL_SKILL, POUR_SKILL
from ..envs.shelve.skill import SHELVE_SKILL
from ..envs.stack.skill import REACH_SKILL, STACK_SKILL
from ..planner.skills.skill import SegmentedSkill


@dataclass(frozen=True, slots=True)
class Error:
    """Error measure of a task: the number that tells how accurate a success was.

    Attributes:
        key: name of the number in `info` and in the records; the largest of several values counts.
        words: name in tables.
        unit: unit in tables.
        factor: conversion factor from the recorded number to that unit.
    """

    key: str
    words: str
    unit: str
    factor: float


@dataclass(frozen=True, slots=True)
class TaskFacts:
    """Facts about a task for commands and reports.

    Attributes:
        id: Gymnasium id of the environment.
        error: error measure, see `Error`; None if the environment tells only success.
        task_metrics: neutral metrics of the task, which favor no method by construction: name in `metric_table` to
            key in `info`.
        compared_segment: the segment of its demonstration whose motion is compared; "" if there is none.
        poured_into: index of the target glass; None if nothing is poured.
        upright: True if the carried object should stay upright.
        demonstrated_task: the task of its demonstration if that is another task; "" otherwise.
        skill: what the segments of its demonstration mean; None: its demonstration needs no segments.
    """

    id: str
    error: Error | None
    task_metrics: dict[str, str]
    compared_segment: str = ""
    poured_into: int | None = None
    upright: bool = True
    demonstrated_task: str = ""
    skill: SegmentedSkill | None = None


OUTSIDE = Error("fraction_outside", "largest share of beads outside", "%", 1e2)
OFFSET = Error("position_error", "largest position error", "mm", 1e3)
BEADS = {"beads_lost": "beads_lost", "share_outside": "fraction_outside"}
TASKS = {
    "stack": TaskFacts(
        "onedemo/Stack-v0",
        OFFSET,
        {"stack_offset": "position_error", "stack_yaw": "yaw_error"},
        "transfer",
        skill=STACK_SKILL,
    ),
    "pour": TaskFacts("onedemo/Pour-v0", OUTSIDE, BEADS, "carry", TARGET, skill=POUR_SKILL),
    "shelve": TaskFacts(
        "onedemo/Shelve-v0",
        OFFSET,
        {"insertion_offset": "position_error", "insertion_angle": "angle_error"},
        "insert",
        upright=False,
        skill=SHELVE_SKILL,
    ),
    "reach": TaskFacts(
        "onedemo/Reach-v0",
        OFFSET,
        {"reach_offset": "position_error"},
        upright=False,
        demonstrated_task="stack",
        skill=REACH_SKILL,
    ),
    "place_one": TaskFacts(
        "onedemo/PlaceOne-v0",
        OFFSET,
        {"stack_offset": "position_error", "stack_yaw": "yaw_error"},
        "transfer",
        demonstrated_task="stack",
        skill=STACK_SKILL,
    ),
    "tilt_pour": TaskFacts(
        "onedemo/TiltPour-v0", OUTSIDE, BEADS, "carry", TARGET, demonstrated_task="pour", skill=POUR_SKILL
    ),
    "insert_one": TaskFacts(
        "onedemo/InsertOne-v0",
        OFFSET,
        {"insertion_offset": "position_error", "insertion_angle": "angle_error"},
        "insert",
        upright=False,
        demonstrated_task="shelve",
        skill=SHELVE_SKILL,
    ),
    "bimanual_pour": TaskFacts(
        "onedemo/BimanualPour-v0", OUTSIDE, BEADS, poured_into=TARGET, demonstrated_task="pour", skill=BIMANUAL_SKILL
    ),
    "robosuite": TaskFacts("onedemo/Robosuite-v0", None, {}, upright=False),
}
"""All shipped tasks by name; for "robosuite" see also `FAMILIES` of `configs.run_config`."""
OWN = TaskFacts("", OFFSET, {}, upright=False)
"""Facts about every task of a user's own; its environment id is known once its module is imported."""
OWN_FREQUENCY = 50
"""Default action frequency of users' own tasks [Hz]."""


def facts_of(task: str) -> TaskFacts:
    """Return the facts about a shipped task, or about a user's own, given by a dotted path; imports nothing."""
    return OWN if is_dotted(task) else TASKS[task]


def environment_id(task: str) -> str:
    """Return the Gymnasium id of a task, registered; imports the module of a user's own task.

    Raises:
        BadDottedName: no such module or name, or it is no task.
        BadTask: the task cannot be used.
    """
    if not is_dotted(task):
        return TASKS[task].id
    from ..envs import task_at

    return task_at(task).id


def seconds_of(task: str) -> float:
    """Return the time limit of a task [s]; imports the module of a user's own task."""
    if not is_dotted(task):
        return IDS[TASKS[task].id].seconds
    from ..envs import task_at

    return task_at(task).seconds


def frequency_of(task: str) -> int:
    """Return the default action frequency of a task [Hz]."""
    return OWN_FREQUENCY if is_dotted(task) else IDS[TASKS[task].id].frequency
