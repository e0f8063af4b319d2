"""Output of a geometric run: a CSV for each track, tables, figures."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from ..atomic_files import write_whole
from . import tables
from .jobs import TRACKS, Row, results_hash
from .suite import GeometricSuite, suite_line

SUMMARY = "geometric.md"


def write_geometric(folder: Path, suite: GeometricSuite, rows: Sequence[Row]) -> None:
    """Write CSV files, tables and figures into the folder.

    Args:
        folder: folder of the results.
        suite: the scenarios.
        rows: rows of all tracks.
    """
    from .figures import draw

    for track in TRACKS:
        mine = [row for row in rows if row["track"] == track]
        if mine:
            write_whole(folder / f"{track}.csv", csv_text(mine))
    write_whole(folder / SUMMARY, summary(suite, rows))
    draw(folder, rows)


def csv_text(rows: Sequence[Row]) -> str:
    """Return rows as CSV; missing numbers are empty."""
    keys = list(dict.fromkeys(key for row in rows for key in row))
    out = io.StringIO()
    writer = csv.DictWriter(out, keys, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()


def summary(suite: GeometricSuite, rows: Sequence[Row]) -> str:
    """Return the page with all tables as Markdown.

    Args:
        suite: the scenarios.
        rows: rows of all tracks.
    """
    lines = [
        "# Geometric tier",
        "",
        f"{suite_line(suite)}. Seed {suite.seed}. Results {results_hash(rows)[:12]}.",
        "",
        "Medians with 95 % bootstrap intervals, shares with Wilson's. The same scenarios for every method.",
        f"The constraint is kept up to {tables.TILT:g}° of tilt over the demonstration's and {1e3 * tables.DRIFT:g} mm",
        "of rim drift. What keeps the arm in mind (`screw`, `rrt`) has the harder task: the others move a free tool.",
        "",
        "## Scenarios",
        "",
        *tables.feasibility(suite),
        "## Levels",
        "",
        *tables.levels(rows),
        "## With obstacles, in pairs",
        "",
        *tables.paired(rows),
        "## Few key poses",
        "",
        *tables.sparse(rows),
        "## Other frames: how far the path moves [mm], median and largest",
        "",
        *tables.frames(rows),
    ]
    return "\n".join(lines).rstrip() + "\n"
