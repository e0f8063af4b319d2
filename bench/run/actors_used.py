"""Actor identities in the cells of a run: another actor under the same name makes another run."""

from __future__ import annotations

from dataclasses import replace

from ...baselines import POLICIES, load_actor
from ...baselines.errors import BadActor
from ...baselines.learning.actor_files import foreign
from ...baselines.learning.learned_policy import DIGITS, LearnedSettings, actor_file, sha256_of
from ...configs import BadConfig, Grid, RunConfig
from ...planner.errors import BadOption


def with_actors(grid: Grid) -> Grid:
    """Return the grid with the SHA-256 and the training steps of the actor of every learned cell.

    Raises:
        BadConfig: an actor does not exist, cannot be read, or has another SHA-256 than the config demands.
    """
    return replace(grid, cells=tuple(_with_actor(cell, grid) for cell in grid.cells))


def _with_actor(cell: RunConfig, grid: Grid) -> RunConfig:
    if cell.method not in POLICIES or POLICIES[cell.method].settings is not LearnedSettings:
        return cell
    source = grid.blame("settings")
    try:
        path = actor_file(cell.method, cell.task, cell.robot, str(cell.settings.get("checkpoint", "")))
        # behavior cloning counts gradient steps, not environment steps
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
