"""Teleoperations in .npz files: any objects, fixtures and joints, checked entry by entry."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from helpers.arms import table_panda
from helpers.strategies import assert_same_pose

from onedemo.planner.errors import BadDemonstration, UnknownName
from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.recordings.kinematic_check import joints_path
from onedemo.planner.recordings.teleoperation import commanded_path, recording_from_teleoperation

SHARED = Path(__file__).parents[4] / "shared" / "data"


def teleoperation(count: int = 12) -> dict[str, np.ndarray]:
    """A short recording: the hand closes, then opens; a cup, a drawer's joint, a shelf."""
    arm, _, home = table_panda()
    t = np.arange(count) / 20.0
    grip = np.where((t > 0.15) & (t < 0.4), 1.0, -1.0)
    joints = home + np.outer(1.5 * t, [1.0, 0.5, -1.0, 0.3, 0.0, 0.2, 0.5])
    q = np.column_stack([joints, np.full((count, 2), 0.04), np.linspace(0.0, 0.3, count)])
    cup = np.tile([0.1, 0.0, 0.83, 1.0, 0.0, 0.0, 0.0], (count, 1))
    names = [f"robot0_joint{k + 1}" for k in range(7)] + ["finger1", "finger2", "drawer_slide"]
    return {
        "t": t,
        "q": q,
        "joint_names": np.array(names),
        "actions": np.column_stack([np.full((count, 6), 0.1), grip]),
        "obj_cup_jnt0": cup,
        "obj_red_can_joint0": cup + 0.1 * np.eye(7)[0],
        "fix_shelf": cup[0] + 0.2 * np.eye(7)[1],
        "ee_gripper0_grip_site": joints_path(arm, joints).vectors,
    }


def read(tmp_path, arrays, **options):
    np.savez(tmp_path / "raw.npz", **arrays)
    return recording_from_teleoperation(tmp_path / "raw.npz", table_panda()[0], **options)


def test_all_that_is_recorded_is_kept(tmp_path):
    arrays = teleoperation()
    found = read(tmp_path, arrays)
    assert set(found.objects) == {"cup", "red_can"} and set(found.fixtures) == {"shelf"}
    assert set(found.other_joints) == {"finger1", "finger2", "drawer_slide"}
    np.testing.assert_array_equal(found.other_joints["drawer_slide"], arrays["q"][:, 9])
    np.testing.assert_array_equal(found.joints, arrays["q"][:, :7])
    np.testing.assert_array_equal(found.gripper, arrays["actions"][:, 6])
    assert_same_pose(found.objects["red_can"].dqs, PosePath.from_vectors(arrays["obj_red_can_joint0"]).dqs, 1e-12)
    assert_same_pose(found.hand.dqs, PosePath.from_vectors(arrays["ee_gripper0_grip_site"]).dqs, 1e-9)
    np.testing.assert_allclose(found.commanded.positions - found.hand.positions, 0.005, atol=1e-12)
    assert any("agrees with the joints to 0.0 mm" in note for note in found.notes)


@pytest.mark.parametrize("base", [[-0.06, 0.1, 0.0, 1, 0, 0, 0], [0.008, 0, 0, 1, 0, 0, 0], [1, 0, 0, 0.6, 0, 0, 0.8]])
def test_the_hand_is_where_the_objects_were_recorded(base, tmp_path):
    """The robot may stand elsewhere than this project's: hand and objects must be in one world."""
    arrays, base = teleoperation(), Pose.from_vector(np.array(base, dtype=float))
    usual = read(tmp_path, arrays)
    arrays["ee_gripper0_grip_site"] = usual.hand.moved(base).vectors
    found = read(tmp_path, arrays)
    assert_same_pose(found.hand.dqs, usual.hand.moved(base).dqs, 1e-9)
    np.testing.assert_allclose(found.commanded.positions - found.hand.positions, 0.005, atol=1e-9)
    assert any("base stood" in note for note in found.notes) and not any("base stood" in note for note in usual.notes)


def test_commands_turn_about_the_axes_of_the_world():
    arm, _, home = table_panda()
    hand = joints_path(arm, home[None].repeat(2, axis=0))
    sent = commanded_path(hand, np.array([[0, 0, 0, 0, 0, 0.5], [2.0, -0.5, 0, 0, 0, 0]]))
    turned = sent[0].rotation @ hand[0].rotation.T
    c, s = np.cos(0.25), np.sin(0.25)
    np.testing.assert_allclose(turned, [[c, -s, 0], [s, c, 0], [0, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(sent[1].position - hand[1].position, [0.05, -0.025, 0.0], atol=1e-12)


@pytest.mark.skipif(not SHARED.is_dir(), reason="the raw recordings are not here")
@pytest.mark.parametrize("name", ["stack", "lift", "nut_assembly"])
def test_the_hand_goes_where_people_sent_it(name):
    """What was commanded is a little ahead of what the hand then did."""
    found = recording_from_teleoperation(SHARED / f"panda_teleop_{name}.npz", table_panda()[0])
    ahead = (found.commanded.positions - found.hand.positions)[:-5]
    done = found.hand.positions[5:] - found.hand.positions[:-5]
    moving = np.linalg.norm(ahead, axis=1) > 0.01
    assert np.corrcoef(ahead[moving].ravel(), done[moving].ravel())[0, 1] > 0.95


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
        ("q", lambda q: q[:, ::-1], r"ee_gripper0_grip_site: contradicts the joints"),
        ("joint_names", lambda n: n[:-1], r"joint_names: are 9, 9 of them different; q has 10 columns"),
        ("joint_names", lambda n: at(n, 3, "finger1"), r"joint_names: are 10, 9 of them different"),
        ("actions", lambda a: a[:, -1], r"actions: is not an array of numbers with 2 dim"),
        ("actions", lambda a: a[:, :0], r"actions: has shape \(12, 0\)"),
        ("actions", lambda a: at(a, (3, 6), np.inf), r"actions: is not finite at index 3"),
        ("actions", lambda a: at(a, (3, 6), 7.0), r"actions: is -1 to 7: which value is the closed gripper"),
        ("obj_cup_jnt0", lambda o: o[:3], r"obj_cup_jnt0: has 3 samples; t has 12"),
        ("obj_cup_jnt0", lambda o: o[0], r"obj_cup_jnt0: "),
        ("fix_shelf", lambda f: f[:6], r"fix_shelf: has shape \(1, 6\)"),
        ("ee_gripper0_grip_site", lambda e: e[:, [0, 1, 2, 4, 5, 6, 3]], "contradicts the joints: from sample"),
        ("t", lambda t: t[:, None], r"t: is not an array of numbers with 1 dim"),
        ("colour", lambda _: np.zeros(3), r"colour: is unknown; a recording holds: t, q, actions.*--ignore colour"),
    ],
)
def test_bad_teleoperations_are_named_with_file_and_index(key, change, message, tmp_path):
    arrays = teleoperation()
    read(tmp_path, arrays)
    with pytest.raises(BadDemonstration, match=message) as caught:
        read(tmp_path, {**arrays, key: change(arrays.get(key))})
    assert str(caught.value).startswith(str(tmp_path / "raw.npz"))
    assert "\n" not in str(caught.value)


def test_a_key_is_left_out_if_the_user_says_so(tmp_path):
    arrays = teleoperation()
    found = read(tmp_path, {**arrays, "colour": np.zeros(3)}, ignored=("col*", "obj_cup*"))
    assert set(found.objects) == {"red_can"}
    assert {"colour is left out, as said", "obj_cup_jnt0 is left out, as said"} <= set(found.notes)
    with pytest.raises(UnknownName, match="unknown key to ignore 'shape'; known: t, q"):
        read(tmp_path, arrays, ignored=("shape",))
    for key in ("t", "q", "actions"):
        with pytest.raises(BadDemonstration, match=f"{key}: is missing; a recording holds: t, q, actions, joint_names"):
            read(tmp_path, {name: value for name, value in arrays.items() if name != key})


def test_joints_in_another_order_are_sorted_by_their_names(tmp_path):
    arrays = teleoperation()
    order = [7, 2, 0, 1, 9, 3, 4, 6, 5, 8]
    found = read(tmp_path, {**arrays, "q": arrays["q"][:, order], "joint_names": arrays["joint_names"][order]})
    np.testing.assert_array_equal(found.joints, arrays["q"][:, :7])
    assert set(found.other_joints) == {"finger1", "finger2", "drawer_slide"}
    np.testing.assert_array_equal(found.other_joints["drawer_slide"], arrays["q"][:, 9])
    assert "q is sorted by joint_names, robot0_joint1 to robot0_joint7" in found.notes
    assert not any("sorted" in note for note in read(tmp_path, arrays).notes)


def test_joints_of_another_robot_are_refused(tmp_path):
    names = np.array([f"iiwa_joint_{k}" for k in range(1, 8)] + ["finger1", "finger2", "drawer_slide"])
    with pytest.raises(BadDemonstration, match="'iiwa_joint_1' is a joint of the IIWA by its name, not of the Panda"):
        read(tmp_path, {**teleoperation(), "joint_names": names})


def test_stamps_in_another_unit_are_asked_about_and_converted(tmp_path):
    arrays = teleoperation()
    assert any("time stamps are in s: 20 Hz" in note for note in read(tmp_path, arrays).notes)
    with pytest.raises(BadDemonstration, match="t: has steps of 1, which are no seconds"):
        read(tmp_path, {**arrays, "t": np.arange(12.0)})
    with pytest.raises(BadDemonstration, match=r"ns \(20 Hz\)"):
        read(tmp_path, {**arrays, "t": np.round(1e9 * arrays["t"]).astype(np.int64)})
    since = np.int64(1_714_550_400) * 10**9 + np.round(1e9 * arrays["t"]).astype(np.int64)
    for found in (read(tmp_path, {**arrays, "t": since}), read(tmp_path, {**arrays, "t": since}, time_unit="ns")):
        np.testing.assert_allclose(found.time, arrays["t"], atol=1e-6)
