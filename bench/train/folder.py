"""Layout of a training's folder, and the results written into it: curve as CSV, figure, best actor.

| file | content |
|---|---|
| `config.json` | the config with the changes of the command line |
| `environment.json` | machine, versions and the command |
| `seed-0/leg-00010/` | last complete training round of each seed: curve so far, weights, replay buffer, actor |
| `seed-0/tensorboard/` | losses, returns and evaluations for TensorBoard |
| `seed-0/steps` | steps done, updated between evaluations |
| `curve.csv` | every evaluation of every seed |
| `curve.png`, `curve.pdf` | success against steps, every seed drawn |
| `actor.json`, `actor.safetensors` | the last actor of the best seed |
"""

from __future__ import annotations

import csv
import io
import shutil
from pathlib import Path

from ...configs import TrainConfig
from ..atomic_files import write_whole
from .evaluations import Point, last_leg, numbers_of, points_of

CONFIG, SEED, CURVE, ACTOR = "config.json", "seed-{}", "curve.csv", "actor"
COLUMNS = ("seed", "steps", "episodes", "successes", "success", "return", "seconds")


def seeds_of(config: TrainConfig) -> range:
    """Return the seeds of a training."""
    return range(config.seed, config.seed + config.seeds)


def curve_of(folder: Path, seed: int) -> list[Point]:
    """Return the evaluations of a seed so far.

    Args:
        folder: folder of the training.
        seed: seed of the learner.

    Raises:
        BadConfig: the stored state is damaged.
    """
    leg = last_leg(folder / SEED.format(seed))
    return [] if leg is None else points_of(numbers_of(leg))


def actor_of_best(folder: Path, curves: dict[int, list[Point]]) -> int | None:
    """Copy the last actor of the seed with the most successes, then the highest return, into the training's folder.

    Args:
        folder: folder of the training.
        curves: evaluations by seed.

    Returns:
        The seed; None if nothing has been evaluated.
    """
    known = {seed: points[-1] for seed, points in curves.items() if points}
    if not known:
        return None
    best = max(known, key=lambda seed: (known[seed].success, sum(known[seed].returns), -seed))
    leg = last_leg(folder / SEED.format(best))
    assert leg
    for suffix in (".safetensors", ".json"):
        shutil.copyfile(leg / f"{ACTOR}{suffix}", folder / f"{ACTOR}{suffix}")
    return best


def write_curves(config: TrainConfig, folder: Path) -> list[str]:
    """Write the curve as CSV, the figure and the best actor; return the lines for the terminal.

    Args:
        config: the training.
        folder: folder of the training.
    """
    from .curve_figure import draw_curves, mean_interval, summary_rows

    curves = {seed: curve_of(folder, seed)[: config.legs] for seed in seeds_of(config)}
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(COLUMNS)
    for seed, points in curves.items():
        for point in points:
            mean, number = sum(point.returns) / len(point.returns), len(point.successes)
            found = (number, sum(point.successes), f"{point.success:.4f}", f"{mean:.3f}", point.seconds)
            rows.writerow([seed, point.steps, *found])
    write_whole(folder / CURVE, text.getvalue())
    title = f"{config.task}, {config.robot}, {config.level}"
    files = draw_curves({config.algorithm: (config.algorithm, list(curves.values()))}, folder / "curve", title)
    best = actor_of_best(folder, curves)
    ends = [points[-1] for points in curves.values() if points]
    low, high = mean_interval([point.successes for point in ends])
    share = sum(point.success for point in ends) / len(ends)
    interval = f"95 %: {low:.0%} to {high:.0%}; {len(ends)} seed{'s' * (len(ends) != 1)}"
    *_, middle, bottom, top = summary_rows(list(curves.values()))[-1]
    return [
        f"return {middle:.1f} (interquartile mean of all episodes, 95 %: {bottom:.1f} to {top:.1f})",
        f"{config.name}: {share:.0%} succeed after {ends[0].steps} steps ({interval})",
        f"curve   {folder / CURVE}",
        *(f"figure  {file}" for file in files),
        f"actor   {folder / ACTOR}.json (seed {best})",
    ]
