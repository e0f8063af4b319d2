"""Table of the shipped tasks: the one place where their facts come together; it imports no simulator."""

from __future__ import annotations

from .facts.task_facts import TaskFacts
from .guests.facts import ROBOSUITE
from .pour.facts import BIMANUAL_POUR, POUR, TILT_POUR
from .shelve.facts import INSERT_ONE, SHELVE
from .stack.facts import PLACE_ONE, REACH, STACK

_EVERY = (STACK, POUR, SHELVE, REACH, PLACE_ONE, TILT_POUR, INSERT_ONE, BIMANUAL_POUR, ROBOSUITE)
TASKS: dict[str, TaskFacts] = {facts.name: facts for facts in _EVERY}
"""All shipped tasks by name; those of 7.5 s are single motions of the others, meant for training."""
IDS: dict[str, TaskFacts] = {facts.id: facts for facts in _EVERY}
"""The same by Gymnasium id."""
