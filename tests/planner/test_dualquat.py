"""Group axioms, exponential and logarithm, interpolation: against algebra, and against other libraries."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
import pytransform3d.transformations as pt
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import ANGLES, assert_same_pose, dqs, gentle_dqs, random_dq

from onedemo.planner import dualquat as dq
from onedemo.planner.errors import BadShape, NotFinite, NotUnit
from onedemo.planner.pose import Pose

few = settings(max_examples=100, deadline=None)
taus = st.floats(0, 1)


def screw_matrix(twist):
    """4 x 4 matrix of a body twist (v, omega)."""
    v, w = twist[:3], twist[3:]
    out = np.zeros((4, 4))
    out[:3, :3] = [[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]]
    out[:3, 3] = v
    return out


@few
@given(dqs(), dqs())
def test_hamilton_operators_are_the_product(a, b):
    product = dq.mul(a, b)
    np.testing.assert_allclose(dq.hamilton_plus(a) @ b, product, atol=1e-14)
    np.testing.assert_allclose(dq.hamilton_minus(b) @ a, product, atol=1e-14)
    np.testing.assert_allclose(dq.hamilton_plus(a) @ b, dq.hamilton_minus(b) @ a, atol=1e-14)


@few
@given(dqs())
def test_the_conjugate_is_the_inverse(x):
    np.testing.assert_allclose(dq.mul(x, dq.conj(x)), dq.identity(), atol=1e-12)


def test_ten_thousand_projected_products_stay_on_the_manifold():
    rng = np.random.default_rng(0)
    factors = random_dq(rng, 10_000)
    factors[:, 4:] *= 0.01
    x = dq.identity()
    for factor in factors:
        x = dq.normalized(dq.mul(x, factor))
    assert abs(np.linalg.norm(x[:4]) - 1) < 1e-12
    assert abs(x[:4] @ x[4:]) < 1e-12


@few
@given(dqs(), dqs())
def test_conjugation_reverses_products(a, b):
    np.testing.assert_allclose(dq.conj(dq.mul(a, b)), dq.mul(dq.conj(b), dq.conj(a)), atol=1e-14)


@few
@given(dqs(), dqs())
def test_translation_of_a_product_composes(a, b):
    composed = dq.translation(a) + Pose(a).rotation @ dq.translation(b)
    np.testing.assert_allclose(dq.translation(dq.mul(a, b)), composed, atol=1e-13)


@pytest.mark.parametrize("angle", ANGLES)
@few
@given(x=st.data())
def test_exp_inverts_log_at_every_angle(angle, x):
    pose = x.draw(dqs(angles=st.just(angle)))
    assert_same_pose(dq.exp(dq.log(pose)), pose, 1e-12)


@few
@given(dqs(angles=st.floats(0, np.pi - 1e-5)), st.tuples(*[st.floats(-1, 1)] * 3))
def test_log_inverts_exp_below_a_half_turn(x, v):
    twist = dq.twist_from_dq(x)
    twist[:3] = v
    np.testing.assert_allclose(dq.twist_from_dq(dq.dq_from_twist(twist)), twist, atol=1e-9)


@few
@given(dqs(angles=st.floats(0, np.pi - 1e-3)))
def test_twice_the_logarithm_is_pinocchios_log6(x):
    np.testing.assert_allclose(dq.twist_from_dq(x), pin.log6(pin.SE3(Pose(x).matrix)).vector, atol=1e-10)


@few
@given(dqs(), taus, taus)
def test_powers_add_up(x, a, b):
    a, b = 0.5 * a, 0.5 * b
    assert_same_pose(dq.mul(dq.power(x, a), dq.power(x, b)), dq.power(x, a + b), 1e-12)


@few
@given(dqs(), dqs())
def test_interpolation_meets_both_ends(a, b):
    assert_same_pose(dq.sclerp(a, b, 0.0), a, 1e-14)
    assert_same_pose(dq.sclerp(a, b, 1.0), b, 1e-13)


@few
@given(gentle_dqs(), gentle_dqs(), st.floats(0, 0.9))
def test_interpolation_has_a_constant_body_twist(a, b, tau):
    first = dq.mul(dq.conj(dq.sclerp(a, b, 0.0)), dq.sclerp(a, b, 0.1))
    later = dq.mul(dq.conj(dq.sclerp(a, b, tau)), dq.sclerp(a, b, tau + 0.1))
    assert_same_pose(first, later, 1e-12)


@few
@given(dqs(), dqs(), taus)
def test_antipodal_inputs_give_the_same_path(a, b, tau):
    if not dq.is_half_turn(dq.mul(dq.conj(a), b)):
        assert_same_pose(dq.sclerp(a, b, tau), dq.sclerp(-a, b, tau), 1e-12)
        assert_same_pose(dq.sclerp(a, b, tau), dq.sclerp(a, -b, tau), 1e-12)


def test_a_half_turn_is_taken_the_same_way_whatever_the_sign():
    for axis in np.eye(3):
        x = np.concatenate([[0.0], axis, np.zeros(4)])
        np.testing.assert_array_equal(dq.twist_from_dq(x), dq.twist_from_dq(-x))
        assert dq.twist_from_dq(x)[3:] @ axis == pytest.approx(np.pi)
        assert dq.is_half_turn(x)


def test_the_long_way_is_taken_on_purpose_only():
    start, end = dq.identity(), Pose.from_yaw([0, 0, 0], 0.4).dq
    assert Pose(dq.sclerp(start, -end, 0.5)).yaw == pytest.approx(0.2)
    long_way = Pose(dq.sclerp(start, -end, 0.5, shortest=False)).yaw
    assert abs(long_way) == pytest.approx(np.pi - 0.2)


@few
@given(dqs(), dqs(), taus, dqs(), dqs())
def test_interpolation_moves_with_world_and_tool(a, b, tau, g, h):
    if abs(dq.mul(dq.conj(a), b)[0]) < 1e-6:
        return
    moved = dq.sclerp(dq.mul(g, dq.mul(a, h)), dq.mul(g, dq.mul(b, h)), tau)
    assert_same_pose(moved, dq.mul(g, dq.mul(dq.sclerp(a, b, tau), h)), 1e-11)


def test_the_decoupled_interpolation_does_not_move_with_the_tool():
    rng = np.random.default_rng(1)
    a, b, h = random_dq(rng), random_dq(rng), random_dq(rng)
    moved = dq.decoupled_lerp(dq.mul(a, h), dq.mul(b, h), 0.5)
    gap = np.linalg.norm(dq.translation(moved) - dq.translation(dq.mul(dq.decoupled_lerp(a, b, 0.5), h)))
    assert gap > 1e-2
    np.testing.assert_allclose(
        dq.translation(dq.decoupled_lerp(a, b, 0.25)), 0.75 * dq.translation(a) + 0.25 * dq.translation(b), atol=1e-13
    )


@few
@given(gentle_dqs(), gentle_dqs(), taus)
def test_interpolation_can_be_reversed(a, b, tau):
    if abs(dq.mul(dq.conj(a), b)[0]) > 1e-6:
        assert_same_pose(dq.sclerp(a, b, tau), dq.sclerp(b, a, 1 - tau), 1e-12)


@few
@given(dqs(angles=st.floats(1e-3, np.pi - 1e-2)), dqs(angles=st.floats(1e-3, np.pi - 1e-2)), taus)
def test_interpolation_agrees_with_matrix_exponentials(a, b, tau):
    start, end = Pose(a).matrix, Pose(b).matrix
    if abs(dq.mul(dq.conj(a), b)[0]) < 1e-2:
        return
    logarithm = scipy.linalg.logm(np.linalg.inv(start) @ end).real
    expected = start @ scipy.linalg.expm(tau * logarithm)
    np.testing.assert_allclose(Pose(dq.sclerp(a, b, tau)).matrix, expected, atol=1e-10)
    np.testing.assert_allclose(screw_matrix(dq.twist_from_dq(dq.mul(dq.conj(a), b))), logarithm, atol=1e-9)


@few
@given(gentle_dqs(), gentle_dqs(), taus)
def test_interpolation_agrees_with_an_independent_library(a, b, tau):
    if abs(dq.mul(dq.conj(a), b)[0]) > 1e-3:
        assert_same_pose(dq.sclerp(a, b, tau), pt.dual_quaternion_sclerp(a, b, tau), 1e-10)


@few
@given(dqs(angles=st.floats(1e-2, np.pi)), st.floats(-2, 2))
def test_a_screw_fixes_its_axis_and_slides_along_it(x, along):
    screw, pose = dq.screw_parameters(x), Pose(x)
    np.testing.assert_allclose(pose.rotation @ screw.axis, screw.axis, atol=1e-10)
    point = screw.point + along * screw.axis
    np.testing.assert_allclose(pose.rotation @ point + pose.position, point + screw.travel * screw.axis, atol=1e-10)
    assert abs(screw.axis @ screw.moment) < 1e-10
    assert 0 <= screw.angle <= np.pi + 1e-12


@few
@given(dqs())
def test_screw_parameters_round_trip(x):
    assert_same_pose(dq.dq_from_screw_parameters(dq.screw_parameters(x)), x, 1e-12)


def test_a_pure_translation_has_infinite_pitch_and_keeps_its_travel():
    screw = dq.screw_parameters(dq.from_position_quaternion([0.0, 0.3, -0.4], [1, 0, 0, 0]))
    assert (screw.angle, screw.travel, screw.pitch) == (0.0, pytest.approx(0.5), np.inf)
    np.testing.assert_allclose(screw.axis, [0, 0.6, -0.8])
    rest = dq.screw_parameters(dq.identity())
    assert (rest.angle, rest.travel) == (0.0, 0.0)


@few
@given(dqs(), dqs(), dqs())
def test_the_pose_error_is_blind_to_sign_and_world(c, x, h):
    error = dq.pose_error(c, x)
    assert dq.pose_error(c, -x) == pytest.approx(error, abs=1e-12)
    assert dq.pose_error(dq.mul(h, c), dq.mul(h, x)) == pytest.approx(error, abs=1e-12)
    assert dq.pose_error(x, -x) < 1e-12
    distance, angle = dq.gap(c, x)
    assert (error < 1e-9) == bool(np.hypot(distance, angle) < 3e-9) or abs(error - 1e-9) < 5e-9


def test_functions_broadcast_over_leading_axes():
    rng = np.random.default_rng(2)
    a, b, tau = random_dq(rng, 4, 1), random_dq(rng, 3), rng.uniform(size=(4, 3))
    path = dq.sclerp(a, b, tau)
    assert path.shape == (4, 3, 8)
    assert_same_pose(path[2, 1], dq.sclerp(a[2, 0], b[1], tau[2, 1]), 1e-15)
    assert dq.translation(path).shape == (4, 3, 3)
    assert dq.mul(a, b).shape == dq.power(path, tau).shape == (4, 3, 8)


def test_signs_are_made_continuous():
    rng = np.random.default_rng(3)
    smooth = dq.sclerp(random_dq(rng), random_dq(rng), np.linspace(0, 1, 20))
    flipped = smooth * rng.choice([-1.0, 1.0], (20, 1))
    out = dq.continuous(flipped)
    assert (np.sum(out[1:, :4] * out[:-1, :4], axis=1) > 0).all()
    assert_same_pose(out, smooth, 0.0)


@pytest.mark.parametrize(
    "call, error, message",
    [
        (lambda: dq.mul(np.zeros(7), dq.identity()), BadShape, r"a has shape \(7,\); expected \(\.\.\., 8\)"),
        (lambda: dq.checked_unit(np.full(8, np.nan)), NotFinite, r"not finite at index \(0,\)"),
        (lambda: dq.checked_unit([2.0, *[0.0] * 7]), NotUnit, "norm 2; expected 1"),
        (lambda: dq.translation(3.0), BadShape, "expected"),
        (lambda: dq.screw_parameters(np.zeros((2, 8)) + dq.identity()), BadShape, r"expected \(8,\)"),
    ],
)
def test_bad_input_is_named(call, error, message):
    with pytest.raises(error, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)
