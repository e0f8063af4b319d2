"""Plans by path generators: a path is generated, then judged in the kinematic closed loop that will follow it.

Such a plan promises less than one of `Planner`: only arrival. Clearance is not certified unless the guard is on, but
among equivalent goals one with a clear path is preferred (`Plan.imitated_share` is the clear fraction of the path). A
failed plan has the reason "ik_or_limit" (the arm does not follow the path to its end) or `NO_PATH`.
"""

from __future__ import annotations

import time

import numpy as np

from ...planner import Arm, Body, Plan, PlanRequest, PlanSettings, PosePath, guide_index, imitated_path
from ...planner.control.arm_arrays import arm_arrays
from ...planner.control.pursuit import ARRIVED
from ...planner.control.reachability import gap, why_not_reached
from ...planner.errors import told_apart
from ...planner.geometry.pose import METERS_PER_RADIAN
from ...planner.planning.plan import MotionPlanner, pose_goal
from ...planner.planning.planning_scene import PlanningScene, scene_template
from ...planner.planning.requests import checked_request
from ...planner.resumable import CALL, Resumable, finished
from ...planner.safety.guarded_pursuit import roll_out
from .motion_method import NO_PATH, PATH
from .path_generators import PathGenerator
from .tool_obstacles import ToolObstacles

AT_GOAL = 0.005
"""Path length [m] to the goal within which a generated path counts as ending at the goal."""
EVERY = 5
"""Ticks between two clearance checks of a roll-out."""


class GeneratedPlanner(MotionPlanner):
    """Planner of one arm's motions by a path generator; see `planner.planning.plan.MotionPlanner`.

    Args:
        arm: the arm.
        body: its capsules, held object included.
        settings: see `PlanSettings`; `repet` and `search` are ignored.
        generator: generator of the paths.
    """

    def __init__(self, arm: Arm, body: Body, settings: PlanSettings, generator: PathGenerator):
        self.arm, self.body, self.settings, self.generator = arm, body, settings, generator
        motion = settings.motion
        self._template = scene_template(arm, body, settings.safety, motion.dt, settings.guard)
        self._work = arm_arrays(arm, motion.controller.packed(), motion.pursuit.packed())
        self._trace = np.empty((round(settings.max_seconds / motion.dt) + 1, arm.dof))

    def answering(self, request: PlanRequest) -> Resumable[Plan]:
        """Plan a motion, without a pause; `next_motion` and `seed` mean nothing to a path generator."""
        yield CALL
        begun = time.perf_counter()
        request = checked_request(request, self.arm)
        q, distance = np.asarray(request.start), self.settings.safety.distance
        scene = PlanningScene(self._template, request.obstacles, distance, request.allowed)
        near = ToolObstacles.of(self.arm, self.body, request.obstacles, request.allowed)
        plan = self._made(request, scene, near, q, self.settings.motion.guide)
        if not plan.success and self.generator.guided:
            plan = self._made(request, scene, near, q, self.settings.motion.max_guide)._replace(tries=2)
        return plan._replace(seconds=time.perf_counter() - begun)

    def _made(
        self, request: PlanRequest, scene: PlanningScene, near: ToolObstacles, q: np.ndarray, fraction: float
    ) -> Plan:
        goal, leaving = pose_goal(request), request.leaving
        here = self.arm.fk(q) if leaving is None else leaving[-1]
        imitated = imitated_path(request.demonstrated, goal)
        guide = guide_index(imitated, fraction)
        path = self.generator.make(request.demonstrated, here, goal, guide, near).path
        whole = path if leaving is None else leaving.joined(path)
        joints, arrived, margin, changed = self._rolled_out(scene, whole, q)
        distance, angle = path[-1].distance_to(goal)
        reason, detail = "", ""
        if (away := np.hypot(distance, METERS_PER_RADIAN * angle)) > AT_GOAL:
            found, most = told_apart(1e3 * away, 1e3 * AT_GOAL, 1)
            turn = f"a radian counted as {METERS_PER_RADIAN:g} m"
            reason, detail = NO_PATH, f"the path ends {found} mm from the goal ({turn}), allowed are {most}"
        elif not arrived:
            reason = "ik_or_limit"
            stop = f"the arm comes to a stop {gap(self.arm, goal, joints[-1])}"
            detail = why_not_reached(self.arm, goal, q, search=False) or stop
        return Plan(
            joints=joints if not reason else q[None],
            dt=self.settings.motion.dt,
            reason=reason,
            how=PATH,
            imitated_poses=imitated.dqs,
            path_poses=path.dqs,
            tree_rows=np.empty((0, 8)),
            detours=0,
            margin=margin if not reason else -np.inf,
            changed=changed,
            tries=1,
            seconds=0.0,
            request=request,
            arm=self.arm,
            body=self.body,
            settings=self.settings,
            detail=detail,
            guide=guide,
            imitated_share=float(np.mean([scene.slack(row) >= 0.0 for row in joints[::EVERY]])) if not reason else 0.0,
        )

    def _rolled_out(self, scene: PlanningScene, path: PosePath, q: np.ndarray) -> tuple[np.ndarray, bool, float, int]:
        """Follow a path kinematically: return joints at every tick, arrival, joint margin, ticks the guard changed."""
        dt = self.settings.motion.dt
        found = finished(roll_out(self._work, scene.robot, path.dqs, q, dt, self._trace))
        return found.joints.copy(), found.status == ARRIVED, float(found.margin), int(found.changed)
