"""Every policy takes up every task: what is promised of the comparison."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from helpers.actors import saved_actor
from helpers.policies import LEARNED, PROGRAMS, installed

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.baselines.factory import make_policy
from onedemo.baselines.key_poses import DENSE
from onedemo.baselines.motion.tool_frame import ToolFrameMotion
from onedemo.bench.geometric.metrics import curve_gap
from onedemo.bench.run.episode_jobs import policy_for
from onedemo.configs.grid import load_grid
from onedemo.configs.run_config import FAMILIES, RunConfig
from onedemo.configs.shipped_files import shipped_config, shipped_demonstration
from onedemo.envs import TASKS
from onedemo.planner.imitation.demonstration_files import read_demonstration
from onedemo.planner.imitation.segmentation import key_poses, resampled

TICKS = 100
THOUGHT = {("pour", "screw-guard-only"): 110, ("pour", "screw-search-only"): 155}
"""Ticks of standing and thinking that come before: without detours no turn of a glass is good enough, so that all are
planned, which costs 0.44 and 0.61 s, at a fifth of a tick of 20 ms."""


@pytest.fixture(scope="module", params=TASKS)
def task_env(request):
    config = load_grid(shipped_config(request.param)).cells[0]
    made = gym.make(TASKS[config.task].id, level="L1", **config.env)
    yield made, config
    made.close()


def taken_up(task_env, name, settings):
    """The report of a policy after two seconds, and what it thinks before that at length: it has moved, each of its
    actions is one that the environment takes."""
    env, config = task_env
    demonstration = read_demonstration(shipped_demonstration(config.demonstration))
    policy, state = make_policy(name, env.unwrapped.task, demonstration, settings), None
    observation, _ = env.reset(seed=1000)
    before, moved = observation["joint_positions"].copy(), 0.0
    for _ in range(TICKS + THOUGHT.get((config.task, name), 0)):
        action, state = policy.predict(observation, state)
        assert env.action_space.contains(action)
        observation, *_ = env.step(action)
        moved = max(moved, np.abs(observation["joint_positions"] - before).max())
    assert moved > 0.1
    return policy.report(state) if hasattr(policy, "report") else None


@pytest.mark.parametrize("name", installed(*PROGRAMS))
def test_every_policy_takes_up_every_task(task_env, name):
    report = taken_up(task_env, name, task_env[1].settings)
    assert not report.failure_reason, report.detail
    labels = {path.label for path in report.paths}
    # a way through joint space is drawn as one round what was not shown
    assert labels - {"escape"} == {"demonstrated", "final"}


@pytest.mark.parametrize("name", LEARNED)
def test_every_learned_policy_takes_up_every_task(task_env, name):
    taken_up(task_env, name, {"checkpoint": saved_actor(task_env[0], name)})


def begun(env, policy):
    """Actions (TICKS, ...) of the first two seconds, and the policy's words about them."""
    state, actions, (observation, _) = None, [], env.reset(seed=1000, options={"level": "L1"})
    for _ in range(TICKS):
        action, state = policy.predict(observation, state)
        actions.append(action)
        observation, *_ = env.step(action)
    return np.array(actions), policy.report(state)


@pytest.mark.parametrize("name", installed("screw", "decoupled", "dmp-goal", "rrt"))
def test_levels_s_and_t_are_what_they_are_called(task_env, name):
    """A cell of these levels makes another policy of the same name, which takes up the task as well."""
    env, config = task_env
    if config.task in FAMILIES:
        pytest.skip("has no segments of which key poses could be shown: tests/bench/run/test_guest_cells.py")
    values = {**config.model_dump(mode="json"), "method": name}
    nominal, sparse, turned = (
        policy_for(env, RunConfig.model_validate({**values, "level": level})) for level in ("L1", "S", "T")
    )
    assert turned.motion_method.__class__ is ToolFrameMotion
    assert sparse.motion_method.__class__ is nominal.motion_method.__class__ is not ToolFrameMotion
    for segment in sparse.demonstration.segments:
        kept = nominal.demonstration.segment_path(segment.name)
        path = resampled(key_poses(resampled(kept, DENSE), 6), DENSE)
        assert curve_gap(path, sparse.demonstration.segment_path(segment.name)) < (0.02 if name != "screw" else 1e-6)
    actions = {}
    for level, policy in (("L1", nominal), ("S", sparse), ("T", turned)):
        actions[level], report = begun(env, policy)
        assert not report.failure_reason, report.detail
    if name != "rrt":
        assert not np.array_equal(actions["S"], actions["L1"]) and not np.array_equal(actions["T"], actions["L1"])
