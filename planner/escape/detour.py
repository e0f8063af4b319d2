"""Compiled detours of a path: where is it blocked, where does the escape start, where does it come back.

Method reference section 4: trigger, root, candidates for coming back, retries at another scale, shortcut, and again
for the rest of the path. Every edge of what comes out has been proven clear exactly once.
"""

from __future__ import annotations

import math

from ..collision.edge_certificates import is_clear, longest_displacement, tool_slack
from ..geometry import screw
from ..jit import inner, kernel
from .escape_tree import (
    AWAY,
    CANDIDATES,
    GROW,
    MOST,
    ON_SHELL,
    PARENT,
    RANDOM,
    RETRIES,
    ROUNDS,
    SHELL,
    SHORTCUT,
    SHRINK,
    SPACING,
    STEP,
    WIDEST,
    grow,
)

FREE, ESCAPED, START_IN_COLLISION, GOAL_IN_COLLISION, NO_ESCAPE, TOO_LONG, NODE_LIMIT = 0, 1, 2, 3, 4, 5, 6
"""The path was clear; detours were found; why not. NODE_LIMIT: a tree was stopped while it still had leaves."""
MIN_SLACK = 0.005
"""Room [m] that a root and the way back have at least, where an obstacle's own margin fills the shell."""

FAR_AHEAD = 0.5
"""Room [m] beyond which it does not matter how much there is."""


@kernel
def first_blocked(g, path, count, first, options):
    """Index of the pose before the first edge that is not clear, from `first` on; -1 if all are.

    Where there is room, one look at it proves several edges: none of them can use up more of it than its way.
    """
    left = 0.0
    for k in range(first, count - 1):
        x, y = screw.load8(path, k), screw.load8(path, k + 1)
        if options[ON_SHELL] == 1.0 and tool_slack(g, y, 1.0) < max(options[SHELL] - options[WIDEST], MIN_SLACK):
            return k
        displacement = longest_displacement(g, x, y)
        if left <= displacement:
            left = tool_slack(g, x, FAR_AHEAD)
        if left <= displacement and not is_clear(g, x, y, options[WIDEST]):
            return k
        left -= displacement
    return -1


@inner
def _slacks(g, path, count, slacks, cutoff):
    """Room [m] at every pose, up to the cutoff."""
    for k in range(count):
        slacks[k] = tool_slack(g, screw.load8(path, k), cutoff)


@inner
def _root(slacks, blocked, enough):
    """The pose that the tree starts from: back from the blocked edge while the room is small and still grows."""
    k = blocked
    while k > 0 and slacks[k] < enough and slacks[k - 1] > slacks[k]:
        k -= 1
    return k


@inner
def _candidates(path, slacks, count, blocked, enough, most, places, poses):
    """Poses behind the blocked stretch at which the path may go on: their number; indices and poses are written.

    The first with enough room, then some later ones, the last pose in the end. Where none has enough, because the
    goal itself is close to an obstacle, those that are clear at all.
    """
    for wanted in (enough, 0.0):
        size, step = 0, max(1, count // 10)
        k = blocked + 1
        # the blocked stretch: the first pose that is not clear, if there is one, then all that are not
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
    """Poses from the root to a node, in order, into `poses`; their number."""
    count, k = 0, row
    while k >= 0:
        count, k = count + 1, int(tree[k, PARENT])
    k, place = row, count
    while k >= 0:
        place -= 1
        screw.store8(poses, place, screw.load8(tree, k))
        k = int(tree[k, PARENT])
    return count


@inner
def _shortened(g, poses, count, options):
    """Leave out poses of a branch that can be jumped over clear; the new number. The ends stay."""
    kept, at = 1, 0
    while at < count - 1:
        ahead = count - 1
        while ahead > at + 1 and not is_clear(g, screw.load8(poses, at), screw.load8(poses, ahead), options[WIDEST]):
            ahead -= 1
        screw.store8(poses, kept, screw.load8(poses, ahead))
        kept, at = kept + 1, ahead
    return kept


@kernel
def write_edge(out, count, x, y, spacing):
    """Append poses from x (excluded) to y (included) at most `spacing` apart; the new number, -1 if out is full."""
    distance, angle = screw.pose_distance(x, y)
    steps = max(1, math.ceil(math.hypot(distance, 0.2 * angle) / spacing - 1e-9))
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
    """The path up to the root, the branch, the path from index `back` on: (number of poses, where the last starts)."""
    at = 0
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


@inner
def _grown(g, root, candidates, tree, cells, heap, options, state):
    """Grow trees at changing scales until one gets home: (row, candidate, rows of the last, True if one was full)."""
    random, away = options[RANDOM], options[AWAY]
    row, j, count, full = -1, -1, 0, False
    for attempt in range(int(options[RETRIES]) + 1):
        scale = 1.0
        if attempt > 0:
            scale = options[SHRINK] if attempt % 2 == 0 else options[GROW]
        options[RANDOM] = random if attempt > 0 else 0.0
        row, j, count = grow(g, root, candidates, tree, cells, heap, options, scale * options[STEP], state)
        if row >= 0:
            break
        full |= count >= min(len(tree), int(options[MOST]))
    options[RANDOM], options[AWAY] = random, away
    return row, j, count, full


@kernel
def last_tree(status, detours, most):
    """Row of the log of `escape` that tells of the tree left behind: that of the failed detour, if one failed."""
    return detours - 1 if status == ESCAPED else min(detours, most - 1)


@kernel
def escape(g, path, count, out, slacks, places, poses, branch, tree, cells, heap, options, state, log):
    """Lead a path round obstacles.

    Args:
        g: the tool among obstacles, see `edges.tool_arrays`.
        path: (cap, 8) the path in its first `count` rows; replaced by the result.
        count: number of poses.
        out: (cap, 8) scratch.
        slacks: (cap,) scratch.
        places: (c,) scratch.
        poses: (c, 8) scratch.
        branch: (b, 8) scratch.
        tree: see `escape_tree.tree_arrays`; the last tree is left behind.
        cells: same.
        heap: same.
        options: see `repet.RepetSettings`.
        state: (1,) of the random numbers.
        log: (ROUNDS, 4) per detour: rows of its tree, first and last index of the detour in the path, retries.

    Returns:
        (status, number of poses, detours).
    """
    if tool_slack(g, screw.load8(path, 0), 1.0) < 0.0:
        return START_IN_COLLISION, count, 0
    if tool_slack(g, screw.load8(path, count - 1), 1.0) < 0.0:
        return GOAL_IN_COLLISION, count, 0
    certain, enough = 0, max(options[SHELL] - options[WIDEST], MIN_SLACK)
    for detour in range(int(options[ROUNDS])):
        blocked = first_blocked(g, path, count, certain, options)
        if blocked < 0:
            return (ESCAPED if detour else FREE), count, detour
        _slacks(g, path, count, slacks, enough)
        root = _root(slacks, blocked, enough)
        size = _candidates(path, slacks, count, blocked, enough, int(options[CANDIDATES]), places, poses)
        row, j, rows, full = _grown(g, path[root], poses[:size], tree, cells, heap, options, state)
        log[detour, 0] = rows
        if row < 0:
            return (NODE_LIMIT if full else NO_ESCAPE), count, detour
        length = _branch(tree, row, branch)
        screw.store8(branch, length, screw.load8(poses, j))
        length += 1
        if options[SHORTCUT] == 1.0:
            length = _shortened(g, branch, length, options)
        count, certain = _joined(path, count, root, branch, length, int(places[j]), out, options[SPACING])
        if count < 0:
            return TOO_LONG, 0, detour
        for k in range(count):
            screw.store8(path, k, screw.load8(out, k))
        log[detour, 1], log[detour, 2] = root, certain
    return NO_ESCAPE, count, int(options[ROUNDS])
