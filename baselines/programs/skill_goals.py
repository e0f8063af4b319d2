"""Goals of a skill's phases in the scene at hand: every pose that looks like the demonstrated end."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from ...envs import TaskDescription
from ...planner import Pose
from ...planner.skills.skill import Phase
from ..policy import Observation

SAME, SAME_TURN = 0.003, 0.05
"""Distance [m] and angle [rad] up to which two goals are one."""
MOST = 16
"""Largest number of goals that are tried."""


class Places:
    """Poses of the things of a task, by name, as observed.

    Args:
        task: the task.
    """

    def __init__(self, task: TaskDescription):
        self._objects = {each.name: k for k, each in enumerate(task.objects)}
        self._furniture = {each.name: k for k, each in enumerate(task.furniture)}
        self._fixed = {each.name: each.pose for each in task.fixtures}

    def index(self, name: str) -> int:
        """Return the index of an object."""
        return self._objects[name]

    def pose(self, name: str, observation: Observation) -> Pose:
        """Return the pose of a thing in the world.

        Args:
            name: of an object, a piece of furniture or a fixture; "" for the world itself.
            observation: the present one.
        """
        if name in self._objects:
            return Pose.from_vector(observation["object_pose"][self._objects[name]])
        if name in self._furniture:
            return Pose.from_vector(observation["furniture_pose"][self._furniture[name]])
        return self._fixed[name] if name else Pose.identity()


def ends_alike(phase: Phase) -> tuple[Pose, ...]:
    """Return all `reference_from_body` at the end of a phase that look alike, those as shown first, no pose twice."""
    poses = (left @ goal @ right for goal in phase.goals for left in phase.left for right in phase.right)
    return tuple(_distinct(poses, MOST))


def _distinct(poses: Iterable[Pose], most: int) -> Iterator[Pose]:
    known: list[Pose] = []
    for pose in poses:
        if all(gap > SAME or angle > SAME_TURN for gap, angle in (pose.distance_to(other) for other in known)):
            known.append(pose)
            yield pose
            if len(known) == most:
                return
