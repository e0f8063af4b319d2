"""The oracle of what is possible, on motions whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from onedemo.bench.geometric.oracle import (
    IMPOSSIBLE,
    POSSIBLE,
    STEPS,
    Question,
    _is_connected,
    arm_verdict,
    deviations,
    tool_verdict,
)
from onedemo.bench.geometric.parts import holding, part_named, robot
from onedemo.planner import Obstacle, Pose, Sphere
from onedemo.planner.imitation.kept_components import found_constraint

PART = "pour carry"


def question(goal: Pose, *obstacles: Obstacle) -> Question:
    """The demonstrated pour from its own start to a goal."""
    part = part_named(PART)
    return Question(robot().arm, holding(PART), obstacles, part.shown, found_constraint(part.shown), part.joints, goal)


def ball(place, radius: float) -> Obstacle:
    return Obstacle(Sphere(radius), Pose.from_position_quaternion(place, [1.0, 0.0, 0.0, 0.0]), name="ball")


def test_the_demonstrated_pour_is_possible_for_tool_and_arm():
    asked = question(part_named(PART).shown[-1])
    assert tool_verdict(asked).answer == POSSIBLE and arm_verdict(asked, tries=1).answer == POSSIBLE


def test_a_pour_out_of_reach_is_impossible_for_the_arm_alone():
    far = Pose.from_position_quaternion([1.5, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]) @ part_named(PART).shown[-1]
    asked = question(far)
    assert tool_verdict(asked).answer == POSSIBLE and arm_verdict(asked, tries=1).answer == IMPOSSIBLE


def test_a_pour_through_a_ball_is_impossible_and_one_around_it_possible():
    shown = part_named(PART).shown
    constraint = found_constraint(shown)
    inside = question(shown[-1], ball(shown[(constraint.guided + len(shown)) // 2].position, 0.05))
    assert tool_verdict(inside).answer == IMPOSSIBLE
    aside = question(shown[-1], ball(shown[constraint.guided // 2].position - np.array([0.0, 0.0, 0.3]), 0.03))
    assert tool_verdict(aside).answer == POSSIBLE


def test_deviations_are_within_the_bounds_and_reach_them():
    asked = question(part_named(PART).shown[-1])
    pose, constraint = asked.goal, asked.constraint
    off = np.array([pose.distance_to(each) for each in deviations(constraint, pose)])
    assert len(off) == len(STEPS) == 729
    assert off[:, 0].max() == pytest.approx(constraint.position_bound, rel=1e-6)
    assert off[:, 1].max() == pytest.approx(constraint.rotation_bound, rel=1e-6)
    np.testing.assert_allclose(off[0], 0.0, atol=1e-9)


def test_a_chain_needs_neighbors():
    own, low, high = (np.zeros((3,) * 6, dtype=bool) for _ in range(3))
    own[(1,) * 6], low[(0,) * 6], high[(2,) * 6] = True, True, True
    assert _is_connected([own, low, own]) and not _is_connected([low, high, own])
    assert not _is_connected([own, low])
