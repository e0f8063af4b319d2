"""Goals of fetching and pouring for glasses anywhere, derived from the demonstrated goals.

The end of the carry is the demonstrated lip in the frame of the demonstrated rim, so that glasses of other
sizes, held at other heights, need no other demonstration. A round glass is axially symmetric: each rotation about its
axis gives another goal.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...envs import TaskDescription
from ...envs.pour.geometry import SOURCE, TARGET
from ...planner import Demonstration, Pose
from ...planner.errors import PlanFailed


class Size(NamedTuple):
    """Outer size of a round glass [m]."""

    radius: float
    height: float

    @staticmethod
    def of(extents: np.ndarray) -> Size:
        """Return the size of full extents (3,) [m] along the glass's own axes."""
        return Size(0.5 * float(extents[0]), float(extents[2]))


def standing(pose: Pose) -> Pose:
    """Return the frame of a standing round glass: its yaw is irrelevant (axial symmetry)."""
    return Pose.from_position_quaternion(pose.position)


def turned_like(held: Pose, shown: Pose) -> Pose:
    """Rotate a round glass in the hand about its own axis to be nearest to another grasp.

    Args:
        held: `tcp_from_glass`.
        shown: `tcp_from_glass` of the other grasp.
    """
    return held @ Pose.from_yaw([0, 0, 0], (held.inverse() @ shown).yaw)


def lip_direction(glass: Pose) -> np.ndarray:
    """Return the direction (2,), in the frame of a tilted glass, of the lowest point of its rim."""
    down = -glass.rotation[2, :2]
    return down / np.linalg.norm(down)


def lip(size: Size, direction: np.ndarray) -> Pose:
    """Return `glass_from_lip`.

    Args:
        size: size of the glass.
        direction: (2,) unit, of the lip in the frame of the glass.
    """
    return Pose.from_position_quaternion([*(size.radius * direction), 0.5 * size.height])


class PourGoals:
    """Goals of the hand for glasses anywhere, derived from the demonstrated goals.

    Args:
        task: task with the sizes of the glasses.
        shown: the demonstration: "carry" ends relative to the target, "approach", if present, relative to the source.
        held: `tcp_from_source` that replaces the demonstrated grasp if there is no "approach".

    Raises:
        PlanFailed: "plan_failed", there is neither an "approach" nor a held source.
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
        """Return the pose of the tcp at a standing source.

        Args:
            source: pose of the source.
            turn: rotation about the source's axis [rad].
        """
        return Pose.from_yaw(source.position, turn) @ self._hand

    def pouring(self, target: Pose, held: Pose, turn: float) -> Pose:
        """Return the pose of the tcp at the end of the carry.

        Args:
            target: pose of the target.
            held: `tcp_from_source`.
            turn: rotation about the target's axis [rad].
        """
        tcp_from_lip = turned_like(held, self.held) @ lip(self._sizes[SOURCE], self._direction)
        rim = _rim(target, self._sizes[TARGET]) @ Pose.from_yaw([0, 0, 0], turn)
        return rim @ self._rim_from_lip @ tcp_from_lip.inverse()


def _rim(target: Pose, size: Size) -> Pose:
    return standing(target) @ Pose.from_position_quaternion([0.0, 0.0, 0.5 * size.height])
