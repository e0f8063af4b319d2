"""Problems of MotionBenchMaker (Chamzas et al., 2022): obstacles, start and goal joints of an arm, and their files.

The shipped file has the 700 problems of the Panda with six digits. Its problems are those of the collection, under its
licence, which lies beside it.
"""

from __future__ import annotations

import json
import lzma
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...configs import BadConfig
from ...configs.shipped_files import FOLDER
from ...planner import Box, Cylinder, Obstacle, Pose, Sphere

SHIPPED = FOLDER / "motionbenchmaker" / "panda.json.xz"
FORMAT_VERSION = 1
DIGITS = 6
"""Digits behind the point of meters, radians and quaternions in a packed file."""


class Problem(NamedTuple):
    """A motion to plan.

    Attributes:
        scene: name of its kind, like "cage".
        number: of the problem within its kind, from 1 on.
        obstacles: in the world.
        start: joint name: position [rad or m], of every joint of the robot.
        goal: joint name: position [rad or m], of the joints that are to move.
    """

    scene: str
    number: int
    obstacles: tuple[Obstacle, ...]
    start: dict[str, float]
    goal: dict[str, float]

    @property
    def key(self) -> tuple[str, int]:
        """Scene and number."""
        return self.scene, self.number

    def joints(self, names: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
        """Return start and goal (dof,) of an arm's joints [rad or m].

        Args:
            names: of the joints, from the base on.

        Raises:
            BadConfig: the problem lacks one of them, or another joint is to move, too.
        """
        where = f"{self.scene} {self.number}"
        for name in names:
            if name not in self.start or name not in self.goal:
                raise BadConfig(where, name, "the arm's joint has no start or no goal in this problem")
        if others := set(self.goal) - set(names):
            raise BadConfig(where, ", ".join(sorted(others)), "has a goal, but is no joint of the arm")
        return np.array([self.start[name] for name in names]), np.array([self.goal[name] for name in names])


def pack_problems(problems: Iterable[Problem]) -> bytes:
    """Return problems as the content of a packed file."""
    rows = [
        {
            "scene": each.scene,
            "number": each.number,
            "obstacles": [_obstacle_row(obstacle) for obstacle in each.obstacles],
            "start": _rounded(each.start),
            "goal": _rounded(each.goal),
        }
        for each in problems
    ]
    text = json.dumps({"format_version": FORMAT_VERSION, "problems": rows}, separators=(",", ":"), allow_nan=False)
    return lzma.compress(text.encode(), preset=9 | lzma.PRESET_EXTREME)


def read_problems(path: Path = SHIPPED) -> list[Problem]:
    """Read a packed file; without a path the shipped one.

    Raises:
        BadConfig: no such file, or no packed problems.
    """
    try:
        table = json.loads(lzma.decompress(path.read_bytes()))
        if table["format_version"] != FORMAT_VERSION:
            raise BadConfig(path, "format_version", f"is {table['format_version']}; known is {FORMAT_VERSION}")
        return [_problem_of(row) for row in table["problems"]]
    except OSError as error:
        raise BadConfig(path, "problems", error.strerror or str(error)) from None
    except (lzma.LZMAError, ValueError, KeyError, TypeError) as error:
        raise BadConfig(path, "problems", f"is no file of packed problems ({error})") from None


def _rounded(values: dict[str, float]) -> dict[str, float]:
    return {name: round(float(value), DIGITS) for name, value in values.items()}


def _obstacle_row(obstacle: Obstacle) -> list[Any]:
    shape = obstacle.shape
    match shape:
        case Box():
            kind, sizes = "box", shape.size
        case Cylinder():
            kind, sizes = "cylinder", (shape.radius, shape.length)
        case Sphere():
            kind, sizes = "sphere", (shape.radius,)
        case _:
            raise BadConfig("problems", obstacle.name, f"is a {type(shape).__name__}; packed are primitives only")
    numbers = [*sizes, *obstacle.pose.position, *obstacle.pose.quaternion]
    return [obstacle.name, kind, *(round(float(value), DIGITS) for value in numbers)]


def _problem_of(row: dict[str, Any]) -> Problem:
    obstacles = tuple(_obstacle_of(*each) for each in row["obstacles"])
    return Problem(row["scene"], int(row["number"]), obstacles, row["start"], row["goal"])


def _obstacle_of(name: str, kind: str, *numbers: float) -> Obstacle:
    shape = primitive(kind, numbers[:-7], name)
    quaternion = np.array(numbers[-4:])
    pose = Pose.from_position_quaternion(numbers[-7:-4], quaternion / np.linalg.norm(quaternion))
    return Obstacle(shape, pose, name=name)


def primitive(kind: str, sizes: Sequence[float], name: str) -> Box | Cylinder | Sphere:
    """Return a shape by its kind.

    Args:
        kind: "box", "cylinder" or "sphere".
        sizes: full extents of a box; radius and length of a cylinder; radius of a sphere [m].
        name: of the obstacle, for the message.

    Raises:
        BadConfig: the kind is another one.
    """
    match kind, tuple(sizes):
        case "box", (x, y, z):
            return Box((x, y, z))
        case "cylinder", (radius, length):
            return Cylinder(radius, length)
        case "sphere", (radius,):
            return Sphere(radius)
    raise BadConfig("problems", name, f"is a {kind} of {len(sizes)} sizes; known are box (3), cylinder (2), sphere (1)")
