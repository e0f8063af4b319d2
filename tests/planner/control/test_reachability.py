"""Why a goal is not reached: the distance, a limit, the rotation, or how near the arm comes; and each is true."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from helpers.random_scenes import at, demonstrated, panda

from onedemo.planner import Arm, Planner, PlanRequest, PlanSettings, Pose, plan_batch
from onedemo.planner.control.reachability import gap, max_reach, why_not_reached
from onedemo.planner.planning.settings import JointSearchSettings

ARM, BODY, HOME = panda()
HERE = ARM.fk(HOME)
BASE = ARM.chain[0, 4:7]
SEARCH = PlanSettings(search=JointSearchSettings(seeds=2, rounds=1, targets=1))
FAR = re.compile(r"ik_or_limit: the goal is ([\d.]+) m from the first joint, (\w+); the arm reaches at most ([\d.]+) m")


@pytest.mark.parametrize("settings", [SEARCH, PlanSettings(search=None), PlanSettings(trees=False, search=None)])
@pytest.mark.parametrize("excess", [1e-7, 0.01, 4.0])
def test_a_goal_out_of_reach_is_said_by_every_planner_with_numbers_that_differ(settings, excess):
    goal = at(BASE + np.array([0.0, 0.0, max_reach(ARM) + excess]), HERE.quaternion)
    asked = PlanRequest(demonstrated(), HOME, goal)
    for plan in (Planner(ARM, BODY, settings).answer(asked), *plan_batch([asked], ARM, BODY, settings)):
        found = FAR.fullmatch(plan.why)
        assert found, plan.why
        assert found[2] == ARM.joint_names[0] and float(found[1]) > float(found[3])


@pytest.mark.parametrize("joint, value", [(3, 0.3), (5, -0.4), (1, 2.1)])
def test_a_goal_that_only_a_joint_beyond_its_limit_reaches_names_a_joint(joint, value):
    """Limits are tightened around a posture, so that the goal of another one lies beyond them."""
    narrow = replace(ARM, lower=HOME - 0.15, upper=HOME + 0.15)
    q = HOME.copy()
    q[joint] += np.sign(value) * 0.8
    words = why_not_reached(narrow, ARM.fk(q), HOME)
    found = re.match(r"within reach, but only beyond a joint limit: (\w+) at (-?[\d.]+) rad is beyond its", words)
    assert found and found[1] in ARM.joint_names, words


def test_a_wrong_rotation_is_told_from_a_wrong_position():
    """An arm whose three joints all turn about z cannot tilt its hand."""
    links = ((0.0, 0.0, 0.3), (0.4, 0.0, 0.0), (0.3, 0.0, 0.0), (0.1, 0.0, 0.0))
    chain = np.array([[1.0, 0.0, 0.0, 0.0, *link, 0.0] for link in links])
    arm = Arm("planar", ("a", "b", "c"), chain, np.full(3, -2.5), np.full(3, 2.5), np.ones(3))
    q = np.array([0.3, 0.8, -0.4])
    tilted = arm.fk(q) @ Pose.from_position_quaternion([0, 0, 0], [np.cos(0.2), np.sin(0.2), 0, 0])
    words = why_not_reached(arm, tilted, np.zeros(3))
    found = re.match(r"the arm reaches the goal's position, but not its rotation: ([\d.]+) degrees off", words)
    assert found and float(found[1]) >= np.degrees(0.4) - 0.1, words


def test_what_the_arm_reaches_is_said():
    assert why_not_reached(ARM, HERE, HOME) == "the arm reaches the goal, but does not follow the path to it"
    assert gap(ARM, HERE, HOME) == "0.000 m and 0.0 degrees from the goal"


def test_a_follower_that_stops_says_how_far_from_the_goal():
    near = at(BASE + np.array([0.0, 0.0, max_reach(ARM) - 0.02]), HERE.quaternion)
    plan = Planner(ARM, BODY, PlanSettings(search=None)).plan(demonstrated(), HOME, near)
    assert re.match(r"ik_or_limit: the arm comes to a stop 0\.\d+ m and [\d.]+ degrees from the goal", plan.why), (
        plan.why
    )
