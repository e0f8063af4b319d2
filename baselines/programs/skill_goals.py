"""Goals of a skill's phases in the scene at hand: every pose that looks like the demonstrated end."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from ...envs import TaskDescription
from ...planner import Pose, PosePath
from ...planner.skills.segments import anchored
from ...planner.skills.skill import Anchor, Pair, Phase
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

    def stands(self, name: str) -> bool:
        """Return whether a thing is furniture, or a part of it."""
        return name in self._furniture

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


def point_of(task: TaskDescription, name: str, anchor: Anchor) -> Pose:
    """Return a point of an object in the object's frame.

    Args:
        task: the task.
        name: of the object.
        anchor: the point, in shares of half the object's size.
    """
    return anchored(anchor, next(each.size for each in task.objects if each.name == name))


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


def level_imitation(path: PosePath, goal: Pose) -> PosePath:
    """Imitate a path that ends at a goal, moved only level: a difference in tilt turns the hand, not the path.

    Args:
        path: the demonstrated path.
        goal: pose of the last one.
    """
    turn = Pose.from_yaw([0.0, 0.0, 0.0], (goal @ path[-1].inverse()).yaw)
    level = Pose.from_position_quaternion(goal.position - (turn @ path[-1]).position) @ turn
    return path.moved(level).with_tool((level @ path[-1]).inverse() @ goal)


def pairs_of(parts: Sequence[str], names: Sequence[str]) -> tuple[Pair, ...]:
    """Return the contacts of every part with every thing.

    Args:
        parts: of the body, or "held".
        names: of the things; "" for none.
    """
    return tuple((part, name) for part in parts for name in names if name)
