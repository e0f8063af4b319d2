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
from ...planner.collision.clearance import slack_at

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
    space = joint_space(arm.lower, arm.upper)
    information = informed(space, g)
    information.setup()
    return lambda: _solved(information, space, start, goal, BUDGET)


def ompl_path(arm: Arm, g: np.ndarray, start: np.ndarray, goal: np.ndarray, seconds: float) -> np.ndarray | None:
    """Plan once with RRT-Connect, in the range of the joints' limits.

    Args:
        arm: the arm.
        g: work array of the robot and its obstacles; see `robot_arrays`.
        start: (dof,) joints [rad].
        goal: (dof,) joints [rad].
        seconds: time limit [s].

    Returns:
        Points (k, dof) of the path as it was found [rad]; None if none was found.

    Raises:
        MissingExtra: OMPL is not installed.
    """
    if any(slack_at(g, q, 0.0, 0.1) < 0.0 or arm.margin(q) < 0.0 for q in (start, goal)):
        return None  # OMPL would wait for a goal until the time is over
    space = joint_space(arm.lower, arm.upper)
    information = informed(space, g)
    information.setup()
    problem = _solved(information, space, start, goal, seconds)
    if not problem.hasExactSolution():
        return None
    return np.array([[state[k] for k in range(arm.dof)] for state in problem.getSolutionPath().getStates()])


def _solved(information: Any, space: Any, start: np.ndarray, goal: np.ndarray, seconds: float) -> Any:
    """Return OMPL's problem after a search."""
    ob, og = (needed(f"ompl.{part}", "ompl") for part in ("base", "geometric"))
    problem: Any = ob.ProblemDefinition(information)
    problem.setStartAndGoalStates(state_of(space, start), state_of(space, goal))
    planner: Any = og.RRTConnect(information)
    planner.setProblemDefinition(problem)
    planner.setup()
    planner.solve(seconds)
    return problem
