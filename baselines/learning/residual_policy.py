"""Residual learning: the screw policy acts, and a learned actor corrects its actions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from ...envs import TaskDescription
from ...planner import Demonstration
from ...planner.errors import BadOption
from ..errors import BadActor
from ..policy import EpisodePolicy, Observation, PolicyReport
from ..program_policy import Episode
from ..screw_policy import ScrewPolicy
from .actor import Actor
from .actor_card import METHOD
from .learned_policy import HERE, LearnedSettings, check_seen, found_actor

SCREW_ACTION = "screw_action"
"""Observation entry with the screw policy's action."""
SHARE = 0.1
"""Default limit of a correction, as a share of the speed of the method's fastest joint at that time."""


def corrected(action: np.ndarray, correction: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Return the corrected action (n,), clipped to [-1, 1].

    Corrections are proportional to the other policy's speed and end where it comes to rest. With random corrections, as
    in exploration, of 0.05 of a full action at any time, PlaceOne kept 3 of 6 successes, and without successes nothing
    is learned from them; with 0.2 of the policy's own speed it kept 6 of 6.

    Args:
        action: (n,) action of the other policy.
        correction: (n,) action of the learner, in [-1, 1].
        scale: (n,) see `Actor.residual_scale`.
    """
    speed = float(np.abs(action[scale > 0.0]).max(initial=0.0))
    return np.clip(action + speed * scale * correction, -1.0, 1.0)


def notify(memory: Episode, task: TaskDescription, action: np.ndarray, taken: np.ndarray) -> None:
    """Tell the screw policy which action was taken, so that it continues from the commanded joints.

    Otherwise corrections would add up to a drift that nothing leads back from.

    Args:
        memory: memory of the screw policy; its commanded joints are changed.
        task: the task.
        action: (n,) action of the screw policy.
        taken: (n,) action taken instead.
    """
    limits = np.stack([arm.velocity_limits for arm in task.arms])
    extra = (taken - action).reshape(len(limits), -1)[:, :-1]
    memory.executor.q += task.control_dt * (extra * limits).reshape(memory.executor.q.shape)


def default_scale(task: TaskDescription, share: float = SHARE) -> tuple[float, ...]:
    """Return the scale of corrections: `share` for every joint, 0 for the grippers.

    A gripper entry of 0 leaves the gripper as it is, but even a slightly negative one drops the held object.

    Args:
        task: the task.
        share: see `SHARE`.
    """
    return tuple([*[share] * task.arms[0].dof, 0.0] * len(task.arms))


class AroundScrew(gym.Wrapper, gym.utils.RecordConstructorArgs):
    """Environment in which the screw policy acts and a learner's actions correct it.

    The observation has one more entry, `screw_action`: the action to which the correction is added. Once the screw
    policy has finished or failed, it stands still.

    Args:
        env: environment of this project in the control mode `joint_velocity`.
        demonstration: the ONE demonstration.
        scale: (n,) see `Actor.residual_scale`; None: `default_scale`.

    Attributes:
        scale: see the arguments.
        screw_action: (n,) next action of the screw policy.

    Raises:
        BadOption: another control mode, or a scale of another length.
    """

    def __init__(self, env: gym.Env, demonstration: Demonstration, scale: Sequence[float] | None = None):
        gym.utils.RecordConstructorArgs.__init__(self, demonstration=demonstration, scale=scale)
        gym.Wrapper.__init__(self, env)
        inner: Any = env.unwrapped
        self._screw, space = ScrewPolicy(inner.task, demonstration), env.observation_space
        if not isinstance(space, spaces.Dict):
            raise BadOption("observation_space", f"is a {type(space).__name__}, not a Dict")
        self.scale = tuple(default_scale(inner.task) if scale is None else map(float, scale))
        if (len(self.scale),) != env.action_space.shape:
            raise BadOption("scale", f"has {len(self.scale)} entries; the action has shape {env.action_space.shape}")
        self.observation_space = spaces.Dict({**space.spaces, SCREW_ACTION: env.action_space})
        self._memory: Episode | None = None
        self.screw_action = np.zeros(len(self.scale))

    def reset(self, **kwargs: Any) -> tuple[Any, dict[str, Any]]:
        """Start an episode of the environment and of the screw policy."""
        observation, info = self.env.reset(**kwargs)
        self._memory = self._screw.begin(observation)
        return self._seen(observation), info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Take the screw policy's action, corrected by `action`."""
        taken = corrected(self.screw_action, np.clip(action, -1.0, 1.0), np.array(self.scale))
        assert self._memory is not None
        notify(self._memory, self._screw.task, self.screw_action, taken)
        observation, reward, terminated, truncated, info = self.env.step(taken)
        return self._seen(observation), reward, terminated, truncated, info

    def _seen(self, observation: Observation) -> dict[str, np.ndarray]:
        assert self._memory is not None
        self.screw_action = self._screw.act(observation, self._memory)
        return {**observation, SCREW_ACTION: self.screw_action.copy()}


class ResidualPolicy(EpisodePolicy):
    """Screw policy, corrected by an actor that was trained in `AroundScrew`.

    Args:
        task: see `make_policy`.
        demonstration: see `make_policy`.
        actor: the actor.
        source: file of the actor, for messages.

    Raises:
        BadActor: the actor has no residual scale.
        BadOption: the task's actions are not joint velocities.
    """

    def __init__(self, task: TaskDescription, demonstration: Demonstration, actor: Actor, source: Path):
        self.screw = ScrewPolicy(task, demonstration)
        if not actor.residual_scale:
            raise BadActor(source, "residual_scale", "is empty; a residual actor says how much of it is added")
        self.actor, self._source, self._scale = actor, source, np.array(actor.residual_scale)

    @classmethod
    def by(cls, task: TaskDescription, demonstration: Demonstration, actor: Actor) -> ResidualPolicy:
        """Return the policy of an actor in memory.

        Args:
            task: see `make_policy`.
            demonstration: see `make_policy`.
            actor: the actor.
        """
        return cls(task, demonstration, actor, HERE)

    @classmethod
    def found(cls, task: TaskDescription, demonstration: Demonstration, settings: LearnedSettings) -> ResidualPolicy:
        """Return the policy of the actor that the settings name; see `found_actor`.

        Args:
            task: see `make_policy`.
            demonstration: see `make_policy`.
            settings: choice of the actor.
        """
        return cls(task, demonstration, *found_actor(METHOD, task, settings))

    def begin(self, observation: Observation) -> Episode:
        """See `EpisodePolicy`; the memory is the screw policy's."""
        check_seen(self.actor, {**observation, SCREW_ACTION: self._scale}, self._source)
        return self.screw.begin(observation)

    def act(self, observation: Observation, memory: Episode) -> np.ndarray:
        """See `EpisodePolicy`; returns the screw policy's action, corrected."""
        action = self.screw.act(observation, memory)
        taken = corrected(action, self.actor({**observation, SCREW_ACTION: action}), self._scale)
        notify(memory, self.screw.task, action, taken)
        return taken

    def hold(self, observation: Observation, state: tuple[Episode, ...]) -> np.ndarray | None:
        """See `ProgramPolicy`.

        Args:
            observation: one observation, of this tick.
            state: state returned by `predict`.
        """
        return self.screw.hold(observation, state)

    def report(self, state: tuple[Episode, ...], index: int = 0) -> PolicyReport:
        """See `ProgramPolicy`."""
        return self.screw.report(state, index)
