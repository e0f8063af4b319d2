"""The safety layer around a policy that knows nothing."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.baselines.safe_actions import SafeActions
from onedemo.planner.errors import BadOption


def unwanted(env, seeds=5, steps=300):
    """Episodes with unwanted contacts, under actions that are drawn anew every half second; and what was done."""
    rng, bad, done = np.random.default_rng(0), 0, np.zeros(4, dtype=int)
    for seed in range(seeds):
        _, info = env.reset(seed=seed)
        for k in range(steps):
            if k % 25 == 0:
                action = rng.uniform(-0.6, 0.6, env.action_space.shape)
            _, _, over, _, info = env.step(action)
            done[info.get("safety", 0)] += 1
            if over:
                break
        bad += not info["safe"]
    return bad, done


def test_a_random_policy_touches_nothing_with_it_and_much_without():
    bare, _ = unwanted(gym.make("onedemo/Stack-v0"))
    safe, done = unwanted(SafeActions(gym.make("onedemo/Stack-v0")))
    assert bare >= 2 and safe == 0
    assert done[1:].sum() > 100


def test_it_follows_the_rules_of_an_environment():
    env = SafeActions(gym.make("onedemo/Stack-v0"))
    observation, info = env.reset(seed=1)
    assert env.observation_space.contains(observation) and info["safety"] == 0
    action, status = env.safe_action(np.zeros(8))
    assert env.action_space.contains(action) and not action[:7].any() and status == 0


def test_the_gripper_is_left_alone():
    env = SafeActions(gym.make("onedemo/Stack-v0"))
    env.reset(seed=1)
    assert env.safe_action(np.append(np.full(7, 1.0), -0.7))[0][7] == -0.7


def test_twists_are_refused():
    with pytest.raises(BadOption, match="joint_velocity"):
        SafeActions(gym.make("onedemo/Stack-v0", control_mode="ee_twist"))


def test_an_episode_does_not_depend_on_the_one_before():
    env, ends = SafeActions(gym.make("onedemo/Stack-v0")), []
    for first in (3, 4):
        env.reset(seed=first)
        for _ in range(5 * first):
            env.step(np.full(8, 0.3))
        env.reset(seed=7)
        for _ in range(60):
            observation, *_ = env.step(np.full(8, -0.4))
        ends.append(observation["joint_positions"])
    np.testing.assert_array_equal(*ends)
