"""Rules of reaching: distance of the hand from its goal, wanted contacts, dense reward."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...planner import Pose
from ...planner.geometry import screw
from ..judge.dense_reward import closeness
from ..judge.goal_progress import contacts
from ..judge.judge import unwanted_contacts
from ..judge.progress import Progress
from ..scene.scene import FIRST_OBJECT, WORLD
from ..simulation.state import State

MAX_OFFSET, MAX_ANGLE = 0.010, float(np.deg2rad(10.0))
"""Tolerances of the hand at its goal [m, rad]."""
ALLOWED = contacts(1, [(WORLD, FIRST_OBJECT)])
"""Wanted contacts: only block and table may touch."""


class ReachVerdict(NamedTuple):
    """Unwanted contacts of a state, see `progress.Contacts`."""

    unwanted: int
    low: int
    high: int


class ReachProgress(Progress):
    """Progress of reaching, updated from the simulator's state at each step.

    Args:
        goals: (2, 8) dual quaternions of the hand at its goal, half a turn apart.
        dt: time between states [s].
    """

    def __init__(self, goals: np.ndarray, dt: float):
        super().__init__(dt)
        self._goals = [tuple(float(v) for v in goal) for goal in goals]
        self.distance, self.angle = np.inf, np.inf

    @property
    def failed(self) -> bool:
        """False: the task can always succeed."""
        return False

    @property
    def motion_index(self) -> float:
        """Index of the current motion: 1 while the hand is at its goal, else 0."""
        return float(self._there)

    @property
    def stage(self) -> str:
        """Furthest progress in words."""
        return "at the place" if self.success else "start"

    @property
    def failure(self) -> str:
        """Empty string: the task can always succeed."""
        return ""

    @property
    def _there(self) -> bool:
        return self.distance <= MAX_OFFSET and self.angle <= MAX_ANGLE

    def update(self, state: State) -> ReachVerdict:
        """See `Progress`."""
        here = tuple(float(v) for v in Pose.from_vector(state.tcp_pose[0]).dq)
        self.distance, self.angle = min(
            (screw.pose_distance(here, goal) for goal in self._goals), key=lambda gap: gap[1]
        )
        verdict = ReachVerdict(*unwanted_contacts(state.touching, ALLOWED, -1))
        self._settle(self._there, verdict)
        return verdict

    def reward(self, state: State) -> float:
        """See `Progress`."""
        return 1.0 if self.success else float(closeness(self.distance, self.angle))

    def task_info(self) -> dict[str, Any]:
        """See `Progress`."""
        return {"position_error": self.distance, "angle_error": self.angle}
