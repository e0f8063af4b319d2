"""Starts and goals of a user's own task, drawn from its ranges."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ...planner import Pose
from ...planner.geometry.hulls import corner_points
from ..scene.robots import ROBOTS, Reach
from ..scene.scene_objects import TABLE_HEIGHT
from .places import At, Range, pose_at
from .task import TABLE_EDGE, Task

JOINTS = {"L0": 0.0, "L1": 0.05, "L2": 0.15}
"""Largest change of a start joint [rad], by layout."""


class TaskLayout(NamedTuple):
    """Drawn places.

    Attributes:
        objects: (n, 7) poses of the objects.
        fixtures: (m, 7) poses of the fixtures.
        goals: (g, 7) goals, in the order of the task.
    """

    objects: np.ndarray
    fixtures: np.ndarray
    goals: np.ndarray


class Heights(NamedTuple):
    """Vertical extent [m] of a thing relative to its frame, as it lies.

    Attributes:
        low: of its lowest point.
        high: of its highest point.
        middle: (2,) x, y of the middle of its outline.
    """

    low: float
    high: float
    middle: np.ndarray


class TaskLayouts:
    """Source of layouts of a task for a robot.

    Args:
        task: the task.
        robot: robosuite's name of the robot.
        axis: (2,) x, y of the arm's first axis [m].
        reach: reach of the arm.

    Raises:
        BadTask: a nominal place is out of the robot's reach.
    """

    def __init__(self, task: Task, robot: str, axis: np.ndarray, reach: Reach):
        self.task, self._robot, self._axis, self._reach = task, robot, axis, reach
        things = [each.body.parts for each in task.objects] + [each.furniture.parts for each in task.fixtures]
        self._corners = {
            name: np.vstack([corner_points(part.shape) @ part.pose.rotation.T + part.pose.position for part in parts])
            for name, parts in zip(task.names, things, strict=True)
        }
        # where something is only put, the hand does not go down as far
        self._farthest = {goal.thing: reach.stack for goal in task.goals.values() if isinstance(goal, At)}
        self._farthest |= {each.name: reach.farthest for each in task.objects}
        for name, where in (*task.start.items(), *task.goals.items()):
            for known in where.robots if isinstance(where, Range) else ():
                if known not in ROBOTS:
                    raise task.bad("start", f"of {name!r} names an unknown robot {known!r}; known: {', '.join(ROBOTS)}")
            if isinstance(where, Range) and where is task.goals.get(name):
                self._check_reach("goals", name, where, reach.stack)
            elif isinstance(where, Range) and name in self._farthest:
                self._check_reach("start", name, where, self._farthest[name])

    def drawn(self, rng: np.random.Generator, layout: str) -> TaskLayout | None:
        """Draw a layout; None if it is off the table or out of reach.

        Args:
            rng: source of randomness.
            layout: "L0", "L1" or "L2".
        """
        task, poses, fits = self.task, {}, True
        for name in task.names:
            pose = self._drawn_pose(rng, layout, name, task.start[name])
            fits = fits and (name not in self._farthest or self._fits(pose, self._farthest[name]))
            poses[name] = pose
        ranges = {name: where for name, where in task.goals.items() if isinstance(where, Range)}
        free = {name: self._drawn_pose(rng, layout, name, where) for name, where in ranges.items()}
        fits = fits and all(self._fits(goal, self._reach.stack) for goal in free.values())
        goals = self._goals(poses, free)
        rows = [np.array([poses[each.name].vector for each in part]).reshape(-1, 7) for part in
                (task.objects, task.fixtures)]  # fmt: skip
        return TaskLayout(rows[0], rows[1], goals) if fits else None

    def goals_for(self, objects: np.ndarray, layout: TaskLayout) -> np.ndarray:
        """Return the goals (g, 7) of a layout whose objects are given.

        Args:
            objects: (n, 7) poses of the objects.
            layout: the layout, with its fixtures.
        """
        rows = [*objects, *layout.fixtures]
        poses = {name: Pose.from_vector(row) for name, row in zip(self.task.names, rows, strict=True)}
        goals = zip(self.task.goals.items(), layout.goals, strict=True)
        free = {name: Pose.from_vector(row) for (name, where), row in goals if isinstance(where, Range)}
        return self._goals(poses, free)

    def passed(self, name: str, poses: Mapping[str, Pose]) -> list[Pose]:
        """Return the poses that an object must pass before its goal.

        Args:
            name: of the object.
            poses: where all things are.
        """
        places = self.task.passes.get(name, ())
        return [poses[where.thing] @ self._relative(name, where) for where in places]

    def _drawn_pose(self, rng: np.random.Generator, layout: str, name: str, where: Range) -> Pose:
        shift, turn = where.reach(layout)
        place = where.nominal(self._robot) + rng.uniform(-shift, shift)
        yaw = where.yaw + rng.uniform(-turn, turn)
        lying = Pose.from_position_quaternion([0.0, 0.0, 0.0], where.rotation)
        return pose_at(place, float(yaw), where, self._heights(name, lying).low, TABLE_HEIGHT)

    def _goals(self, poses: dict[str, Pose], free: dict[str, Pose]) -> np.ndarray:
        """Return the goals (g, 7); a goal at a thing with a goal is where that thing will be."""
        found = dict(free)
        for name in self.task.goals:
            self._resolve(name, poses, found)
        return np.array([found[name].vector for name in self.task.goals]).reshape(-1, 7)

    def _resolve(self, name: str, poses: dict[str, Pose], found: dict[str, Pose]) -> Pose:
        if name in found:
            return found[name]
        where = self.task.goals.get(name)
        if where is None:
            return poses[name]
        assert isinstance(where, At)
        thing = self._resolve(where.thing, poses, found)
        found[name] = thing @ self._relative(name, where)
        return found[name]

    def _relative(self, name: str, where: At) -> Pose:
        """Return `thing_from_object` at the goal."""
        turned = Pose.from_position_quaternion([0.0, 0.0, 0.0], where.rotation)
        if where.at is not None:
            return Pose.from_position_quaternion(where.at) @ turned
        flat = Pose.from_position_quaternion([0.0, 0.0, 0.0])
        below, above = self._heights(where.thing, flat), self._heights(name, turned)
        return Pose.from_position_quaternion([*(below.middle - above.middle), below.high - above.low]) @ turned

    def _heights(self, name: str, lying: Pose) -> Heights:
        corners = self._corners[name] @ lying.rotation.T
        low, high = corners.min(axis=0), corners.max(axis=0)
        return Heights(float(low[2]), float(high[2]), 0.5 * (low + high)[:2])

    def _fits(self, pose: Pose, farthest: float) -> bool:
        place = pose.position[:2]
        away = float(np.linalg.norm(place - self._axis))
        return self._reach.nearest <= away <= farthest and bool(np.abs(place).max() <= TABLE_EDGE)

    def _check_reach(self, key: str, name: str, where: Range, farthest: float) -> None:
        (x, y), robot, nearest = where.nominal(self._robot), self._robot, self._reach.nearest
        away = float(np.hypot(x - self._axis[0], y - self._axis[1]))
        if not nearest <= away <= farthest:
            reason = (
                f"{name!r} at ({x:g}, {y:g}) is {away:.2f} m from the first axis of the {robot}, which reaches from "
            )
            reason += f"{nearest:.2f} to {farthest:.2f} m: move it, or write robots={{{robot!r}: (x, y)}}"
            raise self.task.bad(key, reason)
