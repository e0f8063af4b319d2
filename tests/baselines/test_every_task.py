"""Every policy takes up every task: what is promised of the comparison."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from actors import saved_actor
from policies import LEARNED, PROGRAMS, installed

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.baselines.factory import make_policy
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


def taken_up(task_env, name, settings):
    """The report of a policy after two seconds: it has moved, each of its actions is one that the environment takes."""
    env, config = task_env
    demonstration = load_demonstration(shipped_demonstration(config.demonstration))
    policy, state = make_policy(name, env.unwrapped.task, demonstration, settings), None
    observation, _ = env.reset(seed=1000)
    before, moved = observation["joint_positions"].copy(), 0.0
    for _ in range(TICKS):
        action, state = policy.predict(observation, state)
        assert env.action_space.contains(action)
        observation, *_ = env.step(action)
        moved = max(moved, np.abs(observation["joint_positions"] - before).max())
    assert moved > 0.1
    return policy.report(state) if hasattr(policy, "report") else None


@pytest.mark.parametrize("name", installed(*PROGRAMS))
def test_every_policy_takes_up_every_task(task_env, name):
    report = taken_up(task_env, name, task_env[1].settings)
    assert not report.failure_reason, report.detail
    labels = {path.label for path in report.paths}
    # a way through joint space is drawn as one round what was not shown
    assert labels - {"escape"} == {"demonstrated", "final"}


@pytest.mark.parametrize("name", LEARNED)
def test_every_learned_policy_takes_up_every_task(task_env, name):
    taken_up(task_env, name, {"checkpoint": saved_actor(task_env[0], name)})
