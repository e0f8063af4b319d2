"""Violation of constraints by motions: known values, order, and the best traversal against all of them."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from helpers.planner.carried_paths import book, hinged, poured, shifted, tray, turned
from helpers.strategies import for_all, st

from onedemo.planner import PosePath
from onedemo.planner.constraints.violation import traversal, violation_of
from onedemo.planner.imitation.kept_components import found_constraint

DEGREE = np.deg2rad(1.0)


@pytest.mark.parametrize(
    "path", [tray(), poured(), hinged((0, 1, 0)), book()], ids=["tray", "poured", "handle", "book"]
)
def test_the_imitated_path_keeps_its_own_constraint(path):
    found = violation_of(found_constraint(path), path, path)
    assert found.kept and found.share < 0.25


def test_a_guided_stretch_that_is_left_out_is_a_violation():
    path = poured()
    constraint = found_constraint(path)
    jumped = PosePath(np.delete(path.dqs, slice(constraint.guided + 10, len(path) - 5), axis=0))
    assert not violation_of(constraint, path, jumped).kept
    assert not violation_of(constraint, path, path[: constraint.guided + 2]).kept


def test_a_tilt_on_the_way_is_said_with_its_size():
    path = poured()
    constraint = found_constraint(path)
    tilted = shifted(0.1, 0.0, 0.2) @ path[0]
    middle = tilted @ path[0].inverse() @ turned((1, 0, 0), 30.0 * DEGREE) @ path[0]
    motion = PosePath(np.array([path[0].dq, middle.dq, *path.dqs[constraint.guided :]]))
    found = violation_of(constraint, path, motion)
    assert found.angle == pytest.approx(30.0 * DEGREE, abs=1.5 * DEGREE)
    assert found.detail.startswith("against gravity") and not found.kept


def test_a_shift_while_guided_is_said_with_its_size():
    path = poured()
    constraint = found_constraint(path)
    rows = path.dqs.copy()
    rows[-1] = (shifted(0.0, 0.02, 0.0) @ path[-1]).dq
    found = violation_of(constraint, path, PosePath(rows))
    assert found.position == pytest.approx(0.02, abs=2e-3) and found.detail.startswith("position")


def test_where_nothing_is_kept_nothing_is_violated():
    assert violation_of(None, tray(), poured()).kept


@for_all(st.integers(1, 5), st.integers(1, 4), st.integers(0, 10**6), max_examples=60)
def test_the_traversal_is_the_best_of_all(n, m, seed):
    rng = np.random.default_rng(seed)
    carried, gaps = rng.uniform(size=n), rng.uniform(size=(n, m))
    reach, back = np.empty((2, n, m + 1))
    assert traversal(carried, gaps, reach, back) == pytest.approx(best_of_all(carried, gaps))


def best_of_all(carried, gaps):
    """The least largest gap of all traversals, by listing them."""
    n, m = gaps.shape
    best = np.inf
    for first in range(n):  # poses before `first` are carried
        start, steps = max(carried[:first], default=0.0), n - 1 - first + m - 1
        for length in range(max(n - 1 - first, m - 1), steps + 1):
            for moves in itertools.product(((1, 0), (0, 1), (1, 1)), repeat=length):
                i = first + sum(move[0] for move in moves)
                j = sum(move[1] for move in moves)
                if (i, j) != (n - 1, m - 1):
                    continue
                places = np.vstack(
                    [[first, 0], np.array([first, 0]) + np.cumsum(np.array(moves, dtype=int).reshape(-1, 2), axis=0)]
                )
                best = min(best, max(start, max(gaps[a, b] for a, b in places)))
    return best
