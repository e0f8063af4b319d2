"""How speeds are measured: lines of a table, and timing that noise hits evenly."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

BATCHES = 15
BATCH_SECONDS = 0.02


@dataclass(frozen=True, slots=True)
class Row:
    """One measured line.

    Attributes:
        name: what is measured.
        value: the figure; None where it could not be measured.
        unit: of the figure ("ratio", "us", "ms", "MB", "s").
        goal: largest value that is well; None where there is no bar.
        ok: the bar is met; None where there is none or nothing was measured.
        note: what it was measured against, or why it was not.
    """

    name: str
    value: float | None
    unit: str
    goal: float | None
    ok: bool | None
    note: str


def row(name: str, value: float, unit: str, goal: float | None, note: str = "") -> Row:
    """A measured line with its verdict."""
    return Row(name, value, unit, goal, None if goal is None else value <= goal, note)


def seconds_per_call(*functions: Callable[[], object], together: bool = False) -> list[float]:
    """Median seconds per call of each function, their batches interleaved so that noise hits all alike.

    Args:
        functions: what is measured.
        together: all are called equally often, for functions that go through the same states.
    """
    counts = []
    for function in functions:
        function()
        start = time.perf_counter()
        function()
        counts.append(max(1, round(BATCH_SECONDS / max(time.perf_counter() - start, 1e-9))))
    if together:
        counts = [min(counts)] * len(counts)
    samples: list[list[float]] = [[] for _ in functions]
    runs = list(zip(functions, counts, samples, strict=True))
    for batch in range(BATCHES):
        # there and back, so that what disturbs at a steady beat does not always hit the same one
        for function, count, sample in runs[:: -1 if batch % 2 else 1]:
            start = time.perf_counter()
            for _ in range(count):
                function()
            sample.append((time.perf_counter() - start) / count)
    return [statistics.median(sample) for sample in samples]
