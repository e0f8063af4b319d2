"""Page of `onedemo reproduce`: the measurements, and their agreement with the paper."""

from __future__ import annotations

import csv
import os
from collections.abc import Sequence
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

from ..atomic_files import write_whole
from ..console import counted
from ..document.document import Block, Code, Document, Entry, Heading, Link, Paragraph, Picture, Pictures, Table
from ..document.html_page import html_of
from ..document.markdown_page import markdown_of
from ..provenance import fingerprint
from .experiments import Drawing, Experiment

PAGE, HTML = "reproduce.md", "reproduce.html"
OPENING = (
    "Each task from ONE demonstration, no training. Success is judged by the simulator. The intervals are Wilson's "
    "(95 %); a handful of seeds shows the order of size only. The paper reports no success rates."
)
TREES_SAID = (
    "Mean +- standard deviation of the processor's time; the whole plan once, by the clock. The table: trees.csv."
)
LEVEL_MS, LEVEL_MS_STD, LOOP_MS = 0.0429, 0.0109, 0.1
"""Times [ms] printed in the paper, in C++: a level of the tree (mean, standard deviation), and an upper bound of a
controller loop."""
TIMES = ("experiment", "episodes", "tick_us_median", "tick_us_p99", "tick_us_max", "motion_s_median", "motion_s_max")
TREE_TIMES = (
    "scene", "planes", "levels", "plane_ms", "plane_ms_std", "detour_ms", "detour_ms_std", "detour_level_ms",
    "detour_level_ms_std", "plan_ms",
)  # fmt: skip
Row = dict[str, Any]


class Finished(NamedTuple):
    """Results of a finished experiment.

    Attributes:
        experiment: the experiment.
        rows: its rows of `summary.json`, or of the trees' times.
        pictures: paths relative to the page.
        video: path relative to the page; "" if there is none.
    """

    experiment: Experiment | Drawing
    rows: list[Row]
    pictures: tuple[str, ...]
    video: str


def write_page(output: Path, found: Sequence[Finished], took: str) -> list[Path]:
    """Write the page as Markdown and HTML, and the tables of times.

    Args:
        output: folder of the page.
        found: all finished experiments.
        took: duration of the last command and load of the machine.

    Returns:
        The two pages.
    """
    runs = [each for each in found if isinstance(each.experiment, Experiment)]
    trees = [each for each in found if isinstance(each.experiment, Drawing)]
    write_whole(output / "times.csv", _csv(TIMES, [time_row(each) for each in runs]))
    write_whole(output / "trees.csv", _csv(TREE_TIMES, [tree_row(row) for each in trees for row in each.rows]))
    document = Document("The paper's experiments, reproduced", [Paragraph(OPENING)])
    document.blocks += [
        *([results_table(runs)] if runs else []),
        *(block for each in found for block in _section(each, output)),
        *(_times(runs) if runs else []),
        Paragraph(f"Made on {_machine()}. The last command took {took}; what was finished before was not run again."),
    ]
    pages = [output / PAGE, output / HTML]
    for page, text in zip(pages, (markdown_of(document), html_of(document)), strict=True):
        write_whole(page, text)
    return pages


def results_table(runs: Sequence[Finished]) -> Table:
    """Return the table of results, with a row per experiment."""
    head = ["experiment", "success", "Wilson 95 %", "no unwanted contact", "obstacle touched", "nearest [mm]"]
    rows: list[list[Entry]] = []
    for each in runs:
        row = each.rows[0]
        interval = f"{row['wilson_low']:.2f} to {row['wilson_high']:.2f}"
        touched = "-" if row["clearance_mm_min"] is None else f"{row['touching']} of {row['episodes']}"
        rows.append([
            each.experiment.title, f"{row['successes']} of {row['episodes']}", interval, str(row["safe_successes"]),
            touched, _said(row["clearance_mm_min"]), _largest_error(row),
        ])  # fmt: skip
    return Table([*head, "largest error"], rows)


def _largest_error(row: Row) -> str:
    """Return value, unit and name of an error, short enough for a cell of the table."""
    what, _, unit = row["error"].rpartition(" [")
    for word in ("largest ", "share of "):
        what = what.removeprefix(word)
    return f"{_said(row['error_max'])} {unit[:-1]} ({what.removesuffix(' error')})"


def _section(each: Finished, output: Path) -> list[Block]:
    experiment = each.experiment
    sentence = trees_agree(each.rows) if isinstance(experiment, Drawing) else run_agrees(each.rows[0])
    colors = ["Blue: the demonstration.", "Magenta: the final paths."]
    if isinstance(experiment, Drawing):
        colors += ["Cyan: the collision-free path.", "Green: every tangent plane of the last tree."]
    else:
        among = each.rows[0]["clearance_mm_min"] is not None
        colors += ["Cyan: the detour round obstacles that were not demonstrated."] if among else []
        colors += ["Dashed: as executed."]
    shown = [
        Picture(file, (output / file).read_bytes(), f"{experiment.title} ({Path(file).stem})", "png")
        for file in each.pictures
    ]
    blocks: list[Block] = [
        Heading(2, experiment.title),
        Paragraph(f"Paper: {experiment.paper}"),
        Paragraph(f"{sentence} Differs: {experiment.here}."),
        *([Pictures(shown, " ".join(colors))] if shown else []),
    ]
    if isinstance(experiment, Drawing):
        return [*blocks, _tree_table(each.rows), Paragraph(TREES_SAID)]
    film = Table(["video", "file"], [["the first seed", Link(each.video, each.video)]])
    command = Code(f"onedemo run {experiment.config} {' '.join(experiment.overrides)}")
    return [*blocks, *([film] if each.video else []), command]


def run_agrees(row: Row) -> str:
    """Return a sentence on how a run agrees with the paper."""
    done, count = row["successes"], row["episodes"]
    failures = ", ".join(f"{reason} {times}" for reason, times in row["failures"].items())
    if done == count:
        said = f"Agrees: done from one demonstration in {'its only start' if count == 1 else f'all {count} starts'}"
    elif done:
        said = f"Agrees in {done} of {counted(count, 'start')}, the others failed ({failures})"
    else:
        said = f"Does not agree: none of {counted(count, 'start')} succeeded ({failures})"
    if row["clearance_mm_min"] is None:
        return f"{said}."
    if row["touching"]:
        return f"{said}; an obstacle was touched in {row['touching']} of {count}."
    return f"{said}; no obstacle was touched, the nearest was {row['clearance_mm_min']:.1f} mm away."


def trees_agree(rows: Sequence[Row]) -> str:
    """Return a sentence on how the trees' times agree with the paper."""
    judged = sum(row["judged"] for row in rows)
    planes, levels = ([row[key][0] for row in rows] for key in ("plane_ms", "detour_level_ms"))
    verdict = "Agrees" if judged == len(rows) else f"Agrees in {judged} of {len(rows)} scenes"
    shares = [plane / LEVEL_MS for plane in planes]
    return (
        f"{verdict}: trees of tangent planes lead round convex bodies, judged sound by other means; a plane at the "
        f"root with its eight children takes {1e3 * min(planes):.1f} to {1e3 * max(planes):.1f} us, "
        f"{min(shares):.2f} to {max(shares):.2f} of the {LEVEL_MS} +- {LEVEL_MS_STD} ms that the paper prints for a "
        f"level; with all that belongs to a detour {min(levels):.3f} to {max(levels):.3f} ms per level."
    )


def _tree_table(rows: Sequence[Row]) -> Table:
    head = ["scene", "planes", "levels", "a plane [us]", "a detour [ms]", "a detour, per level [ms]", "whole plan [ms]"]
    lines: list[list[Entry]] = []
    for row in rows:
        plane = _spread(*(1e3 * value for value in row["plane_ms"]))
        detour, level = _spread(*row["detour_ms"]), _spread(*row["detour_level_ms"])
        numbers = [str(row["planes"]), str(row["levels"]), plane, detour, level, f"{row['plan_ms']:.1f}"]
        lines.append([row["scene"], *numbers])
    return Table(head, lines)


def _times(runs: Sequence[Finished]) -> list[Block]:
    """Return the table of planning times and, separately, motion times."""
    head = ["experiment", "tick, median [us]", "tick, p99 [us]", "longest [ms]", "motion, median [s]", "longest [s]"]
    rows: list[list[Entry]] = []
    for each in runs:
        row = each.rows[0]
        longest = None if row["tick_us_max"] is None else 1e-3 * row["tick_us_max"]
        numbers = (row["tick_us_median"], row["tick_us_p99"], longest, row["seconds_median"], row["seconds_max"])
        rows.append([each.experiment.name, *map(_said, numbers)])
    ticks = [1e-3 * each.rows[0]["tick_us_median"] for each in runs]
    below = sum(tick < LOOP_MS for tick in ticks)
    said = (
        f"The planner's time for each tick of 20 ms, by the clock, as called from Python; what else the machine does "
        "shows in it; in the longest one a motion is planned with all its symmetric goals. The motion's time is "
        f"simulated. The paper prints less than {LOOP_MS} ms for a loop, in C++; the median tick is below that in "
        f"{below} of {len(runs)} experiments. Some of the times in the paper's table have no unit, so they are not "
        "compared. The table: times.csv."
    )
    return [Heading(2, "Times"), Table(head, rows), Paragraph(said)]


def time_row(each: Finished) -> Row:
    """Return a row of `times.csv`."""
    row = each.rows[0]
    keys = ("tick_us_median", "tick_us_p99", "tick_us_max", "seconds_median", "seconds_max")
    values = (each.experiment.name, row["episodes"], *(row[key] for key in keys))
    return dict(zip(TIMES, values, strict=True))


def tree_row(row: Row) -> Row:
    """Return a row of `trees.csv`."""
    times = [value for key in ("plane_ms", "detour_ms", "detour_level_ms") for value in row[key]]
    return dict(zip(TREE_TIMES, (row["scene"], row["planes"], row["levels"], *times, row["plan_ms"]), strict=True))


def _csv(columns: Sequence[str], rows: Sequence[Row]) -> str:
    text = StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _said(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"


def _spread(mean: float, deviation: float) -> str:
    return f"{mean:.2f} +- {deviation:.2f}"


def _machine() -> str:
    known = fingerprint()
    return f"{known['processor']} ({os.cpu_count()} cores), Python {known['python']}"
