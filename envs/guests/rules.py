"""Progress of a robosuite task: success is robosuite's, what is safe and how far it has come are ours."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..judge.progress import Progress
from ..scene.scene import ARM, FINGERS, FIRST_OBJECT, FURNITURE, OBSTACLE, WORLD
from ..simulation.state import State
from .guest_scene import HAND
from .judge import Sight

LIFTED = 0.02
"""Height above its start from which a held object counts as lifted [m]."""
FALLEN = 0.3
"""Depth below the table top at which an object has fallen off [m]; bins are less deep."""


class GuestVerdict(NamedTuple):
    """Unwanted contacts of a state, see `Contacts`."""

    unwanted: int
    low: int
    high: int


class GuestProgress(Progress):
    """Progress in a robosuite task.

    Args:
        names: names of the objects.
        start: (n, 7) poses of the objects at the start.
        table_height: z of the table top [m].
        dt: time between states [s].

    Attributes:
        sight: state as robosuite sees it, set before each `update`.
    """

    sight: Sight

    def __init__(self, names: tuple[str, ...], start: np.ndarray, table_height: float, dt: float):
        super().__init__(dt)
        self._names, self._heights = names, start[:, 2].copy()
        self._lowest = np.where(self._heights > table_height - FALLEN, table_height - FALLEN, -np.inf)
        self._stage, self._failure, self._held = "start", "", False

    @property
    def motion_index(self) -> float:
        """1 while the fingers touch an object, else 0."""
        return float(self._held)

    @property
    def failed(self) -> bool:
        """True once an object has fallen off the table."""
        return bool(self._failure)

    @property
    def stage(self) -> str:
        """Furthest progress in words."""
        return "success" if self.success else self._stage

    @property
    def failure(self) -> str:
        """Reason why the task cannot succeed any more, "" if it can."""
        return self._failure

    def update(self, state: State) -> GuestVerdict:
        """See `Progress`."""
        held = state.touching[FINGERS, FIRST_OBJECT:] != 0.0
        heights = state.object_pose[:, 2]
        self._held = bool(held.any())
        for k in np.flatnonzero(held & (heights > self._heights + LIFTED)):
            self._stage = f"lifted {self._names[k]}"
        if (heights < self._lowest).any():
            self._failure = "off_table"
        pairs = unwanted_contacts(state.touching)
        low, high = pairs[-1] if pairs else (-1, -1)
        verdict = GuestVerdict(len(pairs), low, high)
        self._settle(self.sight.success, verdict)
        return verdict

    def reward(self, state: State) -> float:
        """See `Progress`: robosuite's shaped reward."""
        return self.sight.shaped

    def task_info(self) -> dict[str, Any]:
        """See `Progress`."""
        return {"robosuite_success": self.sight.success}


def unwanted_contacts(touching: np.ndarray) -> list[tuple[int, int]]:
    """Return the pairs of owners, the smaller first, that touch and should not.

    These are obstacles with the robot or an object, and links of the robot, other than its hand, with table or
    fixtures. Objects that touch an obstacle do so in the hand, or were pushed.

    Args:
        touching: (owners, owners) contacts, see `State`.
    """
    robot = (ARM, FINGERS, HAND)
    pairs = [(part, OBSTACLE) for part in robot] + [(WORLD, ARM), (ARM, FURNITURE)]
    pairs += [(OBSTACLE, each) for each in range(FIRST_OBJECT, len(touching))]
    return [pair for pair in pairs if touching[pair] != 0.0]
