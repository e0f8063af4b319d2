"""Among obstacles that move: what is foreseen comes true, nothing is touched, it arrives; states tell the truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.arms import table_panda
from helpers.random_scenes import at, base_gap

from onedemo.planner.collision.clearance import slack_at
from onedemo.planner.control.arm_arrays import arm_arrays
from onedemo.planner.control.pursuit import fresh_pursuit_state
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import Box, Obstacle, Sphere, moves
from onedemo.planner.imitation.tsia import screw_path
from onedemo.planner.judge.certify import certify
from onedemo.planner.log.motion_log import MotionLog
from onedemo.planner.planning.planning_scene import PlanningScene
from onedemo.planner.planning.settings import PlanSettings
from onedemo.planner.reactive.command import DONE, ESCAPING, FAILED, WAITING, ReactiveSettings
from onedemo.planner.reactive.prediction import Predictor, same_scene, swept, windows
from onedemo.planner.reactive.reactive_planner import ReactivePlanner
from onedemo.planner.resumable import finished
from onedemo.planner.safety.safety_layer import safe_velocity

DT = 0.02
START = np.array([0.0, 0.4, 0.0, -2.2, 0.0, 2.6, 0.78])
SPEEDS = (0.05, 0.1, 0.2, 0.3)
SHOULDER = 0.3
"""Whatever passes nearer to the axis of the base [m] hits what no joint moves away."""


def robot():
    return table_panda()[:2]


def sideways():
    start = robot()[0].fk(START)
    return screw_path(start, at([0.0, 0.35, 0.0]) @ start, 0.005)


def crossing(seed: int, speed: float) -> Obstacle:
    """Something that crosses the path about when the arm does, from anywhere, and not through the shoulder."""
    arm, body = robot()
    rng, path = np.random.default_rng([7, seed]), sideways()
    while True:
        place = path[int(len(path) * rng.uniform(0.3, 0.7))].position
        angle = rng.uniform(-np.pi, np.pi)
        way = np.array([np.cos(angle), 0.3 * rng.normal(), np.sin(angle)])
        way *= speed / np.linalg.norm(way)
        shape = Sphere(rng.uniform(0.03, 0.06)) if rng.uniform() < 0.5 else Box(tuple(rng.uniform(0.04, 0.1, 3)))
        thing = Obstacle(shape, at(place - rng.uniform(0.5, 2.5) * way), way, "thing")
        line = np.array([thing.at(t).pose.position for t in np.linspace(0.0, 12.0, 200)])
        if np.hypot(line[:, 0] + 0.56, line[:, 1]).min() < SHOULDER or base_gap(body, [thing]) < SHOULDER:
            continue
        if slack_at(PlanningScene.of(arm, body, [thing], PlanSettings()).robot, START, 0.0, 1.0) > 0.03:
            return thing


def followed(world, settings=None, ticks=1500):
    """The commands, and the joints of every tick, of the motion in a world that is a function of the tick."""
    planner = ReactivePlanner(*robot(), settings)
    planner.go(sideways())
    q, commands, trace = START.copy(), [], [START]
    for k in range(ticks):
        planner.see(world(k))
        commands.append(planner.step(q))
        q = q + DT * commands[-1].velocity
        trace.append(q)
        if commands[-1].state in (DONE, FAILED):
            break
    return commands, np.array(trace)


def judged_clearance(trace, obstacle) -> float:
    """Distance [m] that an independent judge proves, between the ticks too."""
    arm, body = robot()
    time = DT * np.arange(len(trace))
    log = MotionLog(arm=arm, body=body, obstacles=(obstacle,), time=time, joints=trace, safety=0.0)
    return certify(log).clearance


def arrives(trace) -> bool:
    distance, angle = robot()[0].fk(trace[-1]).distance_to(sideways()[-1])
    return distance < 2e-3 and angle < 0.02


def crossed(seeds, speed, settings=None) -> tuple[float, float]:
    """Share that arrives, and mean seconds; none may be touched."""
    good, seconds = 0, []
    for seed in seeds:
        thing = crossing(seed, speed)
        commands, trace = followed(lambda k, thing=thing: (thing.at(DT * k),), settings)
        assert judged_clearance(trace, thing) > 0.0, (seed, speed)
        assert (commands[-1].state == DONE) == arrives(trace)
        good += commands[-1].state == DONE
        seconds.append(DT * len(trace))
    return good / len(seeds), float(np.mean(seconds))


@pytest.mark.parametrize("speed", SPEEDS)
def test_what_crosses_is_not_touched_and_the_goal_is_reached(speed):
    assert crossed(range(6), speed)[0] == 1.0


@pytest.mark.slow
@pytest.mark.parametrize("speed", SPEEDS)
def test_many_that_cross_are_not_touched_and_the_goal_is_reached(speed):
    share, seconds = crossed(range(100, 140), speed)
    assert share >= 0.9
    assert seconds <= crossed(range(100, 140), speed, ReactiveSettings(horizon=0.0))[1] + 0.05


def test_foresight_saves_time():
    with_it, without = (crossed(range(6), 0.05, settings)[1] for settings in (None, ReactiveSettings(horizon=0.0)))
    assert with_it < 0.85 * without


def appearing(count: int, speed: float, first: int) -> list[Obstacle]:
    """Things that cross, and at a tick of the free motion are 3 cm away from the arm at least."""
    free, out, seed = followed(lambda k: ())[1], [], 1000
    while len(out) < count:
        thing, seed = crossing(seed, speed), seed + 1
        if PlanningScene.of(*robot(), [thing.at(DT * first)], PlanSettings()).slack(free[first]) > 0.03:
            out.append(thing)
    return out


def test_what_appears_and_moves_is_not_touched_and_the_goal_is_reached():
    first = 15
    for thing in appearing(8, 0.15, first):
        commands, trace = followed(lambda k, thing=thing: (thing.at(DT * k),) if k >= first else ())
        assert commands[-1].state == DONE and arrives(trace)
        assert judged_clearance(trace[first:], thing.at(DT * first)) > 0.0


def test_what_parks_on_the_goal_fails_and_is_named():
    goal, seconds = sideways()[-1].position, 1.0
    way = np.array([0.2, 0.0, 0.1])

    def world(k):
        left = max(0.0, seconds - DT * k)
        return (Obstacle(Sphere(0.05), at(goal - left * way), way if left > 0.0 else np.zeros(3), "cart"),)

    commands, trace = followed(world, ReactiveSettings(patience=0.5))
    last = commands[-1]
    assert (last.state, last.reason) == (FAILED, "blocked") and "cart" in last.detail
    assert not arrives(trace)
    parked = round(seconds / DT) + 1
    assert judged_clearance(trace[: parked + 1], world(0)[0]) > 0.0
    assert judged_clearance(trace[parked:], world(parked)[0]) > 0.0


def test_a_slow_thing_is_gone_round_while_it_moves():
    """It would take seconds to be gone; the way round takes less."""
    way = np.array([0.0, 0.0, -0.05])
    thing = Obstacle(Sphere(0.03), at(sideways()[35].position + np.array([0.0, 0.0, 0.05])), way, "slow")
    commands, trace = followed(lambda k: (thing.at(DT * k),))
    _, blind = followed(lambda k: (thing.at(DT * k),), ReactiveSettings(horizon=0.0))
    assert commands[-1].state == DONE and ESCAPING in [command.state for command in commands]
    assert judged_clearance(trace, thing) > 0.0
    assert len(trace) < 0.8 * len(blind)


def test_waiting_is_standing_still_because_of_what_moves():
    """Something long closes the way and opens it again."""
    way, seen = np.array([0.0, 0.0, -0.3]), 0
    middle = sideways()[len(sideways()) // 2].position
    bar = Obstacle(Box((0.3, 0.04, 0.2)), at(middle + np.array([0.0, 0.06, 0.5])), way, "bar")
    commands, trace = followed(lambda k: (bar.at(DT * k),))
    arm, body = robot()
    for command, q in zip(commands, trace[:-1], strict=True):
        if command.state == WAITING:
            seen += 1
            # it stands, or gives way
            assert np.abs(command.velocity).max() < 0.15 or command.slack < 0.05
            assert np.isfinite(PlanningScene.of(arm, body, [bar], PlanSettings()).slack(q))
    assert seen > 0 and commands[-1].state == DONE


# The parts


def test_what_is_foreseen_comes_true():
    """The roll-out of going on is what happens, to the bit, if nothing else is done."""
    thing = crossing(3, 0.1)
    arm, body = robot()
    settings = ReactiveSettings(horizon=0.0, lead=0.0, patience=30.0)
    commands, _ = followed(lambda k: (thing.at(DT * k),), settings)
    motion = settings.plan.motion
    work = arm_arrays(arm, motion.controller.packed(), replace(motion.pursuit, patience=1e9).packed())
    scene = PlanningScene.of(arm, body, [thing], settings.plan)
    safe_velocity(scene.robot, START, np.zeros(7), DT, np.empty(7))
    before, memory = scene.robot.copy(), fresh_pursuit_state()
    ahead = finished(Predictor(work, DT, 30.0, 0.15).ahead(scene.robot, sideways(), memory, START))
    assert ahead.arrival == pytest.approx(DT * (len(commands) - 1), abs=1e-9)
    rooms = [command.slack for command in commands]
    assert ahead.slack == pytest.approx(min(rooms), abs=1e-6)
    # looking changes nothing
    np.testing.assert_array_equal(scene.robot, before)
    np.testing.assert_array_equal(memory, fresh_pursuit_state())
    short = finished(Predictor(work, DT, 0.5, 0.15).ahead(scene.robot, sideways(), memory, START))
    assert 0.5 < short.arrival < ahead.arrival + 1.0
    later = finished(Predictor(work, DT, 30.0, 0.15).ahead(scene.robot, sideways(), memory, START, wait=5.0))
    assert later.arrival > 5.0


def test_swept_places_cover_the_way():
    thing = Obstacle(Sphere(0.03), at([0.0, 0.0, 0.0]), np.array([0.3, 0.0, 0.0]), "thing", 0.02)
    still = Obstacle(Sphere(0.03), at([1.0, 0.0, 0.0]), name="still")
    places = swept([thing, still], 0.5, 1.5)
    xs = [place.pose.position[0] for place in places]
    assert xs[0] == pytest.approx(0.15) and xs[-1] == pytest.approx(0.45)
    assert max(np.diff(xs)) <= 0.04 + 1e-12
    assert all(not moves(place) and place.margin == 0.02 and place.name == "thing" for place in places)
    assert len(swept([replace(thing, velocity=np.array([3.0, 0.0, 0.0]))], 0.0, 2.0)) <= 10
    assert list(windows(1.0, 2.0)) == [(0.6, 1.8), (0.0, 2.0)]
    assert next(windows(0.1, 2.0))[0] == 0.0


def test_a_scene_has_changed_if_what_stands_has():
    still, moving = Obstacle(Sphere(0.1), name="a"), Obstacle(Sphere(0.1), velocity=np.array([0.1, 0.0, 0.0]), name="a")
    assert same_scene([still], [still]) and same_scene([moving], [moving.at(1.0)])
    assert same_scene([still], [replace(still, pose=at([5e-4, 0.0, 0.0]))])
    assert not same_scene([still], [replace(still, pose=at([5e-3, 0.0, 0.0]))])
    assert not same_scene([still], [replace(still, pose=Pose.from_yaw([0.0, 0.0, 0.0], 0.1))])
    for other in ([], [moving], [replace(still, name="b")], [replace(still, margin=0.1)]):
        assert not same_scene([still], other)
