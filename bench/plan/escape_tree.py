"""Drawing of an escape tree: kept and rejected edges, and the planes along the branch that sees the path again."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...planner import EscapeTree, PosePath
from ...planner.escape.tree_arrays import VERDICT
from ..drawing.convex_view import ConvexSolid, DrawingView, hidden_by

PLANE, KEPT, REJECTED = "#2f9e5b", "#7a7a7a", "#d9482b"
PLANE_SIDE = 0.05
"""Side [m] of the square that represents a plane."""
MOST_REJECTED = 1500
"""Largest number of rejected edges drawn; more would merge into a blot."""
DIM = 0.34
"""Opacity of edges behind a solid."""


def paint_tree(
    axes: Any,
    view: DrawingView,
    tree: EscapeTree,
    path: PosePath,
    solids: Sequence[ConvexSolid],
    *,
    every: bool = False,
) -> None:
    """Draw kept and rejected edges, and planes.

    Args:
        axes: axes of matplotlib.
        view: the view.
        tree: the escape tree.
        path: tcp path of the plan.
        solids: solids that hide edges.
        every: draw every plane, instead of those along the branch that sees the path again.
    """
    from matplotlib.collections import LineCollection, PolyCollection

    positions = PosePath(tree.poses).positions
    child = np.flatnonzero(tree.parents >= 0)
    edges = np.stack([positions[tree.parents[child]], positions[child]], axis=1)
    good = np.isin(tree.verdicts[child], (VERDICT.kept, VERDICT.goal_edge))
    bad = np.flatnonzero(tree.verdicts[child] == VERDICT.rejected_edge)
    bad = bad[np.unique(np.linspace(0, len(bad) - 1, min(len(bad), MOST_REJECTED)).astype(int))] if len(bad) else bad
    for rows, color, width, alpha in ((bad, REJECTED, 0.35, 0.4), (np.flatnonzero(good), KEPT, 0.6, 0.75)):
        if not len(rows):
            continue
        dim = np.where(hidden_by(solids, edges[rows].mean(axis=1), view), DIM, 1.0)
        lines = LineCollection(list(view.flat(edges[rows])), colors=color, linewidths=width, alpha=alpha * dim)
        lines.set_zorder(24)
        axes.add_collection(lines)
    squares = []
    for plane in tree.planes if every else [tree.planes[k] for k in branch_planes(tree, path)]:
        side = 0.5 * PLANE_SIDE
        squares.append(
            [plane.origin + side * (a * plane.u + b * plane.v) for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
        )
    if not squares:
        return
    squares.sort(key=lambda square: float(view.depth(np.mean(square, axis=0))))
    polygons = [view.flat(np.array(square)) for square in squares]
    axes.add_collection(
        PolyCollection(polygons, facecolors=PLANE, edgecolors=PLANE, linewidths=0.7, alpha=0.28, zorder=26)
    )


def branch_planes(tree: EscapeTree, path: PosePath) -> list[int]:
    """Return the planes at the nodes of the branch closest to a path.

    Args:
        tree: the escape tree.
        path: tcp path of the plan.

    Returns:
        Indices into `tree.planes`; a selection of all planes if no branch sees the path again.
    """
    origins = np.array([plane.origin for plane in tree.planes]).reshape(-1, 3)
    ends = np.flatnonzero(tree.verdicts == VERDICT.goal_edge)
    positions = PosePath(tree.poses).positions
    if not len(ends) or not len(origins):
        return [int(k) for k in np.unique(np.linspace(0, len(origins) - 1, 14).astype(int))] if len(origins) else []
    best: list[int] = []
    least = math.inf
    for end in ends[:200]:
        branch, row = [], int(end)
        while row >= 0:
            branch.append(row)
            row = int(tree.parents[row])
        gaps = np.linalg.norm(positions[branch][:, None] - path.positions[None], axis=2).min(axis=1)
        if gaps.mean() < least:
            best, least = branch, float(gaps.mean())
    gaps = np.linalg.norm(origins[:, None] - positions[best][None], axis=2)
    return [int(k) for k in np.flatnonzero(gaps.min(axis=1) < 1e-9)]
