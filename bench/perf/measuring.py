"""Measurement of speeds: rows of the table, and timing that exposes all functions to the same noise."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

BATCHES = 15
"""Number of batches per function."""
BATCH_SECONDS = 0.02
"""Approximate duration [s] of a batch."""


@dataclass(frozen=True, slots=True)
class Row:
    """Row of the table of measurements.

    Attributes:
        name: what is measured.
        value: measured value; None if it could not be measured.
        unit: unit of the value ("ratio", "us", "ms", "MB", "s").
        goal: largest value that passes; None if there is no limit.
        ok: whether the row passes; None if there is no limit or no value.
        note: reference of the measurement, or the reason why there is no value.
    """

    name: str
    value: float | None
    unit: str
    goal: float | None
    ok: bool | None
    note: str


def row(name: str, value: float, unit: str, goal: float | None, note: str = "") -> Row:
    """Return a measured row with its verdict.

    Args:
        name: see `Row`.
        value: see `Row`.
        unit: see `Row`.
        goal: see `Row`.
        note: see `Row`.
    """
    return Row(name, value, unit, goal, None if goal is None else value <= goal, note)


def seconds_per_call(
    *functions: Callable[[], object], together: bool = False, clock: Callable[[], float] = time.perf_counter
) -> list[float]:
    """Return the median time [s] per call of each function; interleaved batches expose all functions to the same noise.

    Args:
        functions: functions to measure.
        together: call all functions equally often, for functions that step through the same states.
        clock: what is measured [s]: elapsed time, or `time.process_time` for work that other programs interrupt.
    """
    counts = []
    for function in functions:
        function()
        start = clock()
        function()
        counts.append(max(1, round(BATCH_SECONDS / max(clock() - start, 1e-9))))
    if together:
        counts = [min(counts)] * len(counts)
    samples: list[list[float]] = [[] for _ in functions]
    runs = list(zip(functions, counts, samples, strict=True))
    for batch in range(BATCHES):
        # alternating order, so that a periodic disturbance does not always hit the same function
        for function, count, sample in runs[:: -1 if batch % 2 else 1]:
            start = clock()
            for _ in range(count):
                function()
            sample.append((clock() - start) / count)
    return [statistics.median(sample) for sample in samples]
