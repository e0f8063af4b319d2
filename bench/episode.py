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
        position_error=[float(value) for value in info["position_error"]],
        yaw_error=[float(value) for value in info["yaw_error"]],
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
    worst = (
        f"largest error {1e3 * np.max(info['position_error']):.1f} mm, {np.degrees(np.max(info['yaw_error'])):.1f} deg"
    )
    if info["failure_reason"]:
        return info["failure_reason"], worst
    if info["collision"]:
        return "collision", f"{info['collision']}; {worst}"
    if report.done:
        return "constraint", f"placed, but not within tolerance; {worst}"
    return "timeout", f"not finished after {seconds:.0f} s; {worst}"


def _report(policy: Policy, state: Any) -> PolicyReport:
    """What the policy says, if it says anything."""
    tell = getattr(policy, "report", None)
    return tell(state) if tell else PolicyReport()
