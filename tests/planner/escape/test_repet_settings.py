"""Settings of escape trees: each does what it says, every value is sound, bad ones are refused in one line."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers.planner.escape_checks import (
    ALONG,
    BALL,
    DEFAULTS,
    OUTSIDE,
    kept_rows,
    least_gap,
    shortest,
)
from helpers.random_scenes import at, boxes, tool_gap, tool_problem

from onedemo.planner.errors import BadOption
from onedemo.planner.escape.repet import (
    EscapeTree,
    RepetSettings,
    clear_of,
    escape_path,
)
from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.geometry.shapes import Box, Obstacle, Sphere
from onedemo.planner.imitation.tsia import screw_path


def edge_lengths(tree: EscapeTree) -> np.ndarray:
    """(n - 1,) distance [m] of every node but the root from its parent."""
    positions = PosePath(tree.poses).positions
    return np.linalg.norm(positions[1:] - positions[tree.parents[1:]], axis=1)


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
