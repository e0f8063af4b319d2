"""`onedemo curves`: trainings of one task in one figure, beside what needs no step of the environment."""

from __future__ import annotations

import csv
import io
import json
from collections import Counter
from pathlib import Path

from pydantic import ValidationError

from ..baselines.learned import METHODS
from ..baselines.residual import METHOD as RESIDUAL
from ..configs.training import TrainConfig
from ..planner.errors import BadConfig
from .console import COMMAND_LINE, console
from .document import Block, Document, Entry, Picture, Pictures, Table
from .files import write_whole
from .groups import groups_of
from .learning_curves import Curves, Line, draw_curves, mean_interval, summary_rows
from .markdown_page import markdown_of
from .methods import place_of
from .run_reading import read_run
from .training_folder import CONFIG, curve_of, seeds_of

COLUMNS = ("method", "steps", "seeds", "success", "low", "high", "return", "return_low", "return_high")
HEAD = ("method", "environment steps", "seeds", "success", "95 %", "return", "95 %", "minutes a seed")
CAPTION = (
    "Success and return (dense, at most 150; a success counts 1 for each step that it saved) of episodes on frozen "
    "scenarios. Thin: each seed. Thick: all seeds, for returns the interquartile mean of all episodes, with 95 % "
    "intervals (bootstrap of seeds, then of their episodes). Dashed: what needs no step of the environment."
)

Trained = tuple[TrainConfig, Curves]
"""A training's config, and the evaluations of each seed."""


def run_curves(trainings: list[Path], run: Path | None, output: Path) -> None:
    """Draw the curves, write their numbers, and say where they are.

    Raises:
        BadConfig: a folder is of no training or of another task, or the run has no method that needs no training.
    """
    found = [(*read_training(folder), folder) for folder in trainings]
    first = found[0][0]
    setting = (first.task, first.robot, first.level)
    for config, _, folder in found:
        if (config.task, config.robot, config.level) != setting:
            reason = f"{config.task} {config.robot} {config.level} is not {' '.join(setting)}: draw them apart"
            raise BadConfig(folder / CONFIG, "task", reason)
    read = by_label([(config, curves) for config, curves, _ in found])
    lines = lines_of(run, setting) if run else {}
    stepping = {}
    for label, (config, curves) in read.items():
        if config.algorithm == "bc":
            lines[label] = Line("bc", summary_rows(curves)[-1][1])
        else:
            stepping[label] = config.algorithm, curves
    output.mkdir(parents=True, exist_ok=True)
    stem = output / f"curves-{first.task.replace('_', '-')}-{first.robot.lower()}"
    files = draw_curves(stepping, stem, f"{first.task}, {first.level}", lines) if stepping else []
    blocks: list[Block] = [table_of(read)]
    if files:
        blocks.append(Pictures([Picture(files[0].name, b"", "success and return against steps")], CAPTION))
    title = f"{first.task}, {first.robot}, {first.level}: one demonstration, or N steps"
    write_whole(stem.with_suffix(".csv"), csv_of(read))
    write_whole(stem.with_suffix(".md"), markdown_of(Document(title, blocks)))
    for file in (*files, stem.with_suffix(".csv"), stem.with_suffix(".md")):
        console().print(str(file))


def by_label(read: list[Trained]) -> dict[str, Trained]:
    """By algorithm, in the order of tables; where there are several of one, by name and digest."""
    several = Counter(config.algorithm for config, _ in read)
    read = sorted(read, key=lambda pair: place_of(pair[0].algorithm))
    return {
        config.algorithm if several[config.algorithm] == 1 else f"{config.name} {config.digest()[:4]}": (config, curves)
        for config, curves in read
    }


def read_training(folder: Path) -> Trained:
    """The config of a training's folder, and the evaluations of its seeds so far.

    Raises:
        BadConfig: it is none, or nothing has been evaluated.
    """
    file = folder / CONFIG
    try:
        config = TrainConfig.model_validate(json.loads(file.read_text(encoding="utf-8")))
    except (OSError, ValueError, ValidationError) as error:
        raise BadConfig(
            file, "", f"is not a training's ({type(error).__name__}); give a folder of onedemo train"
        ) from None
    curves = [points for seed in seeds_of(config) if (points := curve_of(folder, seed))]
    if not curves:
        raise BadConfig(folder, "", "nothing has been evaluated yet")
    return config, curves


def lines_of(run: Path, setting: tuple[str, str, str]) -> dict[str, Line]:
    """The methods of a run on a setting that need no training.

    Raises:
        BadConfig: the run has none on it.
    """
    groups = [group for group in groups_of(read_run(run)) if group.setting == setting and group.records]
    found = {group.label: group for group in groups if group.cell.method not in (*METHODS, RESIDUAL)}
    if not found:
        raise BadConfig(COMMAND_LINE, "--run", f"{run} has no method that needs no training on {' '.join(setting)}")
    return {label: Line(group.cell.method, group.success.share) for label, group in found.items()}


def table_of(read: dict[str, Trained]) -> Table:
    """Each training at its end, or as far as all of its seeds have come."""
    rows: list[list[Entry]] = []
    for label, (config, curves) in read.items():
        steps, share, *_, middle, bottom, top = summary_rows(curves)[-1]
        last = [points[min(map(len, curves)) - 1] for points in curves]
        low, high = mean_interval([point.successes for point in last])
        minutes = sum(point.seconds for point in last) / len(last) / 60.0
        counted = "0" if config.algorithm == "bc" else f"{steps:,}".replace(",", " ")
        success = f"{share:.0%} of {sum(len(point.successes) for point in last)}", f"{low:.0%} to {high:.0%}"
        earned = f"{middle:.1f}", f"{bottom:.1f} to {top:.1f}"
        rows.append([label, counted, str(len(last)), *success, *earned, f"{minutes:.0f}"])
    return Table(list(HEAD), rows, 1)


def csv_of(read: dict[str, Trained]) -> str:
    """All evaluations that all seeds have had; steps of "bc" are of the gradient."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(COLUMNS)
    for label, (_, curves) in read.items():
        for steps, *numbers in summary_rows(curves):
            rows.writerow([label, int(steps), len(curves), *(f"{number:.4f}" for number in numbers)])
    return text.getvalue()
