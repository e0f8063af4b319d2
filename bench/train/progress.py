"""How far a training is, between its evaluations too: every seed writes down its steps, the bar reads them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from ...configs.train_config import TrainConfig
from .folder import SEED, seeds_of

STEPS, EVERY = "steps", 250
"""File in a seed's folder; steps of the environment after which it is renewed."""


def writing_steps(folder: Path) -> Callable[[dict[str, Any], dict[str, Any]], bool]:
    """A callback of Stable-Baselines3 that writes down the steps done so far."""
    last = [-EVERY]

    def callback(local: dict[str, Any], _: dict[str, Any]) -> bool:
        done = int(local["self"].num_timesteps)
        if done - last[0] >= EVERY:
            last[0] = done
            (folder / STEPS).write_text(f"{done}\n")
        return True

    return callback


def steps_done(config: TrainConfig, folder: Path, legs: dict[int, int]) -> int:
    """Steps of all seeds, as far as is known.

    Args:
        config: of the training.
        folder: of it.
        legs: how many evaluations each seed has had.
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
    """A bar that asks for itself how many steps are done.

    Args:
        done: says how many.
        total: of them.
        console: rich's.
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
