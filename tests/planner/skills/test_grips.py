"""Grips: held from when the object moves with the hand, released when it parts; pushes and drops are told apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.planner.shown_skills import Move, at, demonstrated, hand, is_near, pick_and_place
from helpers.strategies import for_all, st

from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.skills.grips import closings, grips


@for_all(st.floats(0.0, 0.3), st.floats(-0.3, 0.3), st.floats(-3.0, 3.0), max_examples=15)
def test_a_grip_is_as_it_was_made(x, y, yaw):
    goal = at(0.4 + x, y, 0.02, yaw)
    (grip,), empty = grips(pick_and_place(goal))
    assert not empty and grip.name == "cube" and grip.opens
    assert is_near(grip.object_from_tcp, hand(0, 0, 0))
    assert is_near(grip.undisturbed, at(0.4, 0.1, 0.02))
    assert grip.rested is not None
    assert is_near(grip.rested, goal)
    assert 40 <= grip.held <= 56 and grip.released >= grip.open


def test_an_object_that_is_let_go_high_up_rests_below():
    released, rest = at(0.55, -0.1, 0.14), at(0.55, -0.1, 0.02)
    demonstration = pick_and_place(released, rest)
    (grip,), _ = grips(demonstration)
    assert is_near(demonstration.object_paths["cube"][grip.released], released)
    assert grip.rested is not None
    assert is_near(grip.rested, rest)


def test_a_push_before_the_grasp_does_not_count_as_the_objects_place():
    cube, pushed = at(0.4, 0.1, 0.02), at(0.426, 0.1, 0.02)
    grasp = hand(0.426, 0.1, 0.02)
    moves = [Move(hand(0.4, 0.1, 0.02), 40), Move(grasp, 10, 1.0), Move(hand(0.426, 0.1, 0.2), 20, 1.0)]
    shown = demonstrated(hand(0.3, -0.1, 0.3), moves, {"cube": cube}, held={1: "cube", 2: "cube"})
    (grip,), _ = grips(shown)
    assert is_near(grip.undisturbed, cube)
    assert is_near(grip.object_from_tcp, pushed.inverse() @ grasp)
    assert not grip.opens and grip.rested is None


def test_a_hand_that_closes_on_nothing_is_no_grip():
    moves = [Move(hand(0.2, 0.3, 0.2), 20, 1.0, 4), Move(hand(0.2, 0.3, 0.25), 5, -1.0), *_moves()]
    held = {3: "cube", 4: "cube"}
    shown = demonstrated(hand(0.3, -0.1, 0.3), moves, {"cube": at(0.4, 0.1, 0.02)}, held=held)
    found, empty = grips(shown)
    assert [grip.name for grip in found] == ["cube"] and len(empty) == 1


def test_of_two_objects_that_move_together_the_one_in_the_hand_is_held():
    lower, upper = at(0.4, 0.1, 0.02), at(0.4, 0.1, 0.06)
    moves = _moves()
    shown = demonstrated(hand(0.3, -0.1, 0.3), moves, {"lower": lower}, held={1: "lower", 2: "lower"})
    path = shown.object_paths["lower"].with_tool(lower.inverse() @ upper)
    both = replace(shown, object_paths={"upper": path, **shown.object_paths})
    assert [grip.name for grip in grips(both)[0]] == ["lower"]


def _moves() -> list[Move]:
    return [
        Move(hand(0.4, 0.1, 0.02), 40, 1.0),
        Move(hand(0.4, 0.1, 0.2), 20, 1.0, 0),
        Move(hand(0.5, 0, 0.2), 20, 1.0),
    ]


@for_all(st.lists(st.sampled_from([-1.0, 1.0, 0.0]), min_size=2, max_size=40), max_examples=60)
def test_closings_are_the_spans_of_positive_commands(commands):
    spans = closings(np.array(commands))
    closed = np.zeros(len(commands), dtype=bool)
    for span in spans:
        closed[span.start : span.stop + 1] = True
        assert span.opens == (span.stop + 1 < len(commands))
    np.testing.assert_array_equal(closed, np.array(commands) > 0.0)


def test_an_object_that_settles_at_first_is_not_carried():
    start = pick_and_place(at(0.5, 0.0, 0.02))
    path = start.object_paths["cube"]
    fallen = PosePath(np.vstack([Pose.from_position_quaternion([0.4, 0.1, 0.06]).dq[None], path.dqs[1:]]))
    (grip,), _ = grips(replace(start, object_paths={"cube": fallen}))
    assert is_near(grip.undisturbed, at(0.4, 0.1, 0.02))


@pytest.mark.parametrize("samples", [2, 3])
def test_a_short_recording_has_no_grip(samples):
    demonstration = pick_and_place(at(0.5, 0.0, 0.02))
    short = replace(
        demonstration,
        time=demonstration.time[:samples],
        path=demonstration.path[:samples],
        gripper=np.ones(samples),
        object_paths={name: path[:samples] for name, path in demonstration.object_paths.items()},
    )
    assert grips(short)[0] == []
