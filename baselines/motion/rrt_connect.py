"""RRT-Connect (Kuffner and LaValle 2000) by OMPL in the joints of one arm or two, with certified edges.

The demonstration is ignored: the path leads to a posture found by the inverse kinematics of the goal. OMPL draws the
samples and grows the trees; edges are checked by the planner's own certificate, so thin obstacles are not missed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ...planner.collision.clearance import slack_at
from ...planner.ranges import check_ranges
from ...planner.search.joint_space_rrt import joint_edge_is_clear, sample_ranges, shortcut
from ..extras import needed


@dataclass(frozen=True, slots=True)
class RrtSettings:
    """Settings of a search.

    Attributes:
        budget: number of edge checks before the search fails: about one second's worth. A count instead of a time limit
            keeps runs reproducible.
        step: longest edge [rad].
        goals: largest number of goal postures.
        seeds: starts of the inverse kinematics; doubled up to three times while no start leads to a clear posture.
        approach: length [m] of the straight end of a path to a contact: along the fingers to a grasp, from above to a
            placement; 0: none.
        shortcuts: attempts to remove points of the path found.
        speed: fraction of the largest joint speed.
        margin: distance [rad] of postures from the joint limits.
    """

    budget: int = 30_000
    step: float = 0.5
    goals: int = 8
    seeds: int = 24
    approach: float = 0.08
    shortcuts: int = 100
    speed: float = 0.4
    margin: float = 0.05

    def __post_init__(self):
        check_ranges(self, "[1, 10000000]", "budget", "goals", "seeds")
        check_ranges(self, "(0, 10]", "step", "speed")
        check_ranges(self, "[0, 1000]", "approach", "shortcuts", "margin")


def joint_path(
    g: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    start: np.ndarray,
    goals: Sequence[np.ndarray],
    settings: RrtSettings,
    seed: int = 0,
) -> np.ndarray | None:
    """Search a clear path in joint space to the first goal that is reached.

    Args:
        g: the robot among obstacles, see `planner.collision.robot_arrays`.
        low: (n,) lower joint limits [rad].
        high: (n,) upper joint limits [rad].
        start: (n,) joints [rad].
        goals: (n,) joints each [rad]; those that are not clear, or beyond a limit, are left out.
        settings: see `RrtSettings`.
        seed: seed of OMPL's random numbers.

    Returns:
        Points (k, n) of the path [rad]; None if no path was found.

    Raises:
        MissingExtra: OMPL is not installed.
    """
    fit = [goal for goal in goals if _is_fit(g, low, high, goal)]
    if not fit or not _is_fit(g, low, high, start):
        return None  # OMPL would wait for a goal without end
    for goal in fit:
        if joint_edge_is_clear(g, start, goal):
            return np.array([start, goal])
    search = _Search(g, *_bounds(low, high, start, fit), settings)
    points = search.solved(start, fit, seed)
    if points is None:
        return None
    out = np.empty((len(points) + settings.shortcuts + 1, len(start)))  # a line may add a point
    out[: len(points)] = points
    state, ends = np.array([float(seed % 2147483646) + 1.0]), np.empty((2, len(start)))
    return out[: shortcut(g, out, len(points), settings.shortcuts, state, ends)].copy()


def _is_fit(g: np.ndarray, low: np.ndarray, high: np.ndarray, q: np.ndarray) -> bool:
    return bool((q >= low).all() and (q <= high).all()) and slack_at(g, q, 0.0, 0.1) >= 0.0


def _bounds(
    low: np.ndarray, high: np.ndarray, start: np.ndarray, goals: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the bounds (n,) of the search, which both its ends lie within."""
    low, high = sample_ranges(low, high, start)
    ends = np.array([start, *goals])
    return np.minimum(low, ends.min(axis=0)), np.maximum(high, ends.max(axis=0))


def timed(points: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Return joints (t, n) at every tick along a path.

    Args:
        points: (k, n) points of the path [rad].
        step: (n,) largest change of each joint per tick [rad].
    """
    rows = [points[:1]]
    for start, end in pairwise(points):
        count = max(1, int(np.ceil((np.abs(end - start) / step).max())))
        rows.append(start + np.arange(1, count + 1)[:, None] / count * (end - start))
    return np.vstack(rows)


def joint_space(low: np.ndarray, high: np.ndarray) -> Any:
    """Return OMPL's space of joints between limits, and silence OMPL.

    Args:
        low: (n,) lower joint limits [rad].
        high: (n,) upper joint limits [rad].
    """
    ob: Any = needed("ompl.base", "ompl")
    util: Any = needed("ompl.util", "ompl")
    util.setLogLevel(util.LogLevel.LOG_NONE)
    bounds, space = ob.RealVectorBounds(len(low)), ob.RealVectorStateSpace(len(low))
    for k in range(len(low)):
        bounds.setLow(k, float(low[k]))
        bounds.setHigh(k, float(high[k]))
    space.setBounds(bounds)
    return space


def informed(space: Any, g: np.ndarray) -> Any:
    """Return OMPL's information on a space, with the planner's own clearance check; its setup is left to the caller.

    Args:
        space: space as returned by `joint_space`.
        g: the robot among obstacles, see `planner.collision.robot_arrays`.
    """
    ob: Any = needed("ompl.base", "ompl")
    information, dof = ob.SpaceInformation(space), space.getDimension()
    information.setStateValidityChecker(lambda state: slack_at(g, _joints(state, dof), 0.0, 0.1) >= 0.0)
    return information


def state_of(space: Any, q: np.ndarray) -> Any:
    """Return joints as a state of OMPL's.

    Args:
        space: space as returned by `joint_space`.
        q: (n,) joints [rad].
    """
    state = space.allocState()
    for k, value in enumerate(q):
        state[k] = float(value)
    return state


class _Search:
    """OMPL's objects for one robot among obstacles.

    OMPL's callbacks hold no reference to these objects: a reference cycle through OMPL would never be freed.
    """

    def __init__(self, g: np.ndarray, low: np.ndarray, high: np.ndarray, settings: RrtSettings):
        self._ob: Any = needed("ompl.base", "ompl")
        self._og: Any = needed("ompl.geometric", "ompl")
        self._util: Any = needed("ompl.util", "ompl")
        self._settings, self._dof, self._asked = settings, len(low), [0]
        self._space = joint_space(low, high)
        self._information = informed(self._space, g)
        self._information.setMotionValidator(_edges(self._ob, self._information, g, self._dof, self._asked))
        self._information.setup()

    def solved(self, start: np.ndarray, goals: Sequence[np.ndarray], seed: int) -> np.ndarray | None:
        """Return the points (k, n) of a path, or None if the budget is exhausted."""
        # planners created from here on draw from this seed, independent of earlier draws
        self._util.RNG.setSeed(seed % 2_000_000_000 + 1)
        problem, goal = self._ob.ProblemDefinition(self._information), self._ob.GoalStates(self._information)
        problem.addStartState(state_of(self._space, start))
        for each in goals:
            goal.addState(state_of(self._space, each))
        problem.setGoal(goal)
        planner = self._og.RRTConnect(self._information)
        planner.setRange(self._settings.step)
        planner.setProblemDefinition(problem)
        planner.setup()
        asked, budget = self._asked, self._settings.budget
        planner.solve(self._ob.PlannerTerminationCondition(lambda: asked[0] >= budget))
        if not problem.hasExactSolution():
            return None
        return np.array([_joints(state, self._dof) for state in problem.getSolutionPath().getStates()])


def _edges(ob: Any, information: Any, g: np.ndarray, dof: int, asked: list[int]) -> Any:
    """Return OMPL's motion validator, backed by the certificate; the validator counts its calls."""

    class Edges(ob.MotionValidator):
        def checkMotion(self, start, end, last_valid=None):
            """See OMPL's `MotionValidator`."""
            asked[0] += 1
            return bool(joint_edge_is_clear(g, _joints(start, dof), _joints(end, dof)))

    return Edges(information)


def _joints(state: Any, dof: int) -> np.ndarray:
    return np.array([state[k] for k in range(dof)])
