"""Ranges of starts and places of goals, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ...planner import Pose
from .things import UPRIGHT, Quaternion, Triple

Pair = tuple[float, float]
NAMES = ("L0", "L1", "L2")
"""Names of the ranges, see `envs.core.levels`; nothing is moved at L0."""


@dataclass(frozen=True)
class Range:
    """Where a thing, or a goal, stands on the table, and how far it is moved at a level.

    Attributes:
        place: nominal position (x, y) of its frame [m]; the middle of the table is (0, 0), the robot stands at
            x = -0.56.
        yaw: nominal turn about the vertical [rad].
        height: height of its lowest point above the table [m].
        rotation: quaternion wxyz of how it lies before it is turned by the yaw.
        shift: largest shift at L1 and at L2 [m]: of x and y alike, or a pair (x, y) for each level.
        turn: largest turn at L1 and at L2 [rad].
        robots: other nominal positions for some robots, by robosuite's name.
    """

    place: Pair
    yaw: float = 0.0
    height: float = 0.0
    rotation: Quaternion = UPRIGHT
    shift: tuple[float | Pair, float | Pair] = (0.0, 0.0)
    turn: Pair = (0.0, 0.0)
    robots: Mapping[str, Pair] = field(default_factory=dict)

    def nominal(self, robot: str) -> np.ndarray:
        """Return the nominal position (2,) [m] for a robot."""
        return np.array(self.robots.get(robot, self.place), dtype=np.float64)

    def reach(self, layout: str) -> tuple[np.ndarray, float]:
        """Return the largest shift (2,) [m] and turn [rad] at a layout."""
        index = NAMES.index(layout)
        if index == 0:
            return np.zeros(2), 0.0
        return np.broadcast_to(np.asarray(self.shift[index - 1], dtype=np.float64), (2,)), float(self.turn[index - 1])


@dataclass(frozen=True)
class At:
    """A goal relative to another thing.

    Attributes:
        thing: name of a movable thing or a fixture.
        at: position (x, y, z) [m] of the object's frame in that of the thing; None: standing on top of its middle.
        rotation: quaternion wxyz of the object in the thing's frame.
    """

    thing: str
    at: Triple | None = None
    rotation: Quaternion = UPRIGHT


def pose_at(place: np.ndarray, yaw: float, where: Range, lowest: float, table: float) -> Pose:
    """Return the pose of a thing in a range.

    Args:
        place: (2,) x, y of its frame [m].
        yaw: its turn about the vertical [rad].
        where: the range.
        lowest: height [m] of its lowest point relative to its frame, as it lies.
        table: height of the table [m].
    """
    turned = Pose.from_yaw([*place, table + where.height - lowest], yaw)
    return turned @ Pose.from_position_quaternion([0.0, 0.0, 0.0], where.rotation)
