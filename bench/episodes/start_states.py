"""Drawn starts of an environment: description, and comparison with frozen starts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ...envs import ScheduledObstacle
from ...envs.simulation.moving_obstacles import described
from .scenarios import Scenario, ScenarioChanged

OBSERVED = ("joint_positions", "object_pose", "goal_pose", "furniture_pose")
"""Entries of the observation that describe a start, besides the obstacles; entries a task lacks are skipped."""
DIGITS = 9
TOLERANCE = 1e-7
"""Starts that differ by less than this [m, rad] count as equal: processors round differently."""


def drawn_start(env: Any, observation: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Return objects, goals, joints and obstacles of an environment after reset, as JSON values.

    Poses are x y z [m] and wxyz in the world, joints in [rad]; obstacles as in
    `envs.simulation.moving_obstacles.ScheduledObstacle`.

    Args:
        env: environment that has just been reset.
        observation: its observation.
    """
    start: dict[str, Any] = {key: _rounded(observation[key]) for key in OBSERVED if key in observation}
    start["obstacles"] = [obstacle(each) for each in env.unwrapped.sim.obstacles.scheduled_obstacles]
    return start


def obstacle(each: ScheduledObstacle) -> dict[str, Any]:
    """Return shape, size, place and motion of an obstacle as JSON values."""
    numbers = {key: _rounded(getattr(each, key)) for key in ("center", "rotation", "long", "short")}
    scalars = {key: _rounded(getattr(each, key)) for key in ("frequency", "phase", "delay")}
    kind = type(each.shape).__name__.lower()
    return {
        "shape": kind,
        "size": _rounded(described(each.shape)),
        **numbers,
        **scalars,
        "motion": each.motion,
        "leg": each.blocked_motion,
    }


def check_start(scenario: Scenario, frozen: Mapping[str, Any], start: Mapping[str, Any]) -> None:
    """Compare a drawn start with the frozen one.

    Args:
        scenario: the scenario, for the error.
        frozen: the start in the file.
        start: the start just drawn, see `drawn_start`.

    Raises:
        ScenarioChanged: they differ; the error names the first differing number.
    """
    found = difference("start", frozen, start)
    if found:
        raise ScenarioChanged(scenario.index, scenario.seed, found)


def difference(where: str, frozen: Any, drawn: Any) -> str:
    """Return the first difference between two JSON values in words; "" if there is none.

    Args:
        where: path of the values in the start, for the text.
        frozen: value in the file.
        drawn: value just drawn.
    """
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
    # adding zero turns a negative zero into a positive one
    return (np.round(np.asarray(value, dtype=np.float64), DIGITS) + 0.0).tolist()
