"""Compiled detours of a path: where the path is blocked, where a detour starts, where it rejoins the path.

Method reference section 4: trigger, root, candidates for rejoining, retries at another scale, shortcut, and again for
the rest of the path. Every edge of the result has been proven clear exactly once.
"""

from __future__ import annotations

import math

from ..collision.edge_certificates import is_clear, longest_displacement, tool_slack
from ..geometry import screw
from ..jit import inlined, inner, kernel
from .escape_tree import grow_on, plant
from .tree_arrays import DETOUR_LOG, GROWTH, NODE, OPTION

FREE, ESCAPED, START_IN_COLLISION, GOAL_IN_COLLISION, NO_ESCAPE, TOO_LONG, NODE_LIMIT = 0, 1, 2, 3, 4, 5, 6
GUIDED_BLOCKED, PAUSED = 7, 8
"""Status of an escape: the path was clear; detours were found; then the reasons of a failure. NODE_LIMIT: a tree was
stopped while it still had open leaves. GUIDED_BLOCKED: no detour ends before the object is guided along the path.
PAUSED: there is more to do."""
MIN_SLACK = 0.005
"""Least slack [m] of a root and of the pose where a detour rejoins, if an obstacle's own margin fills the shell."""

FAR_AHEAD = 0.5
"""Largest slack [m] that is computed."""


@inlined
def _enough(options):
    """Least slack [m] of a root and of the pose where a detour rejoins the path."""
    return max(options[OPTION.shell] - options[OPTION.largest_margin], MIN_SLACK)


@kernel
def first_blocked(g, path, count, first, options):
    """Return the index of the pose before the first edge that is not clear; -1 if all edges are clear.

    One slack can prove several edges: no edge can reduce it by more than its own displacement.

    Args:
        g: the tool among obstacles, see `tool_arrays`.
        path: (>= count, 8) poses of the tcp.
        count: number of poses.
        first: first edge to check.
        options: see `tree_arrays.OPTION`.
    """
    left = 0.0
    for k in range(first, count - 1):
        x, y = screw.load8(path, k), screw.load8(path, k + 1)
        if options[OPTION.on_shell] == 1.0 and tool_slack(g, y, 1.0) < _enough(options):
            return k
        displacement = longest_displacement(g, x, y)
        if left <= displacement:
            left = tool_slack(g, x, FAR_AHEAD)
        if left <= displacement and not is_clear(g, x, y, options[OPTION.largest_margin]):
            return k
        left -= displacement
    return -1


@inner
def _slacks(g, path, count, slacks, cutoff):
    """Compute the slack [m] at every pose, at most the cutoff."""
    for k in range(count):
        slacks[k] = tool_slack(g, screw.load8(path, k), cutoff)


@inner
def _root(slacks, blocked, enough):
    """Index of the root: back from the blocked edge while the slack is small and still grows."""
    k = blocked
    while k > 0 and slacks[k] < enough and slacks[k - 1] > slacks[k]:
        k -= 1
    return k


@inner
def _candidates(path, slacks, count, blocked, enough, most, places, poses):
    """Write indices and poses behind the blocked stretch where a detour may rejoin the path; returns their number.

    There is room for `most` of them. The first is the first pose with enough slack, then come some later ones, in the
    end the last pose. If none has enough slack, because the goal itself is close to an obstacle, clear poses are taken.
    """
    for wanted in (enough, 0.0):
        size, step = 0, max(1, count // 10)
        k = blocked + 1
        # skip the blocked stretch: poses up to the first that is not clear, then all that are not clear
        for j in range(blocked + 1, count):
            if slacks[j] < 0.0:
                k = j
                break
        while k < count and slacks[k] < wanted:
            k += 1
        while k < count and size < most:
            if slacks[k] >= wanted:
                places[size] = k
                size += 1
                k = count - 1 if size == most - 1 or (k < count - 1 and k + step >= count) else k + step
            else:
                k += 1
        if size > 0:
            break
    for j in range(size):
        screw.store8(poses, j, screw.load8(path, int(places[j])))
    return size


@inner
def _branch(tree, row, poses):
    """Write the poses from the root to a node, in order, into `poses`; returns their number, -1 if they do not fit."""
    count, k = 0, row
    while k >= 0:
        count, k = count + 1, int(tree[k, NODE.parent])
    if count > len(poses):
        return -1
    k, place = row, count
    while k >= 0:
        place -= 1
        screw.store8(poses, place, screw.load8(tree, k))
        k = int(tree[k, NODE.parent])
    return count


@inner
def _shortened(g, poses, count, options):
    """Remove poses of a branch that a clear edge can skip, except the ends; returns the new number."""
    kept, at, widest = 1, 0, options[OPTION.largest_margin]
    while at < count - 1:
        ahead = count - 1
        while ahead > at + 1 and not is_clear(g, screw.load8(poses, at), screw.load8(poses, ahead), widest):
            ahead -= 1
        screw.store8(poses, kept, screw.load8(poses, ahead))
        kept, at = kept + 1, ahead
    return kept


@kernel
def write_edge(out, count, x, y, spacing):
    """Append poses of a screw; returns the new number of poses, -1 if `out` is full.

    Args:
        out: (n, 8) poses.
        count: number of poses in use.
        x: pose at the start, a tuple of 8; it is not appended.
        y: pose at the end, appended exactly.
        spacing: largest path length [m] between poses.
    """
    distance, angle = screw.pose_distance(x, y)
    needed = math.hypot(distance, 0.2 * angle) / spacing - 1e-9
    # written so that what is too large for an integer, or no number, does not fit either
    if not needed <= len(out) - count:
        return -1
    steps = max(1, math.ceil(needed))
    if count + steps > len(out):
        return -1
    same = x[0] == y[0] and x[1] == y[1] and x[2] == y[2] and x[3] == y[3]
    for k in range(1, steps + 1):
        z = y if k == steps else screw.sclerp(x, y, k / steps)
        if same and k < steps:
            z = screw.from_pose(screw.translation(z), (x[0], x[1], x[2], x[3]))
        screw.store8(out, count, z)
        count += 1
    return count


@inner
def _joined(path, count, root, branch, size, back, out, spacing):
    """Join the path up to the root, the branch, and the path from index `back` on.

    Returns:
        (number of poses, index of the pose where the branch rejoins the path); (-1, 0) if `out` is full.
    """
    at = 0
    if root + 1 > len(out):
        return -1, 0
    for k in range(root + 1):
        screw.store8(out, at, screw.load8(path, k))
        at += 1
    for k in range(1, size):
        at = write_edge(out, at, screw.load8(branch, k - 1), screw.load8(branch, k), spacing)
        if at < 0:
            return -1, 0
    if at + count - back - 1 > len(out):
        return -1, 0
    rejoined = at - 1
    for k in range(back + 1, count):
        screw.store8(out, at, screw.load8(path, k))
        at += 1
    return at, rejoined


@inlined
def _most_rows(tree, options):
    return min(len(tree), int(options[OPTION.nodes]))


@inner
def _grown(g, root, candidates, tree, cells, heap, options, state, growth, left):
    """Grow trees at changing scales until one sees a candidate, all have failed, or `left` nodes were added.

    Returns:
        (row, candidate, number of nodes that may still be added); row -1 if no node sees a candidate.
    """
    random, away, most = options[OPTION.random], options[OPTION.away], _most_rows(tree, options)
    while growth[GROWTH.attempt] <= options[OPTION.retries]:
        attempt, scale = int(growth[GROWTH.attempt]), 1.0
        if attempt > 0:
            scale = options[OPTION.shrink] if attempt % 2 == 0 else options[OPTION.grow]
        step = scale * options[OPTION.step]
        if growth[GROWTH.open] < 0.0:
            plant(root, screw.load8(candidates, 0), tree, cells, heap, options, step, growth)
        before = growth[GROWTH.rows]
        options[OPTION.random] = random if attempt > 0 else 0.0
        rows = min(most, before + left)
        row, j = grow_on(g, candidates, tree, cells, heap, options, step, state, growth, rows)
        options[OPTION.random], options[OPTION.away] = random, away
        left -= growth[GROWTH.rows] - before
        if row >= 0:
            return row, j, left
        if growth[GROWTH.open] > 0.0 and growth[GROWTH.rows] < most:
            return -1, -1, left
        if growth[GROWTH.rows] >= most:
            growth[GROWTH.full] = 1.0
        growth[GROWTH.attempt] += 1.0
        growth[GROWTH.open] = -1.0
    return -1, -1, left


@kernel
def last_tree(status, detours, most):
    """Return the row of the log of `escape` that belongs to the last tree: that of the failed detour, if one failed.

    Args:
        status: of the escape.
        detours: number of detours that were found.
        most: number of rows of the log.
    """
    return detours - 1 if status == ESCAPED else min(detours, most - 1)


@kernel
def escape(g, path, count, out, slacks, places, poses, branch, tree, cells, heap, options, state, log, growth, most):
    """Lead a path around obstacles, or go on after a pause.

    Args:
        g: the tool among obstacles, see `edge_certificates.tool_arrays`.
        path: (cap, 8) the path in its first `count` rows; replaced by the result. No more poses are written than the
            shortest of `path`, `out` and `slacks` has room for.
        count: number of poses.
        out: (cap, 8) scratch.
        slacks: (cap,) scratch.
        places: (c,) scratch; no more candidates are written.
        poses: (c, 8) scratch.
        branch: (b, 8) scratch, a pose for each level of a tree and one more.
        tree: see `tree_arrays.tree_arrays`; the last tree is left behind.
        cells: see `tree_arrays.tree_arrays`.
        heap: see `tree_arrays.tree_arrays`.
        options: see `tree_arrays.OPTION`.
        state: (1,) of the random numbers.
        log: (rounds, 3) one row per detour, see `tree_arrays.DETOUR_LOG`.
        growth: see `tree_arrays.GROWTH`; zeros at the beginning, left as it is after a pause.
        most: number of nodes after which to pause.

    Returns:
        (status, number of poses, detours); the status PAUSED if there is more to do: then all else must be left alone.
    """
    room = min(len(path), len(out), len(slacks))
    if growth[GROWTH.count] == 0.0:
        if not 0 < count <= room:
            return TOO_LONG, 0, 0
        if tool_slack(g, screw.load8(path, 0), 1.0) < 0.0:
            return START_IN_COLLISION, count, 0
        if tool_slack(g, screw.load8(path, count - 1), 1.0) < 0.0:
            return GOAL_IN_COLLISION, count, 0
        growth[GROWTH.count] = count
    enough, rounds, left = _enough(options), min(int(options[OPTION.rounds]), len(log)), float(most)
    while growth[GROWTH.detour] < rounds:
        count, detour = int(growth[GROWTH.count]), int(growth[GROWTH.detour])
        if growth[GROWTH.growing] == 0.0 and not _begun(g, path, slacks, places, poses, options, enough, growth):
            return (ESCAPED if detour else FREE), count, detour
        if growth[GROWTH.candidates] == 0.0:
            return GUIDED_BLOCKED, count, detour
        root, size = int(growth[GROWTH.root]), int(growth[GROWTH.candidates])
        row, j, left = _grown(g, path[root], poses[:size], tree, cells, heap, options, state, growth, left)
        log[detour, DETOUR_LOG.tree_rows] = growth[GROWTH.rows]
        if row < 0:
            if growth[GROWTH.attempt] <= options[OPTION.retries]:
                return PAUSED, count, detour
            return (NODE_LIMIT if growth[GROWTH.full] == 1.0 else NO_ESCAPE), count, detour
        length = _branch(tree, row, branch[: len(branch) - 1])
        if length < 0:
            return TOO_LONG, 0, detour
        screw.store8(branch, length, screw.load8(poses, j))
        length += 1
        if options[OPTION.shortcut] == 1.0:
            length = _shortened(g, branch, length, options)
        count, certain = _joined(path, count, root, branch, length, int(places[j]), out[:room], options[OPTION.spacing])
        if count < 0:
            return TOO_LONG, 0, detour
        for k in range(count):
            screw.store8(path, k, screw.load8(out, k))
        log[detour, DETOUR_LOG.first], log[detour, DETOUR_LOG.last] = root, certain
        growth[GROWTH.count], growth[GROWTH.certain], growth[GROWTH.growing] = count, certain, 0.0
        growth[GROWTH.detour] += 1.0
    return NO_ESCAPE, int(growth[GROWTH.count]), rounds


@inner
def _begun(g, path, slacks, places, poses, options, enough, growth):
    """Begin the next detour: its root, and where it may rejoin the path; returns False if no edge is blocked."""
    count, most = int(growth[GROWTH.count]), min(int(options[OPTION.candidates]), len(places), len(poses))
    blocked = first_blocked(g, path, count, int(growth[GROWTH.certain]), options)
    if blocked < 0:
        return False
    _slacks(g, path, count, slacks, enough)
    growth[GROWTH.root], growth[GROWTH.candidates] = _root(slacks, blocked, enough), 0.0
    # where the object is guided no detour may begin or end: that would leave the demonstrated way
    last = count if options[OPTION.guided] <= 0.0 else count - int(options[OPTION.guided]) + 1
    if blocked < last - 1:
        growth[GROWTH.candidates] = _candidates(path, slacks, last, blocked, enough, most, places, poses)
    growth[GROWTH.growing], growth[GROWTH.attempt], growth[GROWTH.full] = 1.0, 0.0, 0.0
    growth[GROWTH.rows], growth[GROWTH.open] = 0.0, -1.0
    return True
