"""The control laws against their definitions; limits that are never exceeded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.arms import READY, free_panda, joints, joints_at, panda, random_arm
from helpers.strategies import assert_same_pose, dqs, random_dq
from hypothesis import given, settings
from hypothesis import strategies as st

from onedemo.planner.control.controller import Controller, ControllerSettings, choose_sign
from onedemo.planner.control.linear import cholesky, gram, smallest_singular_bound
from onedemo.planner.errors import BadOption
from onedemo.planner.geometry import dualquat as dq
from onedemo.planner.geometry.pose import Pose

few = settings(max_examples=50, deadline=None)
seeds = st.integers(0, 10**6)
PLAIN = ControllerSettings(null_gain=0.0, max_linear=1e6, max_angular=1e6, damping_threshold=0.0, limit_gain=1e6)
LAWS = ("log", "paper")


def near(rng, arm, size=0.2):
    """Joints off any singularity and a target in reach."""
    q = READY + rng.uniform(-0.2, 0.2, 7)
    return q, arm.fk(q + rng.uniform(-size, size, 7))


def twist_as_dq(xi):
    """A body twist as a pure dual quaternion."""
    return np.concatenate([[0.0], xi[3:], [0.0], xi[:3]])


def pose_jacobian(arm, q):
    """(8, dof) derivative of vec x: x times half the twist of each joint."""
    x, body = arm.fk_jacobian(q)
    return np.stack([0.5 * dq.mul(x, twist_as_dq(body[:, j])) for j in range(arm.dof)], axis=1)


def error_jacobian(arm, q, target):
    """N = H-(x_d) C8 J8: how vec(x* x_d) changes."""
    return dq.hamilton_minus(target) @ dq.CONJUGATE_8 @ pose_jacobian(arm, q)


def error(arm, q, target):
    x = arm.fk_jacobian(q)[0]
    return dq.identity() - dq.mul(dq.conj(x), target)


@few
@given(seeds)
def test_the_pose_and_error_jacobians_are_derivatives(seed):
    arm, rng = random_arm(seed), np.random.default_rng(seed)
    q, qdot, h, target = joints(arm, rng), rng.normal(size=7), 1e-6, random_dq(rng)
    slope = (arm.fk_jacobian(q + h * qdot)[0] - arm.fk_jacobian(q - h * qdot)[0]) / (2 * h)
    np.testing.assert_allclose(pose_jacobian(arm, q) @ qdot, slope, atol=1e-7)
    slope = (error(arm, q + h * qdot, target) - error(arm, q - h * qdot, target)) / (2 * h)
    np.testing.assert_allclose(-error_jacobian(arm, q, target) @ qdot, slope, atol=1e-7)


@few
@given(seeds)
def test_the_paper_law_is_its_pseudo_inverse(seed):
    arm, rng = free_panda(), np.random.default_rng(seed)
    q, target = near(rng, arm)
    e = error(arm, q, target.dq)
    sign = 1.0
    if np.linalg.norm(e) > 1:
        sign, e = -1.0, error(arm, q, -target.dq)
    n = error_jacobian(arm, q, sign * target.dq)
    expected = PLAIN.gain * np.linalg.pinv(n, rcond=1e-9) @ e
    qdot = Controller(arm, replace(PLAIN, law="paper"))(q, target)
    np.testing.assert_allclose(qdot, expected, atol=1e-8 * max(1, np.abs(expected).max()))


@few
@given(seeds)
def test_the_log_law_is_its_pseudo_inverse(seed):
    arm, rng = free_panda(), np.random.default_rng(seed)
    q, target = near(rng, arm)
    x, body = arm.fk_jacobian(q)
    twist = dq.twist_from_dq(dq.mul(dq.conj(x), target.dq))
    expected = PLAIN.gain * np.linalg.pinv(body) @ twist
    np.testing.assert_allclose(Controller(arm, PLAIN)(q, target), expected, atol=1e-8)


@few
@given(seeds)
def test_the_pseudo_inverse_of_n_is_that_of_the_body_jacobian_times_a(seed):
    arm, rng = panda(), np.random.default_rng(seed)
    q, target = near(rng, arm)
    n, body = error_jacobian(arm, q, target.dq), arm.jacobian(q)
    a = n @ np.linalg.pinv(body)
    product = np.linalg.pinv(body) @ np.linalg.pinv(a, rcond=1e-9)
    np.testing.assert_allclose(np.linalg.pinv(n, rcond=1e-9), product, atol=1e-8)


@few
@given(dqs(angles=st.floats(0, np.pi)))
def test_the_reachable_part_of_the_error_is_what_the_method_says_and_bounds_its_decay(x):
    """|P e|^2 = s^2 + |d|^2 - d_w^2 / (1 + |d|^2) >= min((1 + c) / 2, c^2) |e|^2, P onto the range of N."""
    x = x if x[0] >= 0 else -x
    span = np.stack([dq.mul(twist_as_dq(xi), x) for xi in np.eye(6)], axis=1)
    basis = np.linalg.qr(span)[0]
    e, c, d = dq.identity() - x, x[0], x[4:]
    projected = np.sum((basis.T @ e) ** 2)
    assert projected == pytest.approx(1 - c**2 + d @ d - d[0] ** 2 / (1 + d @ d), abs=1e-12)
    assert projected >= min((1 + c) / 2, c**2) * (e @ e) - 1e-12


@few
@given(seeds)
def test_the_range_of_n_on_an_arm_is_that_of_all_twists_of_the_error(seed):
    arm, rng = panda(), np.random.default_rng(seed)
    q, target = near(rng, arm)
    x = dq.mul(dq.conj(arm.fk_jacobian(q)[0]), target.dq)
    u, sigma, _ = np.linalg.svd(error_jacobian(arm, q, target.dq))
    assert (sigma > 1e-9).sum() == 6
    e, c, d = dq.identity() - x, x[0], x[4:]
    expected = 1 - c**2 + d @ d - d[0] ** 2 / (1 + d @ d)
    assert np.sum((u[:, :6].T @ e) ** 2) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("law", LAWS)
@few
@given(seed=seeds)
def test_the_error_falls_with_the_corrected_sign_and_grows_with_the_printed_one(law, seed):
    arm, rng = free_panda(), np.random.default_rng(seed)
    start, target = near(rng, arm)
    dt = 1e-3
    for sign, steps in ((1.0, 50), (-1.0, 25)):
        q, control, errors = start.copy(), Controller(arm, replace(PLAIN, law=law)), []
        for _ in range(steps):
            errors.append(dq.pose_error(arm.fk(q).dq, target.dq))
            q = q + sign * dt * control(q, target)
        assert (sign * np.diff(errors) < 0).all()
        assert (errors[-1] / errors[0] > 1.2) == (sign < 0)


@few
@given(seeds)
def test_in_exact_twist_steps_the_log_law_goes_the_geometric_way_along_the_screw(seed):
    """s_k = 1 - (1 - gain dt)^k: true of a tool that moves by the commanded twist, kept in its own axes for a tick.

    Joints that keep their speed for a tick move the tool by that only up to O(dt^2); here they are put where the
    tool is, to the last digits.
    """
    arm, rng, dt = free_panda(), np.random.default_rng(seed), 0.02
    q, target = near(rng, arm)
    control = Controller(arm, PLAIN)
    start = x = arm.fk(q).dq
    for k in range(1, 13):
        x = dq.mul(x, dq.dq_from_twist(dt * arm.jacobian(q) @ control(q, target)))
        assert_same_pose(x, dq.sclerp(start, target.dq, 1 - (1 - PLAIN.gain * dt) ** k), 1e-10)
        q = joints_at(arm, x, q)
    assert dq.pose_error(x, target.dq) < 0.02 * dq.pose_error(start, target.dq) + 1e-12


def test_the_log_law_moves_along_the_screw_to_the_target():
    dt, gain = 0.02, 15.0
    arm, rng = free_panda(), np.random.default_rng(0)
    q, target = near(rng, arm)
    start, settings_ = arm.fk(q), replace(PLAIN, gain=gain)
    fine = 200
    for _ in range(fine):
        q = q + dt / fine * Controller(arm, settings_)(q, target)
    travelled = dq.twist_from_dq(dq.mul(dq.conj(start.dq), arm.fk(q).dq))
    whole = dq.twist_from_dq(dq.mul(dq.conj(start.dq), target.dq))
    ratio = travelled @ whole / (whole @ whole)
    np.testing.assert_allclose(travelled, ratio * whole, atol=2e-5)
    assert ratio == pytest.approx(1 - np.exp(-gain * dt), abs=1e-3)


@few
@given(seeds)
def test_the_commanded_twist_points_along_the_screw(seed):
    arm, rng = free_panda(), np.random.default_rng(seed)
    q, target = near(rng, arm)
    x, body = arm.fk_jacobian(q)
    k, dt = 0, 0.02
    for k in range(1, 6):
        twist = body @ Controller(arm, PLAIN)(q, target)
        ideal = dq.mul(x, dq.dq_from_twist(dt * twist))
        expected = dq.sclerp(x, target.dq, 1 - (1 - PLAIN.gain * dt))
        assert_same_pose(ideal, expected, 1e-10)
        q = q + 1e-3 * k * rng.normal(size=7)
        x, body = arm.fk_jacobian(q)


@pytest.mark.parametrize("law", LAWS)
@few
@given(seed=seeds)
def test_the_null_space_task_does_not_move_the_tool(law, seed):
    arm, rng = panda(), np.random.default_rng(seed)
    q, _ = near(rng, arm)
    settings_ = ControllerSettings(law=law, null_gain=5.0)
    qdot = Controller(arm, settings_)(q, arm.fk(q))
    assert np.linalg.norm(qdot) > 1e-6
    assert np.abs(arm.jacobian(q) @ qdot).max() < 1e-9


@pytest.mark.parametrize("law", LAWS)
@few
@given(seed=seeds)
def test_speeds_stay_within_limits_and_keep_their_direction(law, seed):
    arm, rng = free_panda(), np.random.default_rng(seed)
    q, target = near(rng, arm, size=1.0)
    free = Controller(arm, replace(PLAIN, law=law))(q, target)
    slow = type(arm)("slow", arm.joint_names, arm.chain, arm.lower, arm.upper, np.full(7, 0.3))
    limited = Controller(slow, replace(PLAIN, law=law))(q, target)
    assert np.abs(limited).max() <= 0.3 + 1e-12
    assert free @ limited >= (1 - 1e-12) * np.linalg.norm(free) * np.linalg.norm(limited)


@pytest.mark.parametrize("law", LAWS)
@few
@given(seed=seeds)
def test_the_tool_is_never_faster_than_allowed(law, seed):
    arm, rng = free_panda(), np.random.default_rng(seed)
    q, target = near(rng, arm, size=1.0)
    settings_ = replace(PLAIN, law=law, max_linear=0.1, max_angular=0.3)
    twist = arm.jacobian(q) @ Controller(arm, settings_)(q, target)
    assert np.linalg.norm(twist[:3]) <= 0.1 + 1e-9
    assert np.linalg.norm(twist[3:]) <= 0.3 + 1e-9


@pytest.mark.parametrize("law", LAWS)
def test_joints_never_leave_their_limits_wherever_the_target_is(law):
    arm, rng, dt = panda(), np.random.default_rng(0), 0.02
    for _ in range(60):
        q, target = joints(arm, rng), Pose(random_dq(rng))
        control = Controller(arm, ControllerSettings(law=law))
        for _ in range(60):
            qdot = control(q, target)
            assert np.isfinite(qdot).all()
            assert (np.abs(qdot) <= arm.velocity_limits + 1e-12).all()
            q = q + dt * qdot
            assert arm.margin(q) >= -1e-12


@few
@given(seeds, st.integers(6, 7))
def test_singular_postures_give_finite_speeds(seed, dof):
    arm, rng = random_arm(seed, dof, prismatic=0.0), np.random.default_rng(seed)
    flat = np.array(arm.chain)
    flat[:, :4] = [1, 0, 0, 0]
    singular = type(arm)("flat", arm.joint_names, flat, arm.lower, arm.upper, arm.velocity_limits)
    qdot = Controller(singular)(joints(arm, rng), Pose(random_dq(rng)))
    assert np.isfinite(qdot).all()
    assert np.abs(qdot).max() <= 2.0 + 1e-12


@few
@given(seeds)
def test_the_bound_of_the_smallest_singular_value_is_a_bound(seed):
    rng = np.random.default_rng(seed)
    matrix = rng.normal(size=(6, 7)) * rng.uniform(0.01, 3, (6, 1))
    work, scratch = np.zeros((30, 16)), np.empty(16)
    work[:6, :7] = matrix
    gram(work, 0, 7, work, 6)
    assert cholesky(work, 6, 0.0, work, 12)
    bound, sigma = smallest_singular_bound(work, 12, scratch), np.linalg.svd(matrix)[1][5]
    assert sigma / np.sqrt(6) <= bound * (1 + 1e-6)
    assert bound <= sigma * (1 + 1e-6)


def test_the_way_round_changes_at_most_once_under_noise():
    rng = np.random.default_rng(0)
    for _ in range(50):
        sign, switches = 0.0, -1
        for _ in range(200):
            before, sign = sign, choose_sign((rng.normal(0, 1e-3), *[0.0] * 7), sign)
            switches += before != sign
        assert switches <= 1
    assert choose_sign((-0.2, *[0.0] * 7), 1.0) == -1.0
    assert choose_sign((-0.05, *[0.0] * 7), 1.0) == 1.0


def test_a_controller_forgets_its_way_round_on_reset():
    arm = panda()
    control, target = Controller(arm), arm.fk(READY + 0.1)
    first = control(READY, target)
    control(READY, Pose(-target.dq))
    control.reset()
    np.testing.assert_array_equal(control(READY, target), first)


@pytest.mark.parametrize(
    "change",
    [{"law": "printed"}, {"gain": 0.0}, {"gain": np.nan}, {"max_linear": -1.0}, {"null_gain": -0.1}, {"limit_gain": 0}],
)
def test_bad_settings_are_named(change):
    with pytest.raises(BadOption, match=next(iter(change))):
        ControllerSettings(**change)
