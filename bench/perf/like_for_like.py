"""Measurement of the planner beside peers that have the same proof, and beside the work that every plan contains.

Processor time throughout. Edges of OMPL's are proven clear by the planner's own certificate where a row says so, and
else checked at OMPL's resolution by the planner's own compiled distances.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import count
from time import process_time
from typing import Any

import numpy as np

from ...baselines.errors import MissingExtra
from ...baselines.extras import needed
from ...baselines.motion.rrt_connect import RrtSettings, joint_path
from ...planner import Obstacle, Planner
from ...planner.control.arm_arrays import arm_arrays
from ...planner.control.pursuit import ARRIVED
from ...planner.planning.planning_scene import PlanningScene, SceneTemplate
from ...planner.planning.settings import JointSearchSettings
from ...planner.resumable import finished
from ...planner.safety.guarded_pursuit import roll_out
from ...planner.search.joint_paths import JointPaths
from ...planner.search.joint_space_rrt import joint_edge_is_clear
from .measuring import Row, row, seconds_per_call
from .ompl_peer import ompl_solver
from .planner import problem

PROVEN = "plan, 100 poses, 1 obstacle / OMPL, proven edges, 100 shortcuts"
FREE = "plan with nothing in the way / its own roll-out"
CONNECT = "RRT-Connect in joint space / OMPL's, edges not proven"
SEARCH = JointSearchSettings()
NO_OMPL = "needs: pip install 'onedemo[ompl]'"
ROOM = 1600
"""Rows for the ticks of a roll-out: 32 s, more than the longest plan."""


def _work_array(planner: Planner, obstacles: list[Obstacle]) -> np.ndarray:
    """Return the arm of a planner among obstacles and its own parts, as roll-outs and searches see it."""
    settings = planner.settings
    template = SceneTemplate(planner.arm, planner.body, settings.safety, settings.motion.dt)
    return PlanningScene(template, obstacles, settings.repet.distance).robot


def _proven(name: str) -> Row:
    """Measure a whole plan beside OMPL's search to the same posture, its edges proven, its path shortened."""
    planner, demo, q, goal, ball = problem()
    plan = planner.plan(demo, q, goal, [ball])
    assert plan.success
    g, seeds, settings = _work_array(planner, [ball]), count(), RrtSettings(shortcuts=100)
    ends = plan.joints[0], [plan.joints[-1]]
    peer = partial(joint_path, g, planner.arm.lower, planner.arm.upper, *ends, settings)
    try:
        needed("ompl.base", "ompl")
    except MissingExtra:
        return Row(name, None, "ratio", 0.5, None, NO_OMPL)
    plan_anew = partial(planner.plan, demo, q, goal, [ball])
    mine, theirs = seconds_per_call(plan_anew, lambda: peer(next(seeds)), clock=process_time)
    note = f"{mine * 1e3:.2f} ms, {plan.how}, with all ticks, against {theirs * 1e3:.2f} ms for the corners of a path"
    return row(name, mine / theirs, "ratio", 0.5, note)


def _free(name: str) -> Row:
    """Measure a whole plan beside the guarded roll-out of its own path, which proves it."""
    planner, demo, q, goal, _ = problem()
    plan = planner.plan(demo, q, goal, [])
    assert plan.how == "direct"
    alone = _roll_out(planner, np.array(plan.path.dqs), q)
    mine, other = seconds_per_call(lambda: planner.plan(demo, q, goal, []), alone, clock=process_time)
    note = f"{mine * 1e3:.3f} ms against {other * 1e3:.3f} ms for {len(plan.joints)} ticks"
    return row(name, mine / other, "ratio", 1.3, note)


def _roll_out(planner: Planner, path: np.ndarray, q: np.ndarray) -> Callable[[], Any]:
    """Return a call that rolls a path out from joints q without any obstacle."""
    motion, g = planner.settings.motion, _work_array(planner, [])
    work = arm_arrays(planner.arm, motion.controller.packed(), motion.pursuit.packed())
    trace = np.empty((ROOM, planner.arm.dof))

    def call() -> Any:
        return finished(roll_out(work, g, path, q, motion.dt, trace))

    assert call().status == ARRIVED
    return call


def _connect(name: str) -> Row:
    """Measure the search alone, with proven edges, beside OMPL's, with edges checked at OMPL's resolution."""
    planner, demo, q, goal, ball = problem()
    plan, arm = planner.plan(demo, q, goal, [ball]), planner.arm
    g, dof = _work_array(planner, [ball]), arm.dof
    start, end = plan.joints[0], plan.joints[-1]
    assert not joint_edge_is_clear(g, start, end), "nothing to search for"
    try:
        peer = ompl_solver(arm, g, start, end)
    except MissingExtra:
        return Row(name, None, "ratio", 0.7, None, NO_OMPL)
    paths = JointPaths(dof, SEARCH.nodes, 0)

    def call() -> None:
        # the state of the random numbers stays: each search draws other samples, as OMPL's does
        assert finished(paths.connected(g, start, end, SEARCH.step, SEARCH.iterations, 0)) is not None

    mine, theirs = seconds_per_call(call, peer, clock=process_time)
    note = f"{mine * 1e3:.3f} ms with proven edges against {theirs * 1e3:.3f} ms, to the same posture"
    return row(name, mine / theirs, "ratio", 0.7, note)


LIKE_LINES: dict[str, Callable[[], Row]] = {
    PROVEN: partial(_proven, PROVEN),
    FREE: partial(_free, FREE),
    CONNECT: partial(_connect, CONNECT),
}
"""Measurements by name."""
