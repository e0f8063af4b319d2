"""Figures of rates with their intervals: one per task and question, each one column of a paper wide."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from ..drawing.figure_style import legend_above, new_figure
from ..method_table import look_of, place_of
from ..statistics import Rate
from .groups import ORDERED, Group, rank

HEIGHT, COLUMNS = 2.2, 3
"""Height of a figure without its legend [inch]; number of columns of the legend."""
SLANTED, ROOM = 25.0, 0.55
"""Slope [degrees] of ticks that also name a task, and room for them [inch]."""
SPREAD = 0.62
"""Fraction of the distance between two ticks over which methods are spread, so that their intervals do not overlap."""
EDGES = (0.0, 0.1, 0.2, 0.3)
"""Speeds [m/s] that delimit the bins of scenarios."""


class Series(NamedTuple):
    """Line of a method in a figure: label, name of the method, and its groups of one task."""

    label: str
    method: str
    groups: list[Group]


def series_of(groups: Iterable[Group]) -> list[Series]:
    """Return the lines of one task's groups, in the order of methods."""
    found: dict[str, list[Group]] = {}
    for group in groups:
        found.setdefault(group.label, []).append(group)
    lines = [Series(label, each[0].cell.method, each) for label, each in found.items()]
    return sorted(lines, key=lambda line: (*place_of(line.method), line.label))


def _points(axes: Any, line: Series, x: np.ndarray, rates: list[Rate], *, joined: bool = True) -> Any:
    """Draw rates with their intervals, and return the handle for a legend."""
    look, shares = look_of(line.label), np.array([rate.share for rate in rates])
    low = shares - np.array([rate.low for rate in rates])
    high = np.array([rate.high for rate in rates]) - shares
    style = {"color": look.color, "marker": look.marker, "linestyle": look.line if joined else "none"}
    errors = np.maximum([low, high], 0.0)
    drawn = axes.errorbar(x, shares, yerr=errors, elinewidth=0.8, markeredgewidth=0.0, clip_on=False, **style)
    drawn[0].set_clip_on(False)
    return drawn


def share_axis(axes: Any, label: str) -> None:
    """Fix the y axis to the range 0 to 1.

    Args:
        axes: matplotlib axes.
        label: label of the y axis.
    """
    axes.set(ylim=(0.0, 1.0), ylabel=label)
    axes.set_yticks(np.linspace(0.0, 1.0, 6))
    axes.grid(False, axis="x")


def by_level(lines: list[Series]) -> Any:
    """Draw safe success against level, and task where an environment has several."""
    levels = list(dict.fromkeys(g.place for line in lines for g in line.groups))
    levels.sort(key=rank)
    tasks = any(g.place != g.setting.level for line in lines for g in line.groups)
    figure, axes = new_figure(HEIGHT + ROOM * tasks, len(lines), COLUMNS)
    handles = []
    for line, shift in zip(lines, _shifts(len(lines)), strict=True):
        known = {group.place: group.safe_success for group in line.groups if group.records}
        steps = [level for level in levels if level in known and level in ORDERED]
        alone = [level for level in levels if level in known and level not in ORDERED]
        for some, joined in ((steps, True), (alone, False)):
            if some:
                x = np.array([levels.index(level) for level in some]) + shift
                drawn = _points(axes, line, x, [known[level] for level in some], joined=joined)
                if len(handles) == 0 or handles[-1][1] != line.label:
                    handles.append((drawn, line.label))
    axes.set_xticks(range(len(levels)), levels)
    axes.set(xlim=(-0.5, len(levels) - 0.5), xlabel="task and level" if tasks else "level")
    if tasks:
        axes.tick_params(axis="x", labelrotation=SLANTED)
        for tick in axes.get_xticklabels():
            tick.set(ha="right", rotation_mode="anchor")
    share_axis(axes, "safe success")
    legend_above(figure, [h for h, _ in handles], [label for _, label in handles], COLUMNS)
    return figure


def _shifts(count: int) -> np.ndarray:
    return SPREAD * (np.arange(count) - 0.5 * (count - 1)) / max(count, 4)


def by_speed(lines: list[Series], speeds: dict[str, float]) -> Any | None:
    """Draw safe success against the speed of the fastest obstacle; None without known speeds.

    Args:
        lines: lines of one task.
        speeds: largest speed of an obstacle [m/s] by the scenario's fingerprint.
    """
    known = [(line, _by_bin(line, speeds)) for line in lines]
    known = [(line, bins) for line, bins in known if bins]
    if not known:
        return None
    figure, axes = new_figure(HEIGHT, len(known), COLUMNS)
    handles = []
    for (line, bins), shift in zip(known, _shifts(len(known)), strict=True):
        found = sorted(bins)
        rates = [Rate.of(sum(bins[k]), len(bins[k])) for k in found]
        handles.append(_points(axes, line, np.array(found) + shift, rates))
    words = ["still", *(f"{low:g} to {high:g}" for low, high in pairwise(EDGES))]
    most = max(max(bins) for _, bins in known)
    words += [f"above {EDGES[-1]:g}"][: most - len(EDGES) + 1]
    axes.set(xlim=(-0.5, most + 0.5), xlabel="largest speed of an obstacle [m/s]")
    axes.set_xticks(range(most + 1), words[: most + 1])
    share_axis(axes, "safe success")
    legend_above(figure, handles, [line.label for line, _ in known], COLUMNS)
    return figure


def _by_bin(line: Series, speeds: dict[str, float]) -> dict[int, list[bool]]:
    """Return safe success of the episodes in each bin of speeds; bin 0 is for static obstacles."""
    bins: dict[int, list[bool]] = {}
    for group in line.groups:
        for record in group.records:
            speed = speeds.get(record.scenario)
            if speed is not None:
                bins.setdefault(int(np.searchsorted(EDGES, speed - 1e-9)), []).append(record.safe_success)
    return bins
