"""Smooth and timed plans: limits kept, ends kept, clear or refused."""

from __future__ import annotations

import numpy as np
import pytest

from onedemo.envs.bodies import robot_body
from onedemo.envs.scene import compiled_scene
from onedemo.planner.certify import certify
from onedemo.planner.errors import PlanFailed
from onedemo.planner.motion_log import MotionLog
from onedemo.planner.planning import Planner
from onedemo.planner.pose import Pose
from onedemo.planner.refine import retimed, smooth_clear_path
from onedemo.planner.repet import clear_of, escape_path, point_tool
from onedemo.planner.shapes import Box, Obstacle, Sphere
from onedemo.planner.tsia import screw_path

START = np.array([0.0, 0.4, 0.0, -2.2, 0.0, 2.6, 0.78])


def planned(obstacles):
    scene = compiled_scene("Panda")
    arm, body = scene.arms[0].arm, robot_body("Panda")
    start = arm.fk(START)
    goal = Pose.from_position_quaternion([0.0, 0.35, 0.0]) @ start
    return arm, body, Planner(arm, body).plan(screw_path(start, goal, 0.01), START, goal, obstacles)


def between(arm, way=0.5):
    return arm.fk(START).position + np.array([0.0, 0.35 * way, 0.0])


@pytest.mark.parametrize("things", [0, 1])
def test_a_timed_plan_keeps_limits_ends_and_distance(things):
    arm = compiled_scene("Panda").arms[0].arm
    ball = [Obstacle(Sphere(0.04), Pose.from_position_quaternion(between(arm)), name="ball")][:things]
    arm, body, plan = planned(ball)
    assert plan.success and plan.how == ("escape" if things else "direct")
    result = retimed(plan, 5.0, arm, body, ball)
    np.testing.assert_allclose(result.joints[[0, -1]], plan.joints[[0, -1]], atol=1e-9)
    assert not result.velocities[[0, -1]].any() or np.abs(result.velocities[[0, -1]]).max() < 1e-6
    steps = np.diff(result.joints, axis=0) / plan.dt
    assert (np.abs(steps) <= arm.velocity_limits + 1e-6).all()
    assert np.abs(np.diff(result.velocities, axis=0) / plan.dt).max() <= 5.0 + 1e-4
    time = plan.dt * np.arange(len(result.joints))
    log = MotionLog(arm=arm, body=body, obstacles=tuple(ball), time=time, joints=result.joints, safety=0.01)
    assert certify(log).ok


def test_what_the_spline_runs_into_is_refused():
    arm, body, plan = planned([])
    wall = [Obstacle(Box((1.0, 0.01, 1.0)), Pose.from_position_quaternion(between(arm, 0.9)), name="wall")]
    with pytest.raises(PlanFailed, match=r"not clear at \d"):
        retimed(plan, 5.0, arm, body, wall)


def test_without_a_plan_there_is_nothing_to_time():
    arm = compiled_scene("Panda").arms[0].arm
    goal = arm.fk(START).position + np.array([0.0, 0.35, 0.0])
    arm, body, plan = planned([Obstacle(Sphere(0.1), Pose.from_position_quaternion(goal))])
    with pytest.raises(PlanFailed, match="goal in collision"):
        retimed(plan, 5.0, arm, body, [])


def test_a_detour_is_made_smooth_and_stays_clear():
    start, end = Pose.identity(), Pose.from_yaw([0.8, 0.0, 0.0], 0.5)
    ball, tool = [Obstacle(Sphere(0.1), Pose.from_position_quaternion([0.4, 0.0, 0.0]))], point_tool(0.03)
    escape = escape_path(screw_path(start, end, 0.01), tool, ball)
    assert escape.found and escape.detours
    curve = smooth_clear_path(escape.path, tool, ball, 0.015)
    assert min(clear_of(pose, tool, ball) for pose in curve) >= 0.015
    for k in (0, -1):
        distance, angle = curve[k].gap(escape.path[k])
        assert distance < 1e-12 and angle < 1e-9
    turns = np.diff(curve.positions, axis=0)
    bends = np.linalg.norm(np.diff(turns / np.linalg.norm(turns, axis=1)[:, None], axis=0), axis=1)
    rough = np.diff(escape.path.positions, axis=0)
    corners = np.linalg.norm(np.diff(rough / np.linalg.norm(rough, axis=1)[:, None], axis=0), axis=1)
    assert bends.max() < 0.7 * corners.max()


def test_a_curve_that_is_not_clear_is_refused():
    path = screw_path(Pose.identity(), Pose.from_position_quaternion([0.8, 0.0, 0.0]), 0.01)
    with pytest.raises(PlanFailed, match="behind pose"):
        smooth_clear_path(path, point_tool(0.03), [Obstacle(Sphere(0.1), Pose.from_yaw([0.4, 0.0, 0.0], 0.0))], 0.01)
