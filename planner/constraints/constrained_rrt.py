"""Compiled search in joint space on a constraint: RRT-Connect whose nodes are moved back to what is kept.

After Berenson, Srinivasa, Ferguson and Kuffner 2009 (CBiRRT). Every edge is proven clear, and certified to keep the
constraint all along. Not in the paper.
"""

from __future__ import annotations

import math

from ..collision.joint_lines import joint_edge_is_clear
from ..collision.robot_arrays import MAX_JOINTS, ROW
from ..escape.tangent_plane import random_number
from ..jit import inner, kernel
from .held_directions import KEPT, largest_deviation, restore

PROGRESS = 0.1
"""Share of a step by which a node must be nearer to its target than its parent."""
FULL, OUT_OF_SAMPLES = -1, 0
"""Outcomes without a path: a tree has no room left; the samples of this slice are used up."""


@inner
def _distance(a, b, n):
    s = 0.0
    for i in range(n):
        s += (a[i] - b[i]) ** 2
    return math.sqrt(s)


@inner
def _nearest(tree, count, q, n):
    best, least = 0, math.inf
    for k in range(count):
        d = _distance(tree[k], q, n)
        if d < least:
            best, least = k, d
    return best, least


@inner
def _edge_is_good(g, work, kept, start, end):
    """True if the line between joints keeps the constraint and is proven clear."""
    n, bound = len(start), kept[0, KEPT.bound]
    q = g[ROW.after, MAX_JOINTS : MAX_JOINTS + n]
    if not largest_deviation(work, kept, start, end, bound, q) <= bound:
        return False
    return joint_edge_is_clear(g, start, end)


@inner
def _extend(g, work, kept, tree, parents, count, target, step, greedy, n):
    """Grow a tree towards a target: (new count, last row, True if the target was reached)."""
    near, distance = _nearest(tree, count, target, n)
    if distance < 1e-9:
        return count, near, True
    while count < len(tree):
        part = min(1.0, step / distance)
        for i in range(n):
            tree[count, i] = tree[near, i] + part * (target[i] - tree[near, i]) if part < 1.0 else target[i]
        if part < 1.0 and not restore(work, kept, tree[count, :n]):
            return count, near, False
        left = _distance(tree[count], target, n)
        if part < 1.0 and left > distance - PROGRESS * step:
            return count, near, False
        if not _edge_is_good(g, work, kept, tree[near, :n], tree[count, :n]):
            return count, near, False
        parents[count] = near
        near, distance, count = count, left, count + 1
        if part == 1.0:
            return count, near, True
        if not greedy:
            return count, near, False
    return count, near, False


@inner
def _read_branch(tree, parents, row, out, at, back, n):
    """Write the branch of a node into `out` from row `at` on, from its root or back to it; returns the next row."""
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


@kernel
def connect_keeping(g, work, kept, low, high, trees, parents, counts, first, iterations, step, state, out):
    """Search a way between two trees that keeps a constraint, for a number of samples; call it again to go on.

    Args:
        g: the robot among obstacles, see `robot_arrays`.
        work: array of the arm, see `arm_arrays`.
        kept: see `packed_constraint`.
        low: (n,) least sampled joints [rad or m].
        high: (n,) largest sampled joints.
        trees: (2, m, n) nodes; the roots are its first rows: the start, and all ends.
        parents: (2, m) rows of the parents; -1 for a root.
        counts: (2,) numbers of nodes, kept between calls.
        first: number of samples that were taken before.
        iterations: number of samples of this call.
        step: length of the longest edge [rad or m].
        state: (1,) of the random numbers.
        out: (>= 2 m, n) points of the way, the result.

    Returns:
        The number of points of the way; OUT_OF_SAMPLES or FULL if none was found.
    """
    n = trees.shape[2]
    sample = g[ROW.part, MAX_JOINTS : MAX_JOINTS + n]
    for k in range(first, first + iterations):
        a, b = (0, 1) if k % 2 == 0 else (1, 0)
        for i in range(n):
            sample[i] = low[i] + random_number(state) * (high[i] - low[i])
        if k < 2:
            for i in range(n):
                sample[i] = trees[b, 0, i]
        elif not restore(work, kept, sample):
            continue
        before = int(counts[a])
        count, row, _ = _extend(g, work, kept, trees[a], parents[a], before, sample, step, True, n)
        counts[a] = count
        if count >= len(trees[a]):
            return FULL
        if count == before:
            continue
        for i in range(n):
            sample[i] = trees[a, row, i]
        count, other, met = _extend(g, work, kept, trees[b], parents[b], int(counts[b]), sample, step, True, n)
        counts[b] = count
        if met:
            rows = (row, other) if a == 0 else (other, row)
            at = _read_branch(trees[0], parents[0], rows[0], out, 0, False, n)
            # the two trees share the point where they meet
            return _read_branch(trees[1], parents[1], rows[1], out, at - 1, True, n)
        if count >= len(trees[b]):
            return FULL
    return OUT_OF_SAMPLES


@kernel
def shorten_keeping(g, work, kept, path, count, tries, state, ends):
    """Replace stretches of a joint path by lines that keep the constraint and are clear, between random points of it.

    Args:
        g: the robot among obstacles, see `robot_arrays`.
        work: array of the arm, see `arm_arrays`.
        kept: see `packed_constraint`.
        path: (m, n) joints, the path in the first `count` rows; changed in place.
        count: number of its points.
        tries: number of lines to try.
        state: (1,) of the random numbers.
        ends: (2, n) scratch.

    Returns:
        The new number of points.
    """
    n = path.shape[1]
    for _ in range(tries):
        if count < 3 or count + 1 >= len(path):
            break
        s, t = random_number(state) * (count - 1), random_number(state) * (count - 1)
        s, t = min(s, t), max(s, t)
        i, j = int(s), int(t)
        if i == j:
            continue
        for d in range(n):
            ends[0, d] = path[i, d] + (s - i) * (path[i + 1, d] - path[i, d])
            ends[1, d] = path[j, d] + (t - j) * (path[j + 1, d] - path[j, d])
        if not _edge_is_good(g, work, kept, ends[0], ends[1]):
            continue
        left = count - (j + 1)
        if j + 1 < i + 3:
            for m in range(left - 1, -1, -1):
                for d in range(n):
                    path[i + 3 + m, d] = path[j + 1 + m, d]
        else:
            for m in range(left):
                for d in range(n):
                    path[i + 3 + m, d] = path[j + 1 + m, d]
        for d in range(n):
            path[i + 1, d], path[i + 2, d] = ends[0, d], ends[1, d]
        count = i + 3 + left
    return count
