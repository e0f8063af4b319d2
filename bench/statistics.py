"""Statistics of the tables: intervals, paired tests and their correction, all by scipy and with fixed seeds.

Not in the paper. The config fixes the number of episodes before the first one runs: nothing here supports optional
stopping (looking at results and adding episodes until they please).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

Values = Sequence[float] | np.ndarray
RESAMPLES = 2000
"""Draws of a bootstrap: the ends of its 95 % interval then have an error of a few percent of the interval's width."""
MEDIANS = 1000
"""Draws of a bootstrap of medians."""
AT_ONCE = 2_000_000
"""Numbers drawn per batch, which bounds the memory."""


def wilson(successes: int, episodes: int) -> tuple[float, float]:
    """Return Wilson's 95 % interval of a success rate; (0, 1) without episodes.

    Args:
        successes: number of successes.
        episodes: number of episodes.

    Returns:
        Lower and upper end, in [0, 1].
    """
    from scipy.stats import binomtest

    if episodes == 0:
        return 0.0, 1.0
    interval = binomtest(successes, episodes).proportion_ci(0.95, method="wilson")
    return float(interval.low), float(interval.high)


def median(values: Values) -> float:
    """Return the median; NaN without values."""
    return float(np.median(values)) if len(values) else float("nan")


def median_interval(values: Values) -> tuple[float, float, float]:
    """Return the median and its 95 % interval: percentiles of a bootstrap with a fixed seed.

    Returns:
        Median, lower and upper end; NaN without values.
    """
    array = np.asarray(values, dtype=np.float64)
    if not len(array):
        return math.nan, math.nan, math.nan
    rng = np.random.default_rng(0)
    drawn = rng.integers(0, len(array), (MEDIANS, len(array)))
    low, high = np.quantile(np.median(array[drawn], axis=1), (0.025, 0.975))
    return float(np.median(array)), float(low), float(high)


def quantile(values: Values, q: float) -> float:
    """Return a quantile; NaN without values.

    Args:
        values: (n,) sample.
        q: probability in [0, 1], for example 0.99.
    """
    return float(np.quantile(values, q)) if len(values) else float("nan")


def interquartile_mean(values: Values) -> float:
    """Return the mean of the middle half of the values; NaN without values.

    It is more robust against outliers than the mean and statistically more efficient than the median.
    """
    from scipy.stats import trim_mean

    return float(trim_mean(values, 0.25)) if len(values) else float("nan")


def only_one(pairs: Sequence[tuple[bool, bool]]) -> tuple[int, int]:
    """Count the pairs in which only the first succeeds, and those in which only the second succeeds."""
    return pairs.count((True, False)), pairs.count((False, True))


def mcnemar(only_first: int, only_second: int) -> float:
    """Return the exact two-sided McNemar p-value of two methods succeeding equally often; 1 without discordant pairs.

    Args:
        only_first: number of pairs in which the first succeeds and the second fails.
        only_second: number of pairs in which the second succeeds and the first fails.
    """
    from scipy.stats import binomtest

    pairs = only_first + only_second
    return float(binomtest(only_first, pairs).pvalue) if pairs else 1.0


class Difference(NamedTuple):
    """Mean difference of pairs, with interval and test.

    Attributes:
        mean: mean of first minus second.
        low: lower end of its 95 % interval.
        high: upper end of its 95 % interval.
        p: two-sided p-value of the null hypothesis that the mean difference is zero.
        pairs: number of pairs.
    """

    mean: float
    low: float
    high: float
    p: float
    pairs: int


FEWEST = 8
"""Fewest pairs for a bootstrap: fewer have too few distinct draws, some of them without any spread, whose scores mean
nothing."""


def paired_bootstrap(first: np.ndarray, second: np.ndarray, seed: int = 0) -> Difference:
    """Return the mean difference of pairs with its interval by the studentized bootstrap.

    Each draw takes n pairs with replacement and measures the deviation of its mean in its own standard errors. The
    quantiles of these scores give the interval; the share of scores beyond the sample's own mean gives the p-value, so
    that interval and p-value agree. Efron and Tibshirani, An Introduction to the Bootstrap, chapters 12 and 16.

    Args:
        first: (n,) values of the first method.
        second: (n,) values of the second method on the same scenarios.
        seed: random seed of the draws.

    Returns:
        The difference; interval and p-value are NaN for fewer than `FEWEST` pairs.
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
        # a draw of identical pairs has no spread of its own: the sample's standard error replaces it
        parts.append((drawn.mean(axis=1) - mean) / np.where(errors > 1e-9 * error, errors, error))
    scores = np.concatenate(parts)
    low, high = np.quantile(scores, [0.025, 0.975])
    farther = int((np.abs(scores) >= abs(mean) / error).sum())
    return Difference(mean, mean - high * error, mean - low * error, (farther + 1) / (RESAMPLES + 1), n)


def holm(values: Sequence[float]) -> list[float]:
    """Return Holm's adjusted p-values in the given order; NaN stays NaN and does not count as a test. S. Holm, 1979."""
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
    """Return a statistic of grouped values (episodes of training seeds) and its 95 % interval.

    Each draw takes groups with replacement, then values of each group: retraining causes the larger part of the spread,
    and episodes of one trained policy are not independent samples of the method.

    Args:
        groups: one sample (n,) per group; empty groups are skipped.
        statistic: maps all values (m,) to a number.
        seed: random seed of the draws.
        resamples: number of draws.

    Returns:
        Statistic, lower and upper end; NaN without values.
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
    """Share of episodes with its 95 % interval.

    Attributes:
        count: number of episodes that count.
        episodes: number of all episodes.
        low: lower end of the interval.
        high: upper end of the interval.
    """

    count: int
    episodes: int
    low: float
    high: float

    @staticmethod
    def of(count: int, episodes: int) -> Rate:
        """Return a rate with Wilson's interval.

        Args:
            count: number of episodes that count.
            episodes: number of all episodes.
        """
        return Rate(count, episodes, *wilson(count, episodes))

    @property
    def share(self) -> float:
        """Share of the episodes that count; NaN without episodes."""
        return self.count / self.episodes if self.episodes else float("nan")
