"""Gymnasium tasks on simulated robots; importing this package registers the ids `onedemo/…`.

The other names below are imported on first use: registering imports no simulator.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..planner.lazy_names import lazy_names
from .registration import register_all
from .shipped import IDS, TASKS

if TYPE_CHECKING:
    from .core.description import FAILURES as FAILURES
    from .core.description import TaskDescription as TaskDescription
    from .core.description import TaskObject as TaskObject
    from .core.environment import TaskEnv as TaskEnv
    from .core.levels import LEVELS as LEVELS
    from .scene.robots import ROBOTS as ROBOTS
    from .simulation.moving_obstacles import ScheduledObstacle as ScheduledObstacle
    from .task_table import facts_of as facts_of
    from .tasks.model_files import parts_of_mesh as parts_of_mesh
    from .tasks.model_files import parts_of_mjcf as parts_of_mjcf
    from .tasks.places import At as At
    from .tasks.places import Range as Range
    from .tasks.registered import register_task as register_task
    from .tasks.registered import task_at as task_at
    from .tasks.success import SceneView as SceneView
    from .tasks.success import Success as Success
    from .tasks.success import Tolerance as Tolerance
    from .tasks.task import Task as Task
    from .tasks.things import Fixture as Fixture
    from .tasks.things import Movable as Movable
    from .tasks.things import Part as Part

__all__ = [
    "FAILURES",
    "IDS",
    "LEVELS",
    "ROBOTS",
    "TASKS",
    "At",
    "Fixture",
    "Movable",
    "Part",
    "Range",
    "SceneView",
    "ScheduledObstacle",
    "Success",
    "Task",
    "TaskDescription",
    "TaskEnv",
    "TaskObject",
    "Tolerance",
    "facts_of",
    "parts_of_mesh",
    "parts_of_mjcf",
    "register_all",
    "register_task",
    "task_at",
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
            ".task_table": ("facts_of",),
            ".tasks.model_files": (
                "parts_of_mesh",
                "parts_of_mjcf",
            ),
            ".tasks.places": (
                "At",
                "Range",
            ),
            ".tasks.registered": (
                "register_task",
                "task_at",
            ),
            ".tasks.success": (
                "SceneView",
                "Success",
                "Tolerance",
            ),
            ".tasks.task": ("Task",),
            ".tasks.things": (
                "Fixture",
                "Movable",
                "Part",
            ),
        },
    )

register_all()
