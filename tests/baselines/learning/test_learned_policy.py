"""Learned policies: only where they were trained, and what corrects the method is added to it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from helpers.actors import random_actor, saved_actor
from helpers.policies import LEARNED

import onedemo.configs
import onedemo.envs
from onedemo.baselines.errors import BadActor
from onedemo.baselines.factory import make_policy
from onedemo.baselines.learning.actor_card import METHOD
from onedemo.baselines.learning.actor_files import load_actor, save_actor
from onedemo.baselines.learning.feature_scaling import FlatFeatures
from onedemo.baselines.learning.learned_policy import METHODS
from onedemo.baselines.learning.residual_policy import AroundScrew, corrected, default_scale
from onedemo.configs.errors import BadConfig
from onedemo.configs.shipped_files import shipped_demonstration
from onedemo.planner.errors import BadOption
from onedemo.planner.imitation.demonstration_files import read_demonstration

DEMONSTRATION = read_demonstration(shipped_demonstration("stack"))
SHIPPED = sorted((Path(onedemo.configs.__file__).parent / "actors").glob("*.json"))
JOINTS = {"control_mode": "joint_velocity"}


@pytest.fixture(scope="module")
def env():
    made = gym.make("onedemo/PlaceOne-v0")
    yield made
    made.close()


@pytest.fixture(scope="module")
def joints():
    made = gym.make("onedemo/PlaceOne-v0", **JOINTS)
    yield made
    made.close()


def made(env, method, checkpoint, **settings):
    return make_policy(method, env.unwrapped.task, DEMONSTRATION, {"checkpoint": str(checkpoint), **settings})


def test_all_of_them_are_known():
    assert sorted([*METHODS, METHOD]) == LEARNED


def test_the_action_is_the_actors(env):
    path = saved_actor(env, "bc")
    policy, actor = made(env, "bc", path), load_actor(path)
    observation, _ = env.reset(seed=0)
    action, state = policy.predict(observation)
    np.testing.assert_array_equal(action, actor(observation))
    assert action.dtype == np.float64 and env.action_space.contains(action)
    np.testing.assert_array_equal(policy.predict(observation, state)[0], action)


@pytest.mark.parametrize(
    "name, options, method, message",
    [
        ("PlaceOne", {}, "ppo", "method: is 'sac'; wanted is 'ppo'"),
        ("Reach", {}, "sac", "task: is 'place_one'; wanted is 'reach'"),
        ("PlaceOne", {"robot": "Sawyer"}, "sac", "robot: is 'Panda'; wanted is 'Sawyer'"),
        ("PlaceOne", JOINTS, "sac", "control.mode: is 'ee_twist'; wanted is 'joint_velocity': it acts with"),
        ("PlaceOne", {"control_frequency": 50}, "sac", "control.frequency: is 20 Hz; wanted is 50 Hz: it acts with"),
        ("PlaceOne", {"onto": "block"}, "sac", r"observation.object_pose: has shape \(1, 7\); here it has \(2, 7\)"),
    ],
)
def test_it_acts_only_where_it_was_trained(env, name, options, method, message):
    other = gym.make(f"onedemo/{name}-v0", **options)
    with pytest.raises(BadActor, match=f"sac-place_one-Panda-ee_twist-20.json: {message}") as caught:
        made(other, method, saved_actor(env, "sac"))
    assert "\n" not in str(caught.value)


def test_an_observation_that_is_another_one_is_refused_at_the_start(env, tmp_path):
    policy = made(env, "sac", saved_actor(env, "sac"))
    observation, _ = env.reset(seed=0)
    less = {key: value for key, value in observation.items() if key != "goal_pose"}
    with pytest.raises(BadActor, match=r"observation.goal_pose: is not among the entries that there are: joint_pos"):
        policy.predict(less)
    with pytest.raises(BadActor, match=r"observation.goal_pose: has shape \(1, 7\); here it has \(2, 7\)"):
        policy.predict({**observation, "goal_pose": np.zeros((2, 7))})


def test_where_none_is_shipped_that_is_said(env):
    with pytest.raises(BadOption, match="no actor is shipped for 'sac-demo' on place_one with Sawyer; name a file"):
        task = replace(env.unwrapped.task, robot="Sawyer")
        make_policy("sac-demo", task, DEMONSTRATION)
    with pytest.raises(BadOption, match=r"place_one with Panda \(shipped: bc, residual, sac-demo, sac\); name"):
        made(env, "ppo", "")
    with pytest.raises(BadActor, match=r"nowhere\.json: file: does not exist"):
        made(env, "sac", "nowhere")
    with pytest.raises(BadConfig, match=r"checkpont: unknown key; did you mean 'checkpoint'. allowed: checkpoint"):
        make_policy("sac", env.unwrapped.task, DEMONSTRATION, {"checkpont": "x"})


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_a_shipped_actor_is_what_its_name_says(path):
    actor = load_actor(path)
    assert path.stem == f"{actor.method}-{actor.task}-{actor.robot}"
    assert actor.training.steps > 0 and actor.training.success is not None


def test_a_correction_is_as_fast_as_what_it_corrects_and_cut():
    action, correction = np.array([0.5, -0.9, 1.0]), np.array([1.0, -1.0, 1.0], dtype=np.float32)
    scale = np.array([0.2, 0.2, 0.0])
    np.testing.assert_allclose(corrected(action, correction, scale), [0.68, -1.0, 1.0])
    still = np.array([0.0, 0.0, 1.0])
    np.testing.assert_array_equal(corrected(still, correction, scale), still)
    np.testing.assert_array_equal(corrected(action, correction, np.zeros(3)), action)


def test_the_gripper_is_the_screw_policys(joints):
    assert default_scale(joints.unwrapped.task) == (*[0.1] * 7, 0.0)


def test_no_correction_is_the_screw_policy(joints, tmp_path):
    actor = replace(random_actor(joints, METHOD), residual_scale=(0.0,) * 8)
    residual, screw = made(joints, METHOD, save_actor(actor, tmp_path)), make_policy(
        "screw", joints.unwrapped.task, DEMONSTRATION
    )  # fmt: skip
    states, (observation, _) = [None, None], joints.reset(seed=3)
    for _ in range(60):
        (one, states[0]), (other, states[1]) = (
            policy.predict(observation, state) for policy, state in zip((residual, screw), states, strict=True)
        )
        np.testing.assert_array_equal(one, other)
        observation, *_ = joints.step(one)
    assert residual.report(states[0]).paths


def test_the_screw_policy_finds_back_from_what_it_was_corrected_by(joints):
    around = AroundScrew(joints, DEMONSTRATION, (*[1.0] * 7, 0.0))
    for size in (0.0, 1.0):
        around.reset(seed=0)
        info = {}
        for k in range(110):
            # for a third of a second while it carries: a quarter of a radian in every joint
            *_, info = around.step(np.full(8, size if 20 <= k < 27 else 0.0))
        assert info["success"]


def test_what_was_trained_around_the_screw_policy_acts_alike_in_the_benchmark(joints, tmp_path):
    """Two ways of the same episode: the learner's wrapper with the actor in it, and the policy on the bare task."""
    actor = random_actor(joints, METHOD)
    policy = made(joints, METHOD, save_actor(actor, tmp_path))
    around = AroundScrew(gym.make("onedemo/PlaceOne-v0", **JOINTS), DEMONSTRATION)
    assert around.scale == actor.residual_scale
    flat = FlatFeatures(around, actor.features, actor.normalization)
    seen, (observation, _), state = flat.reset(seed=4)[0], joints.reset(seed=4), None
    moved = 0.0
    for _ in range(50):
        action, state = policy.predict(observation, state)
        observation, *_ = joints.step(action)
        correction = actor.network(seen)
        moved = max(moved, np.abs(correction[:7]).max())
        seen, *_ = flat.step(correction)
        np.testing.assert_array_equal(seen, flat.normalization(
            flat.features({**observation, "screw_action": around.screw_action})))  # fmt: skip
    assert moved > 0.1


@pytest.mark.parametrize("method, scale, message", [("sac", (0.1,) * 8, "is not empty"), (METHOD, (), "is empty")])
def test_a_scale_belongs_to_what_corrects(joints, method, scale, message, tmp_path):
    actor = replace(random_actor(joints, METHOD), method=method, residual_scale=scale)
    with pytest.raises(BadActor, match=f"actor.json: residual_scale: {message}"):
        made(joints, method, save_actor(actor, tmp_path))


def test_around_the_screw_policy_only_joints_are_commanded(env, joints):
    with pytest.raises(BadOption, match="control_mode"):
        AroundScrew(env, DEMONSTRATION)
    with pytest.raises(BadOption, match="'scale': has 1 entries"):
        AroundScrew(joints, DEMONSTRATION, (0.1,))
    with pytest.raises(BadActor, match=r"control\.mode: is 'joint_velocity'; wanted is 'ee_twist'"):
        made(env, METHOD, saved_actor(joints, METHOD))
