from __future__ import annotations

import numpy as np
import pytest
from helpers.arms import READY, panda
from hypothesis import given, settings
from hypothesis import strategies as st

from onedemo.planner.control.inverse_kinematics import ANGLE_TOLERANCE, POSITION_TOLERANCE, inverse_kinematics
from onedemo.planner.errors import BadOption
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.planning.settings import MotionSettings

few = settings(max_examples=20, deadline=None)
seeds = st.integers(0, 10**6)


@few
@given(seeds)
def test_a_joint_solution_reaches_the_pose(seed):
    arm, rng = panda(), np.random.default_rng(seed)
    target = arm.fk(READY + rng.uniform(-0.3, 0.3, 7))
    q = inverse_kinematics(arm, target, READY)
    assert q is not None
    distance, angle = arm.fk(q).distance_to(target)
    assert distance < POSITION_TOLERANCE
    assert angle < ANGLE_TOLERANCE
    assert arm.margin(q) >= 0


def test_out_of_reach_has_no_joint_solution():
    assert inverse_kinematics(panda(), Pose.from_yaw([2.0, 0, 0.3], 0), READY) is None


@pytest.mark.parametrize("change", [{"guide": 0.9}, {"max_guide": 1.2}, {"departure": -0.1}])
def test_bad_settings_are_named(change):
    with pytest.raises(BadOption):
        MotionSettings(**change)
