"""One demonstration in, a robot policy out.

The packages: `onedemo.planner` (demonstrations, plans, control, safety; needs no simulator), `onedemo.envs` (Gymnasium
tasks; importing registers the ids), `onedemo.baselines` (policies), `onedemo.configs` (settings as data).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from . import former_paths
from .planner.lazy_names import lazy_names

if TYPE_CHECKING:
    from .baselines.factory import make_policy as make_policy
    from .baselines.programs.task_skills import skill_of as skill_of
    from .configs.demonstrations import load_demonstration as load_demonstration
    from .envs.tasks.registered import register_task as register_task
    from .envs.tasks.task import Task as Task
    from .planner.errors import OneDemoError as OneDemoError

__all__ = [
    "OneDemoError",
    "Task",
    "__version__",
    "load_demonstration",
    "make_policy",
    "register_task",
    "skill_of",
]

if not TYPE_CHECKING:  # a type checker would take any name for known
    __getattr__, __dir__ = lazy_names(
        __name__,
        {
            ".baselines.factory": ("make_policy",),
            ".baselines.programs.task_skills": ("skill_of",),
            ".configs.demonstrations": ("load_demonstration",),
            ".envs.tasks.registered": ("register_task",),
            ".envs.tasks.task": ("Task",),
            ".planner.errors": ("OneDemoError",),
        },
        packages=("baselines", "configs", "envs", "planner"),
    )

former_paths.keep()


def _version() -> str:
    from importlib.metadata import version

    return version("onedemo")


__version__ = _version()
