"""Facts about users' own tasks: what is true of all of them, and of one once its module is imported."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

from ..facts.task_facts import TaskFacts, TaskPage

if TYPE_CHECKING:
    from .task import Task

PAGE = TaskPage(
    summary="",
    description="",
    dense="""\
mean over the goals: up to 0.75 for bringing the object there, from 0.75 to 1 for withdrawing; without goals it is that
of success""",
    start="L0 the nominal layout; L1 and L2 things and goals moved as the task's ranges say.",
    ends="when an object has fallen off the table, or one of the task's conditions of failure holds",
    observed={"furniture_pose": "poses of the fixtures; constant during an episode"},
    numbers="`placed`, `position_error` (g,) [m], `angle_error` (g,) [rad], and the task's own numbers",
    options={"object_poses": "(n, 7)"},
    goals="""\
(8 g,): pose of each object with a goal, and 1 where it is released, else 0; its goal and 1 (a task without goals has no
goal form)""",
    blocked="the way of the objects",
)
OWN = TaskFacts("", "", "onedemo.envs.tasks.task_env:declared_env", 60.0, PAGE)
"""Facts about every task of a user's own; its name, id and time limit are known once its module is imported."""


@lru_cache(maxsize=32)
def own_facts(task: Task) -> TaskFacts:
    """Return the facts about a user's own task."""
    from .describe import described

    page = replace(PAGE, summary=task.summary, description=described(task))
    return replace(OWN, name=task.name, id=task.id, seconds=task.seconds, page=page)
