"""What every policy promises, and that the planner's really stacks."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from helpers.actors import saved_actor
from helpers.policies import LEARNED, PROGRAMS, installed

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.baselines.factory import POLICIES, make_policy
from onedemo.baselines.policy import PolicyReport
from onedemo.bench.episodes.episode import run_episode
from onedemo.bench.episodes.scenarios import Scenario
from onedemo.configs.errors import BadConfig
from onedemo.configs.grid import load_config
from onedemo.configs.shipped_files import shipped_config, shipped_demonstration
from onedemo.envs.core.description import FAILURES
from onedemo.planner.errors import BadOption, UnknownName
from onedemo.planner.imitation.demonstration_files import read_demonstration

each_policy = pytest.mark.parametrize("name", installed(*sorted(POLICIES)))
each_program = pytest.mark.parametrize("name", installed(*PROGRAMS, "residual"))
CONFIG = load_config(shipped_config("stack"))
SOON = 250
"""Ticks within which a goal out of reach is found out: 5 s, of which a fifth is planning."""


@pytest.fixture(scope="module")
def env():
    made = gym.make("onedemo/Stack-v0")
    yield made
    made.close()


def a_policy(env, name="screw", settings=None):
    demonstration = read_demonstration(shipped_demonstration("stack"))
    if name in LEARNED:
        settings = {"checkpoint": saved_actor(env, name), **(settings or {})}
    return make_policy(name, env.unwrapped.task, demonstration, settings)


def stack_of(observations):
    return {key: np.stack([each[key] for each in observations]) for key in observations[0]}


@each_policy
def test_actions_fit_the_space_and_leave_the_observation_alone(env, name):
    policy, state = a_policy(env, name), None
    observation, _ = env.reset(seed=0)
    for _ in range(50):
        kept = {key: value.copy() for key, value in observation.items()}
        action, state = policy.predict(observation, state, deterministic=True)
        for key, value in kept.items():
            np.testing.assert_array_equal(observation[key], value)
        assert env.action_space.contains(action)
        observation, *_ = env.step(action)


@each_policy
def test_a_batch_is_its_rows_and_one_row_can_begin_anew(env, name):
    policy = a_policy(env, name)
    starts = [env.reset(seed=seed)[0] for seed in (1, 2)]
    together, batch = policy.predict(stack_of(starts))
    alone = [policy.predict(start) for start in starts]
    np.testing.assert_array_equal(together, [action for action, _ in alone])
    other = env.reset(seed=3)[0]
    following, _ = policy.predict(stack_of([starts[0], other]), batch, episode_start=np.array([False, True]))
    np.testing.assert_array_equal(following[0], policy.predict(starts[0], alone[0][1])[0])
    np.testing.assert_array_equal(following[1], policy.predict(other)[0])


@each_policy
def test_two_instances_act_alike(env, name):
    runs = []
    for _ in range(2):
        policy, state, actions = a_policy(env, name), None, []
        observation, _ = env.reset(seed=5)
        for _ in range(100):
            action, state = policy.predict(observation, state)
            actions.append(action)
            observation, *_ = env.step(action)
        runs.append(actions)
    np.testing.assert_array_equal(*runs)


@each_program
def test_a_goal_out_of_reach_is_a_reason_not_an_exception(env, name):
    policy, observation = a_policy(env, name), env.reset(seed=0)[0]
    observation["object_pose"][:, :3] += [1.5, 0, 0]
    state, report = None, PolicyReport()
    for _ in range(SOON):
        _, state = policy.predict(observation, state)
        report = policy.report(state)
        if report.done:
            break
    assert report.done and report.failure_reason in FAILURES and "block0" in report.detail


@pytest.mark.parametrize("level, seed", [("L1", 11), ("L2", 12)])
def test_one_demonstration_stacks_three_blocks(env, level, seed):
    record, report = run_episode(env, a_policy(env), Scenario(0, seed, level), CONFIG)
    assert (record.success, record.safe, record.stage) == (True, True, "placed 3 of 3")
    assert record.seconds < 35
    assert max(record.numbers["position_error"]) < 0.01
    labels = [path.motion for path in report.paths if path.label == "final"]
    assert labels == [f"{verb} block{k}" for k in range(3) for verb in ("approach", "transfer")]


@pytest.mark.slow
def test_ten_far_layouts_are_stacked(env):
    records = [run_episode(env, a_policy(env), Scenario(k, 900 + k, "L2"), CONFIG)[0] for k in range(10)]
    assert sum(record.success for record in records) >= 9


def test_another_number_of_blocks_needs_no_other_demonstration():
    five = gym.make("onedemo/Stack-v0", n_blocks=4)
    record, _ = run_episode(five, a_policy(five), Scenario(0, 3, "L0"), CONFIG)
    assert record.success


def test_the_policy_never_judges_itself(env):
    """A policy that claims to be done at once is not believed."""

    class Boaster:
        def predict(self, observation, state=None, episode_start=None, deterministic=True):
            return np.zeros(8), ()

        def report(self, state):
            return PolicyReport(done=True)

    record, _ = run_episode(env, Boaster(), Scenario(0, 0, "L1"), CONFIG)
    assert (record.success, record.failure_reason) == (False, "constraint")
    assert record.seconds < 3


def test_a_block_that_vanishes_from_the_hand_is_reported_as_dropped(env):
    policy, state, info = a_policy(env), None, {}
    observation, _ = env.reset(seed=0)
    address = env.unwrapped.sim._object_places[0]
    for _ in range(1500):
        action, state = policy.predict(observation, state)
        observation, *_, info = env.step(action)
        if observation["motion_index"][0] == 1 and action[-1] > 0:
            env.unwrapped.sim.data.qpos[address : address + 3] = [-0.3, 0.3, 0.83]
        if policy.report(state).done:
            break
    report = policy.report(state)
    assert report.failure_reason == "dropped"
    assert "block0 is not in the hand" in report.detail
    still, _ = policy.predict(observation, state)
    np.testing.assert_array_equal(still[:-1], 0)
    assert not info["success"]


@pytest.mark.parametrize(
    "settings, error, message",
    [
        ({"repet": {"shel": 1}}, BadConfig, "repet.shel: unknown key; did you mean 'shell'. allowed: distance, shell,"),
        ({"trimm": 1}, BadConfig, "trimm: unknown key; did you mean 'trim'. allowed: motion, safety, resample, trim"),
        (
            {"motion": {"controller": {"gian": 1}}},
            BadConfig,
            "motion.controller.gian: unknown key; did you mean 'gain'. allowed: law, gain",
        ),
        ({"motion": {"guide": "far"}}, BadConfig, "motion.guide: .*number"),
        ({"resample": -1}, BadConfig, "resample: -1.0 is not a positive number"),
        ({"motion": {"controller": {"gain": 0}}}, BadConfig, "motion.controller.gain: 0.0 is not a positive number"),
        ({"motion": {"dt": 0.01}}, BadOption, "the task acts every 0.02 s"),
    ],
)
def test_bad_settings_are_named(env, settings, error, message):
    with pytest.raises((error, BadConfig), match=message):
        a_policy(env, settings=settings)


def test_an_unknown_policy_is_named(env):
    with pytest.raises(UnknownName, match="unknown policy 'magic'; known: screw"):
        a_policy(env, "magic")


def test_stable_baselines_evaluates_it_like_its_own(env):
    evaluation = pytest.importorskip("stable_baselines3.common.evaluation")
    rewards, lengths = evaluation.evaluate_policy(a_policy(env), env, n_eval_episodes=1, return_episode_rewards=True)
    assert rewards == [1.0]
    assert lengths[0] < 35 * 50
