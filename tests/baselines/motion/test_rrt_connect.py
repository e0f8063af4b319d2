"""Searches by OMPL between joints anywhere within their limits; what cannot be reached is refused at once."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from helpers.random_scenes import SETTINGS, at, demonstrated, panda

from onedemo.baselines.motion.rrt_connect import RrtSettings, joint_path
from onedemo.baselines.motion.rrt_planner import RrtPlanner
from onedemo.baselines.paths_only import motion_planner
from onedemo.planner.errors import BadOption
from onedemo.planner.geometry.shapes import Box, Obstacle
from onedemo.planner.planning.planning_scene import PlanningScene
from onedemo.planner.search.joint_space_rrt import joint_edge_is_clear

pytest.importorskip("ompl")
ARM, BODY, HOME = panda()
BUDGET = RrtSettings(budget=3000)


def posted(goal: np.ndarray) -> np.ndarray:
    """The arm beside a post in the way from its usual joints to a goal."""
    middle = ARM.fk(0.5 * (HOME + goal)).position
    post = Obstacle(Box((0.05, 0.05, 0.6)), at(middle), name="post")
    return PlanningScene.of(ARM, BODY, [post], SETTINGS).seen


def beyond_half_a_turn() -> np.ndarray:
    goal = HOME.copy()
    goal[0], goal[5] = HOME[0] - 2.0, 3.2
    return goal


@pytest.mark.parametrize("back", [False, True])
def test_a_joint_beyond_half_a_turn_is_reached_and_left(back):
    goal = beyond_half_a_turn()
    g, ends = posted(goal), (goal, HOME) if back else (HOME, goal)
    assert not joint_edge_is_clear(g, *ends), "the search has something to do"
    points = joint_path(g, ARM.lower, ARM.upper, ends[0], [ends[1]], BUDGET)
    assert points is not None
    np.testing.assert_allclose(points[[0, -1]], ends, rtol=0.0, atol=1e-12)
    assert all(joint_edge_is_clear(g, np.ascontiguousarray(a), np.ascontiguousarray(b)) for a, b in pairwise(points))


@pytest.mark.parametrize("end", ["start", "goal"])
@pytest.mark.parametrize("why", ["limit", "collision"])
def test_an_end_that_cannot_be_is_refused_at_once(end, why, monkeypatch):
    """OMPL would wait for a valid goal without asking for an edge, so the budget would never end."""

    def never(*_):
        raise AssertionError("OMPL was asked")

    monkeypatch.setattr("onedemo.baselines.motion.rrt_connect._Search.solved", never)
    goal = beyond_half_a_turn()
    g, bad = posted(goal), goal.copy()
    if why == "limit":
        bad[5] = ARM.upper[5] + 0.1
    else:
        bad = 0.5 * (HOME + goal)
    start, ends = (bad, [goal]) if end == "start" else (HOME, [bad])
    assert joint_path(g, ARM.lower, ARM.upper, start, ends, BUDGET) is None


def test_goals_that_cannot_be_are_left_out():
    goal, bad = HOME + 0.3 * np.array([1, 0, 0, 0, 0, 0, 0]), ARM.upper + 1.0
    g = PlanningScene.of(ARM, BODY, [], SETTINGS).seen
    points = joint_path(g, ARM.lower, ARM.upper, HOME, [bad, goal], BUDGET)
    np.testing.assert_array_equal(points[-1], goal)


def test_planners_of_paths_refuse_joints_for_a_goal_in_one_line():
    for planner in (RrtPlanner(ARM, BODY, SETTINGS, BUDGET), motion_planner("replay", ARM, BODY)):
        with pytest.raises(BadOption, match=r"goal.*given as joints; this planner takes a Pose"):
            planner.plan(demonstrated(), HOME, HOME + 0.1)
