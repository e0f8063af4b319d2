"""Configs of users' own tasks: a dotted path stands for the smallest one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ...configs import BadConfig
from ...envs import task_at
from ...envs.dotted_names import BadDottedName, is_dotted
from ...envs.tasks.registered import demonstration_of


def is_own_task(config: str) -> bool:
    """Return whether a config is no file, but the dotted path of a task."""
    return is_dotted(config) and not Path(config).exists()


def own_config(config: str, overrides: list[str]) -> dict[str, Any]:
    """Return the smallest config that runs a task.

    Args:
        config: dotted path of the task.
        overrides: `key=value` changes to the config, which may name another demonstration.

    Raises:
        BadConfig: no such module or name, or it is no task.
        BadTask: the task cannot be used, or names no demonstration.
    """
    try:
        task = task_at(config)
    except BadDottedName as error:
        raise BadConfig(config, "", error.reason) from None
    given = [text.partition("=")[2] for text in overrides if text.startswith("demonstration=")]
    shown = given[-1] if given else demonstration_of(config)
    return {"name": task.name, "task": config, "demonstration": shown}
