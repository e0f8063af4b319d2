"""Segmentation of a path: rests, events, resampling, trimming."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.arms import table_panda
from helpers.strategies import assert_same_pose, random_path

from onedemo.configs.shipped_files import shipped_demonstration
from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.imitation.demonstration_files import read_demonstration
from onedemo.planner.imitation.segmentation import dwells, gripper_events, resampled, trimmed
from onedemo.planner.imitation.tsia import screw_path


def test_the_recorded_joints_give_the_recorded_path():
    demo, arm = read_demonstration(shipped_demonstration("stack")), table_panda()[0]
    for k in range(0, len(demo.path), 25):
        distance, angle = arm.fk(demo.joint_positions[k]).distance_to(demo.path[k])
        assert distance < 1e-9
        assert angle < 1e-9


def test_the_recorded_hand_is_at_the_cube_when_it_closes():
    demo = read_demonstration(shipped_demonstration("stack"))
    approach = demo.segment("approach")
    offset = approach.reference_pose.position - demo.path[approach.stop].position
    assert np.linalg.norm(offset) < 0.02


def test_gripper_events_are_the_last_samples_before_a_change():
    np.testing.assert_array_equal(gripper_events(np.array([-1, -1, 0.5, 1, 1, -1])), [1, 4])


def test_a_rest_is_found_and_a_short_stop_is_not():
    move = screw_path(Pose.identity(), Pose.from_yaw([0.5, 0, 0], 0), 0.01).dqs
    path = PosePath(np.concatenate([move, np.repeat(move[-1:], 30, axis=0), move[::-1]]))
    time = np.arange(len(path)) / 50.0
    assert dwells(time, path) == [(len(move) - 1, len(move) + 30)]
    assert dwells(0.1 * time, path) == []


def test_a_hand_that_never_moves_rests_all_the_time():
    """Off the origin the distance of a pose to itself is rounding, not zero."""
    pose = Pose.from_position_quaternion([0.43, -0.21, 0.87], np.array([0.3, -0.5, 0.7, 0.2]) / np.sqrt(0.87))
    still = PosePath(np.repeat(pose.dq[None], 50, axis=0))
    assert 0 < still.lengths()[-1] < 1e-12
    assert dwells(np.arange(50) / 50.0, still) == [(0, 49)]


def test_resampling_keeps_ends_and_makes_equal_steps():
    rng = np.random.default_rng(0)
    path = random_path(rng, 20)
    paused = PosePath(np.repeat(path.dqs, rng.integers(1, 5, 20), axis=0))
    for source in (path, paused):
        out = resampled(source, 0.01)
        assert_same_pose(out.dqs[[0, -1]], path.dqs[[0, -1]], 1e-15)
        steps = np.diff(out.lengths())
        assert steps.max() <= 0.0101, "a step round a corner of the path is measured along the path"
        assert np.median(steps) == pytest.approx(steps.max(), rel=3e-3)
    assert_same_pose(resampled(path, 0.01).dqs, resampled(paused, 0.01).dqs, 1e-9)


def test_trimming_cuts_the_fumbling_at_the_end():
    there = screw_path(Pose.identity(), Pose.from_yaw([0.3, 0, 0], 0), 0.01)
    fumble = screw_path(there[-1], Pose.from_yaw([0.3, 0.015, 0], 0), 0.005)
    path = there.joined(fumble).joined(fumble.reversed())
    out = trimmed(path, 0.02)
    assert_same_pose(out.dqs[-1], path.dqs[-1], 1e-15)
    assert np.abs(out.positions[:, 1]).max() < 1e-12
