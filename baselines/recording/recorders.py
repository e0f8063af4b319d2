"""Scripted demonstrations by task: those of the shipped ones, and the scripts of users' own tasks."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...envs import TASKS, Task, task_at
from ...envs.dotted_names import is_dotted, said
from ...envs.facts.task_facts import named
from ...planner import Demonstration
from ...planner.errors import OneDemoError, UnknownName
from .scripted_recorder import ScriptedMotion, recorded


class Recorder(NamedTuple):
    """Recorder of a demonstration.

    Attributes:
        record: takes the task's environment, unwrapped, and returns the demonstration recorded in it.
        scene: arguments of that environment.
    """

    record: Callable[[Any], Demonstration]
    scene: Mapping[str, Any] = {}


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
    scripted = {name: facts for name, facts in TASKS.items() if facts.recorder}
    if task not in scripted:
        raise UnknownName("scripted demonstration", task, scripted)
    return Recorder(named(scripted[task].recorder), scripted[task].recorded_in)


def _recorded(env: Any, task: Task) -> Demonstration:
    """Record a user's own script at the nominal layout."""
    observation, _ = env.reset(seed=0, options={"level": "L0"})
    motions = _motions(task, observation, [each.name for each in env.task.furniture])
    return recorded(env, observation, motions, name=task.name)


def _motions(task: Task, observation: dict[str, np.ndarray], fixed: Sequence[str]) -> Iterator[ScriptedMotion]:
    """Yield the motions of a user's script; what is wrong with them is said in one line.

    Raises:
        BadTask: the script raises an error, or yields what is no motion among the task's things.
    """
    assert task.script is not None
    known = [*(each.name for each in task.objects), *fixed]
    try:
        for motion in task.script(observation):
            if not isinstance(motion, ScriptedMotion):
                raise task.bad("script", f"yields {type(motion).__name__}; expected ScriptedMotion(name, waypoints, …)")
            for key, name in (("reference", motion.reference), ("held", motion.held)):
                if name and name not in known:
                    raise task.bad(
                        "script", f"{key} of {motion.name!r}: {name!r} is not there; there are {', '.join(known)}"
                    )
            yield motion
    except OneDemoError:
        raise
    except Exception as error:
        keys = f"; the observation has {', '.join(observation)}" if isinstance(error, KeyError) else ""
        raise task.bad("script", f"{said(error)}{keys}") from error
