"""Skills of demonstrations in which the truth is known: what refers to what, in which order, what is left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.planner.shown_skills import Move, at, box, can, demonstrated, hand, is_near, pick_and_place
from helpers.strategies import for_all, st

from onedemo.planner.errors import BadDemonstration
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import Box, Obstacle
from onedemo.planner.skills.infer import RISE, infer_skill
from onedemo.planner.skills.skill import START
from onedemo.planner.skills.thing import Thing

TABLE = Thing("table", (Obstacle(Box((2.0, 2.0, 0.05)), Pose.from_position_quaternion([0, 0, -0.025])),), free=False)
CUBE = box("cube", 0.04, 0.04, 0.04)


@for_all(st.floats(-0.2, 0.2), st.floats(-0.3, 0.3), st.floats(-3.0, 3.0), max_examples=15)
def test_what_is_put_on_a_thing_refers_to_it_and_not_to_the_table(x, y, yaw):
    plate = at(0.5 + x, y, 0.005, yaw)
    shown = pick_and_place(at(0.5 + x, y, 0.03, 0.3), plate=plate)
    things = {"cube": CUBE, "plate": box("plate", 0.1, 0.1, 0.01), "table": TABLE}
    reach, carry, withdraw = infer_skill(replace(shown, fixtures={"table": Pose.identity()}), things).phases
    assert (reach.kind, carry.kind, withdraw.kind) == ("reach", "carry", "withdraw")
    assert carry.reference == "plate" and carry.touching == ("plate",)
    assert is_near(plate @ carry.goals[0], at(0.5 + x, y, 0.03 + RISE, 0.3))
    assert is_near(reach.goals[0], hand(0, 0, 0)) and reach.gripper == "close" and carry.gripper == "open"


def test_without_shapes_it_refers_to_what_is_nearest_and_says_so():
    shown = pick_and_place(at(0.5, 0.0, 0.03), plate=at(0.5, 0.0, 0.005), far=at(0.62, 0.0, 0.005))
    skill = infer_skill(shown)
    carry = skill.phases[1]
    assert carry.reference == "plate" and "shapes are unknown" in carry.evidence[0]
    (choice,) = skill.choices
    assert choice.what == "reference" and choice.others == ("far",)


def test_a_large_thing_is_not_the_reference_where_a_small_one_is_touched_too():
    peg = Thing("peg", (Obstacle(Box((0.03, 0.03, 0.2)), Pose.from_position_quaternion([0, 0, 0.1])),), free=False)
    sides = [(0.03, 0, 0.02, 0.08), (-0.03, 0, 0.02, 0.08), (0, 0.03, 0.04, 0.02), (0, -0.03, 0.04, 0.02)]
    ring = Thing(
        "cube",
        tuple(Obstacle(Box((w, d, 0.02)), Pose.from_position_quaternion([x, y, 0])) for x, y, w, d in sides),
    )
    shown = pick_and_place(at(0.5, 0.0, 0.25), at(0.504, 0.0, 0.01))
    shown = replace(shown, fixtures={"table": Pose.identity(), "peg": at(0.5, 0, 0)})
    carry = infer_skill(shown, {"cube": ring, "peg": peg, "table": TABLE}).phases[1]
    assert carry.reference == "peg" and set(carry.touching) == {"peg", "table"}
    assert is_near(at(0.5, 0, 0) @ carry.goals[0], at(0.5, 0.0, 0.25))  # it falls: released as shown
    assert is_near(at(0.5, 0, 0) @ carry.goals[1], at(0.504, 0.0, 0.01 + RISE))
    assert len(carry.left) == 4


def test_what_stays_in_the_hand_is_lifted_from_where_it_was():
    moves = [Move(hand(0.4, 0.1, 0.02), 40, 1.0), Move(hand(0.4, 0.1, 0.2), 20, 1.0)]
    shown = demonstrated(hand(0.3, -0.1, 0.3), moves, {"cube": at(0.4, 0.1, 0.02)}, held={1: "cube"})
    reach, carry = infer_skill(shown, {"cube": CUBE}).phases
    assert carry.reference == START and carry.gripper == "none"
    assert is_near(carry.goals[0], at(0, 0, 0.18))
    assert len(reach.left) == 4 and len(reach.right) == 2


def test_two_objects_are_two_times_two_phases_in_the_order_shown():
    first, second = at(0.4, 0.1, 0.02), at(0.4, -0.2, 0.05)
    moves = [
        Move(hand(0.4, 0.1, 0.02), 40, 1.0),
        Move(hand(0.5, 0.1, 0.2), 20, 1.0, 0),
        Move(hand(0.6, 0.1, 0.02), 20, -1.0),
        Move(hand(0.4, -0.2, 0.05), 40, 1.0),
        Move(hand(0.5, 0.0, 0.2), 20, 1.0, 0),
        Move(hand(0.6, 0.1, 0.09), 20, -1.0),
    ]
    held = {1: "cube", 2: "cube", 4: "can", 5: "can"}
    shown = demonstrated(hand(0.3, -0.1, 0.3), moves, {"cube": first, "can": second}, held=held)
    shown = replace(shown, fixtures={"table": Pose.identity()})
    things = {"cube": CUBE, "can": can("can", 0.03, 0.1), "table": TABLE}
    skill = infer_skill(shown, things)
    assert [phase.thing for phase in skill.phases] == ["cube", "cube", "can", "can"]
    assert [phase.reference for phase in skill.phases] == ["cube", "table", "can", "cube"]
    assert skill.things == ("cube", "table", "can")
    assert len({phase.name for phase in skill.phases}) == 4


def test_fingers_are_no_hinges():
    shown = pick_and_place(at(0.5, 0.0, 0.02))
    fingers = np.linspace(0.0, 0.04, len(shown.time))
    plain, more = infer_skill(shown), infer_skill(replace(shown, other_joints={"gripper0_finger_joint1": fingers}))
    assert [phase.name for phase in plain.phases] == [phase.name for phase in more.phases]


@pytest.mark.parametrize(
    "change, words",
    [
        ({"gripper": None}, "gripper"),
        ({"object_paths": {}}, "object_paths"),
        ({"gripper": "never"}, "the hand never closes"),
        ({"object_paths": "still"}, "none was carried: the hand closes 1 times"),
    ],
)
def test_a_skill_that_cannot_be_found_says_what_is_missing(change, words):
    shown = pick_and_place(at(0.5, 0.0, 0.02))
    if change.get("gripper") == "never":
        change = {"gripper": -np.ones(len(shown.time))}
    if change.get("object_paths") == "still":
        path = shown.object_paths["cube"]
        change = {"object_paths": {"cube": path.__class__(np.repeat(path.dqs[:1], len(path), axis=0))}}
    with pytest.raises(BadDemonstration) as caught:
        infer_skill(replace(shown, **change))
    assert words in str(caught.value) and "\n" not in str(caught.value)


@for_all(st.floats(-3.0, 3.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(0.0, 0.5), max_examples=10)
def test_the_skill_does_not_depend_on_the_frame_of_the_world(yaw, x, y, z):
    """Turned about the vertical and shifted, everything that is relative stays as it is."""
    world = Pose.from_yaw([x, y, z], yaw)
    shown = replace(pick_and_place(at(0.5, 0.0, 0.03), plate=at(0.5, 0, 0.005)), fixtures={"table": Pose.identity()})
    things = {"cube": CUBE, "plate": box("plate", 0.1, 0.1, 0.01), "table": TABLE}
    moved = replace(
        shown,
        path=shown.path.moved(world),
        object_paths={name: path.moved(world) for name, path in shown.object_paths.items()},
        fixtures={name: world @ pose for name, pose in shown.fixtures.items()},
    )
    for one, other in zip(infer_skill(shown, things).phases, infer_skill(moved, things).phases, strict=True):
        assert (one.name, one.reference, one.touching) == (other.name, other.reference, other.touching)
        assert all(is_near(a, b) for a, b in zip(one.goals, other.goals, strict=True))
        assert len(one.left) == len(other.left) and len(one.right) == len(other.right)


@pytest.mark.parametrize("way, pressed, slides", [(0.12, 0.0015, True), (0.03, 0.0, False)])
def test_what_slides_on_its_support_is_put_down_where_that_begins_and_then_follows_what_was_commanded(
    way, pressed, slides
):
    cube, board = at(0.4, 0.1, 0.02), at(0.5, -0.1, 0.005)
    grasp, raised = hand(0.4, 0.1, 0.02), hand(0.4, 0.1, 0.15)
    begins, ends = (hand(0.5, -0.1 + y, 0.03) for y in (-0.5 * way, 0.5 * way))
    over = Pose.from_position_quaternion([0, 0, 0.1]) @ begins
    moves = [Move(grasp, 40, 1.0), Move(raised, 20, 1.0, 0), Move(over, 30, 1.0, 0), Move(begins, 20, 1.0, 0)]
    moves += [Move(ends, 30, -1.0), Move(Pose.from_position_quaternion([0, 0, 0.1]) @ ends, 20)]
    held = dict.fromkeys(range(1, 5), "cube")
    shown = demonstrated(hand(0.3, -0.1, 0.3), moves, {"cube": cube}, held=held, fixtures={"board": board})
    shown = replace(shown, commanded=shown.path.moved(Pose.from_position_quaternion([0, 0, -pressed])))
    phases = infer_skill(shown, {"cube": CUBE, "board": box("board", 0.2, 0.3, 0.01, free=False)}).phases
    assert [phase.kind for phase in phases] == ["reach", "carry", *(["slide"] if slides else []), "withdraw"]
    carry, last = phases[1], phases[-2]
    if slides:
        assert carry.gripper == "none" and last.gripper == "open" and last.exact
        assert abs((board @ carry.goals[0]).position[1] - (-0.1 - 0.5 * way)) < 0.01
        assert is_near(board @ last.goals[0], at(0.5, -0.1 + 0.5 * way, 0.03 - pressed), 1e-4, 1e-3)
