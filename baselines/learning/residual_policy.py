"""Learning on top of the method: the screw policy acts, an actor corrects it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from ...envs.core.description import TaskDescription
from ...planner.errors import BadActor, BadOption
from ...planner.imitation.demonstration import Demonstration
from ..policy import EpisodePolicy, Observation, PolicyReport
from ..program_policy import Episode
from ..screw_policy import ScrewPolicy
from .actor import Actor
from .actor_card import METHOD
from .learned_policy import HERE, LearnedSettings, check_seen, found_actor

SCREW_ACTION = "screw_action"
"""Entry of the observation: what the screw policy would do."""
SHARE = 0.1
"""How fast a correction can be, of the fastest joint of the method at that time, unless it is said."""


def corrected(action: np.ndarray, correction: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """The action that is taken (n,), in [-1, 1]: another policy's and, entry by entry scaled, the learner's.

    Corrections are as fast as the other policy is: where it comes to rest they end. With corrections of 0.05 of a full
    action at any time, random ones, as exploration is, left 3 of 6 successes of PlaceOne, and without successes nothing
    is learned of them; with 0.2 of the policy's own speed, 6 of 6.
    """
    speed = float(np.abs(action[scale > 0.0]).max(initial=0.0))
    return np.clip(action + speed * scale * correction, -1.0, 1.0)


def notify(memory: Episode, task: TaskDescription, action: np.ndarray, taken: np.ndarray) -> None:
    """Let the screw policy know what was taken instead of its action: it goes on from the joints that were commanded.

    Otherwise corrections would add up to a way off that nothing leads back from.
    """
    limits = np.stack([arm.velocity_limits for arm in task.arms])
    extra = (taken - action).reshape(len(limits), -1)[:, :-1]
    memory.executor.q += task.control_dt * (extra * limits).reshape(memory.executor.q.shape)


def default_scale(task: TaskDescription, share: float = SHARE) -> tuple[float, ...]:
    """The same for every joint, nothing for the grippers: 0 leaves a gripper, the least below 0 drops what it holds."""
    return tuple([*[share] * task.arms[0].dof, 0.0] * len(task.arms))


class AroundScrew(gym.Wrapper, gym.utils.RecordConstructorArgs):
    """An environment in which the screw policy acts and a learner's actions correct it.

    The observation has one entry more, `screw_action`: the action that the correction is added to. Once the screw
    policy has ended or given up it stands still.

    Args:
        env: of ours, in the control mode `joint_velocity`.
        demonstration: the ONE demonstration.
        scale: per entry of the action, how fast a correction can be, of the fastest joint that is corrected; None:
            `default_scale`.

    Attributes:
        scale: see the arguments.
        screw_action: what the screw policy would do now.

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
        """Start an episode, of the screw policy too."""
        observation, info = self.env.reset(**kwargs)
        self._memory = self._screw.begin(observation)
        return self._seen(observation), info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Act as the screw policy would, corrected."""
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
    """The screw policy, corrected by an actor that was trained in `AroundScrew`.

    Args:
        task: see `make_policy`.
        demonstration: see `make_policy`.
        actor: it.
        source: its file, for messages.

    Raises:
        BadActor: the actor does not say how much of it is added.
        BadOption: the task's actions are not joint velocities.
    """

    def __init__(self, task: TaskDescription, demonstration: Demonstration, actor: Actor, source: Path):
        self.screw = ScrewPolicy(task, demonstration)
        if not actor.residual_scale:
            raise BadActor(source, "residual_scale", "is empty; a residual actor says how much of it is added")
        self.actor, self._source, self._scale = actor, source, np.array(actor.residual_scale)

    @classmethod
    def by(cls, task: TaskDescription, demonstration: Demonstration, actor: Actor) -> ResidualPolicy:
        """The policy of an actor that is at hand."""
        return cls(task, demonstration, actor, HERE)

    @classmethod
    def found(cls, task: TaskDescription, demonstration: Demonstration, settings: LearnedSettings) -> ResidualPolicy:
        """The policy of the actor that settings mean; see `found_actor`."""
        return cls(task, demonstration, *found_actor(METHOD, task, settings))

    def begin(self, observation: Observation) -> Episode:
        """The screw policy's memory."""
        check_seen(self.actor, {**observation, SCREW_ACTION: self._scale}, self._source)
        return self.screw.begin(observation)

    def act(self, observation: Observation, memory: Episode) -> np.ndarray:
        """The screw policy's action, corrected."""
        action = self.screw.act(observation, memory)
        taken = corrected(action, self.actor({**observation, SCREW_ACTION: action}), self._scale)
        notify(memory, self.screw.task, action, taken)
        return taken

    def report(self, state: tuple[Episode, ...], index: int = 0) -> PolicyReport:
        """The screw policy's."""
        return self.screw.report(state, index)
