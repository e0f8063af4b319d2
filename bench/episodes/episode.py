"""One episode: an environment, a policy, a scenario, and the record of what happened."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...baselines.policy import Policy, PolicyReport
from ...configs.grid import RunConfig
from ..metrics.clearance import solids_of
from ..metrics.demonstration_distance import demonstration_named
from ..metrics.metrics import metrics_of
from ..metrics.trace import Trace, TraceRecorder
from ..statistics import median, quantile
from .episode_records import EpisodeRecord
from .scenarios import Scenario

GRACE_SECONDS = 2.0
"""Time that the simulator gets to judge after a policy has declared that it is done."""
COMMON = ("is_success", "success", "safe", "n_contacts", "min_obstacle_distance", "layouts_refused")
"""Numbers and flags in `info` that every task has."""
Observer = Callable[[Any, Any], None]
"""Called with the environment and the observation at the start and after every step."""


@dataclass(frozen=True, slots=True, eq=False)
class Played:
    """An episode that has come to its end and is yet to be judged.

    Attributes:
        trace: what was measured.
        info: the environment's last.
        report: the policy's last.
        ticks: real time of the policy in each tick [s].
        first: how many ticks there were until an action moved something; 0: none did.
        begun: when it began [s], by `time.perf_counter`.
    """

    trace: Trace
    info: dict[str, Any]
    report: PolicyReport
    ticks: list[float]
    first: int
    begun: float


def run_episode(
    env: Any, policy: Policy, scenario: Scenario, config: RunConfig, observer: Observer | None = None
) -> tuple[EpisodeRecord, PolicyReport]:
    """Run one scenario to its end; success is what the environment says at the end."""
    played = play(env, policy, scenario, observer)
    return episode_record(env, played, scenario, config), played.report


def play(env: Any, policy: Policy, scenario: Scenario, observer: Observer | None = None) -> Played:
    """Let a policy act in a scenario until it is over; raises what the policy raises.

    Args:
        env: the environment.
        policy: who acts.
        scenario: where it begins.
        observer: see `Observer`.
    """
    begun, recorder = time.perf_counter(), TraceRecorder(env)
    observation, info = env.reset(seed=scenario.seed, options={"level": scenario.level})
    dt, arms = env.unwrapped.control_dt, len(env.unwrapped.arms)
    state, report, ticks, first, grace = None, PolicyReport(), [], 0, round(GRACE_SECONDS / dt)
    watch = _watching(recorder, observer)
    watch(env, observation)
    over = False
    while not over and grace > 0:
        before = time.perf_counter()
        action, state = policy.predict(observation, state)
        ticks.append(time.perf_counter() - before)
        first = first or (len(ticks) if np.reshape(action, (arms, -1))[:, :-1].any() else 0)
        observation, _, terminated, truncated, info = env.step(action)
        over = terminated or truncated
        watch(env, observation)
        report = _report(policy, state)
        if report.done:
            grace = 0 if report.failure_reason else grace - 1
    return Played(recorder.trace(), info, report, ticks, first, begun)


def _watching(recorder: TraceRecorder, observer: Observer | None) -> Observer:
    """Both, one after the other."""

    def watch(env: Any, observation: Any) -> None:
        recorder(env, observation)
        if observer:
            observer(env, observation)

    return watch


def episode_record(
    env: Any, played: Played, scenario: Scenario, config: RunConfig, trajectories: Path | None = None
) -> EpisodeRecord:
    """The record of an episode.

    Args:
        env: the environment that it was played in.
        played: how it went.
        scenario: where it began.
        config: what the record says of the run.
        trajectories: folder into which the trace is written, as CELL-INDEX.npz; None: it is not kept.
    """
    info, numbers, success = played.info, numbers_of(played.info), bool(played.info["success"])
    if trajectories is not None:
        played.trace.save(trajectories / f"{config.digest()}-{scenario.index}.npz")
    shown, solids = demonstration_named(config.demonstration), solids_of(env.unwrapped.sim)
    metrics = metrics_of(played.trace, solids, config.task, numbers, shown, success=success)
    seconds = env.unwrapped.control_dt * len(played.ticks)
    reason, detail = failure(info, played.report, seconds)
    clearance, ticks = float(info["min_obstacle_distance"]), played.ticks
    times = (median(ticks), quantile(ticks, 0.99), max(ticks), sum(ticks[: played.first or None]))
    return EpisodeRecord(
        cell=config.digest(),
        index=scenario.index,
        seed=scenario.seed,
        method=config.method,
        task=config.task,
        robot=config.robot,
        level=scenario.level,
        success=success,
        safe=bool(info["safe"]),
        stage=info["stage"],
        failure_reason=reason,
        detail=detail,
        collision=info["collision"],
        seconds=round(seconds, 6),
        contacts=int(info["n_contacts"]),
        clearance=clearance if np.isfinite(clearance) else None,
        refused=int(info["layouts_refused"]),
        numbers=numbers,
        metrics=metrics,
        wall_seconds=time.perf_counter() - played.begun,
        tick_us=[1e6 * value for value in times],
    )


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
