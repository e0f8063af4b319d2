from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from helpers.arms import table_panda
from helpers.strategies import assert_same_pose, random_path

from onedemo.bench.cli import main
from onedemo.configs.shipped_files import shipped_demonstration
from onedemo.planner.errors import BadDemonstration, OneDemoError
from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.imitation.demonstration_files import read_demonstration
from onedemo.planner.imitation.import_recordings import from_pose_table, stack_from_teleoperation
from onedemo.planner.imitation.segmentation import dwells, gripper_events, resampled, trimmed
from onedemo.planner.imitation.tsia import screw_path

RAW = Path(__file__).parents[4] / "shared/data/panda_teleop_stack.npz"
needs_raw = pytest.mark.skipif(not RAW.exists(), reason="the raw recording is not here")


POSE_ROUNDING = 1e-14
"""Poses go through sines and cosines, whose last bits differ between machines."""


@needs_raw
def test_the_shipped_demonstration_is_what_the_documented_command_makes(tmp_path, monkeypatch):
    licence, output = "MIT, see LICENSE-robosuite.txt", tmp_path / "stack.npz"
    readme = " ".join((Path(__file__).parents[3] / "README.md").read_text(encoding="utf-8").split())
    assert f'onedemo demo import panda_teleop_stack.npz -o stack.npz --licence "{licence}"' in readme
    command = ["onedemo", "demo", "import", str(RAW), "-o", str(output), "--licence", licence]
    monkeypatch.setattr(sys, "argv", command)
    with pytest.raises(SystemExit) as stopped:
        main()
    assert stopped.value.code == 0
    made, shipped = np.load(output), np.load(shipped_demonstration("stack"))
    assert made.files == shipped.files
    for key in made.files:
        assert (made[key].dtype, made[key].shape) == (shipped[key].dtype, shipped[key].shape), key
        if key in ("poses", "segment_reference_poses"):
            np.testing.assert_allclose(made[key], shipped[key], rtol=0, atol=POSE_ROUNDING)
        else:
            np.testing.assert_array_equal(made[key], shipped[key], err_msg=key)


def teleoperation(count=12):
    """A short recording like the shipped one: the hand closes, then opens."""
    t = np.arange(count) / 20.0
    grip = np.where((t > 0.15) & (t < 0.4), 1.0, -1.0)
    cube = np.tile([0.1, 0.0, 0.83, 1.0, 0.0, 0.0, 0.0], (count, 1))
    q = np.tile([0.0, 0.2, 0.0, -2.2, 0.0, 2.4, 0.78, 0.04, 0.04], (count, 1)) + 0.01 * t[:, None]
    actions = np.column_stack([np.zeros((count, 6)), grip])
    return {"t": t, "q": q, "actions": actions, "obj_cubeA_jnt0": cube, "obj_cubeB_jnt0": cube + 0.1 * np.eye(7)[0]}


def at(array, index, value):
    array = array.copy()
    array[index] = value
    return array


@pytest.mark.parametrize(
    "key, change, message",
    [
        ("q", lambda q: q[:, 0], r"q: is not an array of numbers with 2 dim"),
        ("q", lambda q: q.astype(str), r"q: is not an array of numbers"),
        ("q", lambda q: q[:, :5], r"q: has 5 columns; the Panda has 7 joints"),
        ("q", lambda q: q[:-1], r"q: has 11 samples; t has 12"),
        ("q", lambda q: at(q, (4, 2), np.nan), r"q: is not finite at index 4"),
        ("actions", lambda a: a[:, -1], r"actions: is not an array of numbers with 2 dim"),
        ("actions", lambda a: a[:, :0], r"actions: has shape \(12, 0\)"),
        ("actions", lambda a: at(a, (3, 6), np.inf), r"actions: is not finite at index 3"),
        ("actions", lambda a: at(a, (slice(None), 6), -1.0), r"actions: the gripper changes 0 times"),
        ("obj_cubeA_jnt0", lambda o: o[:3], r"obj_cubeA_jnt0: has 3 samples; t has 12"),
        ("obj_cubeB_jnt0", lambda o: o[0], r"obj_cubeB_jnt0: is not an array of numbers with 2 dim"),
        ("t", lambda t: t[::-1], r"time: does not increase at index 1"),
        ("t", lambda t: t[:, None], r"t: is not an array of numbers with 1 dim"),
    ],
)
def test_bad_teleoperations_are_named_with_file_and_index(key, change, message, tmp_path):
    path, arrays = tmp_path / "raw.npz", teleoperation()
    np.savez(path, **arrays)
    assert len(stack_from_teleoperation(path, table_panda()[0], name="x", licence="y").segments) == 2
    np.savez(path, **{**arrays, key: change(arrays[key])})
    with pytest.raises(BadDemonstration, match=message) as caught:
        stack_from_teleoperation(path, table_panda()[0], name="x", licence="y")
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


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
