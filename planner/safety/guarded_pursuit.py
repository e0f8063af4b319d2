"""Compiled closed loop with the safety layer in it: an arm follows a path and keeps clear at every tick."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..collision.robot_arrays import ROW
from ..control.arm_arrays import ARM
from ..control.controller import tick
from ..control.pursuit import FOLLOWING, STALLED, fresh_pursuit_state, pursue
from ..jit import kernel
from ..resumable import CALL, TICK, Resumable
from .safety_layer import BLOCKED, FREE, safe_velocity

SLICE = 32
"""Ticks of a roll-out between two pauses."""


@kernel
def safe_tick(work, g, q, target, sign, dt, out):
    """Do one safe control step towards a pose: `controller.tick` and the safety layer in one call.

    Args:
        work: arm and controller, see `arm_arrays`.
        g: the arm among obstacles, see `robot_arrays`.
        q: (dof,) joints.
        target: (8,) pose of the tcp to approach.
        sign: direction of rotation so far, see `controller.choose_sign`.
        dt: duration of the step [s].
        out: (dof,) safe joint speeds, the result.

    Returns:
        The direction of rotation taken.
    """
    wish = g[ROW.desired]
    sign = tick(work, q, target, sign, wish[: len(q)])
    safe_velocity(g, q, wish[: len(q)], dt, out)
    return sign


@kernel
def guarded_tick(work, g, path, q, dt, pursuit_state, wish, out):
    """Do one safe tick along a path.

    Args:
        work: arm, controller and pursuit, see `arm_arrays`.
        g: the arm among obstacles, see `robot_arrays`.
        path: (n, 8) poses of the tcp.
        q: (dof,) joints.
        dt: duration of the tick [s].
        pursuit_state: (4,) state of the pursuit, changed in place.
        wish: (dof,) wanted joint speeds, a result.
        out: (dof,) safe joint speeds, a result.

    Returns:
        (status of the pursuit, status of the safety layer).
    """
    status = pursue(work, path, q, dt, pursuit_state, wish)
    return status, safe_velocity(g, q, wish, dt, out)


@kernel
def guarded_roll_out(work, g, path, q, dt, pursuit_state, wish, out, trace, first, last):
    """Follow a path among standing obstacles, or go on after a pause; every step of the trace is proven clear.

    Args:
        work: arm, controller and pursuit, see `arm_arrays`.
        g: the arm among obstacles, see `robot_arrays`.
        path: (n, 8) poses of the tcp.
        q: (dof,) joints, changed in place to those at the end.
        dt: duration of a tick [s].
        pursuit_state: (4,) state of the pursuit, changed in place.
        wish: (dof,) scratch.
        out: (dof,) scratch.
        trace: (t, dof) joints at every tick, a result.
        first: first row of the trace to write.
        last: row before which to pause.

    Returns:
        (status, row of the last entry, smallest joint margin [rad], ticks that the safety layer changed), the latter
        two since the pause; the status FOLLOWING if there is more to do, from the next row on.
    """
    margin, changed = np.inf, 0
    for count in range(first, min(last, len(trace))):
        for i in range(len(q)):
            trace[count, i] = q[i]
            margin = min(margin, q[i] - work[ARM.lower, i], work[ARM.upper, i] - q[i])
        status, safety = guarded_tick(work, g, path, q, dt, pursuit_state, wish, out)
        if status != FOLLOWING:
            return status, count, margin, changed
        if safety != FREE:
            changed += 1
        for i in range(len(q)):
            # standing obstacles cannot hit a standing arm
            q[i] += dt * out[i] if safety != BLOCKED else 0.0
    if last < len(trace):
        return FOLLOWING, last - 1, margin, changed
    return STALLED, len(trace) - 1, margin, changed


class GuardedRollOut(NamedTuple):
    """A path that was followed.

    Attributes:
        status: of the pursuit, at the end.
        joints: (t, dof) at every tick; a view of the array that was given.
        margin: smallest joint margin [rad].
        changed: ticks that the safety layer changed.
    """

    status: int
    joints: np.ndarray
    margin: float
    changed: int


def roll_out(
    work: np.ndarray, g: np.ndarray, path: np.ndarray, q: np.ndarray, dt: float, trace: np.ndarray
) -> Resumable[GuardedRollOut]:
    """Follow a path among standing obstacles, see `guarded_roll_out`, in slices.

    Args:
        work: arm, controller and pursuit, see `arm_arrays`.
        g: the arm among obstacles, see `robot_arrays`.
        path: (n, 8) poses of the tcp.
        q: (dof,) joints at the start.
        dt: duration of a tick [s].
        trace: (t, dof) scratch, in which the joints are left; its length limits that of the motion.
    """
    q, state, (wish, out) = q.copy(), fresh_pursuit_state(), np.empty((2, len(q)))
    first, margin, changed = 0, np.inf, 0
    while True:
        status, last, least, more = guarded_roll_out(
            work, g, path, q, dt, state, wish, out, trace, first, first + SLICE
        )
        margin, changed = min(margin, least), changed + more
        yield CALL + TICK * (last + 1 - first)
        if status != FOLLOWING:
            return GuardedRollOut(status, trace[: last + 1], margin, changed)
        first = last + 1
