"""Limits of joints that are probably in another unit."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from ..errors import BadModel
from .model_joints import SLIDES, TURNS, ModelJoint
from .model_report import SHOWN, listed

TURN = 2.0 * math.pi
MANY, MOST = 4.0 * TURN, 720.0
"""A limit between is one in degrees: no arm turns four times each way, and none has limits of more than two turns."""
FEW = 2.0 * TURN
"""Largest plausible limit [rad]."""
FAST = 8.0 * math.pi
"""Largest plausible speed of a revolute joint [rad/s]."""
FAR = 10.0
"""Largest plausible limit of a prismatic joint [m]."""
SMALL = math.radians(7.0)
"""A limit of one turn in radians, if taken for degrees, and a little more [rad]."""


def check_limits(joints: Sequence[ModelJoint], source: str) -> None:
    """Refuse joints whose limits are in degrees.

    Args:
        joints: joints of the arm.
        source: name of the model for messages.

    Raises:
        BadModel: names the joint and its limits.
    """
    for joint in joints:
        largest = max(abs(joint.low), abs(joint.high))
        if joint.kind == TURNS and MANY < largest <= MOST:
            reason = f"its limits are {joint.low:g} to {joint.high:g} rad; are they in degrees?"
            raise BadModel(source, f"joint {joint.name!r}", reason)


def doubtful_limits(joints: Sequence[ModelJoint], velocity: np.ndarray) -> Iterator[str]:
    """Yield a line for each kind of limit that looks wrong.

    Args:
        joints: joints of the arm.
        velocity: (dof,) largest speeds [rad/s or m/s], NaN where unknown.
    """
    limits = [(joint.name, joint.kind, max(abs(joint.low), abs(joint.high))) for joint in joints]
    finite = [(name, kind, limit) for name, kind, limit in limits if limit < math.inf]
    wide = [name for name, kind, limit in finite if kind == TURNS and limit > FEW]
    far = [name for name, kind, limit in finite if kind == SLIDES and limit > FAR]
    fast = [j.name for j, speed in zip(joints, velocity, strict=True) if j.kind == TURNS and FAST < speed < math.inf]
    turns = [limit for _, kind, limit in finite if kind == TURNS]
    free = [name for name, kind, limit in limits if kind == SLIDES and limit == math.inf]
    if free:
        yield f"sliding joints without limits: {listed(free, SHOWN)}"
    if wide:
        yield f"limits of more than two turns: {listed(wide, SHOWN)}"
    if far:
        yield f"limits of more than {FAR:g} m, in millimetres?: {listed(far, SHOWN)}"
    if fast:
        yield f"speeds of more than {FAST:.0f} rad/s, in degrees?: {listed(fast, SHOWN)}"
    if len(turns) > 1 and max(turns) < SMALL:
        yield 'limits of less than 7 degrees in all joints: is <compiler angle="radian"/> missing?'
