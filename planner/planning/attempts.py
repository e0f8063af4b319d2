"""Closed loops that a plan may try, the likeliest first, and why one failed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..control.reachability import gap
from ..escape.detour import ESCAPED, FREE, GOAL_IN_COLLISION, NO_ESCAPE, NODE_LIMIT, START_IN_COLLISION, TOO_LONG
from ..escape.repet import Corner, RepetSettings
from ..geometry.pose import Pose
from ..robot.arm import Arm
from .closed_loop_motion import COUNT, Buffers
from .joint_space_motion import path_deviation
from .plan import Plan
from .planning_scene import PlanningScene
from .settings import PlanSettings

NOTHING_KEPT = "nothing of the demonstration is kept"
"""Reason of a plan that would join the demonstrated path only at its end though some of it must be kept."""
NOT_KEPT = "what the demonstration keeps is violated"
"""Reason of a plan that would violate a constraint that must be kept."""


class Attempt(NamedTuple):
    """A closed loop to try.

    Attributes:
        guide: fraction of the imitated path before the guiding pose.
        bias: of the detours, see `RepetSettings.bias`.
        factor: of the planning margin.
        early: detours rejoin the path at the first possible pose.
        detours: False: the path is followed without.
    """

    guide: float
    bias: Corner
    factor: float = 1.0
    early: bool = False
    detours: bool = True


def attempts(settings: PlanSettings, escapes: list[int]) -> Iterator[Attempt]:
    """Yield the closed loops to try, the likeliest first.

    Args:
        settings: of the planner.
        escapes: statuses of the tries so far, which grows: biases help where the arm could not follow a detour, not
            where there is none.
    """
    guide, later = settings.motion.guide, settings.motion.max_guide
    first = settings.biases[0]
    yield Attempt(guide, first)
    if escapes[-1] == ESCAPED:
        yield Attempt(guide, first, early=True)
    if escapes[-1] in (FREE, ESCAPED):
        yield Attempt(later, first)
    if not settings.trees:
        return
    yield Attempt(guide, first, settings.tight)
    if escapes[-1] == ESCAPED:
        for bias in settings.biases[1:]:
            yield Attempt(guide, bias, settings.tight)


def escape_detail(
    status: int, arm: Arm, scene: PlanningScene, goal: Pose, joints: np.ndarray, factor: float, rows: int,
    repet: RepetSettings,
) -> str:  # fmt: skip
    """Return why a path was not followed to its end.

    Args:
        status: of its escape, see `escape.detour`.
        arm: the arm.
        scene: the arm among obstacles.
        goal: pose of the tcp at the end.
        joints: (t, dof) of the motion so far.
        factor: of the planning margin.
        rows: number of nodes of the last escape tree.
        repet: settings of the escape trees.
    """
    if status == START_IN_COLLISION:
        return str(scene.tightest_of_tool(arm.fk(joints[0]), factor))
    if status == GOAL_IN_COLLISION:
        return str(scene.tightest_of_tool(goal, factor))
    if status == NODE_LIMIT:
        return f"a tree had {repet.nodes} nodes, see repet.nodes"
    if status == TOO_LONG:
        return f"blend and detours would have more than {repet.longest} poses, see repet.longest"
    if status == NO_ESCAPE:
        return f"{rows} nodes in the last of {repet.retries + 1} trees"
    return f"the arm comes to a stop {gap(arm, goal, joints[-1])}"


def better(one: Plan, other: Plan) -> Plan:
    """Return the plan that keeps the constraint, has the feasible next motion, the larger share, the larger margin.

    Args:
        one: a plan.
        other: the plan it is compared with.
    """

    def rank(plan: Plan) -> tuple[bool, bool, float, float]:
        return plan.violation.kept, plan.next_feasible, round(plan.imitated_share, 1), plan.end_margin

    return max((one, other), key=rank)


def is_straight(arm: Arm, b: Buffers, max_deviation: float) -> bool:
    """Return whether the tool has stayed near the path that it followed.

    Args:
        arm: the arm.
        b: what a closed loop has left behind.
        max_deviation: distance [m] from the path.
    """
    if math.isinf(max_deviation):
        return True
    joints = b.trace[: b.counts[COUNT.last] + 1]
    path = np.vstack([arm.fk(joints[0]).dq, b.followed[: b.counts[COUNT.followed]]])
    return path_deviation(arm, joints, path) <= max_deviation
