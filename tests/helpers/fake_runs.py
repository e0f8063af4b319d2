"""Comparisons on workers without a simulator. As a script: `onedemo run` with such workers."""

from __future__ import annotations

import sys
from contextlib import ExitStack
from pathlib import Path

from onedemo.bench.cli import main
from onedemo.bench.console import console
from onedemo.bench.episodes.run_folder import WHOLE, describe, open_folder
from onedemo.bench.run.comparison import Comparison
from onedemo.bench.run.run_progress import RunProgress
from onedemo.bench.workers import processes
from onedemo.bench.workers.dispatcher import Dispatcher
from onedemo.bench.workers.processes import Processes
from onedemo.configs.grid import load_grid

COMMAND = (sys.executable, str(Path(__file__).with_name("fake_worker.py")))
GRID = """
name: fake
task: stack
demonstration: stack
episodes: 12
video: false
sweep: {level: [L1, L2], settings.trim: [0.01, 0.02]}
"""
ONE_CELL = GRID.partition("sweep")[0]


def grid_in(folder, text=GRID):
    file = folder / "grid.yaml"
    file.write_text(text)
    return load_grid(file)


def dispatcher(workers=2, wall_seconds=60.0, log=None):
    return Dispatcher(Processes(COMMAND, log), workers, wall_seconds)


def completed(grid, folder, executor, shard=WHOLE, **options):
    """The records of a comparison that is run in a folder."""
    with ExitStack() as held:
        open_folder(folder, held, shard.name)
        describe(grid, folder, "a test")
        held.enter_context(executor)
        return Comparison(grid, folder, RunProgress(grid, console(stderr=True)), shard, **options).complete(executor)


if __name__ == "__main__":
    processes.command_of = lambda handler: COMMAND
    main()
