"""The matching part of a shipped demonstration solves each task of one object: the line at N = 0."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.baselines.factory import make_policy
from onedemo.baselines.programs.arm_executor import CLOSE
from onedemo.bench.episodes.episode import run_episode
from onedemo.bench.episodes.scenarios import Scenario
from onedemo.bench.run.episode_jobs import made, policy_for
from onedemo.configs.grid import load_config
from onedemo.configs.shipped_files import shipped_config, shipped_demonstration
from onedemo.planner.errors import BadOption
from onedemo.planner.imitation.demonstration_files import read_demonstration

each_task = pytest.mark.parametrize("task", ["reach", "place_one", "tilt_pour", "insert_one"])


def played(task, seeds, *changes):
    config = load_config(shipped_config(task), list(changes))
    env = made(config)
    policy = policy_for(env, config)
    records = [run_episode(env, policy, Scenario(k, seed, config.level), config)[0] for k, seed in enumerate(seeds)]
    env.close()
    return records


@each_task
@pytest.mark.parametrize("robot", ["Panda", "Baxter"])
def test_the_method_does_it_within_the_horizon(task, robot):
    for record in played(task, (7, 8), f"robot={robot}"):
        assert (record.success, record.safe) == (True, True), record
        assert record.seconds <= 7.5


@each_task
@pytest.mark.slow
def test_the_method_does_it_nearly_always(task):
    records = played(task, range(1000, 1050))
    assert sum(record.success for record in records) >= 48


@pytest.mark.parametrize("change", ["env.control_frequency=10", "env.control_frequency=50", "env.onto=block"])
def test_one_block_is_placed_at_any_rate_and_on_another_block(change):
    for record in played("place_one", (3, 4), change):
        assert record.success, record


def test_what_is_in_the_hand_is_held_from_the_first_tick():
    config = load_config(shipped_config("place_one"))
    env = made(config)
    action, _ = policy_for(env, config).predict(env.reset(seed=3)[0])
    env.close()
    assert action[-1] == CLOSE
    np.testing.assert_allclose(action[:-1], 0.0, atol=1e-12)


def test_a_block_that_waits_on_the_table_is_fetched_first():
    (record,) = played("place_one", (3,), "env.pregrasped=false", "max_seconds=15")
    assert record.success and record.seconds > 5.0


def test_what_moves_joints_needs_a_task_that_is_moved_by_joints():
    env = gym.make("onedemo/Reach-v0")
    demonstration = read_demonstration(shipped_demonstration("stack"))
    with pytest.raises(BadOption, match=r"'control_mode': 'ee_twist'.*control_mode='joint_velocity'"):
        make_policy("screw", env.unwrapped.task, demonstration)
