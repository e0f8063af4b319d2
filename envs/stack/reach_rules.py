"""The rules of reaching: how near the hand is to its place, wanted contacts, dense reward."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...planner.geometry import screw
from ...planner.geometry.pose import Pose
from ...planner.jit import kernel
from ..core.dense_reward import closeness
from ..core.progress import Progress
from ..scene.scene import ARM, FINGERS, FIRST_OBJECT, OTHER_ARM, OTHER_FINGERS, WORLD
from ..simulation.state import State

MAX_OFFSET, MAX_ANGLE = 0.010, float(np.deg2rad(10.0))
"""The hand is at its place within these [m, rad]."""


class ReachVerdict(NamedTuple):
    """See `progress.Contacts`."""

    unwanted: int
    low: int
    high: int


@kernel
def unwanted_contacts(touching):
    """How many pairs of owners touch that should not, and the last of them: only the block on the table may."""
    count, low, high = 0, -1, -1
    for a in range(len(touching)):
        for b in range(a, len(touching)):
            own = a == b or (a == ARM and b == FINGERS) or (a == OTHER_ARM and b == OTHER_FINGERS)
            if touching[a, b] != 0.0 and not own and not (a == WORLD and b >= FIRST_OBJECT):
                count, low, high = count + 1, a, b
    return count, low, high


class ReachProgress(Progress):
    """What has happened in an episode so far.

    Args:
        goals: (2, 8) dual quaternions of the hand at its place: it looks the same after half a turn.
        dt: seconds between states.
    """

    def __init__(self, goals: np.ndarray, dt: float):
        super().__init__(dt)
        self._goals = [tuple(float(v) for v in goal) for goal in goals]
        self.distance, self.angle = np.inf, np.inf

    @property
    def failed(self) -> bool:
        """Never."""
        return False

    @property
    def motion_index(self) -> float:
        """1 while the hand is at its place."""
        return float(self._there)

    @property
    def stage(self) -> str:
        """The furthest progress in words."""
        return "at the place" if self.success else "start"

    @property
    def failure(self) -> str:
        """Nothing that is done makes it impossible."""
        return ""

    @property
    def _there(self) -> bool:
        return self.distance <= MAX_OFFSET and self.angle <= MAX_ANGLE

    def update(self, state: State) -> ReachVerdict:
        """Take in a new state."""
        here = tuple(float(v) for v in Pose.from_vector(state.tcp_pose[0]).dq)
        self.distance, self.angle = min(
            (screw.pose_distance(here, goal) for goal in self._goals), key=lambda gap: gap[1]
        )
        verdict = ReachVerdict(*unwanted_contacts(state.touching))
        self._settle(self._there, verdict)
        return verdict

    def reward(self, state: State) -> float:
        """The dense reward of the state taken in last."""
        return 1.0 if self.success else float(closeness(self.distance, self.angle))

    def task_info(self) -> dict[str, Any]:
        """The task's own entries of `info`."""
        return {"position_error": self.distance, "angle_error": self.angle}
