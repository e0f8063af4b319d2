"""Interface of policies: Stable-Baselines3's prediction signature, and the report of an episode."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ..planner import PosePath

Observation = Mapping[str, np.ndarray]
"""Entries of an observation by name."""


@dataclass(frozen=True, slots=True)
class LabeledPath:
    """Path that a policy used, for drawing.

    Attributes:
        label: "demonstrated", "imitated", "final", or "escape": the detour around obstacles that were not demonstrated.
        motion: name of the motion it belongs to; "" if unknown.
        poses: poses of the tcp in the world.
    """

    label: str
    motion: str
    poses: PosePath


@dataclass(frozen=True, slots=True)
class PolicyReport:
    """Report of a policy on an episode; it never contains success, which the simulator judges.

    Attributes:
        done: the policy has nothing more to do.
        failure_reason: "", or the reason why it failed, one of `onedemo.envs.core.description.FAILURES`.
        detail: one line for the reader.
        paths: paths used so far.
    """

    done: bool = False
    failure_reason: str = ""
    detail: str = ""
    paths: tuple[LabeledPath, ...] = ()


class Policy(Protocol):
    """Any object with Stable-Baselines3's `predict`.

    Two more methods are optional. `report(state)` returns a `PolicyReport`. `hold(observation, state)` is called with a
    real clock, for each control step that begins before `predict` has answered, with the observation of that step and
    the state of that answer, whose action is taken afterwards. It returns the action of the step; None, or no such
    method, stands for a plain hold: zero speed, grippers unchanged.
    """

    def predict(
        self,
        observation: Observation,
        state: Any = None,
        episode_start: np.ndarray | None = None,
        deterministic: bool = True,
    ) -> tuple[np.ndarray, Any]:
        """Return actions for one observation, or for a batch with a leading axis, and the next state.

        Args:
            observation: one observation, or a batch of them.
            state: state returned by the previous call; None at the start.
            episode_start: (n_envs,) True where a new episode has started, or None.
            deterministic: as in Stable-Baselines3.
        """
        ...


class EpisodePolicy(ABC):
    """Policy with a memory per episode; this class handles batches.

    The state is a tuple with one memory per environment. Each call changes the memories in place, so that a state is
    valid for one further call only.
    """

    @abstractmethod
    def begin(self, observation: Observation) -> Any:
        """Return the memory of a new episode that starts with this observation."""

    @abstractmethod
    def act(self, observation: Observation, memory: Any) -> np.ndarray:
        """Return the action for one observation.

        Args:
            observation: one observation, not a batch.
            memory: memory of the episode, changed in place.
        """

    def is_batch(self, observation: Observation) -> bool:
        """Return whether every entry has a leading batch axis."""
        # joint_positions is (arms, dof) in one observation
        return np.ndim(observation["joint_positions"]) == 3

    def predict(
        self,
        observation: Observation,
        state: tuple[Any, ...] | None = None,
        episode_start: np.ndarray | None = None,
        deterministic: bool = True,
    ) -> tuple[np.ndarray, tuple[Any, ...]]:
        """Return actions and the next state, like Stable-Baselines3's models.

        Args:
            observation: one observation, or a batch of them with a leading axis in every entry.
            state: state returned by the previous call; None at the start.
            episode_start: (n_envs,) True where a new episode has started; None: only where state is None.
            deterministic: ignored, the policy is deterministic.
        """
        batched = self.is_batch(observation)
        rows = _rows(observation) if batched else [observation]
        started = np.zeros(len(rows), dtype=bool) if episode_start is None else np.atleast_1d(episode_start)
        memories: list[Any] = [None] * len(rows) if state is None else list(state)
        actions = []
        for i, row in enumerate(rows):
            if memories[i] is None or started[i]:
                memories[i] = self.begin(row)
            actions.append(self.act(row, memories[i]))
        return (np.stack(actions) if batched else actions[0]), tuple(memories)


def _rows(observation: Observation) -> list[dict[str, np.ndarray]]:
    count = len(next(iter(observation.values())))
    return [{key: value[i] for key, value in observation.items()} for i in range(count)]
