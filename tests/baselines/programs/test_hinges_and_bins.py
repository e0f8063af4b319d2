"""Other tasks of robosuite, a door with a latch and bins, from one recording in another one's world and names."""

from __future__ import annotations

import gymnasium as gym
import mujoco
import numpy as np
import pytest
from helpers.envs.scripted_hand import ScriptedHand

import onedemo
import onedemo.envs  # registers the ids
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.imitation.demonstration import Demonstration

TURN, OPEN = -1.35, 0.45
"""Angles [rad] to which the latch is turned and the door is opened."""
BEFORE = Pose.from_position_quaternion([0.0, 0.0, -0.12])
DOWN = Pose.from_position_quaternion([0, 0, 0], [0, 1, 0, 0])


def played(env: gym.Env, shown: Demonstration, seed: int) -> dict:
    """Info at the end of an episode."""
    policy = onedemo.make_policy("screw", env.unwrapped.task, shown)
    observation, info = env.reset(seed=seed)
    state, over = None, False
    while not over:
        action, state = policy.predict(observation, state)
        observation, _, terminated, truncated, info = env.step(action)
        over = terminated or truncated or (policy.report(state).failure_reason != "")
    return info


def latch_at(model: mujoco.MjModel, data: mujoco.MjData, door: float, latch: float) -> Pose:
    for name, value in (("Door_hinge", door), ("Door_latch_joint", latch)):
        data.qpos[model.jnt_qposadr[model.joint(name).id]] = value
    mujoco.mj_kinematics(model, data)
    body = data.body("Door_latch")
    return Pose.from_position_quaternion(body.xpos, body.xquat)


@pytest.fixture(scope="module")
def door_opened(tmp_path_factory) -> Demonstration:
    """The hand takes the latch, turns it and pulls; the recording says where the whole door stood, no more."""
    person = ScriptedHand("Door", seed=21)
    model, data = person.env.sim.model, mujoco.MjData(person.env.sim.model)
    data.qpos[:] = person.env.sim.data.qpos
    body = person.env.sim.data.body("Door_main")
    stood = Pose.from_position_quaternion(body.xpos, body.xquat)
    # the hand points at the door, its fingers above and below the lever
    grasp = Pose.from_position_quaternion([0.12, -0.085, 0.0], [0.5, -0.5, -0.5, -0.5])
    ways = [grasp, grasp @ Pose.from_yaw([0, 0, 0], np.pi)]
    there = latch_at(model, data, 0.0, 0.0)
    grasp = min(ways, key=lambda way: person.tcp.distance_to(there @ way)[1])
    person.go(there @ grasp @ BEFORE, near=0.015)
    person.go(there @ grasp)
    person.grip(1.0)
    angles = [(0.0, TURN * share) for share in np.linspace(0.0, 1.0, 60)]
    angles += [(OPEN * share, TURN) for share in np.linspace(0.0, 1.0, 120)]
    for door, latch in [*angles, *([angles[-1]] * 20)]:
        person.towards(latch_at(model, data, door, latch) @ grasp)
    assert person.info["robosuite_success"]
    return person.demonstration({"Door_main": stood, "table": Pose.identity()}, tmp_path_factory.mktemp("door"))


def test_a_door_is_opened_by_its_latch(door_opened):
    env = gym.make("onedemo/Robosuite-v0", task="Door")
    skill = onedemo.skill_of(door_opened, env.unwrapped.task)
    reach, push = skill.phases
    assert (reach.kind, reach.reference, reach.gripper) == ("reach", "Door", "close")
    assert (push.kind, push.gripper) == ("articulate", "none")
    assert set(push.touching) == {"Door", "Door_frame", "Door_door", "Door_latch"}
    info = played(env, door_opened, seed=1)
    assert info["success"] and info["safe"]


@pytest.fixture(scope="module")
def milk_moved(tmp_path_factory) -> Demonstration:
    """Milk is brought from one bin to its place in the other; the robot does not stand where it does at a table."""
    person = ScriptedHand("PickPlaceMilk", seed=21)
    lies = Pose.from_vector(person.seen["object_pose"][0])
    up = np.array([0.0, 0.0, 1.0])
    above, grasp = lies.position + 0.2 * up, lies.position + 0.035 * up
    turn = Pose.from_yaw([0, 0, 0], (lies.yaw + 0.5 * np.pi) % np.pi - 0.5 * np.pi)
    place = np.array([0.0025, 0.1575, grasp[2]])  # of milk, the compartment at the back
    for point, near in ((above, 0.02), (grasp, 0.006)):
        person.go(Pose.from_position_quaternion(point) @ turn @ DOWN, near)
    person.grip(1.0)
    for point in (above, [*place[:2], above[2]], place + 0.02 * up):
        person.go(Pose.from_position_quaternion(point) @ turn @ DOWN, 0.015)
    person.grip(-1.0)
    person.go(Pose.from_position_quaternion([*place[:2], above[2]]) @ turn @ DOWN, 0.02)
    assert person.info["robosuite_success"]
    bins = {
        name: Pose.from_vector(row) for name, row in zip(("bin1", "bin2"), person.seen["furniture_pose"], strict=True)
    }
    return person.demonstration(bins, tmp_path_factory.mktemp("bins"))


def test_an_object_is_put_into_its_bin(milk_moved):
    env = gym.make("onedemo/Robosuite-v0", task="PickPlaceMilk")
    reach, carry, *_ = onedemo.skill_of(milk_moved, env.unwrapped.task).phases
    assert np.linalg.norm(reach.object_from_tcp.position) < 0.06, "the hand is not where the object is"
    assert (carry.thing, carry.reference) == ("Milk", "bin2")
    info = played(env, milk_moved, seed=1)
    assert info["success"] and info["safe"]
