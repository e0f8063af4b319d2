"""Static description of a task: everything a policy may know before the first observation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...planner import Arm, Body, Obstacle, Pose, Shape
from ..scene.robot_description import robot_parts
from ..scene.scene_objects import TABLE_HEIGHT, CompoundBody, FreeThing, Furniture, SceneSpec, extents
from ..simulation.simulation import Simulation

SLOTS = 3
"""Largest number of obstacles at once."""
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
"""Possible failure reasons of an episode, in `info["failure_reason"]` and in reports."""


@dataclass(frozen=True, slots=True)
class TaskObject:
    """A movable object of the scene.

    Attributes:
        name: unique name.
        shape: shape of the object, or its hull, in the object's frame; a hull need not be centered on it.
        yaw_symmetry: smallest yaw [rad] after which the object looks the same; 2 pi without symmetry, 0 for a round
            object.
        parts: convex solids in the object's frame that the object consists of; (): its one shape.
    """

    name: str
    shape: Shape
    yaw_symmetry: float
    parts: tuple[Obstacle, ...] = ()

    def __post_init__(self):
        if not self.parts:
            object.__setattr__(self, "parts", (Obstacle(self.shape, name=self.name),))

    @staticmethod
    def of(thing: FreeThing) -> TaskObject:
        """Describe a movable object of a scene."""
        solids = thing.parts if isinstance(thing, CompoundBody) else ()
        parts = tuple(Obstacle(part.shape, part.pose, name=thing.name) for part in solids)
        return TaskObject(thing.name, thing.shape, thing.yaw_symmetry, parts)

    @property
    def size(self) -> np.ndarray:
        """(3,) full extents [m] along the object's own axes."""
        return extents(self.shape)

    @property
    def symmetric_yaws(self) -> tuple[float, ...]:
        """Yaws [rad] in [0, 2 pi) after which the object looks the same; (0,) for a round object."""
        if self.yaw_symmetry == 0.0:
            return (0.0,)
        return tuple(np.arange(round(2 * np.pi / self.yaw_symmetry)) * self.yaw_symmetry)

    def at(self, pose: Pose) -> tuple[Obstacle, ...]:
        """Return the solids in the world frame for a given pose of the object."""
        return tuple(Obstacle(part.shape, pose @ part.pose, name=self.name) for part in self.parts)


@dataclass(frozen=True, slots=True)
class TaskFurniture:
    """Furniture: fixed within an episode, possibly moved between episodes, or a part that turns on a hinge.

    Attributes:
        name: unique name.
        parts: solids in the furniture's frame; none where it is only the frame of an assembly.
        assembly: name of the furniture that it is a part of, as a latch is of its door; "" if it stands by itself.
    """

    name: str
    parts: tuple[Obstacle, ...]
    assembly: str = ""

    @staticmethod
    def of(thing: Furniture) -> TaskFurniture:
        """Describe a piece of furniture of a scene."""
        return TaskFurniture(
            thing.name, tuple(Obstacle(part.shape, part.pose, name=thing.name) for part in thing.parts)
        )

    def at(self, pose: Pose) -> tuple[Obstacle, ...]:
        """Return the solids in the world frame for a given pose of the furniture."""
        return tuple(Obstacle(part.shape, pose @ part.pose, name=part.name) for part in self.parts)


@dataclass(frozen=True, slots=True)
class TaskDescription:
    """Constant facts about a task: robot, time step, objects, table.

    Attributes:
        name: task name ("stack").
        robot: robosuite's name of the robot.
        arms: kinematic chains, one per arm, in the order of the observation; world frame as observed.
        control_dt: time between actions [s].
        objects: movable objects in the order of `object_pose`.
        bodies: capsules that contain the arms, grippers included, one body per arm; see `planner.robot.body`.
        table_height: z of the table top [m].
        fixtures: solids that never move: the table (named "table") and the robot's stand, without the floor.
        gripper_width: largest distance between the finger pads [m], one per arm.
        furniture: furniture in the order of `furniture_pose`.
        touching: pairs (body part, fixture) exempt from collision checks, such as a shoulder and the trunk it sits in.
        obstacles: largest number of obstacles, the length of `obstacle_active`.
        control_mode: meaning of an action; see the environment.
        scene_joints: joints of the scene that are not the robot's, like a door's hinge, in the order of
            `scene_joint_positions`.
        skill: the demonstrated skill, if the task's author has written it; None: to be found in the demonstration.
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
    scene_joints: tuple[str, ...] = ()
    skill: Any = None


def described_scene(
    sim: Simulation, name: str, things: SceneSpec, dt: float, control_mode: str, skill: Any
) -> TaskDescription:
    """Return the description of a task whose scene consists of a robot and things at the table.

    Args:
        sim: simulation of the scene.
        name: of the task.
        things: contents of the scene besides the robot.
        dt: time between actions [s].
        control_mode: meaning of an action.
        skill: see `TaskDescription`.
    """
    parts, arms = robot_parts(sim.scene), tuple(index.arm for index in sim.scene.arms)
    return TaskDescription(
        name=name,
        robot=sim.scene.robot.name,
        arms=arms,
        control_dt=dt,
        objects=tuple(TaskObject.of(each) for each in things.objects),
        bodies=parts.bodies,
        table_height=TABLE_HEIGHT,
        fixtures=parts.fixtures,
        gripper_width=tuple(sim.widest_opening(k) for k in range(len(arms))),
        furniture=tuple(TaskFurniture.of(each) for each in things.furniture),
        touching=parts.touching,
        obstacles=SLOTS,
        control_mode=control_mode,
        skill=skill,
    )
