"""Users' own tasks by name: registered with Gymnasium, or given by a dotted path `my_tasks:MY_TASK`."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import gymnasium as gym

from ..core.whole_copies import WHOLE_COPIES
from ..dotted_names import BadDottedName, imported
from ..errors import BadTask
from .facts import OWN
from .task import Task

FORM = "my_tasks:MY_TASK"


class Registered(NamedTuple):
    """A registered task.

    Attributes:
        task: the task.
        file: of the module that has registered it; "" if there is none.
    """

    task: Task
    file: str


_REGISTERED: dict[str, Registered] = {}


def register_task(task: Task) -> str:
    """Register the environment of a task with Gymnasium; again from the same file, the new task replaces the old one.

    Args:
        task: the task.

    Returns:
        The id, for `gymnasium.make`.

    Raises:
        BadTask: this is no task, or its name is registered already.
    """
    if not isinstance(task, Task):
        raise BadTask(task, "", f"is a {type(task).__name__}, not a Task")
    return _registered(task, str(sys._getframe(1).f_globals.get("__file__", "")))


def task_at(path: str) -> Task:
    """Return the task that a dotted path names, registered.

    Args:
        path: like "my_tasks:PEG_IN_HOLE"; the module is searched on Python's path and in the current folder.

    Raises:
        BadDottedName: no such module or name, or it is no task.
        BadTask: the task cannot be used, or its name is registered already.
    """
    found = imported(path, FORM, lambda found: isinstance(found, Task))
    if not isinstance(found, Task):
        raise BadDottedName(path, f"is a {type(found).__name__}, not a Task: write {path.partition(':')[2]} = Task(…)")
    _registered(found, _file_of(path))
    return found


def demonstration_of(path: str) -> str:
    """Return the file of the demonstration of the task that a dotted path names, relative to the current folder.

    Raises:
        BadTask: the task names no demonstration, or one that is not there.
    """
    task = task_at(path)
    if not str(task.demonstration):
        reason = f"is not named; record one with 'onedemo demo record {path} -o FILE.npz' or import one, and write "
        raise task.bad("demonstration", reason + "demonstration='FILE.npz'")
    file = Path(task.demonstration)
    beside = Path(_file_of(path)).parent / file
    found = beside if beside.exists() or not file.exists() else file
    if not found.exists():
        reason = f"{found.name} does not exist: record it with 'onedemo demo record {path} -o {file}', or import one"
        raise task.bad("demonstration", reason)
    here = Path.cwd()
    return str(found.resolve().relative_to(here) if found.resolve().is_relative_to(here) else found)


def _file_of(path: str) -> str:
    return str(getattr(sys.modules[path.partition(":")[0]], "__file__", None) or "")


def _registered(task: Task, file: str) -> str:
    known = _REGISTERED.get(task.id)
    if known is not None and known.task is task:
        return task.id
    if task.id in gym.registry and (known is None or known.file != file):
        whose = f" by {known.file}" if known is not None and known.file else ""
        raise task.bad("name", f"{task.id} is registered already{whose}: choose another name")
    gym.registry.pop(task.id, None)
    facts = replace(OWN, seconds=task.seconds)
    gym.register(
        task.id,
        facts.entry_point,
        max_episode_steps=facts.steps,
        additional_wrappers=(WHOLE_COPIES,),
        kwargs={"declared": task},
    )
    _REGISTERED[task.id] = Registered(task, file)
    return task.id
