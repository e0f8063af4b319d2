"""Schema of training configs: one learner on one task, from several seeds."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, ValidationError

from .errors import BadConfig, unknown_key
from .learner_arguments import DEFAULTS
from .run_config import STRICT, Name, digest_of, reason_of
from .strict_yaml import COMMAND_LINE, load_mapping, with_overrides

ALGORITHMS = ("sac", "ppo", "sac-her", "sac-demo", "bc", "residual")
BESIDE = ("name", "steps", "seeds", "executor", "workers", "address", "wall_seconds", "device")
"""Keys that do not affect the course of a seed's learning curve."""
Positive = Annotated[int, Field(ge=1, le=1_000_000_000)]


class TrainConfig(BaseModel):
    """A learner on a task.

    Attributes:
        name: first part of the training folder's name.
        task: name of the task, like "reach".
        algorithm: "sac" and "ppo" learn from rewards alone; "sac-her" from goals, with hindsight; "sac-demo" keeps the
            ONE demonstration in its buffer, half of every batch; "bc" clones it; "residual" corrects the method by SAC.
        demonstration: name of a shipped demonstration, or a file; ignored by algorithms that learn from rewards alone.
        steps: number of environment steps per seed; gradient steps for "bc". May be raised later: training then
            continues.
        seeds: number of seeds.
        seed: first seed.
        evaluate_every: number of steps between two evaluations, at which state and curve are written.
        evaluate_episodes: number of episodes per evaluation; scenario k has the seed k, as in a comparison.
        level: difficulty level of the episodes.
        robot: robosuite's name of the robot.
        env: further arguments of the environment, like `onto` of placing.
        learner: arguments of the learner, see docs/learning.md; missing ones keep their defaults.
        executor: where seeds are trained: this process, worker processes, or Ray's actors.
        workers: number of seeds trained at once; None: one per processor core.
        address: address of a Ray cluster; None: a local one.
        wall_seconds: real time [s] for `evaluate_every` steps after which a worker counts as hung.
        device: torch's device; "auto": a GPU if there is one.
    """

    model_config = STRICT

    name: Name
    task: str
    algorithm: Literal["sac", "ppo", "sac-her", "sac-demo", "bc", "residual"]
    demonstration: str
    steps: Positive
    seeds: Annotated[int, Field(ge=1, le=1000)] = 3
    seed: Annotated[int, Field(ge=0, le=2**31)] = 0
    evaluate_every: Positive = 5000
    evaluate_episodes: Annotated[int, Field(ge=1, le=10_000)] = 20
    level: str = "L1"
    robot: str = "Panda"
    env: dict[str, Any] = Field(default_factory=dict)
    learner: dict[str, Any] = Field(default_factory=dict)
    executor: Literal["serial", "process", "ray"] = "process"
    workers: Annotated[int, Field(ge=1, le=1024)] | None = None
    address: str | None = None
    wall_seconds: Annotated[float, Field(gt=0, le=604_800)] = 7200.0
    device: str = "auto"

    def digest(self) -> str:
        """Return twelve hexadecimal digits of all values that affect a seed's curve, defaults included."""
        values = self.model_dump(mode="json", exclude=set(BESIDE))
        return digest_of({**values, "learner": {**DEFAULTS[self.algorithm], **self.learner}})

    @property
    def legs(self) -> int:
        """Number of evaluations per seed."""
        return self.steps // self.evaluate_every


TRAIN_KEYS = tuple(TrainConfig.model_fields)


def load_training(path: str | Path, overrides: list[str] | None = None) -> TrainConfig:
    """Load and check a training config with `key=value` changes.

    Args:
        path: training config file.
        overrides: changes, each `key=value`.

    Raises:
        BadConfig: names the file, or the command line, and the key, and the allowed values.
    """
    return training_of(load_mapping(path), path, overrides)


def training_of(written: dict[str, Any], path: str | Path, overrides: list[str] | None = None) -> TrainConfig:
    """Check the content of a training config with `key=value` changes; see `load_training`.

    Args:
        written: content of the file.
        path: the file, or what stands for it in messages.
        overrides: changes, each `key=value`.

    Raises:
        BadConfig: see `load_training`.
    """
    changes = overrides or []
    changed = {text.partition("=")[0].split(".")[0] for text in changes}
    values = with_overrides(written, changes)
    for key in values:
        if key not in TRAIN_KEYS:
            source = COMMAND_LINE if key in changed else path
            raise BadConfig(source, str(key), unknown_key(str(key), TRAIN_KEYS))
    try:
        config = TrainConfig.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        source = COMMAND_LINE if key.split(".")[0] in changed else path
        raise BadConfig(source, key, reason_of(first, TRAIN_KEYS)) from None
    if config.steps % config.evaluate_every:
        reason = f"{config.steps} is not a multiple of evaluate_every, {config.evaluate_every}: {_nearest(config)}"
        raise BadConfig(COMMAND_LINE if "steps" in changed else path, "steps", reason)
    return config


def _nearest(config: TrainConfig) -> str:
    below, every = config.steps // config.evaluate_every * config.evaluate_every, config.evaluate_every
    return f"{below} or {below + every}" if below else f"{every}"
