"""Scripted demonstrations by task: those of the shipped ones, and the scripts of users' own tasks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from ...envs import Task, task_at
from ...envs.dotted_names import is_dotted
from ...planner import Demonstration
from ...planner.errors import UnknownName
from .record_pour import record_pour
from .record_shelve import SCENE, record_shelve
from .scripted_recorder import recorded


class Recorder(NamedTuple):
    """Recorder of a demonstration.

    Attributes:
        record: takes the task's environment, unwrapped, and returns the demonstration recorded in it.
        scene: arguments of that environment.
    """

    record: Callable[[Any], Demonstration]
    scene: Mapping[str, Any] = {}


RECORDERS = {"pour": Recorder(record_pour), "shelve": Recorder(record_shelve, SCENE)}
"""Recorder of each scripted task that is shipped."""


def recorder_of(task: str) -> Recorder:
    """Return the recorder of a task.

    Args:
        task: name of a shipped task, or the dotted path of a user's own.

    Raises:
        UnknownName: no script is shipped for it.
        BadTask: the user's own task has no script.
    """
    if is_dotted(task):
        own = task_at(task)
        if own.script is None:
            raise own.bad(
                "script", "is not given: write a function of the first observation that yields ScriptedMotion"
            )
        return Recorder(lambda env: _recorded(env, own))
    if task not in RECORDERS:
        raise UnknownName("scripted demonstration", task, RECORDERS)
    return RECORDERS[task]


def _recorded(env: Any, task: Task) -> Demonstration:
    """Record a user's own script at the nominal layout."""
    observation, _ = env.reset(seed=0, options={"level": "L0"})
    assert task.script is not None
    return recorded(env, observation, task.script(observation), name=task.name)
