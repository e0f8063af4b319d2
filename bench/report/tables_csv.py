"""Numbers of a report as CSV: one row per episode, one row per cell."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from ...configs import RunConfig
from ..document.untrusted_text import csv_text
from ..episodes.episode_records import EpisodeRecord
from ..metrics.metric_table import METRICS
from ..statistics import interquartile_mean, median
from .groups import Group, groups_of
from .read_runs import Run

EPISODE_WORDS = ("cell", "task", "robot", "level", "method")
EPISODE_NUMBERS = ("index", "seed", "success", "safe", "seconds", "contacts", "refused", "wall_seconds")
EPISODE_ENDS = ("stage", "failure_reason", "detail", "collision")
TICKS = ("tick_us_median", "tick_us_p99", "tick_us_max", "first_us")
CLOCK = ("clock", "delay", "calls", "slow_calls", "longest_ms", "held")
"""Names of the record's fields on its clock, and of the columns."""
RATES = ("success", "safe_success")


def write_tables(run: Run, output: Path) -> list[Path]:
    """Write `episodes.csv` and `summary.csv`.

    Args:
        run: the run.
        output: folder of the report.

    Returns:
        The files written.
    """
    groups = groups_of(run)
    episodes, summary = output / "episodes.csv", output / "summary.csv"
    head = [*EPISODE_WORDS, *EPISODE_NUMBERS, *EPISODE_ENDS, *METRICS, *TICKS, *CLOCK]
    _write(episodes, head, (_episode(record) for group in groups for record in group.records))
    rates = [f"{rate}{part}" for rate in RATES for part in ("es", "_rate", "_low", "_high")]
    head = [
        *EPISODE_WORDS,
        "planned",
        "episodes",
        *rates,
        "touching",
        "refused",
        "failures",
        *(f"{name}_iqm" for name in METRICS),
        *TICKS[:3],
        *CLOCK,
    ]
    _write(summary, head, map(_cell, groups))
    return [episodes, summary]


def _write(path: Path, head: Sequence[str], rows: Iterable[list[Any]]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(head)
        writer.writerows(rows)


def _episode(record: EpisodeRecord) -> list[Any]:
    numbers = [getattr(record, name) for name in EPISODE_NUMBERS]
    metrics = [record.metrics.get(name) for name in METRICS]
    ticks = [round(value, 3) for value in record.tick_us[: len(TICKS)]]
    words = [csv_text(getattr(record, name)) for name in EPISODE_WORDS]
    ends = [csv_text(getattr(record, name)) for name in EPISODE_ENDS]
    values = [*map(_value, [*numbers, *metrics, *ticks]), *[""] * (len(TICKS) - len(ticks))]
    return [*words, *values[: len(numbers)], *ends, *values[len(numbers) :], *_clock(record, [record])]


def _cell(group: Group) -> list[Any]:
    cell, count = group.cell, len(group.records)
    rates: list[Any] = []
    for rate in (group.success, group.safe_success):
        rates += [rate.count, _value(rate.share if count else None), round(rate.low, 4), round(rate.high, 4)]
    failures = {reason: number for reason, number in group.outcomes.items() if "success" not in reason}
    listed = "; ".join(f"{reason} {number}" for reason, number in sorted(failures.items()))
    metrics = [_value(interquartile_mean(known) if len(known := group.values(name)) else None) for name in METRICS]
    ticks = list(zip(*(record.tick_us[:3] for record in group.records), strict=True))
    times = [median(ticks[0]), median(ticks[1]), max(ticks[2])] if ticks else [None] * 3
    words = [csv_text(word) for word in (cell.digest(), cell.task_words, cell.robot, cell.condition, cell.method)]
    clock = _clock(cell, group.records)
    touching, refused = sum(r.contacts > 0 for r in group.records), sum(r.refused for r in group.records)
    return [
        *words,
        group.planned,
        count,
        *rates,
        touching,
        refused,
        csv_text(listed),
        *metrics,
        *map(_value, times),
        *clock,
    ]


def _clock(conditions: EpisodeRecord | RunConfig, records: list[EpisodeRecord]) -> list[Any]:
    """Return the columns of `CLOCK`; where no record has them, as in those of earlier versions, "" for the times."""
    known = [record for record in records if record.calls]
    calls, slow, held = (sum(getattr(each, name) for each in known) for name in ("calls", "slow_calls", "held"))
    times = [calls, slow, round(max(each.longest_ms for each in known), 3), held] if known else [""] * 4
    return [conditions.clock, conditions.delay, *map(_value, times)]


def _value(value: Any) -> Any:
    """Return a value as text for CSV: flags as 0 and 1, numbers with nine digits, "" for None."""
    if value is None:
        return ""
    return int(value) if isinstance(value, bool) else f"{value:.9g}" if isinstance(value, float) else value
