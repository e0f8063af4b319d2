"""Progress common to all tasks: settling, unwanted contacts and the common entries of `info`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, Protocol

from ..simulation.state import State

SETTLED_SECONDS = 0.5
"""Time [s] for which the goal must hold without interruption to count as success."""


class Contacts(Protocol):
    """Unwanted contacts in the verdict on a state.

    Attributes:
        unwanted: number of pairs in unwanted contact.
        low: smaller owner of the last such pair, or -1.
        high: larger owner of the last such pair, or -1.
    """

    @property
    def unwanted(self) -> int: ...  # noqa: D102

    @property
    def low(self) -> int: ...  # noqa: D102

    @property
    def high(self) -> int: ...  # noqa: D102


class Progress(ABC):
    """Progress of an episode, updated from the simulator's state at each step.

    Args:
        dt: time between states [s].

    Attributes:
        collisions: number of unwanted contacts so far, counted in every step.
        collision: name of the most recent unwanted contact.
    """

    def __init__(self, dt: float):
        self._needed, self._settled_steps = round(SETTLED_SECONDS / dt), 0
        self.collisions = 0
        self.collision = ""

    @property
    def success(self) -> bool:
        """True once the goal has held for `SETTLED_SECONDS`."""
        return self._settled_steps >= self._needed

    @property
    @abstractmethod
    def failed(self) -> bool:
        """True if the task can no longer succeed."""

    @property
    @abstractmethod
    def motion_index(self) -> float:
        """Index of the current motion; see the observation of the task."""

    @property
    @abstractmethod
    def stage(self) -> str:
        """Furthest progress in words."""

    @property
    @abstractmethod
    def failure(self) -> str:
        """Reason why the task cannot succeed at present, "" if it can."""

    @abstractmethod
    def update(self, state: State) -> Contacts:
        """Judge a new state, update the progress and return the verdict."""

    @abstractmethod
    def reward(self, state: State) -> float:
        """Return the dense reward in [0, 1] of the last state given to `update`."""

    @abstractmethod
    def task_info(self) -> dict[str, Any]:
        """Return the task-specific entries of `info`."""

    def info(self) -> dict[str, Any]:
        """Return the entries of `info`."""
        success = self.success
        return {
            "is_success": success,
            "success": success,
            "safe": self.collisions == 0,
            "stage": self.stage,
            "failure_reason": self.failure,
            "collision": self.collision,
            **self.task_info(),
        }

    def _settle(self, settled: bool, verdict: Contacts) -> None:
        """Count consecutive settled steps and unwanted contacts."""
        self._settled_steps = self._settled_steps + 1 if settled else 0
        self.collisions += verdict.unwanted
