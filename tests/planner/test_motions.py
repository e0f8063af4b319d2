from __future__ import annotations

import numpy as np
import pytest
from arms import READY, joints, panda
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import assert_same_pose

from onedemo.planner import dualquat as dq
from onedemo.planner.errors import BadOption
from onedemo.planner.ik import ANGLE_TOLERANCE, POSITION_TOLERANCE, inverse_kinematics, path_margins
from onedemo.planner.motions import MotionSettings, plan_motion, reachable_departure
from onedemo.planner.pose import Pose
from onedemo.planner.tsia import screw_path

few = settings(max_examples=20, deadline=None)
seeds = st.integers(0, 10**6)
SETTINGS = MotionSettings()


def shown():
    """Down by 15 cm, forwards and turning a little."""
    end = panda().fk(READY)
    start = Pose.from_yaw([-0.05, 0.03, 0.15], 0.3) @ end
    return screw_path(Pose.from_position_quaternion(start.position, end.quaternion), end, 0.005)


@few
@given(seeds)
def test_a_joint_solution_reaches_the_pose(seed):
    arm, rng = panda(), np.random.default_rng(seed)
    target = arm.fk(READY + rng.uniform(-0.3, 0.3, 7))
    q = inverse_kinematics(arm, target, READY)
    assert q is not None
    distance, angle = arm.fk(q).gap(target)
    assert distance < POSITION_TOLERANCE
    assert angle < ANGLE_TOLERANCE
    assert arm.margin(q) >= 0


def test_out_of_reach_has_no_joint_solution():
    assert inverse_kinematics(panda(), Pose.from_yaw([2.0, 0, 0.3], 0), READY) is None


def test_margins_are_minus_infinity_from_where_the_path_leaves_the_reach():
    arm = panda()
    end = arm.fk(READY)
    path = screw_path(Pose.from_position_quaternion([1.5, 0, 0]) @ end, end, 0.02)
    margins = path_margins(arm, path, READY)
    assert np.isinf(margins[0])
    assert margins[-1] == pytest.approx(arm.margin(READY), abs=0.05)
    lost = np.isinf(margins)
    assert (np.diff(lost.astype(int)) <= 0).all(), "once lost, seen from the end, always lost"


@few
@given(seeds)
def test_motions_arrive_and_keep_the_demonstrated_tail(seed):
    arm, rng = panda(), np.random.default_rng(seed)
    goal = Pose.from_yaw(rng.uniform(-0.08, 0.08, 3), rng.uniform(-0.3, 0.3))
    end = arm.fk(READY)
    goal = Pose.from_position_quaternion(
        goal.position + end.position, (Pose.from_yaw([0, 0, 0], goal.yaw) @ end).quaternion
    )
    motion = plan_motion(arm, READY, shown(), goal, SETTINGS, leaving=shown().reversed())
    assert motion.arrives
    assert arm.fk(motion.q).gap(goal)[0] <= 1e-3
    assert motion.margin > 0
    assert_same_pose(motion.final_path.dqs[-1], goal.dq, 1e-13)
    assert_same_pose(motion.tail.dqs[-1], goal.dq, 1e-13)
    ours, theirs = motion.tail.dqs, shown().dqs[-len(motion.tail) :]
    assert_same_pose(dq.mul(dq.conj(ours[:-1]), ours[1:]), dq.mul(dq.conj(theirs[:-1]), theirs[1:]), 1e-11)
    assert_same_pose(motion.final_path.dqs[0], arm.fk(READY).dq, 1e-13)


def test_without_a_departure_the_blend_begins_at_once():
    arm = panda()
    motion = plan_motion(arm, READY, shown(), arm.fk(READY + 0.05), SETTINGS)
    assert motion.departure is None
    assert motion.seconds > 0


def test_a_goal_out_of_reach_is_said_so():
    motion = plan_motion(panda(), READY, shown(), Pose.from_yaw([2, 0, 0.3], 0.0), SETTINGS)
    assert (motion.arrives, motion.reason) == (False, "ik_or_limit")


def test_an_impossible_departure_becomes_straight_up():
    arm = panda()
    start = arm.fk(READY)
    down = screw_path(start, Pose.from_position_quaternion([0, 0, -0.9]) @ start, 0.01)
    path, before = reachable_departure(arm, READY, down, MotionSettings(departure=0.1))
    assert before.arrived
    assert path[-1].position[2] < start.position[2], "what can be done is done as shown"
    outwards = screw_path(start, Pose.from_position_quaternion([1.5, 0, 0]) @ start, 0.01)
    path, before = reachable_departure(arm, READY, outwards, MotionSettings(departure=0.35))
    assert before.arrived
    np.testing.assert_allclose(path[-1].position - start.position, [0, 0, 0.35], atol=1e-9)


def test_the_guide_moves_on_where_the_tail_cannot_be_reached():
    arm = panda()
    end = arm.fk(READY)
    long = screw_path(Pose.from_position_quaternion([0.9, 0, 0.2]) @ end, end, 0.01)
    early = MotionSettings(guide=0.0, max_guide=0.9)
    motion = plan_motion(arm, READY + 0.05, long, end, early)
    assert motion.arrives
    assert len(motion.tail) < 0.8 * len(long)


def test_many_starts_stay_within_limits():
    arm, rng = panda(), np.random.default_rng(0)
    for _ in range(20):
        motion = plan_motion(arm, joints(arm, rng), shown(), arm.fk(READY), SETTINGS)
        assert np.isfinite(motion.q).all()
        assert motion.margin >= -1e-12


@pytest.mark.parametrize("change", [{"guide": 0.9}, {"max_guide": 1.2}, {"departure": -0.1}, {"min_margin": -1.0}])
def test_bad_settings_are_named(change):
    with pytest.raises(BadOption):
        MotionSettings(**change)
