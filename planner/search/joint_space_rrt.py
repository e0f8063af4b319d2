"""Compiled search in joint space (RRT-Connect, Kuffner and LaValle 2000) with edges that are proven clear.

It finds motions where the tool has a clear path, but the arm cannot follow it. Not in the paper.
"""

from __future__ import annotations

import math

import numpy as np

from ..collision.joint_lines import joint_edge_is_clear
from ..collision.robot_arrays import MAX_JOINTS, ROW
from ..escape.tangent_plane import random_number
from ..jit import inlined, inner, kernel

MIN_SAVING = 0.02
"""Length [rad] that a shortcut must save: most of the time of a search went into proofs that saved nothing."""


@inner
def _distance(a, b):
    s = 0.0
    for i in range(len(a)):
        s += (a[i] - b[i]) ** 2
    return math.sqrt(s)


@inner
def _nearest(tree, count, q):
    best, least = 0, math.inf
    for k in range(count):
        d = _distance(tree[k, : len(q)], q)
        if d < least:
            best, least = k, d
    return best


@inner
def _extend(g, tree, parents, count, q, step, greedy):
    """Grow a tree towards q by one step, or by as many as are clear: (new count, True if q was reached)."""
    n, near = len(q), _nearest(tree, count, q)
    while count < len(tree):
        d = _distance(tree[near, :n], q)
        part = min(1.0, step / max(d, 1e-12))
        for i in range(n):
            tree[count, i] = tree[near, i] + part * (q[i] - tree[near, i]) if part < 1.0 else q[i]
        if not joint_edge_is_clear(g, tree[near, :n], tree[count, :n]):
            return count, False
        parents[count] = near
        near, count = count, count + 1
        if part == 1.0:
            return count, True
        if not greedy:
            return count, False
    return count, False


@inner
def _read_branch(tree, parents, row, out, at, back, n):
    """Write the branch of a node into `out` from row `at` on, from the root or back to it; returns the next row."""
    count, k = 0, row
    while k >= 0:
        count, k = count + 1, int(parents[k])
    k = row
    for i in range(count):
        place = at + i if back else at + count - 1 - i
        for j in range(n):
            out[place, j] = tree[k, j]
        k = int(parents[k])
    return at + count


@inlined
def sample_range(lower, upper, around):
    """Ends of the range in which a joint is sampled: its limits, or one turn within them where they are wider.

    Args:
        lower: limit [rad or m].
        upper: limit.
        around: joint about which a range of one turn lies.
    """
    low = min(max(around - math.pi, lower), max(lower, upper - 2.0 * math.pi))
    return low, min(upper, low + 2.0 * math.pi)


def sample_ranges(lower: np.ndarray, upper: np.ndarray, around: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the ends of the ranges in which joints are sampled: all their limits allow, but no turn twice.

    Args:
        lower: (n,) lower joint limits [rad or m].
        upper: (n,) upper joint limits.
        around: (n,) joints about which a range of one turn lies.
    """
    low, high = np.transpose([sample_range(*each) for each in zip(lower, upper, around, strict=True)])
    return low, high


@kernel
def connect(g, start, goal, trees, parents, step, first, last, counts, state, out):
    """Search a clear path in joint space, or go on after a pause.

    Args:
        g: the robot among obstacles, see `robot_arrays`.
        start: (n,) joints [rad or m], the first point.
        goal: (n,) joints, the last point.
        trees: (2, m, n) scratch, left as it is after a pause.
        parents: (2, m) scratch.
        step: length of the longest edge [rad or m].
        first: number of samples so far; 0: begin.
        last: number of samples after which to pause.
        counts: (2,) int64, numbers of nodes.
        state: (1,) of the random numbers.
        out: (>= 2 m, n) points of the path, the result.

    Returns:
        The number of points of the path; 0 if none was found so far, -1 if the trees are full.
    """
    n = len(start)
    if first == 0:
        for i in range(n):
            trees[0, 0, i], trees[1, 0, i] = start[i], goal[i]
        parents[0, 0] = parents[1, 0] = -1
        counts[:] = 1
    sample = g[ROW.part, MAX_JOINTS : MAX_JOINTS + n]
    for k in range(first, last):
        a, b = (0, 1) if k % 2 == 0 else (1, 0)
        for i in range(n):
            low, high = sample_range(g[ROW.lower, i], g[ROW.upper, i], 0.5 * (start[i] + goal[i]))
            low, high = min(low, start[i], goal[i]), max(high, start[i], goal[i])
            sample[i] = low + random_number(state) * (high - low)
        if k < 2:
            for i in range(n):
                sample[i] = trees[b, 0, i]
        before = counts[a]
        counts[a] = _extend(g, trees[a], parents[a], before, sample, step, k < 2)[0]
        if counts[a] == before:
            continue
        if counts[a] == len(trees[a]) or counts[b] == len(trees[b]):
            return -1
        target = trees[a, counts[a] - 1]
        counts[b], met = _extend(g, trees[b], parents[b], counts[b], target, step, True)
        if met:
            at = _read_branch(trees[0], parents[0], counts[0] - 1, out, 0, False, n)
            # the two trees share the point where they meet
            return _read_branch(trees[1], parents[1], counts[1] - 1, out, at - 1, True, n)
    return 0


@inner
def _on_edge(path, k, s, out):
    """The point at fraction s between points k and k + 1 of a path."""
    for d in range(path.shape[1]):
        out[d] = path[k, d] + s * (path[k + 1, d] - path[k, d])


@inner
def _moved(path, first, count, to):
    """Move the points from `first` to the end so that they begin at row `to`; the new number of points."""
    n = count - first
    for m in range(n):
        k = m if to < first else n - 1 - m
        for d in range(path.shape[1]):
            path[to + k, d] = path[first + k, d]
    return to + n


@inlined
def _length(a, b):
    """Length [rad] of a line, by the joint that moves most."""
    longest = 0.0
    for d in range(len(a)):
        longest = max(longest, abs(b[d] - a[d]))
    return longest


@inner
def _saved(path, i, j, ends):
    """Length [rad] that a line between two points of a path saves; they lie behind its points i and j."""
    length = _length(ends[0], path[i + 1]) + _length(path[j], ends[1])
    for k in range(i + 1, j):
        length += _length(path[k], path[k + 1])
    return length - _length(ends[0], ends[1])


@kernel
def shortcut(g, path, count, tries, state, ends):
    """Replace stretches of a joint path by clear straight lines between random points of the path.

    Args:
        g: the robot among obstacles, see `robot_arrays`.
        path: (m, n) joints, the path in the first `count` rows; changed in place.
        count: number of its points.
        tries: number of lines to try; those that would save less than `MIN_SAVING` are not.
        state: (1,) of the random numbers.
        ends: (2, n) scratch.

    Returns:
        The new number of points.
    """
    for _ in range(tries):
        if count < 3 or count + 1 >= len(path):
            break
        s, t = random_number(state) * (count - 1), random_number(state) * (count - 1)
        s, t = min(s, t), max(s, t)
        i, j = int(s), int(t)
        if i == j:
            continue
        _on_edge(path, i, s - i, ends[0])
        _on_edge(path, j, t - j, ends[1])
        if _saved(path, i, j, ends) >= MIN_SAVING and joint_edge_is_clear(g, ends[0], ends[1]):
            count = _moved(path, j + 1, count, i + 3)
            for d in range(path.shape[1]):
                path[i + 1, d], path[i + 2, d] = ends[0, d], ends[1, d]
    return count
