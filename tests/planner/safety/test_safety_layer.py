"""The safety layer: it changes nothing without need, and whatever is asked of it, nothing comes too close."""

from __future__ import annotations

import math
import os

import numpy as np
import pytest
from helpers.arms import READY, panda, random_arm
from helpers.planner.guarded_point import BALL, DT, gantry, point_among
from helpers.solids import KINDS, random_pose, random_shape
from helpers.strategies import for_all
from hypothesis import strategies as st
from soak import (
    AT_SURFACE,
    BEYOND,
    FALSE_STOPS,
    ROOMY,
    STATUS,
    STEPS,
    STOPPED,
    TOO_CLOSE,
    WORST,
    facing_pandas,
    fcl_rooms,
    panda_body,
    panda_pairs,
    random_obstacles,
    random_scene,
    run_scene,
)

from onedemo.planner import jit
from onedemo.planner.collision.clearance import slack_at
from onedemo.planner.collision.robot_arrays import HEADER, NEAR_PAIR, ROW
from onedemo.planner.errors import UnknownName
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import Box, Capsule, Cylinder, Mesh, Obstacle, Sphere
from onedemo.planner.robot.body import Body
from onedemo.planner.safety.safety_layer import (
    BLOCKED,
    CHANGED,
    FREE,
    HELD,
    SafetyLayer,
    SafetySettings,
    contact_masks,
    safe_velocity,
)

seeds, kinds = st.integers(0, 10**6), st.sampled_from(KINDS)
SHARE = float(os.environ.get("ONEDEMO_SOAK", "1"))
"""Scales the long runs."""
SCENES, STEPS_EACH = 40, max(20, round(2500 * SHARE))


# ------------------------------------------------------------------ no change without need


@for_all(seeds, max_examples=60)
def test_a_command_away_from_everything_is_left_as_it_is_to_the_bit(seed):
    """Property 35: far away, or moving away, or along."""
    rng = np.random.default_rng(seed)
    layer = point_among([Obstacle(Box((1.0, 1.0, 1.0)))], speed=1.0)
    across, up = rng.uniform(-1, 1, 2), rng.uniform(0, 1)
    for height, speed in [(2.0, -1.0), (0.54, up), (0.531, up), (0.5303, 0.0)]:
        u = np.array([*across, speed]) * 0.4
        result = layer([0.0, 0.0, height], u)
        assert result.status == FREE and result.velocity.tobytes() == u.tobytes()


def test_the_panda_is_left_alone_in_free_space_within_its_speeds():
    arm = panda()
    layer = SafetyLayer([arm], [panda_body()], [Obstacle(Sphere(0.1), Pose.from_position_quaternion([2.0, 0, 0]))], DT)
    rng = np.random.default_rng(0)
    for _ in range(50):
        u = rng.uniform(-1, 1, 7) * arm.velocity_limits
        result = layer(READY, u)
        assert (result.status, result.velocity.tobytes(), result.slack) == (FREE, u.tobytes(), math.inf)


def test_too_fast_a_command_is_scaled_as_a_whole():
    arm, u = panda(), np.arange(1.0, 8.0)
    result = SafetyLayer([arm], [panda_body()], [], DT)(READY, 10 * u)
    assert result.status == CHANGED and (np.abs(result.velocity) <= arm.velocity_limits * (1 + 1e-12)).all()
    np.testing.assert_allclose(np.cross(result.velocity[:3], u[:3]), 0, atol=1e-12)
    assert np.max(np.abs(result.velocity) / arm.velocity_limits) == pytest.approx(1.0, abs=1e-12)


# ------------------------------------------------------------------ the bound


@for_all(seeds, kinds, max_examples=100)
def test_one_bound_is_kept_by_the_closed_form(seed, kind):
    """Property 36, for a point: `u + max(0, -alpha h + n . v - n . u) n`."""
    rng = np.random.default_rng(seed)
    obstacle = Obstacle(random_shape(rng, kind), random_pose(rng), 0.1 * rng.normal(size=3))
    layer = point_among([obstacle])
    q, u = rng.normal(size=3) * 0.15, rng.normal(size=3) * 0.3
    layer(q, np.zeros(3))
    rows = layer.work[int(layer.work[ROW.header, HEADER.first_near]) :]
    gap, setting = rows[0, NEAR_PAIR.distance], layer.settings
    n = rows[0, NEAR_PAIR.normal : NEAR_PAIR.t].copy()
    result = layer(q, u)
    if result.status in (FREE, CHANGED) and result.slack > 0 and gap > 1e-6:
        short = max(0.0, -setting.alpha * (gap - 0.01 - setting.buffer) + n @ obstacle.velocity - n @ u)
        # the bound is soft: it gives way by a ten-millionth
        np.testing.assert_allclose(result.velocity, u + short * n, rtol=0, atol=1e-9 + 3e-7 * short)


@for_all(seeds, st.floats(0.5, 80.0), max_examples=80)
def test_the_room_shrinks_at_most_by_its_share_per_step(seed, alpha):
    """Property 37: points moved under the bound alone, in clutter, with gamma = alpha dt."""
    rng = np.random.default_rng(seed)
    obstacles = [
        Obstacle(random_shape(rng, KINDS[int(rng.integers(5))]), random_pose(rng, rng.normal(size=3) * 0.2))
        for _ in range(int(rng.integers(1, 6)))
    ]
    # a decay of 1 and a step that always is clear: the guard does not help
    layer = point_among(obstacles, settings=SafetySettings(alpha=alpha, decay=1.0, shell=0.3))
    q, gamma = rng.normal(size=3), min(1.0, alpha * DT)
    room, seen = slack_at(layer.work, q, 0.0, 10.0), 0
    for _ in range(30):
        if room < 1e-3:
            break
        u = -q * rng.uniform(0, 20) + rng.normal(size=3)
        u *= min(1.0, 3.0 / np.linalg.norm(u))  # nothing comes from beyond the shell
        result = layer(q, u)
        q = q + DT * result.velocity
        after = slack_at(layer.work, q, 0.0, 10.0)
        if room < 0.25:  # within the shell
            assert after >= (1.0 - gamma) * room - 1e-9
            seen += 1
        room = after


def test_the_bounds_change_speeds_no_faster_than_the_arm_can():
    layer = point_among([], speed=1.0, settings=SafetySettings(acceleration=2.0))
    speeds = [layer(np.zeros(3), [1.0, -0.05, 0.0]).velocity for _ in range(60)]
    steps = np.abs(np.diff([np.zeros(3), *speeds], axis=0))
    assert steps.max() <= 2.0 * DT + 1e-9
    np.testing.assert_allclose(speeds[-1], [1.0, -0.05, 0.0], rtol=0, atol=1e-9)


def test_motion_along_a_surface_is_kept():
    """Only the part into the surface goes."""
    layer = point_among([Obstacle(Box((1.0, 1.0, 1.0)))])
    result = layer([0.0, 0.0, 0.5302], [0.3, -0.2, -1.0])
    np.testing.assert_allclose(result.velocity, [0.3, -0.2, 0.0], rtol=0, atol=1e-5)
    assert result.status == CHANGED and result.slack == pytest.approx(2e-4, abs=1e-12)


def test_an_obstacle_margin_goes_before_the_general_distance():
    for margin, keep in ((None, 0.01), (0.0, 0.0), (0.05, 0.05), (0.3, 0.3)):
        layer = point_among([Obstacle(Box((1.0, 1.0, 1.0)), margin=margin)], speed=1.0)
        q = np.array([0.0, 0.0, 0.9])
        for _ in range(400):
            q = q + DT * layer(q, [0.0, 0.0, -1.0]).velocity
            assert q[2] - 0.52 >= keep - 1e-12
        assert q[2] - 0.52 <= keep + 1e-3


def test_allowed_contacts_are_allowed_to_that_part_alone():
    """A held block is put on the table; the hand beside it is kept away."""
    table = Obstacle(Box((2.0, 2.0, 0.5)), Pose.from_position_quaternion([0, 0, -0.25]), name="table")
    wall = Obstacle(Box((0.1, 2.0, 2.0)), Pose.from_position_quaternion([0.5, 0, 0]), name="wall")
    rows = np.array([[2, 0, 0, 0, 0, 0, 0.1, 0.05], [2, 0, 0, -0.08, 0, 0, -0.08, 0.02]])
    body = Body(rows, ("hand", "block"), held=("block",))
    layer = SafetyLayer([gantry()], [body], [table, wall], DT, allowed=[("block", "table")])
    q = np.array([0.0, 0.0, 0.3])
    for _ in range(400):
        q = q + DT * layer(q, [0.0, 0.0, -1.0]).velocity
    assert q[2] - 0.05 == pytest.approx(0.01, abs=1e-3) and q[2] - 0.1 < 0
    for _ in range(400):
        q = q + DT * layer(q, [1.0, 0.0, 0.0]).velocity
    assert q[0] + 0.05 == pytest.approx(0.45 - 0.01, abs=1e-3)


def test_masks_hold_one_bit_per_capsule_of_the_part():
    obstacles = [Obstacle(Sphere(0.1), name="a"), Obstacle(Sphere(0.1), name="b")]
    names = ["hand", "block", "block", "link"]
    assert contact_masks(names, obstacles, [("block", "b"), ("link", "a")]) == [0b1000, 0b0110]
    assert contact_masks(names, obstacles, []) == [0, 0]
    with pytest.raises(UnknownName, match="blok"):
        contact_masks(names, obstacles, [("blok", "b")])
    with pytest.raises(UnknownName, match=r"obstacle.*c"):
        contact_masks(names, obstacles, [("block", "c")])


# ------------------------------------------------------------------ the guard


def total(runs) -> np.ndarray:
    tally = np.sum(runs, axis=0)
    tally[WORST] = min(run[WORST] for run in runs)
    return tally


def test_whatever_is_asked_nothing_comes_too_close_in_a_hundred_thousand_steps():
    """Property 38. Random arms and the Panda, all shapes, seven kinds of command; judged ten times per step."""
    runs, shapes, by_fcl = [], set(), math.inf
    for seed in range(SCENES):
        scene = random_scene(seed)
        tally, log = run_scene(scene, seed, STEPS_EACH, 10, 6)
        assert tally[TOO_CLOSE] == 0 and tally[BEYOND] == 0, f"seed {seed}: {tally}"
        room = fcl_rooms(scene, log, 3)
        assert room >= -2e-5, f"seed {seed}: {room} m by fcl"
        by_fcl = min(by_fcl, room)
        shapes |= {type(obstacle.shape) for obstacle in scene.obstacles}
        runs.append(tally)
    tally = total(runs)
    assert tally[STEPS] == SCENES * STEPS_EACH and shapes == {Sphere, Capsule, Box, Cylinder, Mesh}
    assert tally[FALSE_STOPS] <= 0.02 * tally[ROOMY]
    if SHARE >= 1:
        # it came to it: steps at the surface, changed, held; and python-fcl saw them
        assert tally[AT_SURFACE] > 5000 and tally[STATUS + CHANGED] > 10_000 and tally[STATUS + HELD] > 500
        assert tally[ROOMY] > 20_000 and by_fcl < 2e-3


def test_not_even_a_hair_is_given_up_between_the_ends_of_a_step():
    """Scenes that the long run found."""
    for seed in (13,):
        tally, _ = run_scene(random_scene(seed), seed, 2500, 10, 1)
        assert tally[TOO_CLOSE] == 0, f"{seed}: {tally[WORST]} m"


def test_stops_of_any_kind_with_room_around_are_rare():
    tally = total([run_scene(random_scene(seed, "random"), seed, 2000, 1, 1)[0] for seed in range(20)])
    assert tally[STOPPED] <= 0.02 * tally[ROOMY]


def test_a_joint_at_its_limit_does_not_stop_the_others_when_pushed():
    layer = SafetyLayer([gantry(reach=1.0, speed=1.0)], [BALL], [], DT)
    result = layer([1.0, 0.0, 0.0], [0.5, 0.5, -0.5])
    np.testing.assert_allclose(result.velocity, [0.0, 0.5, -0.5], rtol=0, atol=1e-6)


@pytest.mark.parametrize("kind", ["two pandas", "panda"])
def test_arms_hit_neither_each_other_nor_themselves(kind):
    """Two Pandas face each other at 0.8 m, all pairs between them; judged by python-fcl too."""
    runs = []
    for seed in range(4):
        scene = random_scene(seed, kind)
        tally, log = run_scene(scene, seed, max(20, round(1000 * SHARE)), 5, 2)
        assert tally[TOO_CLOSE] == 0 and tally[BEYOND] == 0, seed
        assert fcl_rooms(scene, log, 2) >= -2e-5
        runs.append(tally)
    assert SHARE < 1 or total(runs)[AT_SURFACE] > 5


def test_two_arms_driven_at_each_other_stop_at_the_distance_to_keep():
    """Straight reach against straight reach, with no obstacle at all; a layer without the pairs lets them meet."""
    robot, least = facing_pandas(1.3), {}
    seeing = SafetyLayer(robot.arms, robot.bodies, [], DT, pairs=robot.pairs)
    blind = SafetyLayer(robot.arms, robot.bodies, [], DT)
    for layer in (seeing, blind):
        q, rooms = np.concatenate([READY, READY]), []
        for _ in range(150):
            q = q + DT * layer(q, np.tile([0.0, 0.4, 0.0, 0.8, 0.0, 0.0, 0.0], 2)).velocity
            rooms.append(slack_at(seeing.work, q, 0.0, 1.0))
        least[layer] = min(rooms)
    assert -1e-9 <= least[seeing] < 3e-3 and least[blind] < -0.02


@pytest.mark.parametrize("thick", [0.001, 0.02])
@pytest.mark.parametrize("dt", [0.01, 0.2])
def test_a_plate_is_not_jumped_over_however_fast(thick, dt):
    layer = point_among([Obstacle(Box((3.0, 3.0, thick)))], dt, speed=1e3)
    rng = np.random.default_rng(0)
    for height in (0.5 * thick + 0.0305, 0.05, 0.3, 2.0):
        q = np.array([0.0, 0.0, height])
        for _ in range(60):
            q = q + dt * layer(q, [*rng.normal(size=2), -1e9]).velocity
            assert q[2] >= 0.5 * thick + 0.03 - 1e-12


def test_absurd_numbers_count_as_nothing_or_as_fast():
    layer = point_among([Obstacle(Box((1.0, 1.0, 1.0)))], speed=2.0)
    result = layer([0.0, 0.0, 1.0], [np.nan, np.inf, 1.0])
    np.testing.assert_array_equal(result.velocity, [0.0, 0.0, 1.0])
    assert result.status == CHANGED
    np.testing.assert_allclose(layer([0.0, 0.0, 1.0], [0.0, 1e300, -1e300]).velocity, [0, 2, -2], atol=1e-12)
    assert not layer([0.0, 0.0, 1.0], [np.nan] * 3).velocity.any()


def test_a_start_that_is_too_close_is_left_and_never_made_worse():
    layer = point_among([Obstacle(Box((1.0, 1.0, 1.0)))], speed=1.0)
    q = np.array([0.0, 0.0, 0.525])
    for _ in range(200):
        after = q + DT * layer(q, [0.1, 0.0, -1.0]).velocity
        assert after[2] >= q[2]
        q = after
    assert q[2] == pytest.approx(0.53, abs=3e-4)


# ------------------------------------------------------------------ joint limits


@for_all(seeds, st.sampled_from([0.002, 0.01, 0.05]), max_examples=40)
def test_joint_limits_are_never_exceeded(seed, dt):
    rng = np.random.default_rng(seed)
    arm = random_arm(seed, int(rng.integers(1, 8)), 0.3)
    layer = SafetyLayer([arm], [Body(np.zeros((0, 8)), ())], [], dt)
    q = rng.uniform(arm.lower, arm.upper)
    u = rng.choice([-1.0, 1.0], arm.dof) * 1e3
    for k in range(300):
        if k % 100 == 99:
            u = -u
        q = q + dt * layer(q, u + rng.normal(size=arm.dof)).velocity
        assert (q >= arm.lower - 1e-12).all() and (q <= arm.upper + 1e-12).all()


def test_joint_limits_hold_for_long_steps_too():
    layer = SafetyLayer([gantry(reach=1.0)], [BALL], [], 0.2)
    q = np.zeros(3)
    for _ in range(20):
        q = q + 0.2 * layer(q, [10.0, -10.0, 3.0]).velocity
        assert (np.abs(q) <= 1.0 + 1e-12).all()


def test_beyond_a_limit_the_only_way_is_back():
    layer = SafetyLayer([gantry(reach=1.0, speed=1.0)], [BALL], [], DT)
    assert layer([1.1, 0.0, 0.0], [0.5, 0.0, 0.0]).velocity[0] == pytest.approx(0.0, abs=1e-9)
    assert layer([1.1, 0.0, 0.0], [-0.5, 0.0, 0.0]).velocity[0] == -0.5


# ------------------------------------------------------------------ moving obstacles


def chase(speed: float, push, retreat: float = 0.5, steps: int = 300):
    """A sphere comes at a point that wants to stay or to meet it: smallest room, and the statuses."""
    q, least, seen = np.zeros(3), math.inf, set()
    ball = Obstacle(Sphere(0.1), Pose.from_position_quaternion([0.5, 0, 0]), (-speed, 0, 0))
    for k in range(steps):
        layer = point_among([ball.at(k * DT)], speed=retreat)
        result = layer(q, push)
        seen.add(result.status)
        q = q + DT * result.velocity
        least = min(least, float(np.linalg.norm(q - ball.at((k + 1) * DT).pose.position)) - 0.13)
    return least, seen


@pytest.mark.parametrize("push", [(0.0, 0.0, 0.0), (5.0, 0.0, 0.0)])
def test_a_sphere_slower_than_the_retreat_never_comes_too_close(push):
    """Property 39."""
    for speed in (0.1, 0.3, 0.49):
        least, seen = chase(speed, push)
        assert least >= -1e-9 and BLOCKED not in seen
        assert least < 0.09  # it was there


def test_a_faster_sphere_is_reported_before_it_is_too_close():
    for speed in (0.7, 2.0):
        q, ball = np.zeros(3), Obstacle(Sphere(0.1), Pose.from_position_quaternion([0.5, 0, 0]), (-speed, 0, 0))
        reported = False
        for k in range(300):
            result = point_among([ball.at(k * DT)], speed=0.5)(q, [0.0, 0.0, 0.0])
            reported |= result.blocked
            # while it is at it, it gets away as fast as it can
            if result.blocked and result.slack < 0.02 and k * DT * speed < 0.4:
                assert result.velocity[0] == pytest.approx(-0.5, abs=1e-6)
            q = q + DT * result.velocity
            if np.linalg.norm(q - ball.at((k + 1) * DT).pose.position) - 0.13 < 0:
                break
        assert reported


def test_what_moves_away_or_along_does_not_disturb():
    for velocity in [(0.0, 0.0, -3.0), (0.0, 0.5, 0.0)]:
        floor = Obstacle(Box((9.0, 9.0, 1.0)), Pose.from_position_quaternion([0, 0, -0.5]), velocity)
        result = point_among([floor])([0.0, 0.0, 0.035], [0.1, 0.0, 0.0])
        assert result.status == FREE


def test_an_obstacle_that_rises_lifts_the_point():
    floor = Obstacle(Box((9.0, 9.0, 1.0)), Pose.from_position_quaternion([0, 0, -0.5]), (0.0, 0.0, 0.2))
    result = point_among([floor])([0.0, 0.0, 0.0302], [0.1, 0.0, 0.0])
    np.testing.assert_allclose(result.velocity, [0.1, 0.0, 0.2], rtol=0, atol=1e-5)


def test_a_lead_looks_at_what_moves_ahead_of_time():
    floor = Obstacle(Box((9.0, 9.0, 1.0)), Pose.from_position_quaternion([0, 0, -0.6]), (0.0, 0.0, 0.2))
    q, u = [0.0, 0.0, 0.1], np.zeros(3)
    now, later = (point_among([floor], settings=SafetySettings(lead=lead)) for lead in (0.0, 0.75))
    assert now(q, u).status == FREE and later(q, u).slack == pytest.approx(0.02, abs=1e-12)


# ------------------------------------------------------------------ the tick


def test_a_hundred_thousand_ticks_allocate_nothing():
    rng = np.random.default_rng(2)
    obstacles = [Obstacle(random_shape(rng, kind), random_pose(rng, rng.normal(size=3) * 0.4)) for kind in KINDS]
    layer = SafetyLayer([panda()], [panda_body()], obstacles, DT, pairs=panda_pairs())
    ticks, state = max(20, round(100_000 * SHARE)), np.array([7.0])

    def run(g, q, u, dt, out, state, ticks):
        held = 0
        for k in range(ticks):
            for i in range(len(q)):
                state[0] = (16807.0 * state[0]) % 2147483647.0
                if k % 50 == 0:
                    q[i] = 3.0 * state[0] / 2147483647.0 - 1.5
                u[i] = 4.0 * state[0] / 2147483647.0 - 2.0
            held += 1 if safe_velocity(g, q, u, dt, out) > 0 else 0
        return held

    compiled = jit.numba.njit(error_model="numpy")(run)
    arrays = np.zeros(7), np.zeros(7), DT, np.zeros(7), state
    jit.import_module("numba.core.runtime._nrt_python").memsys_enable_stats()
    stats = jit.import_module("numba.core.runtime").rtsys.get_allocation_stats

    def allocated(count):
        before = stats()
        changed = compiled(layer.work, *arrays, count)
        return stats().alloc - before.alloc, changed

    # the call itself wraps its five arrays
    assert allocated(1)[0] == allocated(2)[0] <= 5
    counted, changed = allocated(ticks)
    assert counted <= 5 and changed > 0.3 * ticks


def test_the_same_tick_gives_the_same_bits():
    obstacles, rng = random_obstacles(np.random.default_rng(3)), np.random.default_rng(4)
    one, other = (SafetyLayer([panda()], [panda_body()], obstacles, DT, pairs=panda_pairs()) for _ in range(2))
    for _ in range(50):
        q, u = rng.uniform(panda().lower, panda().upper), 3 * rng.normal(size=7)
        first = one(q, u)
        one(rng.uniform(panda().lower, panda().upper), u)  # what was before does not matter
        again, elsewhere = one(q, u), other(q, u)
        assert first.velocity.tobytes() == again.velocity.tobytes() == elsewhere.velocity.tobytes()
        assert first[1:] == again[1:] == elsewhere[1:]


def test_the_inputs_are_not_written_to():
    layer, q, u = point_among([Obstacle(Sphere(0.1))]), np.array([0.2, 0, 0]), np.array([-9.0, np.nan, 1.0])
    before = q.tobytes(), u.tobytes()
    layer(q, u)
    assert before == (q.tobytes(), u.tobytes())
