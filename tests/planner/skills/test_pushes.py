"""Pushes of what turns on a hinge: where they begin, when the hand closes, what they refer to."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from helpers.planner.shown_skills import Move, at, demonstrated, hand, is_near

from onedemo.planner.geometry.pose import Pose
from onedemo.planner.skills.articulations import articulations, joint_events
from onedemo.planner.skills.infer import infer_skill


def test_joints_that_move_are_found_with_their_spans():
    door = np.concatenate([np.zeros(10), np.linspace(0, 0.8, 20), np.full(10, 0.8)])
    events = joint_events({"door": door, "still": np.zeros(40) + 0.001})
    assert list(events) == ["door"]
    start, stop = events["door"]
    assert 8 <= start <= 10 and 28 <= stop <= 31


def test_a_joint_that_gives_a_little_at_first_has_not_moved_yet():
    """A latch sinks on its spring, or fingers nudge it as they close: that is not where the push begins."""
    latch = np.concatenate([np.linspace(0, 0.01, 40), np.linspace(0.01, 1.2, 40), np.full(10, 1.2)])
    start, _ = joint_events({"latch": latch})["latch"]
    assert 38 <= start <= 41


def test_a_push_on_a_hinge_follows_what_was_commanded():
    moves = [Move(hand(0.5, 0.2, 0.1), 40), Move(hand(0.5, 0.4, 0.1), 40)]
    count = 1 + 40 + 12 + 40 + 12
    angle = np.concatenate([np.zeros(60), np.linspace(0, 0.6, 33), np.full(count - 93, 0.6)])
    shown = demonstrated(
        hand(0.3, -0.1, 0.3), moves, {}, fixtures={"door": at(0.6, 0.2, 0.1)}, joints={"door_hinge": angle}
    )
    ahead = shown.path.moved(Pose.from_position_quaternion([0, 0.01, 0]))
    reach, push = infer_skill(replace(shown, commanded=ahead)).phases
    assert (reach.kind, push.kind) == ("reach", "articulate") and push.reference == "door" and push.exact
    assert is_near(at(0.6, 0.2, 0.1) @ reach.goals[0], push.path[0])
    assert is_near(push.path[-1], ahead[92], 0.02)
    measured = infer_skill(shown).phases[1]
    assert "not recorded" in measured.evidence[0] and is_near(measured.path[-1], shown.path[92], 0.02)


DOOR = {"fixtures": {"door": at(0.6, 0.2, 0.1)}}


def opened(commands: tuple[float, ...], turns: tuple[int, int] = (100, 160)):
    """A door pulled by its handle: hand to it, three motions there, each with a gripper command, and away."""
    ways = [hand(0.5, 0.2, 0.1), hand(0.5, 0.21, 0.1), hand(0.5, 0.3, 0.1), hand(0.5, 0.4, 0.1), hand(0.4, 0.4, 0.2)]
    moves = [Move(way, 30, command) for way, command in zip(ways, commands, strict=True)]
    shown = demonstrated(hand(0.3, -0.1, 0.3), moves, {}, **DOOR, joints={})
    start, stop = turns
    angle = np.interp(np.arange(len(shown.time)), [start, stop], [0.0, 0.9])
    return replace(shown, other_joints={"door_hinge": angle})


def test_the_hand_closes_where_it_was_closed_and_lets_go_only_if_it_did():
    shown = opened((1.0, 1.0, 1.0, 1.0, 1.0))
    (event,) = articulations(shown, [])
    close = int(np.flatnonzero(shown.gripper > 0)[0])
    assert event.held == close and event.grips == ((close, "close"),) and not event.opens
    reach, push, *_ = infer_skill(shown).phases
    assert reach.gripper == "close" and is_near(at(0.6, 0.2, 0.1) @ reach.goals[0], shown.path[close])
    assert is_near(push.path[0], shown.path[close]) and push.gripper == "none"
    assert infer_skill(opened((1.0, 1.0, 1.0, -1.0, -1.0))).phases[1].gripper == "open"


def test_a_hand_that_closes_or_opens_in_the_middle_of_a_push_does_so_again():
    shown = opened((-1.0, -1.0, 1.0, -1.0, -1.0), turns=(50, 200))
    phases = [phase for phase in infer_skill(shown).phases if phase.kind in ("reach", "articulate")]
    assert [phase.gripper for phase in phases] == ["none", "close", "open", "none"]
    assert len({phase.name for phase in phases}) == 4
    for phase, following in pairwise(phases):
        assert is_near(phase.path[-1], following.path[0])


def test_a_fist_is_made_before_the_thing_is_reached():
    ways = [hand(0.3, -0.1, 0.2), hand(0.5, 0.2, 0.1), hand(0.5, 0.4, 0.1)]
    moves = [Move(ways[0], 30, 1.0), Move(ways[1], 40, 1.0), Move(ways[2], 40, 1.0)]
    shown = demonstrated(hand(0.3, -0.1, 0.3), moves, {}, **DOOR)
    angle = np.interp(np.arange(len(shown.time)), [len(shown.time) - 50, len(shown.time) - 12], [0.0, 0.6])
    phases = infer_skill(replace(shown, other_joints={"door_hinge": angle})).phases
    assert [(phase.kind, phase.gripper) for phase in phases[:3]] == [
        ("reach", "close"),
        ("reach", "none"),
        ("articulate", "none"),
    ]


@pytest.mark.parametrize("joint, reference", [("door_hinge", "door_main"), ("Door0_latch", "door_main"), ("x", "rug")])
def test_a_joint_belongs_to_what_has_its_name_else_to_what_is_nearest(joint, reference):
    shown = opened((1.0, 1.0, 1.0, 1.0, 1.0))
    angle = shown.other_joints["door_hinge"]
    places = {"door_main": at(0.9, 0.2, 0.1), "rug": Pose.from_position_quaternion([0.5, 0.2, 0.05])}
    (event,) = articulations(replace(shown, other_joints={joint: angle}, fixtures=places), [])
    assert event.reference == reference
