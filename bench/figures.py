"""Figures, in the paper's colors: demonstrated path blue, final path magenta."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..planner.pose import Pose
from .showcase import Showcase

DEMONSTRATED, FINAL, EXECUTED = "#1f4fd8", "#d81fb4", "#6b6b6b"
START_FACE, GOAL_FACE, TABLE_FACE = "#c8955a", "#8fb4f0", "#f1ede4"
_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_FACES = ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))


def draw_episode(seen: Showcase, title: str, files: list[Path]) -> None:
    """Paths and objects of one episode, in space and from above, written to every file."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(11.0, 5.6), layout="constrained")
    grid = figure.add_gridspec(1, 2, width_ratios=(1.5, 1.0))
    space = figure.add_subplot(grid[0], projection="3d")
    _draw_in_space(space, seen)
    _draw_from_above(figure.add_subplot(grid[1]), seen)
    handles, labels = space.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False, fontsize=9)
    figure.suptitle(title, fontsize=11)
    for file in files:
        figure.savefig(file, dpi=160)
    plt.close(figure)


def _lines(seen: Showcase) -> list[tuple[np.ndarray, str, dict[str, Any]]]:
    """Points (n, 3), legend entry ("" for a repeated one) and style of every line."""
    styles = {
        "demonstrated": ("demonstration", {"color": DEMONSTRATED, "linewidth": 2.0, "zorder": 5}),
        "final": ("final paths", {"color": FINAL, "linewidth": 1.5, "zorder": 4}),
    }
    lines = [(path.poses.positions, *styles[path.label]) for path in seen.paths if path.label in styles]
    dashed = {"color": EXECUTED, "linewidth": 0.9, "linestyle": (0, (4, 2)), "zorder": 6}
    lines.append((seen.executed, "executed", dashed))
    labels = [label for _, label, _ in lines]
    return [
        (points, label if labels.index(label) == k else "", style) for k, (points, label, style) in enumerate(lines)
    ]


def _boxes(seen: Showcase) -> list[tuple[np.ndarray, str, str, float]]:
    """Poses (n, 7), legend entry, color and opacity of the two groups of boxes."""
    return [
        (seen.goals, "where they must end", GOAL_FACE, 0.45),
        (seen.start, "objects at the start", START_FACE, 0.95),
    ]


def _draw_in_space(axes: Any, seen: Showcase) -> None:
    from matplotlib.ticker import MultipleLocator
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    axes.computed_zorder = False
    low, high = _bounds(seen)
    table = [(x, y, low[2]) for x, y in ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1]))]
    axes.add_collection3d(Poly3DCollection([table], facecolor=TABLE_FACE, edgecolor="none", zorder=0))
    for points, label, style in _lines(seen):
        axes.plot(*points.T, label=label or None, **style)
    for poses, label, face, alpha in _boxes(seen):
        polygons = [polygon for k, pose in enumerate(poses) for polygon in _faces(pose, seen.objects[k].size)]
        style = {"facecolor": face, "edgecolor": "0.25", "linewidth": 0.4, "alpha": alpha, "zorder": 2}
        axes.add_collection3d(Poly3DCollection(polygons, label=label, **style))
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(high - low, zoom=1.12)
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
    for poses, _, face, alpha in _boxes(seen):
        for k, pose in enumerate(poses):
            footprint = _faces(pose, seen.objects[k].size)[4][:, :2]
            axes.add_patch(Polygon(footprint, facecolor=face, edgecolor="0.25", linewidth=0.5, alpha=alpha, zorder=2))
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", facecolor=TABLE_FACE)
    axes.set_title("from above", fontsize=9, color="0.35")
    axes.set_xlabel("x [m]", fontsize=8)
    axes.set_ylabel("y [m]", fontsize=8)
    axes.tick_params(labelsize=7)
    axes.xaxis.set_major_locator(MultipleLocator(0.1))
    axes.yaxis.set_major_locator(MultipleLocator(0.1))


def _bounds(seen: Showcase) -> tuple[np.ndarray, np.ndarray]:
    """Corners (3,) of what is drawn, down to the table [m]."""
    paths = [path.poses.positions for path in seen.paths]
    points = np.vstack([seen.executed, seen.start[:, :3], seen.goals[:, :3], *paths])
    low, high = points.min(axis=0) - 0.05, points.max(axis=0) + 0.05
    low[2] = seen.table_height
    return low, high


def _faces(pose: np.ndarray, size: np.ndarray) -> list[np.ndarray]:
    """The six faces (4, 3) of a box of full extents `size` [m]; the fifth is its lower one."""
    world = Pose.from_vector(pose)
    corners = (_CORNERS * size) @ world.rotation.T + world.position
    return [corners[list(face)] for face in _FACES]
