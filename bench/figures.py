"""Figures, in the paper's colors: demonstrated path blue, final path magenta."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..planner.pose import Pose
from .showcase import Showcase

DEMONSTRATED, FINAL, EXECUTED = "#1f4fd8", "#d81fb4", "#6b6b6b"
START_FACE, GOAL_FACE = "#c8955a", "#8fb4f0"
_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_FACES = ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))


def draw_episode(seen: Showcase, title: str, files: list[Path]) -> None:
    """Paths and objects of one episode in space, seen from two sides, written to every file."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(11.0, 5.4), layout="constrained")
    for column, (elevation, azimuth, name) in enumerate(((24, -50, "perspective"), (89.9, -90, "from above"))):
        axes = figure.add_subplot(1, 2, column + 1, projection="3d")
        _draw(axes, seen)
        axes.view_init(elev=elevation, azim=azimuth)
        if column:
            axes.set_proj_type("ortho")
            axes.set_zticks([])
            axes.set_zlabel("")
        axes.set_title(name, fontsize=9, color="0.35")
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False, fontsize=9)
    figure.suptitle(title, fontsize=11)
    for file in files:
        figure.savefig(file, dpi=160)
    plt.close(figure)


def _draw(axes, seen: Showcase) -> None:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    drawn: set[str] = set()

    def line(points: np.ndarray, label: str, **style) -> None:
        axes.plot(*points.T, label=None if label in drawn else label, **style)
        drawn.add(label)

    for path in seen.paths:
        if path.label == "demonstrated":
            line(path.poses.positions, "demonstration", color=DEMONSTRATED, linewidth=2.0)
        elif path.label == "final":
            line(path.poses.positions, "final paths", color=FINAL, linewidth=1.5)
    line(seen.executed, "executed", color=EXECUTED, linewidth=0.8, linestyle=(0, (4, 2)))
    for poses, face, alpha, label in (
        (seen.start, START_FACE, 0.95, "blocks at the start"),
        (seen.goals, GOAL_FACE, 0.45, "where they must end"),
    ):
        polygons = [polygon for k, pose in enumerate(poses) for polygon in _box(pose, seen.objects[k].size)]
        axes.add_collection3d(
            Poly3DCollection(polygons, facecolor=face, edgecolor="0.25", linewidth=0.4, alpha=alpha, label=label)
        )
    _frame(axes, seen)


def _box(pose: np.ndarray, size: np.ndarray) -> list[np.ndarray]:
    world = Pose.from_vector(pose)
    corners = (_CORNERS * size) @ world.rotation.T + world.position
    return [corners[list(face)] for face in _FACES]


def _frame(axes, seen: Showcase) -> None:
    """Equal scales around everything drawn, the table as a plane."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    points = np.vstack([seen.executed, seen.start[:, :3], seen.goals[:, :3], *(p.poses.positions for p in seen.paths)])
    low, high = points.min(axis=0) - 0.05, points.max(axis=0) + 0.05
    low[2] = seen.table_height
    corners = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
    table = [(x, y, seen.table_height) for x, y in corners]
    axes.add_collection3d(Poly3DCollection([table], facecolor="#e9e3d8", edgecolor="none", alpha=0.6, zorder=-1))
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(high - low)
    axes.set_xlabel("x [m]", fontsize=8)
    axes.set_ylabel("y [m]", fontsize=8)
    axes.set_zlabel("z [m]", fontsize=8)
    axes.tick_params(labelsize=7)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.pane.set_facecolor("white")
        axis.set_major_locator(_locator())


def _locator():
    from matplotlib.ticker import MultipleLocator

    return MultipleLocator(0.1)
