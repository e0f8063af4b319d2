"""Compiled 6 x 6 linear algebra on rows of a packed array: nothing is allocated."""

from __future__ import annotations

import math

from ..jit import kernel


@kernel
def gram(m, row, n, out, out_row):
    """Compute `M M^T` of six rows.

    Args:
        m: array with M.
        row: first of the six rows of M.
        n: number of columns of M.
        out: array for the result.
        out_row: first of its six rows.
    """
    for i in range(6):
        for j in range(i + 1):
            s = 0.0
            for k in range(n):
                s += m[row + i, k] * m[row + j, k]
            out[out_row + i, j] = s
            out[out_row + j, i] = s


@kernel
def cholesky(a, row, shift, low, low_row):
    """Compute the lower Cholesky factor of `A + shift I`; returns False if a pivot is not positive up to rounding.

    Args:
        a: array with A.
        row: first of the six rows of A.
        shift: number added to the diagonal.
        low: array for the result.
        low_row: first of its six rows.
    """
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
    """Compute `L^-1 b` in place.

    Args:
        low: array with the lower factor L.
        row: first of its six rows.
        b: (>= 6,) six numbers.
    """
    for i in range(6):
        s = b[i]
        for k in range(i):
            s -= low[row + i, k] * b[k]
        b[i] = s / low[row + i, i]


@kernel
def backward_solve(low, row, b):
    """Compute `L^-T b` in place.

    Args:
        low: array with the lower factor L.
        row: first of its six rows.
        b: (>= 6,) six numbers.
    """
    for j in range(6):
        i = 5 - j
        s = b[i]
        for k in range(i + 1, 6):
            s -= low[row + k, i] * b[k]
        b[i] = s / low[row + i, i]


@kernel
def smallest_singular_bound(low, row, b):
    """Return a lower bound of the sixth singular value of M from the factor of `M M^T`: `1 / |M^+|_F`.

    The bound lies between sigma_6 / sqrt(6) and sigma_6, and equals sigma_6 near a singularity; no SVD is needed.

    Args:
        low: array with the lower factor of `M M^T`.
        row: first of its six rows.
        b: (>= 6,) scratch.
    """
    total = 0.0
    for j in range(6):
        # column j of the inverse factor, zero above its diagonal
        b[j] = 1.0 / low[row + j, j]
        total += b[j] * b[j]
        for i in range(j + 1, 6):
            s = 0.0
            for k in range(j, i):
                s -= low[row + i, k] * b[k]
            b[i] = s / low[row + i, i]
            total += b[i] * b[i]
    return 1.0 / math.sqrt(total)
