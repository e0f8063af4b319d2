from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import assert_same_pose, dqs, random_dq, random_path

from onedemo.planner import dualquat as dq
from onedemo.planner.errors import BadShape, NotFinite, NotUnit
from onedemo.planner.pose import Pose, PosePath

few = settings(max_examples=100, deadline=None)


@few
@given(dqs())
def test_poses_survive_matrices_vectors_and_another_library(x):
    pose = Pose(x)
    assert_same_pose(Pose.from_matrix(pose.matrix).dq, x, 1e-12)
    assert_same_pose(Pose.from_vector(pose.vector).dq, x, 1e-12)
    q = pose.quaternion
    placement = pin.SE3(pin.Quaternion(q[0], q[1], q[2], q[3]), pose.position)
    np.testing.assert_allclose(placement.homogeneous, pose.matrix, atol=1e-12)


@few
@given(dqs(), dqs())
def test_composition_is_the_matrix_product(a, b):
    np.testing.assert_allclose((Pose(a) @ Pose(b)).matrix, Pose(a).matrix @ Pose(b).matrix, atol=1e-12)
    np.testing.assert_allclose((Pose(a) @ Pose(a).inverse()).matrix, np.eye(4), atol=1e-12)


@given(st.floats(-3.1, 3.1), st.floats(0, 1.5))
@few
def test_yaw_and_tilt_take_an_orientation_apart(yaw, tilt):
    pose = Pose.from_yaw([0, 0, 0], yaw) @ Pose.from_position_quaternion(
        [0, 0, 0], [np.cos(tilt / 2), np.sin(tilt / 2), 0, 0]
    )
    assert pose.tilt == pytest.approx(tilt, abs=1e-7)
    assert pose.yaw == pytest.approx(yaw, abs=1e-9)
    assert Pose(-pose.dq).yaw == pytest.approx(yaw, abs=1e-9)


def test_poses_cannot_be_changed_and_do_not_share_memory():
    source = dq.identity()
    pose, path = Pose(source), PosePath(np.array([source, source]))
    source[0] = -1.0
    assert pose.dq[0] == 1.0
    with pytest.raises(ValueError):
        pose.dq[0] = 2.0
    with pytest.raises(ValueError):
        path.dqs[0, 0] = 2.0
    with pytest.raises(AttributeError):
        pose.dq = source


def test_paths_are_cut_turned_and_joined():
    path = random_path(np.random.default_rng(0), 12)
    assert len(path[2:5]) == 3
    assert_same_pose(path[2:5].dqs, path.dqs[2:5], 1e-15)
    assert_same_pose(path.reversed().dqs, path.dqs[::-1], 1e-15)
    assert len(path[:5].joined(path[4:])) == 12, "a shared pose is not repeated"
    assert len(path[:5].joined(path[5:])) == 12
    assert [pose.dq.shape for pose in path] == [(8,)] * 12


def test_path_signs_are_continuous_whatever_comes_in():
    rng = np.random.default_rng(1)
    path = random_path(rng, 30)
    flipped = PosePath(path.dqs * rng.choice([-1.0, 1.0], (30, 1)))
    assert (np.sum(flipped.dqs[1:, :4] * flipped.dqs[:-1, :4], axis=1) >= 0).all()
    assert_same_pose(flipped.dqs, path.dqs, 0.0)


@few
@given(st.integers(0, 1000))
def test_length_does_not_depend_on_the_world(seed):
    rng = np.random.default_rng(seed)
    path, world, tool = random_path(rng, 10), Pose(random_dq(rng)), Pose(random_dq(rng))
    np.testing.assert_allclose(path.moved(world).lengths(), path.lengths(), atol=1e-12)
    assert_same_pose(path.with_tool(tool)[3].dq, (path[3] @ tool).dq, 1e-13)
    assert_same_pose(path.moved(world)[3].dq, (world @ path[3]).dq, 1e-13)


def test_length_weighs_turning_by_a_lever():
    turn = PosePath(np.array([Pose.identity().dq, Pose.from_yaw([0, 0, 0], 0.5).dq]))
    assert turn.lengths()[-1] == pytest.approx(0.1)
    assert turn.lengths(meters_per_radian=1.0)[-1] == pytest.approx(0.5)
    slide = PosePath.from_vectors([[0, 0, 0, 1, 0, 0, 0], [0.3, 0.4, 0, -1, 0, 0, 0]])
    assert slide.lengths()[-1] == pytest.approx(0.5)


@pytest.mark.parametrize(
    "call, error, message",
    [
        (lambda: Pose(np.zeros(8)), NotUnit, "norm 0"),
        (lambda: Pose(np.zeros((2, 8)) + dq.identity()), BadShape, r"expected \(8,\)"),
        (lambda: Pose.from_position_quaternion([0, 0, np.inf]), NotFinite, "not finite"),
        (lambda: Pose.from_position_quaternion([0, 0, 0], [1, 1, 0, 0]), NotUnit, "quaternion has norm 1.41"),
        (lambda: Pose.from_vector(np.zeros(6)), BadShape, r"expected \(7,\)"),
        (lambda: Pose.from_matrix(np.eye(3)), BadShape, r"expected \(4, 4\)"),
        (lambda: PosePath(np.empty((0, 8))), BadShape, "n >= 1"),
        (lambda: PosePath.from_vectors(np.zeros((2, 6))), BadShape, r"expected \(n, 7\)"),
    ],
)
def test_bad_input_is_named(call, error, message):
    with pytest.raises(error, match=message):
        call()
