"""Which of several goals a leg should end at: the one from which the task can go on.

Symmetric grasps and symmetric places look alike, but an arm among obstacles cannot do them all. Each is tried as it
will be done: planned with everything that stands around, what is held included, at the true tolerance and stall rule,
and from where that ends the next leg too. Not in the paper, which has one goal.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...planner.errors import PlanFailed
from ...planner.geometry.pose import Pose, PosePath
from ...planner.geometry.shapes import Obstacle, moves
from ...planner.imitation.tsia import departure, final_path, imitated_path, screw_path
from ...planner.planning.joint_space_motion import MAX_DEVIATION
from ...planner.planning.plan import NextMotion, Plan
from ...planner.planning.planner import Planner
from ...planner.planning.settings import PlanSettings
from ...planner.robot.arm import Arm
from ...planner.robot.body import Body
from ..motion.motion_method import DIRECT, ESCAPE, MADE, SCREW, MotionMethod


class MotionChoice(NamedTuple):
    """A leg that may end at any of several goals.

    Attributes:
        name: of what it is about, for messages.
        demonstrated: the segment to imitate.
        goals: where the tcp may end.
        body: of the arm, what it holds included.
        obstacles: what is around; what moves is left to the moment.
        allowed: contacts that are wanted, see `Planner.plan`.
        leaving: the segment whose beginning is imitated when leaving the start; None: none, blend at once.
        detours: along the path or not at all, see `ReactivePlanner.go`.
        done: index in `demonstrated` up to which leaving, now or before, has done it.
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
    """The goal that was chosen and how it is reached.

    Attributes:
        index: of the goal.
        plan: to it.
        departure: how the start is left; None: at once.
        then: the choice of the next leg from there; None if none was asked for, or it cannot be done.
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
        """Paths to follow one after the other, and whether exactly to its end."""
        if self.plan.how == ESCAPE:
            return [(self.plan.path, True)]
        away = [] if self.departure is None or self.plan.how not in (DIRECT, *MADE) else [(self.departure, False)]
        return [*away, (self.plan.path if self.plan.how in MADE else self.tail, True)]

    @property
    def path(self) -> PosePath:
        """All of it, from where the arm stands, for drawing and as the path that comes next."""
        if self.plan.how == ESCAPE:
            return self.plan.path
        if self.plan.how in MADE:
            return self.plan.path if self.departure is None else self.departure.joined(self.plan.path)
        here = self.plan.request.arm.fk(self.plan.joints[0])
        start = here if self.departure is None else self.departure[-1]
        path = final_path(start, self.plan.imitated, self.plan.guide)
        return path if self.departure is None else self.departure.joined(path)

    @property
    def next_motion(self) -> NextMotion | None:
        """The next leg, so that the posture at the end of this one suits it."""
        if self.then is None:
            return None
        request = self.then.plan.request
        return NextMotion(self.then.path, request.allowed, required=not math.isinf(request.settings.max_deviation))


def choose(
    arm: Arm,
    settings: PlanSettings,
    q: np.ndarray,
    leg: MotionChoice,
    then: Callable[[int], MotionChoice] | None = None,
    motion_method: MotionMethod = SCREW,
) -> ChosenMotion:
    """The goal of a leg that is reached best, and from which the next leg can be done.

    Searches in joint space are tried only where nothing else leads to a goal and on from there.

    Args:
        arm: the arm.
        settings: see `PlanSettings`; their motion has the tolerances of what will be done.
        q: (dof,) joints now.
        leg: the leg.
        then: the next leg, given the index of the goal; None if there is none.
        motion_method: how legs are moved.

    Raises:
        PlanFailed: "blocked" or "ik_or_limit", no goal can be reached.
    """
    quick = replace(settings, search=None)
    best = max(_choices(motion_method, arm, quick, quick, q, leg, then), key=_rank)
    if settings.search is not None and (not best.plan.success or (then is not None and best.then is None)):
        best = max([best, *_choices(motion_method, arm, settings, quick, q, leg, then)], key=_rank)
    if not best.plan.success:
        reason = "ik_or_limit" if best.plan.reason == "ik_or_limit" else "blocked"
        raise PlanFailed(reason, f"no goal of {leg.name} can be reached along the demonstration: {best.plan.why}")
    return best


def departure_path(arm: Arm, settings: PlanSettings, q: np.ndarray, leg: MotionChoice) -> PosePath | None:
    """How a leg leaves the start: as shown; where that cannot be done, straight up by as much, if that can be.

    None if the leg leaves at once.
    """
    length, radius = settings.motion.departure, settings.motion.pursuit.capture_radius
    if leg.leaving is None or length <= 0.0:
        return None
    start, planner = arm.fk(q), Planner(arm, leg.body, replace(settings, search=None))
    up = Pose.from_position_quaternion([0.0, 0.0, length]) @ start
    options = departure(leg.leaving, start, length), screw_path(start, up, radius)
    for path in options:
        if planner.plan(path, q, path[-1], _still(leg), allowed=leg.allowed).how == DIRECT:
            return path
    return options[0]


def _choices(
    motion_method: MotionMethod,
    arm: Arm,
    settings: PlanSettings,
    next_settings: PlanSettings,
    q: np.ndarray,
    leg: MotionChoice,
    then: Callable[[int], MotionChoice] | None,
) -> Iterator[ChosenMotion]:
    """A choice for every goal, and for every goal of the next leg from there the best."""
    if not leg.detours:
        settings = replace(
            settings, avoid=False, max_deviation=MAX_DEVIATION, motion=replace(settings.motion, guide=0.0)
        )
    planner, away = motion_method.planner(arm, leg.body, settings), departure_path(arm, settings, q, leg)
    for index, goal in enumerate(leg.goals):
        following = None if then is None else then(index)
        next_motion = None if following is None else _beginning(following, goal, settings)
        shown = leg.demonstrated[motion_method.skipped(leg.done) :]
        plan = planner.plan(shown, q, goal, _still(leg), allowed=leg.allowed, leaving=away, next_motion=next_motion)
        choice = ChosenMotion(index, plan, away)
        if plan.success and following is not None:
            best = max(
                _choices(motion_method, arm, next_settings, next_settings, plan.joints[-1], following, None), key=_rank
            )
            choice = choice._replace(then=best if best.plan.success else None)
        yield choice


def _beginning(leg: MotionChoice, start: Pose, settings: PlanSettings) -> NextMotion | None:
    """What is known of the way of a leg before its goal is chosen."""
    if not leg.detours:
        return NextMotion(imitated_path(leg.demonstrated, leg.goals[0]), leg.allowed, required=True)
    if leg.leaving is None or settings.search is None:
        return None
    return NextMotion(departure(leg.leaving, start, settings.motion.departure))


def _rank(choice: ChosenMotion) -> tuple[bool, bool, float, float, int]:
    """What is arrived at, then what can go on, then how much of the demonstration is kept, then the joint margins."""
    plans = [choice.plan] if choice.then is None else [choice.plan, choice.then.plan]
    kept, margin = (min(getattr(plan, name) for plan in plans) for name in ("kept", "margin"))
    return choice.plan.success, choice.then is not None, min(round(kept, 1), 1.0), margin, -choice.index


def _still(leg: MotionChoice) -> list[Obstacle]:
    return [obstacle for obstacle in leg.obstacles if not moves(obstacle)]
