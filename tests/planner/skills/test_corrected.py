"""What a person says of a skill is done, said in the evidence, and refused where it cannot be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.planner.shown_skills import Move, at, demonstrated, hand, is_near, pick_and_place

from onedemo.planner.errors import BadDemonstration, UnknownName
from onedemo.planner.imitation.corrections import Corrections, PhaseCorrection
from onedemo.planner.skills.infer import RISE, infer_skill
from onedemo.planner.skills.skill import SAME, START

GOAL, REST = at(0.5, 0.0, 0.25), at(0.504, 0.0, 0.01)


def shown(**others):
    return pick_and_place(GOAL, REST, plate=at(0.5, 0.0, 0.005), far=at(0.55, 0.0, 0.005), **others)


def said(demonstration, **phases):
    """Skill of a demonstration of which this is said; `reach` and `carry` are of the cube."""
    named = {f"{name} cube": PhaseCorrection(**each) for name, each in phases.items()}
    return infer_skill(replace(demonstration, corrections=Corrections(phases=named)))


def test_another_reference_ends_at_the_same_place():
    demonstration = shown()
    _, found, _ = infer_skill(demonstration).phases
    _, carry, _ = said(demonstration, carry={"reference": "far"}).phases
    assert (found.reference, carry.reference) == ("plate", "far")
    assert carry.touching[0] == "far" and "reference as said" in carry.evidence
    for mine, theirs in zip(carry.goals, found.goals, strict=True):
        assert is_near(at(0.55, 0.0, 0.005) @ mine, at(0.5, 0.0, 0.005) @ theirs)
    assert said(demonstration, carry={"reference": "far"}).choices == ()


def test_an_end_may_be_relative_to_where_it_began():
    _, carry, _ = said(shown(), carry={"reference": "start"}).phases
    assert carry.reference == START
    assert is_near(at(0.4, 0.1, 0.02) @ carry.goals[0], GOAL)


@pytest.mark.parametrize("goal, end", [("release", GOAL), ("rest", at(0.504, 0.0, 0.01 + RISE))])
def test_one_of_two_goals_is_said(goal, end):
    _, carry, _ = said(shown(), carry={"goal": goal}).phases
    (only,) = carry.goals
    assert is_near(at(0.5, 0.0, 0.005) @ only, end)


def test_nothing_else_looks_alike_where_that_is_said():
    reach = infer_skill(shown()).phases[0]
    assert len(reach.left) * len(reach.right) > 1
    reach = said(shown(), reach={"turns": False}).phases[0]
    assert (reach.left, reach.right) == (SAME, SAME)


def test_the_grasp_is_that_of_the_sample_which_is_said():
    demonstration = shown()
    reach, carry, _ = said(demonstration, reach={"grasp": 20}).phases
    there = demonstration.object_paths["cube"][20].inverse() @ demonstration.path[20]
    assert is_near(reach.goals[0], there) and is_near(reach.object_from_tcp, there)
    assert is_near(carry.object_from_tcp, there)
    assert not is_near(there, infer_skill(demonstration).phases[0].goals[0])


@pytest.mark.parametrize("phase", ["reach", "carry"])
def test_reaching_and_carrying_are_left_out_together(phase):
    skill = said(shown(), **{phase: {"skip": True}})
    assert [each.name for each in skill.phases] == ["withdraw"] and skill.choices == ()


def test_the_gripper_does_what_is_said():
    assert said(shown(), carry={"gripper": "none"}).phases[1].gripper == "none"


def pushed(*, commanded: bool):
    door = np.concatenate([np.zeros(45), np.linspace(0.0, 0.8, 31), np.full(12, 0.8)])
    moves = [Move(hand(0.5, 0.0, 0.2), 30), Move(hand(0.5, 0.3, 0.2), 33)]
    demonstration = demonstrated(
        hand(0.3, -0.1, 0.3), moves, {}, fixtures={"latch": at(0.5, 0.0, 0.2)}, joints={"door_hinge": door}
    )
    ahead = demonstration.path.moved(at(0.0, 0.02, 0.0)) if commanded else None
    return replace(demonstration, commanded=ahead)


@pytest.mark.parametrize("path, ahead", [("commanded", 0.02), ("measured", 0.0)])
def test_a_push_follows_the_path_that_is_said(path, ahead):
    demonstration = pushed(commanded=True)
    skill = infer_skill(demonstration)
    name = next(phase.name for phase in skill.phases if phase.kind == "articulate")
    corrections = Corrections(phases={name: PhaseCorrection(path=path)})
    push = next(
        phase
        for phase in infer_skill(replace(demonstration, corrections=corrections)).phases
        if phase.kind == "articulate"
    )
    measured = demonstration.path.positions
    gap = np.linalg.norm(measured - (push.path[len(push.path) // 2].position - [0.0, ahead, 0.0]), axis=1).min()
    assert gap < 1e-9


@pytest.mark.parametrize(
    "phases, words",
    [
        (
            {"carry": {"reference": "tower"}},
            "phases.carry cube.reference: 'tower' is not recorded; there are: plate, far",
        ),
        ({"reach": {"grasp": 10_000}}, "phases.reach cube.grasp: 10000 is no sample: there are 0 to "),
        ({"reach": {"grasp": -1}}, "phases.reach cube.grasp: -1 is no sample: there are 0 to "),
        ({"reach": {"goal": "rest"}}, "phases.reach cube.goal: cannot be said of it, but of carry cube"),
        ({"carry": {"path": "measured"}}, "phases.carry cube.path: cannot be said of any phase here"),
    ],
)
def test_what_cannot_be_done_is_refused_in_one_line(phases, words):
    with pytest.raises(BadDemonstration) as refused:
        said(shown(), **phases)
    assert words in str(refused.value) and "\n" not in str(refused.value)


def test_a_goal_of_what_stays_in_the_hand_is_refused():
    moves = [Move(hand(0.4, 0.1, 0.02), 40, 1.0), Move(hand(0.4, 0.1, 0.2), 20, 1.0)]
    lifted = demonstrated(hand(0.3, -0.1, 0.3), moves, {"cube": at(0.4, 0.1, 0.02)}, held={1: "cube"})
    with pytest.raises(BadDemonstration, match="cube stays in the hand: it has one end"):
        said(lifted, carry={"goal": "rest"})


def test_a_path_that_was_not_recorded_is_refused():
    demonstration = pushed(commanded=False)
    name = next(phase.name for phase in infer_skill(demonstration).phases if phase.kind == "articulate")
    corrections = Corrections(phases={name: PhaseCorrection(path="commanded")}, source="mine.skill.yaml")
    with pytest.raises(BadDemonstration, match=r"^mine\.skill\.yaml: .*what was commanded is not recorded"):
        infer_skill(replace(demonstration, corrections=corrections))


def test_a_phase_that_is_not_there_is_named_with_those_that_are():
    corrections = Corrections(phases={"carry cup": PhaseCorrection(skip=True)})
    with pytest.raises(UnknownName, match="'carry cup'; known: reach cube, carry cube, withdraw"):
        infer_skill(replace(shown(), corrections=corrections))
