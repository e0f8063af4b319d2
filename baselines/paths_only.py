"""Motions of the policies without a task and without physics: thousands per minute."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..planner import Arm, Body, Obstacle, Pose, PosePath, escape_path, final_path, guide_index, imitated_path
from ..planner.errors import PlanFailed, UnknownName
from ..planner.escape.repet import point_tool
from .factory import POLICIES, settings_of
from .motion.baseline_motions import GeneratedMotionSettings
from .motion.motion_method import MotionPlanner
from .motion.tool_obstacles import ToolObstacles
from .screw_policy import ScrewSettings

PATH_MAKERS = tuple(
    name for name, kind in POLICIES.items() if issubclass(kind.settings, GeneratedMotionSettings | ScrewSettings)
)
"""Policies that make a path of the tcp; the others make joint motions."""


def motion_planner(name: str, arm: Arm, body: Body, settings: Mapping[str, Any] | None = None) -> MotionPlanner:
    """Return the planner of a policy's motions: `.plan(demonstrated, joints, goal, obstacles)` returns a `Plan`.

    Args:
        name: one of `factory.POLICIES`.
        arm: the arm.
        body: capsules of the robot, held object included.
        settings: settings of the policy, as nested mappings.

    Raises:
        UnknownName: no such policy.
        BadConfig: a setting cannot be used.
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
    """Return the path that a policy would make; it is not checked whether it reaches the goal or stays clear.

    Args:
        name: one of `PATH_MAKERS`.
        demonstrated: demonstrated path of the segment.
        start: start pose of the tcp.
        goal: goal pose of the tcp.
        obstacles: obstacles at their current poses.
        tool: (m, 7) capsules that move with the tcp, see `Body.tool`; None: a ball of 5 cm radius at the tcp.
        settings: settings of the policy, as nested mappings.
        guide: index in `demonstrated` of the guiding pose; None: by the settings, from a path length that depends on
            which point of the hand is the tcp.

    Raises:
        PlanFailed: no detour around the obstacles was found.
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
    if not chosen.plan.trees:
        return path
    escape = escape_path(path, tool, obstacles, chosen.plan.repet)
    if not escape.found:
        raise PlanFailed("blocked", escape.reason)
    return escape.path
