"""Plans of random scenes: sound by their judge, equal to the bit."""

from __future__ import annotations

import numpy as np
from helpers.random_scenes import (
    SETTINGS,
    at,
    demonstrated,
    log_of,
    panda,
)

from onedemo.planner.geometry.pose import Pose
from onedemo.planner.judge.certify import certify
from onedemo.planner.planning.plan import Plan

WAYS = ("direct", "escape", "joint search")


def assert_sound(plan: Plan, arm, body, start, goal, obstacles, allowed=(), settings=SETTINGS) -> None:
    """The plan is a success, starts where it must, and its judge agrees."""
    assert plan.success and plan.how in WAYS, plan.reason
    np.testing.assert_array_equal(plan.joints[0], start)
    certificate = certify(log_of(plan, arm, body, goal, obstacles, settings, allowed))
    assert certificate.ok, certificate.reasons


def free_leg(yaw: float = 0.3) -> tuple[np.ndarray, Pose]:
    """The usual joints of the Panda, and a goal beside it."""
    turn = Pose.from_yaw([0, 0, 0], yaw) @ at([0, 0, 0], demonstrated()[-1].quaternion)
    return panda()[2], at([0.0, 0.2, 1.0], turn.quaternion)
