"""One episode: play a scenario with an environment and a policy, and record the outcome."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...baselines import Policy, PolicyReport
from ...configs import RunConfig
from ..metrics.clearance import solids_of
from ..metrics.demonstration_distance import demonstration_named
from ..metrics.metrics import metrics_of
from ..metrics.trace import Trace, TraceRecorder
from ..statistics import median, quantile
from .episode_records import EpisodeRecord
from .scenarios import Scenario, scenarios_of
from .world_clock import SLOW, Observer, PacedWorld, Pacing

GRACE_SECONDS = 2.0
"""Simulated time [s] between a policy declaring itself done and the end of the episode, so that a success can
settle."""
COMMON = ("is_success", "success", "safe", "n_contacts", "min_obstacle_distance", "layouts_refused")
"""Numbers and flags in `info` that every task has."""


@dataclass(frozen=True, slots=True, eq=False)
class Played:
    """A finished episode before judging.

    Attributes:
        trace: measurements of every control tick.
        info: the environment's last `info`.
        report: the policy's last report.
        ticks: real time of the policy per answer [s].
        first: number of answers until the first action that moves a joint; 0: no action did.
        begun: start time by `time.perf_counter` [s].
        world: the environment as the policy saw it, with its number of steps and the policy's CPU times.
    """

    trace: Trace
    info: dict[str, Any]
    report: PolicyReport
    ticks: list[float]
    first: int
    begun: float
    world: PacedWorld


def run_episode(
    env: Any, policy: Policy, scenario: Scenario, config: RunConfig, observer: Observer | None = None
) -> tuple[EpisodeRecord, PolicyReport]:
    """Run one scenario to its end; the environment judges success.

    Args:
        env: environment of the cell.
        policy: acts in the environment.
        scenario: start of the episode.
        config: config of the cell.
        observer: called at the start and after every step, see `Observer`; None: no calls.

    Returns:
        Record of the episode, and the policy's last report.
    """
    played = play(env, policy, scenario, observer, Pacing.of(config))
    return episode_record(env, played, scenario, config), played.report


def play(
    env: Any, policy: Policy, scenario: Scenario, observer: Observer | None = None, pacing: Pacing | None = None
) -> Played:
    """Let a policy act in a scenario until it is over; exceptions of the policy pass through.

    Args:
        env: environment of the cell.
        policy: acts in the environment.
        scenario: start of the episode.
        observer: called at the start and after every step, see `Observer`; None: no calls.
        pacing: how time passes; None: the world waits, and observations are not late.
    """
    begun, recorder = time.perf_counter(), TraceRecorder(env)
    world = PacedWorld(env, pacing or Pacing(), _watching(recorder, observer))
    world.begin(scenario)
    dt, arms = env.unwrapped.control_dt, len(env.unwrapped.arms)
    state, report, ticks, first, grace = None, PolicyReport(), [], 0, round(GRACE_SECONDS / dt)
    while not world.over and grace > 0:
        before = time.perf_counter()
        action, state = world.timed_call(partial(policy.predict, world.seen, state))
        ticks.append(time.perf_counter() - before)
        first = first or (len(ticks) if np.reshape(action, (arms, -1))[:, :-1].any() else 0)
        passed = world.hold(policy, state) + 1
        world.step(action)
        report = _report(policy, state)
        if report.done:
            grace = 0 if report.failure_reason else grace - passed
    return Played(recorder.trace(), world.info, report, ticks, first, begun, world)


def rehearse(env: Any, policy: Policy, config: RunConfig) -> None:
    """Play the first scenario of a cell while the world waits: loading compiled code then costs no time later.

    Args:
        env: environment of the config.
        policy: policy of the config.
        config: config of the cell.
    """
    # whatever fails here fails in an episode too, and is recorded there
    with suppress(Exception):
        play(env, policy, scenarios_of(config)[0])


def _watching(recorder: TraceRecorder, observer: Observer | None) -> Observer:
    """Return an observer that calls the recorder, then the observer if there is one."""

    def watch(env: Any, observation: Any) -> None:
        recorder(env, observation)
        if observer:
            observer(env, observation)

    return watch


def episode_record(
    env: Any, played: Played, scenario: Scenario, config: RunConfig, trajectories: Path | None = None
) -> EpisodeRecord:
    """Return the record of a played episode.

    Args:
        env: environment in which the episode was played.
        played: the played episode.
        scenario: its start.
        config: config of its cell.
        trajectories: folder for the trace, saved as CELL-INDEX.npz; None: the trace is not saved.
    """
    info, numbers, success = played.info, numbers_of(played.info), bool(played.info["success"])
    if trajectories is not None:
        played.trace.save(trajectories / f"{config.digest()}-{scenario.index}.npz")
    shown, solids = demonstration_named(config.demonstration), solids_of(env.unwrapped.sim)
    metrics = metrics_of(played.trace, solids, config.task, numbers, shown, success=success)
    seconds, world = env.unwrapped.control_dt * played.world.steps, played.world
    reason, detail = failure(info, played.report, seconds)
    clearance, ticks = float(info["min_obstacle_distance"]), played.ticks
    times = (median(ticks), quantile(ticks, 0.99), max(ticks), sum(ticks[: played.first or None]))
    return EpisodeRecord(
        cell=config.digest(),
        index=scenario.index,
        seed=scenario.seed,
        method=config.method,
        task=config.task_words,
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
        clock=config.clock,
        delay=config.delay,
        calls=len(ticks),
        slow_calls=sum(value > SLOW for value in world.cpu_seconds),
        longest_ms=1e3 * max(world.cpu_seconds),
        held=world.held,
    )


def failure(info: dict[str, Any], report: PolicyReport, seconds: float) -> tuple[str, str]:
    """Return why an episode failed: a reason of the failure taxonomy and one line for the reader.

    Args:
        info: the environment's last `info`.
        report: the policy's last report.
        seconds: simulated duration of the episode [s].

    Returns:
        Reason and explanation, both "" for a success.
    """
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
    """Return the task's own numbers: the numeric entries of `info` that are not in `COMMON`."""
    return {
        key: [float(entry) for entry in np.ravel(value)]
        for key, value in info.items()
        if key not in COMMON and isinstance(value, int | float | np.ndarray)
    }


def _said(values: list[float]) -> str:
    return " ".join(f"{value:.3g}" for value in values)


def _report(policy: Policy, state: Any) -> PolicyReport:
    """Return the policy's report, or an empty one if the policy does not report."""
    tell = getattr(policy, "report", None)
    return tell(state) if tell else PolicyReport()
