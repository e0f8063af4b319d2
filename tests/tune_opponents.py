"""Try the settings of an opponent: `python tests/tune_opponents.py configs/tuning/potential.yaml`.

A grid in the file is tried on the stacking task's scenarios, without physics: for every block the fetch and the place
as they would be planned, rolled out kinematically. Printed are the shares of motions that arrive, and that arrive
without the arm or what it holds touching an obstacle. Seeds are the file's, never those reported in the README.
"""

from __future__ import annotations

import sys
import time
from itertools import product
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.baselines.factory import make_policy
from onedemo.configs.shipped_files import shipped_demonstration
from onedemo.configs.strict_yaml import load_mapping
from onedemo.planner.errors import PlanFailed
from onedemo.planner.imitation.demonstration_files import read_demonstration
from onedemo.planner.planning.plan import Plan
from onedemo.planner.planning.planning_scene import PlanningScene, SceneTemplate
from onedemo.planner.safety.safety_layer import SafetySettings

RESERVED = range(0, 1000)
"""Seeds of results that are reported."""
LEGS_PER_BLOCK = 2


def touches(plan: Plan) -> bool:
    """True if the arm or what it holds touches an obstacle that nobody showed."""
    strange = [each for each in plan.request.obstacles if each.name.startswith("obstacle")]
    scene = PlanningScene(SceneTemplate(plan.arm, plan.body, SafetySettings(distance=0.0), plan.dt), strange, 0.0)
    return bool(strange) and min(scene.slack(q) for q in plan.joints[::2]) < 0.0


def legs_of(policy: Any, observation: Any) -> list[Plan]:
    """The plans of fetching and placing each block from the start."""
    program, plans = policy.begin(observation).program, []
    for k in range(len(program.task.objects)):
        try:
            choice = program._chosen_fetch(k)
        except PlanFailed:
            continue
        plans += [choice.plan] + ([] if choice.then is None else [choice.then.plan])
    return plans


def tried(env: Any, method: str, settings: dict[str, Any], seeds: range) -> tuple[float, float, float, float]:
    """Shares of motions that arrive, that arrive clear; screw length over the demonstration's; seconds per motion."""
    demonstration = read_demonstration(shipped_demonstration("stack"))
    policy = make_policy(method, env.unwrapped.task, demonstration, settings)
    wanted, arrived, clear, lengths, begun = 0, 0, 0, [], time.perf_counter()
    for seed in seeds:
        observation, _ = env.reset(seed=seed)
        plans = legs_of(policy, observation)
        wanted += LEGS_PER_BLOCK * len(env.unwrapped.task.objects)
        arrived += len(plans)
        clear += sum(not touches(plan) for plan in plans)
        lengths += [plan.path.lengths()[-1] / plan.imitated.lengths()[-1] for plan in plans]
    seconds = (time.perf_counter() - begun) / wanted
    return arrived / wanted, clear / wanted, float(np.median(lengths)) if lengths else np.nan, seconds


def nested(keys: list[str], values: tuple[Any, ...]) -> dict[str, Any]:
    """Settings from dotted keys."""
    result: dict[str, Any] = {}
    for key, value in zip(keys, values, strict=True):
        *outer, last = key.split(".")
        place = result
        for part in outer:
            place = place.setdefault(part, {})
        place[last] = value
    return result


def main(file: str) -> None:
    config = load_mapping(Path(file))
    seeds = range(config["seed"], config["seed"] + config["scenarios"])
    assert not set(seeds) & set(RESERVED), "these seeds are reported"
    env, keys = gym.make("onedemo/Stack-v0", level=config["level"]), list(config["grid"])
    print(f"{'  '.join(keys)}  arrive  clear  length  s/motion")
    for values in product(*config["grid"].values()):
        row = tried(env, config["method"], nested(keys, values), seeds)
        print("  ".join(map(str, values)), "  {:.2f}  {:.2f}  {:.2f}  {:.3f}".format(*row), flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
