"""Facts about a task, its documentation among them, as data; importing them imports neither NumPy nor a simulator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, Literal, NamedTuple


class Error(NamedTuple):
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


OFFSET = Error("position_error", "largest position error", "mm", 1e3)


@dataclass(frozen=True, slots=True)
class SegmentPlayback:
    """Conversion of the demonstration to an episode of a task with one motion.

    Attributes:
        segment: name of the segment to follow.
        end: where its path ends: the hand "at the goal", the held object "at its goal", or the hand at an object
            "as shown".
        thing: index of that object.
        options: parameters of the playback that are not the defaults, see `onedemo.baselines.Playback`.
    """

    segment: str
    end: Literal["at the goal", "at its goal", "as shown"]
    thing: int = 0
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class TaskPage:
    """Part of a task's page that is its own, in Markdown; `page.page_of` adds what all tasks share.

    Attributes:
        summary: one sentence.
        description: what is there, what is to be done, and when it is done.
        dense: meaning of the dense reward.
        start: starts by level, without obstacles.
        ends: when an episode ends without success.
        observed: meanings of entries of the observation, by key, where they are the task's own.
        numbers: the task's own entries of `info`.
        arguments: meanings of the task's own arguments.
        options: the task's own options of `reset`.
        goals: what the goal form's achieved goals consist of, and the desired ones; "" without a goal form.
        blocked: what obstacles block.
    """

    summary: str
    description: str
    dense: str
    start: str
    ends: str
    observed: Mapping[str, str] = field(default_factory=dict)
    numbers: str = ""
    arguments: Mapping[str, str] = field(default_factory=dict)
    options: Mapping[str, str] = field(default_factory=dict)
    goals: str = ""
    blocked: str = ""


@dataclass(frozen=True, slots=True)
class TaskFacts:
    """Facts about a task for registration, commands, reports and learners.

    Attributes:
        name: of the task.
        id: Gymnasium id of the environment.
        entry_point: import path of what makes the environment.
        seconds: time limit [s].
        page: its documentation.
        frequency: default action frequency [Hz].
        error: error measure, see `Error`; None if the environment tells only success.
        task_metrics: neutral metrics of the task, which favor no method by construction: name in `metric_table` to
            key in `info`.
        compared_segment: the segment of its demonstration whose motion is compared; "" if there is none.
        poured_into: index of the target glass; None if nothing is poured.
        upright: True if the carried object should stay upright.
        demonstrated_task: the task of its demonstration if that is another task; "" otherwise.
        skill_at: import path of what the segments of its demonstration mean; "": it needs no segments.
        playback: how its demonstration is played as an episode; None: as the demonstration's skill says.
        recorder: import path of the function that records its scripted demonstration; "": none is shipped.
        recorded_in: arguments of the environment in which it does.
    """

    name: str
    id: str
    entry_point: str
    seconds: float
    page: TaskPage
    frequency: int = 50
    error: Error | None = OFFSET
    task_metrics: Mapping[str, str] = field(default_factory=dict)
    compared_segment: str = ""
    poured_into: int | None = None
    upright: bool = False
    demonstrated_task: str = ""
    skill_at: str = ""
    playback: SegmentPlayback | None = None
    recorder: str = ""
    recorded_in: Mapping[str, Any] = field(default_factory=dict)

    @property
    def steps(self) -> int:
        """Time limit in actions."""
        return round(self.seconds * self.frequency)

    @property
    def skill(self) -> Any:
        """Meaning of the segments of its demonstration (`SegmentedSkill`); None: it needs no segments."""
        return named(self.skill_at) if self.skill_at else None


def named(path: str) -> Any:
    """Return the object at an import path of this project, `package.module:name`."""
    module, _, name = path.partition(":")
    return getattr(import_module(module), name)
