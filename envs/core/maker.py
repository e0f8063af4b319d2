"""Makers of environments: what Gymnasium calls for an id, with the arguments that all tasks share."""

from __future__ import annotations

from collections.abc import Callable
from inspect import Parameter, Signature, signature
from typing import Any

from .declared_task import DeclaredTask
from .environment import METADATA, TaskEnv

SHARED: dict[str, Any] = {
    "level": "L1",
    "obstacles": None,
    "control_mode": "joint_velocity",
    "reward": "sparse",
    "control_frequency": 50,
    "render_mode": None,
}
"""Arguments of all environments, see `TaskEnv`, with their defaults."""
GOAL_FORM: dict[str, Any] = {"goal_form": False, "end_on_success": None}
"""Further arguments of single motions, and of users' own tasks."""
SINGLE_MOTION: dict[str, Any] = {"control_mode": "ee_twist", "reward": "dense", "control_frequency": 20, **GOAL_FORM}
"""Defaults of the tasks that are made for training."""


class EnvironmentMaker:
    """Maker of a task's environment, from arguments by name: those of the task, and those that all tasks share.

    Args:
        task: makes the declared task of its own arguments.
        defaults: shared arguments that differ from `SHARED`, or are added to it.
    """

    metadata = METADATA

    def __init__(self, task: Callable[..., DeclaredTask], **defaults: Any):
        own = signature(task).parameters
        shared = {**SHARED, **defaults}
        self._task, self._own = task, tuple(own)
        kind = Parameter.KEYWORD_ONLY
        parameters = [each.replace(kind=kind) for each in own.values()]
        parameters += [Parameter(key, kind, default=value) for key, value in shared.items()]
        self.__signature__ = Signature(parameters)

    def __call__(self, **arguments: Any) -> TaskEnv:
        """Return an environment; see its page for the arguments."""
        bound = self.__signature__.bind(**arguments)
        bound.apply_defaults()
        given = bound.arguments
        declared = self._task(**{key: given.pop(key) for key in self._own})
        return TaskEnv(declared, **given)
