"""OMPL's RRT-Connect on the same arm with the same distance queries, for `onedemo perf`."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

from ..planner.arm import Arm
from ..planner.clearance import room_at

BUDGET = 2.0
"""Seconds that it may search."""


def ompl_solver(arm: Arm, g: np.ndarray, start: np.ndarray, goal: np.ndarray) -> Callable[[], object]:
    """RRT-Connect from start to goal joints (dof,) among the obstacles of a work array.

    Raises:
        ImportError: OMPL is not installed.
    """
    ob: Any = import_module("ompl.base")
    og: Any = import_module("ompl.geometric")
    space = ob.RealVectorStateSpace(arm.dof)
    bounds = ob.RealVectorBounds(arm.dof)
    for k in range(arm.dof):
        bounds.setLow(k, float(arm.lower[k]))
        bounds.setHigh(k, float(arm.upper[k]))
    space.setBounds(bounds)
    q = np.empty(arm.dof)

    def is_valid(state: Any) -> bool:
        for k in range(arm.dof):
            q[k] = state[k]
        return room_at(g, q, 0.0, 0.1) >= 0.0

    information = ob.SpaceInformation(space)
    information.setStateValidityChecker(is_valid)
    information.setup()

    def solve() -> object:
        problem = ob.ProblemDefinition(information)
        first, last = space.allocState(), space.allocState()
        for k in range(arm.dof):
            first[k], last[k] = float(start[k]), float(goal[k])
        problem.setStartAndGoalStates(first, last)
        planner = og.RRTConnect(information)
        planner.setProblemDefinition(problem)
        planner.setup()
        return planner.solve(BUDGET)

    return solve
