"""The small quadratic program against other solvers, and where the safety layer depends on its details."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.strategies import for_all
from hypothesis import reject
from hypothesis import strategies as st

from onedemo.planner.safety.qp import MOST_ACTIVE, QP, SLACK, inverse_weight, solve

seeds = st.integers(0, 10**6)


def solved(start, weight, rows, bounds, soft=()):
    """Solution, whether the hard bounds hold, and the rows afterwards."""
    n, x = len(start), np.array(start, dtype=float)
    inverse = np.zeros((16, 40))
    inverse[:n, :n] = weight
    inverse_weight(inverse, n)
    work = np.zeros((max(1, len(rows)), QP.width))
    for row, a, b in zip(work, rows, bounds, strict=False):
        row[:n], row[QP.bound] = a, b
    for k in soft:
        work[k, QP.softness] = SLACK
    ok = solve(x, inverse, work, len(rows), np.zeros(MOST_ACTIVE), np.zeros((MOST_ACTIVE + 1, MOST_ACTIVE)), n)
    return x, ok, work


def problem(seed: int, *, feasible: bool = True):
    """Random: size, weight, rows (some doubled, opposite or nearly so), bounds that a random point keeps."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 17)), int(rng.integers(1, 25))
    root = rng.normal(size=(n, n))
    weight = root @ root.T + rng.choice([0.01, 1.0]) * np.eye(n)
    rows = rng.normal(size=(m, n))
    rows /= np.linalg.norm(rows, axis=1)[:, None]
    for k in range(1, m):
        if rng.uniform() < 0.3:
            rows[k] = rng.choice([1.0, -1.0]) * rows[k - 1] + rng.choice([0.0, 1e-3]) * rng.normal(size=n)
    inside = rng.normal(size=n)
    bounds = rows @ inside - np.where(rng.uniform(size=m) < 0.3, 0.0, rng.exponential(size=m))
    if not feasible:
        bounds += 2.0
    return rng.normal(size=n) * 3, weight, rows, bounds


def cost(x, start, weight):
    return 0.5 * (x - start) @ weight @ (x - start)


@for_all(seeds, max_examples=150)
def test_a_random_problem_is_solved_as_by_quadprog(seed):
    quadprog = pytest.importorskip("quadprog")
    start, weight, rows, bounds = problem(seed)
    x, ok, _ = solved(start, weight, rows, bounds)
    try:
        other = quadprog.solve_qp(weight, weight @ start, rows.T, bounds)[0]
    except ValueError:  # it takes nearly parallel rows for contradictions
        reject()
    assert ok and (rows @ x - bounds).min() >= -2e-10
    assert cost(x, start, weight) == pytest.approx(cost(other, start, weight), rel=1e-6, abs=1e-7)
    np.testing.assert_allclose(x, other, rtol=1e-5, atol=1e-5)


@for_all(seeds, max_examples=100)
def test_the_solution_satisfies_the_conditions_of_optimality(seed):
    """Stationary, multipliers not negative, and none on a bound that is not reached: needs no other solver."""
    start, weight, rows, bounds = problem(seed)
    x, ok, work = solved(start, weight, rows, bounds)
    if not ok:  # rows nearly parallel and opposite that both touch: a contradiction up to rounding
        assert (rows @ x - bounds).min() > -1e-6
        reject()
    multipliers = work[:, QP.multiplier]
    assert multipliers.min() >= -1e-9
    pull = rows.T @ multipliers
    np.testing.assert_allclose(weight @ (x - start), pull, rtol=0, atol=1e-8 * (1 + np.abs(pull).max()))
    idle = rows @ x - bounds > 1e-7
    assert not multipliers[idle].any()
    assert ((work[:, QP.active] == 1.0) >= (multipliers > 0)).all()


@for_all(seeds, max_examples=100)
def test_soft_rows_are_solved_as_with_slacks_of_their_own(seed):
    """Every soft row with an own slack variable is an ordinary program; feasible or not."""
    quadprog = pytest.importorskip("quadprog")
    start, weight, rows, bounds = problem(seed, feasible=False)
    n, m = len(start), len(rows)
    x, ok, work = solved(start, weight, rows, bounds, range(m))
    slack = SLACK * work[:, QP.multiplier]
    assert ok and (rows @ x + slack - bounds).min() >= -1e-6 * (1.0 + np.abs(x).max())
    whole = np.block([[weight, np.zeros((n, m))], [np.zeros((m, n)), np.eye(m) / SLACK]])
    linear = np.concatenate([weight @ start, np.zeros(m)])
    other = quadprog.solve_qp(whole, linear, np.hstack([rows, np.eye(m)]).T, bounds)[0][:n]

    def price(y):
        return cost(y, start, weight) + 0.5 / SLACK * (np.maximum(0.0, bounds - rows @ y) ** 2).sum()

    # the other solver loses digits in slacks of such a weight: it may not be the better one
    assert price(x) <= (1.0 + 1e-4) * price(other) + 1e-8


def test_contradicting_soft_rows_give_way_evenly_and_say_by_how_much():
    x, ok, work = solved([0.3, 5.0], np.eye(2), [[1, 0], [-1, 0]], [1.0, 1.0], soft=(0, 1))
    assert ok
    np.testing.assert_allclose(x, [0.0, 5.0], rtol=0, atol=1e-6)
    np.testing.assert_allclose(SLACK * work[:, QP.multiplier], [1.0, 1.0], rtol=0, atol=1e-6)


def test_a_soft_row_gives_way_to_hard_ones():
    x, ok, work = solved([0.0], np.eye(1), [[1.0], [-1.0]], [1.0, -0.25], soft=(0,))
    assert ok and x[0] == pytest.approx(0.25, abs=1e-9)
    assert SLACK * work[0, QP.multiplier] == pytest.approx(0.75, abs=1e-6)


def test_contradicting_hard_rows_are_reported():
    assert not solved([0.0], np.eye(1), [[1.0], [-1.0]], [1.0, 1.0])[1]
    assert not solved([0.0, 0.0], np.eye(2), [[1, 0], [0, 1], [-1, -1]], [1.0, 1.0, -1.0])[1]
    assert solved([0.0, 0.0], np.eye(2), [[1, 0], [0, 1], [-1, -1]], [1.0, 1.0, -2.0])[1]


@for_all(seeds, max_examples=100)
def test_one_bound_is_kept_by_the_closed_form(seed):
    """Property 36."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 17))
    u, a = rng.normal(size=(2, n))
    bound, a = rng.normal(), a / np.linalg.norm(a)
    x, ok, _ = solved(u, np.eye(n), [a], [bound])
    assert ok
    np.testing.assert_allclose(x, u + max(0.0, bound - a @ u) * a, rtol=0, atol=1e-9)


@for_all(seeds, max_examples=60)
def test_what_keeps_all_bounds_is_left_as_it_is_to_the_bit(seed):
    start, weight, rows, bounds = problem(seed)
    bounds = np.minimum(bounds, rows @ start)
    x, ok, work = solved(start, weight, rows, bounds, range(0, len(rows), 2))
    assert ok and x.tobytes() == start.tobytes()
    assert not work[:, QP.multiplier].any() and not work[:, QP.active].any()


def test_no_bounds_at_all():
    assert solved([1.0, 2.0], np.eye(2), [], [])[1]


def test_a_row_of_zeros_is_harmless_where_it_holds_and_reported_where_it_cannot():
    assert solved([1.0], np.eye(1), [[0.0]], [-1.0])[1]
    assert not solved([1.0], np.eye(1), [[0.0]], [1.0])[1]
    x, ok, work = solved([1.0], np.eye(1), [[0.0]], [0.5], soft=(0,))
    assert ok and x[0] == 1.0 and SLACK * work[0, QP.multiplier] == pytest.approx(0.5)


def test_a_box_is_kept_whatever_else_is_asked():
    """As the safety layer lays it out: soft rows that pull far out, hard speed limits."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        n, m = 7, int(rng.integers(1, 15))
        rows = np.vstack([rng.normal(size=(m, n)), np.eye(n), -np.eye(n)])
        # at most one of the two limits of a joint is near
        high = rng.choice([0.0, 1e-9, 1e-4, 0.5, 2.0], n)
        low = np.where(high < 0.5, 2.0, rng.choice([0.0, 1e-9, 1e-4, 0.5, 2.0], n))
        bounds = np.concatenate([rng.normal(size=m) * 3, -low, -high])
        start = np.clip(rng.normal(size=n), -low, high)
        x, ok, _ = solved(start, np.diag(rng.uniform(0.01, 1, n)), rows, bounds, range(m))
        assert ok and (x <= high + 1e-6).all() and (x >= -low - 1e-6).all()


@for_all(seeds, st.floats(-4, 1), max_examples=60)
def test_the_inverse_weight_is_the_inverse(seed, exponent):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 17))
    root = rng.normal(size=(n, min(n, 6)))
    weight = root @ root.T + 10**exponent * np.eye(n)
    out = np.full((16, 40), 7.0)
    out[:n, :n] = weight
    inverse_weight(out, n)
    np.testing.assert_allclose(out[:n, :n] @ weight, np.eye(n), rtol=0, atol=1e-12 * np.linalg.cond(weight) + 1e-12)
    assert (out[n:] == 7.0).all() and (out[:, n:] == 7.0).all()


def test_the_same_problem_gives_the_same_bits():
    start, weight, rows, bounds = problem(5)
    assert solved(start, weight, rows, bounds)[0].tobytes() == solved(start, weight, rows, bounds)[0].tobytes()
