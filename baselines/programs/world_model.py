"""What an arm has to keep clear of, read from observations: the table, the objects, the obstacles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...envs.core.description import TaskDescription
from ...planner.geometry.pose import Pose
from ...planner.geometry.shapes import Box, Capsule, Obstacle, Shape, Sphere
from ..policy import Observation

TABLE = "table"
TABLE_MARGIN, OBJECT_MARGIN = 0.001, 0.003
"""Distances [m] to keep from what the task itself brings close: things are put down there."""
MAX_OBSTACLES = ("obstacle_active", "obstacle_shape", "obstacle_size", "obstacle_pose", "obstacle_velocity")
FREE_MARGIN = 0.010
"""Distance [m] to keep where nothing has to be near: a moving arm lags some millimetres behind what guards it."""
MOVED = 1e-3
"""Change of a pose vector's entry from which an object is in another place."""


class WorldModel:
    """The obstacles of one arm, renewed only when something has moved.

    Args:
        task: with the fixtures and the objects' shapes.
        table_margin: distance [m] to keep from the table.
        margin: distance [m] to keep from objects and furniture.

    Attributes:
        allowed: contacts that are wanted: (part of the body or "held", name of a thing).
    """

    def __init__(self, task: TaskDescription, *, table_margin: float = TABLE_MARGIN, margin: float = OBJECT_MARGIN):
        self.allowed: tuple[tuple[str, str], ...] = task.touching
        self._task, self._held, self._margin = task, None, margin
        self._fixed = tuple(replace(f, margin=table_margin) if f.name == TABLE else f for f in task.fixtures)
        self._poses = np.full((len(task.objects) + len(task.furniture), 7), np.inf)
        self._intruders = np.zeros((task.obstacles, 15))
        self._things: tuple[Obstacle, ...] = ()
        self._seen: tuple[Obstacle, ...] = ()

    def allow(self, contacts: Sequence[tuple[str, str]]) -> None:
        """The contacts that are wanted from now on, besides those that nobody needs to look at."""
        self.allowed = (*self._task.touching, *contacts)

    def name(self, index: int) -> str:
        """Of an object."""
        return self._task.objects[index].name

    def set_margin(self, margin: float) -> None:
        """The distance [m] to keep from objects and furniture from now on."""
        self._margin = margin
        self._poses[:] = np.inf

    def exclude(self, index: int | None) -> None:
        """From now on an object is in the hand, or none is."""
        self._held = index
        self._poses[:] = np.inf

    def obstacles(self, observation: Observation) -> tuple[Obstacle, ...]:
        """The obstacles as observed; the same tuple while nothing has moved."""
        poses = self._places(observation)
        moved = np.abs(poses - self._poses).max(axis=1) > MOVED
        if self._held is not None:
            moved[self._held] = np.isinf(self._poses[self._held, 0])
        intruders = np.column_stack([observation[key].reshape(len(self._intruders), -1) for key in MAX_OBSTACLES])
        if moved.any():
            self._poses[:] = poses
            self._things = self._standing(poses, self._held)
        if moved.any() or (intruders != self._intruders).any():
            self._intruders = intruders
            self._seen = (*self._things, *obstacles_in(observation))
        return self._seen

    def obstacles_if_holding(self, observation: Observation, held: int | None) -> tuple[Obstacle, ...]:
        """The obstacles as observed, if an object were in the hand."""
        return (*self._standing(self._places(observation), held), *obstacles_in(observation))

    def _places(self, observation: Observation) -> np.ndarray:
        """Poses (n, 7) of all objects and furniture."""
        if not self._task.furniture:
            return observation["object_pose"]
        return np.concatenate([observation["object_pose"], observation["furniture_pose"]])

    def _standing(self, poses: np.ndarray, held: int | None) -> tuple[Obstacle, ...]:
        objects, furniture, margin = self._task.objects, self._task.furniture, self._margin
        obstacles_if_holding = [
            Obstacle(each.shape, Pose.from_vector(pose), name=each.name, margin=margin)
            for k, (each, pose) in enumerate(zip(objects, poses, strict=False))
            if k != held
        ]
        for each, pose in zip(furniture, poses[len(objects) :], strict=True):
            obstacles_if_holding += [replace(part, margin=margin) for part in each.at(Pose.from_vector(pose))]
        return (*self._fixed, *obstacles_if_holding)


def obstacles_in(observation: Observation) -> tuple[Obstacle, ...]:
    """What is in the way, as observed."""
    found = []
    for slot in np.flatnonzero(observation["obstacle_active"]):
        pose, velocity = Pose.from_vector(observation["obstacle_pose"][slot]), observation["obstacle_velocity"][slot]
        shape = _shape(int(observation["obstacle_shape"][slot]), observation["obstacle_size"][slot])
        found.append(Obstacle(shape, pose, velocity, f"obstacle{slot}"))
    return tuple(found)


def _shape(kind: int, size: np.ndarray) -> Shape:
    """The shape of an observed obstacle; see the observation's `obstacle_shape` and `obstacle_size`."""
    if kind == 2:
        return Box((float(size[0]), float(size[1]), float(size[2])))
    return Sphere(float(size[0])) if kind == 1 else Capsule(float(size[0]), float(size[2]))
