"""Numbers of a table."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def wilson(successes: int, episodes: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a success rate; (0, 1) without episodes."""
    from scipy.stats import binomtest

    if episodes == 0:
        return 0.0, 1.0
    interval = binomtest(successes, episodes).proportion_ci(0.95, method="wilson")
    return float(interval.low), float(interval.high)


def median(values: Sequence[float]) -> float:
    """Median; NaN of nothing."""
    return float(np.median(values)) if len(values) else float("nan")


def quantile(values: Sequence[float], q: float) -> float:
    """Quantile, for example 0.99; NaN of nothing."""
    return float(np.quantile(values, q)) if len(values) else float("nan")
