"""Compiled 6 x 6 linear algebra on rows of a workspace: nothing is allocated."""

from __future__ import annotations

import math

from ..jit import kernel


@kernel
def gram(m, row, n, out, out_row):
    """`M M^T` of the six rows of m from `row` on, n columns wide."""
    for i in range(6):
        for j in range(i + 1):
            s = 0.0
            for k in range(n):
                s += m[row + i, k] * m[row + j, k]
            out[out_row + i, j] = s
            out[out_row + j, i] = s


@kernel
def cholesky(a, row, shift, low, low_row):
    """Lower factor of `A + shift I`; False where a pivot is not positive up to rounding."""
    for j in range(6):
        s = a[row + j, j] + shift
        scale = s
        for k in range(j):
            s -= low[low_row + j, k] * low[low_row + j, k]
        if s <= 1e-15 * scale or s <= 0.0:
            return False
        pivot = math.sqrt(s)
        low[low_row + j, j] = pivot
        for i in range(j + 1, 6):
            s = a[row + i, j]
            for k in range(j):
                s -= low[low_row + i, k] * low[low_row + j, k]
            low[low_row + i, j] = s / pivot
    return True


@kernel
def forward_solve(low, row, b):
    """`L^-1 b` of six numbers, in place."""
    for i in range(6):
        s = b[i]
        for k in range(i):
            s -= low[row + i, k] * b[k]
        b[i] = s / low[row + i, i]


@kernel
def backward_solve(low, row, b):
    """`L^-T b` of six numbers, in place."""
    for j in range(6):
        i = 5 - j
        s = b[i]
        for k in range(i + 1, 6):
            s -= low[row + k, i] * b[k]
        b[i] = s / low[row + i, i]


@kernel
def smallest_singular_bound(low, row, b):
    """Lower bound of the sixth singular value of M from the factor of `M M^T`: `1 / |M^+|_F`.

    Between sigma_6 / sqrt(6) and sigma_6, and equal to it near a singularity, without an SVD.
    """
    total = 0.0
    for j in range(6):
        # column j of the inverse factor, which is zero above its diagonal
        b[j] = 1.0 / low[row + j, j]
        total += b[j] * b[j]
        for i in range(j + 1, 6):
            s = 0.0
            for k in range(j, i):
                s -= low[row + i, k] * b[k]
            b[i] = s / low[row + i, i]
            total += b[i] * b[i]
    return 1.0 / math.sqrt(total)
