"""Untrained actors for tests: random weights, in a folder that goes with the process."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from onedemo.baselines.learning.actor import Actor, TrainingInfo, actor_for
from onedemo.baselines.learning.actor_card import METHOD
from onedemo.baselines.learning.actor_files import save_actor
from onedemo.baselines.learning.feature_scaling import Normalization
from onedemo.baselines.learning.features import Features
from onedemo.baselines.learning.network import Network
from onedemo.baselines.learning.residual_policy import default_scale

FOLDER = TemporaryDirectory()


def random_network(sizes: tuple[int, ...], seed: int = 0, activation: str = "relu", output: str = "tanh") -> Network:
    rng = np.random.default_rng(seed)
    weights = [rng.normal(size=(out, width)) / np.sqrt(width) for width, out in pairwise(sizes)]
    return Network(tuple(weights), tuple(rng.normal(size=len(each)) for each in weights), activation, output)


def random_actor(env, method: str = "sac", *, hidden: tuple[int, ...] = (16, 16), seed: int = 0) -> Actor:
    """An actor for an environment as it is, or for one whose screw policy it corrects."""
    task, features = env.unwrapped.task, Features.of(env.observation_space)
    scale: tuple[float, ...] = ()
    if method == METHOD:
        entries = env.action_space.shape
        features = Features((*features.shapes, ("screw_action", entries)), (*features.blocks, "screw_action"))
        scale = default_scale(task)
    network = random_network((features.size, *hidden, env.action_space.shape[0]), seed)
    normalization = Normalization.none(features.size)
    training = TrainingInfo("SAC", steps=1000, seed=seed, success=0.5, episodes=10, settings={"gamma": 0.98})
    return actor_for(task, network, features, normalization, method=method, residual_scale=scale, training=training)


def saved_actor(env, method: str = "sac") -> str:
    """The .json of such an actor."""
    task = env.unwrapped.task
    name = f"{method}-{task.name}-{task.robot}-{task.control_mode}-{round(1.0 / task.control_dt)}"
    path = Path(FOLDER.name) / name
    return str(save_actor(random_actor(env, method), path))
