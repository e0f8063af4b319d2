"""Obstacles of an arm, read from observations: the table, the objects, the scheduled obstacles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...envs import TaskDescription
from ...planner import Box, Capsule, Obstacle, Pose, Shape, Sphere
from ...planner.geometry.shapes import SHAPE_KIND
from ..policy import Observation

TABLE = "table"
TABLE_MARGIN, OBJECT_MARGIN = 0.001, 0.003
"""Margins [m] of table and objects, small because the task itself comes close: objects are placed there."""
OBSTACLE_KEYS = ("obstacle_active", "obstacle_shape", "obstacle_size", "obstacle_pose", "obstacle_velocity")
MOVED = 1e-3
"""Change of a pose vector's entry from which an object counts as moved."""


class WorldModel:
    """The obstacles of one arm, updated only when an object has moved.

    Args:
        task: task with the fixtures and the objects' shapes.
        table_margin: margin [m] of the table.
        margin: margin [m] of objects and furniture.

    Attributes:
        allowed: allowed contacts: (part of the body or "held", name of an object).
    """

    def __init__(self, task: TaskDescription, *, table_margin: float = TABLE_MARGIN, margin: float = OBJECT_MARGIN):
        self.allowed: tuple[tuple[str, str], ...] = task.touching
        self._task, self._held, self._margin = task, None, margin
        self._fixed = tuple(replace(f, margin=table_margin) if f.name == TABLE else f for f in task.fixtures)
        self._poses = np.full((len(task.objects) + len(task.furniture), 7), np.inf)
        self._obstacle_rows = np.zeros((task.obstacles, 15))
        self._things: tuple[Obstacle, ...] = ()
        self._seen: tuple[Obstacle, ...] = ()

    def allow(self, contacts: Sequence[tuple[str, str]]) -> None:
        """Set the allowed contacts from now on, besides those the task always allows."""
        self.allowed = (*self._task.touching, *contacts)

    def name(self, index: int) -> str:
        """Return the name of an object."""
        return self._task.objects[index].name

    def set_margin(self, margin: float) -> None:
        """Set the margin [m] of objects and furniture from now on."""
        if margin != self._margin:
            self._margin = margin
            self._poses[:] = np.inf

    def exclude(self, index: int | None) -> None:
        """Exclude the object in the hand from now on; None: the hand is empty."""
        self._held = index
        self._poses[:] = np.inf

    def obstacles(self, observation: Observation) -> tuple[Obstacle, ...]:
        """Return the observed obstacles; the same tuple while nothing has moved."""
        poses = self._places(observation)
        moved = np.abs(poses - self._poses).max(axis=1) > MOVED
        if self._held is not None:
            moved[self._held] = np.isinf(self._poses[self._held, 0])
        rows = np.column_stack([observation[key].reshape(len(self._obstacle_rows), -1) for key in OBSTACLE_KEYS])
        if moved.any():
            self._poses[:] = poses
            self._things = self._standing(poses, self._held, self._margin)
        if moved.any() or (rows != self._obstacle_rows).any():
            self._obstacle_rows = rows
            self._seen = (*self._things, *obstacles_in(observation))
        return self._seen

    def obstacles_if_holding(
        self, observation: Observation, held: int | None, margin: float | None = None
    ) -> tuple[Obstacle, ...]:
        """Return the obstacles as if an object were in the hand.

        Args:
            observation: the present one.
            held: index of the object; None: the hand is empty.
            margin: margin [m] of objects and furniture; None: the present one.
        """
        margin = self._margin if margin is None else margin
        return (*self._standing(self._places(observation), held, margin), *obstacles_in(observation))

    def _places(self, observation: Observation) -> np.ndarray:
        """Return the poses (n, 7) of all objects and furniture."""
        if not self._task.furniture:
            return observation["object_pose"]
        return np.concatenate([observation["object_pose"], observation["furniture_pose"]])

    def _standing(self, poses: np.ndarray, held: int | None, margin: float) -> tuple[Obstacle, ...]:
        objects, furniture = self._task.objects, self._task.furniture
        obstacles_if_holding = [
            replace(part, margin=margin)
            for k, (each, pose) in enumerate(zip(objects, poses, strict=False))
            if k != held
            for part in each.at(Pose.from_vector(pose))
        ]
        for each, pose in zip(furniture, poses[len(objects) :], strict=True):
            obstacles_if_holding += [replace(part, margin=margin) for part in each.at(Pose.from_vector(pose))]
        return (*self._fixed, *obstacles_if_holding)


def obstacles_in(observation: Observation) -> tuple[Obstacle, ...]:
    """Return the observed scheduled obstacles."""
    found = []
    for slot in np.flatnonzero(observation["obstacle_active"]):
        pose, velocity = Pose.from_vector(observation["obstacle_pose"][slot]), observation["obstacle_velocity"][slot]
        shape = _shape(int(observation["obstacle_shape"][slot]), observation["obstacle_size"][slot])
        found.append(Obstacle(shape, pose, velocity, f"obstacle{slot}"))
    return tuple(found)


def _shape(kind: int, size: np.ndarray) -> Shape:
    """Return the shape of an observed obstacle; see the observation's `obstacle_shape` and `obstacle_size`."""
    if kind == SHAPE_KIND.box:
        return Box((float(size[0]), float(size[1]), float(size[2])))
    return Sphere(float(size[0])) if kind == SHAPE_KIND.sphere else Capsule(float(size[0]), float(size[2]))
