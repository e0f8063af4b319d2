"""Escape trees: nothing unsound by other means, every convex body passed, every setting does what it says."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from helpers.planner.escape_checks import (
    ALONG,
    BALL,
    DEFAULTS,
    EDGE,
    HOME,
    KEPT,
    VISITED,
    kept_rows,
    least_gap,
    shortest,
)
from helpers.random_scenes import at, random_tool, tool_gap, tool_problem
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
    RepetSettings,
    TangentPlane,
    clear_of,
    escape_path,
    point_tool,
)
from onedemo.planner.escape.tree_arrays import GROWTH, NODE, OPTION, tree_arrays
from onedemo.planner.geometry import dualquat as dq
from onedemo.planner.geometry import screw
from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.geometry.shapes import Box, Obstacle, Sphere, pack


def tuple_of(pose: Pose) -> tuple[float, ...]:
    return tuple(float(value) for value in pose.dq)


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
            np.zeros(GROWTH.width), np.inf,
        )  # fmt: skip
        assert (status, count) == (TOO_LONG, 0)
        for array in (path, out, slacks, places, poses, branch):
            assert (array[-1] == 7.0).all()
    assert escape(
        tool_arrays(BALL, pack(wall)), path[:3], 4, out, slacks, places, poses, branch, tree, cells, heap, options,
        np.ones(1), np.zeros((10, 3)), np.zeros(GROWTH.width), np.inf,
    )[0] == TOO_LONG  # fmt: skip
