"""Motions of a skill's phases in the scene at hand: their goals, the body that moves, and the contacts wanted."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...envs import TaskDescription
from ...envs.scene.body_clearance import tool_clearance
from ...planner import Body, Obstacle, Pose, PosePath, imitated_path
from ...planner.constraints.request_constraint import remembered_constraint
from ...planner.geometry.shapes import pack
from ...planner.imitation.segmentation import resampled
from ...planner.imitation.tsia import departure, ending, screw_path
from ...planner.skills.alike import standing, turned_like
from ...planner.skills.skill import START, TASK_GOAL, Pair, Phase, Skill
from .arm_executor import ArmExecutor
from .goal_choice import Enough, MotionChoice
from .postures import Postures
from .skill_goals import Places, ends_alike, level_imitation, pairs_of, point_of
from .skill_steps import AS_SHOWN, Transfer, Way
from .task_skills import things_of
from .thought import Thought
from .world_model import OBJECT_MARGIN

if TYPE_CHECKING:
    from ..motion.settings import ProgramSettings

HAND = ("fingers", "hand")
"""Parts of the body that touch a thing that is grasped or pushed."""
MARGIN = 0.08
"""Distance of the joints to their limits [rad] with which no further turn of a round thing is tried."""
AROUND = 0.010
"""Gap [m] that the open hand must leave around an object that it takes in another way than shown."""
FEW = 4
"""Number of goals that look alike up to which each is tried without a look at whether the arm has a posture there."""
SEARCHED = 3
"""Number of turns of a round thing for which joint space is searched."""


class SkillMotions:
    """Motions from where the arm is.

    Args:
        task: the task.
        skill: the skill, with the task's names of things.
        settings: see `ProgramSettings`.
        executor: executor of the arm.

    Attributes:
        paths: demonstrated path of each phase, in equal steps.
        starts: poses at which things were when a phase began that is relative to it.
        leaving: path along which the hand leaves what it has let go; None: there is nothing.
    """

    def __init__(self, task: TaskDescription, skill: Skill, settings: ProgramSettings, executor: ArmExecutor):
        self.task, self.settings, self.executor = task, settings, executor
        step = settings.resample
        self.paths = {phase.name: resampled(phase.path, step) for phase in skill.phases}
        self._before = {phase.name: resampled(phase.before, step) for phase in skill.phases if phase.before is not None}
        self._ends = {phase.name: ends_alike(phase) for phase in skill.phases}
        self.starts: dict[str, Pose] = {}
        self._postures = Postures(executor.arm, executor.q)
        self.leaving: PosePath | None = None
        self._places = Places(task)

    def index(self, phase: Phase) -> int:
        """Return the index of a phase's object."""
        return self._places.index(phase.thing)

    def pose(self, name: str) -> Pose:
        """Return the pose of a thing as observed."""
        return self._places.pose(name, self.executor.observation)

    def tcp_from(self, phase: Phase) -> Pose:
        """Return the observed pose of a phase's object in the hand."""
        return self.executor.tcp_from(self.index(phase))

    def reference(self, phase: Phase) -> Pose:
        """Return the pose that the ends of a phase are relative to."""
        if phase.reference == TASK_GOAL:
            goal = self.executor.goal_pose(self.index(phase))
            return _up(self.settings.release_height) @ goal if phase.gripper == "open" else goal
        if phase.kind == "carry" and phase.reference == START:
            return self.starts[phase.thing]
        if phase.kind != "carry" and self._places.stands(phase.reference):
            # a latch turns with its door, but what is recorded is where it stood at first
            return self.starts.setdefault(phase.reference, self.pose(phase.reference))
        at = self.pose(phase.reference)
        if phase.round:
            return standing(at) @ point_of(self.task, phase.reference, phase.reference_anchor)
        return at

    def contacts(self, phase: Phase, *, brushed: bool = False) -> tuple[Pair, ...]:
        """Return the contacts that a phase wants.

        Args:
            phase: the phase.
            brushed: whether other objects may be touched, too.
        """
        if phase.touch is not None:
            return phase.touch
        if phase.kind != "carry":
            return pairs_of(HAND, [each.name for each in self.task.objects] if brushed else phase.touching)
        fixed = [each.name for each in (*self.task.fixtures, *self.task.furniture)]
        return (*pairs_of(HAND, [phase.thing, *phase.touching]), *pairs_of(("held",), [*phase.touching, *fixed]))

    def reaching(self, phase: Phase) -> MotionChoice:
        """Return the motion of the hand to where it moves a thing, or has done what it should."""
        goals = [self.reference(phase) @ end for end in self._ends[phase.name]]
        return self._motion(phase, self.paths[phase.name], goals)

    def fetching(self, step: Transfer, way: Way = AS_SHOWN) -> MotionChoice:
        """Return the motion to all grasps that look alike, and on from each of them if there are several.

        Args:
            step: the transfer, with a reach.
            way: changes of what was shown.
        """
        reach = step.reach
        assert reach is not None
        at = self.reference(reach)
        goals = [_up(way.height) @ at @ grasp @ way.hand for grasp in self._ends[reach.name]]
        motion = self._motion(reach, self.paths[reach.name], goals, brushed=way.brushed, leaving=self.leaving)

        def carried(index: int) -> MotionChoice:
            held = goals[index].inverse() @ at
            if step.lift is None:
                return self.placing(step.carry, held, lift=True, tail=way.tail)
            up = self.lifting(step.lift, goals[index], held)
            return up._replace(then=lambda _: self.placing(step.carry, held))

        return self._in_two(motion, reach, carried if len(goals) > 1 or not step.carry.as_shown else None)

    def fits(self, reach: Phase, way: Way) -> bool:
        """Return whether the open hand fits around an object that it takes in a way; as shown, it does.

        Args:
            reach: the phase.
            way: changes of what was shown.
        """
        if not way.turn:
            return True
        hand = self._ends[reach.name][0] @ way.hand
        across = things_of(self.task)[reach.thing].points @ hand.rotation[:, 0]
        return float(np.ptp(across)) < self.task.gripper_width[0] - AROUND

    def lifting(self, lift: Phase, start: Pose, held: Pose) -> MotionChoice:
        """Return the motion that lifts an object.

        Args:
            lift: the phase.
            start: where the hand is.
            held: `tcp_from_object`.
        """
        path = self.from_here(lift, start)
        return self._motion(lift, path, [path[-1]], held=held)

    def from_here(self, phase: Phase, start: Pose | None = None) -> PosePath:
        """Return the path of a phase from where the hand is.

        Args:
            phase: the phase.
            start: where the hand is; None: where it is now.
        """
        here = self.executor.arm.fk(self.executor.q) if start is None else start
        if phase.rise:
            return screw_path(here, _up(phase.rise) @ here, self.settings.resample)
        return departure(self.paths[phase.name], here, math.inf)

    def rising(self, lift: Phase) -> PosePath:
        """Return a path straight up by the height of a lift."""
        path, here = self.paths[lift.name], self.executor.arm.fk(self.executor.q)
        rise = path[-1].position[2] - path[0].position[2]
        return screw_path(here, _up(rise) @ here, self.settings.resample)

    def placing(
        self, carry: Phase, held: Pose, *, lift: bool = False, tail: float = math.inf,
        failed: Collection[int] = (), clearance: float = OBJECT_MARGIN,
    ) -> MotionChoice:  # fmt: skip
        """Return the motion of the hand that carries an object.

        Args:
            carry: the phase.
            held: `tcp_from_object`.
            lift: whether the object must be lifted first.
            tail: path length [m] at the end of the demonstrated path that is imitated.
            failed: indices of ends that proved blocked.
            clearance: margin [m] of objects in the part that is free.
        """
        at, tool = self.reference(carry), self._tool(carry, held)
        ends = [end for k, end in enumerate(self._ends[carry.name]) if k not in failed] or self._ends[carry.name]
        goals = [at @ end @ tool.inverse() for end in ends]
        path = self.paths[carry.name] if carry.by_hand else self.paths[carry.name].with_tool(held.inverse())
        shown, leaving = ending(path, tail), path if lift else None
        motion = self._motion(carry, shown, goals, held=held, leaving=leaving)
        lifted = len(departure(shown, shown[0], self.settings.motion.departure)) - 1
        motion = self._in_two(motion._replace(done=lifted if shown is path else 0), carry)
        if clearance == OBJECT_MARGIN:
            return motion
        seen, index = self.executor.observation, self.index(carry)
        around = self.executor.world_model.obstacles_if_holding(seen, index, clearance)
        return motion._replace(obstacles=around, clearance=clearance)

    def end_index(self, carry: Phase, chosen: int, failed: Collection[int]) -> int:
        """Return the index, among all ends of a carry, of one that was chosen among those that are left.

        Args:
            carry: the phase.
            chosen: index among those that are left.
            failed: indices of ends that proved blocked.
        """
        left = [k for k in range(len(self._ends[carry.name])) if k not in failed]
        return left[chosen] if left else chosen

    def inserting(self, carry: Phase, held: Pose) -> PosePath:
        """Return the path of a motion in contact, ending where the object is let go.

        It stays as level as demonstrated: an object that is tilted in the hand turns the hand, not the path.

        Args:
            carry: the phase.
            held: `tcp_from_object`.
        """
        end = self.reference(carry) @ self._ends[carry.name][0] @ held.inverse()
        return level_imitation(self.paths[carry.name], end)

    def withdrawing(self, phase: Phase, path: PosePath) -> Thought[PosePath | None]:
        """Return the beginning of a path, from where the hand is, that leaves what was let go.

        Args:
            phase: the last phase.
            path: the path.
        """
        motion = self._motion(phase, path, [], leaving=path)
        touched = tuple(pair for pair in self.executor.world_model.allowed if pair[0] in motion.body.names)
        return self.executor.departure_path(motion._replace(allowed=touched))

    def _tool(self, carry: Phase, held: Pose) -> Pose:
        """Return the pose, in the tcp's frame, of what of an object is to be at the ends of a carry."""
        if not carry.round or carry.object_from_tcp is None:
            return held
        point = point_of(self.task, carry.thing, carry.anchor)
        return turned_like(held, carry.object_from_tcp.inverse()) @ point

    def _in_two(
        self, motion: MotionChoice, phase: Phase, then: Callable[[int], MotionChoice] | None = None
    ) -> MotionChoice:
        """Return a motion in two parts if only the second one may be in contact; the first one is free."""
        if phase.round:
            carried = phase.kind == "carry"
            motion = motion._replace(enough=Enough(MARGIN, as_shown=carried), searched=SEARCHED, blindly=carried)
        if phase.before is None and math.isinf(phase.touch_within):
            return motion._replace(then=then)
        begun = ended = None
        if phase.before is not None:
            first, second = self._before[phase.name], motion.demonstrated
            starts = [self._imitated(phase, second, goal)[0] for goal in motion.goals]
        else:
            split = self._near(phase, imitated_path(motion.demonstrated, motion.goals[0]), motion.body)
            if motion.body.held:  # found in the whole path: its parts do not show what they are parts of
                kept = remembered_constraint(motion.demonstrated, self.settings.plan.constraint)
                begun, ended = kept.part(0, split + 1), kept.part(split, kept.count)
            first, second = motion.demonstrated[: split + 1], motion.demonstrated[split:]
            starts = [imitated_path(second, goal)[0] for goal in motion.goals]

        def contact(index: int) -> MotionChoice:
            goal = motion.goals[index]
            return motion._replace(
                demonstrated=self._imitated(phase, second, goal),
                goals=(goal,),
                leaving=None,
                done=0,
                detours=not phase.exact,
                guided=False,
                must_keep=phase.must_keep,
                constraint=ended,
                enough=None,
                then=None if then is None else lambda _, on=then: on(index),
            )

        free = tuple(pair for pair in motion.allowed if pair in self.task.touching)
        return motion._replace(
            demonstrated=first,
            goals=tuple(starts),
            allowed=free,
            then=contact,
            parts=2,
            done=0,
            exact=phase.before is not None,
            constraint=begun,
        )

    def _imitated(self, phase: Phase, path: PosePath, goal: Pose) -> PosePath:
        return (level_imitation if phase.exact else imitated_path)(path, goal)

    def _near(self, phase: Phase, path: PosePath, body: Body) -> int:
        """Return the index of the pose from which hand and held object stay near the reference of a phase."""
        shape = self.task.objects[self._places.index(phase.reference)].shape
        there, tool = pack([Obstacle(shape, self.pose(phase.reference))]), body.tool(self.executor.arm)
        clearances = np.array([tool_clearance(tool, row[None], there) for row in path.dqs])
        far = np.flatnonzero(clearances > phase.touch_within)
        return max(1, int(far[-1])) if len(far) else 1

    def _motion(
        self,
        phase: Phase,
        shown: PosePath,
        goals: Sequence[Pose],
        *,
        brushed: bool = False,
        held: Pose | None = None,
        leaving: PosePath | None = None,
    ) -> MotionChoice:
        executor, index = self.executor, None if held is None else self.index(phase)
        body, around = executor.empty, executor.world_model.obstacles_if_holding(executor.observation, index)
        if held is not None and index is not None:
            body = executor.body_with(self.task.objects[index].parts, held)
        names, wanted = {each.name for each in around}, (*self.task.touching, *self.contacts(phase, brushed=brushed))
        allowed = tuple(pair for pair in dict.fromkeys(wanted) if pair[0] in body.names and pair[1] in names)
        reaches = self._postures.reach if len(goals) > FEW and not phase.as_shown else None
        motion = MotionChoice(phase.name, shown, tuple(goals), body, around, allowed, leaving)
        return motion._replace(reaches=reaches, keeping=phase.keeping)


def _up(height: float) -> Pose:
    return Pose.from_position_quaternion([0.0, 0.0, height])
