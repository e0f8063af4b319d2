"""Smooth and timed plans: limits kept, ends kept, clear or refused."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.arms import table_panda

from onedemo.planner.collision.edge_certificates import tool_arrays
from onedemo.planner.errors import PlanFailed
from onedemo.planner.escape.repet import clear_of, escape_path, point_tool
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import Box, Obstacle, Sphere, pack
from onedemo.planner.imitation.tsia import screw_path
from onedemo.planner.judge.certify import certify
from onedemo.planner.log.motion_log import MotionLog
from onedemo.planner.planning.planner import Planner
from onedemo.planner.planning.refine import (
    check_joints_are_clear,
    refused,
    scene_of,
    smooth_clear_path,
    smoothed,
    timed,
)

START = np.array([0.0, 0.4, 0.0, -2.2, 0.0, 2.6, 0.78])


def planned(obstacles):
    arm, body, _ = table_panda()
    start = arm.fk(START)
    goal = Pose.from_position_quaternion([0.0, 0.35, 0.0]) @ start
    return arm, body, Planner(arm, body).plan(screw_path(start, goal, 0.01), START, goal, obstacles)


def between(arm, way=0.5):
    return arm.fk(START).position + np.array([0.0, 0.35 * way, 0.0])


def ball_between(arm):
    return Obstacle(Sphere(0.04), Pose.from_position_quaternion(between(arm)), name="ball")


def judged(plan, arm, body, obstacles):
    time = plan.dt * np.arange(len(plan.joints))
    log = MotionLog(
        arm=arm, body=body, obstacles=tuple(obstacles), time=time, joints=plan.joints, safety=0.01,
        goal=plan.request.goal, claims={"joint_margin": plan.margin},
    )  # fmt: skip
    return certify(log)


def bends(path):
    """Angles between neighboring steps of a tcp path."""
    steps = np.diff(path, axis=0)
    steps = steps[np.linalg.norm(steps, axis=1) > 1e-5]
    units = steps / np.linalg.norm(steps, axis=1)[:, None]
    return np.arccos(np.clip((units[1:] * units[:-1]).sum(axis=1), -1.0, 1.0))


@pytest.mark.parametrize("things", [0, 1])
def test_a_timed_plan_keeps_limits_ends_and_distance(things):
    ball = [ball_between(table_panda()[0])][:things]
    arm, body, plan = planned(ball)
    assert plan.success and plan.how == ("escape" if things else "direct")
    fast = timed(plan, 3.0)
    assert fast.success and fast.refined == ("timed",) and fast.changed == 0
    np.testing.assert_allclose(fast.joints[[0, -1]], plan.joints[[0, -1]], atol=1e-9)
    speeds = np.diff(fast.joints, axis=0) / plan.dt
    assert (np.abs(speeds) <= arm.velocity_limits + 1e-6).all()
    assert np.abs(np.diff(speeds, axis=0) / plan.dt).max() <= 3.0 + 1e-3
    assert np.abs(speeds[[0, -1]]).max() < 3.0 * plan.dt
    assert len(timed(plan, 1.0).joints) > len(fast.joints)
    assert judged(fast, arm, body, ball).ok


@pytest.mark.parametrize("things", [0, 1])
def test_a_smooth_plan_bends_less_and_is_clear(things):
    ball = [ball_between(table_panda()[0])][:things]
    arm, body, plan = planned(ball)
    smooth = smoothed(plan)
    assert smooth.success and smooth.refined == ("smooth",)
    assert judged(smooth, arm, body, ball).ok
    np.testing.assert_array_equal(smooth.joints[0], plan.joints[0])
    assert smooth.path[-1].distance_to(plan.request.goal)[0] < 1e-12
    if things:
        assert bends(smooth.path.positions).max() < 0.5 * bends(plan.path.positions).max()
    both = timed(smooth)
    assert both.refined == ("smooth", "timed") and judged(both, arm, body, ball).ok


def test_what_the_spline_or_the_curve_runs_into_is_refused():
    arm, _, plan = planned([])
    wall = (Obstacle(Box((1.0, 0.01, 1.0)), Pose.from_position_quaternion(between(arm, 0.9)), name="wall"),)
    walled = plan._replace(request=plan.request._replace(obstacles=wall))
    with pytest.raises(PlanFailed, match=r"not clear at \d"):
        timed(walled)
    with pytest.raises(PlanFailed, match="not clear behind pose"):
        smoothed(walled)
    with pytest.raises(PlanFailed, match=r"not clear at \d"):
        check_joints_are_clear(plan.joints, plan.dt * np.arange(len(plan.joints)), scene_of(walled))
    failed = refused(plan, PlanFailed("plan_failed", "so"))
    assert not failed.success and failed.why == "plan_failed: so" and len(failed.joints) == 1


def test_without_a_plan_there_is_nothing_to_refine():
    arm = table_panda()[0]
    goal = arm.fk(START).position + np.array([0.0, 0.35, 0.0])
    plan = planned([Obstacle(Sphere(0.1), Pose.from_position_quaternion(goal), name="ball")])[2]
    for refine in (timed, smoothed):
        with pytest.raises(PlanFailed, match=r"goal in collision: .* touches ball"):
            refine(plan)


def test_a_way_through_joint_space_is_not_made_smooth_but_timed():
    from helpers.random_scenes import panda, problem, solve

    plan = solve(problem("gap", 0))
    assert plan.how == "joint search"
    with pytest.raises(PlanFailed, match="joint space"):
        smoothed(plan)
    assert judged(timed(plan), *panda()[:2], problem("gap", 0).obstacles).ok


def test_a_detour_is_made_smooth_and_stays_clear():
    start, end = Pose.identity(), Pose.from_yaw([0.8, 0.0, 0.0], 0.5)
    ball, tool = [Obstacle(Sphere(0.1), Pose.from_position_quaternion([0.4, 0.0, 0.0]))], point_tool(0.03)
    escape = escape_path(screw_path(start, end, 0.01), tool, ball)
    assert escape.found and escape.detours
    curve = smooth_clear_path(escape.path, tool_arrays(tool, pack(ball), margin=0.015), 0.015)
    assert min(clear_of(pose, tool, ball) for pose in curve) >= 0.015
    for k in (0, -1):
        distance, angle = curve[k].distance_to(escape.path[k])
        assert distance < 1e-12 and angle < 1e-9
    assert bends(curve.positions).max() < 0.7 * bends(escape.path.positions).max()


def test_a_curve_that_is_not_clear_is_refused():
    path = screw_path(Pose.identity(), Pose.from_position_quaternion([0.8, 0.0, 0.0]), 0.01)
    with pytest.raises(PlanFailed, match="behind pose"):
        ball = [Obstacle(Sphere(0.1), Pose.from_yaw([0.4, 0.0, 0.0], 0.0))]
        smooth_clear_path(path, tool_arrays(point_tool(0.03), pack(ball), margin=0.01), 0.01)
