"""Progress of a training between evaluations: every seed writes its step count, and the progress bar reads them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from ...configs import TrainConfig
from .folder import SEED, seeds_of

STEPS, EVERY = "steps", 250
"""File in a seed's folder; environment steps between two updates of it."""


def writing_steps(folder: Path) -> Callable[[dict[str, Any], dict[str, Any]], bool]:
    """Return a Stable-Baselines3 callback that writes the step count into a seed's folder."""
    last = [-EVERY]

    def callback(local: dict[str, Any], _: dict[str, Any]) -> bool:
        done = int(local["self"].num_timesteps)
        if done - last[0] >= EVERY:
            last[0] = done
            (folder / STEPS).write_text(f"{done}\n")
        return True

    return callback


def steps_done(config: TrainConfig, folder: Path, legs: dict[int, int]) -> int:
    """Return the known number of steps of all seeds.

    Args:
        config: the training.
        folder: folder of the training.
        legs: finished evaluations by seed.
    """
    total = 0
    for seed in seeds_of(config):
        try:
            written = int((folder / SEED.format(seed) / STEPS).read_text())
        except (OSError, ValueError):
            written = 0
        total += min(max(legs[seed] * config.evaluate_every, written), config.steps)
    return total


def progress(done: Callable[[], int], total: int, console: Any) -> Any:
    """Return a rich progress bar that polls the number of steps.

    Args:
        done: returns the number of steps done.
        total: number of steps of the training.
        console: console of rich.
    """
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    class Steps(Progress):
        def get_renderables(self) -> Iterable[Any]:
            for task in self.task_ids:
                self.update(task, completed=done())
            return super().get_renderables()

    counts = TextColumn("{task.completed:,.0f} of {task.total:,.0f} steps")
    bars = Steps(counts, BarColumn(), TimeRemainingColumn(), console=console, transient=True, refresh_per_second=2)
    bars.add_task("steps", total=total, completed=done())
    return bars
