"""One program for every skill: what a demonstration shows, done in the scene at hand."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from ...envs import TaskDescription
from ...planner import PosePath
from ...planner.errors import PlanFailed
from ...planner.geometry.pose import nearest
from ...planner.imitation.tsia import departure
from ...planner.skills.skill import Phase, Skill
from ...planner.skills.thing import touching
from ..motion.path_generators import parted
from ..policy import LabeledPath
from .arm_executor import CLOSE, OFF, OPEN, ArmExecutor
from .goal_choice import ChosenMotion
from .skill_motions import SkillMotions
from .skill_steps import Transfer, Way, steps_of
from .task_skills import things_of
from .thought import Thought

if TYPE_CHECKING:
    from ..motion.settings import ProgramSettings

TRIES = 3
"""Number of grasps of one object before the program gives up."""
AWAY = 0.10
"""Path length [m] by which a hand moves away that still touches what it has let go."""
PATIENCE = 5.0
"""Time [s] to wait for an object."""


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
        self.motions = SkillMotions(task, skill, settings, executor)
        self.paths = [LabeledPath("demonstrated", name, path) for name, path in self.motions.paths.items()]
        self._lifted: PosePath | None = None

    def actions(self) -> Iterator[np.ndarray]:
        """Yield the actions of all phases in order."""
        doing = {"reach": self._reach, "slide": self._slide, "articulate": self._push, "leave": self._leave}
        in_hand = self.skill.in_hand
        if not in_hand:  # else the first thing to do is to keep the hand closed
            yield self.executor.still()  # to begin takes a tick of its own
        for step in steps_of(self.skill):
            if isinstance(step, Transfer):
                yield from self._transfer(step, in_hand=in_hand)
                in_hand = False
            elif step.kind in doing:
                self.executor.slow_down(step.speed)
                yield from doing[step.kind](step)
        yield from self._withdraw()

    def _transfer(self, step: Transfer, *, in_hand: bool) -> Iterator[np.ndarray]:
        """Fetch an object and carry it away; one that was not grasped, or was lost on the way, is fetched again."""
        if not in_hand:
            yield from self._awaited(step)
        self.motions.starts[step.carry.thing] = self.motions.pose(step.carry.thing)
        for chance in range(TRIES):
            try:
                if in_hand and chance == 0:
                    yield from self._take_over(step)
                else:
                    yield from self._fetch(step)
                    yield from self._lift(step)
                yield from self._place(step)
                return
            except PlanFailed as failed:
                if chance + 1 == TRIES or failed.reason != "dropped" or step.reach is None:
                    raise
            yield from self._let_go(step.reach)

    def _awaited(self, step: Transfer) -> Iterator[np.ndarray]:
        """Open the hand, and rise until the object is there: it is not handed over under an arm."""
        reach, executor = step.reach, self.executor
        if reach is None or not reach.awaited_on:
            return
        executor.slow_down(reach.speed)
        yield from executor.grip(OPEN, self.settings.open)
        if step.lift is not None and not self._lies(reach):
            for action in executor.follow(self.motions.rising(step.lift), exact=False):
                yield action
                if self._lies(reach):
                    return
        left = round(PATIENCE / self.task.control_dt)
        while not self._lies(reach):
            if left == 0:
                raise PlanFailed("timeout", f"{reach.thing} was not handed over")
            left -= 1
            yield executor.still()

    def _lies(self, reach: Phase) -> bool:
        """Return whether an object lies on what it is awaited on."""
        return bool(self.motions.pose(reach.thing).position[2] > self.motions.pose(reach.awaited_on).position[2])

    def _let_go(self, came: Phase | None, opening: float = OPEN) -> Iterator[np.ndarray]:
        """Open the hand, which leaves as it came in a phase."""
        yield from self.executor.grip(opening, self.settings.open)
        self.executor.release()
        self.motions.leaving = None if came is None else self.motions.paths[came.name].reversed()

    def _take_over(self, step: Transfer) -> Iterator[np.ndarray]:
        """Hold what is in the hand from the start, and lift it if it stands on something."""
        self.executor.slow_down(step.carry.speed)
        self.executor.allow(self.motions.contacts(step.lift or step.carry))
        yield from self.executor.grip(CLOSE, self.settings.close)
        if self._stands(step):
            yield from self._lift(step)
        else:
            self._hold(step.carry)

    def _stands(self, step: Transfer) -> bool:
        """Return whether an object is nearer to a support than where a lift ends."""
        things, pairs = things_of(self.task), self.motions.contacts(step.lift or step.carry)
        held = {name for part, name in pairs if part == "held" and name in things and not things[name].free}
        near = [(things[name], self.motions.pose(name)) for name in held]
        thing = step.carry.thing
        return bool(touching(things[thing], self.motions.pose(thing), near, OFF))

    def _hold(self, phase: Phase) -> None:
        index = self.motions.index(phase)
        self.executor.hold(index, self.task.objects[index].parts, self.motions.tcp_from(phase))

    def _fetch(self, step: Transfer) -> Iterator[np.ndarray]:
        """Take the object with a grasp from which it can be carried on."""
        assert step.reach is not None
        self.executor.slow_down(step.reach.speed)
        yield from self._parted(step)
        yield from self._go((yield from self._chosen_fetch(step)))
        yield from self._end(step.reach)

    def _parted(self, step: Transfer) -> Iterator[np.ndarray]:
        """Move the hand away from what it has let go, if it still touches that, or what is beside it."""
        leaving, executor = self.motions.leaving, self.executor
        if leaving is None or (yield from executor.is_clear(self.motions.fetching(step))):
            return
        away = departure(leaving, executor.arm.fk(executor.q), AWAY)
        yield from executor.follow(away, exact=False, detours=False)
        self.motions.leaving = None

    def _go(self, choice: ChosenMotion | None) -> Iterator[np.ndarray]:
        """Execute the motions of one phase."""
        phase = "" if choice is None or choice.motion is None else choice.motion.name
        while choice is not None and choice.motion is not None and choice.motion.name == phase:
            self.executor.world_model.set_margin(choice.motion.clearance)
            self.executor.allow(choice.motion.allowed)
            whole = choice.path if self._lifted is None else self._lifted.joined(choice.path)
            self._lifted = None
            self.paths.append(LabeledPath("final", phase, whole))
            if not choice.motion.detours:
                return
            yield from self.executor.go(choice)
            motion, index, choice = choice.motion, choice.index, choice.then
            if choice is None and motion.blindly and motion.then is not None:
                choice = yield from self.executor.choose(motion.then(index))

    def _end(self, phase: Phase) -> Iterator[np.ndarray]:
        """Do with the gripper what a phase ends with in which it holds no free object."""
        if phase.gripper == "close":
            yield from self.executor.wait(self.settings.settle)
            yield from self.executor.grip(CLOSE, self.settings.close)
        elif phase.gripper == "open":
            yield from self.executor.grip(OPEN, self.settings.open)

    def _chosen_fetch(self, step: Transfer) -> Thought[ChosenMotion]:
        """Choose a grasp from which the object can be carried on, as much like the one shown as possible.

        In this order: as shown; raised until the hand touches nothing; with less of the demonstrated carry; with a hand
        that leans; turned by a quarter turn, where it fits around the object; with other objects brushed; with a search
        in joint space.
        """
        assert step.reach is not None
        begun, failure, reached = None, None, set[Way]()
        for way in step.ways:
            # where the hand gets to the object, it is the way on that is out of reach, as high as it may take it
            if way._replace(height=0.0) in reached or not self.motions.fits(step.reach, way):
                continue
            try:
                choice = yield from self.executor.choose(self.motions.fetching(step, way), search=False)
            except PlanFailed as failed:
                failure = failure or failed
                continue
            if choice.complete:
                return choice
            begun = begun or choice
            reached.add(way)
        for way in step.raised:
            try:
                return (yield from self.executor.choose(self.motions.fetching(step, way)))
            except PlanFailed as failed:
                failure = failure or failed
        if begun is not None:
            return begun
        assert failure is not None
        raise failure

    def _lift(self, step: Transfer) -> Iterator[np.ndarray]:
        """Lift the object off its support as demonstrated, without detours near it."""
        executor, carry = self.executor, step.carry
        executor.slow_down(carry.speed)
        self._hold(carry)
        grasped = self.motions.tcp_from(carry)
        if step.lift is not None:
            executor.allow(self.motions.contacts(step.lift))
            path = self.motions.from_here(step.lift)
            yield from self._away(path, OFF, carry.speed)
        else:
            motion = self.motions.placing(carry, grasped, lift=True)
            executor.allow(motion.allowed)
            path = yield from executor.departure_path(motion)
            if path is not None:
                yield from executor.leave(path, OFF)
        executor.lifted()
        self._lifted = path

    def _place(self, step: Transfer) -> Iterator[np.ndarray]:
        """Carry the object, which slips a little during the lift, from its present pose in the hand."""
        carry, failed = step.carry, list[int]()
        for chance in range(carry.tries):
            choice = yield from self._chosen_placement(step, failed)
            try:
                yield from self._go(choice)
                if carry.exact:
                    yield from self._insert(carry)
                break
            except PlanFailed as failure:
                if chance + 1 == carry.tries or failure.reason == "dropped":
                    raise
            failed.append(self.motions.end_index(carry, choice.index, failed))
        yield from self.executor.wait(getattr(self.settings, carry.pause))
        self.motions.leaving = None
        if carry.gripper == "open":
            if carry.touch is not None:  # it was no obstacle while it was held
                self.executor.allow(carry.touch)
            yield from self._let_go(step.reach, carry.opening)

    def _insert(self, carry: Phase) -> Iterator[np.ndarray]:
        """Go straight to the end, in contact; where that proves blocked, go back."""
        path, executor = self.motions.inserting(carry, self.motions.tcp_from(carry)), self.executor
        try:
            yield from executor.follow(path, detours=False)
        except PlanFailed as failed:
            here = nearest(path, executor.arm.fk(executor.q))
            if here and failed.reason != "dropped":
                yield from executor.follow(path[: here + 1].reversed(), exact=False, detours=False)
            raise

    def _chosen_placement(self, step: Transfer, failed: Collection[int]) -> Thought[ChosenMotion]:
        """Choose where the carry ends, with as much of the demonstrated way to it as can be reached."""
        choose, carry, held = self.executor.choose, step.carry, self.executor.lifted()
        for tail in step.tails:
            with suppress(PlanFailed):
                motion = self.motions.placing(carry, held, tail=tail, failed=failed)
                return (yield from choose(motion, search=False))
        if carry.clearance:
            with suppress(PlanFailed):
                motion = self.motions.placing(carry, held, failed=failed, clearance=carry.clearance)
                return (yield from choose(motion))
        return (yield from choose(self.motions.placing(carry, held, failed=failed)))

    def _reach(self, phase: Phase) -> Iterator[np.ndarray]:
        """Go to a thing that is moved on its hinge, or to where the hand should be."""
        yield from self._go((yield from self.executor.choose(self.motions.reaching(phase))))
        yield from self._end(phase)

    def _leave(self, phase: Phase) -> Iterator[np.ndarray]:
        """Follow the path from where the hand is, at first straight out, where a detour would push things over."""
        executor, path = self.executor, self.motions.from_here(phase)
        executor.allow(self.motions.contacts(phase))
        if phase.straight:
            yield from self._away(path, phase.straight, 1.0)
        else:
            yield from executor.follow(path, exact=False)
        self.motions.leaving = None

    def _away(self, path: PosePath, straight: float, speed: float) -> Iterator[np.ndarray]:
        """Follow a path straight for a distance [m], in contact, then free, at a share of the speed limits."""
        near, rest = parted(path, straight)
        yield from self.executor.follow(near, exact=False, detours=False)
        self.executor.slow_down(speed)
        self.executor.allow(())
        if rest is not None:
            yield from self.executor.follow(rest, exact=False)

    def _slide(self, phase: Phase) -> Iterator[np.ndarray]:
        """Move the object along what it touches as was commanded, from where the hand has brought it."""
        executor, path, at = self.executor, self.motions.paths[phase.name], self.motions.pose(phase.reference)
        tcp_from_object = self.motions.tcp_from(phase).inverse()
        here = executor.arm.fk(executor.q)
        shown = at @ phase.goals[0] @ path[-1].inverse()
        # of the turns that look alike, the one that was chosen for the carry
        ways = [path.moved(shown).with_tool(turn @ tcp_from_object) for turn in phase.right]
        way = min(ways, key=lambda each: here.distance_to(each[0])[1])
        yield from executor.follow(way, detours=False)
        yield from executor.wait(self.settings.settle)
        if phase.gripper == "open":
            yield from self._let_go(next(each for each in self.skill.phases if each.thing == phase.thing))

    def _push(self, phase: Phase) -> Iterator[np.ndarray]:
        """Follow what was commanded where the hand pushes, relative to where the thing stood."""
        path, there = self.motions.paths[phase.name], self.motions.reference(phase)
        shown = path[-1] @ phase.goals[0].inverse()
        self.executor.allow(self.motions.contacts(phase))
        yield from self.executor.follow(path.moved(there @ shown.inverse()), detours=False, exact=False)
        yield from self._end(phase)

    def _withdraw(self) -> Iterator[np.ndarray]:
        """Move away from what was released, as shown, or back as the hand came."""
        last = self.skill.phases[-1]
        path = self.motions.paths[last.name] if last.kind == "withdraw" else self.motions.leaving
        away = None if path is None else (yield from self.motions.withdrawing(last, path))
        if away is not None:
            yield from self.executor.follow(away, exact=False, detours=last.as_shown)
