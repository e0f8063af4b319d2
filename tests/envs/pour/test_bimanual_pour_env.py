"""Pouring with two arms: its start, its rules."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from helpers.envs.contacts import wanted

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.envs.pour.rules import pour_contacts, tilt_of
from onedemo.envs.scene.scene import ARM, FINGERS, FIRST_OBJECT, OTHER_ARM, OTHER_FINGERS, WORLD
from onedemo.planner.errors import BadOption, UnknownName

SOURCE, TARGET = FIRST_OBJECT, FIRST_OBJECT + 1


@pytest.fixture(scope="module")
def env():
    made = gym.make("onedemo/BimanualPour-v0").unwrapped
    yield made
    made.close()


def still(env):
    action = np.zeros(env.action_space.shape)
    action[[7, 15]] = 1.0
    return action


@pytest.mark.parametrize("level", ["L0", "L1", "L2"])
def test_the_glasses_are_held_upright_from_the_start_and_stay(env, level):
    for seed in range(3):
        start, info = env.reset(seed=seed, options={"level": level})
        assert max(tilt_of(pose) for pose in start["object_pose"]) < 1e-2
        np.testing.assert_array_equal(start["bead_fraction"], [1.0, 0.0, 0.0])
        for _ in range(50):
            observation, _, terminated, _, info = env.step(still(env))
        moved = np.linalg.norm(observation["object_pose"][:, :3] - start["object_pose"][:, :3], axis=1)
        assert moved.max() < 1.5e-3
        assert info["safe"]
        assert not terminated
        assert observation["motion_index"] == [1.0]


def test_a_hand_that_opens_drops_its_glass_and_the_episode_ends(env):
    env.reset(seed=0, options={"level": "L0"})
    action = still(env)
    action[7] = -1.0
    for _ in range(150):
        _, _, terminated, _, info = env.step(action)
        if terminated:
            break
    assert terminated
    assert not info["success"]
    assert info["failure_reason"] in ("constraint", "off_table")


def test_wanted_contacts():
    assert wanted(pour_contacts(), FINGERS, SOURCE)
    assert wanted(pour_contacts(), OTHER_FINGERS, TARGET)
    assert wanted(pour_contacts(), OTHER_ARM, OTHER_FINGERS)
    unwanted = ((FINGERS, TARGET), (OTHER_FINGERS, SOURCE), (ARM, OTHER_ARM), (ARM, TARGET), (WORLD, OTHER_ARM))
    for pair in (*unwanted, (SOURCE, TARGET), (FINGERS, OTHER_FINGERS)):
        assert not wanted(pour_contacts(), *pair), pair


def test_starts_differ_within_their_level_and_repeat(env):
    nominal = env.reset(seed=0, options={"level": "L0"})[0]["object_pose"][:, :3]
    for level, most in (("L1", 0.05), ("L2", 0.15)):
        starts = np.array([env.reset(seed=k, options={"level": level})[0]["object_pose"][:, :3] for k in range(5)])
        assert np.abs(starts - nominal).max() <= most + 1e-3
        assert np.abs(starts - nominal).max() > 0.5 * most
        again = env.reset(seed=4, options={"level": level})[0]["object_pose"][:, :3]
        np.testing.assert_array_equal(again, starts[4])


def test_bad_options_are_named(env):
    with pytest.raises(UnknownName, match="reset option 'stands'"):
        env.reset(options={"stands": 0})
    with pytest.raises(BadOption, match=r"the right hand is \d+ degrees from level; 5 are possible"):
        down = env.sim.scene.home.copy()
        env.reset(options={"joint_positions": down})
