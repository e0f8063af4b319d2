"""Shelving from the demonstration of ONE book in the lower shelf: fetch, lift, carry, insert, repeatedly.

Only the goals are new: a grasp is the demonstrated pose of the hand relative to the grasped book, the end of an
insertion is the slot, given the book's pose in the hand, and the end of a carry is the beginning of that insertion.
Lift and retreat are imitated from their starts: both leave objects that must not be dragged along.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...envs import ROBOTS, TaskDescription
from ...planner import Demonstration, Pose, PosePath, imitated_path
from ...planner.errors import PlanFailed
from ...planner.geometry.pose import nearest
from ...planner.imitation.segmentation import resampled
from ...planner.imitation.tsia import screw_path
from ..policy import LabeledPath
from .arm_executor import CLOSE, OFF, OPEN, ArmExecutor
from .goal_choice import ChosenMotion, MotionChoice
from .world_model import FREE_MARGIN, OBJECT_MARGIN

if TYPE_CHECKING:
    from ..motion.settings import ProgramSettings

CUPBOARD, STAND = "cupboard", "stand"
BETWEEN = 0.07
"""Distance [m] of the retreat after which the fingers are no longer between books."""
PACE = 0.6
"""Fraction of the joints' speed limits in use with a book: a book moved faster turns in the hand."""
CHANCES = 3
"""Number of attempts of an insertion, each from another posture."""
PATIENCE = 5.0
"""Time [s] to wait for a book."""


class ShelveProgram:
    """The program of one episode; iterate over `actions()`.

    Args:
        task: the task.
        shown: the demonstration.
        settings: see `ProgramSettings`.
        executor: executor of the arm.
    """

    SEGMENTS = ("approach", "reach", "lift", "carry", "insert", "retreat")
    """Segments required of a demonstration of this task."""
    SIZED: tuple[str, ...] = ()
    """Objects whose sizes a demonstration must give."""
    RELEASE = "insert"
    """Segment after which the recorded gripper decides how far this one opens; "" for none."""

    def __init__(self, task: TaskDescription, shown: Demonstration, settings: ProgramSettings, executor: ArmExecutor):
        self.task, self.shown, self.settings, self.executor = task, shown, settings, executor
        self._parts = {name: resampled(shown.segment_path(name), settings.resample) for name in self.SEGMENTS}
        self._release = _gripper_after(shown, self.RELEASE, task)
        self.paths = [LabeledPath("demonstrated", name, path) for name, path in self._parts.items()]

    def actions(self) -> Iterator[np.ndarray]:
        """Fetch and shelve each book in order, then withdraw; the first book may be in the hand already."""
        in_hand = self.executor.observation["motion_index"][0] == 1.0
        for k in range(len(self.executor.observation["goal_pose"])):
            if in_hand and k == 0:
                yield from self.executor.grip(CLOSE, self.settings.close)
                self.executor.slow_down(PACE)
                self.executor.hold(k, self.task.objects[k].shape, self.executor.tcp_from(k))
            else:
                yield from self._awaited(k)
                yield from self._fetch(k)
                yield from self._lift(k)
            yield from self._shelve(k)
            yield from self._retreat()

    def _awaited(self, k: int) -> Iterator[np.ndarray]:
        """Open the hand, and rise until book k lies on the stand: a book is not handed over under an arm."""
        yield from self.executor.grip(OPEN, self.settings.open)
        out_of_the_way = () if self._on_stand(k) else self.executor.follow(self._rise(), exact=False)
        for action in out_of_the_way:
            yield action
            if self._on_stand(k):
                return
        left = round(PATIENCE / self.task.control_dt)
        while not self._on_stand(k):
            if left == 0:
                raise PlanFailed("timeout", f"{self.task.objects[k].name} was not handed over")
            left -= 1
            yield self.executor.still()

    def _rise(self) -> PosePath:
        """Return a path straight up by the height of the demonstrated lift, in the present orientation of the hand."""
        here, lift = self.executor.arm.fk(self.executor.q), self._parts["lift"]
        height = lift[-1].position[2] - lift[0].position[2]
        up = Pose.from_position_quaternion([0.0, 0.0, height])
        return screw_path(here, up @ here, self.settings.resample)

    def _on_stand(self, k: int) -> bool:
        names = [each.name for each in self.task.furniture]
        return (
            self.executor.object_pose(k).position[2]
            > self.executor.observation["furniture_pose"][names.index(STAND), 2]
        )

    def _fetch(self, k: int) -> Iterator[np.ndarray]:
        reach = self._parts["reach"]
        grasp = self.shown.segment("reach").reference_pose.inverse() @ reach[-1]
        goal = self.executor.object_pose(k) @ grasp
        touching = (*_named_obstacles((self.task.objects[k].name,)), ("fingers", STAND))
        motion = self._motion_choice("approach", k, imitated_path(reach, goal)[0])
        choice = self.executor.choose(motion, lambda _: self._motion_choice("reach", k, goal, touching))
        yield from self._done(choice, motion)
        self.executor.allow(touching)
        yield from self.executor.follow(imitated_path(reach, goal))
        yield from self.executor.wait(self.settings.settle)
        yield from self.executor.grip(CLOSE, self.settings.close)

    def _lift(self, k: int) -> Iterator[np.ndarray]:
        target = self.task.objects[k]
        grasped = self.executor.tcp_from(k)
        self.executor.slow_down(PACE)
        self.executor.hold(k, target.shape, grasped)
        self.executor.allow((("held", STAND), ("fingers", STAND)))
        lift = self._from_here("lift")
        off = int(np.argmax(lift.positions[:, 2] > lift[0].position[2] + OFF))
        yield from self.executor.follow(lift[: off + 1], exact=False, detours=False)
        self.executor.allow(())
        yield from self.executor.follow(lift[off:], exact=False)
        self.executor.lifted()

    def _shelve(self, k: int) -> Iterator[np.ndarray]:
        names = [each.name for each in self.task.objects]
        touching = (("held", CUPBOARD), *_named_obstacles(names[:k] + names[k + 1 :]))
        for chance in range(CHANCES):
            # the book slips a little during the lift: the goal is computed from its present pose in the hand
            held = self.executor.tcp_from(k)
            insertion = self._insertion(k, held)
            into = self._motion_choice("insert", k, insertion[-1], touching, held)._replace(
                demonstrated=insertion, detours=False
            )
            motion, choice = self._chosen_carry(k, insertion[0], held, into)
            yield from self._done(choice, motion)
            self.executor.world_model.set_margin(OBJECT_MARGIN)
            self.executor.allow(touching)
            insertion = self._insertion(k, self.executor.tcp_from(k))
            try:
                yield from self.executor.follow(insertion, detours=False)
                break
            except PlanFailed as failed:
                if chance + 1 == CHANCES or failed.reason == "dropped":
                    raise
            yield from self._backed_out(insertion)
        yield from self.executor.wait(self.settings.settle)
        yield from self.executor.grip(self._release, self.settings.open)
        self.executor.release()
        self.executor.allow(_named_obstacles(names))

    def _backed_out(self, insertion: PosePath) -> Iterator[np.ndarray]:
        """Move back to the beginning of an insertion."""
        here = nearest(insertion, self.executor.arm.fk(self.executor.q))
        if here:
            yield from self.executor.follow(insertion[: here + 1].reversed(), exact=False, detours=False)

    def _chosen_carry(self, k: int, goal: Pose, held: Pose, into: MotionChoice) -> tuple[MotionChoice, ChosenMotion]:
        """Choose a carry to the front of the slot: with a large margin, or with a small one if nothing else works."""
        failure = PlanFailed("ik_or_limit", f"no posture is found from which {into.name} can go straight")
        for margin in (FREE_MARGIN, OBJECT_MARGIN):
            self.executor.world_model.set_margin(margin)
            motion = self._motion_choice("carry", k, goal, held=held)
            try:
                choice = self.executor.choose(motion, lambda _: into)
            except PlanFailed as failed:
                failure = failed
            else:
                if choice.then is not None:
                    return motion, choice
        raise failure

    def _retreat(self) -> Iterator[np.ndarray]:
        """Move straight back: first from between the books, where a detour would push them over."""
        path = self._from_here("retreat")
        free = int(np.argmax(np.linalg.norm(path.positions - path.positions[0], axis=1) > BETWEEN))
        yield from self.executor.follow(path[: free + 1], exact=False, detours=False)
        self.executor.slow_down(1.0)
        self.executor.allow(())
        yield from self.executor.follow(path[free:], exact=False)

    def _insertion(self, k: int, held: Pose) -> PosePath:
        """Return the demonstrated insertion, ending where the released book is in its slot.

        The path stays as level as demonstrated: a book tilted in the hand turns the hand, not the path.
        """
        above, shown = Pose.from_position_quaternion([0.0, 0.0, self.settings.release_height]), self._parts["insert"]
        end = above @ self.executor.goal_pose(k) @ held.inverse()
        turn = Pose.from_yaw([0.0, 0.0, 0.0], (end @ shown[-1].inverse()).yaw)
        level = Pose.from_position_quaternion(end.position - (turn @ shown[-1]).position) @ turn
        return shown.moved(level).with_tool((level @ shown[-1]).inverse() @ end)

    def _from_here(self, name: str) -> PosePath:
        path = self._parts[name]
        return path.moved(self.executor.arm.fk(self.executor.q) @ path[0].inverse())

    def _done(self, choice: ChosenMotion, motion: MotionChoice) -> Iterator[np.ndarray]:
        self.paths.append(LabeledPath("final", motion.name, choice.path))
        self.executor.allow(())
        yield from self.executor.go(choice)

    def _motion_choice(
        self, name: str, k: int, goal: Pose, allowed: tuple[tuple[str, str], ...] = (), held: Pose | None = None
    ) -> MotionChoice:
        """Return a motion with book k, which is in the hand if `held` (`tcp_from_object`) is given."""
        executor, target = self.executor, self.task.objects[k]
        body = executor.empty if held is None else executor.body_with(target.shape, held)
        around = executor.world_model.obstacles_if_holding(executor.observation, None if held is None else k)
        contacts = (*self.task.touching, *allowed)
        return MotionChoice(f"{name} {target.name}", self._parts[name], (goal,), body, around, contacts)


def _named_obstacles(names: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """Return contacts of the hand with books during grasp and release: its capsules contain more than the hand."""
    return tuple((part, name) for part in ("fingers", "hand") for name in names)


def _gripper_after(shown: Demonstration, name: str, task: TaskDescription) -> float:
    """Return the action that opens this gripper as far as the demonstrated one at the end of a motion.

    How wide an unknown robot's gripper opens is unknown: then the action itself is the demonstrated one.
    """
    assert shown.gripper is not None
    action = float(shown.gripper[shown.segment(name).stop + 1])
    if shown.robot == task.robot or shown.robot not in ROBOTS or action >= 0.0:
        return action
    return max(action * ROBOTS[shown.robot].opening / task.gripper_width[0], OPEN)
