"""One figure for each track of the geometric tier, as in a paper."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..statistics import median_interval, wilson
from .jobs import FRAMES, KEY_POSES, Row
from .tables import is_done, is_kept, methods_in, values_of

COLORS = {
    "screw": "#d81fb4",
    "repet": "#f08ad8",
    "tsia": "#1f4fd8",
    "tsia, guide 0.5": "#7fa3ff",
    "decoupled": "#e08a1e",
    "replay": "#2f9e44",
    "dmp-goal": "#7a4fbf",
    "dmp-goal, screws": "#bda3e6",
    "dmp-world": "#8d8d8d",
    "potential": "#17a2b8",
    "rrt": "#5a3a22",
}
MARKERS = {"tsia": "o", "decoupled": "s", "replay": "x", "dmp-goal": "^", "dmp-goal, screws": "v", "dmp-world": "D"}
ZERO = 1e-12
"""Lower bound of the drawn gaps [mm]: the axis is logarithmic."""


def draw(folder: Path, rows: Sequence[Row]) -> list[Path]:
    """Draw a figure for each track with rows, as PNG and PDF.

    Args:
        folder: folder of the figures.
        rows: rows of all tracks.

    Returns:
        The files written.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    files = []
    style: Any = {"font.size": 8, "axes.spines.top": False, "axes.spines.right": False, "pdf.fonttype": 42}
    with plt.rc_context(style):
        for track, paint in (("paths", _paths), ("sparse", _sparse), ("frames", _frames)):
            mine = [row for row in rows if row["track"] == track]
            if mine:
                figure = paint(plt, mine)
                for file in (folder / f"{track}.png", folder / f"{track}.pdf"):
                    figure.savefig(file, dpi=200)
                    files.append(file)
                plt.close(figure)
    return files


def _paths(plt: Any, rows: Sequence[Row]) -> Any:
    """Draw shares of clear paths to the goal and of those that keep the constraint, tilt while carrying, rim drift."""
    names = methods_in(rows)
    figure, axes = plt.subplots(1, 4, figsize=(8.4, 0.7 + 0.26 * len(names)), sharey=True, layout="constrained")
    levels = sorted({row["level"] for row in rows})
    for k, name in enumerate(names):
        for j, level in enumerate(levels):
            mine = [row for row in rows if (row["method"], row["level"]) == (name, level)]
            at, alpha = k + 0.25 * (j - 0.5 * (len(levels) - 1)), 1.0 - 0.3 * (len(levels) - 1 - j)
            for column, claim in zip(axes, (is_done, is_kept), strict=False):
                done = sum(map(claim, mine))
                _bar(column, at, (done / len(mine), *wilson(done, len(mine))), COLORS[name], alpha)
            pours = [row for row in mine if row["part"] == "pour carry"]
            _spread(axes[2], at, values_of(pours, "tilt"), COLORS[name], alpha)
            _spread(axes[3], at, [1e3 * v for v in values_of(pours, "rim_drift")], COLORS[name], alpha)
    axes[0].set(yticks=range(len(names)), yticklabels=names, xlim=(-0.02, 1.02), xlabel="reached and clear")
    axes[0].invert_yaxis()
    axes[1].set(xlim=(-0.02, 1.02), xlabel="constraint kept too")
    axes[2].set_xlabel("pour: tilt while carrying [°]")
    axes[3].set_xlabel("pour: rim drift [mm]")
    axes[3].set_xscale("symlog", linthresh=0.1)
    axes[3].set_xlim(left=0)
    for each in axes:
        each.grid(axis="x", linewidth=0.4, color="0.9")
        each.set_axisbelow(True)
    figure.suptitle(
        f"pale to dark: {', '.join(levels)}; bars: 95 % interval, or middle half", fontsize=7.5, color="0.35"
    )
    return figure


def _bar(axes: Any, at: float, values: tuple[float, float, float], color: str, alpha: float) -> None:
    middle, low, high = values
    axes.plot([low, high], [at, at], color=color, alpha=alpha, linewidth=2.2, solid_capstyle="butt")
    axes.plot([middle], [at], "o", color=color, alpha=alpha, markersize=3.2)


def _spread(axes: Any, at: float, values: Sequence[float], color: str, alpha: float) -> None:
    if len(values):
        low, middle, high = np.quantile(values, (0.25, 0.5, 0.75))
        _bar(axes, at, (middle, low, high), color, alpha)


def _sparse(plt: Any, rows: Sequence[Row]) -> Any:
    """Draw the rim drift of the pour and the deviation of every segment against the number of key poses."""
    names, parts = methods_in(rows), list(dict.fromkeys(row["part"] for row in rows))
    shown = [(part, "rim_drift", "rim drift [mm]") for part in parts if part == "pour carry"]
    shown += [(part, "aligned", "off the demonstration [mm]") for part in parts]
    columns = min(3, len(shown))
    lines = -(-len(shown) // columns)
    figure, grid = plt.subplots(
        lines, columns, figsize=(2.5 * columns, 2.1 * lines + 0.5), sharex=True, squeeze=False, layout="constrained"
    )
    for axes, (part, key, words) in zip(grid.flat, shown, strict=False):
        for name in names:
            middle, low, high = [], [], []
            for count in KEY_POSES:
                mine = [r for r in rows if (r["part"], r["method"], r["variant"]) == (part, name, str(count))]
                found = median_interval([1e3 * value for value in values_of(mine, key)])
                for values, value in zip((middle, low, high), found, strict=True):
                    values.append(value)
            axes.fill_between(KEY_POSES, low, high, color=COLORS[name], alpha=0.15, linewidth=0)
            axes.plot(
                KEY_POSES, middle, marker=MARKERS.get(name, "."), color=COLORS[name], markersize=4, linewidth=1.1,
                markerfacecolor="none", label=name,
            )  # fmt: skip
        axes.set(xscale="log", yscale="log", title=part, ylabel=words)
        axes.set_xticks(KEY_POSES, [str(count) for count in KEY_POSES])
        axes.minorticks_off()
        axes.grid(linewidth=0.4, color="0.9")
    for axes in list(grid.flat)[len(shown) :]:
        axes.set_axis_off()
    for axes in grid[-1]:
        axes.set_xlabel("key poses")
    for axes in grid.flat:
        axes.tick_params(labelbottom=True)
    handles, labels = grid[0, 0].get_legend_handles_labels()
    spare = list(grid.flat)[len(shown) :]
    if spare:
        spare[0].legend(handles, labels, loc="center", frameon=False)
    else:
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
    grid[0, 0].invert_xaxis()
    return figure


def _frames(plt: Any, rows: Sequence[Row]) -> Any:
    """Draw the displacement of each path after a change of frame; every scenario is a dot, filled without obstacles."""
    names = methods_in(rows)
    figure, grid = plt.subplots(
        1, len(FRAMES), figsize=(1.9 * len(FRAMES), 0.8 + 0.3 * len(names)), sharey=True, sharex=True,
        layout="constrained",
    )  # fmt: skip
    for axes, variant in zip(grid, FRAMES, strict=True):
        for k, name in enumerate(names):
            for blocked, shift, face in ((False, -0.15, COLORS[name]), (True, 0.15, "none")):
                mine = [
                    row for row in rows
                    if (row["variant"], row["method"], row["level"] == "L3") == (variant, name, blocked)
                ]  # fmt: skip
                gaps = np.maximum([1e3 * value for value in values_of(mine, "gap")], ZERO)
                at = k + shift + 0.1 * np.linspace(-1.0, 1.0, max(len(gaps), 2))[: len(gaps)]
                axes.scatter(gaps, at, s=6, facecolor=face, edgecolor=COLORS[name], linewidth=0.5, alpha=0.7)
        axes.set(xscale="log", title=variant, xlim=(1e-13, 3e3))
        axes.set_xticks([1e-12, 1e-8, 1e-4, 1.0, 1e3])
        axes.grid(axis="x", linewidth=0.4, color="0.9")
        axes.set_xlabel("path moves by [mm]")
    grid[0].set(yticks=range(len(names)), yticklabels=names)
    grid[0].invert_yaxis()
    figure.suptitle("filled: free; hollow: among obstacles (L3)", fontsize=7.5, color="0.35")
    return figure
