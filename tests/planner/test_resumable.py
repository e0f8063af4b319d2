"""Computations in slices: the results and the counted costs do not depend on where they pause."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.random_scenes import KINDS, demonstrated, panda, problem
from hypothesis import given
from hypothesis import strategies as st

from onedemo.planner import Planner, PlanRequest
from onedemo.planner.resumable import Paced, finished

BUDGETS = (1.0, 300.0, 4000.0)


def slices(costs, result="done"):
    """A computation of slices of given costs."""
    yield from costs
    return result


def request(kind, seed):
    asked = problem(kind, seed)
    return PlanRequest(demonstrated(), asked.start, asked.goal, asked.obstacles, seed=seed)


def planner():
    return Planner(*panda()[:2])


@given(costs=st.lists(st.floats(0.0, 1e4), max_size=30), budget=st.floats(1.0, 1e5))
def test_a_budget_is_exceeded_by_the_last_slice_only_and_paid_back(costs, budget):
    paced, ticks = Paced(slices(costs)), 0
    while not paced.advance(budget):
        ticks += 1
        assert ticks <= sum(costs) / budget + 1
    assert paced.result == "done" and paced.over


def test_costs_beyond_a_budget_are_owed():
    paced = Paced(slices([10.0, 10.0]))
    assert [paced.advance(4.0) for _ in range(6)] == [False, False, False, False, False, True]


def test_an_infinite_budget_ends_at_once_and_an_error_comes_through():
    paced = Paced(slices([1e9] * 5, 3))
    assert paced.advance(np.inf) and paced.result == 3

    def failing():
        yield 1.0
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        finished(failing())


@pytest.mark.parametrize("budget", BUDGETS)
@pytest.mark.parametrize("kind", KINDS)
def test_a_plan_is_the_same_to_the_last_bit_with_any_budget(kind, budget):
    for seed in (0, 1):
        asked = request(kind, seed)
        whole, paced = planner().answer(asked), Paced(planner().answering(asked))
        while not paced.advance(budget):
            pass
        found = paced.result
        assert (found.joints == whole.joints).all() and found.joints.shape == whole.joints.shape
        assert (found.why, found.how, found.tries) == (whole.why, whole.how, whole.tries)
        assert (found.path_poses == whole.path_poses).all() and (found.tree_rows == whole.tree_rows).all()


def test_the_costs_are_the_same_each_time():
    asked = request("clutter", 3)
    first, again = list(planner().answering(asked)), list(planner().answering(asked))
    assert first == again and max(first) < 20_000.0


def test_two_planners_may_take_turns():
    """Each has arrays of its own."""
    asked = [request(kind, 1) for kind in ("clutter", "shelf")]
    alone = [planner().answer(each) for each in asked]
    paced = [Paced(planner().answering(each)) for each in asked]
    while not all([each.advance(500.0) for each in paced]):
        pass
    for each, whole in zip(paced, alone, strict=True):
        assert (each.result.joints == whole.joints).all()
