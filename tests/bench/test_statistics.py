"""Statistics against published numbers, closed forms and their promise: how often an interval covers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onedemo.bench import statistics
from onedemo.bench.statistics import (
    hierarchical_bootstrap,
    holm,
    interquartile_mean,
    mcnemar,
    median,
    median_interval,
    only_one,
    paired_bootstrap,
    quantile,
    wilson,
)


@pytest.mark.parametrize(
    "successes, episodes, low, high",
    [(0, 10, 0.0, 0.2775), (10, 10, 0.7225, 1.0), (49, 50, 0.8950, 0.9965), (81, 263, 0.2553, 0.3662)],
)
def test_the_interval_is_wilsons(successes, episodes, low, high):
    """The last line: Newcombe 1998, table I."""
    assert wilson(successes, episodes) == (pytest.approx(low, abs=2e-4), pytest.approx(high, abs=2e-4))


@pytest.mark.parametrize("rate", [0.1, 0.5, 0.9])
def test_wilsons_interval_covers_as_often_as_it_says(rate):
    """Exactly, over all outcomes of 50 episodes: Wilson's coverage swings about 95 %."""
    covered = [low <= rate <= high for low, high in (wilson(k, 50) for k in range(51))]
    weights = [math.comb(50, k) * rate**k * (1.0 - rate) ** (50 - k) for k in range(51)]
    assert 0.93 <= np.dot(covered, weights) <= 0.98


@pytest.mark.parametrize("seed", range(3))
def test_the_interval_of_a_median_is_about_that_of_the_order_statistics(seed):
    """Of 101 draws the binomial's 95 % are the 41st and the 61st in order."""
    values = np.random.default_rng(seed).normal(size=101)
    middle, low, high = median_interval(values)
    ordered = np.sort(values)
    assert middle == ordered[50]
    assert ordered[38] <= low <= ordered[43] and ordered[57] <= high <= ordered[62]
    assert median_interval(list(values)) == (middle, low, high)


def test_pairs_in_which_one_alone_succeeds():
    assert only_one([(True, False)] * 6 + [(False, False), (True, True), (False, True)]) == (6, 1)


def test_statistics_of_nothing_say_so():
    assert all(map(math.isnan, median_interval([])))
    assert wilson(0, 0) == (0.0, 1.0)
    assert math.isnan(median([]))
    assert math.isnan(quantile([], 0.99))
    assert math.isnan(interquartile_mean([]))
    assert mcnemar(0, 0) == 1.0
    assert math.isnan(paired_bootstrap(np.zeros(0), np.zeros(0)).mean)
    assert math.isnan(paired_bootstrap(np.ones(1), np.zeros(1)).p)
    few = paired_bootstrap(np.arange(7.0), np.zeros(7))
    assert few.mean == 3.0
    assert all(map(math.isnan, (few.low, few.high, few.p))), "pairs too few to say"
    assert all(map(math.isnan, hierarchical_bootstrap([])))


@pytest.mark.parametrize(
    "first, second, expected",
    [(1, 9, 22 / 1024), (0, 5, 2 / 32), (3, 3, 1.0), (0, 1, 1.0), (2, 8, 2 * (1 + 10 + 45) / 1024)],
)
def test_mcnemar_is_the_sign_test_of_the_pairs_that_differ(first, second, expected):
    assert mcnemar(first, second) == pytest.approx(expected)
    assert mcnemar(second, first) == pytest.approx(expected)


def test_holm_as_in_a_worked_example():
    """Four hypotheses: 0.005 * 4, 0.01 * 3, then 0.03 * 2 which 0.04 * 1 may not undercut."""
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.9, 0.8]) == [1.0, 1.0]
    adjusted = holm([0.01, math.nan, 0.04])
    assert adjusted[0] == pytest.approx(0.02)
    assert math.isnan(adjusted[1])
    assert holm([]) == []


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=12))
def test_holm_keeps_the_order_and_lies_between_no_correction_and_bonferronis(values):
    adjusted = holm(values)
    for p, q in zip(values, adjusted, strict=True):
        assert p - 1e-12 <= q <= min(1.0, len(values) * p) + 1e-12
    order = np.argsort(values, kind="stable")
    assert (np.diff(np.array(adjusted)[order]) >= 0.0).all()


def test_holm_rejects_too_often_in_no_more_than_its_share_of_families():
    rng = np.random.default_rng(1)
    families = rng.uniform(size=(2000, 8))
    wrong = np.mean([min(holm(family)) <= 0.05 for family in families])
    assert wrong == pytest.approx(0.05, abs=0.02)


def test_the_interquartile_mean_leaves_out_a_quarter_at_each_end():
    assert interquartile_mean([1e9, 3.0, 2.0, -1e9]) == 2.5
    assert interquartile_mean(list(range(8))) == 3.5


@pytest.mark.parametrize("draw", ["normal", "exponential"])
def test_the_bootstrap_covers_and_its_test_is_wrong_as_often_as_it_says(draw):
    rng = np.random.default_rng(2)
    covered, rejected, trials = 0, 0, 300
    for trial in range(trials):
        pairs = rng.normal(size=40) if draw == "normal" else rng.exponential(size=40) - 1.0
        base = rng.normal(size=40)
        found = paired_bootstrap(base + pairs, base, seed=trial)
        covered += found.low <= 0.0 <= found.high
        rejected += found.p <= 0.05
    assert 0.91 <= covered / trials <= 0.98
    assert 0.01 <= rejected / trials <= 0.09


def test_the_bootstrap_agrees_with_student_where_student_is_exact():
    from scipy.stats import ttest_1samp

    pairs = np.random.default_rng(3).normal(0.3, 1.0, size=60)
    found, exact = paired_bootstrap(pairs, np.zeros(60)), ttest_1samp(pairs, 0.0)
    interval = exact.confidence_interval(0.95)
    assert found.mean == pytest.approx(pairs.mean())
    assert (found.low, found.high) == (pytest.approx(interval.low, abs=0.05), pytest.approx(interval.high, abs=0.05))
    assert found.p == pytest.approx(exact.pvalue, abs=0.02)


def test_the_bootstrap_is_of_pairs_seeded_and_of_any_size(monkeypatch):
    rng = np.random.default_rng(4)
    base = rng.normal(0.0, 100.0, size=50)
    found = paired_bootstrap(base + 1.0 + 0.1 * rng.normal(size=50), base)
    assert 0.9 < found.low < found.high < 1.1, "the spread of the base is none of the difference"
    a, b = rng.normal(size=(2, 30))
    assert paired_bootstrap(a, b, seed=1) == paired_bootstrap(a, b, seed=1)
    assert paired_bootstrap(a, b, seed=1) != paired_bootstrap(a, b, seed=2)
    swapped = paired_bootstrap(b, a, seed=1)
    assert swapped.mean == -paired_bootstrap(a, b, seed=1).mean
    whole = paired_bootstrap(a, b, seed=1)
    monkeypatch.setattr(statistics, "AT_ONCE", 1000)
    assert paired_bootstrap(a, b, seed=1) == whole


def test_pairs_that_all_differ_alike_need_no_bootstrap():
    assert paired_bootstrap(np.full(9, 2.0), np.ones(9))[:4] == (1.0, 1.0, 1.0, 0.0)
    assert paired_bootstrap(np.ones(9), np.ones(9)).p == 1.0


def test_the_hierarchical_interval_knows_that_seeds_differ():
    """Episodes of eight trainings that differ: taken for alike ones, their interval would be far too narrow."""
    rng = np.random.default_rng(5)
    covered, covered_flat, trials = 0, 0, 60
    for trial in range(trials):
        groups = [rng.normal(rng.normal(), 0.3, size=20) for _ in range(8)]
        _, low, high = hierarchical_bootstrap(groups, np.mean, seed=trial, resamples=300)
        _, flat_low, flat_high = hierarchical_bootstrap([np.concatenate(groups)], np.mean, seed=trial, resamples=300)
        covered += low <= 0.0 <= high
        covered_flat += flat_low <= 0.0 <= flat_high
    assert covered / trials >= 0.8
    assert covered_flat / trials <= 0.6
