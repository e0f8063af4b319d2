"""Motions of a recording: found at grips and rests, named, given and changed by the user."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from onedemo.planner.errors import BadDemonstration, BadOption, UnknownName
from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.imitation.tsia import screw_path
from onedemo.planner.recordings.cuts import SegmentRequest, parsed_segment, segments_of
from onedemo.planner.recordings.import_recording import demonstration_of
from onedemo.planner.recordings.recording import Recording

DOWN = [0.0, 1.0, 0.0, 0.0]


def at(x: float, y: float, z: float) -> Pose:
    return Pose.from_position_quaternion([x, y, z], DOWN)


def recorded() -> Recording:
    """A cup is taken at (0.4, 0), put on a plate at (0.4, 0.3), and the hand leaves; it rests at each."""
    stops = [at(0.3, 0.0, 0.4), at(0.4, 0.0, 0.1), at(0.4, 0.3, 0.15), at(0.3, 0.3, 0.5)]
    pieces, grip = [], []
    for k in range(3):
        path = screw_path(stops[k], stops[k + 1], 0.01).dqs
        pieces += [path, np.repeat(path[-1:], 30, axis=0)]
        grip += [1.0 if k == 1 else -1.0] * (len(path) + 29) + [-1.0 if k == 1 else 1.0 if k == 0 else -1.0]
    hand = PosePath(np.concatenate(pieces))
    gripper = np.roll(np.array(grip), 1)
    gripper[0] = -1.0
    held = np.cumsum(np.diff(gripper, prepend=-1.0) != 0) == 1
    start, end = np.flatnonzero(held)[[0, -1]]
    cup = [hand[min(max(k, start), end)].position - [0.0, 0.0, 0.02] for k in range(len(hand))]
    objects = {"cup": PosePath(np.array([at(*place).dq for place in cup]))}
    fixtures = {"plate": at(0.4, 0.3, 0.1)}
    time = np.arange(len(hand)) / 50.0
    return Recording(Path("r.csv"), time, hand, gripper=gripper, objects=objects, fixtures=fixtures)


def test_motions_end_where_the_gripper_acts_and_refer_to_what_is_there():
    take, put, leave = segments_of(recorded())
    assert (take.reference, take.held, take.gripper) == ("cup", "", "close")
    assert (put.reference, put.held, put.gripper) == ("plate", "cup", "open")
    assert (leave.reference, leave.held, leave.gripper) == ("", "", "none")
    assert put.start == take.stop + 1 and leave.start == put.stop + 1
    np.testing.assert_allclose(put.reference_pose.position, [0.4, 0.3, 0.1])


def test_without_a_gripper_motions_end_at_rests():
    bare = replace(recorded(), gripper=None)
    assert [segment.gripper for segment in segments_of(bare)] == ["none"] * 3
    assert len(segments_of(recorded(), cut="rests")) == 3
    assert [(s.start, s.stop) for s in segments_of(recorded(), cut="none")] == [(0, len(bare.time) - 1)]


def test_a_task_s_names_go_to_the_first_motions_and_one_may_follow():
    names = [segment.name for segment in segments_of(recorded(), names=("approach", "transfer"))]
    assert names == ["approach", "transfer"]
    with pytest.raises(BadDemonstration, match=r"needs a; found are 3 motions \(0.0 to .*name them, like --seg"):
        segments_of(recorded(), names=("a",))
    with pytest.raises(BadDemonstration, match="needs a, b, c, d; found are 3 motions"):
        segments_of(recorded(), names=("a", "b", "c", "d"))


def test_the_user_s_word_goes_before_what_is_found():
    first, second = segments_of(
        recorded(),
        [SegmentRequest("one", 0.0, 0.4, reference="plate"), SegmentRequest("two", 30, 60, held="cup", gripper="open")],
    )
    assert (first.start, first.stop, first.reference) == (0, 20, "plate")
    assert (second.start, second.stop, second.held, second.gripper) == (30, 60, "cup", "open")
    with pytest.raises(UnknownName, match="unknown reference of segment 'one' 'saucer'; known: cup, plate"):
        segments_of(recorded(), [SegmentRequest("one", reference="saucer")])
    with pytest.raises(BadDemonstration, match="segments: 4 are named; found are 3 motions"):
        segments_of(recorded(), [SegmentRequest(name) for name in "abcd"])
    with pytest.raises(BadDemonstration, match=r"segment 'one': ends at 99 s; the recording lasts"):
        segments_of(recorded(), [SegmentRequest("one", 0.0, 99.0)])
    with pytest.raises(UnknownName, match="unknown cut 'often'; known: auto, gripper, rests, none"):
        segments_of(recorded(), cut="often")
    with pytest.raises(BadDemonstration, match=r"r.csv: segment 'two': begins at 10, before the one before has ended"):
        demonstration_of(recorded(), name="x", requests=[SegmentRequest("one", 0, 20), SegmentRequest("two", 10, 60)])


@pytest.mark.parametrize(
    "text, request_",
    [
        ("approach", SegmentRequest("approach")),
        ("approach=0:169", SegmentRequest("approach", 0, 169)),
        ("put=3.2s:8s,reference=plate,held=cup", SegmentRequest("put", 3.2, 8.0, "plate", "cup")),
        ("leave,reference=,gripper=none", SegmentRequest("leave", reference="", gripper="none")),
    ],
)
def test_a_motion_is_written_in_one_option(text, request_):
    found = parsed_segment(text)
    assert found == request_ and isinstance(found.start, type(request_.start))


@pytest.mark.parametrize(
    "text, message",
    [
        ("", "does not begin with a name"),
        ("a=3", "'3' of 'a=3' is no range"),
        ("a=1.5:3", "is no range of samples"),
        ("a=1..5s:3s", "is no range of samples"),
        ("a,colour=red", "'colour=red' of 'a,colour=red' is none of"),
        ("a,reference", "is none of reference=NAME"),
        ("a,gripper=squeeze", "gripper 'squeeze' of .* is none of close, open, none"),
    ],
)
def test_other_forms_are_shown_the_right_one(text, message):
    with pytest.raises(BadOption, match=message):
        parsed_segment(text)


def test_everything_recorded_is_in_the_demonstration():
    recording = recorded()
    found = demonstration_of(recording, name="x", sizes={"cup": np.full(3, 0.08)})
    assert found.object_paths["cup"] is recording.objects["cup"] and "plate" in found.fixtures
    np.testing.assert_array_equal(found.gripper, recording.gripper)
