"""Level T: motions in another frame of the hand. Screws do not notice, and nothing else of a motion does."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.policies import PROGRAMS, installed
from helpers.random_scenes import at, demonstrated, judged, panda, problem

from onedemo.baselines.factory import make_policy, settings_of
from onedemo.baselines.motion.tool_frame import ToolFrameMotion, seen_from
from onedemo.bench.geometric.metrics import curve_gap
from onedemo.configs.errors import BadConfig
from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.imitation.tsia import screw_path
from onedemo.planner.reactive.command import DONE

TOOL = Pose.from_yaw([0.1, 0.0, 0.0], np.pi / 2)
PLACE = at([0.05, 0.3, 1.0]) @ at([0, 0, 0], demonstrated()[-1].quaternion)
TURN = at([0.0, 0.0, 0.0], [np.cos(0.4), np.sin(0.4), 0.0, 0.0])
UNHURRIED = {"controller": {"max_linear": 50.0, "max_angular": 50.0}}
"""No limit of the tcp's speed, which is another at another point of the hand."""


def planned(name, tool=None, motion=None, goal=PLACE, **asked):
    arm, body, home = panda()
    settings = settings_of(name, {"motion": motion or {}})
    motion_method = settings.motion_method if tool is None else ToolFrameMotion(settings.motion_method, tool)
    return motion_method.planner(arm, body, settings.plan).plan(demonstrated(), home, goal, **asked)


def way_of(plan) -> PosePath:
    arm, _, _ = panda()
    return PosePath(np.array([arm.fk(q).dq for q in plan.joints]))


@pytest.mark.parametrize("name", installed(*PROGRAMS))
def test_what_is_asked_and_answered_is_of_the_true_tcp(name):
    arm, body, home = panda()
    plan = planned(name, TOOL)
    assert plan.success and plan.arm is arm and plan.body is body
    np.testing.assert_array_equal(plan.joints[0], home)
    end = arm.fk(plan.joints[-1])
    assert end.distance_to(PLACE)[0] < 3e-3 and end.distance_to(PLACE)[1] < 0.02
    for pose in (plan.path[-1], plan.imitated[-1], plan.request.goal):
        assert pose.distance_to(PLACE)[0] < 1e-3 and pose.distance_to(PLACE)[1] < 1e-3
    shown = plan.request.demonstrated
    assert max(np.array([a.distance_to(b) for a, b in zip(shown, demonstrated(), strict=True)]).ravel()) < 1e-7


def test_the_pull_along_a_screw_is_the_same_motion_and_what_is_no_screw_is_not():
    """Where nothing is measured in lengths at the tcp: the guiding pose is the last, and nothing is capped."""
    goal = PLACE @ TURN
    motion = {"guide": 1.0, "max_guide": 1.0, **UNHURRIED}
    for name in ("screw", "tsia"):
        one, other = planned(name, None, motion, goal), planned(name, TOOL, motion, goal)
        count = min(len(one.joints), len(other.joints))
        assert one.success and other.success and count > 20
        np.testing.assert_allclose(other.joints[:count], one.joints[:count], rtol=0.0, atol=1e-12)
    one, other = planned("decoupled", None, motion, goal), planned("decoupled", TOOL, motion, goal)
    assert one.success and other.success
    assert curve_gap(way_of(other), way_of(one)) > 0.01


def test_with_all_limits_the_screws_way_changes_by_a_hair_and_that_of_the_others_does_not():
    """The tool's speed, and the reach at which the next pose is aimed at, are lengths at the tcp."""
    gaps, last = {}, {"guide": 1.0, "max_guide": 1.0}
    for name in ("screw", "decoupled", "replay"):
        one, other = (way_of(planned(name, tool, last, PLACE @ TURN)) for tool in (None, TOOL))
        gaps[name] = max(curve_gap(one, other), curve_gap(other, one))
    assert gaps["screw"] < 0.001 < 0.008 < min(gaps["decoupled"], gaps["replay"])


@pytest.mark.parametrize("kind, seed", [("convex", 3), ("clutter", 1), ("held", 4)])
def test_ways_round_obstacles_are_clear_for_an_independent_judge(kind, seed):
    scene, settings = problem(kind, seed), settings_of("screw")
    arm, _, _ = panda()
    planner = ToolFrameMotion(settings.motion_method, TOOL).planner(arm, scene.body, settings.plan)
    plan = planner.plan(demonstrated(), scene.start, scene.goal, scene.obstacles)
    assert plan.success, plan.why
    assert plan.tree is None
    certificate = judged(scene, plan)
    assert certificate.ok, certificate.reasons


def test_a_plan_seen_from_elsewhere_and_back_is_the_plan():
    arm, _, _ = panda()
    plan = planned("replay")
    again = seen_from(seen_from(plan, arm.with_tool(TOOL), TOOL), arm, TOOL.inverse())
    np.testing.assert_allclose(again.path_poses, plan.path_poses, atol=1e-12)
    np.testing.assert_allclose(again.imitated_poses, plan.imitated_poses, atol=1e-12)
    assert again.request.goal.distance_to(plan.request.goal)[0] < 1e-12


def followed(name, go, tool=TOOL):
    """Joints (t, dof) of a motion that is followed."""
    arm, body, home = panda()
    settings = settings_of(name, {})
    follower = ToolFrameMotion(settings.motion_method, tool).follower(arm, body, settings.reactive)
    follower.see(())
    go(follower)
    joints = [home]
    for _ in range(1500):
        command = follower.step(joints[-1])
        if command.state == DONE:
            break
        joints.append(joints[-1] + settings.motion.dt * command.velocity)
    return np.array(joints)


@pytest.mark.parametrize("name", installed("screw", "decoupled", "dmp-goal", "rrt"))
def test_a_path_is_followed_to_its_end_by_the_true_tcp(name):
    arm, _, home = panda()
    path = screw_path(arm.fk(home), at([0.0, 0.15, 0.05]) @ arm.fk(home) @ TURN, 0.005)
    joints = followed(name, lambda follower: follower.go(path))
    distance, angle = arm.fk(joints[-1]).distance_to(path[-1])
    assert distance < 3e-3 and angle < 0.02


def test_a_plan_of_a_maker_is_followed_as_it_was_planned():
    arm, _, _ = panda()
    plan = planned("replay", TOOL)
    joints = followed("replay", lambda follower: follower.follow(plan))
    assert arm.fk(joints[-1]).distance_to(PLACE)[0] < 3e-3
    way = PosePath(np.array([arm.fk(q).dq for q in joints]))
    assert curve_gap(way, way_of(plan)) < 1e-3


def test_the_way_of_two_hands_is_made_in_the_other_frame():
    about_y = at([0.0, 0.0, 0.0], [np.cos(0.4), 0.0, np.sin(0.4), 0.0])
    shown, start = demonstrated(), at([-0.2, 0.1, 0.1]) @ demonstrated()[0] @ TURN @ TURN @ about_y
    for name, same in (("screw", True), ("decoupled", False)):
        motion_method = settings_of(name).motion_method
        one, other = motion_method.relative(shown, start), ToolFrameMotion(motion_method, TOOL).relative(shown, start)
        for pose, wanted in ((other.path[0], start), (other.path[-1], shown[-1])):
            assert pose.distance_to(wanted)[0] < 1e-12
        assert (curve_gap(other.path, one.path) < 1e-9) == same


def test_your_own_policy_has_no_legs_to_be_moved_otherwise():
    with pytest.raises(BadConfig, match=r"my\.mod:Mine: moves the hand itself"):
        make_policy("my.mod:Mine", None, None, tool=TOOL)
