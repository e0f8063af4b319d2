"""Learner arguments that hold unless a training config sets them; part of a training's digest."""

from __future__ import annotations

from typing import Any

OFF_POLICY: dict[str, Any] = {
    "hidden": [128, 128],
    "learning_rate": 5e-4,
    "gamma": 0.95,
    # an update takes two to four times as long as a step of the environment
    "batch_size": 256,
    "train_freq": 2,
    "learning_starts": 1000,
    "buffer_size": 1_000_000,
    # starting from 1, the entropy bonus hides these rewards for the first 20 000 steps
    "ent_coef": "auto_0.01",
}
PPO: dict[str, Any] = {
    "hidden": [128, 128],
    "envs": 4,
    "learning_rate": 1e-3,
    "gamma": 0.95,
    "n_steps": 256,
    "batch_size": 256,
    "n_epochs": 5,
    "ent_coef": 0.0,
}
DEFAULTS: dict[str, dict[str, Any]] = {
    "sac": OFF_POLICY,
    "sac-demo": OFF_POLICY,
    "residual": OFF_POLICY,
    "sac-her": {**OFF_POLICY, "n_sampled_goal": 4, "buffer_size": 200_000},
    "ppo": PPO,
    "bc": {"hidden": [128, 128], "learning_rate": 1e-3, "batch_size": 64},
}
"""Arguments by algorithm. `hidden`: widths of the hidden layers; `envs`: environments stepped at once in one
process; `n_sampled_goal`: hindsight goals per transition. The others are the library's own arguments."""
