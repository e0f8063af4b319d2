"""What a run says: one row of numbers, and a report that can be read on its own."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

from ..configs.schema import RunConfig
from .records import EpisodeRecord
from .statistics import median, wilson
from .tasks import TASKS


def summary_row(config: RunConfig, records: list[EpisodeRecord]) -> dict[str, Any]:
    """The numbers of one cell: method, task, robot, level and what came of it; None where there is nothing to tell."""
    successes = sum(record.success for record in records)
    low, high = wilson(successes, len(records))
    error = TASKS[config.task].error
    worst = [error.factor * max(record.numbers[error.key]) for record in records if record.success]
    clearances = [1e3 * record.clearance for record in records if record.clearance is not None]
    return {
        "method": config.method,
        "task": config.task,
        "robot": config.robot,
        "level": config.level,
        "episodes": len(records),
        "successes": successes,
        "safe_successes": sum(record.safe_success for record in records),
        "wilson_low": round(low, 4),
        "wilson_high": round(high, 4),
        **_middle_and_most("seconds", [record.seconds for record in records]),
        "error": f"{error.words} [{error.unit}]",
        **_middle_and_most("error", worst),
        **_middle_and_most("tick_us", [record.tick_us[0] for record in records]),
        "tick_us_p99": _middle([record.tick_us[1] for record in records]),
        "tick_us_max": max((record.tick_us[2] for record in records), default=None),
        "touching": sum(record.contacts > 0 for record in records),
        "clearance_mm_min": min(clearances, default=None),
        "refused": sum(record.refused for record in records),
        "failures": dict(Counter(record.failure_reason for record in records if not record.success)),
    }


def _middle(values: list[float]) -> float | None:
    return median(values) if values else None


def _middle_and_most(key: str, values: list[float]) -> dict[str, float | None]:
    return {f"{key}_median": _middle(values), f"{key}_max": max(values, default=None)}


def verdict(row: dict[str, Any]) -> list[str]:
    """Lines for the terminal and the top of the report."""
    failures = ", ".join(f"{reason} {count}" for reason, count in row["failures"].items()) or "none"
    times = f"{_said(row['tick_us_median'], '.0f')} us per tick (median), {_said(row['tick_us_p99'], '.0f')} us (p99)"
    what, _, unit = row["error"].rpartition(" [")
    most = row["error_max"]
    largest = "no success, so no error" if most is None else f"{what} {most:.1f} {unit[:-1]} in the successes"
    return [
        f"{row['successes']} of {row['episodes']} succeeded at {row['level']} "
        f"(Wilson 95 %: {row['wilson_low']:.2f} to {row['wilson_high']:.2f}), "
        f"{row['safe_successes']} without any unwanted contact",
        f"{_said(row['seconds_median'])} s simulated per episode (median), {largest}",
        f"planner {times}; failures: {failures}",
        *_beside_obstacles(row),
    ]


def _beside_obstacles(row: dict[str, Any]) -> list[str]:
    """A line about obstacles, if there were any."""
    if row["clearance_mm_min"] is None and not row["refused"]:
        return []
    drawn = row["episodes"] + row["refused"]
    return [
        f"obstacles touched in {row['touching']} of {row['episodes']} episodes, smallest distance "
        f"{_said(row['clearance_mm_min'])} mm; {row['refused']} of {drawn} starts had no room for them"
    ]


def write_summary(path: Path, rows: list[dict[str, Any]]) -> None:
    """The rows as `{"rows": [...]}`."""
    path.write_text(json.dumps({"rows": rows}, indent=2, allow_nan=False) + "\n", encoding="utf-8")


def _said(value: float | None, digits: str = ".1f") -> str:
    return "-" if value is None else f"{value:{digits}}"


def report_text(
    config: RunConfig, records: list[EpisodeRecord], row: dict[str, Any], notes: list[str], command: str
) -> str:
    """The report as Markdown."""
    parts = [
        f"# {config.name}: {config.method} on {config.task}, {config.robot}, {config.level}",
        "\n".join(f"- {line}" for line in verdict(row)),
        _table(row),
        _failures([record for record in records if not record.success], config),
        _unsafe([record for record in records if record.success and not record.safe]),
        "## Stage reached\n\n" + _stages(records),
        "## Planner time\n\n" + _times(records),
        "## One episode\n\n" + "\n\n".join(notes),
        f"## How to repeat it\n\n```\n{command}\n```\n\n"
        "Versions are in `environment.json`, the whole config in `config.yaml`, every episode in `episodes.jsonl`.",
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _table(row: dict[str, Any]) -> str:
    head = "| method | task | robot | level | episodes | success | safe success | Wilson 95 % | time [s] | error |"
    line = "|---|---|---|---|---|---|---|---|---|---|"
    cells = (
        row["method"],
        row["task"],
        row["robot"],
        row["level"],
        row["episodes"],
        row["successes"],
        row["safe_successes"],
        f"{row['wilson_low']:.2f} to {row['wilson_high']:.2f}",
        f"{_said(row['seconds_median'])} (max {_said(row['seconds_max'])})",
        "no success"
        if not row["successes"]
        else f"{row['error']} {_said(row['error_median'])} (max {_said(row['error_max'])})",
    )
    return "\n".join([head, line, "| " + " | ".join(_cell(cell) for cell in cells) + " |"])


def _failures(records: list[EpisodeRecord], config: RunConfig) -> str:
    if not records:
        return "## Failures\n\nNone."
    rows = ["| scenario | seed | reason | stage | explanation |", "|---|---|---|---|---|"]
    for record in records:
        cells = (record.index, record.seed, record.failure_reason, record.stage, record.detail)
        rows.append("| " + " | ".join(_cell(cell) for cell in cells) + " |")
    again = f"To see one: `onedemo run {config.name} seed=SEED episodes=1 level={config.level}`."
    return "## Failures\n\n" + "\n".join(rows) + "\n\n" + again


def _unsafe(records: list[EpisodeRecord]) -> str:
    if not records:
        return ""
    lines = [f"- seed {record.seed}: {_cell(record.collision)}" for record in records]
    return "## Successes with an unwanted contact\n\n" + "\n".join(lines)


def _stages(records: list[EpisodeRecord]) -> str:
    counts = Counter(record.stage for record in records)
    return "\n".join(f"- {_cell(stage)}: {count}" for stage, count in counts.most_common())


def _times(records: list[EpisodeRecord]) -> str:
    median_us, p99, largest = zip(*(record.tick_us[:3] for record in records), strict=True)
    rate = median([record.seconds / record.wall_seconds for record in records])
    return (
        f"Per tick of 20 ms, as called from Python: median {median(median_us):.0f} us, 99th percentile "
        f"{median(p99):.0f} us (medians over episodes); the longest tick {max(largest) / 1e3:.1f} ms, in which "
        f"a motion is planned with all its symmetric goals. An episode runs {rate:.0f} times faster than real time, "
        "physics included."
    )


def _cell(value: Any) -> str:
    """Text that can neither break a table nor become markup."""
    text = " ".join(str(value).split())
    for character in "\\|<>[]`*":
        text = text.replace(character, f"\\{character}")
    return text[:300]
