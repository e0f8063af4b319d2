"""Compiled closed loop with the safety layer in it: a path followed by an arm that is kept clear at every tick."""

from __future__ import annotations

import numpy as np

from ..collision.robot_arrays import DESIRED
from ..control.arm_arrays import LIMITS
from ..control.controller import tick
from ..control.pursuit import FOLLOWING, STALLED, pursue
from ..jit import kernel
from .safety_layer import BLOCKED, FREE, safe_velocity


@kernel
def safe_tick(work, g, q, target, sign, dt, out):
    """One control step towards a pose (8,), safe: speeds into `out` (dof,); the way round taken.

    `controller.tick` and the safety layer in one call.
    """
    wish = g[DESIRED]
    sign = tick(work, q, target, sign, wish[: len(q)])
    safe_velocity(g, q, wish[: len(q)], dt, out)
    return sign


@kernel
def guarded_tick(work, g, path, q, dt, pursuit_state, wish, out):
    """One tick along a path: the wanted speeds into `wish`, the safe ones into `out`; both statuses.

    Args:
        work: arm and controller, see `workspace`.
        g: the arm among obstacles, see `robot_arrays`.
        path: (n, 8).
        q: (dof,) joints.
        dt: seconds.
        pursuit_state: (4,) of the pursuit.
        wish: (dof,) result.
        out: (dof,) result.
    """
    status = pursue(work, path, q, dt, pursuit_state, wish)
    return status, safe_velocity(g, q, wish, dt, out)


@kernel
def guarded_roll_out(work, g, path, q, dt, pursuit_state, wish, out, trace, first):
    """Follow a path from q among obstacles that stand still; every step of the trace is proven clear.

    Args:
        work: see `guarded_tick`.
        g: same.
        path: same.
        q: (dof,) joints, moved along.
        dt: seconds.
        pursuit_state: (4,) of the pursuit.
        wish: (dof,) scratch.
        out: (dof,) scratch.
        trace: (t, dof) joints at every tick, written from row `first` on.
        first: row.

    Returns:
        (status, row of the last entry, smallest joint margin [rad], ticks that the safety layer changed).
    """
    margin, changed = np.inf, 0
    for count in range(first, len(trace)):
        for i in range(len(q)):
            trace[count, i] = q[i]
            margin = min(margin, q[i] - work[LIMITS, i], work[LIMITS + 1, i] - q[i])
        status, safety = guarded_tick(work, g, path, q, dt, pursuit_state, wish, out)
        if status != FOLLOWING:
            return status, count, margin, changed
        if safety != FREE:
            changed += 1
        for i in range(len(q)):
            # what stands still cannot hit an arm that does
            q[i] += dt * out[i] if safety != BLOCKED else 0.0
    return STALLED, len(trace) - 1, margin, changed
