"""Learning curves: success against steps, every seed drawn, and what needs no step beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .figure_style import legend_above, new_figure, saved, styled
from .methods import look_of
from .rate_figures import share_axis
from .statistics import hierarchical_bootstrap, interquartile_mean, wilson
from .training_points import Point

HEIGHT, COLUMNS = 2.3, 2
Curves = Sequence[Sequence[Point]]
"""Of each seed its evaluations."""


def mean_interval(groups: Sequence[Sequence[bool]]) -> tuple[float, float]:
    """95 % interval of the share of successes: seeds are drawn, then episodes of each.

    Where all succeed, or none, there is nothing to draw; then Wilson's, as if all were one training's.
    """
    _, low, high = hierarchical_bootstrap([np.asarray(group, dtype=float) for group in groups], np.mean)
    every = [success for group in groups for success in group]
    return (low, high) if low < high else wilson(sum(every), len(every))


def summary_rows(curves: Curves) -> list[tuple[int, float, float, float, float, float, float]]:
    """Steps, share of successes with its interval, interquartile mean of the returns with its, at each evaluation.

    Only where all seeds have been evaluated.
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
    trainings: Mapping[str, tuple[str, Curves]], stem: Path, title: str, lines: Mapping[str, float] | None = None
) -> list[Path]:
    """Draw success against steps as .png and .pdf; the files.

    Args:
        trainings: by label, the method that it is drawn like, and its curves.
        stem: of the files.
        title: of the figure.
        lines: shares of successes of methods that need no step, by name.
    """
    with styled():
        figure, axes = new_figure(HEIGHT, len(trainings) + len(lines or {}), COLUMNS)
        handles, labels = [], []
        for label, (method, curves) in trainings.items():
            handles.append(_drawn(axes, method, curves))
            labels.append(f"{label} ({len(curves)} seed{'s' * (len(curves) != 1)})")
        for method, share in (lines or {}).items():
            handles.append(
                axes.axhline(share, color=look_of(method).color, linestyle=":", linewidth=1.2, clip_on=False)
            )
            labels.append(f"{method}, no step")
        counted = "gradient" if all(method == "bc" for method, _ in trainings.values()) else "environment"
        axes.set(xlabel=f"{counted} steps", xlim=(0, None), title=title)
        axes.xaxis.set_major_formatter(lambda value, _: f"{value / 1e3:g}k" if value else "0")
        share_axis(axes, "success")
        legend_above(figure, handles, labels, COLUMNS)
        saved(figure, stem)
    return [stem.with_suffix(suffix) for suffix in (".png", ".pdf")]


def _drawn(axes: Any, method: str, curves: Curves) -> Any:
    """A thin line for each seed, a thick one for all, and its interval; the thick one."""
    look = look_of(method)
    for points in curves:
        steps, shares = [point.steps for point in points], [point.success for point in points]
        axes.plot(steps, shares, color=look.color, linewidth=0.5, alpha=0.5, clip_on=False)
    rows = np.array([row[:4] for row in summary_rows(curves)]).reshape(-1, 4)
    axes.fill_between(rows[:, 0], rows[:, 2], rows[:, 3], color=look.color, alpha=0.15, linewidth=0)
    style = {"color": look.color, "marker": look.marker, "linestyle": look.line}
    (line,) = axes.plot(rows[:, 0], rows[:, 1], linewidth=1.5, markeredgewidth=0.0, clip_on=False, **style)
    return line
