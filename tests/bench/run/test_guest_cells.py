"""robosuite's own tasks in a comparison: named, checked, done by two methods from one skill, told apart in tables."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import pytest

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.baselines.motion.tool_frame import ToolFrameMotion
from onedemo.bench.episodes.episode_records import FILE, encoded, read_records
from onedemo.bench.episodes.run_folder import describe, table_hash
from onedemo.bench.episodes.scenarios import Suite, frozen, place_of
from onedemo.bench.report.groups import groups_by_environment, groups_by_task, groups_of
from onedemo.bench.report.read_runs import read_run
from onedemo.bench.report.report import write_report
from onedemo.bench.run.command import run_config
from onedemo.bench.run.config_checks import check_grid
from onedemo.bench.run.episode_jobs import made, policy_for
from onedemo.configs.errors import BadConfig
from onedemo.configs.grid import load_grid
from onedemo.configs.run_config import FAMILIES, RunConfig
from onedemo.configs.shipped_files import shipped_config
from onedemo.envs import TASKS
from onedemo.planner.errors import BadDemonstration, OneDemoError

LIFT = "name: lift\ntask: robosuite\ndemonstration: lift\nseed: 4000\nvideo: false\nepisodes: 1\n"
THOUGHT = 10
"""Ticks in which the arm begins to move: one to begin, and five in which a way to the cube is chosen; a few more."""


def config(folder: Path, text: str) -> Path:
    path = folder / "config.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_shipped_comparison_is_the_promised_one():
    grid = load_grid(shipped_config("robosuite"))
    check_grid(grid)
    found = {(cell.task_words, cell.robot): cell.episodes for cell in grid.cells}
    panda = ("Lift D0", "Stack D0", "NutAssemblySquare D0", "NutAssemblyRound D0", "NutAssembly D0", "Stack D1",
             "NutAssemblySquare D1")  # fmt: skip
    others = {
        (task, robot): 20 for task in ("Stack D0", "NutAssemblySquare D0") for robot in ("Sawyer", "IIWA", "UR5e")
    }
    assert found == {**{(task, "Panda"): 50 for task in panda}, **others}
    assert {cell.seed for cell in grid.cells} == {4000} and len(grid.cells) == 2 * len(found)
    assert {cell.method for cell in grid.cells} == {"screw", "replay"}
    assert len({grid.label(cell) for cell in grid.cells}) == len(grid.cells)
    assert "Stack D1 Panda L1 replay" in {grid.label(cell) for cell in grid.cells}


@pytest.mark.parametrize("task", FAMILIES)
def test_what_tells_the_tasks_of_an_environment_apart_has_its_own_defaults(task):
    env = gym.make(TASKS[task].id)
    bare = RunConfig(name="x", task=task, demonstration="lift")
    assert bare.task_words.split()[0] == env.unwrapped.task.name
    given = bare.model_copy(update={"env": FAMILIES[task]})
    assert given.task_words == bare.task_words == "Lift D0"
    with gym.make(TASKS[task].id, **FAMILIES[task]) as other:
        assert str(other.reset(seed=3)[0]) == str(env.reset(seed=3)[0])
    env.close()


REFUSED = {
    "env.task=Lfit": r"env\.task: unknown robosuite task for one arm 'Lfit'; known: Lift, ",
    "env.task=3": r"env\.task: unknown robosuite task for one arm 3",
    "env.task=Wipe": r"env\.task: Wipe cannot be made: its tool replaces the gripper",
    "env.range=D2": r"env\.range: unknown range 'D2'; known: D0, D1",
    "env.range=D1": r"env\.range: Lift has no wider placement D1; those that have one: Stack, ",
    "env.rnge=D1": r"env\.rnge: unknown key; did you mean 'range'",
    "env.level=L3": r"env\.level: unknown key",
    "level=S": r"key_poses: are those of named segments, and robosuite is done without names",
}


@pytest.mark.parametrize("change", REFUSED)
def test_wrong_names_are_refused_in_one_line_before_anything_is_built(tmp_path, change):
    grid = load_grid(config(tmp_path, LIFT), [change])
    with pytest.raises(BadConfig, match=REFUSED[change]) as refused:
        check_grid(grid)
    assert "\n" not in str(refused.value)


def test_a_demonstration_without_a_skill_is_refused_in_one_line(tmp_path):
    with pytest.raises(BadDemonstration, match=r"object_paths.*none is recorded") as refused:
        check_grid(load_grid(config(tmp_path, LIFT), ["demonstration=pour"]))
    assert "\n" not in str(refused.value)


def test_a_demonstration_of_other_things_is_refused_before_any_episode(tmp_path):
    path = config(tmp_path, LIFT)
    with pytest.raises(OneDemoError, match=r"cube.*none of which the task has; it has .*SquareNut") as refused:
        run_config(str(path), ["env.task=NutAssemblySquare", "executor=serial"], tmp_path / "runs", quiet=True)
    assert "\n" not in str(refused.value)
    assert not list((tmp_path / "runs").rglob(FILE))


def test_a_skill_moves_in_another_frame_of_the_hand(tmp_path):
    (cell,) = load_grid(config(tmp_path, LIFT), ["level=T"]).cells
    env = made(cell)
    policy = policy_for(env, cell)
    assert policy.motion_method.__class__ is ToolFrameMotion
    (observation, _), state = env.reset(seed=4000, options={"level": "T"}), None
    for _ in range(THOUGHT):
        action, state = policy.predict(observation, state)
        observation, *_ = env.step(action)
        assert not policy.report(state).failure_reason
        if action[:-1].any():
            break
    assert action[:-1].any()
    env.close()


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run of both methods on one start, and the same run once more."""
    folder = tmp_path_factory.mktemp("lift")
    path = config(folder, LIFT + "executor: serial\nsweep: {method: [screw, replay]}\n")
    for name in ("one", "two"):
        assert run_config(str(path), [], folder / name, quiet=True) == 0
    return [next((folder / name).iterdir()) for name in ("one", "two")]


def test_both_methods_lift_the_cube_from_one_skill(run):
    records = {record.method: record for record in read_records(run[0] / FILE)[0]}
    assert set(records) == {"screw", "replay"}
    assert all(record.safe_success and record.stage == "success" for record in records.values())
    assert {record.task for record in records.values()} == {"Lift D0"}
    assert len({record.scenario for record in records.values()}) == 1
    assert records["replay"].metrics["path_length"] != records["screw"].metrics["path_length"]


def test_results_are_the_same_once_more(run):
    hashes = {table_hash(read_run(folder).every) for folder in run}
    assert len(hashes) == 1 and hashes == {table_hash(read_records(run[1] / FILE)[0])}


def test_a_report_needs_no_error_measure(run):
    rows = json.loads((run[0] / "summary.json").read_text())["rows"]
    assert [(row["task"], row["successes"], row["error"], row["error_max"]) for row in rows] == [
        ("Lift D0", 1, None, None)
    ] * 2
    assert "| Lift D0 L1 |" in (run[0] / "report.md").read_text(encoding="utf-8")


def write_run(folder, records, grid):
    """A run folder with the same episodes in every cell of a method, as if all tasks had gone alike."""
    folder.mkdir()
    starts = {place_of(cell): frozen(cell, 0, {"start": {"obstacles": []}, "refused": 0}) for cell in grid.cells}
    describe(grid, folder, "onedemo run x")
    Suite(list(starts.values())).write(folder)
    lines = [
        replace(records[cell.method], cell=cell.digest(), task=cell.task_words,
                scenario=starts[place_of(cell)]["fingerprint"])
        for cell in grid.cells
    ]  # fmt: skip
    (folder / FILE).write_bytes(b"".join(map(encoded, lines)))


def test_tasks_and_ranges_are_never_pooled(run, tmp_path):
    grid = load_grid(
        config(tmp_path, LIFT + "sweep: {env.task: [Lift, Stack], env.range: [D0, D1], method: [screw, replay]}\n")
    )
    folder = tmp_path / "run"
    write_run(folder, {record.method: record for record in read_records(run[0] / FILE)[0]}, grid)
    groups = groups_of(read_run(folder))
    assert [group.setting.task for group in groups] == [
        name for name in ("Lift D0", "Lift D1", "Stack D0", "Stack D1") for _ in range(2)
    ]
    assert {group.label for group in groups} == {"screw", "replay"}
    assert {len(some) for some in groups_by_task(groups).values()} == {2}
    assert list(groups_by_environment(groups)) == [("robosuite", "Panda")]
    assert len({group.place for group in groups}) == 4
    write_report(folder)
    with (folder / "summary.csv").open(newline="") as file:
        assert {row["task"] for row in csv.DictReader(file)} == {"Lift D0", "Lift D1", "Stack D0", "Stack D1"}
    drawn = {path.stem for path in (folder / "figures").glob("*.png")}
    assert {"success-robosuite-panda", "timing-lift-d0-panda", "timing-stack-d1-panda"} <= drawn
    assert "timing-robosuite-panda" not in drawn
