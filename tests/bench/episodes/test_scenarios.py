"""Frozen starts: what they are called by, and what counts as another one."""

from __future__ import annotations

import copy
import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from onedemo.bench.episodes.scenarios import Suite, frozen, lists_of, place_of, read_suite
from onedemo.bench.episodes.start_states import TOLERANCE, difference, obstacle
from onedemo.configs.run_config import RunConfig
from onedemo.envs.simulation.moving_obstacles import ScheduledObstacle
from onedemo.planner.geometry.shapes import Box, Capsule, Sphere

CELL = RunConfig(name="x", task="stack", demonstration="stack", episodes=3)
numbers = st.floats(-2.0, 2.0)
poses = st.lists(st.lists(numbers, min_size=2, max_size=3), min_size=1, max_size=3)


def cell(**changes):
    return CELL.model_copy(update=changes)


def suite_of(*cells):
    rows = [
        frozen(each, k, {"start": {"x": [0.1 * k]}, "refused": k})
        for each in lists_of(cells)
        for k in range(each.episodes)
    ]
    return Suite(rows)


def test_cells_are_paired_unless_their_starts_are_drawn_from_something_else():
    same = [cell(method="a"), cell(settings={"x": 1}), cell(demonstration="d"), cell(max_seconds=3.0), cell(name="y")]
    same += [cell(env={"control_mode": "ee_twist"}), cell(env={"reward": "dense"})]
    other = [cell(task="t"), cell(robot="r"), cell(level="L2"), cell(obstacles="o"), cell(seed=1), cell(env={"n": 1})]
    assert {place_of(each) for each in same} == {place_of(CELL)}
    assert len({place_of(each) for each in [CELL, *other]}) == 7
    assert len(lists_of([CELL, *same])) == 1
    assert [each.episodes for each in lists_of([cell(episodes=2), cell(episodes=9, method="a"), CELL])] == [9]


def test_the_hash_depends_on_the_starts_and_on_nothing_else():
    one = suite_of(CELL, cell(level="L2"))
    assert suite_of(cell(level="L2", method="a"), cell(name="y")).hash == one.hash, "order and methods do not matter"
    assert suite_of(CELL).hash != one.hash
    assert len({each["fingerprint"] for each in one.scenarios}) == 6
    moved = copy.deepcopy(one.scenarios)
    moved[4]["start"]["x"][0] += 1e-8
    assert Suite(moved).hash != one.hash


def test_what_is_written_is_read_back(tmp_path):
    one = suite_of(CELL, cell(env={"stands": [[0.1, -0.2, 1.0]], "n": 3}))
    assert read_suite(tmp_path) is None
    one.write(tmp_path)
    again = read_suite(tmp_path)
    assert (again.hash, again.scenarios) == (one.hash, one.scenarios)
    assert again.of(cell(method="a"), 2)["start"] == {"x": [0.2]}
    assert again.summary() == f"6 scenarios, suite {one.hash[:12]}; 6 of 12 draws had no room for the obstacles " + (
        "and were drawn anew"
    )


@given(poses, st.data())
def test_only_a_difference_that_can_be_felt_is_one(start, data):
    assert difference("start", start, start) == ""
    row = data.draw(st.integers(0, len(start) - 1))
    column = data.draw(st.integers(0, len(start[row]) - 1))
    moved = copy.deepcopy(start)
    moved[row][column] += data.draw(st.floats(-0.9, 0.9)) * TOLERANCE
    assert difference("start", start, moved) == ""
    moved[row][column] = start[row][column] + data.draw(st.sampled_from([-1.0, 1.0])) * 2 * TOLERANCE
    found = difference("start", start, moved)
    assert found.startswith(f"start[{row}][{column}] is drawn as ")
    moved[row].append(0.0)
    assert difference("start", start, moved).startswith(f"start[{row}] is drawn as ")


def test_what_is_there_differs_from_what_is_not():
    assert difference("s", {"a": 1}, {"b": 1}) == "s is drawn as {'b': 1}, frozen as {'a': 1}"
    assert difference("s", {"a": "box"}, {"a": "sphere"}) == "s.a is drawn as 'sphere', frozen as 'box'"
    assert difference("s", [1], []) == "s is drawn as [], frozen as [1]"
    assert difference("s", None, 0) == "s is drawn as 0, frozen as None"
    assert len(difference("s", "x" * 1000, "y")) < 120
    assert math.isclose(TOLERANCE, 1e-7)


def test_an_obstacle_is_described_as_it_is():
    turn = (math.cos(0.3), 0.0, 0.0, math.sin(0.3))
    each = ScheduledObstacle(
        Capsule(0.02, 0.05), (0.1, 0.2, -0.0), turn, long=(0.1, 0, 0), frequency=2.0, phase=1.0, motion=3
    )
    found = obstacle(each)
    assert (found["shape"], found["size"], found["motion"]) == ("capsule", [0.02, 0.02, 0.05], 3)
    assert math.copysign(1.0, found["center"][2]) == 1.0
    np.testing.assert_allclose(found["rotation"], turn, atol=1e-9)
    assert (found["long"], found["frequency"], found["phase"]) == ([0.1, 0.0, 0.0], 2.0, 1.0)
    assert [obstacle(ScheduledObstacle(s, (0, 0, 1)))["shape"] for s in (Sphere(0.1), Box((0.1, 0.2, 0.3)))] == [
        "sphere",
        "box",
    ]
