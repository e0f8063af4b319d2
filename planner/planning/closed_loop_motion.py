"""A leg of a task in one compiled call: imitate, blend, lead round obstacles, follow with the whole arm kept clear."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..escape.detour import ESCAPED, escape, last_tree, write_edge
from ..escape.escape_tree import tree_arrays
from ..escape.repet import RepetSettings
from ..geometry import screw
from ..geometry.pose import METERS_PER_RADIAN
from ..jit import inner, kernel
from ..safety.guarded_pursuit import guarded_roll_out

IMITATED, GUIDE, FULL, FOLLOWED, LAST, CHANGED, DETOURS, TREE_ROWS = range(8)
"""What `plan_closed_loop` writes into `counts`: length of the imitated path, guide, length of the path, of the one
followed, last row of the trace, ticks changed by the safety layer, detours, rows of the last tree."""


class Buffers(NamedTuple):
    """Arrays that a leg is planned in; made once, used again."""

    imitated: np.ndarray
    path: np.ndarray
    followed: np.ndarray
    spare: np.ndarray
    slacks: np.ndarray
    places: np.ndarray
    poses: np.ndarray
    branch: np.ndarray
    tree: np.ndarray
    cells: np.ndarray
    heap: np.ndarray
    options: np.ndarray
    state: np.ndarray
    log: np.ndarray
    trace: np.ndarray
    counts: np.ndarray


def buffers(settings: RepetSettings, dof: int, ticks: int) -> Buffers:
    """Arrays for legs of an arm with so many joints and at most so many ticks."""
    tree, cells, heap = tree_arrays(settings.nodes, settings.levels)
    return Buffers(
        imitated=np.zeros((settings.longest, 8)),
        path=np.zeros((settings.longest, 8)),
        followed=np.zeros((settings.longest, 8)),
        spare=np.zeros((settings.longest, 8)),
        slacks=np.zeros(settings.longest),
        places=np.zeros(settings.candidates),
        poses=np.zeros((settings.candidates, 8)),
        branch=np.zeros((settings.levels + 3, 8)),
        tree=tree,
        cells=cells,
        heap=heap,
        options=settings.packed(),
        state=np.ones(1),
        log=np.zeros((settings.rounds, 4)),
        trace=np.zeros((ticks + 1, dof)),
        counts=np.zeros(8, dtype=np.int64),
    )


@inner
def _imitated(demo, goal, out):
    """The demonstration moved so that it ends at the goal, signs continuous; `tsia.imitated_path`."""
    n = len(demo)
    moved = screw.mul(goal, screw.conj(screw.load8(demo, n - 1)))
    for k in range(n):
        x = goal if k == n - 1 else screw.mul(moved, screw.load8(demo, k))
        if k > 0:
            y = screw.load8(out, k - 1)
            if x[0] * y[0] + x[1] * y[1] + x[2] * y[2] + x[3] * y[3] < 0.0:
                x = screw.neg(x)
        screw.store8(out, k, x)


@inner
def _guide(path, n, fraction):
    """Index at which so much of the screw length is behind; `tsia.guide_index`."""
    total = 0.0
    for k in range(1, n):
        distance, angle = screw.pose_distance(screw.load8(path, k - 1), screw.load8(path, k))
        total += math.hypot(distance, METERS_PER_RADIAN * angle)
    if total == 0.0:
        return n - 1
    length = 0.0
    for k in range(1, n):
        distance, angle = screw.pose_distance(screw.load8(path, k - 1), screw.load8(path, k))
        length += math.hypot(distance, METERS_PER_RADIAN * angle)
        if length >= fraction * total:
            return k
    return n - 1


@inner
def _copied(source, first, last, out, at):
    for k in range(first, last):
        screw.store8(out, at, screw.load8(source, k))
        at += 1
    return at


@kernel
def plan_closed_loop(work, g, tool, demo, goal, lead, q, fraction, spacing, dt, b, pursuit_state, wish, out):
    """Plan a leg: the joints of every tick are left in the trace.

    Args:
        work: arm, controller and pursuit, see `workspace`.
        g: the arm among obstacles, see `robot_arrays`.
        tool: the tool among obstacles, see `edges.tool_arrays`.
        demo: (n, 8) demonstrated segment.
        goal: (8,) pose to end at.
        lead: (m, 8) how to leave, from the pose at q on; at least that pose.
        q: (dof,) joints at the start, moved to the end.
        fraction: of the imitated path, where the guiding pose is.
        spacing: screw length [m] between poses of the blend.
        dt: seconds per tick.
        b: see `Buffers`.
        pursuit_state: (4,) of the pursuit.
        wish: (dof,) scratch.
        out: (dof,) scratch.

    Returns:
        (status of the escape, status of the pursuit, smallest joint margin [rad]).
    """
    n, counts = len(demo), b.counts
    _imitated(demo, (goal[0], goal[1], goal[2], goal[3], goal[4], goal[5], goal[6], goal[7]), b.imitated)
    guide = _guide(b.imitated, n, fraction) if n > 1 else 0
    at = _copied(lead, 0, len(lead), b.path, 0)
    at = write_edge(b.path, at, screw.load8(lead, len(lead) - 1), screw.load8(b.imitated, guide), spacing)
    full = _copied(b.imitated, guide + 1, n, b.path, at) if at > 0 else 0
    counts[IMITATED], counts[GUIDE], counts[LAST], counts[CHANGED] = n, guide, 0, 0
    if full == 0:
        return -1, 0, -math.inf
    b.log[:] = 0.0
    status, full, counts[DETOURS] = escape(
        tool, b.path, full, b.spare, b.slacks, b.places, b.poses, b.branch, b.tree, b.cells, b.heap, b.options,
        b.state, b.log,
    )  # fmt: skip
    counts[FULL], counts[TREE_ROWS] = full, b.log[last_tree(status, counts[DETOURS], len(b.log)), 0]
    if status == ESCAPED:
        followed = _copied(b.path, 0, full, b.followed, 0)
    else:
        # nothing is resampled where nothing is in the way: the pull to the guiding pose is the blend
        followed = _copied(lead, 1, len(lead), b.followed, 0)
        followed = _copied(b.imitated, guide, n, b.followed, followed)
    counts[FOLLOWED] = followed
    pursuit_state[0], pursuit_state[1], pursuit_state[2], pursuit_state[3] = 0.0, 0.0, np.inf, 0.0
    pursuit, last, margin, changed = guarded_roll_out(
        work, g, b.followed[:followed], q, dt, pursuit_state, wish, out, b.trace, 0
    )
    counts[LAST], counts[CHANGED] = last, changed
    return status, pursuit, margin
