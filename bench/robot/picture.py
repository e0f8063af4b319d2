"""Picture of a robot's capsules over its geometry, from two sides."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...planner import Pose
from ...planner.errors import UnfitShape
from ...planner.fitting.link_pieces import surface
from ...planner.fitting.robot_model import Geometry, places_of, world_from_parts
from ...planner.robot.body import BODY
from ...planner.robot.joint_frames import joint_frames, moved
from ..drawing.convex_view import ConvexSolid, DrawingView, ball_along, union
from ..drawing.figure_style import FAINT, INK
from .load_robot import LoadedRobot
from .robot_summary import postures_of

VIEWS = (DrawingView(-60.0, 18.0), DrawingView(30.0, 18.0))
COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7b5ea7", "#8c6d31", "#a30000", "#333333")
"""Colors of the parts in turn, after Okabe and Ito's color-blind safe set."""
SOLID = np.array([0.62, 0.64, 0.67])
LIGHT = np.array([0.35, -0.45, 0.82])
"""Direction towards the light."""
SIZE, LEGEND, TITLE, DPI = 5.2, 0.5, 0.4, 144
"""Width of a view, heights of legend and title [inch], and resolution."""
BORDER, SCALE, TRIAD = 0.05, 0.1, 0.08
"""Border around the robot, length of the scale, and of the axes of the tool frame [m]."""
AXES = ("#d43c3c", "#3aa03a", "#3a5fd4")
"""Colors of the x, y and z axis of the tool frame."""


def draw_robot(robot: LoadedRobot, file: Path) -> None:
    """Draw a robot in the middle of its joints' ranges: its geometry gray, its capsules in color.

    Args:
        robot: the robot.
        file: picture to write, its format given by the suffix.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    low, high = postures_of(robot.arm)
    frames = [Pose.identity(), *joint_frames(robot.arm, 0.5 * (low + high))]
    triangles, capsules = _triangles(robot, frames), _capsules(robot, frames)
    windows = [_window(view, triangles, capsules) for view in VIEWS]
    extent = np.max([window[1] - window[0] for window in windows], axis=0)
    height = SIZE * float(np.clip(extent[1] / extent[0], 0.5, 1.6))
    with plt.rc_context({"font.family": "DejaVu Sans", "svg.hashsalt": "onedemo", "text.parse_math": False}):
        whole = height + LEGEND + TITLE
        figure = plt.figure(figsize=(2 * SIZE, whole))
        for k, (view, window) in enumerate(zip(VIEWS, windows, strict=True)):
            axes = figure.add_axes((0.5 * k, LEGEND / whole, 0.5, height / whole))
            middle = 0.5 * (window[0] + window[1])
            axes.set(xlim=middle[0] + 0.5 * extent[0] * np.array([-1, 1]), aspect="equal")
            axes.set(ylim=middle[1] + 0.5 * extent[1] * np.array([-1, 1]))
            axes.axis("off")
            _paint(axes, view, triangles, capsules)
            _paint_tool(axes, view, robot.arm.fk(0.5 * (low + high)))
            _paint_scale(axes)
        _label(figure, robot, whole)
        figure.savefig(file, dpi=DPI, facecolor="white")
        plt.close(figure)


def _triangles(robot: LoadedRobot, frames: list[Pose]) -> np.ndarray:
    """Return the triangles (n, 3, 3) of the geometry of all covered parts in the world [m]."""
    read = robot.parts.robot
    reference = [Pose.identity(), *joint_frames(robot.arm, read.reference)]
    found = [np.zeros((0, 3, 3))]
    places = places_of(read.parts, robot.arm.dof)
    for part, world, place in zip(read.parts, world_from_parts(read.parts), places, strict=True):
        if place.frame is not None and place.piece:
            placed = frames[place.frame + 1] @ reference[place.frame + 1].inverse() @ world
            found += [moved(placed, surface_of(geometry)) for geometry in part.geometry]
    return np.vstack(found)


def surface_of(geometry: Geometry) -> np.ndarray:
    """Return the triangles (n, 3, 3) of an element [m]: of its mesh, or of its hull; none if it has no volume."""
    try:
        return surface(geometry) if len(geometry.points) > 3 else np.zeros((0, 3, 3))
    except UnfitShape:
        return np.zeros((0, 3, 3))


def _capsules(robot: LoadedRobot, frames: list[Pose]) -> dict[str, list[ConvexSolid]]:
    found: dict[str, list[ConvexSolid]] = {}
    for row, name in zip(robot.body.rows, robot.body.names, strict=True):
        pose = frames[int(row[BODY.frame]) + 1]
        a, b = (moved(pose, row[first : first + 3]) for first in (BODY.a, BODY.b))
        found.setdefault(name, []).append(ball_along(a, b, float(row[BODY.radius])))
    return found


def _window(
    view: DrawingView, triangles: np.ndarray, capsules: dict[str, list[ConvexSolid]]
) -> tuple[np.ndarray, np.ndarray]:
    outlines = [capsule.outline(view) for each in capsules.values() for capsule in each]
    points = np.vstack([view.flat(triangles.reshape(-1, 3)), *outlines])
    return points.min(axis=0) - BORDER, points.max(axis=0) + BORDER


def _paint(axes: Any, view: DrawingView, triangles: np.ndarray, capsules: dict[str, list[ConvexSolid]]) -> None:
    from matplotlib.collections import PolyCollection
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    shade = 0.62 + 0.38 * np.abs(normals @ (LIGHT / np.linalg.norm(LIGHT)))
    order = np.argsort(view.depth(triangles.mean(axis=1)))
    faces = PolyCollection([*view.flat(triangles[order])], linewidths=0.2, zorder=1)
    colors = np.clip(SOLID * shade[order, None] * 1.25, 0, 1)
    faces.set(facecolor=colors, edgecolor=colors)
    axes.add_collection(faces)
    for color, each in zip(_colors(len(capsules)), capsules.values(), strict=True):
        area = Outline.make_compound_path(
            *[Outline(line, closed=True) for line in union([capsule.outline(view) for capsule in each])]
        )
        axes.add_patch(PathPatch(area, facecolor=color, edgecolor="none", alpha=0.13, zorder=2))
        axes.add_patch(PathPatch(area, facecolor="none", edgecolor=color, linewidth=1.4, zorder=3))


def _paint_tool(axes: Any, view: DrawingView, tool: Pose) -> None:
    for k, color in enumerate(AXES):
        ends = np.stack([tool.position, tool.position + TRIAD * tool.rotation[:, k]])
        axes.plot(*view.flat(ends).T, color=color, linewidth=2.0, solid_capstyle="round", zorder=4)


def _paint_scale(axes: Any) -> None:
    x, y = axes.get_xlim()[0] + 0.02, axes.get_ylim()[0] + 0.02
    axes.plot([x, x + SCALE], [y, y], color=INK, linewidth=1.6, solid_capstyle="butt", zorder=5)
    axes.text(x + 0.5 * SCALE, y + 0.01, f"{100 * SCALE:.0f} cm", ha="center", va="bottom", fontsize=8, color=FAINT)


def _colors(count: int) -> list[str]:
    return [COLORS[k % len(COLORS)] for k in range(count)]


def _label(figure: Any, robot: LoadedRobot, whole: float) -> None:
    from matplotlib.patches import Patch

    names = list(dict.fromkeys(robot.body.names))
    entries = [Patch(facecolor=tuple(SOLID), label="geometry")]
    colors = zip(_colors(len(names)), names, strict=True)
    entries += [Patch(facecolor="none", edgecolor=color, label=name) for color, name in colors]
    figure.legend(handles=entries, loc="lower center", ncols=-(-len(entries) // 2), frameon=False, fontsize=9)
    title = f"{robot.arm.name}: {robot.arm.dof} joints to {robot.tool}, {len(robot.body)} capsules"
    figure.text(0.5, 1.0 - 0.2 / whole, title, fontsize=12, ha="center", va="center")
