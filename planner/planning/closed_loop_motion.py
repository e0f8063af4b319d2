"""A motion in compiled slices: imitate, blend, detour round obstacles, follow with the whole arm kept clear."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..escape.detour import ESCAPED, PAUSED, TOO_LONG, escape, last_tree, write_edge
from ..escape.repet import RepetSettings
from ..escape.tree_arrays import DETOUR_LOG, GROWTH, OPTION, tree_arrays
from ..geometry import screw
from ..geometry.pose import METERS_PER_RADIAN
from ..jit import inner, kernel
from ..resumable import CALL, NODE, Resumable
from ..safety.guarded_pursuit import roll_out

NODES = 500
"""Nodes of escape trees between two pauses."""


class CountColumns(NamedTuple):
    """Places of the counts that a closed loop leaves behind."""

    imitated: int = 0  # poses of the imitated path
    guide: int = 1  # index of the guiding pose in it
    full: int = 2  # poses of the path, lead included
    followed: int = 3  # poses of the path that was followed
    last: int = 4  # last row of the trace
    changed: int = 5  # ticks changed by the safety layer
    detours: int = 6
    tree_rows: int = 7  # rows of the last escape tree
    width: int = 8


COUNT = CountColumns()


class Buffers(NamedTuple):
    """Work arrays of a closed loop; allocated once, used again until a call needs more room."""

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
    growth: np.ndarray
    trace: np.ndarray
    counts: np.ndarray


def buffers(settings: RepetSettings, dof: int, ticks: int, given: int = 0) -> Buffers:
    """Allocate the work arrays.

    Args:
        settings: of the escape trees, whose sizes they set; there is room for `longest` poses of blend and detours.
        dof: number of joints.
        ticks: maximum number of ticks of a motion.
        given: maximum number of poses of the demonstrated path and of that by which the start is left, together.
    """
    poses = given + settings.longest
    tree, cells, heap = tree_arrays(settings.nodes, settings.levels)
    return Buffers(
        imitated=np.zeros((poses, 8)),
        path=np.zeros((poses, 8)),
        followed=np.zeros((poses, 8)),
        spare=np.zeros((poses, 8)),
        slacks=np.zeros(poses),
        places=np.zeros(settings.candidates),
        poses=np.zeros((settings.candidates, 8)),
        branch=np.zeros((settings.levels + 3, 8)),
        tree=tree,
        cells=cells,
        heap=heap,
        options=settings.packed(),
        state=np.ones(1),
        log=np.zeros((settings.rounds, DETOUR_LOG.width)),
        growth=np.zeros(GROWTH.width),
        trace=np.zeros((ticks + 1, dof)),
        counts=np.zeros(COUNT.width, dtype=np.int64),
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
    """Index of the pose at a fraction of the path length; `tsia.guide_index`."""
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
def lay_path(demo, goal, lead, fraction, spacing, b):
    """Lay the path to follow into `b.path`: the start is left, blended into the imitated path; returns False if full.

    Args:
        demo: (n, 8) demonstrated path.
        goal: (8,) pose of the tcp at the end.
        lead: (m, 8) path by which the start is left, from the pose at the start on; at least that pose.
        fraction: share of the imitated path before the guiding pose.
        spacing: path length [m] between poses of the blend.
        b: see `Buffers`.
    """
    n, counts = len(demo), b.counts
    counts[:] = 0
    b.growth[:] = 0.0
    b.log[:] = 0.0
    if len(lead) + n > min(len(b.imitated), len(b.path), len(b.followed)):
        return False
    _imitated(demo, (goal[0], goal[1], goal[2], goal[3], goal[4], goal[5], goal[6], goal[7]), b.imitated)
    guide = _guide(b.imitated, n, fraction) if n > 1 else 0
    if b.options[OPTION.guided] > 0.0:
        guide = min(guide, n - int(b.options[OPTION.guided]))
    at = _copied(lead, 0, len(lead), b.path, 0)
    at = write_edge(b.path, at, screw.load8(lead, len(lead) - 1), screw.load8(b.imitated, guide), spacing)
    counts[COUNT.imitated], counts[COUNT.guide] = n, guide
    if at < 0 or at + n - guide - 1 > len(b.path):
        return False
    counts[COUNT.full] = _copied(b.imitated, guide + 1, n, b.path, at)
    return True


@kernel
def lead_around(tool, b, nodes):
    """Lead the path in `b.path` around obstacles, or go on after a pause; returns the status of the escape.

    Args:
        tool: the tool among obstacles, see `edge_certificates.tool_arrays`.
        b: see `Buffers`.
        nodes: number of nodes of trees after which to pause.
    """
    counts = b.counts
    status, counts[COUNT.full], counts[COUNT.detours] = escape(
        tool, b.path, counts[COUNT.full], b.spare, b.slacks, b.places, b.poses, b.branch, b.tree, b.cells, b.heap,
        b.options, b.state, b.log, b.growth, nodes,
    )  # fmt: skip
    failed = last_tree(status, counts[COUNT.detours], len(b.log))
    counts[COUNT.tree_rows] = b.log[failed, DETOUR_LOG.tree_rows]
    return status


@kernel
def take_path(status, lead, b):
    """Take the path to follow into `b.followed`: the detour, or without one the imitated path from the guiding pose on.

    Without a detour nothing is resampled: the pull to the guiding pose is the blend.

    Args:
        status: of the escape.
        lead: (m, 8) path by which the start is left.
        b: see `Buffers`.
    """
    counts = b.counts
    if status == ESCAPED:
        followed = _copied(b.path, 0, counts[COUNT.full], b.followed, 0)
    else:
        followed = _copied(lead, 1, len(lead), b.followed, 0)
        followed = _copied(b.imitated, counts[COUNT.guide], counts[COUNT.imitated], b.followed, followed)
    counts[COUNT.followed] = followed


class ClosedLoop(NamedTuple):
    """The outcome of a closed loop; its path, tree and joints are in the buffers.

    Attributes:
        escape: status of the escape. TOO_LONG, too, where the paths or the blend do not fit into the work arrays.
        pursuit: status of the pursuit.
        margin: smallest joint margin [rad].
    """

    escape: int
    pursuit: int
    margin: float


def closed_loop(
    work: np.ndarray, g: np.ndarray, tool: np.ndarray, demo: np.ndarray, goal: np.ndarray, lead: np.ndarray,
    q: np.ndarray, fraction: float, spacing: float, dt: float, b: Buffers,
) -> Resumable[ClosedLoop]:  # fmt: skip
    """Plan a motion; the joints of every tick are left in `b.trace`.

    Args:
        work: arm, controller and pursuit, see `arm_arrays`.
        g: the arm among obstacles, see `robot_arrays`.
        tool: the tool among obstacles, see `edge_certificates.tool_arrays`.
        demo: (n, 8) demonstrated path.
        goal: (8,) pose of the tcp at the end.
        lead: (m, 8) path by which the start is left, from the pose at q on; at least that pose.
        q: (dof,) joints at the start.
        fraction: share of the imitated path before the guiding pose.
        spacing: path length [m] between poses of the blend.
        dt: seconds per tick.
        b: see `Buffers`.
    """
    if not lay_path(demo, goal, lead, fraction, spacing, b):
        return ClosedLoop(TOO_LONG, 0, -math.inf)
    status = PAUSED
    while status == PAUSED:
        status = lead_around(tool, b, NODES)
        yield CALL + NODE * min(b.counts[COUNT.tree_rows], NODES)
    take_path(status, lead, b)
    found = yield from roll_out(work, g, b.followed[: b.counts[COUNT.followed]], q, dt, b.trace)
    b.counts[COUNT.last], b.counts[COUNT.changed] = len(found.joints) - 1, found.changed
    return ClosedLoop(status, found.status, found.margin)
