"""Checks of a training config before anything is built: names, arguments, demonstration."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...configs import BadConfig, RunConfig, TrainConfig
from ...envs import TASKS
from ...envs.dotted_names import is_dotted
from ...planner.errors import BadOption
from ..run.config_checks import check_env, check_name, fitting_demonstration, known_names

if TYPE_CHECKING:
    from ...planner import Demonstration

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
    from .learners import chosen

    known = {**known_names(), "task": sorted(name for name, facts in TASKS.items() if facts.playback is not None)}
    for key in ("task", "level", "robot"):
        check_name(config.name, key, getattr(config, key), known)
    cell = RunConfig(name=config.name, task=config.task, demonstration=config.demonstration, env=config.env)
    check_env(cell, config.name)
    for key in CHOSEN:
        if key in config.env:
            raise BadConfig(config.name, f"env.{key}", "is chosen by the algorithm")
    demonstration = fitting_demonstration(cell)
    if is_dotted(config.task) and config.algorithm in OF_ONE_MOTION:
        _check_one_motion(config, demonstration)
    chosen(config)


def _check_one_motion(config: TrainConfig, demonstration: Demonstration) -> None:
    """Refuse a demonstration that cannot be played as an episode of a user's own task."""
    from ...baselines.learning.task_demonstrations import single_skill
    from ...baselines.programs.task_skills import skill_of
    from ...envs import task_at

    try:
        single_skill(task_at(config.task).skill or skill_of(demonstration))
    except BadOption as error:
        reason = f"{error.reason}, and {config.algorithm} learns from one; others: sac, ppo, sac-her, residual"
        raise BadConfig(config.name, "demonstration", reason) from None
