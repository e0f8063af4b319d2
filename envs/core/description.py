"""The static description of a task: what every policy may know before the first observation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...planner.geometry.pose import Pose
from ...planner.geometry.shapes import Obstacle, Shape
from ...planner.robot.arm import Arm
from ...planner.robot.body import Body
from ..scene.scene_objects import Book, FreeBody, Furniture, Glass, extents

FAILURES = (
    "ik_or_limit",
    "collision",
    "timeout",
    "constraint",
    "dropped",
    "plan_failed",
    "blocked",
    "off_table",
)
"""Every reason that an episode may fail for, in `info["failure_reason"]` and in reports."""


@dataclass(frozen=True, slots=True)
class TaskObject:
    """A movable object of the scene.

    Attributes:
        name: unique name.
        shape: it, or the hull of it, centered on its frame.
        yaw_symmetry: smallest yaw [rad] after which the object looks the same; 2 pi if it never does, 0 if it is
            round.
    """

    name: str
    shape: Shape
    yaw_symmetry: float

    @staticmethod
    def of(thing: FreeBody | Glass | Book) -> TaskObject:
        """What a policy may know of a thing."""
        return TaskObject(thing.name, thing.shape, thing.yaw_symmetry)

    @property
    def size(self) -> np.ndarray:
        """(3,) full extents [m] along the object's own axes."""
        return extents(self.shape)

    @property
    def symmetric_yaws(self) -> tuple[float, ...]:
        """All yaws [rad] in [0, 2 pi) after which the object looks the same; (0,) for a round one, which has no end."""
        if self.yaw_symmetry == 0.0:
            return (0.0,)
        return tuple(np.arange(round(2 * np.pi / self.yaw_symmetry)) * self.yaw_symmetry)


@dataclass(frozen=True, slots=True)
class TaskFurniture:
    """What does not move within an episode, but may stand elsewhere in the next.

    Attributes:
        name: unique name.
        parts: its solids, in its own frame.
    """

    name: str
    parts: tuple[Obstacle, ...]

    @staticmethod
    def of(thing: Furniture) -> TaskFurniture:
        """What a policy may know of a thing."""
        return TaskFurniture(
            thing.name, tuple(Obstacle(part.shape, part.pose, name=thing.name) for part in thing.parts)
        )

    def at(self, pose: Pose) -> tuple[Obstacle, ...]:
        """Its solids in the world."""
        return tuple(Obstacle(part.shape, pose @ part.pose, name=part.name) for part in self.parts)


@dataclass(frozen=True, slots=True)
class TaskDescription:
    """What is known and constant: robot, time step, objects, table.

    Attributes:
        name: task name ("stack").
        robot: robosuite's name of the robot.
        arms: one kinematic chain per arm, in the order of the observation; world frame as observed.
        control_dt: seconds between actions.
        objects: in the order of `object_pose`.
        bodies: per arm the capsules that contain it, gripper included; see `planner.body`.
        table_height: z of the table top [m].
        fixtures: what stands still for ever: the table (named "table"), the robot's stand; no floor.
        gripper_width: largest distance between the finger pads [m], one per arm.
        furniture: in the order of `furniture_pose`.
        touching: pairs (part of a body, fixture) that nobody needs to look at: a shoulder and the trunk it sits in.
        obstacles: how many there can be, the length of `obstacle_active`.
        control_mode: what an action means; see the environment.
    """

    name: str
    robot: str
    arms: tuple[Arm, ...]
    control_dt: float
    objects: tuple[TaskObject, ...]
    bodies: tuple[Body, ...]
    table_height: float
    fixtures: tuple[Obstacle, ...]
    gripper_width: tuple[float, ...]
    furniture: tuple[TaskFurniture, ...] = ()
    touching: tuple[tuple[str, str], ...] = ()
    obstacles: int = 0
    control_mode: str = "joint_velocity"
