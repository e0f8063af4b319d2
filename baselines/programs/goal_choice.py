"""Choice among the goals of a motion: the goal from which the task can continue.

Symmetric grasps and places are equivalent, but an arm among obstacles cannot reach all of them. Each is tried as it
will be executed: planned among all obstacles, held object included, with the real tolerance and stall rule, and
followed by the next motion from its end. Not in the paper, which has one goal.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...planner import (
    Arm,
    Body,
    NextMotion,
    Obstacle,
    Plan,
    Planner,
    PlanRequest,
    PlanSettings,
    Pose,
    PosePath,
    final_path,
    imitated_path,
)
from ...planner.errors import PlanFailed
from ...planner.geometry.shapes import moves
from ...planner.imitation.constraint import Constraint, Keeping
from ...planner.imitation.tsia import departure, screw_path
from ...planner.planning.joint_space_motion import MAX_DEVIATION
from ...planner.resumable import SOLVED, Resumable
from ..motion.motion_method import DIRECT, ESCAPE, MADE, SCREW, MotionMethod
from .world_model import OBJECT_MARGIN

PREPARED = 1000.0
"""Cost [us] of a motion and its planner before anything is planned, see `planner.resumable`."""


class MotionChoice(NamedTuple):
    """A motion that may end at any of several goals.

    Attributes:
        name: name of the motion or of its object, for messages.
        demonstrated: the segment to imitate.
        goals: possible poses of the tcp at the end.
        body: capsules of the arm, held object included.
        obstacles: around the arm; moving ones are ignored in planning.
        allowed: allowed contacts, see `Planner.plan`.
        leaving: the segment whose beginning is imitated at the departure; None: no departure, blend at once.
        detours: False: along the path or not at all, see `ReactivePlanner.go`.
        done: index in `demonstrated` up to which a departure, present or past, has executed it.
        then: returns the next motion by the index of the goal; None if there is none.
        guided: False: imitated from its first pose on, as what continues a motion.
        exact: False: finished as soon as the tool is within reach of the end.
        must_keep: a plan that keeps nothing of the demonstration fails.
        enough: what ends the search among the goals; None: all of them are compared.
        searched: number of goals for which joint space is searched; None: all of them.
        parts: number of motions, this one and those that follow, without which it is none.
        clearance: margin [m] of objects while it is followed.
        constraint: what the demonstrated segment keeps; None: what is found in it if the hand holds something.
        keeping: how it is kept, see `PlanRequest.keeping`.
        blindly: the best is followed even if no plan arrives: what the guard and the moment allow decides.
        reaches: quick test whether the arm has a posture at a goal; goals without one are left out; None: no test.
    """

    name: str
    demonstrated: PosePath
    goals: tuple[Pose, ...]
    body: Body
    obstacles: tuple[Obstacle, ...]
    allowed: tuple[tuple[str, str], ...] = ()
    leaving: PosePath | None = None
    detours: bool = True
    done: int = 0
    then: Callable[[int], MotionChoice] | None = None
    guided: bool = True
    exact: bool = True
    must_keep: bool = False
    constraint: Constraint | None = None
    keeping: Keeping | None = None
    enough: Enough | None = None
    searched: int | None = None
    parts: int = 1
    clearance: float = OBJECT_MARGIN
    blindly: bool = False
    reaches: Callable[[Pose], bool] | None = None

    def candidates(self) -> Resumable[list[int]]:
        """Return the indices of the goals to try; the first one if the arm has a posture at none."""
        if self.reaches is None:
            return list(range(len(self.goals)))
        found = []
        for k, goal in enumerate(self.goals):
            if self.reaches(goal):
                found.append(k)
            yield SOLVED
        return found or [0]

    def is_enough(self, choice: ChosenMotion) -> bool:
        """Return whether a choice ends the search among the goals."""
        return self.enough is not None and choice.complete and self.enough.holds(choice)


class Enough(NamedTuple):
    """Motions that are good enough to look no further.

    Attributes:
        margin: least distance of the joints to their limits [rad].
        as_shown: whether a detour, or a way through joint space, is not good enough.
    """

    margin: float
    as_shown: bool = False

    def holds(self, choice: ChosenMotion) -> bool:
        """Return whether a choice is good enough."""
        return choice.margin >= self.margin and (choice.as_shown or not self.as_shown)


class ChosenMotion(NamedTuple):
    """The chosen goal and the motion to it.

    Attributes:
        index: index of the goal.
        plan: plan to the goal.
        departure: path of the departure; None: no departure.
        then: the choice of the next motion from there; None if not requested or infeasible.
        motion: the motion that was asked for; None: one to a single goal, exactly.
    """

    index: int
    plan: Plan
    departure: PosePath | None = None
    then: ChosenMotion | None = None
    motion: MotionChoice | None = None

    @property
    def count(self) -> int:
        """Number of motions, one after the other, that arrive."""
        return int(self.plan.success) + (0 if self.then is None else self.then.count)

    @property
    def complete(self) -> bool:
        """True if all motions that were asked for arrive."""
        if self.motion is None or self.motion.then is None:
            return self.plan.success
        return self.then is not None and self.then.complete

    @property
    def margin(self) -> float:
        """Least distance of the joints to their limits [rad], of all motions."""
        return self.plan.margin if self.then is None else min(self.plan.margin, self.then.margin)

    @property
    def share(self) -> float:
        """Least share of a demonstration that is imitated, of all motions; rounded: a small detour is none."""
        own = min(round(self.plan.imitated_share, 1), 1.0)
        return own if self.then is None else min(own, self.then.share)

    @property
    def as_shown(self) -> bool:
        """True if all motions lead to the demonstrated path, without a detour."""
        made = self.plan.how in MADE and self.plan.imitated_share == 1.0
        return (self.plan.how == DIRECT or made) and (self.then is None or self.then.as_shown)

    @property
    def tail(self) -> PosePath:
        """The imitated path from the guiding pose on."""
        return self.plan.imitated[self.plan.guide :]

    @property
    def parts(self) -> list[tuple[PosePath, bool]]:
        """Paths to follow one after the other, each with True if it is followed exactly to its end."""
        exact = self.motion is None or self.motion.exact
        if self.plan.how == ESCAPE:
            return [(self.plan.path, exact)]
        away = [] if self.departure is None or self.plan.how not in (DIRECT, *MADE) else [(self.departure, False)]
        return [*away, (self.plan.path if self.plan.how in MADE else self.tail, exact)]

    @property
    def path(self) -> PosePath:
        """The whole path from the present pose of the arm, for display and as the path of a next motion."""
        if self.plan.how == ESCAPE:
            return self.plan.path
        if self.plan.how in MADE:
            return self.plan.path if self.departure is None else self.departure.joined(self.plan.path)
        here = self.plan.arm.fk(self.plan.joints[0])
        start = here if self.departure is None else self.departure[-1]
        path = final_path(start, self.plan.imitated, self.plan.guide)
        return path if self.departure is None else self.departure.joined(path)

    @property
    def next_motion(self) -> NextMotion | None:
        """The next motion, so that the posture at the end of this one suits it."""
        if self.then is None:
            return None
        plan = self.then.plan
        return NextMotion(self.then.path, plan.request.allowed, required=not math.isinf(plan.settings.max_deviation))


def choose(
    arm: Arm,
    settings: PlanSettings,
    q: np.ndarray,
    motion: MotionChoice,
    then: Callable[[int], MotionChoice] | None = None,
    motion_method: MotionMethod = SCREW,
) -> Resumable[ChosenMotion]:
    """Choose the goal of a motion that is reached best and from which the next motion is feasible.

    Searches in joint space are tried only where nothing else leads to a goal and on from there.

    Args:
        arm: the arm.
        settings: see `PlanSettings`; their motion has the tolerances of the execution.
        q: (dof,) present joints [rad].
        motion: the motion.
        then: returns the next motion by the index of the goal; None if there is none.
        motion_method: method of executing motions.

    Raises:
        PlanFailed: "blocked" or "ik_or_limit", no goal can be reached, and the motion is not to be followed blindly.
    """
    if then is not None:
        motion = motion._replace(then=then)
    best = yield from _best(motion_method, arm, replace(settings, search=None), q, motion)
    if settings.search is not None and not best.complete:
        few = motion._replace(goals=motion.goals[: motion.searched])
        best = yield from _best(motion_method, arm, settings, q, few, best)
    if motion.blindly:
        return best
    if not best.plan.success:
        reason = "ik_or_limit" if best.plan.reason == "ik_or_limit" else "blocked"
        raise PlanFailed(reason, f"no goal of {motion.name} can be reached along the demonstration: {best.plan.why}")
    if best.count < motion.parts:
        raise PlanFailed("ik_or_limit", f"no posture is found from which {motion.name} can be finished")
    return best


def departure_path(arm: Arm, settings: PlanSettings, q: np.ndarray, motion: MotionChoice) -> Resumable[PosePath | None]:
    """Return the departure of a motion: as demonstrated, or, if only that is feasible, straight up by the same length.

    Args:
        arm: the arm.
        settings: see `PlanSettings`.
        q: (dof,) present joints [rad].
        motion: the motion.

    Returns:
        The path; None if the motion has no departure.
    """
    length, radius = settings.motion.departure, settings.motion.pursuit.capture_radius
    if motion.leaving is None or length <= 0.0:
        return None
    start, planner = arm.fk(q), Planner(arm, motion.body, replace(settings, search=None))
    up = Pose.from_position_quaternion([0.0, 0.0, length]) @ start
    options = departure(motion.leaving, start, length), screw_path(start, up, radius)
    for path in options:
        plan = yield from planner.answering(PlanRequest(path, q, path[-1], _still(motion), motion.allowed))
        if plan.how == DIRECT:
            return path
    return options[0]


def _best(
    motion_method: MotionMethod,
    arm: Arm,
    settings: PlanSettings,
    q: np.ndarray,
    motion: MotionChoice,
    known: ChosenMotion | None = None,
) -> Resumable[ChosenMotion]:
    """Return the best choice among all goals and a known one, or the first one that is good enough.

    Each comes with the best choice of the next motion from there.
    """
    given, quick = settings, replace(settings, search=None)
    if not motion.detours:
        settings = replace(settings, trees=False, search=None, max_deviation=MAX_DEVIATION)
    if not (motion.detours and motion.guided):
        settings = replace(settings, motion=replace(settings.motion, guide=0.0))
    found = [] if known is None else [known]
    if known is not None and motion.is_enough(known):
        return known
    planner = motion_method.planner(arm, motion.body, settings)
    away = yield from departure_path(arm, settings, q, motion)
    for index in (yield from motion.candidates()):
        goal = motion.goals[index]
        following = None if motion.then is None else motion.then(index)
        yield PREPARED
        beginning = None if following is None else _beginning(following, goal, given)
        shown = motion.demonstrated[motion_method.skipped(motion.done) :]
        request = PlanRequest(
            shown, q, goal, _still(motion), motion.allowed, away, beginning, 0, motion.must_keep,
            None if motion.constraint is None else motion.constraint.ending(len(shown)), motion.keeping,
        )  # fmt: skip
        plan = yield from planner.answering(request)
        choice = ChosenMotion(index, plan, away, motion=motion)
        if plan.success and following is not None:
            best = yield from _best(motion_method, arm, quick, plan.joints[-1], following)
            choice = choice._replace(then=best if best.plan.success else None)
        found.append(choice)
        if motion.is_enough(choice):
            return choice
    return max(found, key=lambda choice: _rank(choice, motion.enough))


def _beginning(motion: MotionChoice, start: Pose, settings: PlanSettings) -> NextMotion | None:
    """Return the known part of the next motion's path before its goal is chosen."""
    if not motion.detours:
        return NextMotion(imitated_path(motion.demonstrated, motion.goals[0]), motion.allowed, required=True)
    if motion.leaving is None or settings.search is None:
        return None
    return NextMotion(departure(motion.leaving, start, settings.motion.departure))


def _rank(choice: ChosenMotion, enough: Enough | None) -> tuple[int, float, bool, float, int]:
    """Rank by the motions that arrive, then by how much they are like the demonstration, then by joint margin."""
    like = choice.share if enough is None else float(choice.as_shown)
    least = -math.inf if enough is None else enough.margin
    return choice.count, like, choice.margin >= least, choice.margin, -choice.index


def _still(motion: MotionChoice) -> tuple[Obstacle, ...]:
    return tuple(obstacle for obstacle in motion.obstacles if not moves(obstacle))
