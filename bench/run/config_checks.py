"""Checks of a config before anything is built: names, demonstrations, arguments and settings."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache, partial
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...baselines.own_policy import is_own
from ...configs import BadConfig, Grid, RunConfig
from ...configs.errors import unknown_key
from ...configs.run_config import FAMILIES, REAL, WAITS
from ...envs import TASKS, facts_of
from ...envs.dotted_names import BadDottedName, is_dotted
from ...planner.errors import BadDemonstration, BadOption, UnknownName
from ..recordings.robot_checks import robot_facts

if TYPE_CHECKING:
    from ...planner import Demonstration
    from ...planner.skills.skill import SegmentedSkill

OWN_KEYS = ("robot", "level", "obstacles", "render_mode", "declared")
"""Environment arguments that are config keys of their own, or the task itself."""


def check_grid(grid: Grid) -> None:
    """Refuse a grid with cells that cannot be run.

    Raises:
        BadConfig: an unknown name, argument or setting; names the key and its file (or the command line).
        BadDemonstration: a demonstration is unreadable or belongs to another task.
        UnknownName: no such demonstration is shipped.
    """
    known = known_names()
    conditions = [("defaults", default.when) for default in grid.settings.defaults]
    conditions += [("exclude", condition) for condition in grid.settings.exclude]
    for where, condition in conditions:
        for key, wanted in condition.items():
            for value in wanted if isinstance(wanted, list) else [wanted]:
                check_name(grid.blame(where), key, value, known)
    for cell in grid.cells:
        for key in known:
            check_name(grid.blame(key), key, getattr(cell, key), known)
        _check_arguments(cell, grid)
        _check_key_poses(cell, grid)
        _check_settings(cell, grid)
    for cell in {(cell.task, cell.demonstration): cell for cell in grid.cells}.values():
        fitting_demonstration(cell)


def known_names() -> dict[str, Iterable[str | None]]:
    """Return the allowed values of every config key whose values are names."""
    from ...baselines import POLICIES
    from ...envs import LEVELS, ROBOTS
    from ...envs.core.levels import OBSTACLES

    named = {"task": TASKS, "level": LEVELS, "robot": ROBOTS, "method": POLICIES, "obstacles": (None, *OBSTACLES)}
    return {**named, "clock": (WAITS, REAL)}


def level_words() -> str:
    """Return all levels, each with what it is."""
    from ...envs import LEVELS

    return "; ".join(f"{name}: {level.words}" for name, level in LEVELS.items())


def check_name(source: str | Path, key: str, value: Any, known: dict[str, Iterable[str | None]]) -> None:
    """Refuse an unknown name; dotted paths of users' own policies pass, those of tasks that can be imported, too.

    Args:
        source: file or place to blame in the message.
        key: config key.
        value: value of the key.
        known: allowed values by key; keys without an entry pass.

    Raises:
        BadConfig: the name is unknown.
    """
    if key == "method" and isinstance(value, str) and is_own(value):
        return
    if key == "task" and is_dotted(value):
        try:
            facts_of(value, load=True)
        except BadDottedName as error:
            raise BadConfig(source, key, str(error)) from None
        return
    if key in known and value not in list(known[key]):
        words = level_words() if key == "level" else ", ".join(map(str, known[key]))
        raise BadConfig(source, key, f"unknown {key} {value!r}; known: {words}")


def _check_arguments(cell: RunConfig, grid: Grid) -> None:
    check_env(cell, grid.blame("env"))


def check_env(cell: RunConfig, source: str | Path) -> None:
    """Refuse arguments that the cell's environment does not accept.

    Args:
        cell: the cell.
        source: file or place to blame in the message.

    Raises:
        BadConfig: an unknown argument.
    """
    import gymnasium as gym
    from gymnasium.envs.registration import load_env_creator

    if not cell.env:
        return
    name = facts_of(cell.task, load=True).id
    creator = load_env_creator(str(gym.spec(name).entry_point))
    known = [key for key in signature(creator).parameters if key not in OWN_KEYS]
    for key in cell.env:
        if key not in known:
            raise BadConfig(source, f"env.{key}", f"{unknown_key(key, known)} (arguments of {name})")
    if cell.task in FAMILIES:
        _check_guest(cell, source)


def _check_guest(cell: RunConfig, source: str | Path) -> None:
    """Refuse a task or a range that robosuite's environment does not have."""
    from ...envs.guests.guest_scene import check_guest
    from ...envs.guests.task_facts import wide_range

    given = {**FAMILIES[cell.task], **cell.env}
    checks = {"task": check_guest, "range": partial(wide_range, given["task"])}
    for key, check in checks.items():
        try:
            check(given[key])
        except (BadOption, UnknownName) as error:
            raise BadConfig(source, f"env.{key}", getattr(error, "reason", str(error))) from None


def _check_key_poses(cell: RunConfig, grid: Grid) -> None:
    """Refuse key poses in a task that knows no segments."""
    if cell.key_poses is not None and facts_of(cell.task).skill is None:
        reason = f"are those of named segments, and {cell.task} is done without names: leave key_poses and level S out"
        raise BadConfig(grid.blame("key_poses"), "key_poses", reason)


def _check_settings(cell: RunConfig, grid: Grid) -> None:
    """Refuse settings that the method lacks, and the key `tool` for users' own policies."""
    from ...baselines.factory import OWN_TOOL, settings_of

    if is_own(cell.method):
        if cell.tool is not None:
            raise BadConfig(grid.blame("tool"), "tool", f"{cell.method} {OWN_TOOL}")
        return
    try:
        settings_of(cell.method, cell.settings)
    except BadConfig as error:
        key = f"settings.{error.key}" if error.key else "settings"
        reason = f"{error.reason} (of the method {cell.method!r})"
        raise BadConfig(grid.blame("settings"), key, reason) from None


def fitting_demonstration(cell: RunConfig) -> Demonstration:
    """Return the demonstration of a cell, checked against the cell's task.

    A task that does not say what segments mean needs none: a skill must be found in the demonstration.

    Raises:
        BadDemonstration: the file is unreadable, belongs to another task, lacks a segment or shows no skill.
        UnknownName: no such demonstration is shipped.
    """
    from ...configs import load_demonstration
    from ...configs.shipped_files import demonstration_path, is_shipped

    file = demonstration_path(cell.demonstration)
    demonstration = load_demonstration(cell.demonstration)
    skill = facts_of(cell.task).skill
    if skill is not None:
        _check_names(file, demonstration, cell, skill)
    else:
        _check_skill(cell.task, file, demonstration)
    if not is_shipped(file):  # those are compared by a test
        _check_robot(file, demonstration)
    return demonstration


def _check_names(file: Path, demonstration: Demonstration, cell: RunConfig, skill: SegmentedSkill) -> None:
    """Refuse a demonstration of another task, or without the segments that the task's skill consists of."""
    task = facts_of(cell.task).demonstrated_task or cell.task
    if demonstration.task != task:
        raise BadDemonstration(file, "task", f"is {demonstration.task!r}; the task of this run is {task!r}")
    names = [segment.name for segment in demonstration.segments]
    for name in skill.required:
        if name not in names:
            there = ", ".join(names) or "none"
            reason = f"{name!r} is missing; {task!r} needs {', '.join(skill.required)}, there are: {there}"
            raise BadDemonstration(file, "segment_names", reason)
    _check_content(file, demonstration, skill)


def _check_content(file: Path, demonstration: Demonstration, skill: SegmentedSkill) -> None:
    """Refuse a demonstration that lacks something else that a skill needs."""
    for name in skill.sized:
        if name not in demonstration.object_sizes:
            there = ", ".join(demonstration.object_sizes) or "none"
            reason = f"of {name!r} is missing; this task needs {', '.join(skill.sized)}, there are: {there}"
            raise BadDemonstration(file, "object_sizes", reason)
    for name in skill.releases:
        after = demonstration.segment(name).stop + 1
        if demonstration.gripper is None or after >= len(demonstration.gripper):
            reason = f"says nothing about how the hand opens after {name!r}, which this task needs"
            raise BadDemonstration(file, "gripper", reason)


@lru_cache(maxsize=32)
def _check_skill(task: str, file: Path, demonstration: Demonstration) -> None:
    """Refuse a demonstration without a skill, unless the task has one; of each one this is looked at once."""
    from ...baselines.programs.task_skills import skill_of
    from ...envs import task_at

    if is_dotted(task) and task_at(task).skill is not None:
        return
    try:
        skill_of(demonstration)
    except BadDemonstration as error:
        raise BadDemonstration(file, error.key, error.reason) from None


@lru_cache(maxsize=32)
def _check_robot(file: Path, demonstration: Demonstration) -> None:
    """Refuse a demonstration that its robot cannot have made; of each one this is looked at once."""
    robot_facts(file, demonstration)
