"""`onedemo curves`: trainings of one task in one figure, next to methods that need no environment steps."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from pathlib import Path

from ...baselines.learning.actor_card import METHOD as RESIDUAL
from ...baselines.learning.learned_policy import METHODS
from ...configs import BadConfig
from ..atomic_files import write_whole
from ..console import COMMAND_LINE, console, labeled
from ..document.document import Block, Document, Entry, Picture, Pictures, Table
from ..document.markdown_page import markdown_of
from ..report.groups import groups_of
from ..report.read_runs import read_run
from ..statistics import Rate
from ..train.curve_figure import Line, draw_curves, mean_interval, summary_rows
from ..train.folder import CONFIG
from .read_trainings import Training, by_label, read_training

COLUMNS = ("method", "steps", "seeds", "success", "low", "high", "return", "return_low", "return_high")
"""Columns of the CSV file."""
HEAD = ("method", "environment steps", "seeds", "success", "95 %", "return", "95 %", "minutes a seed")
CAPTION = (
    "Success and return of episodes on frozen scenarios. Returns are sums of the dense reward, at most 150; what is "
    "left of an episode after its success counts 1 a step. Thin: each seed. Thick: all seeds, for returns the "
    "interquartile mean of all episodes, with 95 % intervals (bootstrap of seeds, then of their episodes). Dashed: "
    "what needs no step of the environment."
)


def run_curves(folders: list[Path], run: Path | None, output: Path) -> None:
    """Draw the curves, write their numbers, and print the paths of the files.

    Args:
        folders: folders of trainings.
        run: run folder with methods that need no training, or None.
        output: folder for the files.

    Raises:
        BadConfig: a folder holds no training or one of another task, nothing has been evaluated, or the run has no
            method without training.
    """
    found = evaluated([read_training(folder) for folder in {folder.resolve(): folder for folder in folders}.values()])
    setting = found[0].setting
    for training in found:
        if training.setting != setting:
            reason = f"{' '.join(training.setting)} is not {' '.join(setting)}: draw them apart"
            raise BadConfig(training.folder / CONFIG, "task", reason)
    trainings = by_label(found)
    shown = rates_of(run, setting) if run else {}
    lines = {label: Line(method, rate.share) for label, (method, rate) in shown.items()}
    stepping = {}
    for label, training in trainings.items():
        if training.config.algorithm == "bc":
            lines[label] = Line("bc", summary_rows(training.curves)[-1][1])
        else:
            stepping[label] = training.config.algorithm, training.curves
    task, robot, level = setting
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = "is a file, not a folder" if output.exists() else error.strerror or str(error)
        raise BadConfig(COMMAND_LINE, "--output", f"{output}: {reason}") from None
    stem = output / f"curves-{task.replace('_', '-')}-{robot.lower()}"
    files = draw_curves(stepping, stem, f"{task}, {robot}, {level}", lines) if stepping else []
    blocks: list[Block] = [table_of(trainings, {label: rate for label, (_, rate) in shown.items()})]
    if files:
        blocks.append(Pictures([Picture(files[0].name, b"", "success and return against steps")], CAPTION))
    title = f"{task}, {robot}, {level}: one demonstration, or N steps"
    write_whole(stem.with_suffix(".csv"), csv_of(trainings))
    write_whole(stem.with_suffix(".md"), markdown_of(Document(title, blocks)))
    for file in (*files, stem.with_suffix(".csv"), stem.with_suffix(".md")):
        console().print(str(file))


def evaluated(trainings: list[Training]) -> list[Training]:
    """Return the trainings that have an evaluation; the others are named on standard error.

    Raises:
        BadConfig: no training has one.
    """
    found = [training for training in trainings if training.curves]
    if not found:
        raise BadConfig(trainings[0].folder, "", "nothing has been evaluated yet")
    for training in trainings:
        if not training.curves:
            text = f"{training.folder}: nothing has been evaluated yet"
            console(stderr=True).print(labeled("left out", "yellow", text))
    return found


def rates_of(run: Path, setting: tuple[str, str, str]) -> dict[str, tuple[str, Rate]]:
    """Return the methods of a run that need no training, with their success rates.

    Args:
        run: run folder.
        setting: task, robot and level.

    Returns:
        Method and rate, by label.

    Raises:
        BadConfig: the run has no such method in this setting.
    """
    groups = [group for group in groups_of(read_run(run)) if group.records]
    found = [group for group in groups if group.setting == setting and group.cell.method not in (*METHODS, RESIDUAL)]
    if not found:
        there = ", ".join(sorted({f"{group.label} on {' '.join(group.setting)}" for group in groups})) or "nothing"
        reason = f"{run} has no method that needs no training on {' '.join(setting)}; there is {there}"
        raise BadConfig(COMMAND_LINE, "--run", reason)
    return {group.label: (group.cell.method, group.success) for group in found}


def table_of(trainings: Mapping[str, Training], shown: Mapping[str, Rate]) -> Table:
    """Return the table of results.

    A training's row is its last evaluation that all of its seeds have had.

    Args:
        trainings: trainings by label.
        shown: success rates of methods without training, by label.
    """
    rows: list[list[Entry]] = [
        [label, "0", "", f"{rate.share:.0%} of {rate.episodes}", f"{rate.low:.0%} to {rate.high:.0%}", "", "", ""]
        for label, rate in shown.items()
    ]
    for label, training in trainings.items():
        curves = training.curves
        steps, share, *_, middle, bottom, top = summary_rows(curves)[-1]
        last = [points[min(map(len, curves)) - 1] for points in curves]
        low, high = mean_interval([point.successes for point in last])
        minutes = sum(point.seconds for point in last) / len(last) / 60.0
        counted = "0" if training.config.algorithm == "bc" else f"{steps:,}".replace(",", " ")
        success = f"{share:.0%} of {sum(len(point.successes) for point in last)}", f"{low:.0%} to {high:.0%}"
        earned = f"{middle:.1f}", f"{bottom:.1f} to {top:.1f}"
        rows.append([label, counted, str(len(last)), *success, *earned, f"{minutes:.{0 if minutes >= 1.0 else 1}f}"])
    return Table(list(HEAD), rows, 1)


def csv_of(trainings: Mapping[str, Training]) -> str:
    """Return the CSV text of all evaluations that all seeds have had; the steps of "bc" are gradient steps."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(COLUMNS)
    for label, training in trainings.items():
        for steps, *numbers in summary_rows(training.curves):
            rows.writerow([label, int(steps), len(training.curves), *(f"{number:.4f}" for number in numbers)])
    return text.getvalue()
