"""Figures of outcomes, clearance and planner time; see `rate_figures` for rates."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ...envs import facts_of
from ..drawing.figure_style import FAINT, INK, legend_above, new_figure
from ..method_table import look_of
from ..statistics import median
from .groups import SAFE, UNSAFE, rank
from .rate_figures import COLUMNS, HEIGHT, Series, share_axis

OUTCOMES = {
    SAFE: ("#dfe7ee", "", "safe success"),
    UNSAFE: ("#a9bccd", "/////", "unsafe success"),
    "collision": ("#d55e00", "", "collision"),
    "dropped": ("#e69f00", "||||", "dropped"),
    "off_table": ("#f0e442", "", "off the table"),
    "constraint": ("#cc79a7", "xxxx", "constraint"),
    "ik_or_limit": ("#0072b2", "", "IK or limit"),
    "plan_failed": ("#56b4e9", "\\\\\\\\", "no plan"),
    "blocked": ("#009e73", "", "blocked"),
    "timeout": ("#999999", "----", "timeout"),
    "error": ("#332288", "////", "error of the policy"),
    "worker_died": ("#882255", "....", "worker died"),
    "hung": ("#aa4499", "ooo", "worker hung"),
}
"""Color, hatch and words of every outcome, in the order of bars."""
OTHER = ("#444444", "", "other")
TALLEST = 8.3
"""Largest height [inch] of a figure that fits on a page with its caption."""
FARTHEST = 120.0
"""Largest drawn clearance [mm]."""
CURVE = 200
"""Largest number of drawn points of a distribution."""


def failures(lines: list[Series]) -> Any:
    """Draw the shares of outcomes: one bar per level and method."""
    rows = [(group.place, line.label, group) for line in lines for group in line.groups if group.records]
    rows.sort(key=lambda row: rank(row[0]))
    levels, known = list(dict.fromkeys(level for level, _, _ in rows)), {group.setting.level for _, _, group in rows}
    outcomes = {outcome for _, _, group in rows for outcome in group.outcomes}
    height = min(TALLEST, 0.55 + 0.155 * len(rows) + 0.1 * len(levels))
    figure, axes = new_figure(height, len(outcomes), COLUMNS)
    places = np.array([k + 0.7 * levels.index(level) for k, (level, _, _) in enumerate(rows)])
    used: dict[str, Any] = {}
    left = np.zeros(len(rows))
    for outcome in (*OUTCOMES, *sorted(outcomes - set(OUTCOMES))):
        share = np.array([group.outcomes[outcome] / len(group.records) for _, _, group in rows])
        if share.any():
            color, hatch, words = OUTCOMES.get(outcome, OTHER)
            used[words] = axes.add_collection(_bars(left, share, places, facecolor=color, hatch=hatch))
            left += share
    for level in levels:
        middle = places[[k for k, row in enumerate(rows) if row[0] == level]].mean()
        words = level if level in known else level.replace(" ", "\n", 1)  # a task's name is long
        axes.text(1.02, middle, words, ha="left", va="center", fontweight="bold", clip_on=False)
    axes.set_yticks(places, [label for _, label, _ in rows])
    axes.set(xlim=(0.0, 1.0), ylim=(places[-1] + 0.6, places[0] - 0.6), xlabel="share of episodes")
    points_per_row = 72.0 * (height - 0.55) / (places[-1] + 1.0)
    axes.tick_params(axis="y", length=0, labelsize=min(7.5, 0.85 * points_per_row))
    axes.grid(False)
    axes.spines["left"].set_visible(False)
    words = [entry[2] for entry in (*OUTCOMES.values(), OTHER) if entry[2] in used]
    legend_above(figure, [used[word] for word in words], words, COLUMNS)
    return figure


def _bars(left: np.ndarray, share: np.ndarray, places: np.ndarray, **style: Any) -> Any:
    """Return the bars (n,) of one outcome as one collection: ten times faster and smaller than single hatched bars."""
    from matplotlib.collections import PolyCollection

    x = np.stack([left, left, left + share, left + share], axis=1)
    y = places[:, None] + 0.41 * np.array([-1.0, 1.0, 1.0, -1.0])
    corners = np.stack([x, y], axis=-1)[share > 0.0]
    return PolyCollection(list(corners), edgecolor="white", linewidth=0.3, **style)


def timing(lines: list[Series]) -> Any | None:
    """Draw median, 99th percentile and maximum of the policy's time per tick, logarithmically; None without times."""
    known = [(line, [r.tick_us for g in line.groups for r in g.records if max(r.tick_us) > 0.0]) for line in lines]
    known = [(line, ticks) for line, ticks in known if ticks]
    if not known:
        return None
    figure, axes = new_figure(0.7 + 0.2 * len(known), 4, 4)
    for row, (line, ticks) in enumerate(known):
        values = np.maximum(np.array([entry[:3] for entry in ticks]) / 1e3, 1e-6)
        middle, late, most = median(values[:, 0]), median(values[:, 1]), float(values[:, 2].max())
        color = look_of(line.label).color
        axes.plot([middle, most], [row, row], color=color, linewidth=0.8)
        axes.plot(middle, row, "o", color=color, label="median" if row == 0 else None)
        axes.plot(late, row, "|", color=color, markersize=8, markeredgewidth=1.4)
        axes.plot(most, row, "o", color="white", markeredgecolor=color, markeredgewidth=0.9)
    between = timing_ticks([line for line, _ in known])
    for milliseconds in between:
        axes.axvline(milliseconds, color=FAINT, linewidth=0.8, linestyle="--", zorder=0)
    axes.set(xscale="log", ylim=(len(known) - 0.4, -0.6), xlabel="time per tick [ms]")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_yticks(range(len(known)), [line.label for line, _ in known])
    axes.tick_params(axis="y", length=0)
    axes.grid(False, axis="y")
    legend_above(figure, *_timing_legend(between), 4)
    return figure


def timing_ticks(lines: Iterable[Series]) -> list[float]:
    """Return the tick durations in these episodes [ms], sorted and without repetition."""
    cells = [group.cell for line in lines for group in line.groups]
    rates = {int(cell.env.get("control_frequency", facts_of(cell.task).frequency)) for cell in cells}
    return sorted(1e3 / rate for rate in rates)


def _timing_legend(between: list[float]) -> tuple[list[Any], list[str]]:
    from matplotlib.lines import Line2D

    entries = {
        "median": Line2D([], [], color=INK, marker="o", linestyle="none"),
        "99 %": Line2D([], [], color=INK, marker="|", markersize=8, markeredgewidth=1.4, linestyle="none"),
        "longest": Line2D([], [], color="white", marker="o", markeredgecolor=INK, linestyle="none"),
        f"{' and '.join(f'{each:g}' for each in between)} ms tick": Line2D(
            [], [], color=FAINT, linestyle="--", linewidth=0.8
        ),
    }
    return list(entries.values()), list(entries)


def clearance(lines: list[Series]) -> Any | None:
    """Draw the distribution of the smallest clearance per episode; None without obstacles."""
    known = [
        (line, np.sort(np.concatenate([1e3 * group.values("clearance") for group in line.groups]))) for line in lines
    ]
    known = [(line, found) for line, found in known if len(found)]
    if not known:
        return None
    figure, axes = new_figure(HEIGHT, len(known), COLUMNS)
    handles = []
    farthest = min(FARTHEST, max(20.0, *(float(np.quantile(found, 0.98)) for _, found in known)))
    for line, found in known:
        look, share = look_of(line.label), np.linspace(0.0, 1.0, min(len(found), CURVE) + 1)
        x = np.append(np.quantile(found, share, method="inverted_cdf"), max(farthest, found[-1]))
        style = {"color": look.color, "linestyle": look.line, "marker": look.marker, "markeredgewidth": 0.0}
        every = max(1, len(share) // 6)
        handles += axes.step(x, np.append(share, 1.0), where="post", markevery=(every // 2, every), **style)
    axes.set(xlim=(0.0, farthest), xlabel="smallest clearance of the episode [mm]; 0: contact")
    share_axis(axes, "share of episodes with less")
    legend_above(figure, handles, [line.label for line, _ in known], COLUMNS)
    return figure
