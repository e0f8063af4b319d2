"""Ways through joint space: timed, shortened, as near to the path of the tool as they say."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from helpers.random_scenes import (
    SETTINGS,
    at,
    panda,
    problem,
)
from helpers.strategies import for_all, st

from onedemo.planner.imitation.tsia import screw_path
from onedemo.planner.planning.joint_space_motion import (
    RAMP,
    path_deviation,
    timed_on_lines,
)
from onedemo.planner.planning.planning_scene import PlanningScene
from onedemo.planner.search.joint_space_rrt import joint_edge_is_clear, shortcut

# Ways through joint space


@for_all(st.integers(0, 10**6), st.sampled_from([1e-5, 0.01, 0.3, 3.0]), max_examples=60)
def test_a_way_in_time_stays_on_its_lines_and_keeps_the_speeds_from_rest_to_rest(seed, size):
    """Every point is on one of the lines, in order; corners are taken at rest; ramps are kept."""
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.normal(0.0, size, (int(rng.integers(2, 6)), 7)), axis=0)
    speeds, dt = rng.uniform(0.5, 2.0, 7), 0.02
    rows = timed_on_lines(points, speeds, dt)
    assert np.abs(rows[0] - points[0]).max() == 0.0 and np.allclose(rows[-1], points[-1], atol=1e-12)
    assert (np.abs(np.diff(rows, axis=0)) <= speeds * dt * (1 + 1e-9)).all()
    accelerations = np.abs(np.diff(np.vstack([rows[:1], rows, rows[-1:]]), n=2, axis=0)) / dt**2
    assert (accelerations <= 1.01 * speeds / RAMP + 1e-9).all()
    line, along = 0, 0.0
    for row in rows[1:]:
        way = points[line + 1] - points[line]
        s = float((row - points[line]) @ way / (way @ way))
        assert along < s <= 1.0 + 1e-9 and np.abs(points[line] + s * way - row).max() < 1e-9
        along = s
        if s > 1.0 - 1e-9:
            line, along = line + 1, 0.0
    assert line == len(points) - 1


@pytest.mark.parametrize("seed", range(6))
def test_shortened_ways_keep_their_ends_get_no_longer_and_stay_clear(seed):
    scene = problem("gap", seed)
    arm, body, _ = panda()
    robot = PlanningScene.of(arm, body, scene.obstacles, SETTINGS).robot
    rng, found = np.random.default_rng(seed), 0
    for _ in range(40):
        points = np.clip(scene.start + np.cumsum(rng.normal(0.0, 0.12, (6, 7)), axis=0), arm.lower, arm.upper)
        if not all(joint_edge_is_clear(robot, a, b) for a, b in pairwise(points)):
            continue
        path = np.zeros((40, 7))
        path[:6] = points
        count = shortcut(robot, path, 6, 100, np.array([seed + 1.0]), np.empty((2, 7)))
        short = path[:count]
        np.testing.assert_array_equal(short[[0, -1]], points[[0, -1]])
        lengths = [np.abs(np.diff(way, axis=0)).max(axis=1).sum() for way in (points, short)]
        assert lengths[1] <= lengths[0] + 1e-12
        assert all(joint_edge_is_clear(robot, a, b) for a, b in pairwise(short))
        found += lengths[1] < 0.9 * lengths[0]
    assert found


def test_how_far_a_tool_strays_is_its_distance_from_the_edges_of_its_path():
    arm, _, home = panda()
    start = arm.fk(home)
    path = screw_path(start, at([0.0, 0.1, 0.0]) @ start, 0.01)
    assert path_deviation(arm, home[None], path.dqs) < 1e-12
    assert path_deviation(arm, home[None], path[3:].dqs) == pytest.approx(path[3].distance_to(start)[0], abs=1e-9)
    lifted = screw_path(at([0.0, -0.005, 0.02]) @ start, at([0.0, 0.1, 0.02]) @ start, 0.01)
    assert path_deviation(arm, home[None], lifted.dqs) == pytest.approx(0.02, abs=1e-9)
    assert path_deviation(arm, home[None], start.dq[None]) < 1e-12
