"""Plans of path makers: a path is made, then judged in the kinematic closed loop that will follow it.

A plan promises less than one of `Planner`: it arrives. Nothing is proven clear, unless the guard is on; but of goals
that look alike, one whose path stays clear is preferred (`Plan.imitated_share` is the clear share of the path). A
failed plan has the reason "ik_or_limit", the arm does not follow the path to its end, or `NO_PATH`, there is no path.
"""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ...planner.control.arm_arrays import arm_arrays
from ...planner.control.pursuit import ARRIVED
from ...planner.geometry.pose import METERS_PER_RADIAN, Pose, PosePath
from ...planner.geometry.shapes import Obstacle
from ...planner.imitation.tsia import guide_index, imitated_path
from ...planner.planning.plan import NextMotion, Plan, PlanRequest
from ...planner.planning.planning_scene import PlanningScene, SceneTemplate, checked_obstacles
from ...planner.planning.settings import PlanSettings
from ...planner.robot.arm import Arm
from ...planner.robot.body import Body
from ...planner.safety.guarded_pursuit import guarded_roll_out
from .motion_method import PATH
from .path_generators import PathGenerator
from .tool_obstacles import ToolObstacles

NO_PATH = "no way found"
AT_GOAL = 0.005
"""Screw length [m] to the goal at which a path that was made is held to end there."""
EVERY = 5
"""Ticks between two looks at how clear a roll-out is."""


class GeneratedPlanner:
    """Plans legs of one arm with a path maker; see `motion_method.MotionPlanner`.

    Args:
        arm: the arm.
        body: its capsules, held object included.
        settings: see `PlanSettings`; `repet` and `search` say nothing to it.
        generator: of the paths.
    """

    def __init__(self, arm: Arm, body: Body, settings: PlanSettings, generator: PathGenerator):
        self.arm, self.body, self.settings, self.generator = arm, body, settings, generator
        motion = settings.motion
        self._layout = SceneTemplate(arm, body, settings.safety, motion.dt, guard=settings.guard)
        self._work = arm_arrays(arm, motion.controller.packed(), motion.pursuit.packed())
        self._trace = np.empty((round(settings.max_seconds / motion.dt) + 1, arm.dof))

    def plan(
        self,
        demonstrated: PosePath,
        start: ArrayLike,
        goal: Pose,
        obstacles: Sequence[Obstacle] = (),
        *,
        allowed: Sequence[tuple[str, str]] = (),
        leaving: PosePath | None = None,
        next_motion: NextMotion | None = None,
        seed: int = 0,
    ) -> Plan:
        """Plan a leg; see `Planner.plan`. `next_motion` and `seed` say nothing to a path maker."""
        begun = time.perf_counter()
        q = self.arm.checked(start)
        asked = PlanRequest(self.arm, self.body, goal, tuple(obstacles), tuple(allowed), self.settings, demonstrated)
        scene = PlanningScene(self._layout, checked_obstacles(obstacles), self.settings.safety.distance, allowed)
        near = ToolObstacles.of(self.arm, self.body, obstacles, allowed)
        here = self.arm.fk(q) if leaving is None else leaving[-1]
        plan = self._made(asked, scene, near, demonstrated, here, q, leaving, self.settings.motion.guide)
        if not plan.success and self.generator.guided:
            later = self.settings.motion.max_guide
            plan = self._made(asked, scene, near, demonstrated, here, q, leaving, later)._replace(tries=2)
        return plan._replace(seconds=time.perf_counter() - begun)

    def _made(
        self,
        asked: PlanRequest,
        scene: PlanningScene,
        near: ToolObstacles,
        demonstrated: PosePath,
        here: Pose,
        q: np.ndarray,
        leaving: PosePath | None,
        fraction: float,
    ) -> Plan:
        goal, imitated = asked.goal, imitated_path(demonstrated, asked.goal)
        guide = guide_index(imitated, fraction)
        path = self.generator.make(demonstrated, here, goal, guide, near).path
        whole = path if leaving is None else leaving.joined(path)
        joints, arrived, margin, changed = self._rolled_out(scene, whole, q)
        distance, angle = path[-1].distance_to(goal)
        reason = "" if arrived else "ik_or_limit"
        if np.hypot(distance, METERS_PER_RADIAN * angle) > AT_GOAL:
            reason = NO_PATH
        imitated_share = float(np.mean([scene.slack(row) >= 0.0 for row in joints[::EVERY]])) if not reason else 0.0
        return Plan(
            joints if not reason else q[None], self.settings.motion.dt, reason, PATH, imitated.dqs, path.dqs,
            np.empty((0, 8)), 0, margin if not reason else -np.inf, changed, 1, 0.0, asked,
            "" if reason != NO_PATH else f"the path ends {distance:.3f} m from the goal", guide, imitated_share,
        )  # fmt: skip

    def _rolled_out(self, scene: PlanningScene, path: PosePath, q: np.ndarray) -> tuple[np.ndarray, bool, float, int]:
        """Joints at every tick of following a path, whether it arrives, joint margin, ticks that the guard changed."""
        scratch, memory = np.empty((2, self.arm.dof)), np.array([0.0, 0.0, np.inf, 0.0])
        status, last, margin, changed = guarded_roll_out(
            self._work, scene.robot, path.dqs, q.copy(), self.settings.motion.dt, memory, scratch[0], scratch[1],
            self._trace, 0,
        )  # fmt: skip
        return self._trace[: last + 1].copy(), status == ARRIVED, float(margin), int(changed)
