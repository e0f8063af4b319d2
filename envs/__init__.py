"""Gymnasium tasks on simulated robots; importing this package registers the ids `onedemo/…`.

The other names below are imported on first use: registering imports no simulator.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..planner.lazy_names import lazy_names
from .registration import IDS, register_all

if TYPE_CHECKING:
    from .core.description import FAILURES as FAILURES
    from .core.description import TaskDescription as TaskDescription
    from .core.description import TaskObject as TaskObject
    from .core.environment import TaskEnv as TaskEnv
    from .core.levels import LEVELS as LEVELS
    from .scene.robots import ROBOTS as ROBOTS
    from .simulation.moving_obstacles import ScheduledObstacle as ScheduledObstacle

__all__ = [
    "FAILURES",
    "IDS",
    "LEVELS",
    "ROBOTS",
    "ScheduledObstacle",
    "TaskDescription",
    "TaskEnv",
    "TaskObject",
    "register_all",
]

if not TYPE_CHECKING:  # a type checker would take any name for known
    __getattr__, __dir__ = lazy_names(
        __name__,
        {
            ".core.description": (
                "FAILURES",
                "TaskDescription",
                "TaskObject",
            ),
            ".core.environment": ("TaskEnv",),
            ".core.levels": ("LEVELS",),
            ".scene.robots": ("ROBOTS",),
            ".simulation.moving_obstacles": ("ScheduledObstacle",),
        },
    )

register_all()
