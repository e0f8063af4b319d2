"""Solvers of the track's problems, each on the same body among the same obstacles, with its CPU time.

The planner's own search ends with shortcuts and a time law; RRT-Connect of OMPL stops at its first path.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...baselines.errors import MissingExtra
from ...baselines.motion.rrt_connect import RrtSettings, joint_path
from ...planner import Certificate, Obstacle, Planner, PlanSettings, PosePath, RepetSettings, SafetySettings, certify
from ...planner.planning.planning_scene import PlanningScene
from ..perf.ompl_peer import ompl_path
from .robot import TrackRobot

OURS, OMPL, OMPL_PROVEN = "onedemo", "ompl", "ompl, proven edges"
SOLVERS = (OURS, OMPL, OMPL_PROVEN)
SECONDS = 5.0
"""Time limit of OMPL's own search [s]; the others count their work."""
DETOUR_ROOM = 2.0
"""Distance that detours keep, over the distance that the arm keeps."""


class Answer(NamedTuple):
    """A solver's answer.

    Attributes:
        joints: (t, dof) points of the motion; None without success.
        reason: of the failure; "" with success.
        cpu: CPU time [s].
        seconds: duration of the motion [s]; None if it has no time law.
        certificate: of the independent judge; None if the solver has nothing to be judged.
    """

    joints: np.ndarray | None
    reason: str
    cpu: float
    seconds: float | None = None
    certificate: Certificate | None = None


Solve = Callable[[tuple[Obstacle, ...], np.ndarray, np.ndarray], Answer]
"""Takes obstacles, start and goal (dof,) [rad]."""


def settings_with(distance: float) -> PlanSettings:
    """Return the planner's settings for a distance [m] that the arm keeps from obstacles."""
    return PlanSettings(safety=SafetySettings(distance=distance), repet=RepetSettings(distance=DETOUR_ROOM * distance))


def solvers_of(robot: TrackRobot, distance: float) -> dict[str, Solve]:
    """Return the solvers by name; OMPL's only if it is installed.

    Args:
        robot: the robot.
        distance: that the arm keeps from obstacles [m].
    """
    settings = settings_with(distance)
    planner, arm = Planner(robot.arm, robot.body, settings), robot.arm

    def ours(obstacles: tuple[Obstacle, ...], start: np.ndarray, goal: np.ndarray) -> Answer:
        shown = PosePath(arm.fk(goal).dq[None])  # there is nothing to imitate
        begun = time.process_time()
        plan = planner.plan(shown, start, goal, obstacles)
        cpu = time.process_time() - begun
        if not plan.success:
            return Answer(None, plan.why, cpu)
        return Answer(plan.joints, "", cpu, plan.dt * (len(plan.joints) - 1), certify(plan.log()))

    def work_of(obstacles: tuple[Obstacle, ...]) -> np.ndarray:
        return PlanningScene.of(arm, robot.body, obstacles, settings).seen

    def ompl(obstacles: tuple[Obstacle, ...], start: np.ndarray, goal: np.ndarray) -> Answer:
        work, begun = work_of(obstacles), time.process_time()
        joints = ompl_path(arm, work, start, goal, SECONDS)
        return Answer(joints, "" if joints is not None else "no way found", time.process_time() - begun)

    def proven(obstacles: tuple[Obstacle, ...], start: np.ndarray, goal: np.ndarray) -> Answer:
        work, begun = work_of(obstacles), time.process_time()
        joints = joint_path(work, arm.lower, arm.upper, start, [goal], RrtSettings(shortcuts=0))
        return Answer(joints, "" if joints is not None else "no way found", time.process_time() - begun)

    named: dict[str, Solve] = {OURS: ours, OMPL: ompl, OMPL_PROVEN: proven}
    return named if _has_ompl() else {OURS: ours}


def _has_ompl() -> bool:
    from ...baselines.extras import needed

    try:
        needed("ompl.base", "ompl")
    except MissingExtra:
        return False
    return True
