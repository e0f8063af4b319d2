"""Which actors a run uses: written into its cells, so that another actor under the same name is another run."""

from __future__ import annotations

from dataclasses import replace

from ...baselines.factory import POLICIES
from ...baselines.learning.actor_files import foreign, load_actor
from ...baselines.learning.learned_policy import DIGITS, LearnedSettings, actor_file, sha256_of
from ...configs.grid import Grid
from ...configs.run_config import RunConfig
from ...planner.errors import BadActor, BadConfig, BadOption


def with_actors(grid: Grid) -> Grid:
    """The grid with what its cells' actors are: SHA-256 and how long they were trained.

    Raises:
        BadConfig: there is no such actor, it cannot be read, or it is not the one that the config means.
    """
    return replace(grid, cells=tuple(_with_actor(cell, grid) for cell in grid.cells))


def _with_actor(cell: RunConfig, grid: Grid) -> RunConfig:
    if cell.method not in POLICIES or POLICIES[cell.method].settings is not LearnedSettings:
        return cell
    source = grid.blame("settings")
    try:
        path = actor_file(cell.method, cell.task, cell.robot, str(cell.settings.get("checkpoint", "")))
        # a clone's steps are of the gradient
        steps = 0 if foreign(path) or cell.method == "bc" else load_actor(path).training.steps
    except (BadActor, BadOption) as error:
        reason = error.reason if isinstance(error, BadOption) else str(error)
        raise BadConfig(source, "settings.checkpoint", reason) from None
    found, wanted = sha256_of(path) or "", str(cell.settings.get("sha256", ""))
    if not found.startswith(wanted):
        raise BadConfig(source, "settings.sha256", f"{wanted} is wanted; {path} has {found[:DIGITS]}")
    return cell.model_copy(
        update={"settings": {**cell.settings, "sha256": wanted or found[:DIGITS], "training_steps": steps}}
    )
