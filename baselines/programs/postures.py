"""A quick look at whether an arm has a posture at a goal at all."""

from __future__ import annotations

import numpy as np

from ...planner import Arm, Pose
from ...planner.control.inverse_kinematics import inverse_kinematics

SEEDS = 12
"""Random postures from which one at a goal is sought."""
ROUNDED = 4
"""Decimals of poses [m] that are one: turns of a round thing in a round hand's grasp coincide."""


class Postures:
    """Postures at goals, remembered.

    Args:
        arm: the arm.
        q: (dof,) joints from which one is sought first [rad].
    """

    def __init__(self, arm: Arm, q: np.ndarray):
        rng = np.random.default_rng(0)
        self._arm, self._seeds = arm, [q.copy(), *rng.uniform(arm.lower, arm.upper, (SEEDS, arm.dof))]
        self._known: dict[tuple[float, ...], bool] = {}

    def reach(self, goal: Pose) -> bool:
        """Return whether inverse kinematics finds a posture at a pose of the tcp; it may miss one."""
        key = tuple(float(value) for value in np.round(goal.vector, ROUNDED))
        if key not in self._known:
            found = (inverse_kinematics(self._arm, goal, seed) for seed in self._seeds)
            self._known[key] = any(joints is not None for joints in found)
        return self._known[key]
