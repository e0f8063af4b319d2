"""A small quadratic program in a packed array: the nearest joint speeds that satisfy linear bounds.

Minimizes `(x - x0)^T W (x - x0) / 2 + sum s_i^2 / (2 SLACK)` under `a_i . x + s_i >= b_i`, where only soft rows have
a slack `s_i`, by the dual active-set method of Goldfarb and Idnani (1983). It starts from x0 and adds one violated
bound at a time, so it costs nothing where nothing is violated; the slack gives an answer also where the bounds
contradict each other. Nothing is allocated.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ..jit import inner, kernel

SLACK = 1e-7
"""Softness of a soft row: the slack per unit of its multiplier."""
MOST_ACTIVE = 30
"""Largest number of rows that are active at a time."""
TOLERANCE = 1e-10
"""Violation up to which a row counts as satisfied."""


class BoundColumns(NamedTuple):
    """Columns of a bound; its normal a (16) comes first, one column per coordinate."""

    image: int = 16  # W^-1 a (16)
    bound: int = 32  # b
    softness: int = 33  # SLACK for a soft row, 0 for a hard one
    multiplier: int = 34
    active: int = 35  # 1 if the row is active
    width: int = 36


QP = BoundColumns()


@kernel
def inverse_weight(weight, n):
    """Invert a positive definite matrix in place (Cholesky).

    Args:
        weight: the matrix in its first n rows and columns.
        n: size of the matrix.
    """
    for j in range(n):
        s = weight[j, j]
        for k in range(j):
            s -= weight[j, k] * weight[j, k]
        pivot = math.sqrt(s)
        weight[j, j] = pivot
        for i in range(j + 1, n):
            s = weight[i, j]
            for k in range(j):
                s -= weight[i, k] * weight[j, k]
            weight[i, j] = s / pivot
    for j in range(n):  # inverse of the factor
        weight[j, j] = 1.0 / weight[j, j]
        for i in range(j + 1, n):
            s = 0.0
            for k in range(j, i):
                s -= weight[i, k] * weight[k, j]
            weight[i, j] = s / weight[i, i]
    for i in range(n):  # its product with its transpose, upper triangle first
        for j in range(i, n):
            s = 0.0
            for k in range(j, n):
                s += weight[k, i] * weight[k, j]
            weight[i, j] = s
    for i in range(n):
        for j in range(i):
            weight[i, j] = weight[j, i]


@inner
def _images(rows, count, inverse, n):
    """Compute `W^-1 a` of every row and reset the active set."""
    for k in range(count):
        rows[k, QP.multiplier] = 0.0
        rows[k, QP.active] = 0.0
        for i in range(n):
            s = 0.0
            for j in range(n):
                s += inverse[i, j] * rows[k, j]
            rows[k, QP.image + i] = s


@inner
def _most_violated(rows, count, x, n):
    """Number of the row that is violated most, -1 if all are satisfied."""
    worst, most = -1, -TOLERANCE
    for k in range(count):
        if rows[k, QP.active] == 0.0:
            value = -rows[k, QP.bound]
            for i in range(n):
                value += rows[k, i] * x[i]
            if value < most:
                worst, most = k, value
    return worst


@kernel
def all_hold(rows, count, x, n):
    """Return True if x violates no row: then `solve` would not change x, so W is not needed.

    Args:
        rows: (>= count, >= QP.width) bounds.
        count: number of rows.
        x: (n,) point.
        n: number of coordinates.
    """
    for k in range(count):
        value = -rows[k, QP.bound]
        for i in range(n):
            value += rows[k, i] * x[i]
        if value < -TOLERANCE:
            return False
    return True


@inner
def _inner(rows, i, j, n):
    """`a_i^T W^-1 a_j`, with the slack's share."""
    s = rows[i, QP.softness] if i == j else 0.0
    for k in range(n):
        s += rows[i, k] * rows[j, QP.image + k]
    return s


@inner
def _directions(rows, p, active, size, low, n):
    """Write the change r of the active multipliers per unit of that of row p into `low[MOST_ACTIVE]`.

    Solves `(N^T H N) r = N^T H a_p` by Cholesky; returns False if row p depends on the active rows.
    """
    r = low[MOST_ACTIVE]
    for j in range(size):
        for i in range(j, size):
            s = _inner(rows, int(active[i]), int(active[j]), n)
            for k in range(j):
                s -= low[i, k] * low[j, k]
            if i == j:
                if s <= 1e-14:
                    return False
                low[j, j] = math.sqrt(s)
            else:
                low[i, j] = s / low[j, j]
    for i in range(size):
        s = _inner(rows, int(active[i]), p, n)
        for k in range(i):
            s -= low[i, k] * r[k]
        r[i] = s / low[i, i]
    for j in range(size):
        i = size - 1 - j
        s = r[i]
        for k in range(i + 1, size):
            s -= low[k, i] * r[k]
        r[i] = s / low[i, i]
    return True


@inner
def _drop(rows, active, size, place):
    """Remove a row from the active set; returns the new size."""
    rows[int(active[place]), QP.active] = 0.0
    rows[int(active[place]), QP.multiplier] = 0.0
    for k in range(place, size - 1):
        active[k] = active[k + 1]
    return size - 1


@inner
def _move(rows, x, p, active, size, r, t, n):
    """Take a step of length t: update x and the multipliers, that of row p included."""
    for k in range(size):
        rows[int(active[k]), QP.multiplier] -= t * r[k]
    rows[p, QP.multiplier] += t
    for i in range(n):
        z = rows[p, QP.image + i]
        for k in range(size):
            z -= r[k] * rows[int(active[k]), QP.image + i]
        x[i] += t * z


@inner
def _add(rows, x, p, active, size, low, n):
    """Satisfy row p, dropping active rows that block it; returns the new size, or -1 if the row is infeasible."""
    r = low[MOST_ACTIVE]
    for _ in range(4 * MOST_ACTIVE):
        if size == MOST_ACTIVE or not _directions(rows, p, active, size, low, n):
            return -1
        value, gain = rows[p, QP.softness] * rows[p, QP.multiplier] - rows[p, QP.bound], _inner(rows, p, p, n)
        for i in range(n):
            value += rows[p, i] * x[i]
        for k in range(size):
            gain -= r[k] * _inner(rows, int(active[k]), p, n)
        full = -value / gain if gain > 1e-13 else math.inf
        part, place = math.inf, -1
        for k in range(size):
            if r[k] > 0.0 and rows[int(active[k]), QP.multiplier] / r[k] < part:
                part, place = rows[int(active[k]), QP.multiplier] / r[k], k
        t = min(full, part)
        if t == math.inf:
            return -1
        _move(rows, x, p, active, size, r, t, n)
        if full <= part:
            active[size] = p
            rows[p, QP.active] = 1.0
            return size + 1
        size = _drop(rows, active, size, place)
    return -1


@kernel
def solve(x, inverse, rows, count, active, low, n):
    """Move x from x0 to the solution; returns False if a hard bound is infeasible.

    Args:
        x: (n,) x0 on entry, the solution on exit.
        inverse: W^-1 in its first n rows and columns.
        rows: (>= count, >= QP.width) bounds, see QP.
        count: number of rows.
        active: (MOST_ACTIVE,) scratch.
        low: (MOST_ACTIVE + 1, MOST_ACTIVE) scratch.
        n: number of coordinates, at most 16.
    """
    _images(rows, count, inverse, n)
    size = 0
    for _ in range(8 * (count + n)):
        p = _most_violated(rows, count, x, n)
        if p < 0:
            return True
        size = _add(rows, x, p, active, size, low, n)
        if size < 0:
            return False
    return False
