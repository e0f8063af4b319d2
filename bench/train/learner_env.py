"""The environments that learners see: features of ours, scaled; the method inside of what corrects it."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np

from ...baselines.learning.feature_scaling import FlatFeatures, Normalization, measured_normalization
from ...baselines.learning.features import OBSTACLE, Features
from ...baselines.learning.residual_policy import AroundScrew
from ...configs.shipped_files import demonstration_path
from ...configs.train_config import TrainConfig
from ...envs.core.single_motion import LAST_ACTION
from ...planner.imitation.demonstration import Demonstration
from ...planner.imitation.demonstration_files import load_demonstration
from ..task_table import TASKS

GOALS = ("achieved_goal", "desired_goal")
MEASURED_EPISODES, MEASURED_STEPS = 20, 75
"""Episodes of random actions, and their length, that say how features are scaled."""


class ScaledGoals(gym.ObservationWrapper):
    """The goal form with a scaled observation; goals stay as they are, for they are exchanged and compared.

    Args:
        env: in the goal form.
        normalization: of `Features.raw` of its observation.
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
        """The observation in single precision, scaled but for the goals."""
        goals = {key: observation[key].astype(np.float32) for key in GOALS}
        return {**goals, "observation": self._scale(observation["observation"].astype(np.float32))}


def shown(config: TrainConfig) -> Demonstration:
    """The demonstration of a config."""
    return load_demonstration(demonstration_path(config.demonstration))


def base_env(config: TrainConfig, **options: Any) -> Any:
    """The environment of a config as a policy sees it."""
    from ... import envs  # noqa: F401  (registers the ids)

    arguments: dict[str, Any] = {"robot": config.robot, "level": config.level, **config.env}
    if config.algorithm == "residual":
        arguments["control_mode"] = "joint_velocity"
    if config.algorithm == "sac-her":
        arguments |= {"goal_form": True, "reward": "sparse"}
    return gym.make(TASKS[config.task].id, **{**arguments, **options})


def seen_env(config: TrainConfig) -> Any:
    """The environment with what the learner sees beside, before features are taken and scaled."""
    env = base_env(config)
    return AroundScrew(env, shown(config)) if config.algorithm == "residual" else env


def features_of(env: Any, config: TrainConfig) -> tuple[Features, Normalization]:
    """What is learned from, and how it is scaled: the same for all seeds."""
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
    """The entries a learner sees; None: all but the obstacles'.

    A clone that sees what was done last repeats it: in a demonstration that is right nearly always (de Haan et al.,
    Causal Confusion in Imitation Learning, NeurIPS 2019).
    """
    if config.algorithm != "bc":
        return None
    return tuple(key for key in env.observation_space.spaces if key != LAST_ACTION and not key.startswith(OBSTACLE))


def learners_env(config: TrainConfig, features: Features, normalization: Normalization) -> Any:
    """The environment that a learner steps."""
    env = seen_env(config)
    if config.algorithm == "sac-her":
        return ScaledGoals(env, normalization)
    return FlatFeatures(env, features, normalization)
