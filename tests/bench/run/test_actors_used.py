"""Which actor acts decides what a run is: another one under the same name is another run."""

from __future__ import annotations

import gymnasium as gym
import pytest
from helpers.actors import random_actor

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.baselines.errors import BadActor
from onedemo.baselines.factory import make_policy
from onedemo.baselines.learning.actor_files import save_actor
from onedemo.bench.report.groups import Group
from onedemo.bench.report.tables import costs
from onedemo.bench.run.actors_used import with_actors
from onedemo.configs.errors import BadConfig
from onedemo.configs.grid import load_grid

TEXT = """
name: own
task: reach
demonstration: stack
method: sac
episodes: 2
env: {control_mode: ee_twist}
settings: {checkpoint: %s}
"""


@pytest.fixture(scope="module")
def env():
    made = gym.make("onedemo/Reach-v0")
    yield made
    made.close()


def grid_in(folder, env, seed=0, more=""):
    save_actor(random_actor(env, seed=seed), folder / "mine")
    file = folder / "own.yaml"
    file.write_text(TEXT % f"{folder / 'mine.json'}{more}")
    return load_grid(file)


def test_another_actor_under_the_same_name_is_another_run(tmp_path, env):
    digests = [with_actors(grid_in(tmp_path, env, seed)).digest() for seed in (0, 0, 1)]
    assert digests[0] == digests[1] != digests[2]


def test_a_run_knows_how_long_its_actor_was_trained(tmp_path, env):
    (cell,) = with_actors(grid_in(tmp_path, env)).cells
    assert cell.settings["training_steps"] == 1000 and len(cell.settings["sha256"]) == 16
    (row,) = costs([Group("sac", cell, 2, [])]).rows
    assert row == ["sac", "0", "1000", "1"]


def test_only_the_actor_that_was_written_down_acts(tmp_path, env):
    (cell,) = with_actors(grid_in(tmp_path, env)).cells
    make_policy("sac", env.unwrapped.task, None, cell.settings)
    save_actor(random_actor(env, seed=1), tmp_path / "mine")
    with pytest.raises(BadActor, match=r"mine.json: sha256: is [0-9a-f]{16}; wanted is [0-9a-f]{16}: it is another"):
        make_policy("sac", env.unwrapped.task, None, cell.settings)
    wrong = grid_in(tmp_path, env, 1, f", sha256: {cell.settings['sha256']}")
    with pytest.raises(BadConfig, match=r"settings\.sha256: [0-9a-f]{16} is wanted; .*mine.json has"):
        with_actors(wrong)


def test_an_actor_that_is_not_there_is_refused_before_anything_is_built(tmp_path, env):
    grid = grid_in(tmp_path, env)
    (tmp_path / "mine.json").unlink()
    with pytest.raises(BadConfig, match=r"settings\.checkpoint: .*mine\.json"):
        with_actors(grid)


def test_cells_of_other_methods_stay_as_they_are(tmp_path, env):
    file = tmp_path / "other.yaml"
    file.write_text("name: other\ntask: stack\ndemonstration: stack\n")
    grid = load_grid(file)
    assert with_actors(grid).cells == grid.cells
