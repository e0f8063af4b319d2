"""Plans to given joints: met exactly, judged, and refused for a reason."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers.arms import READY, random_arm
from helpers.random_scenes import SOLVABLE, at, demonstrated, panda, planner_of, problem
from helpers.strategies import for_all, st

from onedemo.planner.errors import BadShape, NotFinite, PlanFailed
from onedemo.planner.escape.repet import escape_path, point_tool
from onedemo.planner.geometry.pose import PosePath
from onedemo.planner.geometry.shapes import Obstacle, Sphere
from onedemo.planner.judge.certify import certify
from onedemo.planner.planning.joint_goal import MOST_POSES, tool_path
from onedemo.planner.planning.plan import Plan
from onedemo.planner.planning.planner import Planner
from onedemo.planner.planning.planning_scene import PlanningScene
from onedemo.planner.planning.refine import scene_of, smoothed, timed
from onedemo.planner.planning.settings import JointSearchSettings, PlanSettings
from onedemo.planner.resumable import finished
from onedemo.planner.robot.arm import Arm
from onedemo.planner.robot.body import BODY, Body
from onedemo.planner.robot.joint_frames import joint_frames, moved
from onedemo.planner.search.joint_paths import JointPaths
from onedemo.planner.search.joint_space_rrt import joint_edge_is_clear, sample_range

ENOUGH = 0.9
"""Share of random scenes that is solved: of some no other posture than the given one can be left."""


def planned(scene, goal=None, **options) -> Plan:
    goal = scene.posture if goal is None else goal
    planner = planner_of() if scene.body is panda()[1] else Planner(panda()[0], scene.body)
    return planner.plan(demonstrated(), scene.start, goal, scene.obstacles, **options)


def lonely(arm: Arm, *places) -> tuple[Planner, PlanningScene]:
    """An arm without a body."""
    body = Body(np.zeros((0, 8)), ())
    return Planner(arm, body), PlanningScene.of(arm, body, places, PlanSettings())


@pytest.mark.parametrize("kind", SOLVABLE)
def test_plans_end_at_the_joints_and_no_success_is_unsound(kind):
    solved, seeds = 0, range(6)
    for seed in seeds:
        scene = problem(kind, seed)
        plan = planned(scene)
        np.testing.assert_array_equal(plan.joints[0], scene.start)
        if not plan.success:
            assert plan.reason == "no path to the goal joints" and "searches" in plan.detail
            continue
        solved += 1
        np.testing.assert_array_equal(plan.joints[-1], scene.posture)
        certificate = certify(plan.log())
        assert certificate.ok, certificate.reasons
        assert certificate.position_error < 1e-9 and certificate.joint_margin == pytest.approx(plan.margin, abs=1e-12)
        work = scene_of(plan).seen
        assert all(joint_edge_is_clear(work, *pair) for pair in zip(plan.joints[:-1], plan.joints[1:], strict=True))
    assert solved >= ENOUGH * len(seeds)


def test_where_the_demonstration_ends_at_the_joints_it_is_followed():
    scene = problem("convex", 1)._replace(obstacles=())
    free = planned(scene, scene.goal)
    assert free.how == "direct"
    plan = planned(scene, free.joints[-1])
    assert plan.how == "direct" and plan.imitated_share == 1.0
    np.testing.assert_array_equal(plan.joints[-1], free.joints[-1])
    elsewhere = free.joints[-1] + 0.3 * np.sign(-free.joints[-1])
    assert planned(scene, elsewhere).how == "joint search"


def test_the_same_seed_gives_the_same_plan_and_another_seed_another():
    scene = problem("gap", 0)
    one, same, other = (planned(scene, seed=seed) for seed in (3, 3, 4))
    assert one.success and one.how == "joint search"
    np.testing.assert_array_equal(one.joints, same.joints)
    assert one.joints.shape != other.joints.shape or not np.array_equal(one.joints, other.joints)


@pytest.mark.parametrize("seed", [np.int8(3), np.uint8(3), np.int16(3), np.int8(-128)], ids=repr)
def test_a_seed_may_be_any_kind_of_whole_number(seed):
    scene = problem("gap", 0)
    one, same = (planned(scene, seed=each) for each in (seed, int(seed)))
    np.testing.assert_array_equal(one.joints, same.joints)
    path, tool = demonstrated(), point_tool(0.05)
    one, same = (escape_path(path, tool, scene.obstacles, seed=each).path for each in (seed, int(seed)))
    np.testing.assert_array_equal(one.dqs, same.dqs)


def test_a_refined_plan_still_ends_at_the_joints():
    plan = planned(problem("convex", 2))
    refined = timed(plan)
    np.testing.assert_allclose(refined.joints[-1], plan.joints[-1], rtol=0.0, atol=1e-9)
    assert certify(refined.log()).ok
    direct = planned(problem("convex", 1)._replace(obstacles=()), plan.joints[0])
    with pytest.raises(PlanFailed, match=r"given joints|joint space"):
        smoothed(direct)


# Refusals


@for_all(st.integers(0, 6), st.sampled_from([-1.0, 1.0]), st.floats(1e-5, 3.0), max_examples=20)
def test_a_goal_beyond_a_limit_is_refused_by_the_joint(joint, side, far):
    arm, scene = panda()[0], problem("convex", 0)
    goal = scene.posture.copy()
    goal[joint] = (arm.upper if side > 0 else arm.lower)[joint] + side * far
    plan = planned(scene, goal)
    assert plan.reason == "goal beyond a joint limit" and arm.joint_names[joint] in plan.detail
    assert len(plan.joints) == 1


def test_a_goal_at_which_any_part_of_the_arm_is_in_collision_is_refused_by_the_part():
    """Of a pose only the tool can be asked."""
    arm, body, home = panda()
    goal = home + np.array([1.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    wrist = next(row for name, row in zip(body.names, body.rows, strict=True) if name == "link6")
    place = moved(joint_frames(arm, goal)[int(wrist[BODY.frame])], wrist[BODY.a : BODY.b])
    ball = Obstacle(Sphere(0.01), at(place), name="ball")
    plan = planner_of().plan(demonstrated(), home, goal, [ball])
    assert plan.reason == "goal in collision" and "link" in plan.detail and "ball" in plan.detail


@pytest.mark.parametrize(
    "goal, error, words",
    [
        (np.zeros(6), BadShape, r"goal has shape \(6,\); expected a Pose, or joints \(7,\)"),
        (np.zeros((1, 7)), BadShape, "goal has shape"),
        (0.5, BadShape, r"goal has shape \(\)"),
        (np.full(7, np.nan), NotFinite, "goal holds a value that is not finite at index 0"),
        ([0.0] * 6 + [math.inf], NotFinite, "at index 6"),
    ],
)
def test_what_is_neither_pose_nor_joints_is_refused(goal, error, words):
    with pytest.raises(error, match=words):
        planner_of().plan(demonstrated(), READY, goal)


def test_without_a_search_only_the_demonstration_can_lead_there():
    scene = problem("gap", 0)
    planner = Planner(panda()[0], panda()[1], replace(PlanSettings(), search=None))
    plan = planner.plan(demonstrated(), scene.start, scene.posture, scene.obstacles)
    assert plan.reason == "no path to the goal joints" and plan.detail == "0 searches in joint space"


def test_the_goals_array_is_the_plans_own():
    scene = problem("convex", 0)
    goal = scene.posture.copy()
    plan = planned(scene, goal)
    goal[:] = 0.0
    np.testing.assert_array_equal(plan.request.goal, scene.posture)
    np.testing.assert_array_equal(plan.goal_pose.dq, panda()[0].fk(scene.posture).dq)


@pytest.mark.parametrize("count", [1, 2, 100, 101, 102, 199, 200, 201, 5000])
def test_of_the_tools_path_no_more_poses_are_kept_than_allowed(count):
    arm, _, home = panda()
    joints = np.linspace(home, home + 0.1, count)
    path = tool_path(arm, joints)
    assert min(count, 0.5 * MOST_POSES) <= len(path) <= MOST_POSES + 1
    for pose, q in ((path[0], joints[0]), (path[-1], joints[-1])):
        np.testing.assert_array_equal(pose, arm.fk(q).dq)


# Joints beyond half a turn


@for_all(st.floats(-20, 20), st.floats(1e-3, 30), st.floats(0, 1), st.booleans(), st.booleans(), max_examples=200)
def test_a_joint_is_sampled_over_all_its_range_but_no_turn_twice(lower, width, share, endless_below, endless_above):
    upper, around = lower + width, lower + share * width
    lower, upper = -math.inf if endless_below else lower, math.inf if endless_above else upper
    low, high = sample_range(lower, upper, around)
    assert lower <= low < high <= upper
    assert low - 1e-9 <= around <= high + 1e-9
    assert high - low == pytest.approx(min(upper - lower, 2.0 * math.pi))


@pytest.mark.parametrize("endless", [False, True])
def test_ways_begin_and_end_beyond_half_a_turn(endless):
    arm = random_arm(3)
    wide = np.full(7, math.inf if endless else 20.0)
    arm = replace(arm, lower=-wide, upper=wide)
    planner, _ = lonely(arm)
    for start, goal in ((3.5, 4.5), (-1.0, 9.0), (12.0, 15.0)):
        plan = planner.plan(PosePath(arm.fk(np.full(7, goal)).dq[None]), np.full(7, start), np.full(7, goal))
        assert plan.success, plan.why
        np.testing.assert_array_equal(plan.joints[-1], np.full(7, goal))


def test_the_last_joints_of_the_panda_are_reached_beyond_half_a_turn():
    arm, _, home = panda()
    goal = home.copy()
    goal[5] = arm.upper[5] - 0.01
    assert goal[5] > math.pi
    for start, end in ((home, goal), (goal, home)):
        post = Obstacle(Sphere(0.03), at(0.5 * (arm.fk(home).position + arm.fk(goal).position)))
        for obstacles in ((), (post,)):
            plan = planner_of().plan(demonstrated(), start, end, obstacles)
            assert plan.success or plan.reason.endswith("in collision"), plan.why
            assert plan.success or obstacles
            assert not plan.success or np.array_equal(plan.joints[-1], end)


def test_the_search_meets_what_lies_behind_half_a_turn():
    """Blocked on the straight line, so that samples are needed."""
    arm, body, home = panda()
    goal = home.copy()
    goal[0], goal[5] = home[0] - 2.0, 3.3
    middle = arm.fk(np.array([home[0] - 1.0, *home[1:]])).position
    scene = PlanningScene.of(arm, body, [Obstacle(Sphere(0.08), at(middle))], PlanSettings())
    assert not joint_edge_is_clear(scene.seen, home, goal)
    points = finished(JointPaths(7, 2000, 0).connected(scene.seen, home, goal, 0.3, 2000, 0))
    assert points is not None and len(points) > 2
    np.testing.assert_array_equal(points[-1], goal)
    assert (points <= arm.upper).all() and (points >= arm.lower).all()


# Effort


def test_a_search_that_fails_is_asked_again_with_other_numbers():
    scenes = [problem("gap", seed) for seed in range(8)]
    counts = []
    for tries in (1, 8):
        search = JointSearchSettings(to_joints=tries)
        planner = Planner(*panda()[:2], PlanSettings(search=search))
        plans = [planner.plan(demonstrated(), s.start, s.posture, s.obstacles) for s in scenes]
        counts.append(sum(plan.success for plan in plans))
    assert counts[1] >= counts[0] and counts[1] >= 7
