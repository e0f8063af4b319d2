"""Joints at and beyond their limits: what is beyond by rounding is at the limit, what is farther is said in words."""

from __future__ import annotations

import numpy as np

from ..errors import told_apart
from ..models.model_joints import ROUNDING
from .arm import Arm
from .kinematics import CHAIN, PRISMATIC

NEAR = 0.02
"""Distance [rad or m] to a limit up to which a joint is said to be near it."""


def within_limits(arm: Arm, q: np.ndarray) -> np.ndarray:
    """Return joints as a new array; those beyond a limit by no more than `ROUNDING` are at the limit.

    Args:
        arm: the arm.
        q: (..., dof) joints [rad or m].
    """
    nearest = np.clip(q, arm.lower, arm.upper)
    return np.where(np.abs(q - nearest) <= ROUNDING, nearest, q)


def beyond_limit(arm: Arm, q: np.ndarray) -> str:
    """Return the joint that is farthest beyond its limits, in words; "" if none is.

    Args:
        arm: the arm.
        q: (dof,) joints [rad or m].
    """
    joint, side, excess = _tightest(arm, q)
    if not excess > 0.0:
        return ""
    over, _ = told_apart(excess, 0.0, 3)
    digits = len(over.partition(".")[2])
    at, limit = told_apart(q[joint], getattr(arm, side)[joint], digits)
    unit = _unit(arm, joint)
    return f"{arm.joint_names[joint]} at {at} {unit} is beyond its {side} limit of {limit} {unit} by {over} {unit}"


def near_limit(arm: Arm, q: np.ndarray) -> str:
    """Return the joint that is nearest to a limit, or at it, in words; "" if none is near.

    Args:
        arm: the arm.
        q: (dof,) joints [rad or m].
    """
    joint, side, excess = _tightest(arm, q)
    if excess < -NEAR:
        return ""
    if excess > ROUNDING:
        return beyond_limit(arm, q)
    name = arm.joint_names[joint]
    if excess >= -ROUNDING:
        return f"{name} is at its {side} limit"
    left, _ = told_apart(-excess, 0.0, 3)
    return f"{name} is {left} {_unit(arm, joint)} from its {side} limit"


def _tightest(arm: Arm, q: np.ndarray) -> tuple[int, str, float]:
    """Return the joint that is farthest beyond, or nearest to, a limit; the limit's name; and the excess."""
    low, high = arm.lower - q, q - arm.upper
    joint = int(np.argmax(np.maximum(low, high)))
    side = "lower" if low[joint] > high[joint] else "upper"
    return joint, side, float(max(low[joint], high[joint]))


def _unit(arm: Arm, joint: int) -> str:
    return "m" if arm.chain[joint, CHAIN.kind] == PRISMATIC else "rad"
