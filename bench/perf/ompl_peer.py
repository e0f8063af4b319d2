"""OMPL's RRT-Connect as it comes, on the same arm with the same distance queries, for `onedemo perf`.

Edges are looked at in the steps that OMPL takes by itself; the policy `rrt` has them proven clear.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...baselines.extras import needed
from ...baselines.motion.rrt_connect import informed, joint_space, state_of
from ...planner.robot.arm import Arm

BUDGET = 2.0
"""Seconds that it may search."""


def ompl_solver(arm: Arm, g: np.ndarray, start: np.ndarray, goal: np.ndarray) -> Callable[[], object]:
    """RRT-Connect from start to goal joints (dof,) among the obstacles of a work array.

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
