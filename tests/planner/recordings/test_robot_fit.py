"""Recordings against the robot: what no arm of its kind can have done is refused, with what would explain it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.arms import table_panda
from helpers.strategies import for_all, st

from onedemo.planner.control.reachability import max_reach
from onedemo.planner.errors import BadDemonstration
from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.recordings.kinematic_check import (
    FAR,
    LONG_TOOL,
    SLACK,
    joints_path,
    limits_in_words,
    reach_in_words,
)
from onedemo.planner.recordings.pose_columns import TableRequest
from onedemo.planner.recordings.pose_table import recording_from_table
from onedemo.planner.recordings.recording import METERS, blame_of

ARM, _, HOME = table_panda()
BLAME = blame_of("x.csv", "joints")
TIME = np.arange(80) / 20.0


def joints(seed: int, wide: float = 0.35) -> np.ndarray:
    """A smooth motion between two postures within the limits, in four seconds."""
    rng = np.random.default_rng(seed)
    ends = np.clip(HOME + rng.uniform(-wide, wide, (2, 7)), ARM.lower + 0.01, ARM.upper - 0.01)
    share = 0.5 - 0.5 * np.cos(np.pi * TIME / TIME[-1])
    return ends[0] + share[:, None] * (ends[1] - ends[0])


def table(folder, path: PosePath, scale: float):
    file, rows = folder / "t.csv", path.vectors * np.array([scale] * 3 + [1.0] * 4)
    np.savetxt(file, rows, delimiter=",", header="x,y,z,qw,qx,qy,qz", comments="")
    return file


@for_all(st.integers(0, 10**6), st.sampled_from(sorted(METERS)), st.booleans(), max_examples=40)
def test_a_hand_that_moves_in_another_unit_is_refused_and_one_in_meters_is_not(tmp_path_factory, seed, unit, is_known):
    folder, path = tmp_path_factory.mktemp("far"), joints_path(ARM, joints(seed))
    file, arm = table(folder, path, 1.0 / METERS[unit]), ARM if is_known else None
    extent = np.linalg.norm(np.ptp(path.positions, axis=0))
    said = recording_from_table(file, TableRequest(rate=20.0, units=unit), arm)
    assert any(f"the hand travels {np.linalg.norm(np.diff(path.positions, axis=0), axis=1).sum():.3g} m within" in note
               for note in said.notes)  # fmt: skip
    if extent / METERS[unit] > (2.0 * (max_reach(ARM) + LONG_TOOL) if is_known else FAR):
        with pytest.raises(BadDemonstration, match=r"moves over .* in cm or mm") as caught:
            recording_from_table(file, TableRequest(rate=20.0), arm)
        assert "--units" in str(caught.value) and "\n" not in str(caught.value)
    else:
        recording_from_table(file, TableRequest(rate=20.0), arm)


def line(length: float) -> PosePath:
    return PosePath(
        np.array([Pose.from_position_quaternion([x, 0.2, 0.3], [1, 0, 0, 0]).dq for x in np.linspace(0, length, 30)])
    )


@pytest.mark.parametrize(
    "length, arm, unit, words",
    [
        (31.0, None, "", "moves over 31 m, which is far for an arm: are the positions in cm or mm"),
        (31.0, None, "m", None),
        (2.9, None, "", None),
        (2.9, ARM, "", "the Panda reaches 1.08 m: are the positions in cm or mm"),
        (2.9, ARM, "m", r"the Panda reaches 1.08 m: are the positions in m\? another robot \(--robot\)"),
        (1.5, ARM, "", None),
    ],
)
def test_how_far_a_hand_may_move_depends_on_the_robot_and_on_what_is_said(length, arm, unit, words):
    if words:
        with pytest.raises(BadDemonstration, match=words):
            reach_in_words(line(length), np.arange(30.0), arm, unit, BLAME)
    else:
        said = reach_in_words(line(length), np.arange(30.0), arm, unit, BLAME)
        assert said.startswith(f"the hand travels {length:.3g} m within {length:.3g} m")
        assert ("which is far for an arm" in said) == (length > 3.0)


def test_a_hand_that_hardly_moves_is_asked_about():
    assert "which is little: are the positions in mm?" in reach_in_words(
        line(0.0005), np.arange(30.0), ARM, "mm", BLAME
    )


def off_the_slack(excess: float) -> bool:
    """Whether rounding cannot decide on which side of the slack an excess is."""
    return abs(excess - SLACK) > 1e-9


@for_all(st.integers(0, 10**6), max_examples=60)
def test_joints_within_the_limits_pass_and_their_degrees_are_found_out(seed):
    q = joints(seed)
    assert limits_in_words(q, TIME, ARM, BLAME) == "within the limits of the Panda"
    with pytest.raises(BadDemonstration, match=r"in degrees \(--angles deg\)\?") as caught:
        limits_in_words(np.degrees(q), TIME, ARM, BLAME)
    assert "\n" not in str(caught.value)


EXCESSES = st.floats(1e-6, 1.0).filter(off_the_slack)


@for_all(st.integers(0, 10**6), st.integers(0, 6), st.booleans(), EXCESSES, max_examples=60)
def test_a_limit_is_passed_by_little_with_a_word_and_by_much_with_an_error(seed, joint, is_low, excess):
    q = joints(seed, 0.0)
    q[40, joint] = ARM.lower[joint] - excess if is_low else ARM.upper[joint] + excess
    slow = TIME * 1000.0
    if excess > SLACK:
        with pytest.raises(BadDemonstration, match=rf"joint {joint + 1} is .* rad at sample 40, its limit") as caught:
            limits_in_words(q, slow, ARM, BLAME)
        assert "in degrees" not in str(caught.value)
    else:
        assert limits_in_words(q, slow, ARM, BLAME).startswith("beyond a limit of the Panda by little: joint ")


@for_all(st.integers(0, 10**6), max_examples=30)
def test_joints_faster_than_the_robot_are_refused_wherever_the_clock_is_wrong(seed):
    q = joints(seed)
    assert np.abs(q[-1] - q[0]).max() > 0.02
    with pytest.raises(BadDemonstration, match=r"joint \d moves by .* rad/s from sample \d+ on, at most .*--time-unit"):
        limits_in_words(q, TIME / 1000.0, ARM, BLAME)


def test_angles_that_wrap_are_no_haste():
    q = joints(1)
    wrapped = q.copy()
    wrapped[40:, 0] += 2.0 * np.pi * np.sign(-q[40, 0])
    free = replace(ARM, lower=np.full(7, -np.inf), upper=np.full(7, np.inf))
    assert limits_in_words(wrapped, TIME, free, BLAME) == "within the limits of the Panda"
