"""The policies' ways to move a leg without a task and without physics: thousands of legs in a minute."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..planner.errors import PlanFailed, UnknownName
from ..planner.escape.repet import escape_path, point_tool
from ..planner.geometry.pose import Pose, PosePath
from ..planner.geometry.shapes import Obstacle
from ..planner.imitation.tsia import final_path, guide_index, imitated_path
from ..planner.robot.arm import Arm
from ..planner.robot.body import Body
from .factory import POLICIES, settings_of
from .motion.baseline_motions import GeneratedMotionSettings
from .motion.motion_method import MotionPlanner
from .motion.tool_obstacles import ToolObstacles
from .screw_policy import ScrewSettings

PATH_MAKERS = tuple(
    name for name, kind in POLICIES.items() if issubclass(kind.settings, GeneratedMotionSettings | ScrewSettings)
)
"""Policies that make a path of the tcp; what is left makes joints."""


def motion_planner(name: str, arm: Arm, body: Body, settings: Mapping[str, Any] | None = None) -> MotionPlanner:
    """What plans the legs of a policy: `.plan(demonstrated, joints, goal, obstacles)` gives a `Plan` with its joints.

    Args:
        name: one of `factory.POLICIES`.
        arm: the arm.
        body: its capsules, held object included.
        settings: the policy's, as nested mappings.
    """
    chosen = settings_of(name, settings)
    return chosen.motion_method.planner(arm, body, chosen.plan)


def made_path(
    name: str,
    demonstrated: PosePath,
    start: Pose,
    goal: Pose,
    obstacles: Sequence[Obstacle] = (),
    *,
    tool: np.ndarray | None = None,
    settings: Mapping[str, Any] | None = None,
    guide: int | None = None,
) -> PosePath:
    """The path that a policy would make; whether it reaches the goal, or stays clear, is for a judge to say.

    Args:
        name: one of `PATH_MAKERS`.
        demonstrated: the segment, where it was shown.
        start: of the tcp.
        goal: of the tcp.
        obstacles: where they are now.
        tool: (m, 7) capsules that move with the tcp, see `Body.tool`; None: a ball of 5 cm about it.
        settings: the policy's, as nested mappings.
        guide: index in `demonstrated` of the guiding pose; None: by the settings, on a length that depends on which
            point of the hand the tcp is.

    Raises:
        PlanFailed: no way round the obstacles was found.
        UnknownName: no such path maker.
    """
    if name not in PATH_MAKERS:
        raise UnknownName("path maker", name, PATH_MAKERS)
    chosen, tool = settings_of(name, settings), point_tool(0.05) if tool is None else tool
    imitated = imitated_path(demonstrated, goal)
    if guide is None:
        guide = guide_index(imitated, chosen.motion.guide)
    if isinstance(chosen, GeneratedMotionSettings):
        return chosen.generator.make(demonstrated, start, goal, guide, ToolObstacles(tool, obstacles)).path
    path = final_path(start, imitated, guide)
    if not chosen.plan.avoid:
        return path
    escape = escape_path(path, tool, obstacles, chosen.plan.repet)
    if not escape.found:
        raise PlanFailed("blocked", escape.reason)
    return escape.path
