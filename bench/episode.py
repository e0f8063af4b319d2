"""One episode: an environment, a policy, a scenario, and the record of what happened."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from ..baselines.policy import Policy, PolicyReport
from ..configs.schema import RunConfig
from .records import EpisodeRecord
from .scenarios import Scenario
from .statistics import median, quantile

GRACE_SECONDS = 2.0
"""Time that the simulator gets to judge after a policy has declared that it is done."""
COMMON = ("is_success", "success", "safe", "n_contacts", "min_obstacle_distance", "layouts_refused")
"""Numbers and flags in `info` that every task has."""
Observer = Callable[[Any, Any], None]
"""Called with the environment and the observation at the start and after every step."""


def run_episode(
    env: Any, policy: Policy, scenario: Scenario, config: RunConfig, observer: Observer | None = None
) -> tuple[EpisodeRecord, PolicyReport]:
    """Run one scenario to its end; success is what the environment says at the end."""
    started = time.perf_counter()
    observation, info = env.reset(seed=scenario.seed, options={"level": scenario.level})
    dt = env.unwrapped.control_dt
    state, report, ticks, steps, grace = None, PolicyReport(), [], 0, round(GRACE_SECONDS / dt)
    if observer:
        observer(env, observation)
    over = False
    while not over and grace > 0:
        before = time.perf_counter()
        action, state = policy.predict(observation, state)
        ticks.append(time.perf_counter() - before)
        observation, _, terminated, truncated, info = env.step(action)
        over, steps = terminated or truncated, steps + 1
        if observer:
            observer(env, observation)
        report = _report(policy, state)
        if report.done:
            grace = 0 if report.failure_reason else grace - 1
    reason, detail = failure(info, report, dt * steps)
    record = EpisodeRecord(
        index=scenario.index,
        seed=scenario.seed,
        method=config.method,
        task=config.task,
        robot=config.robot,
        level=scenario.level,
        success=bool(info["success"]),
        safe=bool(info["safe"]),
        stage=info["stage"],
        failure_reason=reason,
        detail=detail,
        collision=info["collision"],
        seconds=round(dt * steps, 6),
        contacts=int(info["n_contacts"]),
        clearance=clearance if np.isfinite(clearance := float(info["min_obstacle_distance"])) else None,
        refused=int(info["layouts_refused"]),
        numbers=numbers_of(info),
        wall_seconds=time.perf_counter() - started,
        tick_us=[1e6 * value for value in (median(ticks), quantile(ticks, 0.99), max(ticks))],
    )
    return record, report


def failure(info: dict[str, Any], report: PolicyReport, seconds: float) -> tuple[str, str]:
    """Why an episode failed, in the words of the taxonomy, and one line for the reader; "" for a success."""
    if info["success"]:
        return "", ""
    if report.failure_reason:
        return report.failure_reason, report.detail
    worst = ", ".join(f"{key} {_said(values)}" for key, values in numbers_of(info).items())
    if info["failure_reason"]:
        return info["failure_reason"], worst
    if info["collision"]:
        return "collision", f"{info['collision']}; {worst}"
    if report.done:
        return "constraint", f"done, but not within tolerance; {worst}"
    return "timeout", f"not finished after {seconds:.0f} s; {worst}"


def numbers_of(info: dict[str, Any]) -> dict[str, list[float]]:
    """The task's own numbers: what is in `info` besides what every task has."""
    return {
        key: [float(entry) for entry in np.ravel(value)]
        for key, value in info.items()
        if key not in COMMON and isinstance(value, int | float | np.ndarray)
    }


def _said(values: list[float]) -> str:
    return " ".join(f"{value:.3g}" for value in values)


def _report(policy: Policy, state: Any) -> PolicyReport:
    """What the policy says, if it says anything."""
    tell = getattr(policy, "report", None)
    return tell(state) if tell else PolicyReport()
