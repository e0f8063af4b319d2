from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from helpers.arms import READY, free_panda, joints_at, panda
from helpers.strategies import assert_same_pose
from hypothesis import given, settings
from hypothesis import strategies as st

from onedemo.planner.control.controller import ControllerSettings
from onedemo.planner.control.pursuit import ARRIVED, FOLLOWING, STALLED, Pursuit, PursuitSettings
from onedemo.planner.errors import BadOption
from onedemo.planner.geometry import dualquat as dq
from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.imitation.tsia import screw_path

DT = 0.02
few = settings(max_examples=25, deadline=None)
UNHURRIED = ControllerSettings(null_gain=0.0, max_linear=1e3, max_angular=1e3)


def a_path(seed=0, step=0.005):
    """A screw that the Panda can follow."""
    rng = np.random.default_rng(seed)
    arm = panda()
    goal = arm.fk(READY + rng.uniform(-0.15, 0.15, 7))
    return arm, screw_path(arm.fk(READY), goal, step)


@few
@given(st.integers(0, 10**6))
def test_a_followed_path_ends_at_its_end(seed):
    arm, path = a_path(seed)
    result = Pursuit(arm, path, DT).roll_out(READY)
    assert (result.arrived, result.reason) == (True, "")
    distance, angle = arm.fk(result.q).distance_to(path[-1])
    assert distance <= 1e-3
    assert angle <= 1e-2
    assert result.margin <= min(arm.margin(q) for q in result.trace) + 1e-12


def test_a_roll_out_is_the_same_bits_as_stepping():
    arm, path = a_path(3)
    pursuit, q, trace = Pursuit(arm, path, DT), READY.copy(), [READY]
    while (step := pursuit.step(q))[0] == FOLLOWING:
        q = q + DT * step[1]
        trace.append(q)
    assert step[0] == ARRIVED
    np.testing.assert_array_equal(Pursuit(arm, path, DT).roll_out(READY).trace, trace)


def test_a_fraction_of_the_screw_slows_the_gain_down_and_still_arrives():
    arm, path = a_path(1)
    slow = PursuitSettings(tau=0.1)
    first = Pursuit(arm, path, DT, controller=UNHURRIED).step(READY)[1]
    tenth = Pursuit(arm, path, DT, controller=UNHURRIED, settings=slow).step(READY)[1]
    np.testing.assert_allclose(tenth, 0.1 * first, atol=1e-9)
    assert Pursuit(arm, path, DT, settings=slow).roll_out(READY).arrived


@pytest.mark.parametrize(
    "tau, gain, dt", [(1.0, 15.0, 0.02), (0.3, 15.0, 0.02), (0.01, 1000.0, 0.001)], ids=["log law", "slow", "paper"]
)
def test_ideal_tracking_is_the_recurrence_of_screw_steps_and_ends_at_the_end(tau, gain, dt):
    """c <- S(tau gain dt; c, d'_i) until within tolerance; with gain dt = 1 that is the paper's c <- S(tau; c, d'_i).

    The recurrence is that of a tool that keeps the commanded twist for a tick: the joints follow it exactly.
    """
    path = screw_path(free_panda().fk(READY), panda().fk(READY + 0.1), 0.004)
    arm, chosen, radius = free_panda(), replace(UNHURRIED, gain=gain), 0.01
    pursuit = Pursuit(arm, path, dt, controller=chosen, settings=PursuitSettings(tau=tau, capture_radius=radius))
    c, q, index, checked = path[0].dq, READY, 0, Counter()
    for _ in range(4000):
        while index < len(path) - 1 and np.hypot(*np.array(dq.pose_distance(c, path[index].dq)) * [1, 0.2]) <= radius:
            index += 1
        status, qdot = pursuit.step(q)
        assert pursuit.index == index
        if status != FOLLOWING:
            break
        moved = dq.mul(c, dq.dq_from_twist(dt * arm.jacobian(q) @ qdot))
        c = dq.sclerp(c, path[index].dq, tau * gain * dt)
        assert_same_pose(moved, c, 1e-10)
        q = joints_at(arm, c, q)
        checked[index] += 1
    assert status == ARRIVED
    assert sum(checked.values()) > 20
    assert len(checked) > 5
    distance, angle = dq.pose_distance(c, path[-1].dq)
    assert distance <= 1e-3
    assert angle <= 1e-2


def test_the_papers_tau_of_a_hundredth_ends_within_tolerance():
    arm, path = a_path(2, step=0.004)
    settings_ = PursuitSettings(tau=0.01)
    for gain, dt in ((1000.0, 0.001), (15.0, 0.02)):
        controller = ControllerSettings(gain=gain)
        result = Pursuit(arm, path, dt, controller=controller, settings=settings_).roll_out(READY, max_seconds=200.0)
        assert (result.arrived, result.reason) == (True, "")
        assert (np.array(arm.fk(result.q).distance_to(path[-1])) <= [1e-3, 1e-2]).all()


def test_the_reference_is_the_first_pose_beyond_the_capture_radius():
    arm, path = a_path(8)
    settings_ = PursuitSettings(capture_radius=0.012)
    pursuit, q, seen = Pursuit(arm, path, DT, settings=settings_), READY.copy(), set()
    while True:
        x = arm.fk(q).dq
        status, qdot = pursuit.step(q)
        distance, angle = dq.pose_distance(x, path.dqs)
        screw_length = np.hypot(distance, 0.2 * angle)
        if pursuit.index < len(path) - 1:
            assert screw_length[pursuit.index] > 0.012
        if pursuit.index > 0:
            seen.add(pursuit.index)
            assert screw_length[pursuit.index - 1] <= 0.012 or pursuit.index - 1 in seen
        if status != FOLLOWING:
            break
        q = q + DT * qdot
    assert status == ARRIVED
    assert len(seen) > 5


def test_the_reference_never_goes_back_and_stays_at_the_end():
    arm, path = a_path(4)
    pursuit, q, indices = Pursuit(arm, path, DT), READY.copy(), []
    for k in range(300):
        status, qdot = pursuit.step(q)
        indices.append(pursuit.index)
        q = q + DT * qdot + (1e-3 * np.sin(k) if status == FOLLOWING else 0.0)
    assert (np.diff(indices) >= 0).all()
    assert indices[-1] == len(path) - 1


@pytest.mark.parametrize("count", [1, 2])
def test_short_and_repeated_paths_are_followed(count):
    arm, path = a_path(5)
    assert Pursuit(arm, path[len(path) - count :], DT).roll_out(READY).arrived
    doubled = PosePath(np.repeat(path.dqs, 3, axis=0) * np.resize([1.0, -1.0], 3 * len(path))[:, None])
    assert Pursuit(arm, doubled, DT).roll_out(READY).arrived


def test_out_of_reach_is_a_stall_and_too_long_is_a_timeout():
    arm, path = a_path(6)
    far = screw_path(arm.fk(READY), Pose.from_yaw([3.0, 0, 0.3], 0), 0.05)
    result = Pursuit(arm, far, DT).roll_out(READY)
    assert (result.arrived, result.reason) == (False, "ik_or_limit")
    assert np.isfinite(result.q).all()
    assert Pursuit(arm, path, DT).roll_out(READY, max_seconds=0.1).reason == "timeout"
    pursuit, q, status = Pursuit(arm, far, DT), READY.copy(), FOLLOWING
    for _ in range(3000):
        status, qdot = pursuit.step(q)
        if status != FOLLOWING:
            break
        q = q + DT * qdot
    assert status == STALLED


@pytest.mark.parametrize("pull", ["screw", "decoupled"])
def test_pulled_apart_the_tool_goes_straight_and_along_the_screw_otherwise(pull):
    arm = panda()
    start = arm.fk(READY)
    goal = start @ Pose.from_position_quaternion([0.06, 0.05, -0.05], [np.cos(0.4), 0.0, np.sin(0.4), 0.0])
    gentle = ControllerSettings(null_gain=0.0, max_linear=1e3, max_angular=1e3, gain=1.0)
    pursuit = Pursuit(arm, PosePath(goal.dq[None]), DT, controller=gentle, settings=PursuitSettings(interpolation=pull))
    result = pursuit.roll_out(READY)
    assert result.arrived
    way = np.array([arm.fk(q).position for q in result.trace])
    along = (goal.position - start.position) / np.linalg.norm(goal.position - start.position)
    off_line = np.linalg.norm(np.cross(way - start.position, along), axis=1).max()
    curve = screw_path(start, goal, 0.0005).positions
    off_screw = max(np.linalg.norm(curve - each, axis=1).min() for each in way)
    assert (off_line < 1e-3) == (pull == "decoupled")
    assert (off_screw < 1e-3) == (pull == "screw")


def test_the_papers_rule_advances_every_tick_and_is_late():
    arm, path = a_path(7, step=0.001)
    settings_ = PursuitSettings(advance="paper", tau=0.01)
    pursuit, q = Pursuit(arm, path, DT, settings=settings_), READY.copy()
    for k in range(len(path) - 1):
        _, qdot = pursuit.step(q)
        assert pursuit.index == k + 1
        q = q + DT * qdot
    assert arm.fk(q).distance_to(path[-1])[0] > 0.5 * path.lengths()[-1] * 0.2


@pytest.mark.parametrize(
    "change", [{"tau": 0.0}, {"tau": 1.1}, {"advance": "fast"}, {"interpolation": "hard"}, {"capture_radius": -1.0}]
)
def test_bad_settings_are_named(change):
    with pytest.raises(BadOption, match=next(iter(change))):
        PursuitSettings(**change)
    with pytest.raises(BadOption, match=r"gain \* dt"):
        Pursuit(panda(), a_path()[1], 0.1)
