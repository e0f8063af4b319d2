"""Decisions among moving obstacles: to go on, to wait, or to go round; of the safe options the one that arrives first.

Not in the paper, which plans at the present place of an obstacle.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..control.pursuit import fresh_pursuit_state
from ..escape.repet import MAX_OBSTACLES
from ..geometry.pose import Pose, PosePath
from ..geometry.shapes import Obstacle, moves
from ..planning.plan import Plan, PlanRequest
from ..planning.planner import Planner
from ..planning.planning_scene import PlanningScene, SceneTemplate
from ..resumable import SCENE, Resumable
from .prediction import Predictor, is_preferable, swept, windows

WAITS = (0.25, 0.5, 1.0)
"""Waiting times that are compared, as parts of the horizon."""


class Situation(NamedTuple):
    """The subject of a decision, as it is when the decision begins.

    Attributes:
        q: (dof,) joints.
        robot: the arm among the obstacles, see `robot_arrays`.
        path: the path that is followed.
        pursuit: (4,) state of its pursuit.
        rest: the part of the motion's own path that is left.
        obstacles: all obstacles.
        template: the arm and its body, for scenes.
        allowed: returns the allowed contacts that exist among given obstacles.
        detours: whether going round is an option.
        seed: of the plans of detours.
        kept: what their requests say of what the demonstration keeps.
    """

    q: np.ndarray
    robot: np.ndarray
    path: PosePath
    pursuit: np.ndarray
    rest: PosePath
    obstacles: Sequence[Obstacle]
    template: SceneTemplate
    allowed: Callable[[Sequence[Obstacle]], list[tuple[str, str]]]
    detours: bool
    seed: int
    kept: Mapping[str, Any]


class Decision(NamedTuple):
    """A decision.

    Attributes:
        waiting: the arm waits for a moving obstacle to pass.
        detour: the plan of a detour to follow; None: none.
    """

    waiting: bool = False
    detour: Plan | None = None


def decide(now: Situation, predictor: Predictor, planner: Planner, horizon: float) -> Resumable[Decision]:
    """Decide in slices: to go on, to wait, or to go round.

    Args:
        now: the situation.
        predictor: rolls out the options.
        planner: plans the detours.
        horizon: seconds that are predicted.
    """
    best, decision = (yield from predictor.ahead(now.robot, now.path, now.pursuit, now.q)), Decision()
    if best.conflict is None:
        return decision
    conflict = best.conflict
    for part in WAITS:
        other = yield from predictor.ahead(now.robot, now.path, now.pursuit, now.q, part * horizon)
        if is_preferable(other, best):
            best, decision = other, Decision(waiting=True)
    for start, end in windows(conflict, horizon) if now.detours else ():
        plan = yield from _detour(now, planner, start, end)
        if plan is not None:
            other = yield from predictor.ahead(now.robot, plan.path, fresh_pursuit_state(), now.q)
            if is_preferable(other, best):
                best, decision = other, Decision(detour=plan)
    return decision


def _detour(now: Situation, planner: Planner, start: float, end: float) -> Resumable[Plan | None]:
    """Plan round the places where moving obstacles will be in a time span [s], passing before or behind them."""
    still, goal, places = [obstacle for obstacle in now.obstacles if not moves(obstacle)], now.rest[-1], []
    for place in swept(now.obstacles, start, end):
        # an obstacle about to leave the arm or the goal alone: the roll-out shows whether it does in time
        if _spares_ends(now, planner, place, goal):
            places.append(place)
        yield SCENE
    around = still + places
    if len(around) > MAX_OBSTACLES:
        return None
    request = PlanRequest(now.rest, now.q, goal, tuple(around), tuple(now.allowed(around)), seed=now.seed, **now.kept)
    plan = yield from planner.answering(request)
    return plan if plan.how == "escape" else None


def _spares_ends(now: Situation, planner: Planner, place: Obstacle, goal: Pose) -> bool:
    settings = planner.settings
    alone = PlanningScene(now.template, [place], settings.repet.distance, now.allowed([place]))
    return min(alone.slack(now.q), alone.tool_slack(goal)) > settings.repet.distance - settings.safety.distance
