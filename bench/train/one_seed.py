"""Training of one seed, round by round; the state between rounds is on the disk, so that any process can continue.

A training round (`leg`) is `evaluate_every` steps followed by an evaluation. Each round starts with a reset environment
and with all random generators seeded from (seed, leg): a training that was killed and continued has the same curve, bit
for bit.
"""

from __future__ import annotations

import os
import shutil
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ...baselines import actor_of, save_actor
from ...baselines.extras import needed
from ...baselines.learning.actor import Actor, TrainingInfo
from ...configs import BadConfig, TrainConfig
from .behavior_cloning import Clone
from .evaluations import LEG, NUMBERS, Point, last_leg, numbers_of, points_of
from .learner_env import base_env, features_of, seen_env, shown
from .learner_state import load_state, save_state
from .learners import EXTRA, chosen, demo_transitions, made_model
from .progress import writing_steps

DEMONSTRATIONS = {"sac-demo": 1, "bc": 1, "residual": 1}
"""Number of demonstrations that an algorithm learns from; 0 if absent."""


class Trainee:
    """Learner of one seed in this process, restored from the last complete round on the disk.

    Args:
        config: the training.
        seed: seed of the learner.
        folder: folder of the seed.

    Raises:
        BadConfig: the stored state is damaged, or of another config.
        MissingExtra: torch or Stable-Baselines3 is not installed.
    """

    def __init__(self, config: TrainConfig, seed: int, folder: Path):
        torch: Any = needed("torch", EXTRA)
        # more threads do not speed up small networks, and sums would depend on the number of threads
        torch.set_num_threads(1)
        self.config, self.seed, self.folder = config, seed, folder
        env = seen_env(config)
        self.features, self.normalization = features_of(env, config)
        self._task, self._scale = env.unwrapped.task, getattr(env, "scale", ())
        env.close()
        self._evaluation = base_env(config, reward="dense", end_on_success=True)
        _seed_all(seed, 0)
        self._chosen = chosen(config)
        self.model = self._made()
        self.points = [] if (last := last_leg(folder)) is None else self._loaded(last)

    def run_leg(self) -> Point:
        """Train and evaluate one more round, and store the result."""
        begun, before = time.perf_counter(), self.points[-1].seconds if self.points else 0.0
        leg = len(self.points) + 1
        with self._events(leg) as logger:
            self._train(leg, logger)
            steps = int(self.model.num_timesteps)
            successes, returns = evaluated(self.config, self.actor(), self._evaluation)
            # the names that Stable-Baselines3 uses for evaluations
            logger.record("eval/success_rate", float(np.mean(successes)))
            logger.record("eval/mean_reward", float(np.mean(returns)))
            logger.dump(steps)
        seconds = before + time.perf_counter() - begun
        point = Point(self.seed, leg, steps, successes, returns, round(seconds, 3))
        self.points.append(point)
        self._keep()
        return point

    def actor(self) -> Actor:
        """Return the actor learned so far."""
        config, last = self.config, self.points[-1] if self.points else None
        training = TrainingInfo(
            config.algorithm,
            steps=int(self.model.num_timesteps),
            seed=self.seed,
            demonstrations=DEMONSTRATIONS.get(config.algorithm, 0),
            success=None if last is None else last.success,
            episodes=0 if last is None else len(last.successes),
            seconds=0.0 if last is None else last.seconds,
            settings={key: value for key, value in self._chosen.items() if isinstance(value, int | float | str)},
        )
        return actor_of(
            self.model.network if config.algorithm == "bc" else self.model,
            self._task,
            method=config.algorithm,
            features=self.features,
            normalization=self.normalization,
            residual_scale=self._scale,
            config_hash=config.digest(),
            training=training,
        )

    def _made(self) -> Any:
        config = self.config
        if config.algorithm != "bc":
            return made_model(config, self.features, self.normalization)
        before, _, actions, *_ = demo_transitions(config, self.features, self.normalization)
        return Clone(before, actions, self._chosen, config.device)

    def _train(self, leg: int, logger: Any) -> None:
        _seed_all(self.seed, leg)
        if self.config.algorithm == "bc":
            self.model.learn(self.config.evaluate_every)
            logger.record("train/loss", self.model.loss)
            return
        self.model.set_logger(logger)
        self.model.set_random_seed(_leg_seed(self.seed, leg))
        self.model._last_obs = None
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if hasattr(getattr(self.model, "replay_buffer", None), "truncate_last_trajectory"):
                self.model.replay_buffer.truncate_last_trajectory()
            self.model.learn(
                self.config.evaluate_every,
                writing_steps(self.folder),
                reset_num_timesteps=False,
                log_interval=10,
            )

    @contextmanager
    def _events(self, leg: int) -> Iterator[Any]:
        """Open a TensorBoard logger; its file joins those of earlier rounds only when this round is complete."""
        configure: Any = needed("stable_baselines3.common.logger", EXTRA).configure
        events = self.folder / "tensorboard" / f".{leg}"
        shutil.rmtree(events, ignore_errors=True)
        logger = configure(str(events), ["tensorboard"])
        try:
            yield logger
        finally:
            logger.close()
        for file in events.iterdir():
            file.replace(events.parent / f"{file.name}.{leg}")
        events.rmdir()

    def _keep(self) -> None:
        """Write state and actor; the previous round is deleted once this one is complete."""
        leg = len(self.points)
        target = self.folder / LEG.format(leg)
        part = target.with_name(f".{target.name}")
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
        points = [asdict(point) for point in self.points]
        save_state(self.model, part, {"digest": self.config.digest(), "points": points})
        save_actor(self.actor(), part / "actor")
        _on_disk(part)
        shutil.rmtree(target, ignore_errors=True)
        part.replace(target)
        for old in self.folder.glob("leg-*"):
            if old != target:
                shutil.rmtree(old)

    def _loaded(self, last: Path) -> list[Point]:
        digest = numbers_of(last)["digest"]
        if digest != self.config.digest():
            reason = f"is of the config {digest}, not of {self.config.digest()}: begin in another --output"
            raise BadConfig(last / NUMBERS, "digest", reason)
        return points_of(load_state(self.model, last))


def evaluated(config: TrainConfig, actor: Actor, env: Any) -> tuple[tuple[bool, ...], tuple[float, ...]]:
    """Evaluate an actor on the frozen scenarios: seeds from 0 on, as in a comparison.

    Args:
        config: the training.
        actor: the actor.
        env: environment with dense rewards that ends at a success.

    Returns:
        Success and return of each scenario; a success adds 1 to the return for every step it saved.
    """
    from ...baselines import LearnedPolicy
    from ...baselines.learning.residual_policy import ResidualPolicy

    if config.algorithm == "residual":
        policy: Any = ResidualPolicy.by(env.unwrapped.task, shown(config), actor)
    else:
        policy = LearnedPolicy.by(actor)
    successes, returns = [], []
    limit = env.spec.max_episode_steps
    for seed in range(config.evaluate_episodes):
        observation, info = env.reset(seed=seed)
        state, total, steps, over = None, 0.0, 0, False
        while not over:
            action, state = policy.predict(observation, state)
            observation, reward, terminated, truncated, info = env.step(action)
            total, steps, over = total + float(reward), steps + 1, terminated or truncated
        successes.append(bool(info["success"]))
        returns.append(round(total + (limit - steps if info["success"] else 0), 6))
    return tuple(successes), tuple(returns)


def _leg_seed(seed: int, leg: int) -> int:
    rng = np.random.default_rng([seed, leg])
    return int(rng.integers(2**31))


def _seed_all(seed: int, leg: int) -> None:
    needed("stable_baselines3.common.utils", EXTRA).set_random_seed(_leg_seed(seed, leg))


def _on_disk(folder: Path) -> None:
    for path in (*folder.iterdir(), folder):
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
