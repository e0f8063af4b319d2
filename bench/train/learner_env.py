"""Environments as learners see them: with scaled features and, for the residual learner, the screw policy inside."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np

from ...baselines import AroundScrew, Features, FlatFeatures, measured_normalization
from ...baselines.learning.feature_scaling import Normalization
from ...baselines.learning.features import OBSTACLE
from ...configs import TrainConfig, load_demonstration
from ...envs import facts_of
from ...envs.core.goal_form import LAST_ACTION
from ...planner import Demonstration

GOALS = ("achieved_goal", "desired_goal")
MEASURED_EPISODES, MEASURED_STEPS = 20, 75
"""Number and length [steps] of the random-action episodes that determine the scaling of the features."""


class ScaledGoals(gym.ObservationWrapper):
    """Goal form of an environment with a scaled observation.

    Goals stay unscaled, because hindsight exchanges and compares them.

    Args:
        env: environment in the goal form.
        normalization: scaling of `Features.raw` of its observation.
    """

    def __init__(self, env: gym.Env, normalization: Normalization):
        super().__init__(env)
        space: Any = env.observation_space
        skip = sum(space[key].shape[0] for key in GOALS)
        self._scale = Normalization(normalization.mean[skip:], normalization.scale[skip:], normalization.clip)
        whole = space["observation"]
        low, high = (self._scale(np.asarray(bound, dtype=np.float32)) for bound in (whole.low, whole.high))
        goals = {key: gym.spaces.Box(-np.inf, np.inf, space[key].shape, np.float32) for key in GOALS}
        self.observation_space = gym.spaces.Dict({**goals, "observation": gym.spaces.Box(low, high, dtype=np.float32)})

    def observation(self, observation: Any) -> dict[str, np.ndarray]:
        """Return the observation in single precision, scaled except for the goals."""
        goals = {key: observation[key].astype(np.float32) for key in GOALS}
        return {**goals, "observation": self._scale(observation["observation"].astype(np.float32))}


def shown(config: TrainConfig) -> Demonstration:
    """Load the demonstration of a config."""
    return load_demonstration(config.demonstration)


def base_env(config: TrainConfig, **options: Any) -> Any:
    """Build the environment of a config as a policy sees it.

    Args:
        config: the training.
        options: further arguments of the environment; they take precedence.
    """
    from ... import envs  # noqa: F401  (registers the ids)

    arguments: dict[str, Any] = {"robot": config.robot, "level": config.level, **config.env}
    if config.algorithm == "residual":
        arguments["control_mode"] = "joint_velocity"
    if config.algorithm == "sac-her":
        arguments |= {"goal_form": True, "reward": "sparse"}
    return gym.make(facts_of(config.task, load=True).id, **{**arguments, **options})


def seen_env(config: TrainConfig) -> Any:
    """Build the environment before its features are taken and scaled; for `residual`, with the screw policy inside."""
    env = base_env(config)
    return AroundScrew(env, shown(config)) if config.algorithm == "residual" else env


def features_of(env: Any, config: TrainConfig) -> tuple[Features, Normalization]:
    """Return the learner's features and their scaling, which are the same for all seeds.

    Args:
        env: environment of `seen_env`.
        config: the training.
    """
    goal = config.algorithm == "sac-her"
    features = Features.raw(env.observation_space) if goal else Features.of(env.observation_space, _seen(env, config))
    measured = measured_normalization(env, features, episodes=MEASURED_EPISODES, steps=MEASURED_STEPS)
    if not goal:
        return features, measured
    skip = sum(env.observation_space[key].shape[0] for key in GOALS)
    mean, scale = measured.mean.copy(), measured.scale.copy()
    mean[:skip], scale[:skip] = 0.0, 1.0
    return features, Normalization(mean, scale, measured.clip)


def _seen(env: Any, config: TrainConfig) -> tuple[str, ...] | None:
    """Return the observation entries that a learner sees; None: all but the obstacles'.

    A clone that sees its last action repeats it, since in a demonstration that is nearly always right (de Haan et al.,
    Causal Confusion in Imitation Learning, NeurIPS 2019).
    """
    if config.algorithm != "bc":
        return None
    return tuple(key for key in env.observation_space.spaces if key != LAST_ACTION and not key.startswith(OBSTACLE))


def learners_env(config: TrainConfig, features: Features, normalization: Normalization) -> Any:
    """Build the environment that a learner steps.

    Args:
        config: the training.
        features: features of the observation.
        normalization: scaling of the features.
    """
    env = seen_env(config)
    if config.algorithm == "sac-her":
        return ScaledGoals(env, normalization)
    return FlatFeatures(env, features, normalization)
