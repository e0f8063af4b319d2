"""Where a hand must end to fetch and to pour, for glasses anywhere, from where it ended in the demonstration.

The end of the carry is where the demonstrated lip was, seen from the demonstrated rim, so that glasses of other
sizes, held at other heights, need no other demonstration. A round glass looks the same from everywhere: each turn
about its axis gives another goal.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...envs.core.description import TaskDescription
from ...envs.pour.geometry import SOURCE, TARGET
from ...planner.errors import PlanFailed
from ...planner.geometry.pose import Pose
from ...planner.imitation.demonstration import Demonstration


class Size(NamedTuple):
    """Of a round glass, outside [m]."""

    radius: float
    height: float

    @staticmethod
    def of(extents: np.ndarray) -> Size:
        """Of full extents (3,) along its own axes."""
        return Size(0.5 * float(extents[0]), float(extents[2]))


def standing(pose: Pose) -> Pose:
    """The frame of a round glass that stands: its turn about the vertical says nothing."""
    return Pose.from_position_quaternion(pose.position)


def turned_like(held: Pose, shown: Pose) -> Pose:
    """A round glass in the hand, turned about its own axis to be as near as possible to how another is held."""
    return held @ Pose.from_yaw([0, 0, 0], (held.inverse() @ shown).yaw)


def lip_direction(glass: Pose) -> np.ndarray:
    """(2,) direction, in the frame of a tilted glass, of the lowest point of its rim."""
    down = -glass.rotation[2, :2]
    return down / np.linalg.norm(down)


def lip(size: Size, direction: np.ndarray) -> Pose:
    """`glass_from_lip`."""
    return Pose.from_position_quaternion([*(size.radius * direction), 0.5 * size.height])


class PourGoals:
    """Where the hand must end, for glasses anywhere, from where it ended in the demonstration.

    Args:
        task: with the sizes of the glasses.
        shown: the demonstration: "carry" ends relative to the target, "approach", if there, relative to the source.
        held: `tcp_from_source` that is taken for the demonstrated one where no "approach" is shown.
    """

    def __init__(self, task: TaskDescription, shown: Demonstration, held: Pose | None):
        self._sizes = [Size.of(each.size) for each in task.objects]
        names = [segment.name for segment in shown.segments]
        if "approach" in names:
            source = standing(shown.segment("approach").reference_pose)
            self._hand = source.inverse() @ shown.segment_path("approach")[-1]
            held = self._hand.inverse()
        if held is None:
            raise PlanFailed("plan_failed", "the demonstration shows no approach, and the source is not in the hand")
        self.held, sizes = held, [Size.of(shown.object_sizes[each.name]) for each in task.objects]
        end = shown.segment_path("carry")[-1] @ held
        self._direction = lip_direction(end)
        rim = _rim(shown.segment("carry").reference_pose, sizes[TARGET])
        self._rim_from_lip = rim.inverse() @ end @ lip(sizes[SOURCE], self._direction)

    def grasp(self, source: Pose, turn: float) -> Pose:
        """The tcp at a standing source."""
        return Pose.from_yaw(source.position, turn) @ self._hand

    def pouring(self, target: Pose, held: Pose, turn: float) -> Pose:
        """The tcp at the end of the carry, for a source held as `tcp_from_source`."""
        tcp_from_lip = turned_like(held, self.held) @ lip(self._sizes[SOURCE], self._direction)
        rim = _rim(target, self._sizes[TARGET]) @ Pose.from_yaw([0, 0, 0], turn)
        return rim @ self._rim_from_lip @ tcp_from_lip.inverse()


def _rim(target: Pose, size: Size) -> Pose:
    return standing(target) @ Pose.from_position_quaternion([0.0, 0.0, 0.5 * size.height])
