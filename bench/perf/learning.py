"""Share of a learner's time that its environment takes, measured against the same learner on an idle environment."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import gymnasium as gym

from ...baselines.errors import MissingExtra
from ...configs import TrainConfig
from ...envs import TASKS
from ...envs.core.goal_form import HORIZON
from .measuring import Row, row, seconds_per_call

SHARE = 0.85
"""Required share of the throughput on an idle environment."""
LEARNERS: dict[str, dict[str, Any]] = {"our SAC": {}, "SB3's SAC": {"hidden": [256, 256], "batch_size": 256}}
"""Networks and batches: this project's defaults, made for one core, and the library's own."""


class Idle(gym.Env):
    """Environment that does nothing, with the spaces and the episode length of another one.

    Args:
        like: environment that gives the spaces.
    """

    def __init__(self, like: Any):
        self.observation_space, self.action_space = like.observation_space, like.action_space
        self._seen, self._steps = like.observation_space.sample(), 0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """See `gymnasium.Env`."""
        super().reset(seed=seed)
        self._steps = 0
        return self._seen, {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """See `gymnasium.Env`; the observation never changes."""
        self._steps += 1
        return self._seen, 0.0, False, self._steps >= HORIZON, {}


def _throughput(task: str, learner: str, name: str) -> Row:
    from ...baselines.extras import needed
    from ..train.learner_env import features_of, seen_env
    from ..train.learners import EXTRA, made_model

    try:
        needed("torch", EXTRA).set_num_threads(1)
        vector: Any = needed("stable_baselines3.common.vec_env", EXTRA).DummyVecEnv
    except MissingExtra:
        return Row(name, None, "ratio", 1.0 / SHARE, None, f"needs: pip install 'onedemo[{EXTRA}]'")
    values = {"train_freq": 1, "learning_starts": 100, "buffer_size": 10_000, **LEARNERS[learner]}
    config = TrainConfig(name="perf", task=task, algorithm="sac", demonstration="stack", steps=1, learner=values)
    env = seen_env(config)
    features, normalization = features_of(env, config)
    env.close()
    ours, idle = (made_model(config, features, normalization) for _ in range(2))
    idle.set_env(vector([partial(Idle, ours.get_env())]))
    learn = [partial(model.learn, HORIZON, reset_num_timesteps=False) for model in (ours, idle)]
    mine, theirs = (seconds / HORIZON for seconds in seconds_per_call(*learn))
    note = (
        f"{mine * 1e3:.2f} ms against {theirs * 1e3:.2f} ms per step with one update; {theirs / mine:.2f} of its speed"
    )
    return row(name, mine / theirs, "ratio", 1.0 / SHARE, note)


def _name(task: str, learner: str) -> str:
    return f"{TASKS[task].id.split('/')[1].split('-')[0]} step of {learner} / on an idle environment"


LEARNING_LINES: dict[str, Callable[[], Row]] = {
    _name(task, learner): partial(_throughput, task, learner, _name(task, learner))
    for task in ("reach", "place_one")
    for learner in LEARNERS
}
"""Measurements by name."""
