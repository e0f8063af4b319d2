"""Warm-up: planning and following run once, so that no tick waits for the compiler.

Kernels are compiled at their first call (half a minute in total) or loaded from the disk (half a second). The warm-up
must not depend on whether some posture of the arm is clear, so it uses a body that is a point at the tool; only the
messages use the real body.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from math import inf

import numpy as np

from ..constraints.constrained_rrt import connect_keeping, shorten_keeping
from ..constraints.guided_postures import FLOOD, PARTS, edge_along, spread_back
from ..constraints.held_directions import packed_constraint
from ..constraints.violation import violation_of
from ..control.arm_arrays import arm_arrays
from ..control.controller import Controller
from ..geometry import dualquat as dq
from ..geometry.pose import Pose, PosePath
from ..geometry.shapes import Obstacle, Sphere
from ..imitation.kept_components import found_constraint
from ..imitation.segmentation import resampled
from ..imitation.tsia import final_path, imitated_path, screw_path
from ..planning.constrained_search import ConstrainedSearch
from ..planning.joint_space_motion import plan_joint_space
from ..planning.planning_scene import PlanningScene
from ..planning.settings import JointSearchSettings, PlanSettings
from ..resumable import finished
from ..robot.arm import Arm
from ..robot.body import BODY, Body
from ..safety.safety_layer import SafetyLayer
from .command import ReactiveSettings
from .reactive_planner import ReactivePlanner

STEP, STEPS = 0.005, 4
"""Length [m] of the motion's steps, and their number."""
FAR = Obstacle(Sphere(0.01), Pose.from_position_quaternion([0.0, 0.0, 50.0]), name="far")
SLOW = np.array([0.0, 0.0, 1e-3])
"""Velocity [m/s] of an obstacle that hardly moves."""
SHORT = PlanSettings(search=JointSearchSettings(seeds=1, targets=1, postures=1, rounds=1, shortcuts=1))


def warm_up(arm: Arm, body: Body) -> None:
    """Compile all kernels of planning and following, or load them from the cache; they serve any arm.

    Args:
        arm: the arm.
        body: its capsules.
    """
    q = 0.5 * (np.maximum(arm.lower, -1.0) + np.minimum(arm.upper, 1.0))
    row = np.zeros(BODY.width)
    row[BODY.frame], row[BODY.radius] = arm.dof - 1.0, 0.001
    point, path = Body(row[None], ("point",)), _upwards(arm.fk(q))
    _algebra(path.dqs)
    for seen in ((FAR,), (replace(FAR, velocity=SLOW),)):
        _follow(ReactivePlanner(arm, point, ReactiveSettings(plan=SHORT, thinking=inf)), q, path, seen)
    _search(arm, point, q)
    SafetyLayer((arm,), (point,), (FAR,), SHORT.motion.dt)(q, np.zeros(arm.dof))
    Controller(arm)(q, path[-1])
    # the queries behind messages
    scene = PlanningScene.of(arm, body, (FAR,), SHORT)
    scene.tightest(q)
    scene.tightest_of_tool(path[0])


def _upwards(start: Pose) -> PosePath:
    """Return a short path upwards."""
    up = Pose.from_position_quaternion([0.0, 0.0, STEPS * STEP]) @ start
    return final_path(start, imitated_path(resampled(screw_path(start, up, STEP), STEP), up), 1)


def _algebra(x: np.ndarray) -> None:
    """Compile the pose algebra for writable and for read-only arrays, which are different types.

    Args:
        x: (n, 8) poses, read-only.
    """
    for one, other in product((x, x.copy()), repeat=2):
        dq.mul(one, other)
        dq.sclerp(one, other, np.zeros(len(x)))
    turn = dq.identity()[:4]
    turn.flags.writeable = False
    for place, other in product((np.zeros(3), turn[1:]), (turn, turn.copy())):
        dq.from_position_quaternion(place, other)
    for one in (x, x.copy()):
        dq.translation(one)
        dq.normalized(one)
        dq.checked_unit(1.0000001 * one)
        dq.checked_unit(one)
        dq.dq_from_twist(dq.twist_from_dq(one))


def _follow(planner: ReactivePlanner, q: np.ndarray, path: PosePath, seen: tuple[Obstacle, ...]) -> None:
    """Plan a motion, follow it, and predict it where something moves; then once without detours."""
    for detours in (True, False):
        planner.see(seen)
        planner.go(path, detours=detours)
        planner.step(q)
        planner.see(tuple(obstacle.at(STEP) for obstacle in seen))
        planner.step(q)


def _search(arm: Arm, point: Body, q: np.ndarray) -> None:
    """Search in joint space for a path to the present pose, which any arm can reach."""
    here, motion = arm.fk(q), SHORT.motion
    scene, work = (
        PlanningScene.of(arm, point, (FAR,), SHORT),
        arm_arrays(arm, motion.controller.packed(), motion.pursuit.packed()),
    )
    finished(plan_joint_space(arm, scene, work, PosePath(here.dq[None]), here, q, SHORT, None, 0))
    _keep(arm, scene, work, q)


def _keep(arm: Arm, scene: PlanningScene, work: np.ndarray, q: np.ndarray) -> None:
    """Find a constraint, and compile its searches and measures; nothing need be found."""
    path = _upwards(arm.fk(q))
    found = replace(found_constraint(path), guided=len(path) // 2)
    violation_of(found, path, path)
    search = ConstrainedSearch(arm, scene, work, path, path[-1], q, found, SHORT, None, 0)
    finished(search.run())
    kept, state, rows = packed_constraint(found), np.ones(1), np.array([q, q, q, q])
    trees, parents, counts = np.array([rows, rows]), np.full((2, 4), -1.0), np.ones(2)
    options, scratch, solver = np.zeros(FLOOD.width), np.empty((PARTS, arm.dof)), work.copy()
    out, nodes, links, numbers = np.empty((8, arm.dof)), np.array([rows, rows]), np.zeros((2, 4)), np.ones(2)
    connect_keeping(scene.seen, solver, kept, q - 0.1, q + 0.1, trees, parents, counts, 0, 1, 0.1, state, out)
    shorten_keeping(scene.seen, solver, kept, out, 2, 1, state, rows[:2])
    spread_back(scene.seen, solver, path.dqs[:2], 1, 0, nodes, links, numbers, 0, 1, options, state, scratch)
    edge_along(scene.seen, solver, q, q.copy(), scratch, rows[0])
