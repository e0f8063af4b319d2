"""`onedemo run`: a config in, a run folder out; interrupted runs continue where they stopped."""

from __future__ import annotations

import os
import shlex
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from ...configs import BadConfig, load_grid, shipped_config
from ...configs.grid import grid_of
from ..console import console, counted
from ..episodes.run_folder import LOG, alone, describe, merge, open_folder, parsed_shard, recorded
from ..episodes.scenarios import read_suite
from ..interruption import ended
from ..workers.executors import executor_for
from .actors_used import with_actors
from .comparison import Comparison
from .config_checks import check_grid
from .contents_used import with_contents
from .episode_jobs import EpisodeJobs
from .finish import film, report, show
from .own_task import is_own_task, own_config
from .run_progress import RunProgress

SHIPPED_FOLDERS = (".", os.path.join("configs", "bench"))


def run_config(
    config: str,
    overrides: list[str],
    output: Path,
    *,
    shard: str | None = None,
    retry: bool = False,
    quiet: bool = False,
) -> int:
    """Run a config and write its run folder.

    Args:
        config: config file, the name of a shipped config, or the dotted path of a task.
        overrides: `key=value` changes to the config.
        output: parent folder of the run folder.
        shard: part i of n of the episodes, as "i/n"; None: all episodes.
        retry: rerun the episodes that were lost with their workers.
        quiet: print only the run folder and errors.

    Returns:
        The exit code.

    Raises:
        BadConfig: the config, an override or the demonstration cannot be used.
        RunBusy: another process writes into the same folder.
    """
    part = parsed_shard(shard)
    if is_own_task(config):
        grid = grid_of(own_config(config, overrides), config, overrides)
    else:
        grid = load_grid(config_path(config), overrides)
    check_grid(grid)
    grid = with_contents(with_actors(grid))
    folder = output / f"{grid.name}-{grid.digest()}"
    err = console(stderr=True, quiet=quiet)

    def work() -> list[str]:
        with ExitStack() as held:
            open_folder(folder, held, part.name)
            describe(grid, folder, shlex.join(["onedemo", "run", config, *overrides]))
            return _completed(Comparison(grid, folder, RunProgress(grid, err), part, retry=retry), err)

    return ended(work, folder, "finished episodes", quiet=quiet)


def config_path(config: str) -> Path:
    """Return the path of a config file, or of the shipped config with this name or source-tree path.

    Raises:
        BadConfig: no such file.
        UnknownName: no such config is shipped.
    """
    path = Path(config)
    if path.suffix == ".py":
        raise BadConfig(config, "", f"is no config; a task in it is {path.stem}:NAME")
    if path.exists():
        return path
    if path.suffix in ("", ".yaml") and str(path.parent) in SHIPPED_FOLDERS:
        if path.with_suffix(".py").is_file():
            raise BadConfig(config, "", f"no such config; a task in {path.stem}.py is {path.stem}:NAME")
        return shipped_config(path.stem)
    raise BadConfig(path, "", "no such file")


def _completed(comparison: Comparison, err: Any) -> list[str]:
    """Run the missing episodes and, once none is missing, write the report; return the lines for the terminal."""
    grid, folder, shard = comparison.grid, comparison.folder, comparison.shard
    episodes = sum(cell.episodes for cell in grid.cells)
    with executor_for(grid.settings, EpisodeJobs, episodes, folder / LOG) as executor:
        comparison.complete(executor)
        suite = read_suite(folder)
        assert suite
        # other shards may have finished in the meantime
        records, _ = recorded(folder, grid.cells, suite)
        missing = sum(len(suite.feasible(cell)) for cell in grid.cells) - len(records)
        if missing:
            return [
                f"part {shard.index} of {shard.count} is done; missing of other parts: {counted(missing, 'episode')}"
            ]
        with alone(folder, "pictures"):
            if len(grid.cells) == 1:
                with err.status("drawing the first episode"):
                    show(executor, grid, folder)
            if grid.cells[0].video:
                with err.status("recording failures"):
                    film(executor, grid, folder, records.values())
    merge(folder, records.values(), list(grid.cells))
    with err.status("drawing the report"):
        return report(folder)
