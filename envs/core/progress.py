"""What the progress of every task has in common: settling, unwanted contacts, and the common entries of `info`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, Protocol

from ..simulation.state import State

SETTLED_SECONDS = 0.5
"""For how long a success must last."""


class Contacts(Protocol):
    """What every verdict says of unwanted contacts.

    Attributes:
        unwanted: pairs that touch and should not.
        low: the smaller owner of the last of them, or -1.
        high: the other owner.
    """

    @property
    def unwanted(self) -> int: ...  # noqa: D102

    @property
    def low(self) -> int: ...  # noqa: D102

    @property
    def high(self) -> int: ...  # noqa: D102


class Progress(ABC):
    """What has happened in an episode so far, renewed from the simulator's state at each step.

    Args:
        dt: seconds between states.

    Attributes:
        collisions: unwanted contacts so far, counted in every step.
        collision: name of the last of them.
    """

    def __init__(self, dt: float):
        self._needed, self._settled_steps = round(SETTLED_SECONDS / dt), 0
        self.collisions = 0
        self.collision = ""

    @property
    def success(self) -> bool:
        """What must be has been for long enough."""
        return self._settled_steps >= self._needed

    @property
    @abstractmethod
    def failed(self) -> bool:
        """Nothing that can be done would be a success any more."""

    @property
    @abstractmethod
    def motion_index(self) -> float:
        """See the observation of the task."""

    @property
    @abstractmethod
    def stage(self) -> str:
        """The furthest progress in words."""

    @property
    @abstractmethod
    def failure(self) -> str:
        """Why it cannot succeed as things are, "" if it can."""

    @abstractmethod
    def update(self, state: State) -> Contacts:
        """Take in a new state."""

    @abstractmethod
    def reward(self, state: State) -> float:
        """The dense reward in [0, 1] of the state taken in last."""

    @abstractmethod
    def task_info(self) -> dict[str, Any]:
        """The task's own entries of `info`."""

    def info(self) -> dict[str, Any]:
        """The entries of `info`."""
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
        """Count a step that is as it must be, or begin anew; and its unwanted contacts."""
        self._settled_steps = self._settled_steps + 1 if settled else 0
        self.collisions += verdict.unwanted
