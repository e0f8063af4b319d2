"""Hulls in capsules: exact where a capsule is close, never more than the truth, proven between the ends of a step."""

from __future__ import annotations

import math
from dataclasses import replace

import fcl
import numpy as np
import pytest
from helpers.arms import random_arm
from helpers.solids import KINDS, fcl_capsule, fcl_distance, fcl_obstacle, random_pose, random_shape
from helpers.strategies import for_all
from hypothesis import strategies as st
from scipy.spatial import ConvexHull
from soak import random_obstacles

from onedemo.planner import jit
from onedemo.planner.collision.capsule_placement import place_capsules
from onedemo.planner.collision.clearance import find_near, min_slack, slack_at
from onedemo.planner.collision.edge_certificates import is_clear, tool_arrays, tool_slack
from onedemo.planner.collision.hull_distance import CLOSE, obstacle_hull_distance, pair_hull_distance
from onedemo.planner.collision.robot_arrays import CAPSULE, HEADER, NEAR_PAIR, ROW, robot_arrays
from onedemo.planner.collision.step_certificates import near_pair_slack, step_stays_clear
from onedemo.planner.errors import BadModel, BadOption, BadShape, UnknownName, WrongType
from onedemo.planner.geometry import screw
from onedemo.planner.geometry.convex_distance import PER_ROW, convex_distance
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import Box, Mesh, Obstacle, Sphere, core_of, pack
from onedemo.planner.robot.arm import Arm
from onedemo.planner.robot.body import Body, Hull
from onedemo.planner.robot.joint_frames import joint_frames, moved
from onedemo.planner.safety.barrier import _lay_bounds
from onedemo.planner.safety.safety_layer import SafetyLayer, SafetySettings
from onedemo.planner.search.joint_space_rrt import joint_edge_is_clear

seeds = st.integers(0, 10**6)
lay_bounds = jit.numba.njit(error_model="numpy")(lambda g, q: _lay_bounds(g, q))
SAFETY = SafetySettings(distance=0.01, self_distance=0.015, shell=0.3)


def hull_in(row: np.ndarray, rng) -> Hull:
    """Corners of a hull that fills a part of a capsule (7)."""
    core = row[:3] + rng.uniform(size=(24, 1)) * (row[3:6] - row[:3])
    away = rng.normal(size=(24, 3))
    away *= row[6] * rng.uniform(0.3, 1.0, (24, 1)) / np.linalg.norm(away, axis=1)[:, None]
    rounding = float(rng.choice([0.0, 0.1 * row[6]]))
    scale = 1.0 - rounding / row[6]
    return Hull(Mesh.hull_of(core + scale * away).vertices, rounding)


def robot(seed: int, margin: float = 0.01):
    """Array, arm, body and pairs of a random robot with hulls in most capsules, and its obstacles."""
    rng = np.random.default_rng(seed)
    arm = random_arm(seed, int(rng.integers(2, 8)), 0.2)
    frames = np.arange(-1, arm.dof, dtype=float)
    ends = rng.uniform(-0.1, 0.1, (len(frames), 6))
    rows = np.column_stack([frames, ends, rng.uniform(0.03, 0.1, len(frames))])
    hulls = tuple(hull_in(row[1:], rng) if rng.uniform() < 0.8 else None for row in rows)
    body = Body(rows, tuple(f"part{k}" for k in range(len(rows))), hulls=hulls)
    pairs = [(i, j) for i in range(len(rows)) for j in range(i + 2, len(rows))]
    obstacles = random_obstacles(rng)
    g = robot_arrays((arm,), (body,), pack(obstacles), margin=margin, pairs=pairs, settings=SAFETY.packed(0.01))
    return g, arm, body, pairs, obstacles, rng


def swallowed(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether one of two hulls holds a point of the other: fcl sees the surfaces of meshes only."""
    for points, point in ((one, other[0]), (other, one[0])):
        if len(points) > 3:
            planes = ConvexHull(points).equations
            if (planes[:, :3] @ point + planes[:, 3]).max() <= 0.0:
                return True
    return False


def corners_of(obstacle: Obstacle) -> np.ndarray:
    """Corners of a mesh, else the middle alone."""
    shape = obstacle.shape
    return moved(obstacle.pose, shape.vertices) if isinstance(shape, Mesh) else obstacle.pose.position[None]


def solid(body: Body, c: int, frames: list[Pose]) -> tuple[fcl.CollisionObject, float]:
    """What capsule c covers, in fcl, and a radius around it."""
    row, frame = body.rows[c], frames[int(body.rows[c, 0]) + 1]
    hull = body.hulls[c]
    if hull is None:
        return fcl_capsule(moved(frame, row[1:4]), moved(frame, row[4:7]), row[7]), 0.0
    return fcl_obstacle(Obstacle(Mesh(moved(frame, hull.corners)))), hull.rounding


def truth(body: Body, arm, obstacles, pairs, q) -> dict[tuple, float]:
    """Distance of every pair of what the capsules cover, by fcl; not above 0 if they touch."""
    frames = [Pose.identity(), *joint_frames(arm, q)]
    solids = [solid(body, c, frames) for c in range(len(body))]
    places = [frames[int(row[0]) + 1] for row in body.rows]
    points = [
        moved(place, row[1:4])[None] if hull is None else moved(place, hull.corners)
        for row, hull, place in zip(body.rows, body.hulls, places, strict=True)
    ]
    out = {}
    for c, (item, radius) in enumerate(solids):
        if body.rows[c, 0] < 0:
            continue
        for k, obstacle in enumerate(obstacles):
            inside = swallowed(points[c], corners_of(obstacle))
            out[0, c, k] = 0.0 if inside else fcl_distance(item, fcl_obstacle(obstacle)) - radius
    for i, j in pairs:
        inside = swallowed(points[i], points[j])
        out[1, i, j] = 0.0 if inside else fcl_distance(solids[i][0], solids[j][0]) - solids[i][1] - solids[j][1]
    return out


@for_all(seeds, st.sampled_from(KINDS), max_examples=80)
def test_the_distance_of_a_hull_is_that_of_fcl(seed, kind):
    rng = np.random.default_rng(seed)
    corners = Mesh.hull_of(rng.normal(size=(30, 3)) * rng.uniform(0.02, 0.2, 3)).vertices
    pose, other = random_pose(rng, rng.uniform(-0.3, 0.3, 3)), random_shape(rng, kind, 0.2)
    obstacle = Obstacle(other, random_pose(rng, rng.uniform(-0.4, 0.4, 3)))
    rows = [np.pad(corners[k : k + PER_ROW].ravel(), (0, 40))[:40] for k in range(0, len(corners), PER_ROW)]
    vertices = other.vertices if kind == "mesh" else np.zeros((0, 3))
    g = np.vstack([*rows, np.pad(vertices, ((0, 0), (0, 37)))])
    number, rounding, half, _ = core_of(other)
    distance, normal, point = convex_distance(
        g, 0, len(corners), tuple(pose.rotation.ravel()), tuple(pose.position), number, half,
        len(rows), len(vertices), tuple(obstacle.pose.rotation.ravel()), tuple(obstacle.pose.position), math.inf,
    )  # fmt: skip
    world = moved(pose, corners)
    true = fcl_distance(fcl_obstacle(Obstacle(Mesh(world))), fcl_obstacle(obstacle))
    if distance == 0.0:
        assert true <= rounding + 1e-5 or swallowed(world, corners_of(obstacle))
        return
    assert np.linalg.norm(normal) == pytest.approx(1.0)
    # fcl ends at a tolerance of its own, so that it is not the judge of the last micrometres
    assert distance - rounding <= max(true, 0.0) + 2e-4 or true <= 0.0
    if true > 1e-4:
        assert distance - rounding == pytest.approx(true, abs=2e-4)
    # the plane through the closest point bounds the hull
    assert (world @ normal).min() == pytest.approx(np.dot(point, normal), abs=1e-6)


@for_all(seeds, max_examples=60)
def test_the_slack_is_exact_where_it_is_close_and_never_too_large(seed):
    g, arm, body, pairs, obstacles, rng = robot(seed)
    for q in rng.uniform(-2.5, 2.5, (4, arm.dof)):
        true = truth(body, arm, obstacles, pairs, q)
        slacks = {key: gap - (SAFETY.self_distance if key[0] else 0.01) for key, gap in true.items()}
        least, slack = min(slacks.values()), slack_at(g, q, 0.0, 10.0)
        if min(true.values()) <= 1e-5:  # fcl's last micrometres
            assert slack < 0.0
        else:
            assert slack <= least + 3e-4
            if least < CLOSE - 1e-3:
                assert slack == pytest.approx(least, abs=3e-4)


@for_all(seeds, max_examples=60)
def test_near_pairs_have_the_slack_of_all_pairs(seed):
    g, arm, *_, rng = robot(seed)
    q = rng.uniform(-2.5, 2.5, arm.dof)
    place_capsules(g, q, ROW.placed)
    least = find_near(g, 0.3)
    assert min(least, 0.2) == pytest.approx(min_slack(g, ROW.placed, 0.0, 0.2), abs=1e-6)
    if least > 1.0:  # no pair is near
        return
    assert near_pair_slack(g, -1, 0.0) == pytest.approx(least, abs=1e-9)
    place_capsules(g, q, ROW.placed_next)
    assert near_pair_slack(g, ROW.placed_next, 0.0) == pytest.approx(least, abs=1e-6)
    first = int(g[ROW.header, HEADER.first_near])
    near = g[first : first + int(g[ROW.header, HEADER.near])]
    exact = near[near[:, NEAR_PAIR.exact] == 1.0]
    normals = exact[:, NEAR_PAIR.normal : NEAR_PAIR.normal + 3]
    assert np.allclose(np.linalg.norm(normals, axis=1), 1.0)


@for_all(seeds, max_examples=40)
def test_bounds_are_the_slopes_of_the_distances_of_hulls(seed):
    g, arm, *_, rng = robot(seed)
    q = rng.uniform(-2.5, 2.5, arm.dof)
    place_capsules(g, q, ROW.placed)
    find_near(g, 0.3)
    lay_bounds(g, q)
    first, count, bound = (int(g[ROW.header, k]) for k in (HEADER.first_near, HEADER.near, HEADER.first_bound))
    near, bounds = g[first : first + count].copy(), g[bound : bound + count, : arm.dof].copy()
    for row, slope in zip(near, bounds, strict=True):
        if row[NEAR_PAIR.exact] == 0.0 or row[NEAR_PAIR.distance] < 1e-3:
            continue
        i, j = int(row[NEAR_PAIR.capsule]), int(row[NEAR_PAIR.other])
        for joint in range(arm.dof):
            gaps = []
            for turn in (-1e-4, 0.0, 1e-4):
                place_capsules(g, q + turn * np.eye(arm.dof)[joint], ROW.placed_next)
                if row[NEAR_PAIR.self_pair] == 1.0:
                    gaps.append(pair_hull_distance(g, ROW.placed_next, i, j, 1.0)[0])
                else:
                    gaps.append(obstacle_hull_distance(g, ROW.placed_next, i, j, (0.0, 0.0, 0.0), 1.0)[0])
            # where the closest corner changes, the slope is any between those of both sides
            sides = sorted([(gaps[1] - gaps[0]) / 1e-4, (gaps[2] - gaps[1]) / 1e-4])
            assert sides[0] - 5e-3 <= slope[joint] <= sides[1] + 5e-3


def sampled_slack(g, q, step, count: int = 60) -> float:
    return min(slack_at(g.copy(), q + s * step, 0.0, 1.0) for s in np.linspace(0.0, 1.0, count))


@for_all(seeds, st.floats(0.01, 0.4), max_examples=120)
def test_a_proven_step_stays_clear_in_between(seed, size):
    g, arm, *_, rng = robot(seed)
    for q in rng.uniform(-2.5, 2.5, (10, arm.dof)):
        if slack_at(g, q, 0.0, 1.0) < 0.0:
            continue
        step = size * rng.normal(size=arm.dof)
        place_capsules(g, q, ROW.placed)
        find_near(g, 5.0)
        if step_stays_clear(g, q, step, 0.01):
            assert sampled_slack(g, q, step) > -1e-6
        if joint_edge_is_clear(g, q, q + step):
            assert sampled_slack(g, q, step) > -1e-6


def test_a_bar_that_turns_about_its_end_is_not_proven_past_a_post_in_its_swing():
    """The core stands still on the axis: only the hull moves."""
    turn = Arm("turntable", ("turn",), np.eye(2, 8), [-3.0], [3.0], [1.0])
    bar = Hull(np.array([[x, y, z] for x in (0.0, 0.2) for y in (-0.005, 0.005) for z in (-0.005, 0.005)]))
    body = Body(np.array([[0, 0, 0, 0, 0, 0, 0, 0.201]]), ("bar",), hulls=(bar,))
    post = Obstacle(Sphere(0.01), Pose.from_position_quaternion([0.15 * math.cos(0.4), 0.15 * math.sin(0.4), 0.0]))
    g = robot_arrays((turn,), (body,), pack([post]), margin=0.001, settings=SAFETY.packed(0.01))
    assert min(slack_at(g, np.array([angle]), 0.0, 1.0) for angle in (0.0, 0.8)) > 0.03
    assert slack_at(g, np.array([0.4]), 0.0, 1.0) < 0.0
    for step, is_proven in ((0.8, False), (0.7, False), (0.1, True)):
        place_capsules(g, np.zeros(1), ROW.placed)
        find_near(g, 5.0)
        assert step_stays_clear(g, np.zeros(1), np.array([step]), 0.01) == is_proven
    assert not joint_edge_is_clear(g, np.zeros(1), np.array([0.8]))


@for_all(seeds, st.floats(-0.2, 0.2), max_examples=60)
def test_beyond_any_cutoff_a_lower_bound_suffices_and_up_to_it_the_distance_is_exact(seed, cutoff):
    """A negative cutoff too: a robot that is too close already asks by how much."""
    g, arm, _, pairs, _, rng = robot(seed)
    place_capsules(g, rng.uniform(-2.5, 2.5, arm.dof), ROW.placed)
    for i, j in pairs:
        if g[ROW.body + i, CAPSULE.corners] + g[ROW.body + j, CAPSULE.corners] == 0.0:
            continue
        truth, found = (pair_hull_distance(g, ROW.placed, i, j, limit)[0] for limit in (math.inf, cutoff))
        assert found <= truth + 1e-9
        assert found > cutoff if truth > cutoff else found == pytest.approx(truth, abs=1e-6)


def test_steps_are_proven_that_capsules_alone_could_not_prove():
    """What the hulls are for: postures and steps that the capsules refuse."""
    more = proven = 0
    for seed in range(40):
        g, arm, body, pairs, obstacles, rng = robot(seed)
        bare = Body(body.rows, body.names)
        h = robot_arrays((arm,), (bare,), pack(obstacles), margin=0.01, pairs=pairs, settings=SAFETY.packed(0.01))
        for q in rng.uniform(-2.5, 2.5, (20, arm.dof)):
            assert slack_at(g, q, 0.0, 1.0) >= slack_at(h, q, 0.0, 1.0) - 1e-9
            more += slack_at(g, q, 0.0, 1.0) >= 0.0 > slack_at(h, q, 0.0, 1.0)
            step = 0.02 * rng.normal(size=arm.dof)
            ways = [joint_edge_is_clear(work, q, q + step) for work in (g, h)]
            assert ways[0] or not ways[1]
            proven += ways[0] and not ways[1]
    assert more > 20 and proven > 10


@for_all(seeds, st.booleans(), max_examples=80)
def test_a_proven_motion_of_the_tool_stays_clear_in_between(seed, turning):
    rng = np.random.default_rng(seed)
    rows = np.column_stack([rng.uniform(-0.1, 0.1, (3, 6)), rng.uniform(0.03, 0.1, 3)])
    hulls = [hull_in(row, rng) for row in rows]
    g = tool_arrays(rows, pack(random_obstacles(rng)), hulls=hulls, margin=0.01)
    for _ in range(10):
        x = random_pose(rng, rng.uniform(-0.6, 0.6, 3))
        y = random_pose(rng, x.position + rng.uniform(-0.2, 0.2, 3))
        y = y if turning else Pose.from_position_quaternion(y.position, x.quaternion)
        a, b = tuple(x.dq.tolist()), tuple(y.dq.tolist())
        if is_clear(g, a, b, 0.01):
            twist = screw.twist_of(screw.mul(screw.conj(a), b))
            for s in np.linspace(0.0, 1.0, 50):
                at = screw.mul(a, screw.from_twist(screw.scaled(twist, float(s))))
                assert tool_slack(g, at, 1.0) > -1e-6


@for_all(seeds, max_examples=30)
def test_the_safety_layer_keeps_what_the_capsules_cover_clear(seed):
    g, arm, body, pairs, obstacles, rng = robot(seed)
    q = next((q for q in rng.uniform(-2.5, 2.5, (300, arm.dof)) if slack_at(g, q, 0.0, 1.0) > 1e-6), None)
    if q is None:
        return
    layer = SafetyLayer([arm], [body], obstacles, 0.02, settings=SAFETY, pairs=pairs)
    wish = rng.normal(size=arm.dof)
    for k in range(60):
        wish = rng.normal(size=arm.dof) if k % 15 == 0 else wish
        velocity = layer(q, wish).velocity
        assert sampled_slack(layer.work, q, 0.02 * velocity, 6) > -1e-6
        q = q + 0.02 * velocity


def test_hulls_that_do_not_fit_are_refused():
    rows, names = np.array([[0, 0, 0, 0, 0, 0, 0.1, 0.05]]), ("link1",)
    cube = Hull(0.02 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]))
    kept = Body(np.tile(rows, (2, 1)), names * 2, hulls=(cube, cube)).hulls
    assert kept[0] is kept[1] and np.array_equal(kept[0].corners, cube.corners)
    with pytest.raises(BadShape, match="hulls"):
        Body(rows, names, hulls=(cube, cube))
    with pytest.raises(BadShape, match="hull of link1"):
        Body(rows, names, hulls=(Hull(np.zeros((4, 2))),))
    with pytest.raises(BadModel, match="link1"):
        Body(rows, names, hulls=(Hull(np.full((4, 3), np.nan)),))
    with pytest.raises(BadModel, match=r"pairs\[0\]"):
        Body(rows, names, pairs=((0, 1),))
    for margins in ({(0, 1): 0.01}, {(0, 1): math.nan}):
        with pytest.raises(BadModel, match="margins"):
            Body(rows, names, margins=margins)
    with pytest.raises(BadModel, match="margins"):
        Body(np.tile(rows, (2, 1)), names * 2, pairs=((0, 1),), margins={(0, 1): -0.01})
    with pytest.raises(WrongType, match="hull of link1"):
        Body(rows, names, hulls=(np.zeros((4, 3)),))
    with pytest.raises(BadOption, match="unknown"):
        Body(rows, names).ignoring(("link1", "link1"))
    with pytest.raises(UnknownName, match="elbow"):
        Body(rows, names, pairs=()).ignoring(("link1", "elbow"))


@for_all(seeds, max_examples=60)
def test_a_pair_keeps_the_smaller_of_its_own_and_the_usual_margin(seed):
    _, arm, body, pairs, _, rng = robot(seed)
    margins = {pair: float(rng.choice([0.0, 0.004, 0.05])) for pair in pairs if rng.uniform() < 0.7}
    kept = {pair: min(margins.get(pair, math.inf), SAFETY.self_distance) for pair in pairs}
    close = replace(body, pairs=tuple(pairs), margins=margins)
    g = robot_arrays((arm,), (close,), pack(()), pairs=pairs, settings=SAFETY.packed(0.01))
    layer = SafetyLayer([arm], [close], [], 0.02, settings=SAFETY, pairs=pairs)
    for q in rng.uniform(-2.5, 2.5, (5, arm.dof)):
        slack = math.inf
        for pair in pairs:
            usual = replace(SAFETY, self_distance=kept[pair]).packed(0.01)
            alone = robot_arrays((arm,), (body,), pack(()), pairs=[pair], settings=usual)
            slack = min(slack, slack_at(alone, q, 0.0, 1.0))
        for work in (g, layer.work):
            assert slack_at(work, q, 0.0, 1.0) == pytest.approx(slack, abs=1e-9)
            place_capsules(work, q, ROW.placed)
            assert min(find_near(work, 5.0), 1.0) == pytest.approx(slack, abs=1e-9)
            assert joint_edge_is_clear(work, q, q) == (slack >= 0.0)
        if slack > 1e-6:
            velocity = layer(q, rng.normal(size=arm.dof)).velocity
            assert slack_at(layer.work, q + 0.02 * velocity, 0.0, 1.0) > -1e-9


def test_margins_go_with_their_pairs():
    rows = np.array([[k, 0, 0, 0, 0, 0, 0.1, 0.03] for k in range(-1, 4)], dtype=float)
    body = Body(rows, ("base", "link1", "link2", "link3", "hand"), pairs=((0, 4), (1, 4)), margins={(1, 4): 0.003})
    held = body.holding("block", Sphere(0.02), Pose.identity(), random_arm(1, 4))
    assert held.margins == held.released().margins == {(1, 4): 0.003} and body.moving().margins == {(0, 3): 0.003}
    assert body.ignoring(("link1", "hand")).margins == {} and body.ignoring(("base", "hand")).margins == body.margins


def test_a_held_object_is_checked_against_the_arm_but_not_the_hand():
    arm = random_arm(1, 4)
    rows = np.array([[k, 0, 0, 0, 0, 0, 0.1, 0.03] for k in range(-1, 4)], dtype=float)
    body = Body(rows, ("base", "link1", "link2", "link3", "hand"), pairs=((0, 4),))
    held = body.holding("block", Sphere(0.02), Pose.identity(), arm)
    assert held.pairs == ((0, 4), (0, 5), (1, 5), (2, 5)) and held.released().pairs == ((0, 4),)
    assert held.ignoring(("block", "base")).pairs == ((0, 4), (1, 5), (2, 5))


def test_what_is_inside_a_wide_capsule_may_come_close_to_a_box():
    """A thin plate in a fat capsule: the capsule touches, the plate is 3 cm away."""
    arm = random_arm(5, 1, 0.0)
    plate = Hull(np.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-0.001, 0.001)]))
    body = Body(np.array([[0, 0, 0, 0, 0, 0, 0, 0.15]]), ("plate",), hulls=(plate,))
    frame = joint_frames(arm, np.zeros(1))[0]
    over = frame @ Pose.from_position_quaternion([0.0, 0.0, 0.041])
    wall = Obstacle(Box((0.5, 0.5, 0.02)), over)
    g = robot_arrays((arm,), (body,), pack([wall]), margin=0.0)
    assert slack_at(g, np.zeros(1), 0.0, 1.0) == pytest.approx(0.03, abs=1e-6)
