"""Plans that cannot be: the reason is named, bad input is one line."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from helpers.planner.planned import WAYS, assert_sound, free_leg
from helpers.random_scenes import (
    SETTINGS,
    at,
    demonstrated,
    judged,
    log_of,
    panda,
    problem,
    solve,
)
from helpers.strategies import for_all, st

from onedemo.planner.errors import BadOption, BadShape, NotFinite
from onedemo.planner.escape.repet import MAX_OBSTACLES, RepetSettings
from onedemo.planner.geometry.pose import PosePath
from onedemo.planner.geometry.shapes import Box, Obstacle, Sphere
from onedemo.planner.judge.certify import certify
from onedemo.planner.planning.planner import Planner
from onedemo.planner.planning.planning_scene import PlanningScene
from onedemo.planner.planning.settings import JointSearchSettings, PlanSettings
from onedemo.planner.safety.safety_layer import SafetySettings


def test_a_leg_of_no_length_is_planned():
    arm, body, home = panda()
    here = arm.fk(home)
    found = Planner(arm, body).plan(PosePath(np.array([here.dq] * 5)), home, here)
    assert_sound(found, arm, body, home, here, ())
    assert np.abs(found.joints - home).max() < 1e-2


@pytest.mark.parametrize("place", [(3.0, 0.0, 1.0), (0.0, 0.0, 3.0), (-0.56, 0.0, 0.95)])
def test_a_goal_out_of_reach_is_an_honest_failure(place):
    arm, body, home = panda()
    _, near = free_leg()
    for obstacles in ((), (Obstacle(Sphere(0.05), at([0.3, 0.0, 1.0])),)):
        failed = Planner(arm, body).plan(demonstrated(), home, at(place, near.quaternion), obstacles)
        assert failed.reason == "ik_or_limit"
        np.testing.assert_array_equal(failed.joints, home[None])


def test_a_start_or_goal_that_cannot_be_is_named_with_part_and_obstacle():
    arm, body, home = panda()
    planner, (_, goal) = Planner(arm, body), free_leg()
    beyond = home.copy()
    beyond[3] = arm.upper[3] + 0.01
    failed = planner.plan(demonstrated(), beyond, goal)
    assert failed.why.startswith(f"start beyond a joint limit: {arm.joint_names[3]} at ")
    assert failed.why.endswith(" by 0.010 rad")
    far = Obstacle(Sphere(0.05), at([0.0, 0.0, 9.0]), name="far")
    tcp = arm.fk(home).position
    on_hand = [far, Obstacle(Sphere(0.05), at(tcp), name="ball")]
    failed = planner.plan(demonstrated(), home, goal, on_hand)
    assert failed.reason == "start in collision" and failed.detail in ("fingers touches ball", "hand touches ball")
    elbow = [Obstacle(Sphere(0.05), at([-0.56, 0.0, 1.5])), far]
    failed = planner.plan(demonstrated(), home, goal, elbow)
    assert failed.reason == "start in collision" and re.fullmatch("link[34] touches obstacle 0", failed.detail)
    on_goal = [far, Obstacle(Sphere(0.05), at(goal.position), name="cup")]
    failed = planner.plan(demonstrated(), home, goal, on_goal)
    assert failed.reason == "goal in collision" and failed.detail in ("fingers touches cup", "hand touches cup")
    # what is held is named as what it is, and what is near but apart with the distance
    holding = Planner(arm, body.holding("held", Box((0.05, 0.05, 0.05)), at([0.0, 0.0, 0.04]), arm))
    for start, end, place in ((home, goal, arm.fk(home)), (home, goal, goal)):
        below = [Obstacle(Box((0.2, 0.2, 0.02)), at(place.position - [0.0, 0.0, 0.085]), name="shelf")]
        failed = holding.plan(demonstrated(), start, end, below)
        which = "goal" if place is goal else "start"
        assert re.fullmatch(
            rf"{which} in collision: held (touches shelf|is \d\.\d mm from shelf, which must be 10\.0)", failed.why
        ), failed.why


def test_what_is_too_close_for_a_detour_is_named():
    arm, body, home = panda()
    goal = at([0.0, 0.4, 1.0], free_leg()[1].quaternion)
    wall = Obstacle(Box((2.0, 0.02, 3.0)), at([0.65, 0.2, 1.0]), name="wall")
    shelf = Obstacle(Box((0.2, 0.2, 0.02)), at(goal.position - [0.0, 0.0, 0.3]), name="shelf")
    gap = PlanningScene.of(arm, body, [shelf], SETTINGS).tool_slack(goal) + SETTINGS.safety.distance
    near = Obstacle(shelf.shape, at([0.0, 0.0, gap - 0.015]) @ shelf.pose, name="shelf")
    planner = Planner(arm, body, PlanSettings(search=None))
    failed = planner.plan(demonstrated(), home, goal, [wall, near])
    assert failed.why == "no room for a detour at the goal: fingers is 15.0 mm from shelf, which must be 20.0"
    farther = planner.plan(demonstrated(), home, goal, [wall, shelf])
    assert not farther.success and "no room" not in farther.why


def test_a_tree_that_is_stopped_says_so():
    scene = problem("cage", 1)
    few = replace(SETTINGS, repet=replace(SETTINGS.repet, nodes=200), search=None)
    failed = solve(scene, few)
    assert failed.why == "node limit reached: a tree had 200 nodes, see repet.nodes"
    assert failed.tree is not None and len(failed.tree.poses) == 200
    many = replace(SETTINGS, repet=replace(SETTINGS.repet, nodes=200_000, levels=5), search=None)
    failed = solve(scene, many)
    assert re.fullmatch(r"no escape found: \d+ nodes in the last of 5 trees", failed.why)


def test_no_tree_of_another_leg_is_shown():
    arm, body, home = panda()
    _, goal = free_leg()
    planner = Planner(arm, body)
    scene = problem("cage", 0)
    assert planner.plan(demonstrated(), scene.start, scene.goal, scene.obstacles).tree is not None
    assert planner.plan(demonstrated(), home, goal).tree is None


def test_a_plan_that_ends_at_a_joint_limit_is_a_fallback():
    scene = problem("convex", 0)
    one, two = solve(scene, replace(SETTINGS, effort=0)), solve(scene)
    assert one.success and one.end_margin < SETTINGS.end_margin < two.end_margin
    assert judged(scene, two).ok


def test_what_stands_in_the_base_is_a_collision_or_nobodys():
    arm, body, _ = panda()
    start, goal = free_leg()
    inside = [Obstacle(Sphere(0.05), at([-0.56, 0.0, 0.95]), name="core")]
    found = Planner(arm, body).plan(demonstrated(), start, goal, inside)
    assert found.reason == "start in collision" or certify(log_of(found, arm, body, goal, inside)).ok


def test_numbers_that_are_none_and_wrong_shapes_are_one_line():
    arm, body, home = panda()
    planner, (_, goal) = Planner(arm, body), free_leg()
    bad = home.copy()
    bad[2] = np.nan
    for start, error in ((bad, NotFinite), (home[:6], BadShape), (home[None], BadShape)):
        with pytest.raises(error) as caught:
            planner.plan(demonstrated(), start, goal)
        assert "\n" not in str(caught.value)
    many = [Obstacle(Sphere(0.01), at([5, 5, 5]))] * 10_000
    with pytest.raises(BadOption, match=f"10000; allowed are {MAX_OBSTACLES}"):
        planner.plan(demonstrated(), home, goal, many)


@for_all(st.integers(0, 10**6), max_examples=15)
def test_any_start_and_goal_give_a_plan_or_a_reason(seed):
    """Nothing is asked of the draw but that it is finite."""
    arm, body, _ = panda()
    rng = np.random.default_rng(seed)
    start = rng.uniform(arm.lower, arm.upper)
    goal = arm.fk(rng.uniform(arm.lower, arm.upper))
    around = [Obstacle(Sphere(0.1), at(rng.normal(size=3))) for _ in range(3)]
    settings = replace(SETTINGS, search=JointSearchSettings(iterations=300, rounds=1))
    found = Planner(arm, body, settings).plan(demonstrated(), start, goal, around, seed=seed)
    if found.success:
        assert_sound(found, arm, body, start, goal, around)
    else:
        assert found.reason


@pytest.mark.parametrize(
    "values",
    [
        {"tight": 0.0}, {"tight": 1.1}, {"tight": math.nan}, {"biases": ()}, {"spacing": 0.0}, {"max_seconds": 0.0},
        {"max_seconds": math.inf}, {"repet": RepetSettings(distance=0.012)},
        {"safety": SafetySettings(distance=0.03)},
    ],
    ids=str,
)  # fmt: skip
def test_settings_out_of_range_are_refused_in_one_line(values):
    with pytest.raises(BadOption) as caught:
        PlanSettings(**values)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "values", [{"step": 0.0}, {"step": 11.0}, {"speed": 0.0}, {"iterations": 0}, {"nodes": 0}, {"rounds": 0}], ids=str
)
def test_search_settings_out_of_range_are_refused_in_one_line(values):
    with pytest.raises(BadOption, match=next(iter(values))):
        JointSearchSettings(**values)


def test_without_search_and_detours_there_is_the_safety_layer_alone():
    ways = {
        "all": SETTINGS,
        "no search": replace(SETTINGS, search=None),
        "no trees": replace(SETTINGS, trees=False),
        "none": replace(SETTINGS, trees=False, search=None),
    }
    allowed = {"all": WAYS[:3], "no search": WAYS[:2], "no trees": (WAYS[0], WAYS[2]), "none": WAYS[:1]}
    solved = dict.fromkeys(ways, 0)
    for name, settings in ways.items():
        for seed in range(8):
            scene = problem("gap", seed)
            found = solve(scene, settings)
            solved[name] += found.success
            if found.success:
                assert judged(scene, found).ok
                assert found.how in allowed[name]
    assert solved["none"] < solved["no trees"] == 8
    assert solved["none"] < solved["all"] and solved["no search"] < solved["all"] == 8
