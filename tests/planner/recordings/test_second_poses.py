"""Poses beside the hand's: objects that are none, other hands, frames in turn; and times no hand can have moved in."""

from __future__ import annotations

import numpy as np
import pytest

from onedemo.planner.errors import BadDemonstration
from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.recordings.kinematic_check import gaps_in_words
from onedemo.planner.recordings.pose_columns import TableRequest
from onedemo.planner.recordings.pose_table import recording_from_table

COUNT = 80
TIME = np.arange(COUNT) / 20.0
CLOSED = (np.arange(COUNT) >= 30) & (np.arange(COUNT) < 70)
NAMES = ("x", "y", "z", "qw", "qx", "qy", "qz")
HAND = PosePath(
    np.array([Pose.from_yaw([0.4 + 0.005 * k, 0.1 * np.sin(0.05 * k), 0.3], 0.01 * k).dq for k in range(COUNT)])
)


def carried() -> np.ndarray:
    """A cup that stands, is taken where the gripper closes, and stays where it opens."""
    grip = Pose.from_yaw([0.0, 0.0, 0.03], 0.2)
    return np.array([(HAND[min(max(k, 30), 70)] @ grip).vector for k in range(COUNT)])


def read(folder, columns: dict[str, np.ndarray | list[str]], **options):
    file = folder / "t.csv"
    rows = zip(*(map(str, column) for column in columns.values()), strict=True)
    file.write_text("\n".join([",".join(columns), *(",".join(row) for row in rows)]))
    return recording_from_table(file, TableRequest(**options))


def pose(owner: str, vectors: np.ndarray) -> dict[str, np.ndarray]:
    return {f"{owner}{name}": vectors[:, k] for k, name in enumerate(NAMES)}


def table(*others: tuple[str, np.ndarray], gripper: np.ndarray | None = CLOSED) -> dict[str, np.ndarray]:
    columns = {"time": TIME, **pose("", HAND.vectors)}
    for owner, vectors in others:
        columns |= pose(owner, vectors)
    return columns if gripper is None else columns | {"gripper": np.where(gripper, 1.0, -1.0)}


AHEAD = np.concatenate([HAND.vectors[1:], HAND.vectors[-1:]])


@pytest.mark.parametrize("name", ["action", "command", "ref", "reference", "des", "waypoint", "cmd"])
def test_what_is_called_a_command_is_no_object(name, tmp_path):
    with pytest.raises(BadDemonstration, match=f"'{name}_x' is a command.*--ignore '{name}_x'"):
        read(tmp_path, table((f"{name}_", AHEAD)))


@pytest.mark.parametrize("gripper", [CLOSED, None])
@pytest.mark.parametrize("name", ["target", "goal", "raw", "filtered", "camera"])
def test_what_goes_where_the_hand_goes_is_no_object(name, gripper, tmp_path):
    with pytest.raises(BadDemonstration, match=f"object '{name}' is within 20 mm of the hand .*--ignore '{name}_"):
        read(tmp_path, table((f"{name}_", AHEAD), gripper=gripper))


def test_what_is_fixed_to_an_open_hand_is_no_object(tmp_path):
    vectors = HAND.with_tool(Pose.from_yaw([0.1, 0.0, -0.2], 1.0)).vectors
    with pytest.raises(
        BadDemonstration, match="object 'elbow' moves as if fixed to the hand while the gripper is open"
    ):
        read(tmp_path, table(("elbow_", vectors)))
    # in a hand that is never open it may be held
    assert set(read(tmp_path, table(("cup_", vectors), gripper=np.ones(COUNT, bool))).objects) == {"cup"}


def test_what_the_hand_carries_is_an_object(tmp_path):
    assert set(read(tmp_path, table(("cup_", carried()))).objects) == {"cup"}
    assert set(read(tmp_path, table(("target_", carried()))).objects) == {"target"}


def test_an_object_that_jumps_is_refused(tmp_path):
    lost = carried()
    lost[40] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    with pytest.raises(BadDemonstration, match=r"object 'cup' jumps by 0.* from sample 39 to 40.*--ignore 'cup_"):
        read(tmp_path, table(("cup_", lost)))


@pytest.mark.parametrize("hand, other", [("right", "left"), ("follower", "leader")])
def test_another_hand_is_no_object(hand, other, tmp_path):
    columns = {"time": TIME, **pose(f"{hand}_", HAND.vectors), **pose(f"{other}_", AHEAD + 0.5 * np.eye(7)[0])}
    found = read(tmp_path, columns, hand=hand)
    assert not found.objects
    assert any(f"the pose of '{other}', another hand than '{hand}', is left out" in note for note in found.notes)
    with pytest.raises(BadDemonstration, match="which pose is the hand's"):
        read(tmp_path, columns)


def test_time_in_minutes_and_stamps_in_bursts_are_refused(tmp_path):
    columns = table()
    with pytest.raises(BadDemonstration, match="which no hand does: is the time in another unit"):
        read(tmp_path, columns | {"time": TIME / 60.0})
    bursts = np.repeat(TIME[::2], 2) + np.tile([0.0, 1e-4], COUNT // 2)
    with pytest.raises(BadDemonstration, match=r"in 0.1 ms from sample 0 to 1, .* m/s, .*stamps come in bursts"):
        read(tmp_path, columns | {"time": bursts})


def test_a_gap_in_which_the_hand_moved_on_is_named():
    time = TIME + np.where(np.arange(COUNT) > 50, 3.0, 0.0)
    path = PosePath(np.concatenate([HAND.dqs[:51], HAND.dqs[55:], HAND.dqs[-4:]]))
    assert gaps_in_words(path, time) == [
        "no samples from 2.50 to 5.55 s, 3.05 s, in which the hand moved on by 0.033 m"
    ]
    assert gaps_in_words(HAND, TIME) == []


def with_gripper(name: str, opened: float, shut: float, *others: tuple[str, np.ndarray]) -> dict[str, np.ndarray]:
    return table(*others, gripper=None) | {name: np.where(CLOSED, shut, opened)}


@pytest.mark.parametrize(
    "name, opened, shut, message",
    [
        ("finger_joint", 0.0, 0.2, "an opening .m., or an angle that closes it"),
        ("gripper_position", 0.0, 0.12, "an opening .m., or an angle that closes it"),
        ("gripper", 1.0, 0.0, "is 0 to 1, at first 1: is it open then, or closed"),
        ("gripper", 255.0, 0.0, "is 0 to 255, at first 255: is it open then, or closed"),
    ],
)
def test_a_gripper_whose_sense_nothing_says_is_asked_about(name, opened, shut, message, tmp_path):
    columns = with_gripper(name, opened, shut)
    with pytest.raises(BadDemonstration, match=f"{message}.*--gripper-closed"):
        read(tmp_path, columns)
    np.testing.assert_array_equal(read(tmp_path, columns, closed=shut).gripper, np.where(CLOSED, 1.0, -1.0))


def test_a_gripper_that_changes_once_may_have_held_something_from_the_start(tmp_path):
    columns = table(gripper=None) | {"gripper": np.where(TIME > 3.0, 1.0, 0.0)}
    with pytest.raises(BadDemonstration, match="is 0 to 1, at first 0: is it open then, or closed"):
        read(tmp_path, columns)
    assert read(tmp_path, columns, closed=0.0).gripper[0] == 1.0


@pytest.mark.parametrize(
    "name, opened, shut", [("gripper", 1.0, 0.0), ("finger_joint", 0.08, 0.02), ("gripper_position", 0.0, 0.8)]
)
def test_a_carried_object_decides_the_sense_of_a_gripper(name, opened, shut, tmp_path):
    found = read(tmp_path, with_gripper(name, opened, shut, ("cup_", carried())))
    np.testing.assert_array_equal(found.gripper, np.where(CLOSED, 1.0, -1.0))


@pytest.mark.parametrize("name, opened, shut", [("finger_joint", 0.0, 0.2), ("gripper_width", 0.02, 0.08)])
def test_a_carried_object_contradicts_a_gripper(name, opened, shut, tmp_path):
    with pytest.raises(BadDemonstration, match="objects move with the hand where it would be open: say so with"):
        read(tmp_path, with_gripper(name, opened, shut, ("cup_", carried())))
