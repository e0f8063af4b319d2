"""`onedemo reproduce`: the paper's experiments one by one, and one page about them.

| file | content |
|---|---|
| `reproduce.md`, `reproduce.html` | results, figures and agreement with the paper; the HTML page is self-contained |
| `times.csv`, `trees.csv` | the times |
| `figures/`, `videos/` | figure and video of the first seed of each experiment |
| `runs/` | run folders; see `run_folder` |
| `trees.json` | times of the escape trees, and a digest of their scenes |
"""

from __future__ import annotations

import json
import os
import shutil
import time
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ...configs import BadConfig, load_grid, shipped_config
from ...configs.run_config import digest_of
from ..atomic_files import write_whole
from ..console import COMMAND_LINE, console
from ..episodes.run_folder import FIGURE, VIDEO, written_json
from ..run.command import run_config
from .experiments import EXPERIMENTS, Drawing, Experiment, experiments_named
from .report import Finished, write_page

RUNS, FIGURES, VIDEOS, TREES = "runs", "figures", "videos", "trees.json"


def reproduce(names: Iterable[str], output: Path, *, episodes: int | None = None, video: bool = True) -> int:
    """Run the missing parts of the experiments, and write the page about all finished ones.

    Args:
        names: names of experiments; empty: all experiments.
        output: folder of the page.
        episodes: seeds per experiment; None: each experiment's own number.
        video: record videos.

    Returns:
        The exit code.

    Raises:
        UnknownName: no such experiment; the message lists all names.
        BadConfig: the folder cannot be created.
    """
    wanted, err = experiments_named(names), console(stderr=True)
    try:
        for name in (RUNS, FIGURES, VIDEOS):
            (output / name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadConfig(COMMAND_LINE, "--output", f"{output}: {error.strerror}") from None
    start, load = time.perf_counter(), os.getloadavg()[0]
    left = [each for each in wanted if finished(each, output, episodes) is None]
    work = {each.name: _work(each, episodes) for each in left}
    for number, each in enumerate(wanted, 1):
        done = sum(work[before.name] for before in wanted[: number - 1] if before in left)
        words = time_left(time.perf_counter() - start, done, sum(work.values()) - done)
        err.print(f"{number} of {len(wanted)}: {each.title} ({each.name}){words}")
        if isinstance(each, Drawing):
            draw_trees(each, output)
        elif code := run_config(each.config, changes(each, episodes, video=video), output / RUNS):
            return code
    seconds = time.perf_counter() - start
    found = [done for each in EXPERIMENTS if (done := finished(each, output, episodes)) is not None]
    loads = (load, os.getloadavg()[0])
    pages = write_page(output, found, f"{seconds / 60.0:.1f} minutes, load {loads[0]:.1f} to {loads[1]:.1f}")
    for page in pages:
        console().print(str(page))
    return 0


def _work(each: Experiment | Drawing, episodes: int | None) -> int:
    """Return a measure of an experiment's work: its episodes; drawings take about as long as one."""
    return 1 if isinstance(each, Drawing) else each.episodes if episodes is None else episodes


def time_left(seconds: float, done: int, left: int) -> str:
    """Return how long the rest will take, as far as what is done shows; "" if nothing is done or left.

    Args:
        seconds: time [s] so far.
        done: work done in it.
        left: work left.
    """
    return f", about {max(1, round(seconds * left / done / 60.0))} min left" if done and left else ""


def changes(experiment: Experiment, episodes: int | None, *, video: bool) -> list[str]:
    """Return an experiment's overrides of its config.

    Args:
        experiment: the experiment.
        episodes: number of seeds; None: the experiment's own number.
        video: record videos.
    """
    count = experiment.episodes if episodes is None else episodes
    own = [f"name={experiment.name}", f"episodes={count}", f"video={str(video).lower()}"]
    return [*own, *experiment.overrides]


def run_folder_of(experiment: Experiment, output: Path, episodes: int | None) -> Path:
    """Return the run folder of an experiment.

    Args:
        experiment: the experiment.
        output: folder of the page.
        episodes: see `changes`.
    """
    grid = load_grid(shipped_config(experiment.config), changes(experiment, episodes, video=True))
    return output / RUNS / f"{grid.name}-{grid.digest()}"


def finished(each: Experiment | Drawing, output: Path, episodes: int | None) -> Finished | None:
    """Return the results of an experiment, with its pictures and video copied next to the page.

    Args:
        each: the experiment or drawing.
        output: folder of the page.
        episodes: see `changes`.

    Returns:
        The results; None if the experiment has not been run.
    """
    if isinstance(each, Drawing):
        rows = written_json(output, TREES).get("rows")
        pictures = [f"{FIGURES}/{each.name}_{scene}.png" for scene in each.scenes]
        there = tuple(picture for picture in pictures if (output / picture).is_file())
        return Finished(each, rows, there, "") if rows else None
    folder = run_folder_of(each, output, episodes)
    rows = written_json(folder, "summary.json").get("rows")
    if not rows:
        return None
    for ending in (".png", ".pdf"):
        _copied((folder / FIGURE).with_suffix(ending), output / FIGURES / f"{each.name}{ending}")
    drawn = _copied(folder / FIGURE, output / FIGURES / f"{each.name}.png")
    filmed = _copied(folder / VIDEO, output / VIDEOS / f"{each.name}.mp4")
    pictures = (f"{FIGURES}/{each.name}.png",) if drawn else ()
    return Finished(each, rows, pictures, f"{VIDEOS}/{each.name}.mp4" if filmed else "")


def _copied(source: Path, target: Path) -> bool:
    """Copy a file if it exists; return whether it does."""
    if source.is_file():
        shutil.copyfile(source, target)
    return source.is_file()


def draw_trees(drawing: Drawing, output: Path) -> None:
    """Draw a drawing's scenes with all planes and time their trees, unless that was done before.

    Args:
        drawing: the drawing.
        output: folder of the page.
    """
    from ...configs.plan_scene import shipped_scene

    texts = [shipped_scene(scene).read_text(encoding="utf-8") for scene in drawing.scenes]
    key = digest_of([list(drawing.scenes), texts, drawing.repeats])
    before = written_json(output, TREES)
    pictures = [output / FIGURES / f"{drawing.name}_{scene}.png" for scene in drawing.scenes]
    if before.get("of") == key and all(picture.is_file() for picture in pictures):
        return
    with console(stderr=True).status("growing and drawing the trees (compiled on first use: about a minute)"):
        rows = [
            _drawn(scene, picture, drawing.repeats) for scene, picture in zip(drawing.scenes, pictures, strict=True)
        ]
    write_whole(output / TREES, json.dumps({"of": key, "rows": rows}, indent=1) + "\n")


def _drawn(scene: str, picture: Path, repeats: int) -> dict[str, Any]:
    from ...configs.plan_scene import load_scene, shipped_scene
    from ...planner import certify
    from ..plan.command import plan_in
    from ..plan.figure import draw_plan
    from ..plan.tree_times import timed_tree

    planned = plan_in(load_scene(shipped_scene(scene)))
    certificate = certify(planned.plan.log())
    draw_plan(planned, certificate, [picture, picture.with_suffix(".pdf")], every_plane=True)
    return {**asdict(timed_tree(planned, repeats)), "judged": certificate.ok}
