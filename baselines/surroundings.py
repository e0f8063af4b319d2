"""What an arm has to keep clear of, read from observations: the table, the objects, the obstacles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..envs.task import TaskDescription
from ..planner.pose import Pose
from ..planner.shapes import Box, Obstacle
from .policy import Observation

TABLE = "table"
TABLE_MARGIN, OBJECT_MARGIN = 0.001, 0.003
"""Distances [m] to keep from what the task itself brings close: things are put down there."""
MOVED = 1e-3
"""Change of a pose vector's entry from which an object is in another place."""


class Surroundings:
    """The obstacles of one arm, renewed only when something has moved.

    Args:
        task: with the fixtures and the objects' sizes.
        table_margin: distance [m] to keep from the table.
        margin: distance [m] to keep from objects.

    Attributes:
        allowed: contacts that are wanted: (part of the body or "held", name of a thing).
    """

    def __init__(self, task: TaskDescription, *, table_margin: float = TABLE_MARGIN, margin: float = OBJECT_MARGIN):
        self.allowed: tuple[tuple[str, str], ...] = ()
        self._objects, self._held, self._margin = task.objects, None, margin
        self._fixed = tuple(replace(f, margin=table_margin) if f.name == TABLE else f for f in task.fixtures)
        self._poses = np.full((len(task.objects), 7), np.inf)
        self._seen: tuple[Obstacle, ...] = ()

    def without(self, index: int | None) -> None:
        """From now on an object is in the hand, or none is."""
        self._held = index
        self._poses[:] = np.inf

    def seen(self, observation: Observation) -> tuple[Obstacle, ...]:
        """The obstacles as observed; the same tuple while nothing has moved."""
        poses = observation["object_pose"]
        moved = np.abs(poses - self._poses).max(axis=1) > MOVED
        if self._held is not None:
            moved[self._held] = np.isinf(self._poses[self._held, 0])
        if moved.any():
            self._poses[:] = poses
            self._seen = self.around(observation, self._held)
        return self._seen

    def around(self, observation: Observation, held: int | None) -> tuple[Obstacle, ...]:
        """The obstacles as observed, if an object were in the hand."""
        objects = (
            Obstacle(Box(tuple(each.size)), Pose.from_vector(pose), name=each.name, margin=self._margin)
            for k, (each, pose) in enumerate(zip(self._objects, observation["object_pose"], strict=True))
            if k != held
        )
        return (*self._fixed, *objects)
