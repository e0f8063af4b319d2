"""Learning curves: success and return against steps for every seed, with lines for methods that need no steps."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...envs.core.goal_form import HORIZON
from ..drawing.figure_style import COLUMN, LEGEND_ROW, legend_above, saved, styled
from ..method_table import Look, look_of, other_look
from ..report.rate_figures import share_axis
from ..statistics import hierarchical_bootstrap, interquartile_mean, wilson
from .evaluations import Point

HEIGHT, COLUMNS = 3.3, 2
"""Height of a figure without its legend [inch]; number of legend columns."""
MARGIN = 0.03
"""Margin of the success axis beyond 0 and 1, as a share of successes."""
DASH = 2.0
"""Length of a dash in line widths."""
Curves = Sequence[Sequence[Point]]
"""Evaluations of each seed."""


class Line(NamedTuple):
    """Horizontal line of a method that needs no environment steps.

    Attributes:
        method: method whose color the line takes.
        share: share of successes.
    """

    method: str
    share: float


def mean_interval(groups: Sequence[Sequence[bool]]) -> tuple[float, float]:
    """Return the 95 % interval of the share of successes, bootstrapped over seeds and then over their episodes.

    Where all episodes succeed, or none, the bootstrap has no spread: the interval is Wilson's then, as if all episodes
    belonged to one training.
    """
    _, low, high = hierarchical_bootstrap([np.asarray(group, dtype=float) for group in groups], np.mean)
    every = [success for group in groups for success in group]
    return (low, high) if low < high else wilson(sum(every), len(every))


def summary_rows(curves: Curves) -> list[tuple[int, float, float, float, float, float, float]]:
    """Return the statistics of each evaluation that all seeds have had.

    Returns:
        Rows of steps, share of successes, its interval (low, high), interquartile mean of the returns, and its interval
        (low, high).
    """
    rows = []
    for points in zip(*curves, strict=False):
        shares = [np.asarray(point.successes, dtype=float) for point in points]
        share, low, high = hierarchical_bootstrap(shares, np.mean)
        returns = [np.asarray(point.returns) for point in points]
        middle, bottom, top = hierarchical_bootstrap(returns, interquartile_mean)
        rows.append((points[0].steps, share, low, high, middle, bottom, top))
    return rows


def draw_curves(
    trainings: Mapping[str, tuple[str, Curves]], stem: Path, title: str, lines: Mapping[str, Line] | None = None
) -> list[Path]:
    """Draw successes and returns against steps as .png and .pdf; return the two files.

    Args:
        trainings: by label, the method whose look the curves take, and the curves.
        stem: path of the files without suffix.
        title: title of the figure.
        lines: by label, methods that need no environment steps.
    """
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    lines = lines or {}
    with styled():
        rows = -(-(len(trainings) + len(lines)) // COLUMNS)
        figure = Figure(figsize=(COLUMN, HEIGHT + LEGEND_ROW * rows), layout="constrained")
        top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        handles, labels = [], []
        for k, (label, line) in enumerate(lines.items()):
            # staggered dashes: lines at the same height all remain visible
            dashes = (DASH * k, (DASH, DASH * max(1, len(lines) - 1)))
            style = {"color": look_of(line.method).color, "linewidth": 1.5}
            top.axhline(line.share, linestyle=dashes, clip_on=False, **style)
            handles.append(Line2D([], [], linestyle=(0, (DASH, 0.6 * DASH)), **style))
            labels.append(f"{label}, no step")
        drawn: Counter[str] = Counter()
        for label, (method, curves) in trainings.items():
            handles.append(_drawn(top, bottom, other_look(method, drawn[method]), curves))
            drawn[method] += 1
            labels.append(f"{label} ({len(curves)} seed{'s' * (len(curves) != 1)})")
        counted = "gradient" if all(method == "bc" for method, _ in trainings.values()) else "environment"
        top.set(title=title)
        bottom.set(xlabel=f"{counted} steps", xlim=(0, None), ylim=(0, HORIZON), ylabel="return")
        bottom.set_yticks(range(0, HORIZON + 1, HORIZON // 3))
        bottom.grid(False, axis="x")
        thousands = bottom.get_xlim()[1] >= 5e3
        bottom.xaxis.set_major_formatter(lambda value, _: f"{value / 1e3:g}k" if thousands and value else f"{value:g}")
        bottom.locator_params(axis="x", nbins=6)
        share_axis(top, "success")
        # shares of 0 and 1 matter most: they must not lie on the frame
        top.set_ylim(-MARGIN, 1.0 + MARGIN)
        legend_above(figure, handles, labels, COLUMNS)
        saved(figure, stem)
    return [stem.with_suffix(suffix) for suffix in (".png", ".pdf")]


def _drawn(top: Any, bottom: Any, look: Look, curves: Curves) -> Any:
    """Draw thin lines for the seeds, a thick line for all and its interval, on both axes; return the legend handle."""
    rows = np.array(summary_rows(curves)).reshape(-1, 7)
    style = {"color": look.color, "marker": look.marker, "linestyle": look.line, "linewidth": 1.5, "markersize": 3.0}
    line = None
    for axes, column in ((top, 1), (bottom, 4)):
        for points in curves:
            values = [point.success if axes is top else interquartile_mean(np.array(point.returns)) for point in points]
            steps = [point.steps for point in points]
            axes.plot(steps, values, color=look.color, linewidth=0.5, alpha=0.5, clip_on=False)
        axes.fill_between(rows[:, 0], *rows[:, column + 1 : column + 3].T, color=look.color, alpha=0.15, linewidth=0)
        (drawn,) = axes.plot(*rows[:, [0, column]].T, markeredgewidth=0.0, clip_on=False, **style)
        line = line or drawn
    return line
