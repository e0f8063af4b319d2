"""A small quadratic program in a workspace: the nearest joint speeds that keep linear bounds.

Minimizes `(x - x0)^T W (x - x0) / 2 + sum s_i^2 / (2 SLACK)` under `a_i . x + s_i >= b_i`, where only soft rows have
a slack `s_i`, by the dual active-set method of Goldfarb and Idnani (1983). It starts from x0 and adds one violated
bound at a time, so it costs nothing where nothing is violated; the slack gives an answer also where the bounds
contradict each other. Nothing is allocated.

A row holds, from column 0 on: a (16), W^-1 a (16), b, softness (SLACK or 0), multiplier, 1 if active.
"""

from __future__ import annotations

import math

from ..jit import inner, kernel

SLACK = 1e-7
"""Softness of a soft row: a multiplier of 1 gives way by this much."""
IMAGE, BOUND, SOFTNESS, MULTIPLIER, ACTIVE, WIDTH = 16, 32, 33, 34, 35, 36
MOST_ACTIVE = 30
TOLERANCE = 1e-10


@kernel
def inverse_weight(weight, n):
    """Replace the positive definite n x n matrix in the first rows by its inverse (Cholesky, in place)."""
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
    """`W^-1 a` of every row; no row is active."""
    for k in range(count):
        rows[k, MULTIPLIER] = 0.0
        rows[k, ACTIVE] = 0.0
        for i in range(n):
            s = 0.0
            for j in range(n):
                s += inverse[i, j] * rows[k, j]
            rows[k, IMAGE + i] = s


@inner
def _most_violated(rows, count, x, n):
    """The row that is violated most, relative to its length; -1 if none is."""
    worst, most = -1, -TOLERANCE
    for k in range(count):
        if rows[k, ACTIVE] == 0.0:
            value = -rows[k, BOUND]
            for i in range(n):
                value += rows[k, i] * x[i]
            if value < most:
                worst, most = k, value
    return worst


@kernel
def all_hold(rows, count, x, n):
    """True if x violates no row: then `solve` would leave it as it is, and needs no W for it."""
    for k in range(count):
        value = -rows[k, BOUND]
        for i in range(n):
            value += rows[k, i] * x[i]
        if value < -TOLERANCE:
            return False
    return True


@inner
def _inner(rows, i, j, n):
    """`a_i^T W^-1 a_j`, with the slack's share."""
    s = rows[i, SOFTNESS] if i == j else 0.0
    for k in range(n):
        s += rows[i, k] * rows[j, IMAGE + k]
    return s


@inner
def _directions(rows, p, active, size, low, n):
    """Change r of the active multipliers per unit of row p's, into row MOST_ACTIVE of `low`; False if dependent.

    Solves `(N^T H N) r = N^T H a_p` by Cholesky.
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
    """Take a row out of the active set; returns the new size."""
    rows[int(active[place]), ACTIVE] = 0.0
    rows[int(active[place]), MULTIPLIER] = 0.0
    for k in range(place, size - 1):
        active[k] = active[k + 1]
    return size - 1


@inner
def _move(rows, x, p, active, size, r, t, n):
    """Go the length t: multipliers and x; the row p takes part with its own multiplier."""
    for k in range(size):
        rows[int(active[k]), MULTIPLIER] -= t * r[k]
    rows[p, MULTIPLIER] += t
    for i in range(n):
        z = rows[p, IMAGE + i]
        for k in range(size):
            z -= r[k] * rows[int(active[k]), IMAGE + i]
        x[i] += t * z


@inner
def _add(rows, x, p, active, size, low, n):
    """Make row p hold, dropping active rows that stand in the way; the new size, or -1 if it cannot hold."""
    r = low[MOST_ACTIVE]
    for _ in range(4 * MOST_ACTIVE):
        if size == MOST_ACTIVE or not _directions(rows, p, active, size, low, n):
            return -1
        value, gain = rows[p, SOFTNESS] * rows[p, MULTIPLIER] - rows[p, BOUND], _inner(rows, p, p, n)
        for i in range(n):
            value += rows[p, i] * x[i]
        for k in range(size):
            gain -= r[k] * _inner(rows, int(active[k]), p, n)
        full = -value / gain if gain > 1e-13 else math.inf
        part, place = math.inf, -1
        for k in range(size):
            if r[k] > 0.0 and rows[int(active[k]), MULTIPLIER] / r[k] < part:
                part, place = rows[int(active[k]), MULTIPLIER] / r[k], k
        t = min(full, part)
        if t == math.inf:
            return -1
        _move(rows, x, p, active, size, r, t, n)
        if full <= part:
            active[size] = p
            rows[p, ACTIVE] = 1.0
            return size + 1
        size = _drop(rows, active, size, place)
    return -1


@kernel
def solve(x, inverse, rows, count, active, low, n):
    """Move x, which holds x0, to the solution; False if a hard bound could not be met.

    Args:
        x: (n,) x0 on entry, the solution on exit.
        inverse: W^-1 in its first n rows and columns.
        rows: bounds, see the module.
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
