"""Steps and edges: called clear only where nothing comes too near between their ends."""

from __future__ import annotations

import math
import os

import numpy as np
import pytest
from helpers.planner.clearance_cases import POINT, SAFETY, robot, work_of
from helpers.planner.guarded_point import gantry
from helpers.solids import random_pose
from soak import panda_body, panda_pairs, random_obstacles

from onedemo.planner.collision.capsule_placement import place_capsules
from onedemo.planner.collision.clearance import find_near, slack_at
from onedemo.planner.collision.edge_certificates import is_clear, tool_arrays, tool_slack
from onedemo.planner.collision.robot_arrays import ROW
from onedemo.planner.collision.step_certificates import reach_of, step_stays_clear
from onedemo.planner.geometry import screw
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import Box, Obstacle, Sphere, pack
from onedemo.planner.robot.arm import Arm
from onedemo.planner.robot.body import Body

SHARE = float(os.environ.get("ONEDEMO_SOAK", "1"))
"""Scales the long runs."""


# ------------------------------------------------------------------ steps


def proven(g, q, step, dt: float) -> bool:
    """What the guard asks: are all pairs that can matter clear during a step?"""
    place_capsules(g, q, ROW.placed)
    g[ROW.step, : len(q)] = step
    find_near(g, reach_of(g, g[ROW.step], dt))
    return bool(step_stays_clear(g, q, step, dt))


def worst_room(g, q, step, dt: float, count: int = 200) -> float:
    return min(slack_at(g, q + s * step, s * dt, 0.1) for s in np.linspace(0, 1, count + 1))


def test_a_step_that_is_proven_clear_is_clear():
    """Random arms and all shapes, still and moving, plates of 2 mm; steps up to a radian; judged at 200 places."""
    counts = {True: 0, False: 0}
    for seed in range(max(10, round(300 * SHARE))):
        g, arm, _, rng = robot(seed, moving=bool(seed % 2))
        for _ in range(20):
            q = rng.uniform(-2, 2, arm.dof)
            if slack_at(g, q, 0.0, 1.0) < 2e-4:
                continue
            step, dt = rng.normal(size=arm.dof) * rng.choice([0.01, 0.1, 0.5]), float(rng.choice([0.01, 0.2]))
            answer = proven(g, q, step, dt)
            counts[answer] += 1
            if answer:
                assert worst_room(g, q, step, dt) >= -1e-9, (seed, q, step)
    assert SHARE < 1 or min(counts.values()) > 200


def test_a_step_with_room_to_spare_is_proven_clear():
    """Not only safe but useful: few steps that stay 2 mm away from too close are refused."""
    refused = asked = 0
    for seed in range(150):
        g, arm, _, rng = robot(seed, moving=bool(seed % 2))
        for _ in range(10):
            q, step = rng.uniform(-2, 2, arm.dof), 0.03 * rng.normal(size=arm.dof)
            if slack_at(g, q, 0.0, 1.0) > 2e-3 and worst_room(g, q, step, 0.02, 50) > 2e-3:
                asked += 1
                refused += not proven(g, q, step, 0.02)
    assert asked > 200 and refused <= 0.01 * asked


@pytest.mark.parametrize("speed", [0.5, 3.0, 50.0])
@pytest.mark.parametrize("thick", [1e-3, 0.05])
def test_no_step_tunnels_through_a_plate(speed, thick):
    g = work_of(gantry(), POINT, [Obstacle(Box((1.0, 1.0, thick)))])
    for slant in (0.0, 0.3):
        q = np.array([0.0, 0.0, 0.5 * thick + 0.035])
        step = speed * np.array([slant, 0.0, -1.0])
        assert not proven(g, q, step, 1.0)
        assert not proven(g, q + step, -step, 1.0)
        assert proven(g, q, -0.02 * step / speed, 1.0)


def test_a_fast_plate_does_not_tunnel_through_a_robot_at_rest():
    for velocity in (0.5, 30.0):
        plate = Obstacle(Box((1.0, 1.0, 1e-3)), Pose.from_position_quaternion([0, 0, -0.3]), (0, 0, velocity))
        g = work_of(gantry(), POINT, [plate])
        assert not proven(g, np.zeros(3), np.zeros(3), 1.0)
        # one that is outrun is clear
        assert velocity > 1.0 or proven(g, np.zeros(3), np.array([0.0, 0.0, 1.01 * velocity]), 1.0)
        away = Obstacle(plate.shape, plate.pose, (0, 0, -velocity))
        assert proven(work_of(gantry(), POINT, [away]), np.zeros(3), np.zeros(3), 1.0)


def test_a_short_motion_along_a_plane_is_proven():
    g = work_of(gantry(), POINT, [Obstacle(Box((4.0, 4.0, 1.0)))])
    q = np.array([-1.0, 0.3, 0.5 + 0.02 + 0.01 + 1.1e-4])
    assert proven(g, q, np.array([0.02, -0.02, 0.0]), 1.0)
    assert not proven(g, q, np.array([0.02, -0.02, -3e-4]), 1.0)


def test_sliding_along_a_plane_is_proven_however_long():
    g = work_of(gantry(), POINT, [Obstacle(Box((4.0, 4.0, 1.0)))])
    q = np.array([-1.0, 0.3, 0.5 + 0.02 + 0.01 + 1.1e-4])
    assert proven(g, q, np.array([2.0, -0.5, 0.0]), 1.0)


def test_a_pass_by_a_small_ball_is_not_proven_by_two_distances_that_suffice_for_contact():
    g = work_of(gantry(), POINT, [Obstacle(Sphere(0.001))])
    q, step = np.array([-0.008, 0.0, 0.030]), np.array([0.016, 0.0, 0.0])
    assert slack_at(g, q, 0.0, 1.0) > 0 and worst_room(g, q, step, 1.0) < -9e-4
    assert not proven(g, q, step, 1.0)


def test_a_path_of_one_joint_bends_towards_the_wall():
    """What bulges out between the ends is seen, however the wall stands."""
    chain = np.zeros((2, 8))
    chain[:, 0] = 1.0
    arm = Arm("door", ("hinge",), chain, np.array([-3.0]), np.array([3.0]), np.array([50.0]))
    body = Body(np.array([[0, 0.5, 0, 0, 0.5, 0, 0, 0.02]]), ("edge",))
    for angle in (0.1, 0.4, 1.0):
        bulge = 0.5 * (1.0 - math.cos(0.5 * angle))
        for share, clear in ((0.3, False), (0.9, False), (0.99, False), (1.5, True)):
            face = 0.5 * math.cos(0.5 * angle) + share * bulge + SAFETY.distance + 0.02
            wall = Obstacle(Box((10, 10, 10)), Pose.from_position_quaternion([face + 5.0, 0, 0]))
            g = work_of(arm, body, [wall])
            assert proven(g, np.array([-0.5 * angle]), np.array([angle]), 1.0) == clear


def planar_arm() -> Arm:
    chain = np.zeros((3, 8))
    chain[:, 0] = 1.0
    chain[1:, 4] = 0.5
    return Arm("planar", ("a", "b"), chain, np.full(2, -4.0), np.full(2, 4.0), np.full(2, 50.0))


def folded_case(q1: float, step, share: float):
    """Work array, joints: the tip of a folded arm bends towards a wall in the middle of a step."""
    tip_body = Body(np.array([[1, 0.5, 0, 0, 0.5, 0, 0, 0.02]]), ("tip",))

    def tip(s):
        a, b = s * step[0], q1 + s * (step[0] + step[1])
        return 0.5 * np.array([math.cos(a) + math.cos(b), math.sin(a) + math.sin(b), 0.0])

    chord = tip(1.0) - tip(0.0)
    off = tip(0.5) - 0.5 * (tip(0.0) + tip(1.0))
    n = -(off - off @ chord / (chord @ chord) * chord)
    n /= np.linalg.norm(n)
    heights = [n @ tip(s) for s in np.linspace(0, 1, 101)]
    ends, low = min(heights[0], heights[-1]), min(heights)
    face = ends - share * (ends - low) - SAFETY.distance - 0.02
    turn = Pose.from_position_quaternion(np.zeros(3), [math.cos(a := 0.5 * math.atan2(n[1], n[0])), 0, 0, math.sin(a)])
    wall = Obstacle(Box((10, 10, 10)), Pose.from_position_quaternion((face - 5.0) * n, turn.quaternion))
    return work_of(planar_arm(), tip_body, [wall]), np.array([0.0, q1])


def test_a_path_that_bends_towards_the_wall_is_not_proven():
    for q1 in np.linspace(math.pi - 0.1, math.pi + 0.1, 21):
        for step in ([0.215, 0.2616], [0.14, 0.136], [-0.2, -0.075]):
            for share in (0.6, 0.75, 0.88):
                g, q = folded_case(q1, step, share)
                if proven(g, q, np.array(step), 1.0):
                    assert worst_room(g, q, np.array(step), 1.0) >= -1e-9


def test_a_pair_that_keeps_its_distance_keeps_all_of_it_within_a_step():
    g = work_of(gantry(), POINT, [Obstacle(Sphere(0.1))])
    # past the ball: 0.05 mm of room at both ends, 0.05 mm less than none in the middle
    reach = 0.1 + 0.02 + SAFETY.distance
    x = math.sqrt((reach + 5e-5) ** 2 - (reach - 4e-5) ** 2)
    q, step = np.array([-x, 0.0, reach - 4e-5]), np.array([2 * x, 0.0, 0.0])
    assert worst_room(g, q, step, 1.0) < -3e-5
    assert not proven(g, q, step, 1.0)


def test_a_pair_that_is_too_close_may_part_but_not_close_in():
    g = work_of(gantry(), POINT, [Obstacle(Box((1.0, 1.0, 1.0)))])
    q = np.array([0.0, 0.0, 0.525])
    assert proven(g, q, np.array([0.0, 0.0, 0.1]), 1.0)
    assert proven(g, q, np.array([0.1, 0.0, 0.0]), 1.0)
    assert not proven(g, q, np.array([0.0, 0.0, -2e-4]), 1.0)


def test_a_robot_does_not_hit_itself_within_a_step():
    """The Panda's own pairs, judged at 50 places."""
    from helpers.arms import panda

    arm, rng = panda(), np.random.default_rng(0)
    g, seen = work_of(arm, panda_body(), [], panda_pairs()), [0, 0]
    for _ in range(3000):
        q = rng.uniform(arm.lower, arm.upper)
        step = rng.normal(size=7) * rng.choice([0.02, 0.2])
        if slack_at(g, q, 0.0, 1.0) > 2e-4:
            answer = proven(g, q, step, 0.05)
            seen[answer] += 1
            if answer:
                assert worst_room(g, q, step, 0.05, 50) >= -1e-9
    assert min(seen) > 30


def test_an_edge_past_a_small_ball_and_a_turn_through_a_plate_are_not_proven():
    """A slide that comes a little too close half-way, from far and near; a turn on the spot, at the end of a rod."""
    ball = pack([Obstacle(Sphere(0.001))])
    g = tool_arrays(np.array([[0, 0, 0, 0, 0, 0, 0.02]]), ball, margin=0.01)
    for height in (0.001, 0.02, 0.029, 0.0305):
        for reach in (0.04, 0.1, 0.5, 2.0):
            x, y = (tuple(Pose.from_position_quaternion([side * reach, 0, height]).dq) for side in (-1, 1))
            assert not is_clear(g, x, y, 0.01)
    x, y = (tuple(Pose.from_position_quaternion([side, 0, 0.0315]).dq) for side in (-1, 1))
    assert is_clear(g, x, y, 0.01)
    plate = pack([Obstacle(Box((1.0, 0.001, 1.0)), Pose.from_position_quaternion([0.6, 0, 0]))])
    g = tool_arrays(np.array([[0.3, 0, 0, 0.3, 0, 0, 0.02]]), plate, margin=0.01)
    x, y, away = (
        tuple(Pose.from_position_quaternion(np.zeros(3), [np.cos(a), 0, 0, np.sin(a)]).dq) for a in (-0.3, 0.5, -0.9)
    )
    assert not is_clear(g, x, y, 0.01) and is_clear(g, x, away, 0.01)


@pytest.mark.parametrize("turning", [False, True])
def test_an_edge_of_a_tool_that_is_proven_clear_is_clear(turning):
    """Slides and screws, judged at 200 places; and few that are clear are refused."""
    counts, refused = [0, 0], 0
    for seed in range(max(25, round(60 * SHARE))):
        rng = np.random.default_rng(seed)
        tool = np.column_stack([rng.uniform(-0.1, 0.1, (2, 6)), [0.03, 0.02]])
        g = tool_arrays(tool, pack(random_obstacles(rng)), margin=0.01)
        for _ in range(10):
            x = random_pose(rng, rng.uniform(-0.6, 0.6, 3))
            way = random_pose(rng) if turning else Pose.identity()
            y = Pose.from_position_quaternion(
                x.position + rng.normal(size=3) * rng.choice([0.01, 0.1, 0.5]),
                (x @ way).quaternion if turning else x.quaternion,
            )
            x, y = tuple(x.dq), tuple(y.dq)
            if not turning:
                y = (*x[:4], *y[4:]) if np.allclose(x[:4], y[:4]) else (*x[:4], *(-v for v in y[4:]))
            answer = bool(is_clear(g, x, y, 0.01))
            counts[answer] += 1
            if answer or SHARE >= 1:
                twist = screw.twist_of(screw.mul(screw.conj(x), y))
                places = np.linspace(0, 1, 201 if SHARE >= 1 else 51)
                poses = [screw.mul(x, screw.from_twist(screw.scaled(twist, s))) for s in places]
                rooms = [tool_slack(g, pose, 0.02) for pose in poses]
                assert not answer or min(rooms) >= -1e-9
                refused += not answer and min(rooms) > 1e-3
    assert SHARE < 1 or (min(counts) > 30 and refused <= 3)
