"""The static description of a task: what every policy may know before the first observation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..planner.arm import Arm
from ..planner.body import Body
from ..planner.shapes import Obstacle

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
    """A movable box of the scene.

    Attributes:
        name: unique name.
        size: (3,) full extents [m] along the object's own axes.
        yaw_symmetry: smallest yaw [rad] after which the object looks the same; 2 pi if it never does.
    """

    name: str
    size: np.ndarray
    yaw_symmetry: float

    def __post_init__(self):
        size = np.array(self.size, dtype=np.float64)
        size.flags.writeable = False
        object.__setattr__(self, "size", size)

    @property
    def symmetric_yaws(self) -> tuple[float, ...]:
        """All yaws [rad] in [0, 2 pi) after which the object looks the same."""
        return tuple(np.arange(round(2 * np.pi / self.yaw_symmetry)) * self.yaw_symmetry)


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
