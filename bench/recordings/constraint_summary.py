"""Constraints of a demonstration in words and in a figure: what is kept, where, and within which bounds."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...planner import Demonstration, PosePath
from ...planner.imitation.constraint import Constraint
from ...planner.imitation.kept_components import found_constraint
from ..drawing.figure_style import DOTS, FAINT, INK, styled

WIDTH, PANEL = 7.0, 1.9
"""Width of the figure, and height of a row of panels [inch]."""
COLUMNS = 3
"""Largest number of panels in a row."""
CARRIED, GUIDED = "#e6eefc", "#fbe6f6"
"""Colors of the two stretches."""
MILLIMETERS = 1e3


class ShownConstraint(NamedTuple):
    """A motion of a demonstration and what it keeps.

    Attributes:
        name: of the motion.
        path: of the hand.
        constraint: found in the path.
    """

    name: str
    path: PosePath
    constraint: Constraint


def constraints_of(demonstration: Demonstration) -> list[ShownConstraint]:
    """Return the constraints of the motions that carry something; of all motions if nothing says which of them do."""
    carries = [each for each in demonstration.segments if each.held] or list(demonstration.segments)
    named = [(each.name, demonstration.segment_path(each.name)) for each in carries]
    named = named or [("the whole path", demonstration.path)]
    return [ShownConstraint(name, path, found_constraint(path)) for name, path in named]


def constraint_lines(demonstration: Demonstration) -> list[str]:
    """Return what a demonstration keeps, a line for each motion that carries something."""
    return [f"{each.name}: {in_words(each)}" for each in constraints_of(demonstration)]


def in_words(shown: ShownConstraint) -> str:
    """Return what a motion keeps, in words."""
    constraint, lengths = shown.constraint, shown.path.lengths()
    bound, spread = (math.degrees(value) for value in (constraint.bound, constraint.spread))
    words = []
    if constraint.components == 2:
        words.append(f"held upright as grasped within {bound:.1f} deg (shown {spread:.1f})")
    elif constraint.components == 1:
        words.append(f"turned against gravity as shown and no other way, within {bound:.1f} deg")
    if constraint.guided < constraint.count:
        share = 100.0 * lengths[constraint.guided] / max(lengths[-1], 1e-12)
        off, turned = MILLIMETERS * constraint.position_bound, math.degrees(constraint.rotation_bound)
        where = f"from {share:.0f} % of the path on" if constraint.guided else "all along"
        words.append(f"{where} guided along the path relative to the goal, within {off:.0f} mm and {turned:.1f} deg")
    return "; ".join(words) or "nothing is kept but by imitation"


def draw_constraints(demonstration: Demonstration, file: Path) -> None:
    """Draw how far the vertical is from what each motion keeps, and where the object is guided.

    Args:
        demonstration: the demonstration.
        file: .png, .pdf or .svg.
    """
    from matplotlib.figure import Figure

    shown = constraints_of(demonstration)
    columns = min(len(shown), COLUMNS)
    rows = -(-len(shown) // columns)
    with styled():
        figure = Figure(figsize=(WIDTH, PANEL * rows), layout="constrained")
        for k, each in enumerate(shown):
            _draw(figure.add_subplot(rows, columns, k + 1), each)
        figure.savefig(file, dpi=DOTS)


def _draw(axes: Any, shown: ShownConstraint) -> None:
    constraint, lengths = shown.constraint, shown.path.lengths()
    at = lengths[min(constraint.guided, len(lengths) - 1)]
    if constraint.components:
        axes.axvspan(0.0, at, color=CARRIED, zorder=0, linewidth=0)
        axes.plot([0.0, at], [math.degrees(constraint.bound)] * 2, color=INK, linestyle="--")
        axes.text(0.0, math.degrees(constraint.bound), " bound", va="bottom", fontsize=6.5)
    if constraint.guided < constraint.count:
        axes.axvspan(at, lengths[-1], color=GUIDED, zorder=0, linewidth=0)
        axes.text(
            0.5 * (at + lengths[-1]), 0.02, "guided", transform=axes.get_xaxis_transform(), ha="center", fontsize=6.5
        )
    axes.plot(lengths, np.degrees(constraint.deviations(shown.path)), color="#1f4fd8", linewidth=1.4)
    top = 2.0 * math.degrees(constraint.bound) if math.isfinite(constraint.bound) else 10.0
    axes.set(
        xlim=(0.0, max(lengths[-1], 1e-6)), ylim=(0.0, top), xlabel="path length [m]", ylabel="off what is kept [deg]"
    )
    axes.set_title(shown.name, fontsize=7.0)
    axes.tick_params(colors=FAINT)
