"""Figure of one episode in the paper's colors: demonstrated path blue, final path magenta, detour cyan."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...planner import Pose
from ..drawing.convex_view import hull
from ..drawing.surfaces import surface
from .first_episode import Showcase

DEMONSTRATED, FINAL, FREE, EXECUTED = "#1f4fd8", "#d81fb4", "#00a9c7", "#6b6b6b"
START_FACE, GOAL_FACE, TABLE_FACE = "#c8955a", "#8fb4f0", "#f1ede4"
OBSTACLE_FACE, FURNITURE_FACE = "#d9482b", "#a9a090"
TALL = 0.8
"""Ratio of height to width of the scene from which it is drawn smaller: otherwise its labels leave the figure."""
MOVED = 0.005
"""Extent [m] from which an obstacle's trace is drawn."""


class _Group(NamedTuple):
    """Solids with one style: polygons (k, 3) per solid [m], legend entry, face color, opacity, drawn edges or not."""

    solids: list[list[np.ndarray]]
    label: str
    face: str
    alpha: float
    edges: bool = True


def draw_episode(seen: Showcase, title: str, files: Sequence[Path]) -> None:
    """Draw paths and objects of one episode, in 3D and from above.

    Args:
        seen: the observed episode.
        title: title of the figure.
        files: image files to write, all with the same figure.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(11.0, 6.0), layout="constrained")
    grid = figure.add_gridspec(1, 2, width_ratios=(1.5, 1.0), wspace=0.08)
    space = figure.add_subplot(grid[0], projection="3d")
    _draw_in_space(space, seen)
    _draw_from_above(figure.add_subplot(grid[1]), seen)
    handles, labels = space.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=_columns(len(labels)), frameon=False, fontsize=9)
    figure.suptitle(title, fontsize=11)
    for file in files:
        figure.savefig(file, dpi=160)
    plt.close(figure)


def _columns(entries: int) -> int:
    """Return the number of legend columns: one row for up to six entries, else two rows as equal as possible."""
    return entries if entries <= 6 else (entries + 1) // 2


def _lines(seen: Showcase) -> list[tuple[np.ndarray, str, dict[str, Any]]]:
    """Return points (n, 3), legend entry ("" for a repeated entry) and style of every line."""
    styles = {
        "demonstrated": ("demonstration", {"color": DEMONSTRATED, "linewidth": 2.0, "zorder": 5}),
        "final": ("final paths", {"color": FINAL, "linewidth": 1.5, "zorder": 4}),
        "escape": ("round obstacles", {"color": FREE, "linewidth": 2.2, "zorder": 7}),
    }
    lines = [(path.poses.positions, *styles[path.label]) for path in seen.paths if path.label in styles]
    dashed = {"color": EXECUTED, "linewidth": 0.9, "linestyle": (0, (4, 2)), "zorder": 6}
    lines.append((seen.executed, "executed", dashed))
    dotted = {"color": OBSTACLE_FACE, "linewidth": 1.2, "linestyle": (0, (1, 1.5)), "zorder": 3}
    traces = [np.array(trace) for trace in seen.traces.values()]
    lines += [(trace, "obstacle's path", dotted) for trace in traces if np.ptp(trace, axis=0).max() > MOVED]
    labels = [label for _, label, _ in lines]
    return [
        (points, label if labels.index(label) == k else "", style) for k, (points, label, style) in enumerate(lines)
    ]


def _groups(seen: Showcase) -> list[_Group]:
    """Return the groups of solids that are not empty, from back to front."""
    goals, start = (
        [
            surface(part.shape, part.pose)
            for each, pose in zip(seen.objects, poses, strict=False)
            for part in each.at(pose)
        ]
        for poses in (map(Pose.from_vector, seen.goals), map(Pose.from_vector, seen.start))
    )
    above = [-np.inf, -np.inf, seen.table_height]
    furniture = [[np.maximum(p, above) for p in surface(each.shape, each.pose)] for each in seen.furniture]
    obstacles = [surface(each.shape, each.pose) for each in seen.obstacles.values()]
    groups = [
        _Group(furniture, "furniture", FURNITURE_FACE, 0.16),
        _Group(goals, "where they must end", GOAL_FACE, 0.45),
        _Group(start, "objects at the start", START_FACE, 0.95),
        _Group(obstacles, "obstacles", OBSTACLE_FACE, 0.55, edges=False),
    ]
    return [group for group in groups if group.solids]


def _draw_in_space(axes: Any, seen: Showcase) -> None:
    from matplotlib.ticker import MultipleLocator
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    axes.computed_zorder = False
    low, high = _bounds(seen)
    table = [(x, y, low[2]) for x, y in ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1]))]
    axes.add_collection3d(Poly3DCollection([table], facecolor=TABLE_FACE, edgecolor="none", zorder=0))
    for points, label, style in _lines(seen):
        axes.plot(*points.T, label=label or None, **style)
    for group in _groups(seen):
        polygons = [polygon for solid in group.solids for polygon in solid]
        edge = {"edgecolor": "0.25", "linewidth": 0.4} if group.edges else {"edgecolor": "none"}
        if max(len(solid) for solid in group.solids) > 6:  # curved: an edge at every facet would blacken it
            edge = {"edgecolor": "none"}
        style = {"facecolor": group.face, "alpha": group.alpha, "zorder": 2, **edge}
        axes.add_collection3d(Poly3DCollection(polygons, label=group.label, **style))
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    size = high - low
    axes.set_box_aspect(size, zoom=1.12 if size[2] < TALL * size[:2].max() else 0.98)
    axes.view_init(elev=22, azim=-55)
    for axis, label in ((axes.xaxis, "x [m]"), (axes.yaxis, "y [m]"), (axes.zaxis, "z [m]")):
        axis.pane.set_facecolor("white")
        axis.set_major_locator(MultipleLocator(0.1))
        axis.set_label_text(label, fontsize=8)
    axes.tick_params(labelsize=7)


def _draw_from_above(axes: Any, seen: Showcase) -> None:
    from matplotlib.patches import Polygon
    from matplotlib.ticker import MultipleLocator

    low, high = _bounds(seen)
    for points, _, style in _lines(seen):
        axes.plot(points[:, 0], points[:, 1], **style)
    for group in _groups(seen):
        for solid in group.solids:
            footprint = hull(np.vstack(solid)[:, :2])
            style = {"facecolor": group.face, "edgecolor": "0.25", "linewidth": 0.5, "alpha": group.alpha}
            axes.add_patch(Polygon(footprint, **style, zorder=2))
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", facecolor=TABLE_FACE)
    axes.set_title("from above", fontsize=9, color="0.35")
    axes.set_xlabel("x [m]", fontsize=8)
    axes.set_ylabel("y [m]", fontsize=8)
    axes.tick_params(labelsize=7)
    axes.xaxis.set_major_locator(MultipleLocator(0.1))
    axes.yaxis.set_major_locator(MultipleLocator(0.1))


def _bounds(seen: Showcase) -> tuple[np.ndarray, np.ndarray]:
    """Return the lower and upper corner (3,) of the scene, down to the table [m]."""
    paths = [path.poses.positions for path in seen.paths]
    traces = [np.array(trace) for trace in seen.traces.values()]
    points = np.vstack([seen.executed, seen.start[:, :3], seen.goals[:, :3], *paths, *traces])
    corners = np.vstack([polygon for group in _groups(seen) for solid in group.solids for polygon in solid])
    low = np.minimum(points.min(axis=0) - 0.05, corners.min(axis=0) - 0.02)
    high = np.maximum(points.max(axis=0) + 0.05, corners.max(axis=0) + 0.02)
    low[2] = seen.table_height
    return low, high
