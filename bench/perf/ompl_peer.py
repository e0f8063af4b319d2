"""OMPL's RRT-Connect with default settings, on the same arm and distance queries, for `onedemo perf`.

Edges are checked at OMPL's default resolution; the policy `rrt` has them proven clear.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...baselines.extras import needed
from ...baselines.motion.rrt_connect import informed, joint_space, state_of
from ...planner import Arm

BUDGET = 2.0
"""Time limit [s] of a search."""


def ompl_solver(arm: Arm, g: np.ndarray, start: np.ndarray, goal: np.ndarray) -> Callable[[], object]:
    """Return a call that plans once with RRT-Connect.

    Args:
        arm: the arm.
        g: work array of the robot and its obstacles; see `robot_arrays`.
        start: (dof,) joints [rad].
        goal: (dof,) joints [rad].

    Raises:
        MissingExtra: OMPL is not installed.
    """
    ob, og = (needed(f"ompl.{part}", "ompl") for part in ("base", "geometric"))
    space = joint_space(arm.lower, arm.upper)
    information = informed(space, g)
    information.setup()

    def solve() -> object:
        problem: Any = ob.ProblemDefinition(information)
        problem.setStartAndGoalStates(state_of(space, start), state_of(space, goal))
        planner: Any = og.RRTConnect(information)
        planner.setProblemDefinition(problem)
        planner.setup()
        return planner.solve(BUDGET)

    return solve
