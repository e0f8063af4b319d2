"""Intervals and paired tests of the geometric tier."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

RESAMPLES = 1000


def median_interval(values: Sequence[float]) -> tuple[float, float, float]:
    """Median and its 95 % bootstrap interval (percentiles of 1000 resamples, the same for the same values)."""
    array = np.asarray(values, dtype=np.float64)
    if not len(array):
        return float("nan"), float("nan"), float("nan")
    rng = np.random.default_rng(0)
    drawn = rng.integers(0, len(array), (RESAMPLES, len(array)))
    low, high = np.quantile(np.median(array[drawn], axis=1), (0.025, 0.975))
    return float(np.median(array)), float(low), float(high)


def mcnemar(first: Sequence[bool], second: Sequence[bool]) -> tuple[int, int, float]:
    """How often only the first of two succeeds, how often only the second, and the exact two-sided p of McNemar."""
    from scipy.stats import binomtest

    pairs = list(zip(first, second, strict=True))
    mine, theirs = sum(a and not b for a, b in pairs), sum(b and not a for a, b in pairs)
    return mine, theirs, float(binomtest(mine, mine + theirs).pvalue) if mine + theirs else 1.0


def holm(values: Sequence[float]) -> list[float]:
    """p-values corrected for their number by Holm's method, in the order given."""
    out, largest = [0.0] * len(values), 0.0
    for rank, k in enumerate(np.argsort(values, kind="stable")):
        largest = max(largest, min(1.0, (len(values) - rank) * values[k]))
        out[k] = largest
    return out
