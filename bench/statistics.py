"""Numbers of a table: intervals, paired tests and their correction, all on scipy and all from stated seeds.

Not in the paper. The number of episodes is fixed by the config before the first one runs: nothing here is for looking
at results and going on until they please.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

Values = Sequence[float] | np.ndarray
RESAMPLES = 2000
"""Draws of a bootstrap: the error of its 95 % ends is then some percent of their distance."""
MEDIANS = 1000
"""Draws of a bootstrap of medians."""
AT_ONCE = 2_000_000
"""Numbers drawn together."""


def wilson(successes: int, episodes: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a success rate; (0, 1) without episodes."""
    from scipy.stats import binomtest

    if episodes == 0:
        return 0.0, 1.0
    interval = binomtest(successes, episodes).proportion_ci(0.95, method="wilson")
    return float(interval.low), float(interval.high)


def median(values: Values) -> float:
    """Median; NaN of nothing."""
    return float(np.median(values)) if len(values) else float("nan")


def median_interval(values: Values) -> tuple[float, float, float]:
    """Median and its 95 % interval: percentiles of a bootstrap, the same for the same values; NaN of nothing."""
    array = np.asarray(values, dtype=np.float64)
    if not len(array):
        return math.nan, math.nan, math.nan
    rng = np.random.default_rng(0)
    drawn = rng.integers(0, len(array), (MEDIANS, len(array)))
    low, high = np.quantile(np.median(array[drawn], axis=1), (0.025, 0.975))
    return float(np.median(array)), float(low), float(high)


def quantile(values: Values, q: float) -> float:
    """Quantile, for example 0.99; NaN of nothing."""
    return float(np.quantile(values, q)) if len(values) else float("nan")


def interquartile_mean(values: Values) -> float:
    """Mean of the middle half: less moved by outliers than the mean, less wasteful than the median; NaN of nothing."""
    from scipy.stats import trim_mean

    return float(trim_mean(values, 0.25)) if len(values) else float("nan")


def only_one(pairs: Sequence[tuple[bool, bool]]) -> tuple[int, int]:
    """In how many pairs the first alone succeeds, and in how many the second."""
    return pairs.count((True, False)), pairs.count((False, True))


def mcnemar(only_first: int, only_second: int) -> float:
    """Exact two-sided McNemar p-value: of the pairs in which one alone succeeds, is either the likelier one?

    Args:
        only_first: pairs in which the first succeeds and the second does not.
        only_second: the other way round.
    """
    from scipy.stats import binomtest

    pairs = only_first + only_second
    return float(binomtest(only_first, pairs).pvalue) if pairs else 1.0


class Difference(NamedTuple):
    """A mean of differences of pairs.

    Attributes:
        mean: first minus second.
        low: lower end of its 95 % interval.
        high: upper end.
        p: two-sided p-value of "there is none".
        pairs: how many there were.
    """

    mean: float
    low: float
    high: float
    p: float
    pairs: int


FEWEST = 8
"""Pairs; fewer have too few different draws, some without any spread, whose scores mean nothing."""


def paired_bootstrap(first: np.ndarray, second: np.ndarray, seed: int = 0) -> Difference:
    """Mean difference of pairs (n,) with its interval by the studentized bootstrap; NaN of fewer than `FEWEST`.

    Each draw takes n pairs with replacement and measures its mean in its own standard errors. The quantiles of that
    give the interval, and how often it is farther out than the sample's own mean the p-value, so that both tell the
    same story. Efron and Tibshirani, An Introduction to the Bootstrap, chapters 12 and 16.
    """
    away = np.asarray(first, dtype=np.float64) - np.asarray(second, dtype=np.float64)
    n = len(away)
    if n < FEWEST:
        return Difference(float(away.mean()) if n else math.nan, math.nan, math.nan, math.nan, n)
    mean, error = float(away.mean()), float(away.std(ddof=1)) / math.sqrt(n)
    if error <= 1e-12 * max(abs(mean), 1e-300):
        return Difference(mean, mean, mean, 0.0 if mean else 1.0, n)
    rng, parts = np.random.default_rng(seed), []
    rows = max(1, min(RESAMPLES, AT_ONCE // n))
    for start in range(0, RESAMPLES, rows):
        drawn = away[rng.integers(n, size=(min(rows, RESAMPLES - start), n))]
        errors = drawn.std(axis=1, ddof=1) / math.sqrt(n)
        # a draw of equal pairs alone has no error of its own: it is given the sample's
        parts.append((drawn.mean(axis=1) - mean) / np.where(errors > 1e-9 * error, errors, error))
    scores = np.concatenate(parts)
    low, high = np.quantile(scores, [0.025, 0.975])
    farther = int((np.abs(scores) >= abs(mean) / error).sum())
    return Difference(mean, mean - high * error, mean - low * error, (farther + 1) / (RESAMPLES + 1), n)


def holm(values: Sequence[float]) -> list[float]:
    """Holm's adjusted p-values, in their order; NaN stays NaN and is not counted. S. Holm, 1979."""
    p = np.asarray(values, dtype=np.float64)
    known = np.flatnonzero(~np.isnan(p))
    order = known[np.argsort(p[known], kind="stable")]
    out = np.full(len(p), np.nan)
    scaled = p[order] * np.arange(len(order), 0, -1)
    out[order] = np.minimum(np.maximum.accumulate(scaled), 1.0)
    return out.tolist()


def hierarchical_bootstrap(
    groups: Sequence[Values],
    statistic: Callable[[Any], float] = interquartile_mean,
    seed: int = 0,
    resamples: int = RESAMPLES,
) -> tuple[float, float, float]:
    """A statistic of all values and its 95 % interval, where values come in groups: episodes of training seeds.

    Each draw takes groups with replacement, then values of each: training anew is the larger part of the spread, and
    episodes of one trained policy are no independent ones.
    """
    arrays = [np.asarray(group, dtype=np.float64) for group in groups if len(group)]
    if not arrays:
        return math.nan, math.nan, math.nan
    rng, draws = np.random.default_rng(seed), []
    for _ in range(resamples):
        chosen = [arrays[k] for k in rng.integers(len(arrays), size=len(arrays))]
        draws.append(statistic(np.concatenate([a[rng.integers(len(a), size=len(a))] for a in chosen])))
    low, high = np.quantile(draws, [0.025, 0.975])
    return statistic(np.concatenate(arrays)), float(low), float(high)


class Rate(NamedTuple):
    """A share of episodes with its 95 % interval."""

    count: int
    episodes: int
    low: float
    high: float

    @staticmethod
    def of(count: int, episodes: int) -> Rate:
        """With Wilson's interval."""
        return Rate(count, episodes, *wilson(count, episodes))

    @property
    def share(self) -> float:
        """The rate; NaN without episodes."""
        return self.count / self.episodes if self.episodes else float("nan")
