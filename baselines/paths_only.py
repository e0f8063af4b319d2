"""Motions of the policies without a task and without physics: thousands per minute."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..planner import (
    Arm,
    Body,
    Obstacle,
    PlanSettings,
    Pose,
    PosePath,
    RepetSettings,
    escape_path,
    final_path,
    guide_index,
    imitated_path,
)
from ..planner.constraints.request_constraint import fitted, remembered_constraint
from ..planner.constraints.violation import violation_of
from ..planner.errors import PlanFailed, UnknownName
from ..planner.escape.repet import point_tool
from ..planner.planning.attempts import NOT_KEPT
from .factory import POLICIES, settings_of
from .motion.baseline_motions import GeneratedMotionSettings
from .motion.motion_method import MotionPlanner
from .motion.tool_obstacles import ToolObstacles
from .screw_policy import ScrewSettings

TIGHTER = (0.7, 0.35)
"""Factors of the distance to obstacles with which a detour is tried again: the planner's own, and half of it."""
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
    if not chosen.plan.trees:
        return final_path(start, imitated, guide)
    return _escaped(demonstrated, imitated, start, obstacles, tool, chosen.plan, guide)


def _escaped(
    demonstrated: PosePath,
    imitated: PosePath,
    start: Pose,
    obstacles: Sequence[Obstacle],
    tool: np.ndarray,
    settings: PlanSettings,
    guide: int,
) -> PosePath:
    """Return the imitated path, led around obstacles, with what the demonstration keeps."""
    if settings.keeping == "free":
        return _around(final_path(start, imitated, guide), tool, obstacles, settings.repet, None)
    constraint = fitted(remembered_constraint(demonstrated, settings.constraint), imitated, start)
    path = final_path(start, imitated, min(guide, constraint.last_carried))
    guided = len(path) - (constraint.count - constraint.guided) if constraint.guided < constraint.count else None
    found = _around(path, tool, obstacles, settings.repet, guided)
    violation = violation_of(constraint, imitated, found)
    if settings.keeping == "must" and not violation.kept:
        raise PlanFailed("blocked", f"{NOT_KEPT}: {violation.detail}")
    return found


def _around(
    path: PosePath, tool: np.ndarray, obstacles: Sequence[Obstacle], repet: RepetSettings, guided: int | None
) -> PosePath:
    """Return the path led around obstacles, with less margin where there is no room for more."""
    escape = escape_path(path, tool, obstacles, repet, guided=guided)
    for factor in TIGHTER:
        if escape.found:
            break
        escape = escape_path(path, tool, obstacles, replace(repet, distance=factor * repet.distance), guided=guided)
    if not escape.found:
        raise PlanFailed("blocked", escape.reason)
    return escape.path
