"""Features as a bounded box for training, with a scaling that is measured once and then fixed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from ...planner.errors import BadOption, BadShape, NotFinite
from ...planner.ranges import check_ranges
from ..policy import Observation
from .features import Features

CLIP = 10.0
"""Scaled values beyond this are clipped."""
HELD = 10
"""Control steps for which a random action is held: with a new action at every step the arm would hardly move."""
LENGTH, SPEED, SHARE = 0.05, 0.25, 0.125
"""Least scale of a length [m], of a joint speed [rad/s], and of all other features as a share of their range: features
that random actions hardly change may change more later."""
LENGTHS = (".x", ".y", ".z")
"""Endings of feature names that denote lengths, unless the name contains one of `AXIS`."""
AXIS = ("x_axis", "z_axis")


@dataclass(frozen=True, slots=True, eq=False)
class Normalization:
    """Scaling of features: subtract the mean, divide by the scale, clip.

    Attributes:
        mean: (n,) float32, read-only.
        scale: (n,) float32, positive, read-only.
        clip: largest absolute value afterwards; None: no clipping.

    Raises:
        BadShape: mean and scale differ in length.
        NotFinite: an entry of mean or scale is not finite.
        BadOption: a scale or the clip is not positive.
    """

    mean: np.ndarray
    scale: np.ndarray
    clip: float | None = CLIP

    def __post_init__(self):
        for name in ("mean", "scale"):
            array = np.array(getattr(self, name), dtype=np.float32)
            if array.ndim != 1 or len(array) != len(self.mean):
                raise BadShape(name, array.shape, f"({len(self.mean)},)")
            if not np.isfinite(array).all():
                raise NotFinite(name, int(np.argmin(np.isfinite(array))))
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        if (self.scale <= 0.0).any():
            raise BadOption("scale", f"entry {int(np.argmax(self.scale <= 0.0))} is not positive")
        if self.clip is not None:
            check_ranges(self, "(0, inf)", "clip")

    @staticmethod
    def none(size: int, clip: float | None = CLIP) -> Normalization:
        """Return the scaling that only clips.

        Args:
            size: number of features.
            clip: see `Normalization`.
        """
        return Normalization(np.zeros(size), np.ones(size), clip)

    def __call__(self, features: np.ndarray) -> np.ndarray:
        """Return the scaled features (..., n) float32."""
        scaled = (features - self.mean) / self.scale
        return scaled if self.clip is None else np.clip(scaled, -np.float32(self.clip), np.float32(self.clip))


class FlatFeatures(gym.ObservationWrapper, gym.utils.RecordConstructorArgs):
    """Environment whose observation is a flat float32 box of features.

    Args:
        env: environment with a Dict of boxes as its observation.
        features: features to take; None: `Features.of` its observation space.
        normalization: scaling of the features; None: unscaled, clipped at `CLIP`.

    Raises:
        BadShape: the normalization has another number of features.
    """

    def __init__(self, env: gym.Env, features: Features | None = None, normalization: Normalization | None = None):
        gym.utils.RecordConstructorArgs.__init__(self, features=features, normalization=normalization)
        gym.ObservationWrapper.__init__(self, env)
        self.features = features or Features.of(env.observation_space)
        self.normalization = normalization or Normalization.none(self.features.size)
        if len(self.normalization.mean) != self.features.size:
            raise BadShape("normalization", self.normalization.mean.shape, f"({self.features.size},)")
        low, high = (np.asarray(bound, np.float32) for bound in self.features.bounds(env.observation_space))
        self.observation_space = spaces.Box(self.normalization(low), self.normalization(high), dtype=np.float32)

    def observation(self, observation: Observation) -> np.ndarray:
        """Return the scaled features (n,) float32."""
        return self.normalization(self.features(observation))


def measured_normalization(
    env: Any, features: Features, *, episodes: int = 20, steps: int = 200, seed: int = 0
) -> Normalization:
    """Measure mean and standard deviation of features over episodes of random actions, each held for `HELD` steps.

    Standard deviations below `LENGTH`, `SPEED` or `SHARE` of the range are raised to that limit.

    Args:
        env: environment with a Dict of boxes as its observation.
        features: features to measure.
        episodes: number of episodes; episode k has the seed `seed + k`.
        steps: largest number of steps per episode.
        seed: seed of the first episode and of the actions.
    """
    rng, seen = np.random.default_rng(seed), []
    low, high = env.action_space.low, env.action_space.high
    for episode in range(episodes):
        observation, _ = env.reset(seed=seed + episode)
        seen.append(features(observation))
        actions = np.repeat(rng.uniform(low, high, (steps // HELD + 1, *low.shape)), HELD, axis=0)
        for action in actions[:steps]:
            observation, _, terminated, truncated, _ = env.step(action)
            seen.append(features(observation))
            if terminated or truncated:
                break
    values = np.array(seen, dtype=np.float64)
    scale = np.maximum(values.std(axis=0), _least(features, env.observation_space))
    return Normalization(values.mean(axis=0), scale)


def _least(features: Features, space: spaces.Space[Any]) -> np.ndarray:
    """Return the least scale (n,) of each feature."""
    low, high = features.bounds(space)
    least = SHARE * (high - low)
    for k, name in enumerate(features.names):
        length = name.endswith(LENGTHS) and not any(axis in name for axis in AXIS)
        if length or name.startswith("gripper_opening"):
            least[k] = LENGTH
        elif name.startswith("joint_velocities"):
            least[k] = SPEED
    return np.where(least > 0.0, least, 1.0)
