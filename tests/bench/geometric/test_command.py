"""The geometric tier: frozen scenarios, the same bits for any workers, and numbers that notice what is wrong."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from onedemo.baselines.key_poses import filled
from onedemo.baselines.motion.path_generators import straight_path
from onedemo.bench.console import console
from onedemo.bench.geometric import metrics
from onedemo.bench.geometric.clearance import FAR, ToolJudge
from onedemo.bench.geometric.command import GeometricRequest, jobs_for, recorded, run_geometric, wanted_rows
from onedemo.bench.geometric.jobs import METHODS, GeometricJobs, frames_row, key_of, path_row, results_hash, sparse_row
from onedemo.bench.geometric.parts import KINDS, part_named, robot, tool_of
from onedemo.bench.geometric.suite import FILE, LEVELS, GeometricSuite, cells, drawn, read_suite
from onedemo.bench.geometric.tables import is_kept
from onedemo.configs.errors import BadConfig
from onedemo.envs.scene.body_clearance import tool_clearance
from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.geometry.shapes import Box, Obstacle, Sphere, pack
from onedemo.planner.imitation.segmentation import key_poses
from onedemo.planner.imitation.tsia import screw_path

SEED = 5
QUICK = ("tsia", "decoupled", "replay", "potential")


@pytest.fixture(scope="module")
def suite():
    return GeometricSuite(SEED, [drawn(index, SEED) for index in range(len(cells()))])


def at(suite, part, level):
    return next(each for each in suite.scenarios if (each.part, each.level) == (part, level))


def shifted(path, offset):
    return path.moved(Pose.from_position_quaternion(offset))


def test_a_scenario_depends_on_seed_and_index_alone(suite):
    assert [drawn(index, SEED) for index in (7, 3)] == [suite.lines[7], suite.lines[3]]
    assert drawn(3, SEED + 1) != suite.lines[3]


def test_both_ends_are_in_reach_and_clear_and_the_way_between_is_not(suite):
    for each in suite.scenarios:
        arm = robot().arm
        distance, angle = arm.fk(np.array(each.joints)).distance_to(each.start)
        assert distance < 1e-3 and angle < 1e-2
        assert bool(each.obstacles) == (LEVELS[each.level].obstacles > 0)
        if each.obstacles:
            ends = np.array([each.start.dq, each.goal.dq])
            assert tool_clearance(tool_of(each.part), ends, pack(each.obstacles)) > 0.02


def test_what_is_written_is_what_was_drawn_and_a_changed_file_is_refused(suite, tmp_path):
    suite.write(tmp_path)
    again = read_suite(tmp_path)
    assert again.hash == suite.hash and again.seed == SEED
    for mine, theirs in zip(suite.scenarios, again.scenarios, strict=True):
        assert np.array_equal(mine.start.dq, theirs.start.dq) and np.array_equal(mine.goal.dq, theirs.goal.dq)
    file = tmp_path / FILE
    file.write_text(file.read_text().replace('"draws":1', '"draws":2', 1))
    with pytest.raises(BadConfig, match="has been changed"):
        read_suite(tmp_path)


def test_every_method_is_asked_for_the_same_scenarios(suite):
    order = GeometricRequest(len(suite.lines), SEED, tuple(METHODS), 1)
    asked = {}
    for track, variant, method, index in wanted_rows(suite, order):
        if not variant.startswith("tool, "):
            asked.setdefault(track, {}).setdefault(method, set()).add((variant, index))
    for methods in asked.values():
        assert len(set(map(frozenset, methods.values()))) == 1
    jobs = jobs_for(Path("."), wanted_rows(suite, order))
    assert sum(len(job["methods"]) * len(job["indices"]) for job in jobs) == len(list(wanted_rows(suite, order)))


def test_the_same_bits_in_processes_and_after_a_crash(suite, tmp_path):
    small = GeometricSuite(SEED, suite.lines[:2])
    small.write(tmp_path)
    methods, bench = ("tsia", "decoupled"), GeometricJobs()
    order = GeometricRequest(2, SEED, methods, 1)
    here = [row for job in jobs_for(tmp_path, wanted_rows(small, order)) for row in bench.do(job)["rows"]]
    expected = {key_of(row): row for row in here}
    file = tmp_path / f"rows-{small.hash[:12]}.jsonl"
    torn = json.dumps(here[0])
    file.write_text("".join(json.dumps(row) + "\n" for row in here[1:20]) + torn[: len(torn) // 2])
    assert run_geometric(2, SEED, tmp_path, methods=methods, workers=2, quiet=True) == 0
    rows = recorded(file, console(quiet=True))
    assert list(rows) != list(expected), "workers answer in another order"
    assert results_hash(rows[key] for key in expected) == results_hash(expected.values())
    written = (tmp_path / "geometric.md").read_text()
    assert results_hash(expected[key] for key in wanted_rows(small, order))[:12] in written
    with pytest.raises(BadConfig, match="holds 2 scenarios"):
        run_geometric(4, SEED, tmp_path, methods=methods, workers=1, quiet=True)


@pytest.mark.parametrize("part", KINDS)
def test_another_tool_frame_moves_what_interpolates_apart_and_not_the_screw(suite, part):
    scenario = at(suite, part, "L2")
    assert frames_row(scenario, "tool", "tsia")["gap"] < 1e-10
    assert frames_row(scenario, "world", "tsia")["gap"] < 1e-10
    assert frames_row(scenario, "recorded elsewhere", "tsia")["gap"] < 1e-10
    assert frames_row(scenario, "tool", "decoupled")["gap"] > 1e-6
    assert frames_row(scenario, "world", "decoupled")["gap"] < 1e-10


def test_a_primitive_in_the_world_depends_on_where_it_was_recorded(suite):
    pytest.importorskip("movement_primitives")
    scenario = at(suite, "pour carry", "L2")
    assert frames_row(scenario, "recorded elsewhere", "dmp-world")["gap"] > 0.01
    assert frames_row(scenario, "recorded elsewhere", "dmp-goal")["gap"] < 1e-9


def test_few_key_poses_cost_the_lip_without_screws_and_not_with_them(suite):
    scenario = at(suite, "pour carry", "L1")
    drift = {name: sparse_row(scenario, "4", name)["rim_drift"] for name in ("tsia", "decoupled", "replay")}
    assert drift["tsia"] < 0.001 < 0.003 < min(drift["decoupled"], drift["replay"])
    dense = {name: sparse_row(scenario, "600", name)["rim_drift"] for name in drift}
    assert max(dense.values()) < 2e-5


@pytest.mark.parametrize("name", QUICK)
def test_free_ways_are_the_demonstrations_own(suite, name):
    for part in KINDS:
        row = path_row(at(suite, part, "L1"), "L1", name)
        assert row["reached"] and row["clear"] and is_kept(row)
        assert row["aligned"] < 1e-5 and row["tilt_excess"] < 0.5


def test_thinning_keeps_the_ends_and_filling_keeps_the_keys():
    shown = part_named("pour carry").shown
    keys = key_poses(shown, 6)
    assert len(keys) == 6
    for join in (screw_path, straight_path):
        path = filled(keys, join)
        assert np.array_equal(path.dqs[0], shown.dqs[0]) and np.array_equal(path.dqs[-1], shown.dqs[-1])
        assert metrics.curve_gap(keys, path) < 1e-12


def test_planted_a_goal_that_is_missed():
    shown = part_named("pour carry").shown
    assert metrics.is_reached(*metrics.ending(shown, shown[-1]))
    assert not metrics.is_reached(*metrics.ending(shifted(shown, [0.006, 0.0, 0.0]), shown[-1]))


def test_planted_a_glass_that_tilts_on_its_way():
    part = part_named("pour carry")
    tipped = part.shown[25] @ Pose.from_position_quaternion([0, 0, 0], [np.cos(0.15), np.sin(0.15), 0.0, 0.0])
    path = part.shown[:25].joined(PosePath(tipped.dq[None])).joined(part.shown[26:])
    assert metrics.tilt(part, part.shown) < 5.0
    assert metrics.tilt(part, path) == pytest.approx(np.degrees(0.3), abs=1.0)


def test_planted_a_lip_that_is_aside():
    part = part_named("pour carry")
    assert metrics.rim_drift(part, part.shown, part.shown[-1]) < 2e-5
    aside = shifted(part.shown, [0.005, 0.0, 0.0])
    assert metrics.rim_drift(part, aside, part.shown[-1]) == pytest.approx(0.005, abs=0.0015)
    assert np.isnan(metrics.rim_drift(part, part.shown[:5], part.shown[-1]))
    assert metrics.rim_drift(part_named("stack transfer"), aside, part.shown[-1]) is None


def test_planted_a_path_that_is_elsewhere():
    shown = part_named("stack transfer").shown
    assert metrics.curve_gap(shown[::2], shown) < 1e-12
    assert metrics.curve_gap(shifted(shown, [0.0, 0.0, 0.5]), shown) > 0.3
    sides = shown.dqs.copy()
    sides[40] = (Pose.from_position_quaternion([0.0, 0.02, 0.0]) @ shown[40]).dq
    assert 0.005 < metrics.curve_gap(PosePath(sides), shown) <= 0.02 + 1e-9


def test_planted_a_path_that_trembles():
    shown = part_named("shelve insert").shown
    trembling = [Pose.from_position_quaternion([0.0, 0.0, 0.002 * (k % 2)]) @ pose for k, pose in enumerate(shown)]
    assert metrics.jerk(PosePath(np.array([pose.dq for pose in trembling]))) > metrics.jerk(shown) + 1.0


def test_a_plate_between_two_poses_is_found():
    tool = np.array([[0.0, 0.0, -0.01, 0.0, 0.0, 0.01, 0.005]])
    path = PosePath.from_vectors([[-0.2, 0, 0, 1, 0, 0, 0], [0.2, 0, 0, 1, 0, 0, 0]])
    plate = Obstacle(Box((0.001, 0.1, 0.1)), Pose.from_position_quaternion([0.05, 0.0, 0.0]))
    assert not ToolJudge(tool, [plate]).clearance_of(path).clear
    beside = Obstacle(Sphere(0.02), Pose.from_position_quaternion([0.0, 0.0356, 0.0]))
    found = ToolJudge(tool, [beside]).clearance_of(path)
    assert found.clear and found.least == pytest.approx(0.0106, abs=2e-3)
    assert ToolJudge(tool, []).clearance_of(path) == (True, FAR)


def test_a_turn_that_sweeps_into_something_is_found():
    tool = np.array([[0.0, 0.0, 0.0, 0.3, 0.0, 0.0, 0.005]])
    half = [np.cos(0.75), 0.0, 0.0, np.sin(0.75)]
    path = PosePath.from_vectors([[0, 0, 0, 1, 0, 0, 0], [0, 0, 0, *half]])
    ball = Obstacle(Sphere(0.01), Pose.from_position_quaternion([0.29 * np.cos(0.8), 0.29 * np.sin(0.8), 0.0]))
    assert not ToolJudge(tool, [ball]).clearance_of(path).clear


def test_a_line_that_is_none_is_passed_over(tmp_path):
    file = tmp_path / "rows.jsonl"
    row = {"track": "paths", "variant": "L1", "method": "tsia", "index": 0}
    file.write_text("nonsense\n" + json.dumps(row) + "\n" + '{"track": "pa')
    assert list(recorded(file, console(quiet=True))) == [("paths", "L1", "tsia", 0)]
    assert file.read_text().endswith("}\n")
