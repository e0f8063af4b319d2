"""Policies that were learned beforehand: an actor's file, no training, no torch."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...configs.shipped_files import shipped_actor
from ...envs.core.description import TaskDescription
from ...planner.errors import BadActor, BadOption, UnknownName
from ..policy import EpisodePolicy, Observation
from .actor import Actor
from .actor_files import card_path, foreign, load_actor

METHODS = ("sac", "ppo", "sac-her", "sac-demo", "bc")
"""Whose action is the actor's; `residual` adds it to another policy's."""
DIGITS = 16
"""Of a SHA-256, as many as tell actors apart."""
HERE = Path("actor")
"""What stands for the file of an actor that has none."""


@dataclass(frozen=True, slots=True)
class LearnedSettings:
    """Which actor acts.

    Attributes:
        checkpoint: name of a shipped actor, or a file as `load_actor` takes it; "": the shipped one of this method,
            task and robot.
        allow_pickle: a zip of Stable-Baselines3 is read too, which may run whatever code its author put into it;
            needs the extra `rl`.
        sha256: of the actor's file (the .json, which holds that of the weights), or its beginning; "": not looked at.
            A run writes it down, and goes on only with the same actor.
        training_steps: of the environment that its training took, for reports; a run writes it down.
    """

    checkpoint: str = ""
    allow_pickle: bool = False
    sha256: str = ""
    training_steps: int = 0


class LearnedPolicy(EpisodePolicy):
    """Acts as its actor does; remembers nothing.

    Args:
        actor: it.
        source: its file, for messages.

    Raises:
        BadActor: the actor is one that corrects another policy.
    """

    def __init__(self, actor: Actor, source: Path):
        if actor.residual_scale:
            raise BadActor(source, "residual_scale", "is not empty; only the method residual adds to another's action")
        self.actor, self._source = actor, source

    @classmethod
    def by(cls, actor: Actor) -> LearnedPolicy:
        """The policy of an actor that is at hand."""
        return cls(actor, HERE)

    @classmethod
    def found(cls, method: str, task: TaskDescription, settings: LearnedSettings) -> LearnedPolicy:
        """The policy of the actor that settings mean; see `found_actor`."""
        return cls(*found_actor(method, task, settings))

    def is_batch(self, observation: Observation) -> bool:
        """See `EpisodePolicy`; in the goal form of an environment there are no joint positions to tell it by."""
        key, shape = self.actor.features.shapes[0]
        return key in observation and np.ndim(observation[key]) == len(shape) + 1

    def begin(self, observation: Observation) -> tuple[()]:
        """Nothing to remember, once the observation is known to be the actor's."""
        check_seen(self.actor, observation, self._source)
        return ()

    def act(self, observation: Observation, memory: tuple[()]) -> np.ndarray:
        """The actor's action."""
        return self.actor(observation).astype(np.float64)


def found_actor(method: str, task: TaskDescription, settings: LearnedSettings) -> tuple[Actor, Path]:
    """The actor that the settings mean, fit for the method and the task; and its file.

    Raises:
        BadActor: the actor cannot be read, or is of another method, task, robot, control or observation.
        BadOption: there is none.
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

    Raises:
        BadActor: naming the first entry that is missing or of another shape.
    """
    if unseen := actor.unseen({key: np.shape(value) for key, value in observation.items()}):
        raise BadActor(source, *unseen)


def actor_file(method: str, task: str, robot: str, checkpoint: str) -> Path:
    """The file that a checkpoint means; without one, that of the actor shipped for a method, task and robot.

    Raises:
        BadOption: none is shipped.
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
    """Of an actor's .json, or of whatever file it is; None: it cannot be read."""
    try:
        return hashlib.sha256((path if foreign(path) else card_path(path)).read_bytes()).hexdigest()
    except OSError:
        return None
