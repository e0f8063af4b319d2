"""Pairs that are close, how they change with the joints, and steps that are proven to stay clear."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.arms import random_arm
from helpers.planner.clearance_cases import POINT, SAFETY, robot, work_of
from helpers.planner.guarded_point import gantry
from helpers.solids import random_pose
from helpers.strategies import for_all
from hypothesis import strategies as st
from soak import facing_pandas, frames_of, random_body, random_obstacles

from onedemo.planner import jit
from onedemo.planner.collision.capsule_placement import place_capsules
from onedemo.planner.collision.clearance import capsule_distance, find_near, min_slack, obstacle_distance, slack_at
from onedemo.planner.collision.robot_arrays import CAPSULE, HEADER, NEAR_PAIR, PLACED, ROW, SETTING, robot_arrays
from onedemo.planner.collision.step_certificates import bound_motion, near_pair_slack
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import Obstacle, Sphere, pack
from onedemo.planner.robot.arm import Arm
from onedemo.planner.robot.body import Body
from onedemo.planner.safety.barrier import _lay_bounds
from onedemo.planner.safety.qp import QP

seeds = st.integers(0, 10**6)
lay_bounds = jit.numba.njit(error_model="numpy")(lambda g, q: _lay_bounds(g, q))


def near_rows(g) -> np.ndarray:
    first = int(g[ROW.header, HEADER.first_near])
    return g[first : first + int(g[ROW.header, HEADER.near])]


def all_gaps(g, world: int = ROW.placed) -> dict[tuple, float]:
    """Distance of every pair, one by one."""
    capsules, obstacles, pairs = (int(g[ROW.header, k]) for k in (HEADER.capsules, HEADER.obstacles, HEADER.pairs))
    gaps = {}
    for c in range(capsules):
        if g[ROW.body + c, CAPSULE.frame] >= 0:
            for k in range(obstacles):
                gaps[0, c, k] = obstacle_distance(g, world, c, k, 0.0, 1e3)
    for i, j in g[ROW.obstacles + obstacles : ROW.obstacles + obstacles + pairs, :2].astype(int):
        gaps[1, i, j] = capsule_distance(g, world, i, j)
    return gaps


@for_all(seeds, st.sampled_from([0.02, 0.1, 0.5, 2.0]), max_examples=60)
def test_the_near_pairs_are_all_that_are_near(seed, shell):
    g, arm, _, rng = robot(seed)
    place_capsules(g, rng.uniform(-2, 2, arm.dof), ROW.placed)
    least = find_near(g, shell)
    found = {
        (int(r[NEAR_PAIR.self_pair]), int(r[NEAR_PAIR.capsule]), int(r[NEAR_PAIR.other])): r[NEAR_PAIR.distance]
        for r in near_rows(g)
    }
    wanted = {pair: gap for pair, gap in all_gaps(g).items() if gap <= shell}
    assert found.keys() == wanted.keys() and len(near_rows(g)) == len(found)
    for pair, gap in wanted.items():
        assert found[pair] == pytest.approx(gap, abs=1e-12)
    rooms = [gap - (SAFETY.self_distance if pair[0] else SAFETY.distance) for pair, gap in wanted.items()]
    if rooms:
        assert least == pytest.approx(min(rooms), abs=1e-12) == pytest.approx(near_pair_slack(g, -1, 0.0), abs=1e-12)
    assert all(
        r[NEAR_PAIR.margin] == (SAFETY.self_distance if r[NEAR_PAIR.self_pair] else SAFETY.distance)
        for r in near_rows(g)
    )


@for_all(seeds, st.floats(-0.2, 1.0), max_examples=60)
def test_the_smallest_room_is_that_of_all_pairs_up_to_the_cutoff(seed, cutoff):
    g, arm, _, rng = robot(seed)
    q = rng.uniform(-2, 2, arm.dof)
    place_capsules(g, q, ROW.placed)
    rooms = [gap - (SAFETY.self_distance if pair[0] else SAFETY.distance) for pair, gap in all_gaps(g).items()]
    least = min([100.0, *rooms])
    assert slack_at(g, q, 0.0, 100.0) == pytest.approx(least, abs=1e-12)
    assert slack_at(g, q, 0.0, cutoff) == pytest.approx(min(least, cutoff), abs=1e-12)
    assert min_slack(g, ROW.placed, 0.0, 100.0) == slack_at(g, q, 0.0, 100.0)


@for_all(seeds, max_examples=40)
def test_capsules_stand_where_independent_kinematics_puts_them(seed):
    g, arm, body, rng = robot(seed)
    q = rng.uniform(-3, 3, arm.dof)
    frames = frames_of(arm, q)
    for world in (ROW.placed, ROW.placed_next):
        place_capsules(g, q, world)
        for c, row in enumerate(body.rows):
            frame = frames[int(row[0]) + 1]
            for k in (0, 3):
                point = frame[:3, :3] @ row[1 + k : 4 + k] + frame[:3, 3]
                np.testing.assert_allclose(g[world + c, k : k + 3], point, rtol=0, atol=1e-12)


def test_masked_pairs_fixed_parts_and_own_margins():
    arm = random_arm(3, 2, 0.0)
    body = Body(np.array([[-1, 0, 0, 0, 0, 0, 0.1, 0.05], [1, 0, 0, 0, 0, 0, 0.1, 0.05]]), ("base", "hand"))
    q = np.zeros(2)
    at = Pose.from_position_quaternion(frames_of(arm, q)[2][:3, 3] + [0.2, 0, 0])
    obstacles = [Obstacle(Sphere(0.1), at), Obstacle(Sphere(0.1), margin=0.03)]
    rooms = {}
    for masks in ((0, 0), (0b10, 0), (0b01, 0), (0b10, 0b10)):
        g = work_of(arm, body, obstacles, masks=masks)
        place_capsules(g, q, ROW.placed)
        find_near(g, 10.0)
        rooms[masks] = [tuple(row[[NEAR_PAIR.capsule, NEAR_PAIR.other, NEAR_PAIR.margin]]) for row in near_rows(g)]
    assert rooms[0, 0] == rooms[0b01, 0] == [(1, 0, 0.01), (1, 1, 0.03)]
    assert rooms[0b10, 0] == [(1, 1, 0.03)] and rooms[0b10, 0b10] == []


@for_all(seeds, max_examples=60)
def test_bounds_are_the_derivatives_of_the_distances(seed):
    """Central differences; the pair's need holds the obstacle's own velocity."""
    g, arm, _, rng = robot(seed, moving=True)
    q, n = rng.uniform(-2, 2, arm.dof), arm.dof
    place_capsules(g, q, ROW.placed)
    find_near(g, 0.5)
    lay_bounds(g, q)
    rows, first = near_rows(g).copy(), int(g[ROW.header, HEADER.first_bound])
    bounds = g[first : first + len(rows)].copy()
    for row, bound in zip(rows, bounds, strict=True):
        if row[NEAR_PAIR.distance] < 1e-3:
            continue

        def gap(q, seconds, row=row):
            place_capsules(g, q, ROW.placed_next)
            i, j = int(row[NEAR_PAIR.capsule]), int(row[NEAR_PAIR.other])
            return (
                capsule_distance(g, ROW.placed_next, i, j)
                if row[NEAR_PAIR.self_pair]
                else obstacle_distance(g, ROW.placed_next, i, j, seconds, 1e3)
            )

        h = 1e-5
        for i in range(n):
            e = h * np.eye(n)[i]
            plus, minus = gap(q + e, 0.0), gap(q - e, 0.0)
            if abs(plus + minus - 2 * row[NEAR_PAIR.distance]) < 1e-7:  # no kink in between
                assert bound[i] == pytest.approx((plus - minus) / (2 * h), abs=2e-4)
        assert not bound[n : QP.image].any()
        closing = 0.0 if row[NEAR_PAIR.self_pair] else (gap(q, -h) - gap(q, h)) / (2 * h)
        room = row[NEAR_PAIR.distance] - row[NEAR_PAIR.margin] - SAFETY.buffer
        assert bound[QP.bound] == pytest.approx(closing - SAFETY.alpha * room, abs=2e-4)


def test_the_last_bounds_are_the_speeds_that_each_joint_may_have():
    """Down to its lowest, up to its highest, near its limits at both ends too."""
    arm = gantry(reach=1.0, speed=1.0)
    g = work_of(arm, POINT, [])
    for q in ([0.0, 0.0, 0.0], [1.0, -1.0, 0.99], [-0.999, 0.9, 1.0]):
        q = np.array(q)
        place_capsules(g, q, ROW.placed)
        find_near(g, 0.5)
        assert lay_bounds(g, q) == 6
        first = int(g[ROW.header, HEADER.first_bound])
        rows = g[first : first + 6]
        np.testing.assert_array_equal(rows[:, :3], np.repeat(np.eye(3), 2, axis=0) * np.tile([1, -1], 3)[:, None])
        gain = SAFETY.limit_gain
        low, high = np.maximum(-1.0, gain * (-1.0 - q)), np.minimum(1.0, gain * (1.0 - q))
        np.testing.assert_allclose(rows[::2, QP.bound], low, rtol=0, atol=1e-12)
        np.testing.assert_allclose(rows[1::2, QP.bound], -high, rtol=0, atol=1e-12)
        assert not rows[:, QP.softness].any()


def test_bounds_of_two_arms_move_only_the_joints_of_their_own():
    """Both Pandas, against an obstacle and against each other."""
    robot, rng = facing_pandas(), np.random.default_rng(0)
    ball = Obstacle(Sphere(0.1), Pose.from_position_quaternion([0.4, 0, 0.4]))
    bodies = [Body(body.rows, body.names) for body in robot.bodies]
    g = robot_arrays(robot.arms, bodies, pack([ball]), pairs=robot.pairs, margin=0.01, settings=SAFETY.packed(0.01))
    checked = 0
    for _ in range(5):
        q = rng.uniform(g[ROW.lower, :14], g[ROW.upper, :14])
        place_capsules(g, q, ROW.placed)
        find_near(g, 0.3)
        lay_bounds(g, q)
        rows, first = near_rows(g).copy(), int(g[ROW.header, HEADER.first_bound])
        bounds = g[first : first + len(rows), :14].copy()
        for row, bound in zip(rows, bounds, strict=True):
            i, j = int(row[NEAR_PAIR.capsule]), int(row[NEAR_PAIR.other])
            if row[NEAR_PAIR.distance] < -0.02:
                continue
            slopes = []
            for e in 1e-6 * np.eye(14):
                gaps = []
                for sign in (1, -1):
                    place_capsules(g, q + sign * e, ROW.placed_next)
                    gap = (
                        capsule_distance(g, ROW.placed_next, i, j)
                        if row[NEAR_PAIR.self_pair]
                        else obstacle_distance(g, ROW.placed_next, i, j, 0.0, 1e3)
                    )
                    gaps.append(gap)
                slopes.append((gaps[0] - gaps[1]) / 2e-6)
            checked += 1
            np.testing.assert_allclose(bound, slopes, rtol=0, atol=1e-3)
    assert checked > 20


@for_all(seeds, st.floats(-3, 0.5), max_examples=100)
def test_no_point_of_a_core_goes_farther_than_its_bound(seed, exponent):
    """Lengths of sampled ways: arms with turning and sliding joints, steps up to half a turn."""
    rng = np.random.default_rng(seed)
    arm = random_arm(seed, int(rng.integers(1, 8)), 0.3)
    body = random_body(arm, rng)
    g = work_of(arm, body, [])
    q, step = rng.uniform(-2, 2, arm.dof), 10**exponent * rng.normal(size=arm.dof) * (rng.uniform(size=arm.dof) < 0.7)
    place_capsules(g, q, ROW.placed)
    bound_motion(g, ROW.placed, step)
    bound = g[ROW.placed : ROW.placed + len(body), PLACED.reach].copy()
    places = []
    for s in np.linspace(0, 1, 60):
        place_capsules(g, q + s * step, ROW.placed_next)
        ends = g[ROW.placed_next : ROW.placed_next + len(body), :6].reshape(-1, 2, 3)
        places.append(np.concatenate([ends, ends.mean(axis=1, keepdims=True)], axis=1))
    ways = np.linalg.norm(np.diff(places, axis=0), axis=3).sum(axis=0).max(axis=1)
    assert (ways <= bound + 1e-12).all()
    # and it is no wild guess for small steps
    if 10**exponent < 0.01:
        assert (bound <= 3 * arm.dof * ways + 1e-3).all()


def test_the_bound_grows_with_a_lever_that_a_later_joint_lengthens():
    """An arm folded so that its end is on the first axis: what it sweeps there is not seen at the start."""
    for seed in range(8):
        arm = random_arm(seed, 2, 0.0)
        g = work_of(arm, Body(np.array([[1, 0.5, 0.0, 0.0, 0.5, 0.0, 0.0, 0.02]]), ("ball",)), [])

        def farthest_way(q, step, g=g):
            place_capsules(g, q, ROW.placed)
            bound_motion(g, ROW.placed, step)
            bound, places = g[ROW.placed, PLACED.reach], []
            for s in np.linspace(0, 1, 200):
                place_capsules(g, q + s * step, ROW.placed_next)
                places.append(g[ROW.placed_next, :3].copy())
            return bound, np.linalg.norm(np.diff(places, axis=0), axis=1).sum()

        turns = [np.array([0.0, turn]) for turn in np.linspace(-3, 3, 121)]
        folded = min(turns, key=lambda q: farthest_way(q, np.array([0.1, 0.0]))[1])
        step = np.array([1.5, 1.5])
        alone = sum(farthest_way(folded, part)[0] for part in (step * [1, 0], step * [0, 1]))
        bound, way = farthest_way(folded, step)
        assert way <= bound + 1e-12
        assert bound > alone + 0.1


def test_the_bound_of_one_joint_is_its_arc():
    arm = random_arm(1, 1, 0.0)
    body = Body(np.array([[0, 0.3, 0.4, 0.1, 0.3, 0.4, 0.7, 0.02]]), ("rod",))
    g = work_of(arm, body, [])
    place_capsules(g, np.zeros(1), ROW.placed)
    bound_motion(g, ROW.placed, np.array([-0.2]))
    assert g[ROW.placed, PLACED.reach] == pytest.approx(0.2 * 0.5, abs=1e-12)


def test_the_clearance_does_not_depend_on_the_frame_of_the_world():
    rng = np.random.default_rng(2)
    arm = random_arm(2, 5, 0.3)
    body, obstacles = random_body(arm, rng), random_obstacles(rng)
    body = Body(
        body.rows[body.rows[:, 0] >= 0], tuple(n for n, r in zip(body.names, body.rows, strict=True) if r[0] >= 0)
    )
    moved = random_pose(rng, (0.3, -0.2, 0.5))
    chain = arm.chain.copy()
    first = moved @ Pose.from_position_quaternion(chain[0, 4:7], chain[0, :4])
    chain[0, :4], chain[0, 4:7] = first.quaternion, first.position
    there = Arm("there", arm.joint_names, chain, arm.lower, arm.upper, arm.velocity_limits)
    elsewhere = [Obstacle(o.shape, moved @ o.pose) for o in obstacles]
    for _ in range(50):
        q = rng.uniform(-2, 2, 5)
        one, other = work_of(arm, body, obstacles), work_of(there, body, elsewhere)
        assert slack_at(one, q, 0.0, 9.0) == pytest.approx(slack_at(other, q, 0.0, 9.0), abs=1e-9)


def test_later_means_where_the_obstacle_will_be():
    ball = Obstacle(Sphere(0.1), Pose.from_position_quaternion([0.1, 0.2, 1.0]), (0.2, 0.3, -0.4))
    g = work_of(gantry(), POINT, [ball])
    for seconds in (0.0, 0.5, 1.0):
        later = work_of(gantry(), POINT, [ball.at(seconds)])
        here = slack_at(g, np.zeros(3), seconds, 9.0)
        assert here == pytest.approx(slack_at(later, np.zeros(3), 0.0, 9.0), abs=1e-12)
        assert here == pytest.approx(np.linalg.norm(ball.at(seconds).pose.position) - 0.13, abs=1e-12)
    assert g[ROW.settings, SETTING.self_margin] == 0.015
