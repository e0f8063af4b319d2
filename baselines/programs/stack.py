"""Stacking from the demonstration of ONE block: fetch and place, repeatedly.

Only the goals are new: a grasp is the demonstrated pose of the hand relative to the grasped object, a release
is the goal pose of the object, given its pose in the hand.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from ...envs import TaskDescription, TaskObject
from ...planner import Demonstration, Pose, PosePath
from ...planner.imitation.segmentation import resampled, trimmed
from ...planner.imitation.tsia import departure
from ..policy import LabeledPath
from .arm_executor import CLOSE, OFF, OPEN, ArmExecutor
from .goal_choice import ChosenMotion, MotionChoice
from .world_model import TABLE

if TYPE_CHECKING:
    from ..motion.settings import ProgramSettings


def grasps(demonstration: Demonstration, target: TaskObject) -> list[Pose]:
    """Return all `object_from_tcp` that repeat the demonstrated grasp on an object, one per symmetric yaw.

    The demonstrated grasp is turned so that the fingers close along the object's narrower horizontal axis.

    Args:
        demonstration: demonstration with the segment "approach".
        target: the object.
    """
    object_pose = demonstration.segment("approach").reference_pose
    shown = object_pose.inverse() @ demonstration.segment_path("approach")[-1]
    closing = np.abs(shown.rotation[:2, 0])  # fingers close along the x axis of the tcp
    aligned = int(np.argmax(closing)) == int(np.argmin(target.size[:2]))
    extra = 0.0 if aligned else np.pi / 2
    return [Pose.from_yaw([0, 0, 0], yaw + extra) @ shown for yaw in target.symmetric_yaws]


def releases(target: TaskObject, goal: Pose, tcp_from_object: Pose, height: float) -> list[Pose]:
    """Return all poses of the tcp with the held object above its goal, one per symmetric yaw.

    Args:
        target: the object.
        goal: goal pose of the object.
        tcp_from_object: pose of the object in the hand.
        height: above the goal [m].
    """
    above = Pose.from_position_quaternion([0, 0, height]) @ goal
    return [above @ Pose.from_yaw([0, 0, 0], yaw) @ tcp_from_object.inverse() for yaw in target.symmetric_yaws]


class StackProgram:
    """The program of one episode; iterate over `actions()`.

    Args:
        task: the task.
        shown: the demonstration.
        settings: see `ProgramSettings`.
        executor: executor of the arm.
    """

    SEGMENTS = ("approach", "transfer")
    """Segments required of a demonstration of this task."""
    SIZED: tuple[str, ...] = ()
    """Objects whose sizes a demonstration must give."""
    RELEASE = ""
    """Segment after which the recorded gripper decides how far this one opens; "" for none."""

    def __init__(self, task: TaskDescription, shown: Demonstration, settings: ProgramSettings, executor: ArmExecutor):
        self.task, self.shown, self.settings, self.executor = task, shown, settings, executor
        step = settings.resample
        self.approach = resampled(shown.segment_path("approach"), step)
        self.transfer = resampled(trimmed(shown.segment_path("transfer"), settings.trim), step)
        self.withdrawal = self.approach.reversed()
        self._lifted = len(departure(self.transfer, self.transfer[0], settings.motion.departure)) - 1
        self.paths = [
            LabeledPath("demonstrated", "approach", self.approach),
            LabeledPath("demonstrated", "transfer", self.transfer),
        ]

    def actions(self) -> Iterator[np.ndarray]:
        """Fetch and place each object in order, then withdraw; objects already placed or fetched are not repeated."""
        first, in_hand = divmod(int(self.executor.observation["motion_index"][0]), 2)
        for k in range(first, len(self.task.objects)):
            if in_hand and k == first:
                self.executor.allow(self._wanted(k))
                yield from self.executor.grip(CLOSE, self.settings.close)
            else:
                yield from self._fetch(k)
            yield from self._place(k)
        last = len(self.task.objects) - 1
        away = self.executor.departure_path(self._motion_choice(last, self.approach, (), leaving=self.withdrawal))
        if away is not None:
            yield from self.executor.follow(away, exact=False)

    def _wanted(self, k: int) -> tuple[tuple[str, str], ...]:
        """Return the contacts needed to move object k: of the fingers with it, of both with its support."""
        objects = self.task.objects
        under = [TABLE] + [objects[j].name for j in (k - 1,) if j >= 0]
        own = [("fingers", objects[j].name) for j in (k - 1, k) if j >= 0]
        return (*own, *(("held", name) for name in under))

    def _fetch(self, k: int) -> Iterator[np.ndarray]:
        self.executor.allow(self._wanted(k))
        choice = self._chosen_fetch(k)
        self.paths.append(LabeledPath("final", f"fetch {self.task.objects[k].name}", choice.path))
        yield from self.executor.go(choice)
        yield from self.executor.wait(self.settings.settle)
        yield from self.executor.grip(CLOSE, self.settings.close)

    def _place(self, k: int) -> Iterator[np.ndarray]:
        target = self.task.objects[k]
        grasped = self.executor.tcp_from(k)
        self.executor.hold(k, target.shape, grasped)
        lift = self._lift(k, grasped)
        if lift is not None:
            yield from self.executor.leave(lift, OFF)
        # the object slips a little during the lift: the goal is computed from its present pose in the hand
        held = self.executor.lifted()
        choice = self.executor.choose(self._placement(k, held))
        path = choice.path if lift is None else lift.joined(choice.path)
        self.paths.append(LabeledPath("final", f"place {target.name}", path))
        yield from self.executor.go(choice)
        yield from self.executor.wait(self.settings.settle)
        yield from self.executor.grip(OPEN, self.settings.open)
        self.executor.release()

    def _lift(self, k: int, grasped: Pose) -> PosePath | None:
        """Return the demonstrated lift of an object off its support; None if the object is already in the air."""
        pose, half = self.executor.object_pose(k), 0.5 * float(self.task.objects[k].size[2])
        if pose.position[2] - half > self.task.table_height + OFF:
            return None
        return self.executor.departure_path(self._placement(k, grasped, leaving=self.transfer))

    def _chosen_fetch(self, k: int) -> ChosenMotion:
        """Return the grasp from which the object can also be placed."""
        target, executor = self.task.objects[k], self.executor
        grasp_poses = grasps(self.shown, target)
        goals = tuple(executor.object_pose(k) @ grasp for grasp in grasp_poses)
        motion = self._motion_choice(k, self.approach, goals, leaving=self.withdrawal if k else None)
        return executor.choose(
            motion, lambda index: self._placement(k, grasp_poses[index].inverse(), leaving=self.transfer)
        )

    def _placement(self, k: int, held: Pose, leaving: PosePath | None = None) -> MotionChoice:
        """Return the motion of object k from the hand to its goal."""
        target = self.task.objects[k]
        goals = releases(target, self.executor.goal_pose(k), held, self.settings.release_height)
        return self._motion_choice(k, self.transfer, tuple(goals), held=held, leaving=leaving, done=self._lifted)

    def _motion_choice(
        self,
        k: int,
        demonstrated: PosePath,
        goals: tuple[Pose, ...],
        *,
        held: Pose | None = None,
        leaving: PosePath | None = None,
        done: int = 0,
    ) -> MotionChoice:
        executor, target = self.executor, self.task.objects[k]
        body = executor.empty if held is None else executor.body_with(target.shape, held)
        around = executor.world_model.obstacles_if_holding(executor.observation, None if held is None else k)
        wanted = [
            pair
            for pair in (*self.task.touching, *self._wanted(k))
            if pair[1] in [obstacle.name for obstacle in around]
        ]
        allowed = tuple(pair for pair in wanted if pair[0] in body.names)
        return MotionChoice(target.name, demonstrated, goals, body, around, allowed, leaving, done=done)
