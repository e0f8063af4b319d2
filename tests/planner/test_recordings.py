from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from strategies import assert_same_pose, random_path

from onedemo.configs.shipped import shipped_demonstration
from onedemo.envs.scene import robot_arm
from onedemo.planner.demo_io import load_demonstration
from onedemo.planner.errors import BadDemonstration, OneDemoError
from onedemo.planner.pose import Pose, PosePath
from onedemo.planner.recordings import from_pose_table, stack_from_teleoperation
from onedemo.planner.segment import dwells, gripper_events, resampled, trimmed
from onedemo.planner.tsia import screw_path

RAW = Path(__file__).parents[3] / "shared/data/panda_teleop_stack.npz"
needs_raw = pytest.mark.skipif(not RAW.exists(), reason="the raw recording is not here")


@needs_raw
def test_the_shipped_demonstration_is_the_import_of_the_raw_recording():
    shipped = load_demonstration(shipped_demonstration("stack"))
    made = stack_from_teleoperation(RAW, robot_arm("Panda"), name="stack", licence=shipped.licence)
    np.testing.assert_array_equal(made.time, shipped.time)
    np.testing.assert_array_equal(made.gripper, shipped.gripper)
    np.testing.assert_allclose(made.path.vectors, shipped.path.vectors, atol=1e-9)
    ours = [(s.name, s.start, s.stop, s.reference, s.held, s.gripper) for s in made.segments]
    assert ours == [(s.name, s.start, s.stop, s.reference, s.held, s.gripper) for s in shipped.segments]


def test_the_recorded_joints_give_the_recorded_path():
    demo, arm = load_demonstration(shipped_demonstration("stack")), robot_arm("Panda")
    for k in range(0, len(demo.path), 25):
        distance, angle = arm.fk(demo.joint_positions[k]).gap(demo.path[k])
        assert distance < 1e-9
        assert angle < 1e-9


def test_the_recorded_hand_is_at_the_cube_when_it_closes():
    demo = load_demonstration(shipped_demonstration("stack"))
    approach = demo.segment("approach")
    offset = approach.reference_pose.position - demo.path[approach.stop].position
    assert np.linalg.norm(offset) < 0.02


def table(tmp_path, name="poses.csv", scale=1.0, order=(0, 1, 2, 3), header="", rest=40):
    """There, a rest, and back again."""
    out = screw_path(Pose.identity(), Pose.from_yaw([0.3, 0.1, 0.2], 0.8), 0.01)
    still = np.repeat(out.vectors[-1:], rest, axis=0)
    rows = np.vstack([out.vectors, still, out.reversed().vectors])
    rows = np.column_stack([rows[:, :3] * scale, rows[:, 3:][:, order]])
    path = tmp_path / name
    if path.suffix == ".npy":
        np.save(path, rows)
    else:
        np.savetxt(path, rows, delimiter=",", header=header, comments="")
    return path, out


@pytest.mark.parametrize(
    "made, read",
    [
        ({}, {}),
        ({"name": "poses.npy"}, {}),
        ({"header": "x,y,z,qw,qx,qy,qz"}, {}),
        ({"scale": 100.0}, {"units": "cm"}),
        ({"scale": 1000.0}, {"units": "mm"}),
        ({"order": (1, 2, 3, 0)}, {"quaternion": "xyzw"}),
    ],
)
def test_tables_of_poses_become_demonstrations_cut_where_the_hand_rests(made, read, tmp_path):
    path, out = table(tmp_path, **made)
    demo = from_pose_table(path, name="mine", robot="Panda", rate=50.0, **read)
    assert len(demo.segments) == 2
    np.testing.assert_allclose(demo.path[len(out) - 1].position, [0.3, 0.1, 0.2], atol=1e-6)
    assert demo.path[len(out) - 1].yaw == pytest.approx(0.8, abs=1e-6)
    assert demo.duration == pytest.approx((len(demo.path) - 1) / 50.0)


@pytest.mark.parametrize(
    "arguments, message",
    [
        ({"units": "inch"}, "unknown unit 'inch'; known: m, cm, mm"),
        ({"quaternion": "zyxw"}, "unknown quaternion order 'zyxw'; known: wxyz, xyzw"),
        ({"rate": 0.0}, "rate: 0.0 is not a positive number"),
        ({"rate": np.nan}, "rate: nan is not"),
        ({"robot": "HAL"}, "robot: 'HAL' is unknown"),
        ({"source": "dreamt"}, "source: 'dreamt'"),
    ],
)
def test_bad_arguments_of_a_table_are_named(arguments, message, tmp_path):
    path, _ = table(tmp_path)
    with pytest.raises(OneDemoError, match=message):
        from_pose_table(path, **{"name": "x", "robot": "Panda", "rate": 50.0, **arguments})


@pytest.mark.parametrize(
    "content, message",
    [
        ("", "table"),
        ("1,2,3\n", r"has shape \(1, 3\); expected \(n, 7\)"),
        ("0,0,0,1,0,0,0\n", "has 1 sample"),
        ("a,b\nx,y\n", "cannot be read"),
        ("0,0,0,1,0,0,0\n0,0,0,2,0,0,0\n", "the quaternion at index 1 has norm 2"),
        ("0,0,0,1,0,0,0\n0,0,nan,1,0,0,0\n", "is not finite at index 1"),
    ],
)
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_bad_tables_are_named(content, message, tmp_path):
    path = tmp_path / "bad.csv"
    path.write_text(content)
    with pytest.raises(BadDemonstration, match=message) as caught:
        from_pose_table(path, name="x", robot="Panda", rate=50.0)
    assert str(path) in str(caught.value)


def test_gripper_events_are_the_last_samples_before_a_change():
    np.testing.assert_array_equal(gripper_events(np.array([-1, -1, 0.5, 1, 1, -1])), [1, 4])


def test_a_rest_is_found_and_a_short_stop_is_not():
    move = screw_path(Pose.identity(), Pose.from_yaw([0.5, 0, 0], 0), 0.01).dqs
    path = PosePath(np.concatenate([move, np.repeat(move[-1:], 30, axis=0), move[::-1]]))
    time = np.arange(len(path)) / 50.0
    assert dwells(time, path) == [(len(move) - 1, len(move) + 30)]
    assert dwells(0.1 * time, path) == []


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
