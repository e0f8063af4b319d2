"""Summary of a run: one row of numbers for each cell, and lines for the terminal."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

from ...configs import RunConfig
from ...configs.run_config import REAL
from ...envs import facts_of
from ..atomic_files import write_whole
from ..console import counted
from ..episodes.episode_records import EpisodeRecord
from ..episodes.world_clock import SLOW
from ..statistics import median, wilson
from .groups import outcome_of

SUMMARY = "summary.json"
DETAILS, SEEDS = 3, 5
"""Largest numbers of details per kind of failure, and of seeds per detail, on the terminal."""


def summary_row(config: RunConfig, records: list[EpisodeRecord]) -> dict[str, Any]:
    """Return the numbers of one cell: method, task, robot, level and results; None for numbers that do not exist.

    Args:
        config: config of the cell.
        records: its finished episodes.
    """
    successes = sum(record.success for record in records)
    low, high = wilson(successes, len(records))
    error = facts_of(config.task).error
    successful = [record for record in records if record.success]
    errors = [each.numbers.get(error.key) for each in successful] if error else []
    worst = [error.factor * max(found) for found in errors if found] if error else []
    timed = [record for record in records if max(record.tick_us) > 0.0]
    clearances = [1e3 * record.clearance for record in records if record.clearance is not None]
    return {
        "method": config.method,
        "task": config.task_words,
        "robot": config.robot,
        "level": config.condition,
        "episodes": len(records),
        "successes": successes,
        "safe_successes": sum(record.safe_success for record in records),
        "wilson_low": round(low, 4),
        "wilson_high": round(high, 4),
        **_middle_and_most("seconds", [record.seconds for record in timed]),
        "error": f"{error.words} [{error.unit}]" if error else None,
        **_middle_and_most("error", worst),
        **_middle_and_most("tick_us", [record.tick_us[0] for record in timed]),
        "tick_us_p99": _middle([record.tick_us[1] for record in timed]),
        "tick_us_max": max((record.tick_us[2] for record in timed), default=None),
        "clock": config.clock,
        "delay": config.delay,
        "calls": sum(record.calls for record in records),
        "slow_calls": sum(record.slow_calls for record in records),
        "longest_ms": max((record.longest_ms for record in records if record.calls), default=None),
        "held": sum(record.held for record in records),
        "touching": sum(record.contacts > 0 for record in records),
        "clearance_mm_min": min(clearances, default=None),
        "refused": sum(record.refused for record in records),
        "failures": dict(Counter(outcome_of(record) for record in records if not record.success)),
        "failure_details": _details(records),
    }


def clocks(rows: list[dict[str, Any]]) -> list[str]:
    """Return a line for each clock and delay in the rows of a summary: what it is, and how many ticks were slow."""
    lines = []
    conditions = {(row["clock"], row["delay"]) for row in rows}
    for clock, delay in sorted(conditions, key=lambda each: (each[0] == REAL, each[1])):
        here = [row for row in rows if (row["clock"], row["delay"]) == (clock, delay)]
        slow, calls, held = (sum(row[key] for row in here) for key in ("slow_calls", "calls", "held"))
        goes_on = f"real, the world went on for {counted(held, 'tick')} while the policy computed"
        words = goes_on if clock == REAL else "the world waits while the policy computes"
        late = f", observations are {counted(delay, 'tick')} late" if delay else ""
        worst = max(row["longest_ms"] or 0.0 for row in here)
        times = f"; {slow} of {calls} ticks above {1e3 * SLOW:.0f} ms of CPU time, the longest {worst:.0f} ms"
        lines.append(f"clock: {words}{late}{times if calls else ''}")
    return lines


def _details(records: list[EpisodeRecord]) -> dict[str, list[str]]:
    """Return the details of failures by reason, the most frequent first, each with a seed."""
    found: dict[str, dict[str, list[int]]] = {}
    for record in records:
        if not record.success:
            found.setdefault(outcome_of(record), {}).setdefault(record.detail, []).append(record.seed)
    return {
        reason: [
            f"{detail or 'no detail'} (seed {', '.join(map(str, seeds[:SEEDS]))}{', …' * (len(seeds) > SEEDS)})"
            for detail, seeds in sorted(details.items(), key=lambda each: -len(each[1]))
        ]
        for reason, details in found.items()
    }


def _middle(values: list[float]) -> float | None:
    return median(values) if values else None


def _middle_and_most(key: str, values: list[float]) -> dict[str, float | None]:
    return {f"{key}_median": _middle(values), f"{key}_max": max(values, default=None)}


def verdict(row: dict[str, Any]) -> list[str]:
    """Return the lines about a cell for the terminal."""
    failures = ", ".join(f"{reason} {count}" for reason, count in row["failures"].items()) or "none"
    times = f"{_said(row['tick_us_median'], '.0f')} us per tick (median), {_said(row['tick_us_p99'], '.0f')} us (p99)"
    return [
        f"{row['successes']} of {row['episodes']} succeeded at {row['level']} "
        f"(Wilson 95 %: {row['wilson_low']:.2f} to {row['wilson_high']:.2f}), "
        f"{row['safe_successes']} without any unwanted contact",
        f"{_said(row['seconds_median'])} s simulated per episode (median){_largest(row)}",
        f"planner {times}; failures: {failures}",
        *why_failed(row),
        *_beside_obstacles(row),
    ]


def _largest(row: dict[str, Any]) -> str:
    """Return the largest error in words; "" if the task has no error measure."""
    if row["error"] is None:
        return ""
    what, _, unit = row["error"].rpartition(" [")
    most = row["error_max"]
    return ", no success, so no error" if most is None else f", {what} {most:.1f} {unit[:-1]} in the successes"


def why_failed(row: dict[str, Any]) -> list[str]:
    """Return a line for each kind of failure of a cell: its number, and why, with the seeds."""
    lines = []
    for reason, details in row["failure_details"].items():
        more = f"; and {len(details) - DETAILS} more reasons, see the report" if len(details) > DETAILS else ""
        lines.append(f"  {row['failures'][reason]} {reason}: {'; '.join(details[:DETAILS])}{more}")
    return lines


def _beside_obstacles(row: dict[str, Any]) -> list[str]:
    """Return a line about obstacles, if there were any."""
    if row["clearance_mm_min"] is None and not row["refused"]:
        return []
    drawn = row["episodes"] + row["refused"]
    return [
        f"obstacles touched in {row['touching']} of {row['episodes']} episodes, smallest distance "
        f"{_said(row['clearance_mm_min'])} mm; {row['refused']} of {drawn} starts had no room for them"
    ]


def write_summary(path: Path, rows: list[dict[str, Any]]) -> None:
    """Write the rows as `{"rows": [...]}`.

    Args:
        path: file to write.
        rows: rows of `summary_row`.
    """
    write_whole(path, json.dumps({"rows": rows}, indent=2, allow_nan=False) + "\n")


def _said(value: float | None, digits: str = ".1f") -> str:
    return "-" if value is None else f"{value:{digits}}"
