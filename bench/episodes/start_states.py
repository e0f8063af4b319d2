"""The start that an environment has drawn, described and compared with a frozen one."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ...envs.simulation.moving_obstacles import ScheduledObstacle, described
from .scenarios import Scenario, ScenarioChanged

OBSERVED = ("joint_positions", "object_pose", "goal_pose", "furniture_pose")
"""Entries of the observation that a start consists of, besides the obstacles; those that a task has."""
DIGITS = 9
TOLERANCE = 1e-7
"""Starts that differ by less than this [m, rad] are the same: processors round differently."""


def drawn_start(env: Any, observation: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Objects, goals, joints and obstacles of an environment that has just been reset, as JSON can hold them.

    Poses are x y z [m] and wxyz in the world, joints [rad]; obstacles as in
    `envs.simulation.moving_obstacles.ScheduledObstacle`.
    """
    start: dict[str, Any] = {key: _rounded(observation[key]) for key in OBSERVED if key in observation}
    start["obstacles"] = [obstacle(each) for each in env.unwrapped.sim.obstacles.scheduled_obstacles]
    return start


def obstacle(each: ScheduledObstacle) -> dict[str, Any]:
    """Shape, size, place and motion of an obstacle."""
    numbers = {key: _rounded(getattr(each, key)) for key in ("center", "rotation", "long", "short")}
    scalars = {key: _rounded(getattr(each, key)) for key in ("frequency", "phase", "delay")}
    kind = type(each.shape).__name__.lower()
    return {
        "shape": kind,
        "size": _rounded(described(each.shape)),
        **numbers,
        **scalars,
        "motion": each.motion,
        "leg": each.leg,
    }


def check_start(scenario: Scenario, frozen: Mapping[str, Any], start: Mapping[str, Any]) -> None:
    """Compare a drawn start with the frozen one.

    Raises:
        ScenarioChanged: they differ; naming the first number that does.
    """
    found = difference("start", frozen, start)
    if found:
        raise ScenarioChanged(scenario.index, scenario.seed, found)


def difference(where: str, frozen: Any, drawn: Any) -> str:
    """The first place where two values of JSON differ, in words; "" if they do not."""
    if isinstance(frozen, Mapping) and isinstance(drawn, Mapping) and set(frozen) == set(drawn):
        pairs = [(f"{where}.{key}", frozen[key], drawn[key]) for key in frozen]
    elif isinstance(frozen, list) and isinstance(drawn, list) and len(frozen) == len(drawn):
        pairs = [(f"{where}[{k}]", frozen[k], drawn[k]) for k in range(len(frozen))]
    elif _same(frozen, drawn):
        return ""
    else:
        return f"{where} is drawn as {_short(drawn)}, frozen as {_short(frozen)}"
    return next((found for pair in pairs if (found := difference(*pair))), "")


def _same(frozen: Any, drawn: Any) -> bool:
    if isinstance(frozen, float | int) and isinstance(drawn, float | int):
        return math.isclose(frozen, drawn, rel_tol=0.0, abs_tol=TOLERANCE)
    return type(frozen) is type(drawn) and frozen == drawn


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _rounded(value: Any) -> Any:
    # adding zero makes a negative zero a positive one
    return (np.round(np.asarray(value, dtype=np.float64), DIGITS) + 0.0).tolist()
