"""Wanted contacts are for the ends of a motion: no way through joint space, and no detour, leads through the thing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.random_scenes import SETTINGS, at, ball_at, blocked, demonstrated, everywhere, panda, planner_of

from onedemo.planner.collision.clearance import slack_at
from onedemo.planner.control.arm_arrays import arm_arrays
from onedemo.planner.imitation.tsia import screw_path
from onedemo.planner.judge.certify import certify
from onedemo.planner.planning.joint_space_motion import JointSpaceMotion, plan_joint_space
from onedemo.planner.planning.plan import Plan
from onedemo.planner.planning.planning_scene import CONTACT_ROOM, PlanningScene
from onedemo.planner.resumable import finished

ARM, BODY, _ = panda()


def gap(plan: Plan) -> float:
    """Distance [m] from the ball that the independent judge certifies, contacts not exempt."""
    return certify(replace(plan.log(), allowed=(), safety=0.0)).clearance


def test_a_way_to_joints_keeps_clear_of_what_it_may_touch_at_its_ends():
    start, goal, ball = blocked()
    plan = planner_of().plan(demonstrated(), start, goal, [ball], allowed=everywhere(ball))
    assert plan.success and gap(plan) >= SETTINGS.safety.distance - 1e-6


@pytest.mark.parametrize("seed", range(3))
def test_the_way_to_an_imitated_path_keeps_clear_of_it_too(seed):
    """Only along the path itself, which shows the contact, is it exempt."""
    start, goal, ball = blocked()
    pose, scene = ARM.fk(goal), PlanningScene.of(ARM, BODY, [ball], SETTINGS, everywhere(ball))
    motion = SETTINGS.motion
    work = arm_arrays(ARM, motion.controller.packed(), motion.pursuit.packed())
    path = screw_path(at([0.0, 0.0, 0.1]) @ pose, pose, 0.01)
    found = finished(plan_joint_space(ARM, scene, work, path, pose, start, SETTINGS, None, seed))
    assert isinstance(found, JointSpaceMotion)
    joined = next(k for k, q in enumerate(found.joints) if ARM.fk(q).distance_to(found.path[0])[0] < 0.002)
    strict = PlanningScene.of(ARM, BODY, [ball], SETTINGS)
    assert joined > 20 and min(strict.slack(q) for q in found.joints[:joined]) >= -1e-6


@pytest.mark.parametrize("near", [0.002, 0.0, -0.003])
def test_a_contact_at_the_goal_is_reached_and_nowhere_deeper(near):
    """By no more than the room in which edges are proven."""
    start, goal, _ = blocked()
    tool, probe = ARM.fk(goal), None
    low, high = 0.0, 0.3  # along z the ball comes as near to the fingers as wanted
    for _ in range(60):
        depth = 0.5 * (low + high)
        probe = ball_at(tool.position + tool.rotation @ [0.0, 0.0, depth])
        scene = PlanningScene.of(ARM, BODY, [probe], replace(SETTINGS, safety=replace(SETTINGS.safety, distance=0.0)))
        low, high = (depth, high) if scene.slack(goal) < near else (low, depth)
    refused = planner_of().plan(demonstrated(), start, goal, [probe])
    assert refused.reason == "goal in collision"
    plan = planner_of().plan(demonstrated(), start, goal, [probe], allowed=everywhere(probe))
    assert plan.success, plan.why
    np.testing.assert_array_equal(plan.joints[-1], goal)
    if plan.how == "joint search":
        scene = PlanningScene.of(ARM, BODY, [probe], replace(SETTINGS, safety=replace(SETTINGS.safety, distance=0.0)))
        assert min(scene.slack(row) for row in plan.joints) >= near - CONTACT_ROOM - 1e-6


def test_without_wanted_contacts_nothing_is_laid_out_anew():
    start, goal, ball = blocked()
    scene = PlanningScene.of(ARM, BODY, [ball], SETTINGS)
    assert scene.with_contacts_as_at(start, goal) is scene.seen


def test_a_detour_through_the_thing_is_told_from_one_round_it():
    start, goal, ball = blocked()
    scene = PlanningScene.of(ARM, BODY, [ball], SETTINGS, everywhere(ball))
    through = np.linspace(start, goal, 60)
    assert scene.slack(through[30]) > 0.0, "exempt altogether"
    assert not scene.keeps_contacts(through)
    plan = planner_of().plan(demonstrated(), start, goal, [ball])
    assert plan.success and scene.keeps_contacts(plan.joints)
    assert scene.keeps_contacts(through[:5])
    open_scene = PlanningScene.of(ARM, BODY, [ball], replace(SETTINGS, guard=False), everywhere(ball))
    assert open_scene.keeps_contacts(through), "without a guard obstacles are ignored"


def test_others_keep_their_distance_while_one_part_may_touch():
    """Who may touch is the hand alone: the same ball at the forearm is an obstacle."""
    start, goal, ball = blocked()
    scene = PlanningScene.of(ARM, BODY, [ball], SETTINGS, (("hand", "ball"),))
    seen = scene.with_contacts_as_at(start, goal)
    assert seen is not scene.seen
    strict = PlanningScene.of(ARM, BODY, [ball], SETTINGS)

    for q in np.linspace(start, goal, 30):
        assert slack_at(seen, q, 0.0, 1.0) == pytest.approx(strict.slack(q), abs=1e-9), "both ends are clear"
