"""Style of figures: one column of a paper wide, in color-blind safe colors, with reproducible bytes."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

COLUMN = 3.5
"""Width of a column of a two-column paper [inch]."""
LEGEND_ROW = 0.155
"""Height of a row of a legend [inch]."""
DOTS = 300
"""Resolution of the PNG images [dots per inch]."""
INK, FAINT, GRID = "#222222", "#767676", "#e4e4e4"
STYLE: dict[Any, Any] = {
    "font.size": 8.0,
    "font.family": "DejaVu Sans",
    "axes.titlesize": 8.5,
    "axes.labelsize": 8.0,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "legend.fontsize": 7.0,
    "axes.linewidth": 0.6,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.0,
    "lines.markersize": 4.0,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "hatch.linewidth": 0.5,
    "legend.frameon": False,
    "legend.handlelength": 1.6,
    "legend.columnspacing": 1.0,
    "legend.handletextpad": 0.5,
    "pdf.fonttype": 42,
    "svg.fonttype": "path",
    "svg.hashsalt": "onedemo",
    "text.parse_math": False,
    "figure.dpi": 100.0,
}
"""Settings of matplotlib for all figures."""


@contextmanager
def styled() -> Iterator[None]:
    """Draw in this style inside the `with` block; the previous style returns afterwards."""
    import matplotlib

    with matplotlib.rc_context(STYLE):
        yield


def new_figure(height: float, entries: int, columns: int) -> tuple[Any, Any]:
    """Return a figure of one column's width with one axes.

    Args:
        height: height without the legend [inch].
        entries: number of entries of the legend.
        columns: number of columns of the legend.

    Returns:
        Figure and axes.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(COLUMN, height + LEGEND_ROW * -(-entries // columns)), layout="constrained")
    return figure, figure.add_subplot()


def legend_above(figure: Any, handles: list[Any], labels: list[str], columns: int) -> None:
    """Draw a legend over the figure's whole width above the axes, unless there are no entries.

    Args:
        figure: the figure.
        handles: handles of the entries.
        labels: labels of the entries.
        columns: largest number of columns.
    """
    if handles:
        figure.legend(handles, labels, loc="outside upper center", ncols=min(columns, len(handles)))


def saved(figure: Any, stem: Path) -> str:
    """Write a figure as .png and .pdf, without dates, and return it as SVG text.

    Args:
        figure: the figure.
        stem: path of the files without suffix.
    """
    stem.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(stem.with_suffix(".png"), dpi=DOTS, metadata={"Software": None})
    figure.set_layout_engine("none")  # the layout of the first format holds for all formats
    figure.savefig(stem.with_suffix(".pdf"), metadata={"CreationDate": None, "Producer": None, "Creator": None})
    drawing = io.StringIO()
    figure.savefig(drawing, format="svg", metadata={"Date": None, "Creator": None})
    return drawing.getvalue()
