"""Skills whose demonstrations name their segments: what of them becomes which phase."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.planner.shown_skills import at, hand, is_near, pick_and_place

from onedemo.planner.geometry.pose import Pose
from onedemo.planner.imitation.demonstration import Segment
from onedemo.planner.skills.alike import turned_like
from onedemo.planner.skills.segments import RIM, ROUND, Moved, anchored, lip_of, phases_of
from onedemo.planner.skills.skill import (
    DEMONSTRATED,
    OTHERS,
    PREVIOUS,
    TASK_GOAL,
    THING,
    SegmentedSkill,
    SegmentMeaning,
)

CUBE = np.array([0.04, 0.04, 0.04])
TOUCH = (("fingers", THING), ("held", PREVIOUS), ("hand", OTHERS), ("held", "table"))
REACH = SegmentMeaning("fetch", "reach", THING, TOUCH, gripper="close", turns="thing")
PLACE = SegmentMeaning("place", "carry", TASK_GOAL, gripper=DEMONSTRATED, turns="thing", before="over")
SKILL = SegmentedSkill((REACH, SegmentMeaning("up", "lift", optional=True, rise=0.1), PLACE), each=True)


def shown(*left_out: str):
    """A cube is fetched, carried and placed; its motions have names."""
    recorded = pick_and_place(at(0.5, -0.1, 0.02))
    cube = Pose(recorded.object_paths["cube"].dqs[0])
    segments = (
        Segment("fetch", 0, 40, "cube", cube, gripper="close"),
        Segment("over", 53, 102, held="cube"),
        Segment("place", 103, 122, held="cube", gripper="open"),
    )
    return replace(recorded, segments=tuple(each for each in segments if each.name not in left_out))


def moved(name="block1", size=CUBE, previous="block0"):
    return Moved(name, size, (0.0, np.pi), previous, ("block0", "block2"))


def test_what_a_demonstration_must_have_comes_from_the_parts():
    assert SKILL.required == ("fetch", "over", "place")
    assert SKILL.releases == ("place",) and SKILL.sized == ()
    assert SegmentedSkill((PLACE._replace(sized=("cup", "bowl")), REACH)).sized == ("cup", "bowl")


def test_phases_are_those_of_the_thing_at_hand():
    reach, lift, place = phases_of(SKILL, shown(), moved(), 0.02)
    assert [each.name for each in (reach, lift, place)] == ["fetch block1", "up block1", "place block1"]
    assert reach.reference == reach.thing == "block1" and place.reference == TASK_GOAL
    pairs = (("fingers", "block1"), ("held", "block0"), ("hand", "block0"), ("hand", "block2"), ("held", "table"))
    assert reach.touch == pairs
    (first, *_) = phases_of(SKILL, shown(), moved(previous=""), 0.02)
    assert ("held", "") not in first.touch and len(first.touch) == 4
    assert len(reach.left) == len(place.right) == 2 and len(reach.right) == len(place.left) == 1
    assert place.before is not None and is_near(place.before[0], shown().path[53])


def test_the_hand_opens_as_the_recorded_one_after_the_segment():
    recorded = shown()
    gripper = recorded.gripper.copy()
    gripper[123:] = -0.3
    *_, place = phases_of(SKILL, replace(recorded, gripper=gripper), moved(), 0.02)
    assert (place.gripper, place.opening) == ("open", -0.3)


def test_a_lift_that_was_not_shown_is_straight_up():
    _, lift, _ = phases_of(SKILL, shown(), moved(), 0.02)
    assert lift.rise == 0.1


@pytest.mark.parametrize(
    "size, turn", [((0.04, 0.04, 0.04), 0.0), ((0.04, 0.06, 0.05), 0.0), ((0.06, 0.04, 0.05), 0.5)]
)
def test_fingers_close_across_the_narrower_side(size, turn):
    reach, *_ = phases_of(SKILL, shown(), moved(size=np.array(size)), 0.02)
    as_shown = at(0.4, 0.1, 0.02).inverse() @ hand(0.4, 0.1, 0.02)
    assert is_near(reach.goals[0], Pose.from_yaw([0, 0, 0], turn * np.pi) @ as_shown)


def test_the_lip_is_the_lowest_point_of_the_rim():
    size, tilted = np.array([0.06, 0.06, 0.1]), Pose.from_position_quaternion([0, 0, 0], [0.6, 0.8, 0.0, 0.0])
    lip = lip_of(tilted)
    around = [np.array([np.cos(a), np.sin(a), 1.0]) * 0.5 * size for a in np.linspace(0, 2 * np.pi, 181)]
    lowest = min(around, key=lambda point: (tilted @ Pose.from_position_quaternion(point)).position[2])
    np.testing.assert_allclose(anchored(lip, size).position, lowest, atol=1e-9)
    np.testing.assert_allclose(anchored(RIM, size).position, [0, 0, 0.05])


def test_the_yaw_of_a_round_thing_means_nothing():
    held = hand(0.0, 0.02, 0.1).inverse()
    assert is_near(turned_like(held @ Pose.from_yaw([0, 0, 0], 1.0), held), held)
    assert ROUND[0] == 0.0 and len(ROUND) == 13
