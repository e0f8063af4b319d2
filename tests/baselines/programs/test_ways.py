"""Ways that differ from what was shown, and the quick look at whether the arm has a posture at a goal."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers.arms import table_panda

from onedemo.baselines.programs.goal_choice import MotionChoice
from onedemo.baselines.programs.postures import Postures
from onedemo.baselines.programs.skill_steps import AS_SHOWN, WAYS, Way
from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.resumable import finished

FAR = Pose.from_position_quaternion([3.0, 0.0, 1.0])


def test_the_first_way_is_as_shown_and_each_is_there_once():
    assert WAYS[0] == AS_SHOWN and len(set(WAYS)) == len(WAYS)
    assert AS_SHOWN.hand.distance_to(Pose.identity()) == pytest.approx((0.0, 0.0))


def test_a_quarter_turn_leaves_the_approach_and_swaps_the_axis_along_which_the_fingers_close():
    turned = Way(turn=0.5 * math.pi).hand.rotation
    np.testing.assert_allclose(turned @ [0, 0, 1], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(turned @ [1, 0, 0], [0, 1, 0], atol=1e-12)


def test_a_posture_is_found_where_there_is_one_and_none_where_the_arm_does_not_reach():
    arm, _, home = table_panda()
    postures = Postures(arm, home)
    assert postures.reach(arm.fk(home + 0.1)) and not postures.reach(FAR)


def test_goals_without_a_posture_are_left_out_unless_all_are():
    arm, _, home = table_panda()
    here, reach = arm.fk(home), Postures(arm, home).reach
    path = PosePath(np.array([here.dq, here.dq]))
    motion = MotionChoice("x", path, (FAR, here, FAR), None, ())
    assert finished(motion.candidates()) == [0, 1, 2]
    assert finished(motion._replace(reaches=reach).candidates()) == [1]
    assert finished(motion._replace(goals=(FAR, FAR), reaches=reach).candidates()) == [0]
