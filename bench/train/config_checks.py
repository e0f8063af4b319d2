"""Checks of a training config before anything is built: names, arguments, demonstration."""

from __future__ import annotations

from ...configs.run_config import RunConfig
from ...configs.train_config import TrainConfig
from ...planner.errors import BadConfig
from ..run.config_checks import check_env, check_name, fitting_demonstration, known_names

CHOSEN = ("reward", "goal_form", "end_on_success", "control_mode")
"""Arguments of environments that the algorithm of a training chooses."""


def check_training(config: TrainConfig) -> None:
    """Refuse a training that cannot be: its names, its arguments, its demonstration.

    Raises:
        BadConfig: an unknown name or argument.
        BadDemonstration: the demonstration is of something else.
    """
    from ...baselines.learning.task_demonstrations import EPISODES
    from .learners import chosen

    known = {**known_names(), "task": sorted(EPISODES)}
    for key in ("task", "level", "robot"):
        check_name(config.name, key, getattr(config, key), known)
    cell = RunConfig(name=config.name, task=config.task, demonstration=config.demonstration, env=config.env)
    check_env(cell, config.name)
    for key in CHOSEN:
        if key in config.env:
            raise BadConfig(config.name, f"env.{key}", "is chosen by the algorithm")
    fitting_demonstration(cell)
    chosen(config)
