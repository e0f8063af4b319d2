"""Following a motion among obstacles that come, go, move and stay; the arm is ideal, the judge is slack_at."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers.arms import table_panda

from onedemo.planner.collision.clearance import slack_at
from onedemo.planner.errors import BadModel, BadOption, PlanFailed
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import Box, Obstacle, Sphere
from onedemo.planner.imitation.tsia import screw_path
from onedemo.planner.planning.joint_space_motion import MAX_DEVIATION, path_deviation
from onedemo.planner.planning.planner import Planner
from onedemo.planner.planning.planning_scene import PlanningScene
from onedemo.planner.reactive.command import (
    BLOCKED,
    DONE,
    ESCAPING,
    FAILED,
    FOLLOWING,
    PLANNING,
    STATES,
    WAITING,
    ReactiveSettings,
)
from onedemo.planner.reactive.reactive_planner import ReactivePlanner
from onedemo.planner.robot.body import Body

DT = 0.02
START = np.array([0.0, 0.4, 0.0, -2.2, 0.0, 2.6, 0.78])


def robot():
    return table_panda()[:2]


def sideways(way=0.35):
    """A straight motion of the tcp along y."""
    arm, _ = robot()
    start = arm.fk(START)
    return screw_path(start, Pose.from_position_quaternion([0.0, way, 0.0]) @ start, 0.005)


def middle(path):
    return path[len(path) // 2].position


def ball(place, *, radius=0.04, velocity=(0.0, 0.0, 0.0)):
    return Obstacle(Sphere(radius), Pose.from_position_quaternion(place), np.array(velocity), "ball")


def followed(path, world, *, settings=None, ticks=1500, detours=True):
    """States, joints and rooms of following a path in a world that is a function of the tick."""
    arm, body = robot()
    planner = ReactivePlanner(arm, body, settings)
    planner.go(path, detours=detours)
    q, states, rooms, trace = START.copy(), [], [], []
    for k in range(ticks):
        obstacles = world(k)
        planner.see(obstacles)
        command = planner.step(q)
        assert command.state in STATES and np.isfinite(command.velocity).all()
        q = q + DT * command.velocity
        later = [obstacle.at(DT) for obstacle in obstacles]
        rooms.append(slack_at(PlanningScene.of(arm, body, later, planner.settings.plan).robot, q, 0.0, 1.0))
        states.append(command.state)
        trace.append(q)
        if command.state in (DONE, FAILED):
            break
    return states, np.array(rooms), np.array(trace), planner


def reached(path, q):
    distance, angle = robot()[0].fk(q).distance_to(path[-1])
    return distance < 2e-3 and angle < 0.02


def test_with_nothing_around_a_leg_is_followed_to_its_end():
    path = sideways()
    states, _, trace, planner = followed(path, lambda k: ())
    assert states[-1] == DONE and set(states[:-1]) == {FOLLOWING} and reached(path, trace[-1])
    assert planner.path is path


def test_what_stands_in_the_way_is_led_round_and_nothing_is_touched():
    path = sideways()
    things = (ball(middle(path)),)
    states, rooms, trace, _ = followed(path, lambda k: things)
    assert states[-1] == DONE and ESCAPING in states and reached(path, trace[-1])
    assert rooms.min() >= -1e-9


def test_what_appears_on_the_way_is_led_round_at_once():
    path = sideways()
    things = (ball(middle(path)),)
    settings = ReactiveSettings(thinking=math.inf)
    states, rooms, trace, _ = followed(path, lambda k: things if k >= 8 else (), settings=settings)
    assert set(states[:8]) == {FOLLOWING} and states[8] == ESCAPING
    assert states[-1] == DONE and reached(path, trace[-1]) and rooms.min() >= -1e-9


@pytest.mark.parametrize("share", [0.01, 0.2])
def test_the_arm_stands_until_the_way_round_is_planned_by_a_budget_per_tick(share):
    path = sideways()
    things = (ball(middle(path)),)
    settings = ReactiveSettings(thinking=share)
    states, rooms, trace, _ = followed(path, lambda k: things if k >= 8 else (), settings=settings)
    planned = states.index(ESCAPING)
    assert set(states[:8]) == {FOLLOWING} and set(states[8:planned]) == {PLANNING}
    assert (trace[9:planned] == trace[9]).all()
    assert states[-1] == DONE and reached(path, trace[-1]) and rooms.min() >= -1e-9


def test_what_comes_near_while_a_way_is_planned_is_kept_away_from():
    """The arm retreats from a ball that moves, without waiting for the plan round another one."""
    path = sideways()
    still, velocity = ball(middle(path)), np.array([0.0, 0.1, 0.0])
    from_behind = path[0].position + np.array([0.0, -0.22, 0.0])

    def world(k):
        mover = Obstacle(
            Sphere(0.03), Pose.from_position_quaternion(from_behind + DT * k * velocity), velocity, "mover"
        )
        return (still, mover) if k < 60 else (still,)

    states, rooms, trace, _ = followed(path, world, settings=ReactiveSettings(thinking=0.001), ticks=60)
    assert set(states) == {PLANNING} and np.abs(trace[-1] - trace[0]).max() > 0.01
    assert rooms.min() >= -1e-9


def test_what_vanishes_is_no_longer_led_round():
    path = sideways()
    things = (ball(middle(path)),)
    states, _, trace, _ = followed(path, lambda k: things if k < 10 else ())
    assert states[5] == ESCAPING and states[12] == FOLLOWING and states[-1] == DONE and reached(path, trace[-1])


@pytest.mark.parametrize("speed", [0.05, 0.15])
def test_what_crosses_is_let_pass(speed):
    path = sideways()
    start = middle(path) + np.array([0.0, 0.0, 0.35])
    velocity = np.array([0.0, 0.0, -speed])

    def world(k):
        return (ball(start + DT * k * velocity, velocity=velocity),)

    # what is slow may be below the table before the arm is through: no table here
    settings = ReactiveSettings(lead=0.0)
    states, rooms, trace, _ = followed(path, world, settings=settings)
    assert states[-1] == DONE and reached(path, trace[-1])
    assert rooms.min() >= -1e-3 or BLOCKED in states
    assert rooms.min() > -0.01


def test_it_waits_where_waiting_is_the_answer():
    """Something long crosses the path close ahead and is gone soon: nothing to plan round, nothing to flee from."""
    path = sideways()
    velocity = np.array([0.0, 0.0, -0.3])

    def world(k):
        place = path[len(path) // 2].position + [0.0, 0.06, 0.5] + DT * k * velocity
        return (Obstacle(Box((0.3, 0.04, 0.2)), Pose.from_position_quaternion(place), velocity, "bar"),)

    states, rooms, trace, _ = followed(path, world, settings=ReactiveSettings(lead=0.0))
    assert WAITING in states and states[-1] == DONE and reached(path, trace[-1])
    assert rooms.min() >= -1e-3


def test_what_is_faster_than_the_arm_is_reported():
    path = sideways()
    velocity = np.array([-2.0, 0.0, 0.0])
    start = robot()[0].fk(START).position + np.array([0.8, 0.0, 0.0])
    states, _, _, _ = followed(path, lambda k: (ball(start + DT * k * velocity, velocity=velocity),), ticks=60)
    assert BLOCKED in states


def test_a_goal_behind_walls_fails_with_a_reason_and_touches_nothing():
    path = sideways()
    goal, walls = path[-1].position, []
    for axis in range(3):
        for side in (-1.0, 1.0):
            size, place = [0.42, 0.42, 0.42], goal.copy()
            size[axis] = 0.02
            place[axis] += 0.2 * side
            walls.append(Obstacle(Box(tuple(size)), Pose.from_position_quaternion(place), name=f"wall{axis}{side:+g}"))
    settings = ReactiveSettings(patience=0.4, give_up=5.0)
    states, rooms, _, planner = followed(path, lambda k: tuple(walls), settings=settings)
    assert states[-1] == FAILED and planner.motion.reason in ("blocked", "ik_or_limit")
    assert rooms[rooms < 1.0].min() >= min(rooms[0], 0.0) - 1e-9


def test_standing_still_gives_way_to_what_comes():
    arm, body = robot()
    planner = ReactivePlanner(arm, body)
    q, velocity = START.copy(), np.array([-0.1, 0.0, 0.0])
    start = arm.fk(q).position + np.array([0.25, 0.0, 0.0])
    least = np.inf
    for k in range(150):
        planner.see((ball(start + DT * k * velocity, velocity=velocity),))
        command = planner.step(q)
        q = q + DT * command.velocity
        later = ball(start + DT * (k + 1) * velocity)
        least = min(least, slack_at(PlanningScene.of(arm, body, [later], planner.settings.plan).robot, q, 0.0, 1.0))
    assert least > -5e-3
    assert np.abs(q - START).max() > 0.05


def test_the_same_world_gives_the_same_motion():
    path = sideways()
    things = (ball(middle(path)),)
    one, two = (followed(path, lambda k: things)[2] for _ in range(2))
    np.testing.assert_array_equal(one, two)


def test_within_reach_of_the_end_is_less_than_exactly():
    arm, body = robot()
    path, ends = sideways(0.1), []
    for exact in (True, False):
        planner = ReactivePlanner(arm, body)
        planner.go(path, exact=exact)
        q = START.copy()
        for _ in range(500):
            command = planner.step(q)
            if command.state == DONE:
                break
            q = q + DT * command.velocity
        ends.append(arm.fk(q).distance_to(path[-1])[0])
    assert ends[0] < 1.1e-3 < ends[1] < 0.011


@pytest.mark.parametrize("change", [{"patience": 0.0}, {"patience": 2.0, "give_up": 1.0}, {"horizon": -1.0}])
def test_absurd_settings_are_refused(change):
    with pytest.raises(BadOption):
        replace(ReactiveSettings(), **change)


# Strictly along the path

BESIDE = np.array([0.0, 0.0, 0.13])


def test_without_detours_nothing_is_led_round_and_the_tool_stays_on_its_path():
    """Beside the path the safety layer would push the tool away from it; that is waited out, then given up."""
    path = sideways()
    beside = middle(path) + BESIDE
    things = (ball(beside),)
    arm, _ = robot()
    free_states, _, free, _ = followed(path, lambda k: things)
    assert free_states[-1] == DONE and path_deviation(arm, free, path.dqs) > 3 * MAX_DEVIATION
    states, rooms, trace, planner = followed(path, lambda k: things, detours=False)
    assert states[-1] == FAILED and planner.motion.reason == "blocked" and "ball" in planner.motion.detail
    assert ESCAPING not in states and rooms.min() >= -1e-9
    # a tick past the limit is what it takes to see that it is passed
    assert path_deviation(arm, trace, path.dqs) < MAX_DEVIATION + 0.001


def test_without_detours_it_goes_on_when_what_was_beside_is_gone():
    path = sideways()
    things = (ball(middle(path) + BESIDE),)
    states, _, trace, _ = followed(path, lambda k: things if k < 120 else (), detours=False)
    assert WAITING in states and states[-1] == DONE and reached(path, trace[-1])


def test_what_stands_still_at_the_goal_is_given_up_at_the_first_stall():
    path = sideways()
    things = (ball(path[-1].position),)
    states, rooms, _, planner = followed(path, lambda k: things, ticks=3000)
    assert states[-1] == FAILED and planner.motion.reason == "blocked" and rooms.min() >= -1e-9
    assert len(states) * DT < 10.0


def test_a_failed_plan_is_not_followed():
    arm, body = robot()
    planner = ReactivePlanner(arm, body)
    failed = Planner(arm, body).plan(sideways(), START, Pose.from_position_quaternion([5.0, 0.0, 0.0]))
    with pytest.raises(PlanFailed, match=r"there is no plan to follow: ik_or_limit: the goal is"):
        planner.follow(failed)
    assert planner.motion is None


def test_a_body_of_another_arm_is_refused_and_the_old_one_kept():
    arm, body = robot()
    planner = ReactivePlanner(arm, body)
    foreign = Body(np.array([[9.0, 0, 0, 0, 0, 0, 0, 0.01]]), ("hand",))
    with pytest.raises(BadModel, match="moves with joint 9"):
        planner.hold(foreign)
    assert planner.body is body


def test_very_long_paths_are_followed_at_even_steps():
    arm, body = robot()
    planner, start = ReactivePlanner(arm, body), arm.fk(START)
    long = screw_path(start, Pose.from_position_quaternion([0.0, 0.1, 0.0]) @ start, 2e-5)
    planner.go(long)
    assert len(long) > 4000 and len(planner.path) == 4000
