"""A scene file with the plan that answers it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...configs.plan_scene import PlanScene
from ...planner.log.motion_log import MotionLog
from ...planner.planning.plan import Plan
from ...planner.planning.settings import PlanSettings
from ...planner.robot.arm import Arm
from ...planner.robot.body import Body


class ScenePlan(NamedTuple):
    """A scene, who moves in it, and the plan.

    Attributes:
        scene: what was asked.
        arm: of the robot.
        body: its capsules, held object included.
        start: (dof,) joints.
        settings: of the planner.
        plan: the answer.
    """

    scene: PlanScene
    arm: Arm
    body: Body
    start: np.ndarray
    settings: PlanSettings
    plan: Plan

    @property
    def log(self) -> MotionLog:
        """The plan as its judge takes it."""
        plan, scene = self.plan, self.scene
        return MotionLog(
            arm=self.arm,
            body=self.body,
            obstacles=scene.obstacles,
            time=plan.dt * np.arange(len(plan.joints)),
            joints=plan.joints,
            safety=self.settings.safety.distance,
            goal=scene.goal,
            demonstrated=plan.imitated if plan.success else None,
            allowed=scene.allowed,
            claims={"joint_margin": plan.margin} if plan.success else {},
        )
