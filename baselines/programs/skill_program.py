"""One program for every skill: what a demonstration shows, done in the scene at hand."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from ...envs import TaskDescription
from ...planner import Pose, PosePath
from ...planner.errors import PlanFailed
from ...planner.imitation.segmentation import resampled
from ...planner.imitation.tsia import departure, ending
from ...planner.skills.alike import turned_about
from ...planner.skills.skill import START, Phase, Skill
from ..policy import LabeledPath
from .arm_executor import CLOSE, OFF, OPEN, ArmExecutor
from .goal_choice import ChosenMotion, MotionChoice
from .skill_goals import Places, ends_alike

if TYPE_CHECKING:
    from ..motion.settings import ProgramSettings

TRIES = 3
"""Number of grasps of one object before the program gives up."""
TAILS = (math.inf, 0.06, 0.03)
"""Path lengths [m] at the end of a carry that are imitated: all, or less where the demonstrated way is out of reach."""
LEANS = tuple(np.deg2rad([0.0, 15.0, -15.0, 30.0, -30.0]))
"""Angles [rad] about the line on which the fingers close by which the hand may lean to reach farther."""
RAISED = (0.0, 0.003, 0.006, 0.010, 0.015)
"""Heights [m] above the demonstrated grasp that are tried: another hand, or another object, leaves less room."""
HAND = ("fingers", "hand")
"""Parts of the body that touch a thing that is grasped or pushed."""


class SkillProgram:
    """The program of one episode; iterate over `actions()`.

    Args:
        task: the task.
        skill: the skill, with the task's names of things.
        settings: see `ProgramSettings`.
        executor: executor of the arm.
    """

    def __init__(self, task: TaskDescription, skill: Skill, settings: ProgramSettings, executor: ArmExecutor):
        self.task, self.skill, self.settings, self.executor = task, skill, settings, executor
        self._paths = {phase.name: resampled(phase.path, settings.resample) for phase in skill.phases}
        self._places = Places(task)
        self._starts: dict[str, Pose] = {}
        self._leaving: PosePath | None = None
        self.paths = [LabeledPath("demonstrated", name, path) for name, path in self._paths.items()]

    def actions(self) -> Iterator[np.ndarray]:
        """Yield the actions of all phases in order."""
        for phase, following in zip(self.skill.phases, [*self.skill.phases[1:], None], strict=True):
            if phase.kind == "carry":
                continue
            if phase.kind == "reach" and following is not None and following.kind == "carry":
                yield from self._fetch_and_carry(phase, following)
            elif phase.kind == "reach":
                yield from self._reach(phase)
            elif phase.kind == "slide":
                yield from self._slide(phase)
            elif phase.kind == "articulate":
                yield from self._push(phase)
        yield from self._withdraw()

    def _pose(self, name: str) -> Pose:
        return self._places.pose(name, self.executor.observation)

    def _fetch_and_carry(self, reach: Phase, carry: Phase) -> Iterator[np.ndarray]:
        """Fetch an object and carry it away; one that was not grasped, or was lost on the way, is fetched again."""
        self._starts[carry.thing] = self._pose(carry.thing)
        for chance in range(TRIES):
            try:
                yield from self._fetch(reach, carry)
                yield from self._lift(reach, carry)
                yield from self._place(reach, carry)
                return
            except PlanFailed as failed:
                if chance + 1 == TRIES or failed.reason != "dropped":
                    raise
            yield from self._let_go(reach)

    def _let_go(self, reach: Phase) -> Iterator[np.ndarray]:
        """Open the hand after a grasp that failed."""
        yield from self.executor.grip(OPEN, self.settings.open)
        self.executor.release()
        self._leaving = self._paths[reach.name].reversed()

    def _fetch(self, reach: Phase, carry: Phase) -> Iterator[np.ndarray]:
        """Take the object with a grasp from which it can be carried on."""
        executor = self.executor
        motion, choice = self._chosen_fetch(reach, carry)
        executor.allow(motion.allowed)
        self.paths.append(LabeledPath("final", reach.name, choice.path))
        yield from executor.go(choice)
        yield from executor.wait(self.settings.settle)
        yield from executor.grip(CLOSE, self.settings.close)

    def _chosen_fetch(self, reach: Phase, carry: Phase) -> tuple[MotionChoice, ChosenMotion]:
        """Choose a grasp from which the object can be carried on, as much like the one shown as possible.

        In this order: as shown; raised until the hand touches nothing; with less of the demonstrated carry; with a hand
        that leans; with other objects brushed; with a search in joint space.
        """
        executor, begun, failure = self.executor, None, None
        own, everything = (reach.thing,), tuple(each.name for each in self.task.objects)
        for touched, lean, tail, height in product((own, everything), LEANS, TAILS, RAISED):
            motion, then = self._grasping(reach, carry, touched, height, tail, lean)
            try:
                choice = executor.choose(motion, then, search=False)
            except PlanFailed as failed:
                failure = failure or failed
                continue
            if choice.then is not None:
                return motion, choice
            begun = begun or (motion, choice)
        for height in RAISED:
            motion, then = self._grasping(reach, carry, (reach.thing,), height, TAILS[0])
            with suppress(PlanFailed):
                return motion, executor.choose(motion, then)
        if begun is not None:
            return begun
        assert failure is not None
        raise failure

    def _grasping(
        self, reach: Phase, carry: Phase, touched: Sequence[str], height: float, tail: float, lean: float = 0.0
    ) -> tuple[MotionChoice, Callable[[int], MotionChoice]]:
        """Return the motion to all grasps that look alike, and the carry from each of them."""
        at, up = self._pose(reach.thing), Pose.from_position_quaternion([0.0, 0.0, height])
        tilt = turned_about(np.array([1.0, 0.0, 0.0]), np.zeros(3), lean)
        goals = tuple(up @ at @ grasp @ tilt for grasp in ends_alike(reach))
        held = [goal.inverse() @ at for goal in goals]
        motion = self._motion(reach, goals, _contacts(HAND, touched), leaving=self._leaving)
        return motion, lambda index: self._placement(reach, carry, held[index], lift=True, tail=tail)

    def _lift(self, reach: Phase, carry: Phase) -> Iterator[np.ndarray]:
        """Lift the object off its support as demonstrated, without detours near it."""
        executor, index = self.executor, self._places.index(carry.thing)
        grasped = executor.tcp_from(index)
        executor.hold(index, self.task.objects[index].parts, grasped)
        motion = self._placement(reach, carry, grasped, lift=True)
        executor.allow(motion.allowed)
        path = executor.departure_path(motion)
        if path is not None:
            yield from executor.leave(path, OFF)
        executor.lifted()

    def _place(self, reach: Phase, carry: Phase) -> Iterator[np.ndarray]:
        """Carry the object, which slips a little during the lift, from its present pose in the hand."""
        executor = self.executor
        motion, choice = self._chosen_placement(reach, carry)
        executor.allow(motion.allowed)
        self.paths.append(LabeledPath("final", carry.name, choice.path))
        yield from executor.go(choice)
        yield from executor.wait(self.settings.settle)
        if carry.gripper == "open":
            yield from executor.grip(OPEN, self.settings.open)
            executor.release()
            self._leaving = self._paths[reach.name].reversed()
        else:
            self._leaving = None

    def _chosen_placement(self, reach: Phase, carry: Phase) -> tuple[MotionChoice, ChosenMotion]:
        """Choose where the carry ends, with as much of the demonstrated way to it as can be reached."""
        executor, held = self.executor, self.executor.lifted()
        for tail in TAILS:
            motion = self._placement(reach, carry, held, lift=False, tail=tail)
            with suppress(PlanFailed):
                return motion, executor.choose(motion, search=False)
        motion = self._placement(reach, carry, held, lift=False)
        return motion, executor.choose(motion)

    def _placement(self, reach: Phase, carry: Phase, held: Pose, *, lift: bool, tail: float = math.inf) -> MotionChoice:
        """Return the motion of the hand that carries the object.

        Args:
            reach: the phase before.
            carry: the phase.
            held: `tcp_from_object`.
            lift: whether the object must be lifted first.
            tail: path length [m] at the end of the demonstrated path that is imitated.
        """
        at = self._starts[carry.thing] if carry.reference == START else self._pose(carry.reference)
        tcp_from_object = held.inverse()
        goals = tuple(at @ end @ tcp_from_object for end in ends_alike(carry))
        path = self._paths[carry.name].with_tool(tcp_from_object)
        contacts = (*_contacts(HAND, (carry.thing, *carry.touching)), *_contacts(("held",), self._around(carry)))
        index = self._places.index(carry.thing)
        shown = ending(path, tail)
        motion = self._motion(carry, goals, contacts, path=shown, held=(index, held), leaving=path if lift else None)
        return motion if shown is path else motion._replace(done=0)

    def _around(self, carry: Phase) -> tuple[str, ...]:
        """Return the names of what a carried object touches at its end, and of what it may have stood on."""
        return (*carry.touching, *(each.name for each in self.task.fixtures), *self._supports(carry.thing))

    def _supports(self, name: str) -> tuple[str, ...]:
        return tuple(each.name for each in self.task.furniture)

    def _motion(
        self,
        phase: Phase,
        goals: tuple[Pose, ...],
        contacts: Sequence[tuple[str, str]],
        *,
        path: PosePath | None = None,
        held: tuple[int, Pose] | None = None,
        leaving: PosePath | None = None,
    ) -> MotionChoice:
        executor = self.executor
        around = executor.world_model.obstacles_if_holding(executor.observation, None if held is None else held[0])
        body = executor.empty if held is None else executor.body_with(self.task.objects[held[0]].parts, held[1])
        names = {obstacle.name for obstacle in around}
        wanted = (*self.task.touching, *contacts)
        allowed = tuple(pair for pair in dict.fromkeys(wanted) if pair[0] in body.names and pair[1] in names)
        shown = self._paths[phase.name] if path is None else path
        done = 0
        if held is not None:
            done = len(departure(shown, shown[0], self.settings.motion.departure)) - 1
        return MotionChoice(phase.name, shown, goals, body, around, allowed, leaving, done=done)

    def _reach(self, phase: Phase) -> Iterator[np.ndarray]:
        """Go to a thing that is moved on its hinge."""
        executor, at = self.executor, self._stood(phase)
        motion = self._motion(phase, tuple(at @ end for end in ends_alike(phase)), _contacts(HAND, phase.touching))
        executor.allow(motion.allowed)
        choice = executor.choose(motion)
        self.paths.append(LabeledPath("final", phase.name, choice.path))
        yield from executor.go(choice)
        yield from self._end(phase)

    def _stood(self, phase: Phase) -> Pose:
        """Return where what moves on its joints stood at first, as it is recorded: it is pushed from there."""
        return self._starts.setdefault(phase.reference, self._pose(phase.reference))

    def _end(self, phase: Phase) -> Iterator[np.ndarray]:
        """Close or open the hand as at the end of a phase in which it holds no free object."""
        if phase.gripper == "close":
            yield from self.executor.wait(self.settings.settle)
            yield from self.executor.grip(CLOSE, self.settings.close)
        elif phase.gripper == "open":
            yield from self.executor.grip(OPEN, self.settings.open)

    def _slide(self, phase: Phase) -> Iterator[np.ndarray]:
        """Move the object along what it touches as was commanded, from where the hand has brought it."""
        executor, path, at = self.executor, self._paths[phase.name], self._pose(phase.reference)
        tcp_from_object = executor.tcp_from(self._places.index(phase.thing)).inverse()
        here = executor.arm.fk(executor.q)
        shown = at @ phase.goals[0] @ path[-1].inverse()
        # of the turns that look alike, the one that was chosen for the carry
        ways = [path.moved(shown).with_tool(turn @ tcp_from_object) for turn in phase.right]
        way = min(ways, key=lambda each: here.distance_to(each[0])[1])
        yield from executor.follow(way, detours=False)
        yield from executor.wait(self.settings.settle)
        if phase.gripper == "open":
            yield from executor.grip(OPEN, self.settings.open)
            executor.release()
            self._leaving = self._paths[next(each.name for each in self.skill.phases if each.thing == phase.thing)]
            self._leaving = self._leaving.reversed()

    def _push(self, phase: Phase) -> Iterator[np.ndarray]:
        """Follow what was commanded where the hand pushes, relative to where the thing is."""
        path = self._paths[phase.name]
        here = self._stood(phase)
        shown = path[-1] @ phase.goals[0].inverse()
        self.executor.allow(_contacts(HAND, phase.touching))
        yield from self.executor.follow(path.moved(here @ shown.inverse()), detours=False, exact=False)
        yield from self._end(phase)

    def _withdraw(self) -> Iterator[np.ndarray]:
        """Move away from what was released, as shown, or back as the hand came."""
        last = self.skill.phases[-1]
        path = self._paths[last.name] if last.kind == "withdraw" else self._leaving
        if path is None:
            return
        here = self.executor.arm.fk(self.executor.q)
        away = departure(path, here, self.settings.motion.departure)
        yield from self.executor.follow(away, exact=False, detours=False)


def _contacts(parts: Sequence[str], names: Sequence[str]) -> tuple[tuple[str, str], ...]:
    return tuple((part, name) for part in parts for name in names if name)
