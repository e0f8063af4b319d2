"""Compiled constraint of a carried object: the vertical as it sees it, near directions that the demonstration keeps.

On a straight line in joint space the angle changes no faster than the joints turn it, so a value at one place proves a
stretch, like a distance does. Not in the paper.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..control.arm_arrays import ARM, pose_at
from ..geometry import screw
from ..imitation.constraint import Constraint
from ..jit import inlined, inner, kernel
from ..robot.kinematics import CHAIN, FRAME, REVOLUTE

SMALLEST = 1e-3
"""Share of a line below which a stretch that cannot be certified counts as a violation."""
STEPS = 12
"""Largest number of steps by which joints are moved back to a constraint."""
INSIDE = 0.3
"""Share of the bound within which a joint position is moved: room for the lines between them."""
DAMPING = 1e-4
"""Added to the squared singular values of a step."""
LONGEST_STEP = 0.3
"""Largest rotation [rad] of one step."""


class KeptColumns(NamedTuple):
    """Columns of the head of a packed constraint; its other rows are directions (3)."""

    count: int = 0  # number of directions
    bound: int = 1  # [rad]
    width: int = 3


KEPT = KeptColumns()


def packed_constraint(constraint: Constraint | None) -> np.ndarray:
    """Return what a constraint keeps while the object is carried, as the kernels take it; None keeps nothing."""
    directions = np.empty((0, 3)) if constraint is None else constraint.directions
    out = np.zeros((1 + max(len(directions), 1), KEPT.width))
    out[0, KEPT.count], out[0, KEPT.bound] = len(directions), math.inf if constraint is None else constraint.bound
    out[1 : 1 + len(directions)] = directions
    return out


@inlined
def _to_chord(kept, k, up):
    """Point nearest to a vector on the chord between directions k and k + 1, as a unit vector."""
    a = (kept[k, 0], kept[k, 1], kept[k, 2])
    if k + 1 > int(kept[0, KEPT.count]):
        return a
    d = (kept[k + 1, 0] - a[0], kept[k + 1, 1] - a[1], kept[k + 1, 2] - a[2])
    square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    s = ((up[0] - a[0]) * d[0] + (up[1] - a[1]) * d[1] + (up[2] - a[2]) * d[2]) / max(square, 1e-300)
    s = min(max(s, 0.0), 1.0)
    x, y, z = a[0] + s * d[0], a[1] + s * d[1], a[2] + s * d[2]
    scale = 1.0 / math.sqrt(x * x + y * y + z * z)
    return (scale * x, scale * y, scale * z)


@inlined
def _angle(a, b):
    c = screw.cross(a, b)
    return math.atan2(math.sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]), a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@inner
def nearest_kept(kept, x):
    """Return the angle [rad] of the vertical from what is kept at a pose, and the nearest kept direction.

    Args:
        kept: see `packed_constraint`.
        x: pose, a tuple of 8.
    """
    up = screw.rotate((x[0], -x[1], -x[2], -x[3]), (0.0, 0.0, 1.0))
    least, near = math.inf, up
    count = int(kept[0, KEPT.count])
    for k in range(1, max(count, 2) if count > 0 else 1):
        direction = _to_chord(kept, k, up)
        angle = _angle(direction, up)
        if angle < least:
            least, near = angle, direction
    return (least if count > 0 else 0.0), near


@kernel
def deviation_at(work, kept, q):
    """Return the angle [rad] of the vertical from what is kept at joints q.

    Args:
        work: array of the arm, see `arm_arrays`.
        kept: see `packed_constraint`.
        q: (dof,) joints.
    """
    return nearest_kept(kept, pose_at(work, q))[0]


@inner
def _rate(work, start, end):
    """Bound on the rotation [rad] of the tool away from the vertical along the line between joints.

    The first joint's axis stands still; of the others any direction is assumed.
    """
    n, total = len(start), 0.0
    for i in range(n):
        if work[ARM.chain + i, CHAIN.kind] == REVOLUTE:
            share = 1.0
            if i == 0:
                x, y = work[ARM.frames, FRAME.axis], work[ARM.frames, FRAME.axis + 1]
                share = math.sqrt(x * x + y * y)
            total += share * abs(end[i] - start[i])
    return total


@kernel
def largest_deviation(work, kept, start, end, bound, q):
    """Return a certified bound [rad] on the deviation along the line between joints, or infinity beyond a given one.

    Args:
        work: array of the arm, see `arm_arrays`.
        kept: see `packed_constraint`.
        start: (dof,) joints.
        end: (dof,) joints.
        bound: deviation [rad] beyond which the answer does not matter.
        q: (dof,) scratch.
    """
    if kept[0, KEPT.count] == 0.0:
        return 0.0
    s, worst, n = 0.0, 0.0, len(start)
    for i in range(n):
        q[i] = end[i]
    if deviation_at(work, kept, q) > bound:
        return math.inf
    rate = _rate(work, start, end)
    for _ in range(2000):
        for i in range(n):
            q[i] = start[i] + s * (end[i] - start[i])
        here = deviation_at(work, kept, q)
        if here > bound:
            return math.inf
        if here + rate * (1.0 - s) <= bound:
            # the value at the end bounds the rest from the other side
            for i in range(n):
                q[i] = end[i]
            last = deviation_at(work, kept, q)
            return max(worst, 0.5 * (here + last + rate * (1.0 - s)))
        stretch = (bound - here) / rate
        if stretch < SMALLEST:
            return math.inf
        worst, s = bound, s + stretch
    return math.inf


@kernel
def restore(work, kept, q):
    """Move joints back to a constraint by a few damped steps; returns whether they keep it.

    Args:
        work: array of the arm, see `arm_arrays`.
        kept: see `packed_constraint`.
        q: (dof,) joints, changed in place; they stay within their limits.
    """
    n = len(q)
    for _ in range(STEPS):
        x = pose_at(work, q)
        angle, near = nearest_kept(kept, x)
        if angle <= INSIDE * kept[0, KEPT.bound]:
            return True
        axis = screw.cross(screw.rotate((x[0], x[1], x[2], x[3]), near), (0.0, 0.0, 1.0))
        scale = min(angle, LONGEST_STEP) / max(math.sqrt(axis[0] * axis[0] + axis[1] * axis[1]), 1e-12)
        a = b = c = 0.0
        for i in range(n):
            if work[ARM.chain + i, CHAIN.kind] == REVOLUTE:
                u, v = work[ARM.frames + i, FRAME.axis], work[ARM.frames + i, FRAME.axis + 1]
                a, b, c = a + u * u, b + u * v, c + v * v
        a, c = a + DAMPING, c + DAMPING
        x_, y_, determinant = scale * axis[0], scale * axis[1], a * c - b * b
        l_, m_ = (c * x_ - b * y_) / determinant, (a * y_ - b * x_) / determinant
        for i in range(n):
            if work[ARM.chain + i, CHAIN.kind] == REVOLUTE:
                u, v = work[ARM.frames + i, FRAME.axis], work[ARM.frames + i, FRAME.axis + 1]
                q[i] = min(max(q[i] + u * l_ + v * m_, work[ARM.lower, i]), work[ARM.upper, i])
    return deviation_at(work, kept, q) <= INSIDE * kept[0, KEPT.bound]
