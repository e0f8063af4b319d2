"""What may be asked of a planner, what is refused in one line, and what a failed plan says of the goal."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from helpers.random_scenes import SETTINGS, at, demonstrated, panda

from onedemo.planner.control.reachability import max_reach, why_not_reached
from onedemo.planner.errors import BadOption, OneDemoError, WrongType
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import Box, Obstacle, Sphere
from onedemo.planner.imitation.tsia import screw_path
from onedemo.planner.planning.attempts import NOTHING_KEPT
from onedemo.planner.planning.plan import NextMotion, PlanRequest
from onedemo.planner.planning.planner import Planner
from onedemo.planner.planning.planning_scene import PlanningScene, Tightest
from onedemo.planner.planning.requests import LEAVING_TOLERANCE, checked_request, reduced_request
from onedemo.planner.planning.settings import MotionSettings, PlanSettings
from onedemo.planner.robot.joint_limits import ROUNDING

ARM, BODY, HOME = panda()
HERE = ARM.fk(HOME)
GOAL = at([0.0, 0.1, 0.05]) @ HERE


def request(**change) -> PlanRequest:
    return PlanRequest(demonstrated(), HOME, GOAL)._replace(**change)


@pytest.mark.parametrize(
    "change, message",
    [
        ({"demonstrated": np.zeros((3, 8))}, "demonstrated is a ndarray; expected a PosePath"),
        ({"goal": "home"}, r"goal is 'home', a str; expected an array of numbers"),
        ({"obstacles": [Box((1, 1, 1))]}, r"obstacles\[0\] is .*; expected an Obstacle"),
        ({"obstacles": Obstacle(Sphere(0.1))}, "obstacles is .*; expected a sequence of Obstacle"),
        ({"leaving": HERE}, "leaving is .*; expected a PosePath"),
        ({"next_motion": demonstrated()}, "next_motion is .*; expected a NextMotion"),
        ({"next_motion": NextMotion(HERE)}, r"next_motion.path is .*; expected a PosePath"),
        ({"next_motion": NextMotion(demonstrated(), allowed=5)}, "next_motion.allowed is 5, a int; expected"),
        ({"next_motion": NextMotion(demonstrated(), allowed=["ab"])}, r"next_motion.allowed\[0\] is 'ab'.*a pair of"),
        ({"seed": None}, "option 'seed': None is not a whole number"),
        ({"seed": 0.5}, "option 'seed': 0.5 is not a whole number"),
    ],
)
def test_what_is_no_part_of_a_request_is_refused_in_one_line(change, message):
    with pytest.raises(OneDemoError, match=message) as caught:
        checked_request(request(**change), ARM)
    assert "\n" not in str(caught.value)
    with pytest.raises(WrongType):
        Planner(ARM, BODY).answer(None)


def test_a_start_beyond_a_limit_by_rounding_is_at_the_limit():
    start = HOME.copy()
    for beyond, clamped in ((1e-9, True), (0.9 * ROUNDING, True), (1e-5, False), (0.01, False)):
        start[3] = ARM.upper[3] + beyond
        assert (checked_request(request(start=start), ARM).start[3] == ARM.upper[3]) == clamped
        why = Planner(ARM, BODY, PlanSettings(search=None)).plan(demonstrated(), start, GOAL).why
        assert clamped == ("beyond" not in why)
        words = {
            1e-5: "at -0.06979 rad is beyond its upper limit of -0.06980 rad by 0.00001 rad",
            0.01: "at -0.060 rad is beyond its upper limit of -0.070 rad by 0.010 rad",
        }
        assert clamped or why == f"start beyond a joint limit: {ARM.joint_names[3]} {words[beyond]}"
    np.testing.assert_array_equal(checked_request(request(), ARM).start, HOME)


@pytest.mark.parametrize(
    "away, turn, fit", [(0.0, 0.0, True), (0.009, 0.0, True), (0.011, 0.0, False), (0.0, 0.1, False)]
)
def test_leaving_begins_at_the_tool(away, turn, fit):
    begin = HERE @ Pose.from_yaw([away, 0.0, 0.0], turn)
    asked = request(leaving=screw_path(begin, GOAL, 0.01))
    if fit:
        assert away <= LEAVING_TOLERANCE and checked_request(asked, ARM).leaving is asked.leaving
    else:
        with pytest.raises(BadOption, match=rf"leaving.*{1e3 * away:.1f} mm and {math.degrees(turn):.1f} degrees"):
            checked_request(asked, ARM)


def test_paths_are_reduced_to_what_is_asked_for_and_the_request_of_a_plan_is_the_one_asked():
    path = demonstrated()
    asked = request(leaving=screw_path(HERE, GOAL, 0.001), next_motion=NextMotion(path))
    short, deviation = reduced_request(asked, 10)
    assert 0.0 < deviation < 0.05
    assert [len(each) for each in (short.demonstrated, short.leaving, short.next_motion.path)] == [10, 10, 10]
    assert reduced_request(asked, 1000) == (asked, 0.0)
    few = replace(SETTINGS, search=None, repet=replace(SETTINGS.repet, longest=20))
    plan = Planner(ARM, BODY, few).plan(path, HOME, GOAL)
    assert plan.request.demonstrated is path and len(plan.imitated) == 20 and 0.0 < plan.reduction < 0.01


@pytest.mark.parametrize("change", [{"dt": 0.0}, {"dt": -0.02}, {"dt": math.nan}, {"dt": "fast"}, {"dt": math.inf}])
def test_time_steps_that_are_none_are_refused(change):
    with pytest.raises(BadOption, match="dt"):
        MotionSettings(**change)
    with pytest.raises(BadOption, match=r"30 s are 3e\+10 ticks of 1e-09 s; allowed are 1000000"):
        PlanSettings(motion=MotionSettings(dt=1e-9))


def test_a_goal_out_of_reach_says_how_far_the_arm_reaches():
    far = at([5.0, 0.0, 1.0], HERE.quaternion)
    failed = Planner(ARM, BODY).plan(demonstrated(), HOME, far)
    found = re.fullmatch(
        r"ik_or_limit: the goal is (\d+\.\d+) m from the first joint, \w+; the arm reaches at most (\d+\.\d+) m",
        failed.why,
    )
    assert found and float(found[1]) > 4.0 > float(found[2])
    rng = np.random.default_rng(0)
    base = ARM.chain[0, 4:7]
    reached = [np.linalg.norm(ARM.fk(rng.uniform(ARM.lower, ARM.upper)).position - base) for _ in range(500)]
    assert max(reached) <= max_reach(ARM) < 1.5 * max(reached)


def test_a_goal_within_the_longest_reach_says_how_near_the_arm_comes():
    base = ARM.chain[0, 4:7]
    near = at(base + np.array([0.0, 0.0, max_reach(ARM) - 0.05]), HERE.quaternion)
    words = why_not_reached(ARM, near, HOME)
    assert re.match(r"inverse kinematics ends 0\.\d+ m and [\d.]+ degrees from the goal", words)
    assert why_not_reached(ARM, near, HOME, search=False) == ""
    assert why_not_reached(ARM, HERE, HOME) == "the arm reaches the goal, but does not follow the path to it"


@pytest.mark.parametrize(
    "distance, margin, words",
    [
        (0.00999, 0.01, "link3 is 9.99 mm from link5, which must be 10.00"),
        (0.005, 0.01, "link3 is 5.0 mm from link5, which must be 10.0"),
        (-0.001, 0.01, "link3 touches link5"),
        (0.0121, 0.003, "link3 is 12.1 mm from link5, and 3.0 are enough"),
    ],
)
def test_a_message_does_not_contradict_itself(distance, margin, words):
    assert str(Tightest("link3", "link5", distance, margin)) == words


@pytest.mark.parametrize("margin, blocking", [(0.15, "far"), (0.0, "near")])
def test_the_pair_with_the_least_slack_is_named_not_the_nearest(margin, blocking):
    """Two balls below the hand: the farther one blocks if more must be kept from it."""
    near = Obstacle(Sphere(0.02), at([0.0, 0.0, 0.03]) @ HERE, name="near", margin=0.0 if margin else None)
    far = Obstacle(Sphere(0.02), at([0.0, 0.0, -0.12]) @ HERE, name="far", margin=margin)
    scene = PlanningScene.of(ARM, BODY, [near, far], PlanSettings())
    slacks = {}
    for one in (near, far):
        alone = PlanningScene.of(ARM, BODY, [one], PlanSettings())
        slacks[one.name] = alone.slack(HOME)
    assert min(slacks, key=slacks.__getitem__) == blocking, slacks
    for tight in (scene.tightest(HOME), scene.tightest_of_tool(HERE)):
        assert tight.other == blocking and tight.slack == pytest.approx(slacks[blocking], abs=1e-6)
    why = Planner(ARM, BODY).plan(demonstrated(), HOME, GOAL, [near, far]).why
    assert why.startswith("start in collision") and blocking in why


def test_a_plan_that_must_keep_some_of_the_demonstration_and_keeps_nothing_has_failed(monkeypatch):
    path = demonstrated()
    planner = Planner(ARM, BODY)
    plan = planner.plan(path, HOME, GOAL)
    assert plan.success and plan.keeps and planner.plan(path, HOME, GOAL, must_keep=True).success
    bare = plan._replace(imitated_share=0.0)
    assert bare.keeps and not bare._replace(request=plan.request._replace(must_keep=True)).keeps

    def followed(self, run, lead, seed):
        yield 0.0
        return bare._replace(request=run.request), 1

    def searched(self, run, best, seed):
        yield 0.0
        return best

    monkeypatch.setattr(Planner, "_followed", followed)
    monkeypatch.setattr(Planner, "_searched", searched)
    assert planner.plan(path, HOME, GOAL).success
    failed = planner.plan(path, HOME, GOAL, must_keep=True)
    assert failed.reason == NOTHING_KEPT and failed.detail == "found was: direct" and not failed.success
