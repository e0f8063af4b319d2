"""Painting of convex solids, their shells and the floor as flat polygons: small, sharp vector graphics."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .convex_view import ConvexSolid, DrawingView, union

FACE, EDGE = (0.914, 0.722, 0.447), (0.47, 0.30, 0.07)
SHELL_FACE, SHELL_EDGE = "#f3dcb4", "#d9a441"
ARM_FACES, ARM_EDGE = ("#ececec", "#cfd8e3"), "#8b9299"
ARM_LINES: tuple[Any, Any] = ((0, (1.5, 1.5)), "solid")
FLOOR, GRID, INK = "#f6f4ef", "#dcd8cf", "0.35"
LIGHT = np.array([0.35, -0.45, 0.82])
"""Direction towards the light."""
SHINE = 9
"""Number of nested lighter outlines that make a ball look round."""


def paint_solid(axes: Any, view: DrawingView, solid: ConvexSolid, zorder: float) -> None:
    """Paint an obstacle.

    Args:
        axes: matplotlib axes.
        view: the view.
        solid: the obstacle.
        zorder: layer of its lowest part; the other parts lie within 0.005 above.
    """
    from matplotlib.patches import Polygon

    outline = solid.outline(view)
    axes.add_patch(Polygon(outline, facecolor=FACE, edgecolor="none", alpha=0.42, zorder=zorder))
    for facet in solid.facets:
        ahead = float(facet.normal @ view.axes[2])
        flat = view.flat(facet.corners)
        if ahead > 1e-6:
            shade = np.array(FACE) * (0.72 + 0.28 * max(float(facet.normal @ LIGHT), 0.0))
            axes.add_patch(Polygon(flat, facecolor=shade, edgecolor="none", alpha=0.38, zorder=zorder + 0.002))
            axes.add_patch(Polygon(flat, facecolor="none", edgecolor=EDGE, linewidth=0.7, zorder=zorder + 0.004))
        else:
            faint = {"edgecolor": EDGE, "linewidth": 0.5, "linestyle": (0, (2, 2)), "alpha": 0.35}
            axes.add_patch(Polygon(flat, facecolor="none", zorder=zorder + 0.001, joinstyle="round", **faint))
    if not solid.facets:
        _shine(axes, view, solid, zorder)
    axes.add_patch(Polygon(outline, facecolor="none", edgecolor=EDGE, linewidth=1.0, zorder=zorder + 0.005))


def _shine(axes: Any, view: DrawingView, solid: ConvexSolid, zorder: float) -> None:
    """Paint a soft light spot: nested outlines of shrinking solids that move towards the light."""
    from matplotlib.patches import Polygon

    light = view.flat(LIGHT)
    for k in range(1, SHINE + 1):
        share = k / (SHINE + 1.0)
        inner = ConvexSolid(solid.core, solid.radius * (1.0 - share), solid.planes, (), solid.kind)
        flat = inner.outline(view) + 0.45 * share * solid.radius * light
        axes.add_patch(Polygon(flat, facecolor="white", edgecolor="none", alpha=0.075, zorder=zorder + 0.002))


def paint_shells(axes: Any, view: DrawingView, solids: Sequence[ConvexSolid], distance: float) -> None:
    """Paint the region closer to obstacles than the shell's distance as one area.

    Args:
        axes: matplotlib axes.
        view: the view.
        solids: the obstacles.
        distance: thickness of the shell [m].
    """
    if solids:
        style = {"edgecolor": SHELL_EDGE, "linewidth": 0.9, "linestyle": (0, (4, 3))}
        _paint_union(axes, [s.outline(view, distance) for s in solids], SHELL_FACE, 0.35, 6.0, style)


def paint_arm(axes: Any, view: DrawingView, capsules: Sequence[ConvexSolid], posture: int) -> None:
    """Paint the arm's capsules in one posture as a pale shadow behind everything.

    Args:
        axes: matplotlib axes.
        view: the view.
        capsules: capsules of the arm in this posture.
        posture: 0 for the start, 1 for the goal.
    """
    style = {"edgecolor": ARM_EDGE, "linewidth": 0.8, "linestyle": ARM_LINES[posture]}
    outlines = [capsule.outline(view) for capsule in capsules]
    _paint_union(axes, outlines, ARM_FACES[posture], 0.55, 4.0 + 0.5 * posture, style)


def arm_patch(posture: int, **options: Any) -> Any:
    """Return the legend handle of the arm.

    Args:
        posture: 0 for the start, 1 for the goal.
        options: options of matplotlib's `Patch`.
    """
    from matplotlib.patches import Patch

    return Patch(facecolor=ARM_FACES[posture], edgecolor=ARM_EDGE, linestyle=ARM_LINES[posture], **options)


def _paint_union(
    axes: Any, outlines: list[np.ndarray], face: str, alpha: float, zorder: float, style: dict[str, Any]
) -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    area = Path.make_compound_path(*[Path(line, closed=True) for line in union(outlines)])
    axes.add_patch(PathPatch(area, facecolor=face, edgecolor="none", alpha=alpha, zorder=zorder))
    axes.add_patch(PathPatch(area, facecolor="none", alpha=0.8, zorder=zorder + 0.1, **style))


def paint_floor(axes: Any, view: DrawingView, low: np.ndarray, high: np.ndarray) -> None:
    """Paint a grid on the lower side of a box, its coordinates, and a scale of heights.

    Args:
        axes: matplotlib axes.
        view: the view.
        low: (3,) lower corner of the box [m].
        high: (3,) upper corner of the box [m].
    """
    from matplotlib.collections import LineCollection
    from matplotlib.patches import Polygon

    corners = floor_corners(low, high)
    axes.add_patch(Polygon(view.flat(corners), facecolor=FLOOR, edgecolor=GRID, linewidth=1.0, zorder=1))
    xs, ys = (_ticks(low[k], high[k]) for k in (0, 1))
    lines = [[[x, low[1], low[2]], [x, high[1], low[2]]] for x in xs]
    lines += [[[low[0], y, low[2]], [high[0], y, low[2]]] for y in ys]
    flat = [view.flat(np.array(line)) for line in lines]
    axes.add_collection(LineCollection(flat, colors=GRID, linewidths=0.7, zorder=2))
    towards = view.axes[2]
    near = np.where(towards > 0, high, low)
    for k, ticks in ((0, xs), (1, ys)):
        other, out = 1 - k, np.zeros(3)
        out[other] = np.sign(towards[other]) * 0.035
        for value in [*ticks, None]:
            at = np.array([0.0, 0.0, low[2]])
            at[k], at[other] = 0.5 * (low[k] + high[k]) if value is None else value, near[other]
            if value is None:
                _label(axes, view, at + 3.7 * out, f"{'xy'[k]} [m]", size=10.0)
            else:
                _label(axes, view, at + out, f"{value:.1f}".replace("-0.0", "0.0"))
    _height_scale(axes, view, low, high)


def floor_corners(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the corners (4, 3) of the lower side of a box, in order around it [m].

    Args:
        low: (3,) lower corner of the box [m].
        high: (3,) upper corner of the box [m].
    """
    return np.array(
        [[x, y, low[2]] for x, y in ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1]))]
    )


def scale_ends(view: DrawingView, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return foot and head (2, 3) of the scale of heights: at the floor's leftmost corner in the picture.

    Args:
        view: the view.
        low: (3,) lower corner of the box [m].
        high: (3,) upper corner of the box [m].
    """
    corners = floor_corners(low, high)
    foot = corners[int(view.flat(corners)[:, 0].argmin())]
    return np.array([foot, [foot[0], foot[1], high[2]]])


def _height_scale(axes: Any, view: DrawingView, low: np.ndarray, high: np.ndarray) -> None:
    foot = scale_ends(view, low, high)[0]
    up = np.array([0.0, 0.0, 1.0])
    ticks = _ticks(low[2], high[2])
    axes.plot(*view.flat(np.stack([foot, foot + (high[2] - low[2]) * up])).T, color="0.75", linewidth=0.9, zorder=2)
    for value in ticks[ticks > low[2] + 0.02]:
        x, y = view.flat(foot + (value - low[2]) * up)
        axes.plot([x - 0.008, x], [y, y], color="0.6", linewidth=0.8, zorder=2)
        axes.text(x - 0.014, y, f"{value:.1f}", ha="right", va="center", fontsize=8.5, color=INK)
    x, y = view.flat(foot + (high[2] - low[2]) * up)
    axes.text(x, y + 0.02, "z [m]", ha="center", va="bottom", fontsize=10, color=INK)


def _label(axes: Any, view: DrawingView, at: np.ndarray, text: str, size: float = 8.5) -> None:
    axes.text(*view.flat(at), text, ha="center", va="center", fontsize=size, color=INK, zorder=8, clip_on=True)


def _ticks(low: float, high: float) -> np.ndarray:
    step = 0.1 if high - low <= 1.01 else 0.2
    return step * np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 0.5)
