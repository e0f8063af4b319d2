"""The examples: short files, each done from its one demonstration; their demonstrations are what the scripts record."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import onedemo
from onedemo.baselines import task_episode
from onedemo.baselines.recording.recorders import recorder_of
from onedemo.envs import task_at

FOLDER = Path(__file__).parents[2] / "examples"
EXAMPLES = {"peg_in_hole": "PEG_IN_HOLE", "ring_on_peg": "RING_ON_PEG", "wipe_board": "WIPE_BOARD"}
SECOND = 50


@pytest.fixture(autouse=True)
def folder(monkeypatch):
    """The current folder is that of the examples."""
    monkeypatch.chdir(FOLDER)
    yield
    for name in EXAMPLES:
        sys.modules.pop(name, None)


def played(name: str, level: str, seeds: range, **options) -> list[dict]:
    """Info at the end of each episode."""
    task = task_at(f"{name}:{EXAMPLES[name]}")
    env, found = gym.make(task.id, **options), []
    policy = onedemo.make_policy("screw", env.unwrapped.task, onedemo.load_demonstration(task.demonstration))
    for seed in seeds:
        observation, info = env.reset(seed=seed, options={"level": level})
        state, over, left = None, False, SECOND
        while not over and left:
            action, state = policy.predict(observation, state)
            observation, _, terminated, truncated, info = env.step(action)
            over = terminated or truncated
            left -= policy.report(state).done
        found.append({**info, "why": policy.report(state).detail})
    env.close()
    return found


def test_each_is_one_file_of_at_most_a_hundred_lines_in_public_names():
    assert {path.stem for path in FOLDER.glob("*.py")} == set(EXAMPLES)
    page = (FOLDER / "README.md").read_text(encoding="utf-8")
    for name, task in EXAMPLES.items():
        text = (FOLDER / f"{name}.py").read_text(encoding="utf-8")
        assert text.count("\n") <= 100 and f"onedemo run {name}:{task}" in page
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.ImportFrom):
                assert node.module in ("onedemo.baselines", "onedemo.envs", "onedemo.planner")


@pytest.mark.parametrize("name", EXAMPLES)
def test_it_is_done_where_it_was_never_shown(name):
    for info in played(name, "L2", range(2)):
        assert info["success"] and info["safe"], info["why"]


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
@pytest.mark.parametrize("level, least", [("L2", 19), ("L3", 16)])
def test_most_starts_succeed(name, level, least):
    assert sum(info["success"] for info in played(name, level, range(4000, 4020))) >= least


def test_another_robot_wipes_from_the_same_demonstration():
    (info,) = played("wipe_board", "L1", range(1), robot="UR5e")
    assert info["success"] and info["stains_left"] == 0, info["why"]


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_demonstration_is_what_the_script_records(name):
    path = f"{name}:{EXAMPLES[name]}"
    env = gym.make(task_at(path).id, level="L0")
    again, kept = recorder_of(path).record(env.unwrapped), onedemo.load_demonstration(f"{name}.npz")
    assert len(again.path) == len(kept.path) and again.source == kept.source == "scripted"
    assert np.abs(again.joint_positions - kept.joint_positions).max() < 1e-3
    env.close()


@pytest.mark.parametrize("mode", ["joint_velocity", "ee_twist"])
@pytest.mark.parametrize("name", EXAMPLES)
def test_the_demonstration_is_an_episode_for_learners(name, mode):
    task = task_at(f"{name}:{EXAMPLES[name]}")
    env = gym.make(task.id, control_mode=mode, control_frequency=20)
    episode = task_episode(env, onedemo.load_demonstration(task.demonstration))
    assert episode.success and episode.rewards[-1] == 1.0 and len(episode.actions) < 300
    assert all(env.action_space.contains(action) for action in episode.actions)
    env.close()


def test_a_sponge_that_hovers_wipes_nothing():
    env = gym.make(task_at("wipe_board:WIPE_BOARD").id)
    observation, info = env.reset(seed=0, options={"level": "L0"})
    above = observation["goal_pose"][0] + [0, 0, 0.05, 0, 0, 0, 0]
    _, info = env.reset(seed=0, options={"level": "L0", "object_poses": [above]})
    assert info["stains_left"] == 4
    _, info = env.reset(seed=0, options={"level": "L0", "object_poses": observation["goal_pose"]})
    for _ in range(50):
        *_, info = env.step(np.zeros(8))
    assert info["placed"] == 1 and info["stains_left"] > 0 and not info["success"]
