"""Stable-Baselines3 learners, and the demonstration as their data; needs the extra `rl`."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np

from ...baselines import task_episode
from ...baselines.extras import needed
from ...configs import BadConfig, TrainConfig
from ...configs.errors import unknown_key
from ...configs.learner_arguments import DEFAULTS, misfit_of
from ...envs.core.goal_form import HORIZON
from ...planner.errors import BadOption
from .learner_env import base_env, learners_env, shown

EXTRA = "rl"
OWN = ("hidden", "envs", "n_sampled_goal")
"""Arguments beyond the algorithm's: widths of the hidden layers, number of environments stepped together in this
process, and hindsight goals per transition."""
NOT_OURS = {
    *("policy", "env", "policy_kwargs", "replay_buffer_class", "replay_buffer_kwargs"),
    *("tensorboard_log", "verbose", "seed", "device", "_init_setup_model"),
}
"""Arguments of the algorithm that a config may not set."""


def chosen(config: TrainConfig) -> dict[str, Any]:
    """Return all arguments of the learner, checked.

    Raises:
        BadConfig: an unknown argument, or a value that it cannot have.
        MissingExtra: Stable-Baselines3 is not installed.
    """
    known = known_arguments(config.algorithm)
    for key in config.learner:
        if key not in known:
            reason = f"{unknown_key(key, sorted(known))} (arguments of {config.algorithm})"
            raise BadConfig(config.name, f"learner.{key}", reason)
        if reason := misfit_of(key, config.learner[key]):
            raise BadConfig(config.name, f"learner.{key}", reason)
    values = {"envs": 1, **DEFAULTS[config.algorithm], **config.learner}
    if config.algorithm != "ppo" and values["envs"] != 1:
        raise BadConfig(config.name, "learner.envs", "is only for ppo; another learner steps one environment")
    if config.algorithm == "sac-her" and values["learning_starts"] < HORIZON:
        reason = f"{values['learning_starts']} is less than {HORIZON}, the longest episode: hindsight needs a whole one"
        raise BadConfig(config.name, "learner.learning_starts", reason)
    named, rollout = _rollout(config, values)
    if config.evaluate_every % rollout:
        raise BadConfig(
            config.name, "evaluate_every", f"{config.evaluate_every} is not a multiple of {named}, {rollout}"
        )
    return values


def _rollout(config: TrainConfig, values: dict[str, Any]) -> tuple[str, int]:
    """Return the arguments that set the steps between updates, and the steps; evaluations come only after updates."""
    if config.algorithm == "ppo":
        return "learner.n_steps x learner.envs", values["n_steps"] * values["envs"]
    steps = values.get("train_freq", 1)
    if isinstance(steps, bool) or not isinstance(steps, int) or steps < 1:
        raise BadConfig(config.name, "learner.train_freq", f"{steps!r} is not a positive whole number of steps")
    return "learner.train_freq", steps


def known_arguments(algorithm: str) -> set[str]:
    """Return the arguments that a config may give a learner."""
    if algorithm == "bc":
        return {"hidden", "learning_rate", "batch_size"}
    parameters = set(inspect.signature(_kind(algorithm).__init__).parameters) - {"self", *NOT_OURS}
    own = {"hidden", "n_sampled_goal"} if algorithm == "sac-her" else {"hidden"}
    return parameters | own | ({"envs"} if algorithm == "ppo" else set())


def made_model(config: TrainConfig, features: Any, normalization: Any) -> Any:
    """Build an untrained Stable-Baselines3 learner with its environments.

    Args:
        config: the training.
        features: `Features` of the observation.
        normalization: `Normalization` of the features.

    Raises:
        BadConfig: the learner refuses an argument.
        MissingExtra: Stable-Baselines3 is not installed.
    """
    library: Any = needed("stable_baselines3", EXTRA)
    monitor: Any = needed("stable_baselines3.common.monitor", EXTRA).Monitor
    vector: Any = needed("stable_baselines3.common.vec_env", EXTRA).DummyVecEnv
    values = chosen(config)
    own = {key: values.pop(key) for key in OWN if key in values}
    make: Callable[[], Any] = lambda: monitor(learners_env(config, features, normalization))  # noqa: E731
    more: dict[str, Any] = {}
    if config.algorithm == "sac-demo":
        more["replay_buffer_class"] = symmetric_buffer()
    if config.algorithm == "sac-her":
        more["replay_buffer_class"] = library.HerReplayBuffer
        more["replay_buffer_kwargs"] = {"n_sampled_goal": own["n_sampled_goal"]}
    policy = "MultiInputPolicy" if config.algorithm == "sac-her" else "MlpPolicy"
    try:
        model = _kind(config.algorithm)(
            policy,
            vector([make] * own["envs"]),
            policy_kwargs={"net_arch": list(own["hidden"])},
            device=config.device,
            verbose=0,
            **more,
            **values,
        )
    except (TypeError, ValueError, AssertionError) as error:
        raise BadConfig(config.name, "learner", str(error).splitlines()[0]) from None
    if config.algorithm == "sac-demo":
        model.replay_buffer.show(*demo_transitions(config, features, normalization))
    if config.algorithm == "residual":
        # zero last layer: an untrained learner corrects nothing (Silver et al., Residual Policy Learning, 2018)
        for parameter in model.actor.mu.parameters():
            parameter.data.zero_()
    return model


def demo_transitions(config: TrainConfig, features: Any, normalization: Any) -> tuple[np.ndarray, ...]:
    """Return the ONE demonstration as transitions of the config's task.

    Args:
        config: the training.
        features: `Features` of the observation.
        normalization: `Normalization` of the features.

    Returns:
        float32 arrays of n steps: scaled features (n, size) before and after each step, actions (n, m), rewards (n,),
        terminations (n,).

    Raises:
        BadOption: the demonstration, played back in the task, does not succeed.
    """
    env = base_env(config)
    episode = task_episode(env, shown(config))
    env.close()
    if not episode.success:
        raise BadOption("demonstration", f"played back in {config.task}, it does not succeed; nothing is to be cloned")
    before, after = (normalization(features(seen)) for seen in (episode.observations, episode.next_observations))
    actions = episode.actions.astype(np.float32)
    return before, after, actions, episode.rewards.astype(np.float32), episode.terminations.astype(np.float32)


def symmetric_buffer() -> type:
    """Return a replay buffer class whose batches are half demonstration (Ball et al., RLPD, ICML 2023)."""
    torch: Any = needed("torch", EXTRA)
    kind: Any = needed("stable_baselines3.common.buffers", EXTRA).ReplayBuffer

    class SymmetricBuffer(kind):
        """Replay buffer with a second one for the demonstration."""

        demo: Any = None

        def show(self, before: Any, after: Any, actions: Any, rewards: Any, ends: Any) -> None:
            """Store the demonstration, which is never overwritten.

            Args:
                before: (n, size) scaled features before each step.
                after: (n, size) scaled features after it.
                actions: (n, m) actions.
                rewards: (n,) rewards.
                ends: (n,) 1 where the episode terminated.
            """
            self.demo = kind(len(before), self.observation_space, self.action_space, self.device)
            for row in zip(before, after, actions, rewards, ends, strict=True):
                self.demo.add(*(np.asarray(part)[None] for part in row), [{}])

        def sample(self, batch_size: int, env: Any = None) -> Any:
            """Draw half of the batch from the experience and half from the demonstration.

            Args:
                batch_size: number of transitions.
                env: see `ReplayBuffer.sample`.
            """
            half = batch_size // 2
            done, seen = super().sample(batch_size - half, env), self.demo.sample(half, env)
            pairs: Any = zip(done, seen, strict=True)
            parts: Any = (None if a is None else torch.cat([a, b]) for a, b in pairs)
            return type(done)(*parts)

    return SymmetricBuffer


def _kind(algorithm: str) -> Any:
    library: Any = needed("stable_baselines3", EXTRA)
    return library.PPO if algorithm == "ppo" else library.SAC
