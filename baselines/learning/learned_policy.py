"""Policies learned beforehand: they need an actor's file, but neither training nor torch."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...configs import shipped_actor
from ...envs import TaskDescription
from ...planner.errors import BadOption, UnknownName
from ..errors import BadActor
from ..policy import EpisodePolicy, Observation
from .actor import Actor
from .actor_files import card_path, foreign, load_actor

METHODS = ("sac", "ppo", "sac-her", "sac-demo", "bc")
"""Methods whose action is the actor's output; `residual` adds that output to another policy's action."""
DIGITS = 16
"""Digits of a SHA-256 that suffice to distinguish actors."""
HERE = Path("actor")
"""Stand-in path of an actor without a file."""


@dataclass(frozen=True, slots=True)
class LearnedSettings:
    """Choice of the actor.

    Attributes:
        checkpoint: name of a shipped actor, or a file that `load_actor` accepts; "": the shipped actor of this method,
            task and robot.
        allow_pickle: also read a Stable-Baselines3 zip, which may run any code its author put into it; needs the extra
            `rl`.
        sha256: SHA-256 of the actor's file (the .json, which contains that of the weights), or its beginning; "": not
            checked. A run records it, and continues only with the same actor.
        training_steps: environment steps of its training, for reports; recorded by a run.
    """

    checkpoint: str = ""
    allow_pickle: bool = False
    sha256: str = ""
    training_steps: int = 0


class LearnedPolicy(EpisodePolicy):
    """Policy that acts as its actor does, without memory.

    Args:
        actor: the actor.
        source: file of the actor, for messages.

    Raises:
        BadActor: the actor corrects another policy.
    """

    def __init__(self, actor: Actor, source: Path):
        if actor.residual_scale:
            raise BadActor(source, "residual_scale", "is not empty; only the method residual adds to another's action")
        self.actor, self._source = actor, source

    @classmethod
    def by(cls, actor: Actor) -> LearnedPolicy:
        """Return the policy of an actor in memory."""
        return cls(actor, HERE)

    @classmethod
    def found(cls, method: str, task: TaskDescription, settings: LearnedSettings) -> LearnedPolicy:
        """Return the policy of the actor that the settings name; see `found_actor`.

        Args:
            method: name of the method.
            task: the task.
            settings: choice of the actor.
        """
        return cls(*found_actor(method, task, settings))

    def is_batch(self, observation: Observation) -> bool:
        """See `EpisodePolicy`; uses the actor's first entry, because the goal form has no joint positions."""
        key, shape = self.actor.features.shapes[0]
        return key in observation and np.ndim(observation[key]) == len(shape) + 1

    def begin(self, observation: Observation) -> tuple[()]:
        """See `EpisodePolicy`; checks the first observation."""
        check_seen(self.actor, observation, self._source)
        return ()

    def act(self, observation: Observation, memory: tuple[()]) -> np.ndarray:
        """See `EpisodePolicy`."""
        return self.actor(observation).astype(np.float64)


def found_actor(method: str, task: TaskDescription, settings: LearnedSettings) -> tuple[Actor, Path]:
    """Return the actor that the settings name, checked against method and task, and its file.

    Args:
        method: name of the method.
        task: the task.
        settings: choice of the actor.

    Raises:
        BadActor: the actor cannot be read, or has another method, task, robot, control mode or observation.
        BadOption: there is no such actor.
    """
    path = actor_file(method, task.name, task.robot, settings.checkpoint)
    if (found := sha256_of(path)) is not None and not found.startswith(settings.sha256):
        raise BadActor(path, "sha256", f"is {found[:DIGITS]}; wanted is {settings.sha256}: it is another actor")
    if settings.allow_pickle and foreign(path).startswith("is a zip"):
        from .export_actor import actor_of_zip

        actor = actor_of_zip(path, task, method=method)
    else:
        actor = load_actor(path)
    if misfit := actor.misfit(method, task):
        raise BadActor(path, *misfit)
    return actor, path


def check_seen(actor: Actor, observation: Observation, source: Path) -> None:
    """Refuse an observation that the actor was not made for.

    Args:
        actor: the actor.
        observation: an observation of the task.
        source: file of the actor, for messages.

    Raises:
        BadActor: the first entry that is missing or has another shape.
    """
    if unseen := actor.unseen({key: np.shape(value) for key, value in observation.items()}):
        raise BadActor(source, *unseen)


def actor_file(method: str, task: str, robot: str, checkpoint: str) -> Path:
    """Return the file of a checkpoint, or of the actor shipped for a method, task and robot.

    Args:
        method: name of the method.
        task: name of the task.
        robot: robosuite's name of the robot.
        checkpoint: see `LearnedSettings`.

    Raises:
        BadOption: no such actor is shipped.
    """
    name = checkpoint or f"{method}-{task}-{robot}"
    try:
        return shipped_actor(name)
    except UnknownName as error:
        if checkpoint:
            return Path(checkpoint)
        place = f"-{task}-{robot}"
        shipped = [str(known).removesuffix(place) for known in error.known if str(known).endswith(place)]
        there = f" (shipped: {', '.join(shipped)})" if shipped else ""
        reason = f"no actor is shipped for {method!r} on {task} with {robot}{there}; name a file (docs/learning.md)"
        raise BadOption("checkpoint", reason) from None


def sha256_of(path: Path) -> str | None:
    """Return the SHA-256 of an actor's .json, or of a foreign file itself; None if it cannot be read."""
    try:
        return hashlib.sha256((path if foreign(path) else card_path(path)).read_bytes()).hexdigest()
    except OSError:
        return None
