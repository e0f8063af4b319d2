"""RRT-Connect (Kuffner and LaValle 2000) by OMPL in the joints of one arm or two, every edge proven clear.

No demonstration of the way: it goes to wherever the inverse kinematics of the goal leads. OMPL draws the samples and
grows the trees; whether an edge is clear is asked of the planner's own certificate: nothing thin is jumped over.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ...planner.collision.clearance import slack_at
from ...planner.errors import BadOption
from ...planner.planning.joint_space_rrt import joint_edge_is_clear, shortcut
from ..extras import needed


@dataclass(frozen=True, slots=True)
class RrtSettings:
    """A search.

    Attributes:
        budget: edges that may be looked at before it is given up: about what fits into a second. A count, not a
            clock, so that a run can be repeated.
        step: longest edge [rad].
        goals: joint postures of the goal that are aimed at, at most.
        seeds: starts of the inverse kinematics; twice as many, three times over, where none leads to a clear posture.
        approach: length [m] of the straight end of a way to where something must be touched: along the fingers
            to a grasp, from above to a place; 0: none.
        shortcuts: tries to leave out points of what was found.
        speed: of the largest joint speed.
        margin: distance [rad] that postures keep from the joint limits.
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
        for name in ("budget", "goals", "seeds"):
            if not 1 <= getattr(self, name) <= 10**7:
                raise BadOption(name, f"{getattr(self, name)} is not from 1 to ten million")
        for name in ("step", "speed"):
            if not 0.0 < getattr(self, name) <= 10.0:
                raise BadOption(name, f"{getattr(self, name)} is not a positive number up to 10")
        for name in ("approach", "shortcuts", "margin"):
            if not 0 <= getattr(self, name) <= 1000:
                raise BadOption(name, f"{getattr(self, name)} is not from 0 to 1000")


def joint_path(
    g: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    start: np.ndarray,
    goals: Sequence[np.ndarray],
    settings: RrtSettings,
    seed: int = 0,
) -> np.ndarray | None:
    """Points (k, n) of a clear way in joint space to the goal that is met first; None if none was found.

    Args:
        g: the robot among obstacles, see `planner.robot_arrays`.
        low: (n,) joint limits [rad].
        high: same.
        start: (n,) joints.
        goals: (n,) joints each, clear.
        settings: see `RrtSettings`.
        seed: of OMPL's random numbers.

    Raises:
        MissingExtra: OMPL is not installed.
    """
    for goal in goals:
        if joint_edge_is_clear(g, start, goal):
            return np.array([start, goal])
    search = _Search(g, low, high, settings)
    points = search.solved(start, goals, seed)
    if points is None:
        return None
    out = np.empty((len(points) + settings.shortcuts + 1, len(start)))  # a line may add a point
    out[: len(points)] = points
    state, ends = np.array([float(seed % 2147483646) + 1.0]), np.empty((2, len(start)))
    return out[: shortcut(g, out, len(points), settings.shortcuts, state, ends)].copy()


def timed(points: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Joints at every tick along points (k, n), no joint moving more than its step (n,) in a tick."""
    rows = [points[:1]]
    for start, end in pairwise(points):
        count = max(1, int(np.ceil((np.abs(end - start) / step).max())))
        rows.append(start + np.arange(1, count + 1)[:, None] / count * (end - start))
    return np.vstack(rows)


def joint_space(low: np.ndarray, high: np.ndarray) -> Any:
    """OMPL's space of joints between limits (n,); from now on OMPL says nothing."""
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
    """What OMPL knows of a space, with the planner's own answer to which states are clear; yet to be set up."""
    ob: Any = needed("ompl.base", "ompl")
    information, dof = ob.SpaceInformation(space), space.getDimension()
    information.setStateValidityChecker(lambda state: slack_at(g, _joints(state, dof), 0.0, 0.1) >= 0.0)
    return information


def state_of(space: Any, q: np.ndarray) -> Any:
    """Joints (n,) as a state of OMPL's."""
    state = space.allocState()
    for k, value in enumerate(q):
        state[k] = float(value)
    return state


class _Search:
    """OMPL's objects for one robot among obstacles.

    What OMPL calls back knows nothing of these objects: a ring of references through it would never be freed.
    """

    def __init__(self, g: np.ndarray, low: np.ndarray, high: np.ndarray, settings: RrtSettings):
        self._ob: Any = needed("ompl.base", "ompl")
        self._og: Any = needed("ompl.geometric", "ompl")
        self._util: Any = needed("ompl.util", "ompl")
        self._settings, self._dof, self._asked = settings, len(low), [0]
        self._space = joint_space(np.maximum(low, -np.pi), np.minimum(high, np.pi))
        self._information = informed(self._space, g)
        self._information.setMotionValidator(_edges(self._ob, self._information, g, self._dof, self._asked))
        self._information.setup()

    def solved(self, start: np.ndarray, goals: Sequence[np.ndarray], seed: int) -> np.ndarray | None:
        """Points (k, n) of a way, None if the budget ran out."""
        # what is made from here on draws from this seed, whatever was drawn before
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
    """OMPL's question whether an edge is clear, answered by the certificate; counts how often it is asked."""

    class Edges(ob.MotionValidator):
        def checkMotion(self, start, end, last_valid=None):
            asked[0] += 1
            return bool(joint_edge_is_clear(g, _joints(start, dof), _joints(end, dof)))

    return Edges(information)


def _joints(state: Any, dof: int) -> np.ndarray:
    return np.array([state[k] for k in range(dof)])
