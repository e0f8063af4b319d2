"""Checks of a training config before anything is built: names, arguments, demonstration."""

from __future__ import annotations

from ...configs import BadConfig, RunConfig, TrainConfig
from ...envs.dotted_names import is_dotted
from ..run.config_checks import check_env, check_name, fitting_demonstration, known_names

OF_ONE_MOTION = ("sac-demo", "bc")
"""Algorithms that need the demonstration as an episode of the task."""
CHOSEN = ("reward", "goal_form", "end_on_success", "control_mode")
"""Environment arguments that the training's algorithm decides."""


def check_training(config: TrainConfig) -> None:
    """Refuse an impossible training: its names, arguments, demonstration or learner settings.

    Raises:
        BadConfig: an unknown name, argument or setting.
        BadDemonstration: the demonstration belongs to another task.
        MissingExtra: Stable-Baselines3 is not installed.
    """
    from ...baselines.learning.task_demonstrations import EPISODES
    from .learners import chosen

    known = {**known_names(), "task": sorted(EPISODES)}
    for key in ("task", "level", "robot"):
        check_name(config.name, key, getattr(config, key), known)
    if is_dotted(config.task) and config.algorithm in OF_ONE_MOTION:
        reason = (
            f"{config.algorithm} learns from an episode of the demonstration, which only {', '.join(EPISODES)} have"
        )
        raise BadConfig(config.name, "algorithm", f"{reason}; for your own task: sac, ppo, sac-her, residual")
    cell = RunConfig(name=config.name, task=config.task, demonstration=config.demonstration, env=config.env)
    check_env(cell, config.name)
    for key in CHOSEN:
        if key in config.env:
            raise BadConfig(config.name, f"env.{key}", "is chosen by the algorithm")
    fitting_demonstration(cell)
    chosen(config)
