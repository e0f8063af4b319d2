"""Group axioms, exponential and logarithm, interpolation: against algebra, and against other libraries."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
import pytransform3d.transformations as pt
import scipy.linalg
from helpers.strategies import ANGLES, assert_same_pose, directions, dqs, for_all, positions, random_dq
from hypothesis import assume
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from onedemo.planner.errors import BadShape, NotFinite, NotUnit
from onedemo.planner.geometry import dualquat as dq
from onedemo.planner.geometry.pose import Pose

taus = st.floats(0, 1)
BELOW_HALF_TURN = np.pi - 1e-6
up_to_half_turn = st.one_of(
    st.sampled_from([*ANGLES[:-2], np.pi - 1e-4, np.pi - 1e-5, BELOW_HALF_TURN]), st.floats(0, BELOW_HALF_TURN)
)


def matrix_log_tolerance(x):
    """1e-10 up to pi - 1e-4, then what logarithms of *matrices* can give.

    Their condition is 1 / (pi - angle): rounding of 1e-15 in the entries of a rotation matrix is 1e-9 in its
    logarithm at pi - 1e-6, in Pinocchio and in SciPy alike. That of a quaternion has no such loss, which the
    comparisons of exponentials and with closed forms show, at 1e-10 on the whole range.
    """
    return max(1e-10, 1e-14 / (np.pi - np.linalg.norm(dq.twist_from_dq(x)[3:])))


def between(a, b):
    return dq.mul(dq.conj(a), b)


@for_all(dqs(), dqs())
def test_hamilton_operators_are_the_product(a, b):
    product = dq.mul(a, b)
    np.testing.assert_allclose(dq.hamilton_plus(a) @ b, product, rtol=0, atol=1e-14)
    np.testing.assert_allclose(dq.hamilton_minus(b) @ a, product, rtol=0, atol=1e-14)
    np.testing.assert_allclose(pt.concatenate_dual_quaternions(a, b), product, rtol=0, atol=1e-12)


def test_ten_thousand_projected_products_stay_on_the_manifold():
    factors = random_dq(np.random.default_rng(0), 10_000)
    x = dq.identity()
    for factor in factors:
        x = dq.normalized(dq.mul(x, factor))
        assert abs(np.linalg.norm(x[:4]) - 1) < 1e-12 and abs(x[:4] @ x[4:]) < 1e-12
    np.testing.assert_array_equal(dq.checked_unit(factors), factors)
    np.testing.assert_allclose(dq.checked_unit((1 - 9e-7) * factors), factors, rtol=0, atol=1e-14)


@for_all(dqs(), st.floats(0.5, 2), st.floats(-1, 1))
def test_projection_removes_scale_and_slant_and_keeps_pose_and_sign(x, scale, slant):
    off = scale * x
    off[4:] += slant * x[:4]
    np.testing.assert_allclose(dq.normalized(off), x, rtol=0, atol=1e-14)


@for_all(dqs(), dqs())
def test_the_conjugate_is_the_inverse_and_reverses_products(a, b):
    np.testing.assert_allclose(dq.mul(a, dq.conj(a)), dq.identity(), rtol=0, atol=1e-12)
    np.testing.assert_allclose(dq.conj(dq.mul(a, b)), dq.mul(dq.conj(b), dq.conj(a)), rtol=0, atol=1e-14)


@for_all(dqs(), dqs())
def test_translation_of_a_product_composes(a, b):
    composed = dq.translation(a) + Pose(a).rotation @ dq.translation(b)
    np.testing.assert_allclose(dq.translation(dq.mul(a, b)), composed, rtol=0, atol=1e-13)
    np.testing.assert_array_equal(dq.translation(-a), dq.translation(a))


@pytest.mark.parametrize("angle", ANGLES)
@for_all(data=st.data())
def test_logarithm_and_screw_parameters_can_be_undone_at_every_angle(angle, data):
    x = data.draw(dqs(angles=st.just(angle)))
    assert_same_pose(dq.exp(dq.log(x)), x, 1e-12)
    assert_same_pose(dq.dq_from_screw_parameters(dq.screw_parameters(x)), x, 1e-12)
    assert np.linalg.norm(dq.twist_from_dq(x)[3:]) == pytest.approx(angle, rel=1e-12, abs=1e-15)


@for_all(dqs(angles=up_to_half_turn), st.tuples(*[st.floats(-1, 1)] * 3))
def test_log_inverts_exp_below_a_half_turn(x, v):
    twist = np.concatenate([v, dq.twist_from_dq(x)[3:]])
    np.testing.assert_allclose(dq.twist_from_dq(dq.dq_from_twist(twist)), twist, rtol=0, atol=1e-9)


@for_all(dqs(angles=up_to_half_turn))
def test_twice_the_logarithm_is_pinocchios_log6(x):
    motion = pin.SE3(Pose(x).matrix)
    oracle, twist, log = pin.log6(motion).vector, dq.twist_from_dq(x), dq.log(x)
    np.testing.assert_allclose(twist, oracle, rtol=0, atol=matrix_log_tolerance(x))
    # to the bit, but where halves are too small to have all their digits
    np.testing.assert_allclose(2 * np.concatenate([log[5:], log[1:4]]), twist, rtol=0, atol=np.finfo(float).tiny)
    assert log[0] == log[4] == 0.0
    np.testing.assert_allclose(pin.exp6(pin.Motion(twist)).homogeneous, motion.homogeneous, rtol=0, atol=1e-10)


@for_all(directions(), st.floats(1e-2, BELOW_HALF_TURN), positions())
def test_the_logarithm_is_its_closed_form_up_to_the_half_turn(axis, angle, position):
    x = dq.from_position_quaternion(position, np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * axis]))
    omega = angle * axis
    c = (1 - 0.5 * angle / np.tan(0.5 * angle)) / angle**2
    v = position - 0.5 * np.cross(omega, position) + c * np.cross(omega, np.cross(omega, position))
    np.testing.assert_allclose(dq.twist_from_dq(x), np.concatenate([v, omega]), rtol=0, atol=1e-10)


@for_all(dqs(), taus, taus)
def test_powers_add_up(x, a, b):
    a, b = a * b, a - a * b
    assert_same_pose(dq.mul(dq.power(x, a), dq.power(x, b)), dq.power(x, a + b), 1e-12)
    assert_same_pose(dq.power(x, 1.0), x, 1e-12)


@pytest.mark.parametrize("shortest", [True, False])
@for_all(a=dqs(), b=dqs())
def test_interpolation_meets_both_ends(shortest, a, b):
    assume(shortest or between(a, b)[0] > -1 + 1e-6)
    assert_same_pose(dq.sclerp(a, b, 0.0, shortest=shortest), a, 1e-14)
    assert_same_pose(dq.sclerp(a, b, 1.0, shortest=shortest), b, 1e-14 if shortest else 1e-9)


@for_all(dqs(), dqs(), st.floats(0, 0.9))
def test_interpolation_has_a_constant_body_twist(a, b, tau):
    first = between(dq.sclerp(a, b, 0.0), dq.sclerp(a, b, 0.1))
    assert_same_pose(between(dq.sclerp(a, b, tau), dq.sclerp(a, b, tau + 0.1)), first, 1e-12)


@for_all(dqs(), dqs(), taus)
def test_antipodal_inputs_give_the_same_path(a, b, tau):
    for x, y in [(-a, b), (a, -b), (-a, -b)]:
        assert_same_pose(dq.sclerp(x, y, tau), dq.sclerp(a, b, tau), 1e-12)


@pytest.mark.parametrize("scalar", [0.0, 1e-13, -1e-13])
@pytest.mark.parametrize("axis", [(0, -1, 0), (0, 0, 1), (-0.6, 0.8, 0), (1e-14, -0.6, 0.8)])
def test_a_half_turn_is_taken_about_the_axis_whose_first_component_is_positive(axis, scalar):
    x = np.concatenate([[scalar], axis, np.zeros(4)])
    turn = dq.twist_from_dq(x)[3:]
    np.testing.assert_array_equal(turn, dq.twist_from_dq(-x)[3:])
    sign = np.sign(axis[np.argmax(np.abs(axis) > np.full(3, 1e-12))])
    np.testing.assert_allclose(turn, sign * np.pi * np.array(axis), atol=1e-12)
    assert dq.is_half_turn(x)
    assert not dq.is_half_turn(dq.dq_from_twist([0, 0, 0, *(0.999 * turn)]))


def test_the_long_way_is_taken_on_purpose_only():
    start, end = dq.identity(), Pose.from_yaw([0, 0, 0], 0.4).dq
    assert Pose(dq.sclerp(start, -end, 0.5)).yaw == pytest.approx(0.2)
    assert Pose(dq.sclerp(start, -end, 0.5, shortest=False)).yaw == pytest.approx(0.2 - np.pi)
    assert Pose(dq.sclerp(start, end, 0.5, shortest=False)).yaw == pytest.approx(0.2)


@for_all(dqs(), dqs(), taus, dqs(), dqs())
def test_interpolation_moves_with_world_and_tool_and_can_be_reversed(a, b, tau, g, h):
    assume(abs(between(a, b)[0]) > 1e-6)
    assert_same_pose(dq.sclerp(b, a, 1 - tau), dq.sclerp(a, b, tau), 1e-12)
    moved = dq.sclerp(dq.mul(g, dq.mul(a, h)), dq.mul(g, dq.mul(b, h)), tau)
    assert_same_pose(moved, dq.mul(g, dq.mul(dq.sclerp(a, b, tau), h)), 1e-11)


def test_the_decoupled_interpolation_goes_straight_but_does_not_move_with_the_tool():
    a, b, h = random_dq(np.random.default_rng(1), 3)
    tau = np.linspace(0, 1, 5)
    path = dq.decoupled_lerp(a, b, tau)
    line = (1 - tau[:, None]) * dq.translation(a) + tau[:, None] * dq.translation(b)
    np.testing.assert_allclose(dq.translation(path), line, rtol=0, atol=1e-13)
    assert_same_pose(path[:, :4], dq.sclerp(a, b, tau)[:, :4], 1e-13)
    retooled = dq.decoupled_lerp(dq.mul(a, h), dq.mul(b, h), 0.5)
    assert dq.pose_error(retooled, dq.mul(path[2], h)) > 1e-2


@for_all(dqs(), dqs(angles=up_to_half_turn), taus)
def test_interpolation_agrees_with_matrix_exponentials(a, motion, tau):
    twist = dq.twist_from_dq(motion)
    generator = np.zeros((4, 4))
    generator[:3, :3], generator[:3, 3] = np.cross(np.eye(3), twist[3:]), twist[:3]
    np.testing.assert_allclose(scipy.linalg.expm(generator), Pose(motion).matrix, rtol=0, atol=1e-10)
    expected = Pose(a).matrix @ scipy.linalg.expm(tau * generator)
    np.testing.assert_allclose(Pose(dq.sclerp(a, dq.mul(a, motion), tau)).matrix, expected, rtol=0, atol=1e-10)


@for_all(dqs(angles=st.one_of(st.floats(1e-3, BELOW_HALF_TURN), st.sampled_from([np.pi - 1e-4, BELOW_HALF_TURN]))))
def test_the_logarithm_agrees_with_that_of_matrices(motion):
    logarithm = scipy.linalg.logm(Pose(motion).matrix).real
    twist = np.concatenate([logarithm[:3, 3], logarithm[[2, 0, 1], [1, 2, 0]]])
    np.testing.assert_allclose(dq.twist_from_dq(motion), twist, rtol=0, atol=matrix_log_tolerance(motion))


@for_all(dqs(), dqs(angles=st.one_of(st.floats(1e-2, BELOW_HALF_TURN), st.just(BELOW_HALF_TURN))), taus)
def test_interpolation_and_screw_agree_with_an_independent_library(a, motion, tau):
    b = dq.mul(a, motion)
    assert_same_pose(dq.sclerp(a, b, tau), pt.dual_quaternion_sclerp(a, b, tau), 1e-10)
    screw = dq.screw_parameters(motion)
    point, axis, pitch, angle = pt.screw_parameters_from_dual_quaternion(dq.power(motion, 1.0))
    np.testing.assert_allclose([*screw.axis, screw.angle, screw.pitch], [*axis, angle, pitch], rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(np.cross(screw.point - point, axis), 0, atol=1e-10 * (1 + np.linalg.norm(point)))


@for_all(dqs(angles=st.one_of(st.floats(1e-2, np.pi), st.just(np.pi))), st.floats(-2, 2))
def test_a_screw_fixes_its_axis_and_slides_along_it(x, along):
    screw, pose = dq.screw_parameters(x), Pose(x)
    np.testing.assert_allclose(pose.rotation @ screw.axis, screw.axis, rtol=0, atol=1e-10)
    point = screw.point + along * screw.axis
    slid = point + screw.travel * screw.axis
    np.testing.assert_allclose(pose.rotation @ point + pose.position, slid, rtol=0, atol=1e-10)
    assert abs(screw.point @ screw.axis) < 1e-10 and 0 <= screw.angle <= np.pi + 1e-12


def test_a_pure_translation_has_infinite_pitch_and_keeps_its_travel():
    screw = dq.screw_parameters(dq.from_position_quaternion([0.0, 0.3, -0.4], [1, 0, 0, 0]))
    assert (screw.angle, screw.travel, screw.pitch) == (0.0, pytest.approx(0.5), np.inf)
    np.testing.assert_allclose([*screw.axis, *screw.moment], [0, 0.6, -0.8, 0, 0, 0])
    rest = dq.screw_parameters(dq.identity())
    assert (rest.angle, rest.travel, *rest.axis) == (0.0,) * 5


@for_all(dqs(), dqs(), dqs())
def test_the_pose_error_is_zero_for_equal_poses_only_and_blind_to_sign_and_world(c, x, h):
    error, (distance, angle) = dq.pose_error(c, x), dq.pose_distance(c, x)
    assert error == pytest.approx(np.hypot(2 * np.sin(angle / 4), distance / 2), abs=1e-12)
    assert distance == pytest.approx(np.linalg.norm(dq.translation(c) - dq.translation(x)), abs=1e-12)
    turn = Rotation.from_quat(c[[1, 2, 3, 0]]).inv() * Rotation.from_quat(x[[1, 2, 3, 0]])
    assert angle == pytest.approx(turn.magnitude(), abs=1e-12)
    for d, y in [(c, -x), (-c, x), (x, c), (dq.mul(h, c), dq.mul(h, x))]:
        assert dq.pose_error(d, y) == pytest.approx(error, abs=1e-12)
    assert dq.pose_error(x, -x) < 1e-12


def test_functions_broadcast_over_leading_axes():
    rng = np.random.default_rng(2)
    a, b, tau = random_dq(rng, 4, 1), random_dq(rng, 3), rng.uniform(size=(4, 3))
    path = dq.sclerp(a, b, tau)
    assert path.shape == dq.mul(a, b).shape == dq.power(path, tau).shape == dq.exp(dq.log(path)).shape == (4, 3, 8)
    assert dq.decoupled_lerp(a, b, tau).shape == dq.normalized(path).shape == dq.conj(path).shape == (4, 3, 8)
    assert dq.translation(path).shape == (4, 3, 3)
    assert dq.pose_error(a, b).shape == dq.pose_distance(a, b)[0].shape == dq.is_half_turn(path).shape == (4, 3)
    for i, j in np.ndindex(4, 3):
        np.testing.assert_array_equal(path[i, j], dq.sclerp(a[i, 0], b[j], tau[i, j]))
        np.testing.assert_array_equal(dq.mul(a, b)[i, j], dq.mul(a[i, 0], b[j]))
    assert dq.mul(np.empty((0, 8)), a[0]).shape == (0, 8)


@pytest.mark.parametrize("function", [dq.normalized, dq.conj, dq.continuous, dq.log, dq.translation])
def test_results_are_new_arrays(function):
    x = random_dq(np.random.default_rng(4), 3)
    kept = x.copy()
    assert not np.shares_memory(function(x), x)
    np.testing.assert_array_equal(x, kept)


def test_signs_are_made_continuous():
    rng = np.random.default_rng(3)
    smooth = dq.sclerp(*random_dq(rng, 2), np.linspace(0, 1, 20))
    out = dq.continuous(smooth * rng.choice([-1.0, 1.0], (20, 1)))
    assert (np.sum(out[1:, :4] * out[:-1, :4], axis=1) > 0).all()
    assert_same_pose(out, smooth, 0.0)


@pytest.mark.parametrize(
    "call, error, message",
    [
        (lambda: dq.mul(np.zeros(7), dq.identity()), BadShape, r"a has shape \(7,\); expected \(\.\.\., 8\)"),
        (lambda: dq.sclerp(dq.identity(), np.zeros(4), 0.5), BadShape, r"end has shape \(4,\)"),
        (lambda: dq.dq_from_twist(np.zeros(8)), BadShape, r"twist has shape \(8,\); expected \(\.\.\., 6\)"),
        (lambda: dq.screw_parameters(np.zeros((2, 8)) + dq.identity()), BadShape, r"expected \(8,\)"),
        (lambda: dq.checked_unit(np.diag([1.0, np.nan]) @ np.ones((2, 8))), NotFinite, r"index \(1, 0\)"),
        (lambda: dq.checked_unit([1.0, *[0.0] * 6, np.inf], "goal"), NotFinite, r"goal .* at index \(7,\)"),
        (lambda: dq.checked_unit([2.0, *[0.0] * 7]), NotUnit, "norm 2; expected 1"),
        (lambda: dq.checked_unit([1 + 2e-6, *[0.0] * 7]), NotUnit, r"norm 1\.000002"),
    ],
)
def test_bad_input_is_named_in_one_line(call, error, message):
    with pytest.raises(error, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)
