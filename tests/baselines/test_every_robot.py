"""Every robot does every task that it is offered for, and is refused in one line where it is not."""

from __future__ import annotations

import re
from pathlib import Path

import gymnasium as gym
import pytest

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.baselines.factory import make_policy
from onedemo.bench.episodes.episode import run_episode
from onedemo.bench.episodes.scenarios import Scenario
from onedemo.configs.grid import load_config, load_grid
from onedemo.configs.shipped_files import shipped_config, shipped_demonstration
from onedemo.envs import TASKS
from onedemo.envs.scene.robots import ROBOTS
from onedemo.planner.errors import BadOption
from onedemo.planner.imitation.demonstration_files import read_demonstration

PAGE = Path(__file__).parents[2] / "docs" / "robots.md"
WHOLE = {"stack": {"n_blocks": 1}, "pour": {}, "shelve": {"n_books": 1}, "bimanual_pour": {}}
"""Tasks that are no single motion of another one, with one object instead of three."""
NAMES = {task: TASKS[task].id.removeprefix("onedemo/").removesuffix("-v0") for task in WHOLE}
CASES = [(robot, task) for robot in sorted(ROBOTS) for task in WHOLE]
SEED = 1


def rows_of_the_page() -> dict[tuple[str, str], bool]:
    """Whether the page of robots says "refused", by robot and name of the task."""
    rows = re.findall(r"^\| (\w+) \| (\w+) \|(.*)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    return {(robot, task): "refused" in results for robot, task, results in rows if task in NAMES.values()}


@pytest.mark.parametrize("robot, task", CASES)
def test_it_succeeds_or_is_refused_as_the_page_says(robot, task):
    config, refused = load_config(shipped_config(task)), rows_of_the_page().get((robot, NAMES[task]), True)
    try:
        env = gym.make(TASKS[task].id, robot=robot, level="L1", **{**config.env, **WHOLE[task]})
    except BadOption as refusal:
        assert refused
        assert re.fullmatch(rf"option 'robot': {robot} (cannot [a-z ]+: .{{20,}}|has one arm; .+)", str(refusal))
        return
    assert not refused
    shown = read_demonstration(shipped_demonstration(config.demonstration))
    policy = make_policy("screw", env.unwrapped.task, shown, config.settings)
    record, _ = run_episode(env, policy, Scenario(0, SEED, "L1"), config)
    env.close()
    assert (record.success, record.safe, record.failure_reason) == (True, True, ""), record.detail


def test_the_page_has_a_row_of_every_robot_and_task():
    two = {(robot, NAMES["bimanual_pour"]) for robot, kind in ROBOTS.items() if len(kind.ready) == 2}
    one = {(robot, NAMES[task]) for robot, task in CASES if task != "bimanual_pour"}
    assert set(rows_of_the_page()) == one | two


def test_the_config_of_the_page_runs_all_that_is_not_refused():
    cells = load_grid(shipped_config("robots")).cells
    offered = {row for row, refused in rows_of_the_page().items() if not refused}
    assert {(cell.robot, NAMES[cell.task], cell.level) for cell in cells} == {
        (*row, level) for row in offered for level in ("L1", "L2")
    }
    assert {(cell.episodes, cell.seed, cell.video) for cell in cells} == {(20, 7000, False)}
