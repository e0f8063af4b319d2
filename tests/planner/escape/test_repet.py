"""Escape trees: nothing unsound by other means, every convex body passed, every setting does what it says."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from helpers.random_scenes import Gauge, at, boxes, random_tool, tool_gap, tool_problem
from helpers.solids import KINDS as FORMS
from helpers.solids import random_pose, random_shape, true_distance
from helpers.strategies import assert_same_pose, for_all, random_dq, st

from onedemo.planner.collision.clearance import find_near
from onedemo.planner.collision.edge_certificates import is_clear, place_tool, point_speeds, slide_is_clear, tool_arrays
from onedemo.planner.collision.edge_certificates import screw_is_clear as screw_clear
from onedemo.planner.collision.robot_arrays import PLACED, ROW
from onedemo.planner.errors import BadOption, BadShape, NotFinite, OneDemoError
from onedemo.planner.escape.detour import TOO_LONG, escape, first_blocked
from onedemo.planner.escape.escape_tree import expand
from onedemo.planner.escape.repet import (
    MAX_OBSTACLES,
    VERDICTS,
    EscapeTree,
    RepetSettings,
    TangentPlane,
    clear_of,
    escape_path,
    point_tool,
)
from onedemo.planner.escape.tree_arrays import NODE, OPTION, tree_arrays
from onedemo.planner.geometry import dualquat as dq
from onedemo.planner.geometry import screw
from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.geometry.shapes import Box, Obstacle, Sphere, pack
from onedemo.planner.imitation.tsia import screw_path

DEFAULTS = RepetSettings()
FINE = 5e-4
"""Steps of the dense checks: no point of the tool moves more than this [m] between two looks."""
KEPT, EDGE, VISITED, OUTSIDE, HOME = range(len(VERDICTS))


def tuple_of(pose: Pose) -> tuple[float, ...]:
    return tuple(float(value) for value in pose.dq)


def reach_of(tool: np.ndarray) -> float:
    """Radius [m] of the ball about the tcp that holds a tool."""
    return float((np.linalg.norm(tool[:, :6].reshape(-1, 2, 3), axis=2).max(axis=1) + tool[:, 6]).max())


def between(x: Pose, y: Pose, tool: np.ndarray) -> np.ndarray:
    """Poses on the screw from x to y so near to each other that no point of the tool moves farther than `FINE`."""
    gap, angle = x.distance_to(y)
    # on the short screw the tcp's way is at most a quarter longer than (pi / 2 of) the straight line at half a turn
    count = math.ceil((0.5 * math.pi * gap + angle * reach_of(tool)) / FINE) + 1
    return dq.sclerp(x.dq, y.dq, np.linspace(0.0, 1.0, count + 1))


def least_gap(path: PosePath, tool: np.ndarray, obstacles, keep: float) -> float:
    """Smallest distance [m] of a tool on a path, by fcl every half millimeter.

    A look at distance D says all of the next (D - keep) meters, which are passed over; so a value above `keep` is a
    bound only.
    """
    gauge = Gauge(tool, obstacles)
    least, ahead = gauge(path[-1]), 0
    for x, y in pairwise(path):
        poses = between(x, y, tool)
        while ahead < len(poses):
            gap = gauge(Pose(poses[ahead]))
            least = min(least, gap)
            if gap < keep - 1e-3:
                return least
            ahead += max(1, int((gap - keep) / FINE))
        ahead -= len(poses)
    return least


def shortest(path: PosePath) -> float:
    return float(path.lengths()[-1])


def kept_rows(tree: EscapeTree) -> np.ndarray:
    return np.flatnonzero((tree.verdicts == KEPT) | (tree.verdicts == HOME))


def edge_lengths(tree: EscapeTree) -> np.ndarray:
    """(n - 1,) distance [m] of every node but the root from its parent."""
    positions = PosePath(tree.poses).positions
    return np.linalg.norm(positions[1:] - positions[tree.parents[1:]], axis=1)


# The promise: soundness (property 25), convex bodies (26), bits (27)


@pytest.mark.parametrize("kind", ["convex", "clutter", "gap", "trap", "shelf"])
def test_a_path_that_was_found_keeps_the_distance_and_both_ends(kind):
    found = 0
    for seed in range(6):
        path, tool, obstacles = tool_problem(kind, seed)
        escape = escape_path(path, tool, obstacles, seed=seed)
        if escape.found:
            found += 1
            assert least_gap(escape.path, tool, obstacles, DEFAULTS.distance) >= DEFAULTS.distance - 1e-6
            assert_same_pose(escape.path.dqs[[0, -1]], path.dqs[[0, -1]], 1e-15)
    assert found >= 5


def test_both_ends_are_exact():
    for seed in range(6):
        path, tool, obstacles = tool_problem("convex", seed)
        escape = escape_path(path, tool, obstacles, seed=seed)
        np.testing.assert_array_equal(escape.path.dqs[0], path.dqs[0])
        np.testing.assert_array_equal(np.abs(escape.path.dqs[-1]), np.abs(path.dqs[-1]))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["convex", "clutter", "gap", "trap", "shelf"])
@pytest.mark.parametrize("orientation", ["root", "spread", "turn"])
def test_many_paths_that_were_found_keep_the_distance(kind, orientation):
    settings = RepetSettings(orientation=orientation)
    for seed in range(100, 140):
        path, tool, obstacles = tool_problem(kind, seed)
        escape = escape_path(path, tool, obstacles, settings, seed=seed)
        if escape.found:
            assert least_gap(escape.path, tool, obstacles, settings.distance) >= settings.distance - 1e-6, seed


@pytest.mark.parametrize("shape", FORMS)
def test_a_convex_body_in_free_space_is_always_passed(shape):
    for seed in range(40):
        path, tool, obstacles = tool_problem("convex", seed, shape)
        escape = escape_path(path, tool, obstacles, seed=seed)
        assert escape.found, f"seed {seed}: {escape.reason}"
        assert escape.detours, f"seed {seed}: there was nothing on the way"


def test_a_closed_cage_is_an_honest_failure_and_leaves_its_tree():
    for seed in range(10):
        path, tool, obstacles = tool_problem("cage", seed)
        escape = escape_path(path, tool, obstacles, seed=seed)
        assert escape.reason in ("no escape found", "node limit reached")
        assert not escape.found and not escape.detours
        assert escape.path is path
        assert 1 < len(escape.tree.poses) <= DEFAULTS.nodes
        assert not (escape.tree.verdicts == HOME).any()


@pytest.mark.parametrize("kind", ["clutter", "shelf", "cage"])
def test_the_same_seed_gives_the_same_bits(kind):
    for seed in range(6):
        path, tool, obstacles = tool_problem(kind, seed)
        one, two = (escape_path(path, tool, obstacles, seed=seed) for _ in range(2))
        np.testing.assert_array_equal(one.path.dqs, two.path.dqs)
        assert (one.reason, one.detours, one.tree is None) == (two.reason, two.detours, two.tree is None)
        if one.tree is not None:
            np.testing.assert_array_equal(one.tree.poses, two.tree.poses)


def test_seeds_differ_where_chance_is_asked():
    path, tool, obstacles = tool_problem("cage", 0)
    one, two = (escape_path(path, tool, obstacles, seed=seed).tree.poses for seed in (1, 2))
    assert one.shape != two.shape or (one != two).any()


@for_all(st.integers(0, 10**6), max_examples=25)
def test_what_is_far_away_changes_no_bit(seed):
    path, tool, _ = tool_problem("clutter", seed)
    rng = np.random.default_rng(seed)
    far = [Obstacle(random_shape(rng, kind), random_pose(rng, [30.0, 0.0, 0.0])) for kind in FORMS]
    escape = escape_path(path, tool, far)
    assert escape.found and escape.tree is None and not escape.detours
    assert escape.path.dqs.tobytes() == path.dqs.tobytes()


# Its parts: the bound (28), certified edges, clearances


@for_all(st.integers(0, 10**6), max_examples=40)
def test_the_bound_of_an_edge_is_no_less_than_the_way_of_any_point(seed):
    rng = np.random.default_rng(seed)
    tool, x, y = random_tool(rng), Pose(random_dq(rng)), Pose(random_dq(rng))
    work = tool_arrays(tool, pack([]))
    fastest = point_speeds(work, screw.twist_of(screw.mul(screw.conj(tuple_of(x)), tuple_of(y))))
    bounds = work[ROW.placed : ROW.placed + len(tool), PLACED.reach]
    poses = [Pose(row) for row in dq.sclerp(x.dq, y.dq, np.linspace(0, 1, 400))]
    turns, places = np.array([pose.rotation for pose in poses]), np.array([pose.position for pose in poses])
    inside = tool[:, :3] + rng.uniform(size=(len(tool), 1)) * (tool[:, 3:6] - tool[:, :3])
    ways = []
    for points in (tool[:, :3], tool[:, 3:6], inside):
        track = np.einsum("kij,mj->kmi", turns, points) + places[:, None]
        ways.append(np.linalg.norm(np.diff(track, axis=0), axis=2).sum(axis=0))
    assert (np.array(ways) <= bounds + 1e-12).all()
    np.testing.assert_allclose(np.maximum(ways[0], ways[1]), bounds, rtol=1e-4, err_msg="an end goes that far")
    assert fastest == bounds.max()


def some_edge(rng, turned: bool):
    """A tool, an obstacle near an edge, the edge; hits and misses are about as frequent."""
    tool, x = random_tool(rng), random_pose(rng)
    delta = rng.normal(size=3) * 0.15
    y = at(x.position + delta, x.quaternion)
    if turned:
        y = y @ Pose(dq.dq_from_twist([0, 0, 0, *(rng.normal(size=3) * 0.7)]))
    kind = FORMS[rng.integers(len(FORMS))]
    place = x.position + rng.uniform(-0.2, 1.2) * delta + rng.normal(size=3) * 0.1
    return tool, Obstacle(random_shape(rng, kind), random_pose(rng, place)), x, y


@pytest.mark.parametrize("turned", [False, True])
def test_an_edge_is_called_clear_exactly_where_dense_samples_are(turned):
    rng, verdicts = np.random.default_rng(int(turned)), []
    for _ in range(60):
        tool, obstacle, x, y = some_edge(rng, turned)
        keep = rng.choice([0.0, 0.01, 0.03])
        work = tool_arrays(tool, pack([obstacle]), margin=keep)
        clear = bool(is_clear(work, tuple_of(x), tuple_of(y), keep))
        assert clear == bool(screw_clear(work, tuple_of(x), tuple_of(y))) or not turned
        least = least_gap(PosePath(np.array([x.dq, y.dq])), tool, [obstacle], keep)
        if clear:
            assert least >= keep - 1e-6
        else:
            assert least <= keep + 3e-4, "refused though there is room"
        verdicts.append(clear)
    assert 15 < sum(verdicts) < 45, "hits and misses"


@pytest.mark.slow
@pytest.mark.parametrize("turned", [False, True])
def test_many_edges_called_clear_are(turned):
    rng = np.random.default_rng(10 + turned)
    for _ in range(1500):
        tool, obstacle, x, y = some_edge(rng, turned)
        work = tool_arrays(tool, pack([obstacle]), margin=0.01)
        if is_clear(work, tuple_of(x), tuple_of(y), 0.01):
            assert least_gap(PosePath(np.array([x.dq, y.dq])), tool, [obstacle], 0.01) >= 0.01 - 1e-6


def test_a_slide_and_a_screw_without_a_turn_agree():
    rng = np.random.default_rng(5)
    for _ in range(200):
        tool, obstacle, x, y = some_edge(rng, False)
        work = tool_arrays(tool, pack([obstacle]), margin=0.01)
        place_tool(work, tuple_of(x), ROW.placed)
        find_near(work, x.distance_to(y)[0] + 0.01)
        slides = bool(slide_is_clear(work, tuple(y.position - x.position)))
        if slides != bool(screw_clear(work, tuple_of(x), tuple_of(y))):
            least = least_gap(PosePath(np.array([x.dq, y.dq])), tool, [obstacle], 0.01)
            assert abs(least - 0.01) < 3e-4, "they differ where it is not a matter of the last tenth of a millimeter"


def test_distances_of_a_tool_are_those_of_another_library():
    rng = np.random.default_rng(2)
    for _ in range(40):
        tool, pose = random_tool(rng), random_pose(rng)
        obstacle = Obstacle(random_shape(rng, FORMS[rng.integers(5)]), random_pose(rng, rng.normal(size=3) * 0.3))
        gap = tool_gap(tool, [obstacle], pose)
        if gap > 0:
            assert clear_of(pose, tool, [obstacle]) == pytest.approx(min(gap, 1.0), abs=1e-6)
    assert clear_of(Pose.identity(), point_tool(0.1), [Obstacle(Sphere(0.1), at([5, 0, 0]))]) == 1.0
    assert clear_of(Pose.identity(), point_tool(0.1), []) == 1.0


def test_the_distance_of_a_tool_knows_no_margins():
    ball = Obstacle(Sphere(0.1), at([0.5, 0.0, 0.0]), margin=0.05)
    assert clear_of(Pose.identity(), point_tool(0.1), [ball]) == pytest.approx(0.3, abs=1e-12)


# The tree as data


@pytest.mark.parametrize("kind, seed", [("trap", 0), ("clutter", 3), ("cage", 1)])
@pytest.mark.parametrize("orientation", ["root", "turn"])
def test_a_tree_is_consistent(kind, seed, orientation):
    path, tool, obstacles = tool_problem(kind, seed)
    settings = RepetSettings(orientation=orientation)
    escape = escape_path(path, tool, obstacles, settings, seed=seed)
    tree = escape.tree
    assert tree.parents[0] == -1
    assert (tree.parents[1:] >= 0).all() and (tree.parents[1:] < np.arange(1, len(tree.parents))).all()
    assert set(tree.verdicts) <= set(range(len(VERDICTS)))
    assert (tree.verdicts == HOME).sum() == escape.found
    assert np.isin(tree.parents[1:], kept_rows(tree)).all(), "only what was kept has children"
    assert len(tree.planes) == len(set(tree.parents[1:]))
    np.testing.assert_allclose(np.linalg.norm(tree.poses[:, :4], axis=1), 1.0, atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_children_lie_in_planes_that_touch_at_the_closest_point(seed):
    """The paper's invariant; the normal is compared with how the distance by other means grows."""
    path, tool, obstacles = tool_problem("convex", seed)
    tool = tool[:1]  # of several parts the second nearest would have its say
    tree = escape_path(path, tool, obstacles).tree
    step = 1e-3
    positions = PosePath(tree.poses).positions
    opened = sorted(set(tree.parents[1:]))
    for row, plane in zip(opened, tree.planes, strict=True):
        assert isinstance(plane, TangentPlane)
        frame = np.column_stack([plane.u, plane.v, plane.normal])
        np.testing.assert_allclose(frame.T @ frame, np.eye(3), atol=1e-14)
        assert np.linalg.det(frame) > 0
        np.testing.assert_array_equal(plane.origin, positions[row])
        children = np.flatnonzero(tree.parents == row)
        assert len(children) == 8
        assert np.abs((positions[children] - plane.origin) @ plane.normal).max() < 1e-12
        pose = Pose(tree.poses[row])
        a, b = (pose.rotation @ end + pose.position for end in (tool[0, :3], tool[0, 3:6]))
        here, ahead, back = (
            true_distance(obstacles[0], a + way * plane.normal, b + way * plane.normal) for way in (0.0, step, -step)
        )
        # the closest points of convex bodies part one for one along the line between them
        assert ahead - here == pytest.approx(step, abs=1e-7)
        assert here - back == pytest.approx(step, abs=1e-7)


@pytest.mark.parametrize("kind, seed", [("trap", 1), ("clutter", 6), ("cage", 2)])
def test_verdicts_say_why(kind, seed):
    path, tool, obstacles = tool_problem(kind, seed)
    settings = RepetSettings(nodes=120, retries=0)
    tree = escape_path(path, tool, obstacles, settings, seed=seed).tree
    seen = PosePath(tree.poses).moved(Pose(tree.poses[0]).inverse()).positions
    cells = np.floor(seen[kept_rows(tree)] / (settings.cell * settings.step) + 0.5)
    assert len(np.unique(cells, axis=0)) == len(cells), "of two in one cell one is kept"
    for k in range(1, len(tree.poses)):
        edge = PosePath(tree.poses[[tree.parents[k], k]])
        if tree.verdicts[k] in (KEPT, HOME, VISITED):
            assert least_gap(edge, tool, obstacles, settings.distance) >= settings.distance - 1e-6
        elif tree.verdicts[k] == EDGE:
            assert least_gap(edge, tool, obstacles, settings.distance) <= settings.distance + 3e-4


# Coordinates


def moved(obstacles, world_from_old: Pose):
    return tuple(Obstacle(o.shape, world_from_old @ o.pose, name=o.name, margin=o.margin) for o in obstacles)


@pytest.mark.parametrize("kind", ["convex", "trap"])
def test_moving_the_world_moves_the_escape(kind):
    """Bases and the grid of visited places turn with the problem.

    What could break it: a path that runs head-on into a normal (the basis then falls back on an axis), and nodes of
    equal cost (rounding decides); random problems have neither.
    """
    settings = RepetSettings(basis="goal", retries=0)
    for seed in range(8):
        path, tool, obstacles = tool_problem(kind, seed)
        change = Pose(random_dq(np.random.default_rng(seed)))
        here = escape_path(path, tool, obstacles, settings)
        there = escape_path(path.moved(change), tool, moved(obstacles, change), settings)
        assert here.found == there.found
        assert here.detours == there.detours
        np.testing.assert_allclose(here.path.moved(change).positions, there.path.positions, atol=1e-6)


def test_the_papers_basis_does_not_move_with_the_world():
    settings = RepetSettings(basis="world", cell=1e-3, retries=0)
    apart = []
    for seed in range(8):
        path, tool, obstacles = tool_problem("convex", seed)
        change = Pose(random_dq(np.random.default_rng(seed)))
        here = escape_path(path, tool, obstacles, settings)
        there = escape_path(path.moved(change), tool, moved(obstacles, change), settings)
        apart.append(here.found and there.found and abs(shortest(here.path) - shortest(there.path)) > 1e-4)
    assert sum(apart) >= 4


# Settings

BALL = point_tool(0.02)
ALONG = screw_path(at([-0.3, 0.0, 0.0]), at([0.3, 0.0, 0.0]), 0.01)


@pytest.mark.parametrize(
    "values",
    [
        {"trigger": "late"}, {"basis": "tool"}, {"cost": "time"}, {"orientation": "upright"},
        {"shell": 0.0}, {"shell": math.nan}, {"shell": 0.02}, {"distance": -0.01}, {"distance": math.nan},
        {"distance": 0.05}, {"step": 0.0}, {"step": math.inf}, {"grow": 0.0}, {"shrink": -1.0}, {"spacing": 0.0},
        {"turn": 0.0}, {"cell": 0.0}, {"away": -1.0}, {"levels": 0}, {"levels": 101}, {"beam": 0}, {"beam": 1001},
        {"candidates": 0}, {"nodes": 0}, {"nodes": 10**6 + 1}, {"rounds": 0}, {"rounds": 101}, {"longest": 0},
        {"retries": -1}, {"retries": 1001}, {"random": -1}, {"random": 1001},
    ],
    ids=str,
)  # fmt: skip
def test_settings_out_of_range_are_refused_in_one_line(values):
    with pytest.raises(BadOption) as caught:
        RepetSettings(**values)
    assert next(iter(values)) in str(caught.value) or "shell" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "values",
    [
        {"trigger": "shell"}, {"basis": "world"}, {"cost": "goal"}, {"square": True}, {"orientation": "spread"},
        {"orientation": "turn"}, {"pull_back": True}, {"shortcut": False}, {"step": 0.04}, {"step": 0.12},
        {"levels": 20}, {"beam": 4}, {"distance": 0.0}, {"shell": 0.2}, {"random": 0}, {"random": 30}, {"away": 0.0},
        {"candidates": 1}, {"cell": 2.0}, {"nodes": 3000}, {"spacing": 0.05}, {"retries": 0}, {"bias": (0, 1, 0)},
    ],
    ids=str,
)  # fmt: skip
def test_every_value_gives_sound_paths(values):
    settings, found = RepetSettings(**values), 0
    for seed in range(4):
        path, tool, obstacles = tool_problem("convex", seed)
        escape = escape_path(path, tool, obstacles, settings)
        found += escape.found
        if escape.found:
            assert least_gap(escape.path, tool, obstacles, settings.distance) >= settings.distance - 1e-6
    assert found >= 3


def slot(width: float, height: float) -> list[Obstacle]:
    """An upright window across x in a wall of two meters."""
    side, above = (2.0 - width) / 2, (2.0 - height) / 2
    return boxes(
        Pose.identity(),
        ((0.03, side, 2.0), (0.0, (2.0 + width) / 4, 0.0)),
        ((0.03, side, 2.0), (0.0, -(2.0 + width) / 4, 0.0)),
        ((0.03, width, above), (0.0, 0.0, (2.0 + height) / 4)),
        ((0.03, width, above), (0.0, 0.0, -(2.0 + height) / 4)),
    )


def test_a_long_bar_turns_to_pass_a_slot():
    bar, wall = np.array([[0.0, -0.2, 0.0, 0.0, 0.2, 0.0, 0.02]]), slot(0.2, 0.7)
    common = {"workspace": ((-0.35, -0.2, -0.2), (0.35, 0.2, 0.2)), "levels": 20, "nodes": 20_000}
    assert escape_path(ALONG, bar, wall, RepetSettings(**common)).reason == "no escape found"
    escape = escape_path(ALONG, bar, wall, RepetSettings(orientation="turn", **common))
    assert escape.found
    assert least_gap(escape.path, bar, wall, DEFAULTS.distance) >= DEFAULTS.distance - 1e-6
    # skew is enough: a bar that goes along itself needs less of the slot than its shadow
    assert max(pose.distance_to(Pose.identity())[1] for pose in escape.path) > DEFAULTS.turn - 1e-9


def test_a_turn_is_of_the_angle_that_is_set():
    path, tool, obstacles = tool_problem("cage", 0)
    tree = escape_path(path, tool, obstacles, RepetSettings(orientation="turn", turn=0.3, retries=0, nodes=200)).tree
    angles = np.array(
        [Pose(tree.poses[tree.parents[k]]).distance_to(Pose(tree.poses[k]))[1] for k in range(1, len(tree.poses))]
    )
    assert (angles > 0.1).any()
    np.testing.assert_allclose(angles[angles > 1e-6], 0.3, atol=1e-9)


def test_nodes_keep_the_roots_orientation_or_spread_the_turn():
    end = Pose.from_yaw([0.3, 0.0, 0.0], 1.5)
    path, ball = screw_path(at([-0.3, 0, 0]), end, 0.01), [Obstacle(Sphere(0.08))]
    bar = np.array([[0.0, -0.05, 0.0, 0.0, 0.05, 0.0, 0.02]])
    kept = escape_path(path, bar, ball)
    assert kept.found
    root = Pose(kept.tree.poses[0])
    assert max(root.distance_to(Pose(row))[1] for row in kept.tree.poses) < 1e-12
    spread = escape_path(path, bar, ball, RepetSettings(orientation="spread"))
    assert spread.found
    root = Pose(spread.tree.poses[0])
    turns = np.array([Pose(row).yaw - root.yaw for row in spread.tree.poses])
    assert turns.min() > -1e-9 and turns.max() > 0.1, "on the way home it turns towards it"
    assert max(Pose(row).tilt for row in spread.tree.poses) < 1e-9, "a turn about the vertical stays one"


def test_a_shell_starts_the_detour_earlier():
    ball = [Obstacle(Sphere(0.05), at([0.0, 0.01, 0.0]))]
    late, early = (escape_path(ALONG, BALL, ball, RepetSettings(trigger=way)) for way in ("predictive", "shell"))
    assert early.detours[0][0] <= late.detours[0][0]
    # passing within the shell, outside of the distance: the paper gives way, the prediction need not
    beside = [Obstacle(Sphere(0.05), at([0.0, 0.11, 0.0]))]
    assert escape_path(ALONG, BALL, beside).path is ALONG
    shy = escape_path(ALONG, BALL, beside, RepetSettings(trigger="shell"))
    assert shy.found and shy.detours


def test_the_root_stands_back_at_the_shell():
    ball = [Obstacle(Sphere(0.05))]
    for shell in (0.03, 0.08):
        escape = escape_path(ALONG, BALL, ball, RepetSettings(shell=shell))
        root = tool_gap(BALL, ball, Pose(escape.tree.poses[0]))
        assert shell <= root < shell + 0.011


def test_the_distance_is_kept_and_own_margins_go_first():
    for distance in (0.0, 0.04):
        settings = RepetSettings(distance=distance, shell=distance + 0.03)
        plain = [Obstacle(Box((0.1, 0.1, 0.1)))]
        escape = escape_path(ALONG, BALL, plain, settings)
        least = least_gap(escape.path, BALL, plain, distance)
        assert escape.found and distance - 1e-6 <= least < distance + 0.06
    for margin in (0.0, 0.05):
        own = [Obstacle(Box((0.1, 0.1, 0.1)), margin=margin)]
        escape = escape_path(ALONG, BALL, own)
        assert escape.found
        assert least_gap(escape.path, BALL, own, margin) >= margin - 1e-6


def test_masks_name_what_may_touch():
    two = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.02], [0.0, 0.0, 0.1, 0.0, 0.0, 0.1, 0.02]])
    low = [Obstacle(Sphere(0.03))]
    assert escape_path(ALONG, two, low).detours
    assert escape_path(ALONG, two, low, masks=[0b01]).path is ALONG
    assert escape_path(ALONG, two, low, masks=[0b10]).detours


def test_the_way_so_far_counts_in_the_cost():
    ways = {"length": 0.0, "goal": 0.0}
    for seed in range(20):
        path, tool, obstacles = tool_problem("trap", seed)
        found = {cost: escape_path(path, tool, obstacles, RepetSettings(cost=cost, shortcut=False)) for cost in ways}
        if all(escape.found for escape in found.values()):
            for cost in ways:
                ways[cost] += shortest(found[cost].path)
    assert 0 < ways["length"] < ways["goal"]


def test_children_stand_on_a_circle_or_a_square():
    ball, step = [Obstacle(Sphere(0.05))], DEFAULTS.step
    for square, near in ((False, step), (True, step / math.sqrt(2))):
        tree = escape_path(ALONG, BALL, ball, RepetSettings(square=square)).tree
        lengths = edge_lengths(tree)[:8]
        np.testing.assert_allclose(lengths[::2], step, atol=1e-12)
        np.testing.assert_allclose(lengths[1::2], near, atol=1e-12)


def test_children_are_brought_back_to_the_shell():
    ball = [Obstacle(Sphere(0.05), at([0, 0.01, 0]))]
    rooms = {}
    for pull in (False, True):
        tree = escape_path(ALONG, BALL, ball, RepetSettings(pull_back=pull, retries=0, levels=6)).tree
        rooms[pull] = max(clear_of(Pose(tree.poses[k]), BALL, ball) for k in kept_rows(tree))
    assert rooms[True] < rooms[False]


def test_a_shortcut_is_no_longer():
    shorter = 0
    for seed in range(15):
        path, tool, obstacles = tool_problem("trap", seed)
        with_, without = (escape_path(path, tool, obstacles, RepetSettings(shortcut=way)) for way in (True, False))
        assert with_.found == without.found
        if with_.found and len(with_.detours) == len(without.detours) == 1:
            assert shortest(with_.path) <= shortest(without.path) * 1.02
            shorter += shortest(with_.path) < shortest(without.path) - 1e-3
    assert shorter >= 3


@pytest.mark.parametrize("axis", [1, 2])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_bias_chooses_the_side(axis, sign):
    bias = np.zeros(3)
    bias[axis] = sign
    escape = escape_path(ALONG, BALL, [Obstacle(Sphere(0.06))], RepetSettings(bias=tuple(bias)))
    assert escape.found
    side = sign * escape.path.positions[:, axis]
    assert side.max() > 0.08 > -side.min()


def test_nodes_stay_in_the_workspace():
    box = ((-1.0, -1.0, -0.02), (1.0, 1.0, 1.0))
    ball = [Obstacle(Sphere(0.06), at([0, 0, 0.01]))]
    free = escape_path(ALONG, BALL, ball, RepetSettings(bias=(0.0, 0.0, -1.0)))
    assert free.path.positions[:, 2].min() < -0.05, "without walls it goes below"
    escape = escape_path(ALONG, BALL, ball, RepetSettings(workspace=box, bias=(0.0, 0.0, -1.0)))
    assert escape.found
    tree = escape.tree
    heights = PosePath(tree.poses).positions[:, 2]
    assert (heights[kept_rows(tree)] >= -0.02).all()
    assert (heights[tree.verdicts == OUTSIDE] < -0.02).all() and (tree.verdicts == OUTSIDE).any()


def test_two_obstacles_apart_give_two_detours():
    path = screw_path(at([-0.5, 0.0, 0.0]), at([0.5, 0.0, 0.0]), 0.01)
    balls = [Obstacle(Sphere(0.05), at([x, 0.005, 0.0])) for x in (-0.25, 0.25)]
    escape = escape_path(path, BALL, balls)
    assert escape.found and len(escape.detours) == 2
    (a, b), (c, d) = escape.detours
    assert 0 < a < b <= c < d < len(escape.path) - 1
    assert escape_path(path, BALL, balls, RepetSettings(rounds=1)).reason == "no escape found"


def levels_of(tree: EscapeTree) -> np.ndarray:
    levels = np.zeros(len(tree.parents), dtype=int)
    for k in range(1, len(levels)):
        levels[k] = levels[tree.parents[k]] + 1
    return levels


def test_levels_beam_and_nodes_bound_the_tree():
    path, tool, obstacles = tool_problem("cage", 3)
    for levels, beam, nodes in ((3, 48, 4000), (14, 2, 4000), (14, 48, 50)):
        settings = RepetSettings(levels=levels, beam=beam, nodes=nodes, retries=0)
        tree = escape_path(path, tool, obstacles, settings).tree
        depth = levels_of(tree)
        assert depth.max() <= levels
        assert np.bincount(depth[sorted(set(tree.parents[1:]))]).max() <= beam
        assert len(tree.poses) <= nodes


def test_retries_change_the_scale_and_ask_chance():
    path, tool, obstacles = tool_problem("cage", 4)
    for retries, scale in ((0, 1.0), (1, DEFAULTS.grow), (2, DEFAULTS.shrink), (3, DEFAULTS.grow)):
        settings = RepetSettings(retries=retries, random=5, away=0.0, nodes=300)
        tree = escape_path(path, tool, obstacles, settings).tree
        count = 8 + 5 * (retries > 0)
        lengths = edge_lengths(tree)
        np.testing.assert_allclose(lengths[:8], scale * settings.step, atol=1e-12)
        assert np.bincount(tree.parents[1:])[0] == count
        assert (lengths[:count] <= scale * settings.step * math.sqrt(2) + 1e-12).all()


def test_random_children_leave_the_plane_outwards_only_as_far_as_set():
    path, tool, obstacles = tool_problem("cage", 4)
    for away in (0.0, 0.5):
        settings = RepetSettings(retries=1, random=20, away=away, nodes=300)
        tree = escape_path(path, tool, obstacles, settings).tree
        plane, positions = tree.planes[0], PosePath(tree.poses).positions
        off = (positions[tree.parents == 0] - plane.origin) @ plane.normal / (settings.grow * settings.step)
        assert np.abs(off[:8]).max() < 1e-9
        assert off.min() > -1e-9 and off.max() <= away + 1e-9
        assert away == 0.0 or off.max() > 0.3


@pytest.mark.parametrize("spacing", [0.003, 0.03])
def test_poses_of_a_detour_are_no_farther_apart_than_the_spacing(spacing):
    escape = escape_path(ALONG, BALL, [Obstacle(Sphere(0.06))], RepetSettings(spacing=spacing))
    (first, last), steps = escape.detours[0], np.diff(escape.path.lengths())
    assert steps[first:last].max() <= spacing + 1e-12


def test_a_detour_that_does_not_fit_is_a_failure_of_its_own():
    settings = RepetSettings(longest=len(ALONG) + 2)
    escape = escape_path(ALONG, BALL, [Obstacle(Sphere(0.1))], settings)
    assert escape.reason == "the detours do not fit into the longest path allowed"
    assert escape.path is ALONG


def test_the_way_back_may_be_later_than_the_first_free_pose():
    """Behind the obstacle the path runs through a box that is open only at the far end."""
    path = screw_path(at([-0.3, 0.0, 0.0]), at([0.6, 0.0, 0.0]), 0.01)
    cell = [Obstacle(Box((0.02, 0.3, 0.3)))]
    cell += [Obstacle(Box((0.3, 0.02, 0.3)), at([0.15, y, 0.0])) for y in (-0.16, 0.16)]
    cell += [Obstacle(Box((0.3, 0.3, 0.02)), at([0.15, 0.0, z])) for z in (-0.16, 0.16)]
    one, eight = (escape_path(path, BALL, cell, RepetSettings(candidates=count)) for count in (1, 8))
    assert one.reason == "node limit reached", "the way in from the far end takes too many"
    assert eight.found
    assert eight.path[eight.detours[0][1]].position[0] > 0.3


# Bad input and honest failures


def test_ends_in_collision_are_told_apart():
    for place, reason in ((-0.3, "start in collision"), (0.3, "goal in collision")):
        escape = escape_path(ALONG, BALL, [Obstacle(Sphere(0.05), at([place, 0.0, 0.0]))])
        assert escape.reason == reason
        assert escape.path is ALONG and escape.tree is None


def test_a_goal_inside_the_shell_is_reached():
    beside = [Obstacle(Box((0.1, 0.1, 0.1)), at([0.3, 0.1, 0.0])), Obstacle(Sphere(0.06))]
    gap = tool_gap(BALL, beside, ALONG[-1])
    assert DEFAULTS.distance < gap < DEFAULTS.shell
    escape = escape_path(ALONG, BALL, beside)
    assert escape.found
    np.testing.assert_array_equal(escape.path.dqs[-1], ALONG.dqs[-1])
    assert least_gap(escape.path, BALL, beside, DEFAULTS.distance) >= DEFAULTS.distance - 1e-6


def test_too_many_obstacles_are_refused_in_one_line():
    many = [Obstacle(Sphere(0.01), at([5, 5, 5]))] * 10_000
    with pytest.raises(BadOption, match=f"10000; allowed are {MAX_OBSTACLES}") as caught:
        escape_path(ALONG, BALL, many)
    assert "\n" not in str(caught.value)
    assert escape_path(ALONG, BALL, many[:MAX_OBSTACLES]).path is ALONG


def test_one_pose_is_a_path():
    one = PosePath(Pose.identity().dq[None])
    assert escape_path(one, BALL, [Obstacle(Sphere(0.05), at([1, 0, 0]))]).path is one
    assert escape_path(one, BALL, [Obstacle(Sphere(0.05))]).reason == "start in collision"


def test_what_is_not_a_number_is_refused():
    with pytest.raises(OneDemoError):
        PosePath(np.full((2, 8), np.nan))
    for tool, error in ((np.full((1, 7), np.nan), NotFinite), (np.zeros((1, 6)), BadShape), (np.zeros(7), BadShape)):
        with pytest.raises(error, match="tool"):
            escape_path(ALONG, tool, [])
    for masks in ([0, 0], [2], [-1]):
        with pytest.raises(BadOption, match="masks"):
            escape_path(ALONG, BALL, [Obstacle(Sphere(0.05))], masks=masks)
    with pytest.raises(BadOption, match="capsules of the tool': there are 100"):
        escape_path(ALONG, np.tile(BALL, (100, 1)), [])
    with pytest.raises(NotFinite):
        Obstacle(Sphere(0.1), velocity=np.array([np.nan, 0, 0]))
    with pytest.raises(BadOption, match="has 61 poses; allowed are 10"):
        escape_path(ALONG, BALL, [], RepetSettings(longest=10))


def test_a_tool_without_parts_passes_everything():
    assert escape_path(ALONG, np.zeros((0, 7)), [Obstacle(Sphere(0.1))]).path is ALONG


@for_all(st.integers(-(2**70), 2**70), max_examples=20)
def test_any_whole_number_is_a_seed(seed):
    assert escape_path(ALONG, BALL, [Obstacle(Sphere(0.06))], seed=seed).found


@pytest.mark.parametrize("kind", ["convex", "clutter", "gap", "trap", "shelf"])
def test_first_blocked_is_the_first_edge_that_is_not_clear(kind):
    """Also where one look at the room proves several edges."""
    options = DEFAULTS.packed()
    options[OPTION.largest_margin] = DEFAULTS.distance
    for seed in range(3):
        path, tool, obstacles = tool_problem(kind, seed)
        g = tool_arrays(tool, pack(obstacles), margin=DEFAULTS.distance)
        clear = [is_clear(g, tuple(x), tuple(y), DEFAULTS.distance) for x, y in pairwise(path.dqs.tolist())]
        expected = clear.index(False) if False in clear else -1
        assert first_blocked(g, np.ascontiguousarray(path.dqs), len(path), 0, options) == expected


def test_children_far_off_the_plane_are_proven_clear_too():
    """A random child may go farther than its siblings: past a plate that no other can reach."""
    plate = Obstacle(Box((2.0, 2.0, 0.002)), Pose.from_position_quaternion([0.0, 0.0, 0.18]))
    ball = Obstacle(Sphere(0.05), Pose.from_position_quaternion([0.0, 0.0, -0.1]))
    g, options = tool_arrays(point_tool(0.005), pack([plate, ball]), margin=0.01), DEFAULTS.packed()
    options[OPTION.largest_margin], options[OPTION.random], options[OPTION.away] = 0.01, 40.0, 5.0
    tree, x = np.zeros((60, NODE.width)), tuple(Pose.identity().dq.tolist())
    tree[0, 0] = 1.0
    count = expand(
        g,
        tree,
        0,
        1,
        tuple(at([0.5, 0.0, 0.0]).dq.tolist()),
        np.full(64, -1.0),
        options,
        options[OPTION.step],
        np.ones(1),
    )
    kept = [row for row in tree[1:count] if row[NODE.verdict] == KEPT]
    assert len(kept) > 10 and count - 1 - len(kept) > 5
    assert all(is_clear(g, x, tuple(row[:8].tolist()), 0.01) for row in kept)


def test_no_more_poses_are_written_than_there_is_room_for():
    """Of every array the last row, which the kernel is not given, stays what it was."""
    settings, rows = RepetSettings(), len(ALONG) + 3
    wall = [Obstacle(Sphere(0.06), at([0.0, 0.0, 0.0]))]
    for spacing in (0.01, 1e-9, 1e-300):
        path, out, slacks = np.full((rows + 1, 8), 7.0), np.full((rows + 1, 8), 7.0), np.full(rows + 1, 7.0)
        places, poses, branch = np.full(6, 7.0), np.full((6, 8), 7.0), np.full((settings.levels + 4, 8), 7.0)
        path[: len(ALONG)] = ALONG.dqs
        tree, cells, heap = tree_arrays(settings.nodes, settings.levels)
        options = replace(settings, spacing=spacing).packed()
        status, count, _ = escape(
            tool_arrays(BALL, pack(wall), margin=settings.distance), path[:-1], len(ALONG), out[:-1], slacks[:-1],
            places[:-1], poses[:-1], branch[:-1], tree, cells, heap, options, np.ones(1), np.zeros((10, 3)),
        )  # fmt: skip
        assert (status, count) == (TOO_LONG, 0)
        for array in (path, out, slacks, places, poses, branch):
            assert (array[-1] == 7.0).all()
    assert escape(
        tool_arrays(BALL, pack(wall)), path[:3], 4, out, slacks, places, poses, branch, tree, cells, heap, options,
        np.ones(1), np.zeros((10, 3)),
    )[0] == TOO_LONG  # fmt: skip
