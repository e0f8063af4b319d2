"""Drawing and writing of a report's figures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..document.document import Picture, Pictures
from ..document.untrusted_text import slug
from ..drawing.figure_style import saved, styled
from .groups import Group, groups_by_environment, groups_by_task
from .outcome_figures import clearance, failures, timing
from .rate_figures import Series, by_level, by_speed, series_of
from .read_runs import Run, speeds_of

FOLDER = "figures"
KINDS = ("success", "speed", "failures", "clearance", "timing")
"""Kinds of figures, one for each question; file names begin with them."""
SIDE_BY_SIDE = ("success", "failures")
"""Kinds that show every level by itself, hence all tasks of an environment; the others pool the levels of a task."""


def drawn(run: Run, groups: list[Group], output: Path) -> dict[str, list[Picture]]:
    """Draw all figures, one per kind, task or environment, and robot if there are data, and write them as PNG and PDF.

    Args:
        run: the run.
        groups: groups of the run.
        output: folder of the report.

    Returns:
        Pictures by kind.
    """
    speeds = speeds_of(run.suite)
    draw: dict[str, Callable[[list[Series]], Any]] = {
        "success": by_level,
        "speed": lambda lines: by_speed(lines, speeds),
        "failures": failures,
        "clearance": clearance,
        "timing": timing,
    }
    found: dict[str, list[Picture]] = {kind: [] for kind in KINDS}
    with styled():
        for kind in KINDS:
            parts = groups_by_environment(groups) if kind in SIDE_BY_SIDE else groups_by_task(groups)
            for (task, robot), some in parts.items():
                lines = series_of(group for group in some if group.records)
                title = f"{task}, {robot}"
                figure = draw[kind](lines) if lines else None
                if figure is not None:
                    figure.axes[0].set_title(title)
                    stem = f"{FOLDER}/{kind}-{slug(task)}-{slug(robot)}"
                    svg = saved(figure, output / stem)
                    found[kind].append(Picture(f"{stem}.png", svg.encode(), f"{kind}: {title}"))
    return found


def with_caption(pictures: list[Picture], caption: str) -> list[Pictures]:
    """Return one block of pictures with a caption, or no block without pictures.

    Args:
        pictures: pictures of one kind.
        caption: their common caption.
    """
    return [Pictures(pictures, caption)] if pictures else []
