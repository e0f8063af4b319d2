"""Scene file with the plan that answers it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...configs.plan_scene import PlanScene
from ...planner import Arm, Body, Plan, PlanSettings


class ScenePlan(NamedTuple):
    """Scene, robot and plan.

    Attributes:
        scene: the scene.
        arm: arm of the robot.
        body: capsules of the robot, held object included.
        start: (dof,) joints [rad] at the start.
        settings: settings of the planner.
        plan: the plan.
    """

    scene: PlanScene
    arm: Arm
    body: Body
    start: np.ndarray
    settings: PlanSettings
    plan: Plan
