"""Poses against matrices and another library; paths of poses are cut, joined, carried and measured."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from helpers.strategies import assert_same_pose, dqs, for_all, random_dq, random_path
from hypothesis import strategies as st

from onedemo.planner.errors import BadShape, NotFinite, NotUnit
from onedemo.planner.geometry import dualquat as dq
from onedemo.planner.geometry.pose import Pose, PosePath

IDENTITY = np.eye(8)[0]


@for_all(dqs())
def test_poses_survive_matrices_vectors_and_another_library(x):
    pose = Pose(x)
    assert_same_pose(Pose.from_matrix(pose.matrix).dq, x, 1e-12)
    assert_same_pose(Pose.from_vector(pose.vector).dq, x, 1e-12)
    assert_same_pose(Pose.from_position_quaternion(pose.position, pose.quaternion).dq, x, 1e-12)
    w, i, j, k = pose.quaternion
    assert w >= 0
    placement = pin.SE3(pin.Quaternion(w, i, j, k), pose.position)
    np.testing.assert_allclose(placement.homogeneous, pose.matrix, rtol=0, atol=1e-12)
    i, j, k, w = pin.Quaternion(pin.SE3(pose.matrix).rotation).coeffs()
    assert_same_pose(dq.from_position_quaternion(placement.translation, [w, i, j, k]), x, 1e-12)


@for_all(dqs(), dqs())
def test_composition_is_the_matrix_product(world_from_tcp, tcp_from_cup):
    a, b = Pose(world_from_tcp), Pose(tcp_from_cup)
    world_from_cup = a @ b
    np.testing.assert_allclose(world_from_cup.matrix, a.matrix @ b.matrix, rtol=0, atol=1e-12)
    np.testing.assert_allclose(a.inverse().matrix @ a.matrix, np.eye(4), rtol=0, atol=1e-12)
    assert_same_pose((world_from_cup.inverse() @ a).dq, b.inverse().dq, 1e-12)
    distance, angle = a.distance_to(world_from_cup)
    assert distance == pytest.approx(np.linalg.norm(b.position), abs=1e-12)
    assert 2 * np.cos(angle) + 1 == pytest.approx(np.trace(b.rotation), abs=1e-12)


@for_all(st.floats(-3.1, 3.1), st.one_of(st.just(1e-9), st.floats(0, 3.1)), st.floats(-3.1, 3.1))
def test_yaw_and_tilt_take_an_orientation_apart(yaw, tilt, about):
    lean = [np.cos(tilt / 2), np.sin(tilt / 2) * np.cos(about), np.sin(tilt / 2) * np.sin(about), 0]
    pose = Pose.from_yaw([0, 0, 0], yaw) @ Pose.from_position_quaternion([1, 2, 3], lean)
    for same in (pose, Pose(-pose.dq)):
        assert same.tilt == pytest.approx(tilt, abs=1e-12)
        assert same.yaw == pytest.approx(yaw, abs=1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_half_a_turn_about_the_vertical_is_plus_pi_whatever_the_sign(sign):
    assert Pose(sign * Pose.from_yaw([0, 0, 0], np.pi).dq).yaw == np.pi


def test_tilt_keeps_its_digits_upside_down():
    tilt = np.pi - 1e-7
    pose = Pose.from_position_quaternion([0, 0, 0], [np.cos(tilt / 2), np.sin(tilt / 2), 0, 0])
    assert pose.tilt == pytest.approx(tilt, abs=1e-12)


def test_poses_cannot_be_changed_and_do_not_share_memory():
    single, several = IDENTITY.copy(), np.array([IDENTITY, IDENTITY])
    pose, path = Pose(single), PosePath(several)
    single[0] = several[1, 0] = -7.0
    assert pose.dq[0] == path.dqs[1, 0] == 1.0
    for array in (pose.dq, path.dqs, path[1].dq, path[:1].dqs, path.reversed().dqs, pose.inverse().dq):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 2.0
    with pytest.raises(AttributeError):
        pose.dq = single
    with pytest.raises(AttributeError):
        path.dqs = several


@for_all(dqs())
def test_checking_a_pose_twice_changes_no_bit(x):
    pose = Pose(x)
    np.testing.assert_array_equal(Pose(pose.dq).dq, pose.dq)
    np.testing.assert_array_equal(PosePath(pose.dq[None])[0].dq, pose.dq)


@pytest.mark.parametrize("part", [slice(2, 5), slice(None, None, 3), slice(-4, None), slice(8, 2, -1), slice(7, 99)])
def test_paths_are_cut_like_sequences(part):
    path = random_path(np.random.default_rng(0), 12)
    assert isinstance(path[part], PosePath)
    assert_same_pose(path[part].dqs, path.dqs[part], 0.0)
    assert_same_pose(np.array([pose.dq for pose in path][part]), path.dqs[part], 0.0)
    assert_same_pose(path[-1].dq, path.dqs[11], 0.0)
    assert_same_pose(path.reversed()[part].dqs, path.dqs[::-1][part], 0.0)
    with pytest.raises(IndexError):
        path[12]


def test_a_pose_shared_by_two_paths_is_not_repeated_when_they_are_joined():
    path = random_path(np.random.default_rng(0), 12)
    for second in (path[4:], path[5:]):
        joined = path[:5].joined(second)
        assert_same_pose(joined.dqs, path.dqs, 0.0)
    assert len(path.joined(path)) == 24


def test_joining_the_last_pose_alone_repeats_nothing():
    path = random_path(np.random.default_rng(0), 3)
    assert len(path.joined(path[-1:])) == 3


def test_path_signs_are_continuous_whatever_comes_in():
    rng = np.random.default_rng(1)
    path = random_path(rng, 30)
    flipped = PosePath(path.dqs * rng.choice([-1.0, 1.0], (30, 1)))
    assert (np.sum(flipped.dqs[1:, :4] * flipped.dqs[:-1, :4], axis=1) >= 0).all()
    assert_same_pose(flipped.dqs, path.dqs, 0.0)
    assert_same_pose(PosePath.from_vectors(flipped.vectors).dqs, path.dqs, 1e-14)
    np.testing.assert_array_equal(flipped.vectors, np.hstack([flipped.positions, flipped.quaternions]))


@for_all(st.integers(0, 1000))
def test_a_path_is_carried_pose_by_pose_and_its_length_does_not_depend_on_the_world(seed):
    rng = np.random.default_rng(seed)
    path, world, tool = random_path(rng, 10), Pose(random_dq(rng)), Pose(random_dq(rng))
    np.testing.assert_allclose(path.moved(world).lengths(), path.lengths(), rtol=0, atol=1e-12)
    for k, pose in enumerate(path):
        assert_same_pose(path.moved(world)[k].dq, (world @ pose).dq, 1e-13)
        assert_same_pose(path.with_tool(tool)[k].dq, (pose @ tool).dq, 1e-13)


def test_length_adds_steps_and_weighs_turning_by_a_lever():
    turn = PosePath(np.array([IDENTITY, Pose.from_yaw([0, 0, 0], 0.5).dq]))
    np.testing.assert_allclose(turn.lengths(), [0, 0.1])
    np.testing.assert_allclose(turn.lengths(meters_per_radian=1.0), [0, 0.5])
    slide = [[0, 0, 0, 1, 0, 0, 0], [0.3, 0.4, 0, -1, 0, 0, 0], [0.3, 0.4, 1, 1, 0, 0, 0]]
    np.testing.assert_allclose(PosePath.from_vectors(slide).lengths(), [0, 0.5, 1.5])
    both = PosePath(np.array([IDENTITY, Pose.from_yaw([0.3, 0, 0], 2.0).dq]))
    np.testing.assert_allclose(both.lengths(), [0, 0.5])
    np.testing.assert_array_equal(turn[:1].lengths(), [0])


def test_poses_and_paths_print_as_rounded_vectors():
    path = PosePath(np.array([-IDENTITY, Pose.from_yaw([1 / 3, 0, 0], 0).dq]))
    assert repr(path[0]).replace("-0", "0") == "Pose([0 0 0 1 0 0 0])"
    assert repr(path).startswith("PosePath(2 poses, Pose([") and "0.3333" in repr(path)


BAD_ROW = [[0, 0, 0, 1, 0, 0, 0], [0, np.nan, 0, 1, 0, 0, 0]]


@pytest.mark.parametrize(
    "call, error, message",
    [
        (lambda: Pose(np.zeros(8)), NotUnit, "pose has norm 0; expected 1"),
        (lambda: Pose(np.zeros((2, 8)) + IDENTITY), BadShape, r"pose has shape \(2, 8\); expected \(8,\)"),
        (lambda: Pose.from_position_quaternion([0, 0, np.inf]), NotFinite, "pose .* not finite"),
        (lambda: Pose.from_position_quaternion([0, 0, 0], [1, 1, 0, 0]), NotUnit, "quaternion has norm 1.41"),
        (lambda: Pose.from_position_quaternion([0, 0], [1, 0, 0, 0]), BadShape, r"position has shape \(2,\)"),
        (lambda: Pose.from_vector(np.zeros(6)), BadShape, r"pose vector has shape \(6,\); expected \(7,\)"),
        (lambda: Pose.from_vector([0, 0, 0, np.nan, 0, 0, 0]), NotFinite, "not finite"),
        (lambda: Pose.from_matrix(np.eye(3)), BadShape, r"matrix has shape \(3, 3\); expected \(4, 4\)"),
        (lambda: PosePath(np.empty((0, 8))), BadShape, r"path has shape \(0, 8\); .* n >= 1"),
        (lambda: PosePath(IDENTITY), BadShape, r"path has shape \(8,\)"),
        (lambda: PosePath(np.array([IDENTITY, 2 * IDENTITY])), NotUnit, "path has norm 2"),
        (lambda: PosePath.from_vectors(np.zeros((2, 6))), BadShape, r"pose vectors .* expected \(n, 7\)"),
        (lambda: PosePath.from_vectors(BAD_ROW), NotFinite, r"path .* index \(1, "),
        (lambda: Pose([1, 0, 0, 0, 5, 0, 0, 0]), NotUnit, "pose"),
        (lambda: Pose.from_matrix(np.diag([2.0, 2, 2, 1])), NotUnit, "matrix"),
        (lambda: Pose.from_matrix(np.full((4, 4), np.nan)), NotFinite, "matrix"),
    ],
)
def test_bad_input_is_named_in_one_line(call, error, message):
    with pytest.raises(error, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)
