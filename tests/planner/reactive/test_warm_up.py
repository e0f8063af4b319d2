"""Warming up: afterwards no tick has to wait for the compiler."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

pytest.importorskip("robosuite")  # episodes are played
from helpers.random_scenes import panda

from onedemo.planner.reactive.warm_up import warm_up

TICKS = 150
SCRIPT = """
import json, sys
from onedemo.bench.episodes.scenarios import scenarios_of
from onedemo.bench.run.episode_jobs import made, policy_for
from onedemo.configs.grid import load_config
from onedemo.configs.shipped_files import shipped_config

def compiled():
    found = set()
    packages = ("onedemo.planner.", "onedemo.envs.scene.body")
    for module in [m for name, m in sys.modules.items() if name.startswith(packages)]:
        for name, value in vars(module).items():
            found |= {(value.py_func.__module__, name, str(each)) for each in getattr(value, "signatures", ())}
    return found

task, method, ticks = sys.argv[1], sys.argv[2], int(sys.argv[3])
config = load_config(shipped_config(task), ["level=" + sys.argv[4], "method=" + method])
env = made(config)
policy, state, scenario = policy_for(env, config), None, scenarios_of(config)[0]
observation, _ = env.reset(seed=scenario.seed)
before, moved = compiled(), False
for _ in range(ticks):
    action, state = policy.predict(observation, state)
    moved = moved or bool(action[:-1].any())
    observation, *_ = env.step(action)
print(json.dumps({"known": len(before), "moved": moved, "late": sorted(compiled() - before)}))
"""


def test_warming_up_needs_no_more_than_an_arm_and_its_body():
    arm, body, _ = panda()
    warm_up(arm, body)


@pytest.mark.parametrize("task, method, level", [("stack", "screw", "L3"), ("pour", "replay", "L1")])
def test_no_kernel_of_the_planner_is_compiled_in_a_tick(task, method, level):
    """In a process of its own: another test may have compiled what is missing."""
    command = [sys.executable, "-c", SCRIPT, task, method, str(TICKS), level]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["moved"] and found["known"] > 15
    assert found["late"] == []
