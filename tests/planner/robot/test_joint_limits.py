"""Joints at and beyond limits: rounding is clamped wherever joints come in, the rest is said with enough digits."""

from __future__ import annotations

import re

import numpy as np
import pytest
from helpers.arms import random_arm
from helpers.random_scenes import at, demonstrated, panda
from helpers.strategies import for_all
from hypothesis import strategies as st

from onedemo.planner import Controller, MotionLog, Planner, PlanSettings, certify
from onedemo.planner.robot.joint_limits import NEAR, ROUNDING, beyond_limit, near_limit, within_limits

ARM, BODY, HOME = panda()
GOAL = at([0.0, 0.1, 0.05]) @ ARM.fk(HOME)
SIDES = {"lower": -1.0, "upper": 1.0}
each_side = pytest.mark.parametrize("side", SIDES)
excesses = st.floats(2.0 * ROUNDING, 3.0)


def moved(arm, joint: int, side: str, excess: float) -> np.ndarray:
    """Joints in the middle but for one, which is beyond its limit."""
    q = 0.5 * (arm.lower + arm.upper)
    q[joint] = getattr(arm, side)[joint] + SIDES[side] * excess
    return q


@for_all(st.integers(0, 6), st.sampled_from(tuple(SIDES)), st.floats(0.0, 3.0))
def test_what_is_beyond_by_rounding_is_at_the_limit_and_nothing_else_is_touched(joint, side, excess):
    q = moved(ARM, joint, side, excess)
    found = within_limits(ARM, q)
    assert found is not q
    if abs(q[joint] - getattr(ARM, side)[joint]) <= ROUNDING:
        assert found[joint] == getattr(ARM, side)[joint] and beyond_limit(ARM, found) == ""
    else:
        np.testing.assert_array_equal(found, q)


@for_all(st.integers(0, 30), st.integers(0, 6), st.sampled_from(tuple(SIDES)), excesses)
def test_joint_value_limit_and_excess_are_named_and_add_up(seed, joint, side, excess):
    arm = random_arm(seed)
    words = beyond_limit(arm, moved(arm, joint, side, excess))
    unit = "m" if arm.chain[joint, 7] else "rad"
    number = r"(-?\d+\.\d+)"
    found = re.fullmatch(
        rf"joint{joint} at {number} {unit} is beyond its {side} limit of {number} {unit} by {number} {unit}", words
    )
    assert found, words
    at_, limit, over = map(float, found.groups())
    assert at_ != limit and over > 0.0
    digits = len(found[3].partition(".")[2])
    assert abs(SIDES[side] * (at_ - limit) - over) <= 2.0 * 10.0**-digits


@each_side
def test_a_joint_near_its_limit_is_named(side):
    for excess, words in (
        (-2.0 * NEAR, ""),
        (-0.5 * NEAR, f"{ARM.joint_names[3]} is 0.010 rad from its {side} limit"),
        (0.0, f"{ARM.joint_names[3]} is at its {side} limit"),
        (0.5 * ROUNDING, f"{ARM.joint_names[3]} is at its {side} limit"),
    ):
        assert near_limit(ARM, moved(ARM, 3, side, excess)) == words
    beyond = moved(ARM, 3, side, 0.1)
    assert near_limit(ARM, beyond) == beyond_limit(ARM, beyond) != ""


@each_side
def test_start_goal_log_and_controller_take_rounding_for_the_limit(side):
    planner = Planner(ARM, BODY, PlanSettings(search=None))
    for excess, fit in ((1e-9, True), (0.9 * ROUNDING, True), (1e-5, False)):
        q = HOME.copy()
        q[6] = getattr(ARM, side)[6] + SIDES[side] * excess
        for why in (planner.plan(demonstrated(), q, GOAL).why, planner.plan(demonstrated(), HOME, q).why):
            assert fit == ("beyond" not in why), why
        log = MotionLog(ARM, BODY, (), np.array([0.0, 1.0]), np.array([q, q]), 0.01)
        assert fit == (certify(log).reasons == ()), certify(log).reasons
        away = SIDES[side] * Controller(ARM)(q, GOAL)[6]
        assert away <= 1e-6, "a controller does not lead farther beyond"
