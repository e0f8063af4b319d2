"""Stable-Baselines3's own hindsight replay takes the goal form as it is."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import onedemo.envs  # noqa: F401  (registers the ids)


@pytest.mark.parametrize("name", ["Reach", "PlaceOne", "TiltPour", "InsertOne"])
def test_hindsight_replay_trains_on_the_goal_form(name):
    library = pytest.importorskip("stable_baselines3", reason="the extra rl is not installed")
    env = gym.make(f"onedemo/{name}-v0", goal_form=True, reward="sparse")
    model = library.SAC(
        "MultiInputPolicy",
        env,
        replay_buffer_class=library.HerReplayBuffer,
        replay_buffer_kwargs={"n_sampled_goal": 4, "goal_selection_strategy": "future"},
        policy_kwargs={"net_arch": [16]},
        learning_starts=160,
        buffer_size=1000,
        batch_size=64,
        seed=0,
    )
    before = [part.detach().clone() for part in model.actor.parameters()]
    model.learn(200)
    assert any(not np.array_equal(a, b.detach()) for a, b in zip(before, model.actor.parameters(), strict=True))
    batch = model.replay_buffer.sample(256)
    reached = batch.rewards.numpy().ravel() == 1.0
    # four of five goals were achieved later in the same episode: some of them at this very step
    assert reached.any() and not reached.all()
