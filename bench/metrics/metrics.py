"""Metrics of an episode, from its trace and the simulator's final `info`; see `metric_table`."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np

from ...envs import facts_of
from ...planner import Demonstration
from .carry_segments import Carry, carries, carrying_tilt
from .clearance import Solids
from .demonstration_distance import deviation, end_of, length_of, shown, turning_of, way_ratio
from .smoothness import log_dimensionless_jerk, sparc
from .trace import Trace

MOVED = 1e-3
"""Change of a joint [rad] from which the arm counts as moving."""
Metrics = dict[str, float | None]
"""Values by name, see `metric_table`; None if there was nothing to measure."""


def metrics_of(
    trace: Trace,
    solids: Solids,
    task: str,
    numbers: Mapping[str, list[float]],
    demonstration: Demonstration | None,
    *,
    success: bool,
) -> Metrics:
    """Return all metrics of an episode; none depends on real time, so that they are reproducible.

    Args:
        trace: the episode.
        solids: collision geometry of its simulation.
        task: name of the task.
        numbers: the task's own numbers, as in the final `info`.
        demonstration: demonstration that the carries are compared with; None: no comparison.
        success: verdict of the simulator.
    """
    facts, near = facts_of(task), solids.clearance(trace)
    found = carries(trace, facts.poured_into)
    tilt, tilting = carrying_tilt(trace, found) if facts.upright else (None, None)
    values: Metrics = {
        "clearance": near.smallest,
        "clearance_robot": near.robot,
        "clearance_held": near.held,
        "tilt": tilt,
        "tilt_integral": tilting,
        **{
            name: max(map(abs, numbers[key]), default=None)
            for name, key in facts.task_metrics.items()
            if key in numbers
        },
        "path_length": sum(length_of(trace.tcp[:, arm, :3]) for arm in range(trace.tcp.shape[1])),
        "rotation_length": sum(turning_of(trace.tcp[:, arm, 3:]) for arm in range(trace.tcp.shape[1])),
        "time_to_goal": float(trace.time[-1]) if success else None,
        "first_motion": first_motion(trace),
        **_of_carries(trace, found, task, demonstration),
    }
    return {name: value if value is None or math.isfinite(value) else None for name, value in values.items()}


def first_motion(trace: Trace) -> float | None:
    """Return the simulated time [s] at which the first joint has moved; None if none has."""
    joints = trace.joints[:, trace.columns.ravel()]
    moved = np.flatnonzero((np.abs(joints - joints[0]) > MOVED).any(axis=1))
    return float(trace.time[moved[0]]) if len(moved) else None


def _of_carries(trace: Trace, found: list[Carry], task: str, demonstration: Demonstration | None) -> Metrics:
    """Return means over the carries of an episode; for the deviation the maximum."""
    facts, wanted = facts_of(task), shown(demonstration, task)
    ends = [end_of(trace, carry, poured=facts.poured_into is not None) for carry in found]
    pairs = list(zip(found, ends, strict=True))
    speeds = [_speed(trace, carry, end) for carry, end in pairs]
    rate = 1.0 / trace.dt if trace.dt else 0.0
    values: Metrics = {
        "log_dimensionless_jerk": _mean(log_dimensionless_jerk(speed, rate) for speed in speeds),
        "sparc": _mean(sparc(speed, rate) for speed in speeds),
    }
    if wanted is not None:
        strays = [deviation(trace, carry, end, wanted) for carry, end in pairs]
        values["path_ratio"] = _mean(way_ratio(trace, carry, end, wanted) for carry, end in pairs)
        values["deviation"] = max((stray for stray in strays if stray is not None), default=None)
    return values


def _speed(trace: Trace, carry: Carry, end: int) -> np.ndarray:
    """Return the speed of the tcp between ticks [m/s]."""
    points = trace.tcp[carry.first : end + 1, carry.arm, :3]
    return np.linalg.norm(np.diff(points, axis=0), axis=1) / trace.dt if len(points) > 1 else np.zeros(0)


def _mean(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None
