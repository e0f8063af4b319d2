"""Every policy takes up every task: what is promised of the comparison."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from policies import installed

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.baselines.factory import POLICIES, make_policy
from onedemo.bench.tasks import TASKS
from onedemo.configs.schema import load_config
from onedemo.configs.shipped import shipped_config, shipped_demonstration
from onedemo.planner.demo_io import load_demonstration

TICKS = 100


@pytest.fixture(scope="module", params=TASKS)
def task_env(request):
    config = load_config(shipped_config(request.param))
    made = gym.make(TASKS[config.task].id, level="L1", **config.env)
    yield made, config
    made.close()


@pytest.mark.parametrize("name", installed(*sorted(POLICIES)))
def test_every_policy_takes_up_every_task(task_env, name):
    """For two seconds: it moves, and each of its actions is one that the environment takes."""
    env, config = task_env
    demonstration = load_demonstration(shipped_demonstration(config.demonstration))
    policy, state = make_policy(name, env.unwrapped.task, demonstration, config.settings), None
    observation, _ = env.reset(seed=1000)
    before, moved = observation["joint_positions"].copy(), 0.0
    for _ in range(TICKS):
        action, state = policy.predict(observation, state)
        assert env.action_space.contains(action)
        observation, *_ = env.step(action)
        moved = max(moved, np.abs(observation["joint_positions"] - before).max())
    report = policy.report(state)
    assert not report.failure_reason, report.detail
    assert moved > 0.1
    labels = {path.label for path in report.paths}
    # a way through joint space is drawn as one round what was not shown
    assert labels - {"escape"} == {"demonstrated", "final"}
