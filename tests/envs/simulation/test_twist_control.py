"""Tcp twists as actions: the arm does together, and soon, what it was told."""

from __future__ import annotations

import gymnasium as gym
import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.envs.simulation.twist_control import MAX_LINEAR, TORQUE_SHARE

ROBOTS = ("Panda", "Baxter", "UR5e")
FREQUENCIES = (10, 20, 50)


def driven(robot, frequency):
    env = gym.make("onedemo/Reach-v0", robot=robot, control_frequency=frequency).unwrapped
    observation, _ = env.reset(seed=0, options={"level": "L0"})
    return env, observation


def twist(axis, size=1.0):
    action = np.zeros(7)
    action[axis] = size
    return action


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("frequency", FREQUENCIES)
@pytest.mark.parametrize("axis", (3, 4, 5))
def test_a_turn_that_begins_and_ends_at_once_leaves_the_tool_where_it_is(robot, frequency, axis):
    # 40 mm with a Panda whose joints each go as fast as they can
    env, before = driven(robot, frequency)
    for k in range(2 * frequency):
        observation, *_ = env.step(twist(axis) if k < 0.15 * frequency else np.zeros(7))
        assert np.linalg.norm(observation["tcp_pose"][0, :3] - before["tcp_pose"][0, :3]) < 0.015


@pytest.mark.parametrize("axis", (0, 1, 2))
def test_the_tool_has_its_speed_after_two_actions_and_rests_after_four(axis):
    env, observation = driven("Panda", 20)
    places = [observation["tcp_pose"][0, :3]]
    for k in range(12):
        observation, *_ = env.step(twist(axis) if k < 6 else np.zeros(7))
        places.append(observation["tcp_pose"][0, :3])
    speeds = np.diff(places, axis=0)[:, axis] * 20
    assert speeds[2:6] == pytest.approx(MAX_LINEAR, rel=0.25)
    assert speeds[10:] == pytest.approx(0.0, abs=0.15 * MAX_LINEAR)
    assert places[-1][axis] - places[0][axis] == pytest.approx(6 / 20 * MAX_LINEAR, abs=0.003)


@pytest.mark.parametrize("robot", ROBOTS)
def test_changes_of_speed_ask_for_no_more_than_their_share_of_any_torque(robot):
    env, _ = driven(robot, 20)
    drive, rng = env._drive, np.random.default_rng(0)
    index = env.sim.scene.arms[0]
    limits = env.sim.model.actuator_forcerange[index.ctrl, 1]
    for _ in range(50):
        inertia = np.zeros((env.sim.model.nv, env.sim.model.nv))
        mujoco.mj_fullM(env.sim.model, inertia, env.sim.data.qM)
        before = drive._speeds[0].copy()
        env.step(np.r_[rng.uniform(-1, 1, 6), 0])
        torque = inertia[np.ix_(index.qvel, index.qvel)] @ (drive._speeds[0] - before) / env.control_dt
        assert (np.abs(torque) <= (TORQUE_SHARE + 1e-9) * limits).all()


def test_a_turn_turns_by_what_was_asked_for():
    env, observation = driven("Panda", 20)
    before = Rotation.from_quat(observation["tcp_pose"][0, [4, 5, 6, 3]])
    for k in range(16):
        observation, *_ = env.step(twist(5, 0.5) if k < 6 else np.zeros(7))
    turned = Rotation.from_quat(observation["tcp_pose"][0, [4, 5, 6, 3]]) * before.inv()
    np.testing.assert_allclose(turned.as_rotvec(), [0, 0, 0.5 * 1.2 * 6 / 20], atol=0.01)


def test_what_was_driven_before_a_reset_is_forgotten():
    env, _ = driven("Panda", 20)
    rng = np.random.default_rng(1)
    actions, after = rng.uniform(-1, 1, (5, 7)), []
    for _ in range(2):
        env.reset(seed=3)
        for action in actions:
            observation, *_ = env.step(action)
        after.append(observation["joint_positions"])
    np.testing.assert_array_equal(*after)
