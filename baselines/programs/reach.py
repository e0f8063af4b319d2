"""Reaching as demonstrated: the demonstrated approach, relative to the goal of the hand."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from ...envs import TaskDescription
from ...planner import Demonstration, Pose
from ...planner.imitation.segmentation import resampled
from ..policy import LabeledPath
from .arm_executor import ArmExecutor
from .goal_choice import MotionChoice

if TYPE_CHECKING:
    from ..motion.settings import ProgramSettings


class ReachProgram:
    """The program of one episode; iterate over `actions()`.

    Args:
        task: the task.
        shown: the demonstration.
        settings: see `ProgramSettings`.
        executor: executor of the arm.
    """

    SEGMENTS = ("approach",)
    """Segments required of a demonstration of this task."""
    SIZED: tuple[str, ...] = ()
    """Objects whose sizes a demonstration must give."""
    RELEASE = ""
    """Segment after which the recorded gripper decides how far this one opens; "" for none."""

    def __init__(self, task: TaskDescription, shown: Demonstration, settings: ProgramSettings, executor: ArmExecutor):
        self.task, self.settings, self.executor = task, settings, executor
        self.approach = resampled(shown.segment_path("approach"), settings.resample)
        self.paths = [LabeledPath("demonstrated", "approach", self.approach)]

    def actions(self) -> Iterator[np.ndarray]:
        """Yield the actions of moving to the goal; a half turn of the hand makes no difference."""
        executor, target = self.executor, self.task.objects[0].name
        goals = tuple(executor.goal_pose(0) @ Pose.from_yaw([0.0, 0.0, 0.0], turn) for turn in (0.0, np.pi))
        around = executor.world_model.obstacles_if_holding(executor.observation, None)
        choice = executor.choose(MotionChoice(target, self.approach, goals, executor.empty, around, self.task.touching))
        self.paths.append(LabeledPath("final", f"reach {target}", choice.path))
        yield from executor.go(choice)
