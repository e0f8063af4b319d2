"""Robot data that robosuite lacks: speed limits, grip range, postures for this table.

Joint speed limits are the manufacturers': Franka Research 3 / Panda data sheet, Rethink's hardware specifications of
Baxter and Sawyer, KUKA LBR iiwa 7 R800, Universal Robots UR5e, Kinova Gen3 and Jaco² (7 joints), UFACTORY xArm 7.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, NamedTuple, TypeVar

import numpy as np

from ...planner.errors import BadOption, UnknownName, told_apart

Joints = tuple[float, ...]
Places = TypeVar("Places")


class Reach(NamedTuple):
    """Distances [m] from an arm's first axis at which its hand can point straight down, 0.1 rad off all joint limits.

    Attributes:
        nearest: least distance of a block that is grasped on the table and lifted by 10 cm.
        farthest: largest distance of such a block.
        stack: largest distance of a stack on which a third block is put.
    """

    nearest: float
    farthest: float
    stack: float


WHOLE_TABLE = Reach(0.32, 0.70, 0.80)
"""A reach that includes every place of a stack."""


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot at the table.

    Attributes:
        name: robosuite's name.
        speeds: (dof,) largest joint speeds [rad/s].
        grip: least and largest width [m] of an object that the gripper can hold: the pads close on it, yet it fits
            between.
        opening: widest gap between the gripper's pads [m].
        ready: start joints [rad] per arm, from which the table is well in reach; the first arm is the default.
        stand: x of the base [m]; None: robosuite's place.
        beside: lateral offset [m] of the base from the table's center line when one of two arms works, which puts this
            arm's shoulder on the line.
        reach: where the hand can point straight down.
        gripper: robosuite's name of the gripper; "default" for the robot's own. robosuite's models of Robotiq's
            two-finger grippers fold up when closed on a block: robots that come with one hold a Panda's gripper here.
        parked: joints [rad] per arm while it is idle; only for robots with two arms.
    """

    name: str
    speeds: Joints
    grip: tuple[float, float]
    opening: float
    ready: dict[str, Joints]
    stand: float | None = None
    beside: float = 0.0
    reach: Reach = WHOLE_TABLE
    gripper: str = "default"
    parked: dict[str, Joints] = field(default_factory=dict)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle a supported robot by its name: it is the same everywhere."""
        if ROBOTS.get(self.name) is self:
            return robot_named, (self.name,)
        if WITH_PANDA_GRIPPER.get(self.name) is self:
            return robot_with_gripper, (self.name, self.gripper)
        return type(self), tuple(getattr(self, each.name) for each in fields(self))

    def check_grip(self, width: float, thing: str) -> None:
        """Refuse a robot whose gripper cannot hold an object of a given width.

        Args:
            width: width of the object [m].
            thing: name of the object, for the message.

        Raises:
            BadOption: the gripper cannot hold the object.
        """
        low, high = self.grip
        if not low <= width <= high:
            wide, _ = told_apart(1e3 * width, 1e3 * (low if width < low else high), 0)
            can = f"its gripper holds {1e3 * low:g} to {1e3 * high:g} mm"
            raise BadOption("robot", f"{self.name} cannot hold {thing}, {wide} mm wide: {can}")

    def place(self, arms: tuple[str, ...]) -> tuple[float | None, float]:
        """Return x (None: robosuite's) and y [m] of the base for the given working arms."""
        alone = len(self.ready) == 2 and len(arms) == 1
        side = 1.0 if next(iter(self.ready)) in arms else -1.0
        return self.stand, side * self.beside if alone else 0.0

    def checked_arms(self, arms: str | tuple[str, ...] | None) -> tuple[str, ...]:
        """Return the names of the working arms, in order.

        Args:
            arms: name or names of the arms; None: the default arm.

        Raises:
            BadOption: the robot has no such arm.
        """
        wanted = (next(iter(self.ready)),) if arms is None else (arms,) if isinstance(arms, str) else arms
        for arm in wanted:
            if arm not in self.ready:
                raise BadOption("arm", f"{self.name} has no arm {arm!r}; it has: {', '.join(self.ready)}")
        return wanted


PANDA_READY = (0.0, np.pi / 16.0, 0.0, -np.pi / 2.0 - np.pi / 3.0, 0.0, np.pi - 0.2, np.pi / 4)
PANDA_GRIP, RETHINK_GRIP = ((0.002, 0.075), 0.079), ((0.016, 0.056), 0.0601)
"""Grip ranges and widest openings of the two grippers [m]."""
ROBOTS: dict[str, Robot] = {
    robot.name: robot
    for robot in (
        Robot("Panda", (2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61), *PANDA_GRIP, {"right": PANDA_READY}),
        Robot(
            "Baxter",
            (2.0, 2.0, 2.0, 2.0, 4.0, 4.0, 4.0),
            *RETHINK_GRIP,
            {
                "right": (0.205, -1.095, 0.779, 1.885, -0.408, 0.946, 0.387),
                "left": (-0.205, -1.095, -0.779, 1.885, 0.408, 0.946, -0.387),
            },
            stand=-0.6,
            beside=0.2594,
            reach=Reach(0.34, 0.74, 0.80),
            parked={
                "right": (-0.9, 0.9, 0.0, 0.3, 0.0, 0.3, 0.0),
                "left": (0.9, 0.9, 0.0, 0.3, 0.0, 0.3, 0.0),
            },
        ),
        Robot(
            "Sawyer",
            (1.74, 1.328, 1.957, 1.957, 3.485, 3.485, 4.545),
            *RETHINK_GRIP,
            {"right": (0.354, -0.583, -0.9, 1.825, 1.02, 0.875, 0.686)},
        ),
        Robot(
            "IIWA",
            (1.71, 1.71, 1.75, 2.27, 2.44, 3.14, 3.14),
            *PANDA_GRIP,
            {"right": (0.0, 0.56, 0.0, -1.529, 0.0, 1.052, 0.0)},
            reach=Reach(0.44, 0.70, 0.80),
            gripper="PandaGripper",
        ),
        Robot(
            "UR5e",
            (3.14, 3.14, 3.14, 3.14, 3.14, 3.14),
            *PANDA_GRIP,
            {"right": (-0.47, -1.735, 2.48, -2.275, -1.59, -1.991)},
            gripper="PandaGripper",
        ),
        Robot(
            "Kinova3",
            (1.39, 1.39, 1.39, 1.39, 1.22, 1.22, 1.22),
            *PANDA_GRIP,
            {"right": (-0.057, 0.722, 0.023, 1.312, -0.017, 1.108, -1.603)},
            reach=Reach(0.32, 0.66, 0.68),
            gripper="PandaGripper",
        ),
        Robot(
            "XArm7",
            (3.14, 3.14, 3.14, 3.14, 3.14, 3.14, 3.14),
            *PANDA_GRIP,
            {"right": (0.0, 0.195, 0.0, 0.974, 0.0, 0.779, 0.0)},
            reach=Reach(0.32, 0.66, 0.68),
            gripper="PandaGripper",
        ),
        Robot(
            "Jaco",
            (0.628, 0.628, 0.628, 0.628, 0.837, 0.837, 0.837),
            *PANDA_GRIP,
            {"right": (0.0, 2.482, 0.0, 4.798, 0.0, 2.316, 0.0)},
            reach=Reach(0.32, 0.64, 0.67),
            gripper="PandaGripper",
        ),
    )
}
"""Supported robots by robosuite's names."""
WITH_PANDA_GRIPPER: dict[str, Robot] = {
    "Sawyer": replace(ROBOTS["Sawyer"], grip=PANDA_GRIP[0], opening=PANDA_GRIP[1], gripper="PandaGripper")
}
"""One-armed robots that hold a Panda's gripper only on request."""
OWN_GRIPPERS = {"Panda": "PandaGripper", "Sawyer": "RethinkGripper"}
"""robosuite's names of the grippers that are a robot's own."""


def robot_named(name: object) -> Robot:
    """Return the robot with a given name.

    Raises:
        UnknownName: no such robot is supported.
    """
    if not isinstance(name, str) or name not in ROBOTS:
        raise UnknownName("robot", name, ROBOTS)
    return ROBOTS[name]


def grippers_of(robot: Robot) -> tuple[str, ...]:
    """Return robosuite's names of the grippers that a robot can hold, its usual one first."""
    usual = OWN_GRIPPERS.get(robot.name, robot.gripper)
    return (usual, "PandaGripper") if robot.name in WITH_PANDA_GRIPPER else (usual,)


def robot_with_gripper(name: object, gripper: object) -> Robot:
    """Return the robot with a given name and gripper.

    Args:
        name: robosuite's name of the robot.
        gripper: robosuite's name of the gripper.

    Raises:
        UnknownName: no such robot is supported, or it holds no such gripper.
    """
    robot = robot_named(name)
    known = grippers_of(robot)
    if not isinstance(gripper, str) or gripper not in known:
        raise UnknownName(f"gripper of {robot.name}", gripper, known)
    return robot if gripper == known[0] else WITH_PANDA_GRIPPER[robot.name]


def places_of(table: Mapping[str, Places | str], robot: Robot, task: str) -> Places:
    """Return the places where a robot does a task.

    Args:
        table: places by robot, or the reason why a robot has none.
        robot: the robot.
        task: task in words, for the message.

    Raises:
        BadOption: the robot cannot do this task.
    """
    found = table.get(robot.name, "no places were made for it")
    if isinstance(found, str):
        raise BadOption("robot", f"{robot.name} cannot {task}: {found}")
    return found
