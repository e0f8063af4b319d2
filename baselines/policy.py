"""What a policy is: Stable-Baselines3's prediction shape, and what it may tell about itself afterwards."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ..planner.geometry.pose import PosePath

Observation = Mapping[str, np.ndarray]


@dataclass(frozen=True, slots=True)
class LabeledPath:
    """A path that a policy used, for drawing.

    Attributes:
        label: "demonstrated", "imitated", "final", or "escape": the way that was taken round what nobody showed.
        motion: name of the motion it belongs to; "" where that is not known.
        poses: the tcp in the world.
    """

    label: str
    motion: str
    poses: PosePath


@dataclass(frozen=True, slots=True)
class PolicyReport:
    """What a policy says of an episode; success is never among it, the simulator judges that.

    Attributes:
        done: the policy has nothing more to do.
        failure_reason: "" or one of `onedemo.envs.core.description.FAILURES`: why it gave up.
        detail: one line for the reader.
        paths: the paths it used so far.
    """

    done: bool = False
    failure_reason: str = ""
    detail: str = ""
    paths: tuple[LabeledPath, ...] = ()


class Policy(Protocol):
    """Anything with Stable-Baselines3's `predict`; `report(state)` is optional."""

    def predict(
        self,
        observation: Observation,
        state: Any = None,
        episode_start: np.ndarray | None = None,
        deterministic: bool = True,
    ) -> tuple[np.ndarray, Any]:
        """Actions for one observation, or for a batch with a leading axis; and the next state."""
        ...


class EpisodePolicy(ABC):
    """A policy that keeps a memory per episode; this class does the batching.

    The state is a tuple with one memory per environment. A memory is changed by each call: a state is good
    for one further call only.
    """

    @abstractmethod
    def begin(self, observation: Observation) -> Any:
        """The memory of a new episode that starts with this observation."""

    @abstractmethod
    def act(self, observation: Observation, memory: Any) -> np.ndarray:
        """The action for one observation."""

    def is_batch(self, observation: Observation) -> bool:
        """True if there is a leading axis in every entry."""
        # joint_positions is (arms, dof) in one observation
        return np.ndim(observation["joint_positions"]) == 3

    def predict(
        self,
        observation: Observation,
        state: tuple[Any, ...] | None = None,
        episode_start: np.ndarray | None = None,
        deterministic: bool = True,
    ) -> tuple[np.ndarray, tuple[Any, ...]]:
        """Actions and the next state, as Stable-Baselines3's models give them.

        Args:
            observation: one observation, or a batch of them with a leading axis in every entry.
            state: what the previous call returned; None at the start.
            episode_start: (n_envs,) True where a new episode has begun; None: only where state is None.
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
