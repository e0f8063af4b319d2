"""Run folders with random numbers, for measuring and testing reports: no episode in them was ever run."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...configs import RunConfig
from ...envs import TASKS, ScheduledObstacle
from ...planner import Sphere
from ..metrics.metric_table import METRICS
from .episode_records import FILE, EpisodeRecord, encoded
from .run_folder import CELLS, VERSION
from .scenarios import Suite, frozen, place_of
from .start_states import obstacle
from .world_clock import SLOW

METHODS = ("screw", "decoupled", "replay", "dmp-goal", "potential", "rrt")
LEVELS = ("L1", "L2", "L3", "L4")
SKILL = {"screw": 3.4, "decoupled": 3.0, "replay": 2.2, "dmp-goal": 1.2, "potential": 1.6, "rrt": 0.4}
HARDNESS = {"L0": 0.0, "L1": 0.3, "L2": 0.8, "L3": 1.6, "L4": 2.0, "F": 1.8}
TICKS = {"screw": 40.0, "decoupled": 35.0, "replay": 20.0, "dmp-goal": 90.0, "potential": 30.0, "rrt": 60.0}
REASONS = ("collision", "timeout", "dropped", "constraint", "plan_failed", "blocked", "ik_or_limit", "off_table")
DEMANDING = ("L3", "L4", "F")
"""Levels with obstacles."""


def write_synthetic_run(
    folder: Path,
    episodes: int = 50,
    *,
    tasks: tuple[str, ...] = ("stack", "pour"),
    levels: tuple[str, ...] = LEVELS,
    methods: tuple[str, ...] = METHODS,
    seed: int = 0,
) -> Path:
    """Write a finished run folder with random outcomes, and return the folder.

    Args:
        folder: folder to write; made if missing.
        episodes: number of episodes per cell.
        tasks: names of the tasks.
        levels: levels of every task.
        methods: methods on every task and level.
        seed: random seed of the outcomes, and seed of the cells.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    places = [_cell(task, level, methods[0], episodes, seed) for task in tasks for level in levels]
    scenarios = {
        place_of(place): [frozen(place, k, {"start": {"obstacles": _obstacles(place.level, rng)}, "refused": 0})
                          for k in range(episodes)]
        for place in places
    }  # fmt: skip
    cells = [_cell(task, level, method, episodes, seed) for task in tasks for level in levels for method in methods]
    with (folder / FILE).open("wb") as file:
        for cell in cells:
            for scenario in scenarios[place_of(cell)]:
                file.write(encoded(_record(cell, scenario, rng)))
    Suite([scenario for found in scenarios.values() for scenario in found]).write(folder)
    described = [
        {"digest": c.digest(), "label": f"{c.task} {c.robot} {c.level} {c.method}", "config": c.model_dump(mode="json")}
        for c in cells
    ]
    _write(folder / CELLS, {"version": VERSION, "run": "synthetic", "cells": described})
    _write(folder / "environment.json", {"python": "3.11.2", "commit": "", "packages": {"numpy": "1.26.4"}})
    grid = {"name": "synthetic", "tasks": list(tasks), "levels": list(levels), "methods": list(methods)}
    _write(folder / "config.yaml", grid)  # JSON is YAML
    return folder


def _write(path: Path, value: Any) -> None:
    path.write_text(json.dumps(value, indent=1) + "\n", encoding="utf-8")


def _obstacles(level: str, rng: np.random.Generator) -> list[dict[str, Any]]:
    if level not in DEMANDING:
        return []
    speed = float(rng.uniform(0.05, 0.3)) if level == "L4" and rng.uniform() < 0.7 else 0.0
    return [obstacle(ScheduledObstacle(Sphere(0.05), (0.1, 0.0, 1.0), long=(0.0, 0.1, 0.0), frequency=10.0 * speed))]


def _cell(task: str, level: str, method: str, episodes: int, seed: int) -> RunConfig:
    return RunConfig(
        name="synthetic",
        task=task,
        method=method,
        demonstration=TASKS[task].demonstrated_task or task,
        episodes=episodes,
        level=level,
        seed=seed,
    )


def _record(cell: RunConfig, scenario: dict[str, Any], rng: np.random.Generator) -> EpisodeRecord:
    method, level, task = cell.method, cell.level, cell.task
    skill = SKILL.get(method, 1.5) - HARDNESS.get(level, 0.5) - (0.4 if task == "pour" else 0.0)
    speed = max((o["frequency"] * 0.1 for o in scenario["start"]["obstacles"]), default=0.0)
    success = bool(rng.uniform() < 1.0 / (1.0 + np.exp(-skill + 5.0 * speed)))
    beside = level in DEMANDING
    touched = beside and bool(rng.uniform() < (0.01 if method == "screw" else 0.15))
    reason = "" if success else str(rng.choice(REASONS[1:] if not touched else REASONS[:1]))
    seconds = float(rng.normal(22.0, 3.0)) if success else 60.0
    clearance = 0.0 if touched else float(rng.gamma(4.0, 0.008 if method == "screw" else 0.006))
    metrics = dict.fromkeys(METRICS) | {
        "clearance": clearance if beside else None,
        "tilt": float(rng.gamma(8.0, 0.02 / max(skill + 2.0, 0.5))),
        "path_ratio": float(1.0 + rng.gamma(2.0, 0.2)),
        "path_length": float(rng.gamma(20.0, 0.1)),
        "rotation_length": float(rng.gamma(20.0, 0.2)),
        "time_to_goal": seconds if success else None,
        "first_motion": 0.02,
        "log_dimensionless_jerk": float(rng.normal(-14.0 - HARDNESS.get(level, 0.5), 1.0)),
        "sparc": float(rng.normal(-2.3, 0.2)),
        "deviation": float(rng.gamma(2.0, 0.005)),
        **{name: float(rng.gamma(2.0, 0.002)) for name in TASKS[task].task_metrics},
    }
    blank = EpisodeRecord(
        scenario["index"], scenario["seed"], method, task, "Panda", level, success, not touched,
        "placed 3 of 3" if success else "lifted block 2 of 3", reason, f"made up: {reason}" if reason else "",
        "link5-obstacle0" if touched else "", round(seconds, 3), int(touched), clearance if beside else None, 0,
        _numbers(task), 1.0, [], cell.digest(), scenario["fingerprint"], metrics,
    )  # fmt: skip
    tick = TICKS.get(method, 50.0) * float(rng.lognormal(0.0, 0.1))
    longest = 4.0 * tick * float(rng.lognormal(3.0, 0.6))
    times = {"calls": round(50.0 * seconds), "slow_calls": int(longest > 1e6 * SLOW), "longest_ms": 0.001 * longest}
    return replace(blank, tick_us=[tick, 4.0 * tick, longest, 2.0 * tick], **times)


def _numbers(task: str) -> dict[str, list[float]]:
    error = TASKS[task].error
    return {error.key: [0.001]} if error else {}
