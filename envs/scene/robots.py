"""The robots: what robosuite does not say of them, or does not say for this table.

Joint speed limits are the makers': Franka Research 3 / Panda data sheet, Rethink's hardware specifications of Baxter
and Sawyer, KUKA LBR iiwa 7 R800, Universal Robots UR5e, Kinova Gen3.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from ...planner.errors import BadOption, UnknownName

Joints = tuple[float, ...]
Places = TypeVar("Places")


@dataclass(frozen=True)
class Robot:
    """A robot that stands at the table.

    Attributes:
        speeds: (dof,) largest joint speeds [rad/s].
        grip: widths [m] of what the gripper can hold: from what its pads close on to what passes between them.
        opening: widest gap between the pads of its gripper [m].
        ready: per arm the joints [rad] from which the table is reached well; the first arm is the usual one.
        stand: x of its base [m]; None: where robosuite puts it.
        beside: how far [m] the base stands beside the table's middle line when one of two arms works, so that this
            arm's shoulder is on it.
        reach: (nearest, farthest) [m] from the arm's first axis at which the hand can point straight down at the table.
        gripper: robosuite's name of it; "default" for the robot's own. Robotiq's two-finger grippers, as robosuite
            models them, fold up when they are closed on a block: what comes with them here holds a Panda's gripper.
        parked: per arm the joints [rad] at which it does nothing; only of robots with two.
    """

    speeds: Joints
    grip: tuple[float, float]
    opening: float
    ready: dict[str, Joints]
    stand: float | None = None
    beside: float = 0.0
    reach: tuple[float, float] = (0.32, 0.70)
    gripper: str = "default"
    parked: dict[str, Joints] = field(default_factory=dict)

    def check_grip(self, width: float, name: str, thing: str) -> None:
        """Refuse a robot whose gripper cannot hold a thing of some width [m].

        Raises:
            BadOption: its gripper cannot.
        """
        low, high = self.grip
        if not low <= width <= high:
            can = f"its gripper holds {1e3 * low:.0f} to {1e3 * high:.0f} mm"
            raise BadOption("robot", f"{name} cannot hold {thing}, {1e3 * width:.0f} mm wide: {can}")

    def place(self, arms: tuple[str, ...]) -> tuple[float | None, float]:
        """X (None: robosuite's) and y [m] of the base, for the arms that work."""
        alone = len(self.ready) == 2 and len(arms) == 1
        side = 1.0 if next(iter(self.ready)) in arms else -1.0
        return self.stand, side * self.beside if alone else 0.0

    def checked_arms(self, arms: str | tuple[str, ...] | None, name: str) -> tuple[str, ...]:
        """The names of the arms that work, in order; None: the usual one.

        Raises:
            BadOption: this robot has no such arm.
        """
        wanted = (next(iter(self.ready)),) if arms is None else (arms,) if isinstance(arms, str) else arms
        for arm in wanted:
            if arm not in self.ready:
                raise BadOption("arm", f"{name} has no arm {arm!r}; it has: {', '.join(self.ready)}")
        return wanted


PANDA_READY = (0.0, np.pi / 16.0, 0.0, -np.pi / 2.0 - np.pi / 3.0, 0.0, np.pi - 0.2, np.pi / 4)
PANDA_GRIP, RETHINK_GRIP = ((0.002, 0.075), 0.079), ((0.016, 0.056), 0.0601)
"""What the two grippers can hold and how far they open [m]."""
ROBOTS = {
    "Panda": Robot((2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61), *PANDA_GRIP, {"right": PANDA_READY}),
    "Baxter": Robot(
        (2.0, 2.0, 2.0, 2.0, 4.0, 4.0, 4.0),
        *RETHINK_GRIP,
        {
            "right": (0.205, -1.095, 0.779, 1.885, -0.408, 0.946, 0.387),
            "left": (-0.205, -1.095, -0.779, 1.885, 0.408, 0.946, -0.387),
        },
        stand=-0.6,
        beside=0.2594,
        reach=(0.34, 0.74),
        parked={
            "right": (-0.9, 0.9, 0.0, 0.3, 0.0, 0.3, 0.0),
            "left": (0.9, 0.9, 0.0, 0.3, 0.0, 0.3, 0.0),
        },
    ),
    "Sawyer": Robot(
        (1.74, 1.328, 1.957, 1.957, 3.485, 3.485, 4.545),
        *RETHINK_GRIP,
        {"right": (0.354, -0.583, -0.9, 1.825, 1.02, 0.875, 0.686)},
    ),
    "IIWA": Robot(
        (1.71, 1.71, 1.75, 2.27, 2.44, 3.14, 3.14),
        *PANDA_GRIP,
        {"right": (0.0, 0.56, 0.0, -1.529, 0.0, 1.052, 0.0)},
        gripper="PandaGripper",
    ),
    "UR5e": Robot(
        (3.14, 3.14, 3.14, 3.14, 3.14, 3.14),
        *PANDA_GRIP,
        {"right": (-0.47, -1.735, 2.48, -2.275, -1.59, -1.991)},
        gripper="PandaGripper",
    ),
    "Kinova3": Robot(
        (1.39, 1.39, 1.39, 1.39, 1.22, 1.22, 1.22),
        *PANDA_GRIP,
        {"right": (-0.057, 0.722, 0.023, 1.312, -0.017, 1.108, -1.603)},
        gripper="PandaGripper",
    ),
}
"""By robosuite's names."""


def robot_named(name: object) -> Robot:
    """The robot of a name.

    Raises:
        UnknownName: no such robot is supported.
    """
    if not isinstance(name, str) or name not in ROBOTS:
        raise UnknownName("robot", name, ROBOTS)
    return ROBOTS[name]


def places_of(table: Mapping[str, Places | str], robot: object, task: str) -> Places:
    """Where a robot does a task.

    Args:
        table: by robot its places, or the reason that it has none.
        robot: its name.
        task: what it is to do, for messages.

    Raises:
        UnknownName: no such robot.
        BadOption: it is known, but cannot do this.
    """
    robot_named(robot)
    found = table.get(str(robot), "no places were made for it")
    if isinstance(found, str):
        raise BadOption("robot", f"{robot} cannot {task}: {found}")
    return found
