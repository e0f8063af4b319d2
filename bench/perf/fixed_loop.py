"""A compiled loop that never changes, as a unit of CPU time that is the same work on every machine."""

from __future__ import annotations

import math
from functools import partial
from time import process_time

from ...planner.jit import kernel
from .measuring import seconds_per_call

ROUNDS = 72_000
"""Rounds of the loop: it takes 1 ms of CPU where Pinocchio's FK + Jacobian of the Panda takes 0.7 us."""


@kernel
def _fixed_loop(rounds):
    """Turn a quaternion many times: multiplications, a sine and a root, as in kinematics."""
    w, x, y, z, angle = 1.0, 0.0, 0.0, 0.0, 0.1
    for k in range(rounds):
        s = math.sin(angle)
        c = math.sqrt(1.0 - s * s)
        w, x, y, z = c * w - s * z, c * x + s * y, c * y - s * x, c * z + s * w
        angle = 0.1 + 1e-6 * (k & 1023) * x
    return w + x + y + z


def unit() -> float:
    """Return the CPU time of the fixed loop [s] now."""
    return seconds_per_call(partial(_fixed_loop, ROUNDS), clock=process_time)[0]
