"""Choice among the goals of a motion: the goal from which the task can continue.

Symmetric grasps and places are equivalent, but an arm among obstacles cannot reach all of them. Each is tried as it
will be executed: planned among all obstacles, held object included, with the real tolerance and stall rule, and
followed by the next motion from its end. Not in the paper, which has one goal.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
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
    PlanSettings,
    Pose,
    PosePath,
    final_path,
    imitated_path,
)
from ...planner.errors import PlanFailed
from ...planner.geometry.shapes import moves
from ...planner.imitation.tsia import departure, screw_path
from ...planner.planning.joint_space_motion import MAX_DEVIATION
from ..motion.motion_method import DIRECT, ESCAPE, MADE, SCREW, MotionMethod


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


class ChosenMotion(NamedTuple):
    """The chosen goal and the motion to it.

    Attributes:
        index: index of the goal.
        plan: plan to the goal.
        departure: path of the departure; None: no departure.
        then: the choice of the next motion from there; None if not requested or infeasible.
    """

    index: int
    plan: Plan
    departure: PosePath | None = None
    then: ChosenMotion | None = None

    @property
    def tail(self) -> PosePath:
        """The imitated path from the guiding pose on."""
        return self.plan.imitated[self.plan.guide :]

    @property
    def parts(self) -> list[tuple[PosePath, bool]]:
        """Paths to follow one after the other, each with True if it is followed exactly to its end."""
        if self.plan.how == ESCAPE:
            return [(self.plan.path, True)]
        away = [] if self.departure is None or self.plan.how not in (DIRECT, *MADE) else [(self.departure, False)]
        return [*away, (self.plan.path if self.plan.how in MADE else self.tail, True)]

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
) -> ChosenMotion:
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
        PlanFailed: "blocked" or "ik_or_limit", no goal can be reached.
    """
    quick = replace(settings, search=None)
    best = max(_choices(motion_method, arm, quick, quick, q, motion, then), key=_rank)
    if settings.search is not None and (not best.plan.success or (then is not None and best.then is None)):
        best = max([best, *_choices(motion_method, arm, settings, quick, q, motion, then)], key=_rank)
    if not best.plan.success:
        reason = "ik_or_limit" if best.plan.reason == "ik_or_limit" else "blocked"
        raise PlanFailed(reason, f"no goal of {motion.name} can be reached along the demonstration: {best.plan.why}")
    return best


def departure_path(arm: Arm, settings: PlanSettings, q: np.ndarray, motion: MotionChoice) -> PosePath | None:
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
        if planner.plan(path, q, path[-1], _still(motion), allowed=motion.allowed).how == DIRECT:
            return path
    return options[0]


def _choices(
    motion_method: MotionMethod,
    arm: Arm,
    settings: PlanSettings,
    next_settings: PlanSettings,
    q: np.ndarray,
    motion: MotionChoice,
    then: Callable[[int], MotionChoice] | None,
) -> Iterator[ChosenMotion]:
    """Yield a choice for every goal, each with the best choice of the next motion from there."""
    if not motion.detours:
        settings = replace(
            settings, avoid=False, max_deviation=MAX_DEVIATION, motion=replace(settings.motion, guide=0.0)
        )
    planner, away = motion_method.planner(arm, motion.body, settings), departure_path(arm, settings, q, motion)
    for index, goal in enumerate(motion.goals):
        following = None if then is None else then(index)
        next_motion = None if following is None else _beginning(following, goal, settings)
        shown = motion.demonstrated[motion_method.skipped(motion.done) :]
        plan = planner.plan(
            shown, q, goal, _still(motion), allowed=motion.allowed, leaving=away, next_motion=next_motion
        )
        choice = ChosenMotion(index, plan, away)
        if plan.success and following is not None:
            best = max(
                _choices(motion_method, arm, next_settings, next_settings, plan.joints[-1], following, None), key=_rank
            )
            choice = choice._replace(then=best if best.plan.success else None)
        yield choice


def _beginning(motion: MotionChoice, start: Pose, settings: PlanSettings) -> NextMotion | None:
    """Return the known part of the next motion's path before its goal is chosen."""
    if not motion.detours:
        return NextMotion(imitated_path(motion.demonstrated, motion.goals[0]), motion.allowed, required=True)
    if motion.leaving is None or settings.search is None:
        return None
    return NextMotion(departure(motion.leaving, start, settings.motion.departure))


def _rank(choice: ChosenMotion) -> tuple[bool, bool, float, float, int]:
    """Rank by arrival, then continuation, then fraction of the demonstration imitated, then joint margin."""
    plans = [choice.plan] if choice.then is None else [choice.plan, choice.then.plan]
    share, margin = (min(getattr(plan, name) for plan in plans) for name in ("imitated_share", "margin"))
    return choice.plan.success, choice.then is not None, min(round(share, 1), 1.0), margin, -choice.index


def _still(motion: MotionChoice) -> list[Obstacle]:
    return [obstacle for obstacle in motion.obstacles if not moves(obstacle)]
