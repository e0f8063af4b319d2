"""The tasks of one object: what those who train rely on."""

from __future__ import annotations

import math
import warnings
from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from hypothesis import given
from hypothesis import strategies as st

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.envs.judge.dense_reward import closeness, gaps, placing, tilting, turned_by
from onedemo.envs.judge.goal_progress import GoalProgress
from onedemo.envs.stack.rules import stack_rules
from onedemo.planner.errors import BadOption, UnknownName
from onedemo.planner.geometry.pose import Pose

IDS = ("onedemo/Reach-v0", "onedemo/PlaceOne-v0", "onedemo/TiltPour-v0", "onedemo/InsertOne-v0")
HELD = IDS[1:]
each_id = pytest.mark.parametrize("name", IDS)
each_held = pytest.mark.parametrize("name", HELD)
small = st.floats(0.0, 1.0)


@pytest.fixture(scope="module")
def envs():
    made = {name: gym.make(name) for name in IDS}
    yield made
    for env in made.values():
        env.close()


@pytest.fixture(scope="module")
def goal_envs():
    made = {name: gym.make(name, goal_form=True, reward="sparse") for name in IDS}
    yield made
    for env in made.values():
        env.close()


def closed(env):
    """Stand still with a closed hand."""
    action = np.zeros(env.action_space.shape)
    action[-1] = 1.0
    return action


@each_id
def test_they_are_made_for_training(name, envs):
    env = envs[name]
    assert env.action_space.shape == (7,)
    assert env.unwrapped.control_dt == 0.05
    assert env.spec.max_episode_steps == 150
    env.reset(seed=0)
    ends = [env.step(np.zeros(7))[2:4] for _ in range(150)]
    assert ends == [(False, False)] * 149 + [(False, True)]


@each_id
@pytest.mark.parametrize("mode", ["ee_twist", "joint_velocity"])
def test_what_was_done_last_is_seen(name, mode):
    env = gym.make(name, control_mode=mode)
    observation, _ = env.reset(seed=0)
    assert not observation["last_action"].any()
    rng = np.random.default_rng(0)
    for _ in range(5):
        action = rng.uniform(-1.5, 1.5, env.action_space.shape)
        observation, *_ = env.step(action)
        np.testing.assert_array_equal(observation["last_action"], np.clip(action, -1.0, 1.0))
        action[:] = 0.0  # a copy was kept
    again, _ = env.reset(seed=1)
    assert not again["last_action"].any() and observation["last_action"].any()


@each_held
@pytest.mark.parametrize("robot", ["Panda", "Baxter"])
def test_what_is_in_the_hand_from_the_start_stays_there(name, robot):
    env = gym.make(name, robot=robot)
    for seed in range(3):
        observation, info = env.reset(seed=seed)
        assert observation["motion_index"][0] == 1 and info["safe"]
        at = observation["object_pose"][0]
        hand = Pose.from_vector(observation["tcp_pose"][0])
        before = hand.inverse() @ Pose.from_vector(at)
        for _ in range(30):
            observation, _, _, _, info = env.step(closed(env))
        hand = Pose.from_vector(observation["tcp_pose"][0])
        distance, angle = before.distance_to(hand.inverse() @ Pose.from_vector(observation["object_pose"][0]))
        assert observation["motion_index"][0] == 1 and info["safe"]
        assert distance < 0.004 and angle < 0.05


@each_held
def test_it_is_held_by_friction_and_falls_without(name):
    env = gym.make(name).unwrapped
    env.sim.model.geom_friction[:] = 1e-4
    env.sim.model.geom_priority[:] = 0
    start = env.reset(seed=0)[0]["object_pose"][0, 2]
    for _ in range(10):
        observation, *_ = env.step(closed(env))
    assert observation["object_pose"][0, 2] < start - 0.03


def test_the_block_can_stand_on_another():
    env = gym.make("onedemo/PlaceOne-v0", onto="block", level="L2")
    observation, _ = env.reset(seed=3)
    np.testing.assert_allclose(observation["object_pose"][0], observation["goal_pose"][0], atol=1e-12)
    assert observation["motion_index"][0] == 3
    assert observation["goal_pose"][1, 2] == pytest.approx(observation["goal_pose"][0, 2] + 0.05)


def test_the_block_can_wait_on_the_table():
    env = gym.make("onedemo/PlaceOne-v0", pregrasped=False)
    observation, _ = env.reset(seed=3)
    assert observation["motion_index"][0] == 0
    assert observation["object_pose"][0, 2] == pytest.approx(0.825)


def test_a_block_in_the_hand_follows_given_joints_and_the_hand_a_given_block(envs):
    env = envs["onedemo/PlaceOne-v0"]
    joints = env.unwrapped.sim.scene.home[0] + 0.1
    observation, _ = env.reset(seed=0, options={"joint_positions": joints})
    np.testing.assert_allclose(observation["joint_positions"][0], joints)
    assert observation["motion_index"][0] == 1
    pose = np.array([0.05, 0.1, 0.95, 1.0, 0.0, 0.0, 0.0])
    observation, _ = env.reset(seed=0, options={"object_poses": pose[None]})
    np.testing.assert_allclose(observation["object_pose"][0], pose, atol=1e-9)
    assert observation["motion_index"][0] == 1


@pytest.mark.parametrize("name", ["onedemo/TiltPour-v0", "onedemo/InsertOne-v0"])
def test_what_has_no_room_for_obstacles_says_so(name, envs):
    for make in (
        lambda: gym.make(name, level="L3"),
        lambda: gym.make(name, obstacles="static"),
        lambda: envs[name].reset(options={"level": "L4"}),
        lambda: envs[name].reset(options={"obstacles": "moving"}),
    ):
        with pytest.raises(BadOption, match="too short for obstacles; allowed: levels L0, L1, L2, R, S, T"):
            make()


@pytest.mark.parametrize("option", ["goal_form", "end_on_success"])
def test_flags_are_flags(option):
    with pytest.raises(BadOption, match=f"'{option}': 'yes' is neither True nor False"):
        gym.make("onedemo/Reach-v0", **{option: "yes"})
    with pytest.raises(UnknownName, match="unknown onto 'shelf'; known: table, block"):
        gym.make("onedemo/PlaceOne-v0", onto="shelf")


# ---- rewards


@given(small, small)
def test_nearer_is_never_worse(a, b):
    close, far = sorted((a, b))
    assert 0.0 <= closeness(far, 0.0) <= closeness(close, 0.0) <= 1.0 == closeness(0.0, 0.0)
    assert closeness(0.0, far) <= closeness(0.0, close)


@given(small, small)
def test_what_is_missing_in_one_way_does_not_hide_what_is_gained_in_the_other(distance, angle):
    gained = closeness(0.0, angle) - closeness(distance, angle)
    assert gained == pytest.approx(1.0 - closeness(distance, 0.0), abs=1e-12)


@given(small, small, small, small, small)
def test_each_stage_of_placing_pays_more_than_the_one_before(reach, error, turn, away, other):
    lost = placing(reach, error, turn, False, False, away)
    held = placing(reach, other, turn, True, False, away)
    placed = placing(reach, error, turn, False, True, away)
    tiny = 1e-12
    assert -tiny <= lost <= held + tiny and held <= placed + tiny and placed <= 1.0 + tiny
    assert placing(0.0, 0.0, 0.0, False, True, 1.0) == 1.0


@given(small, small, small, st.booleans())
def test_pouring_pays_most_for_beads(way, tilt, poured, held):
    reward = tilting(way, tilt, held, poured)
    assert 0.5 * poured <= reward <= 0.5 + 0.5 * poured
    assert tilting(0.0, 1.0, True, 1.0) == 1.0


@each_id
def test_dense_rewards_are_shares_and_nothing_pays_more_than_success(name, envs):
    env, rng = envs[name], np.random.default_rng(0)
    env.reset(seed=1)
    rewards = [env.step(rng.uniform(-1, 1, 7))[1] for _ in range(100)]
    assert min(rewards) >= 0.0
    assert max(rewards) < 1.0


def a_finished_episode(**options):
    """Of a block that stands at its place, the hand away; rewards and ends of each step."""
    env = gym.make("onedemo/PlaceOne-v0", pregrasped=False, **options)
    base = np.array([0.1, 0.0, 0.825, 1.0, 0.0, 0.0, 0.0])
    env.reset(seed=0, options={"object_poses": base[None], "base_pose": base})
    return [env.step(np.zeros(7))[1:4] for _ in range(30)]


def test_a_success_ends_sparse_episodes_and_lets_dense_ones_go_on():
    sparse, dense = a_finished_episode(reward="sparse"), a_finished_episode()
    first = next(k for k, (_, ended, _) in enumerate(sparse) if ended)
    assert 8 <= first <= 12 and sparse[first][0] == 1.0
    assert not any(ended for _, ended, _ in dense)
    assert dense[-1][0] > 0.99
    assert a_finished_episode(end_on_success=True)[first][1]
    assert not any(ended for _, ended, _ in a_finished_episode(reward="sparse", end_on_success=False))


# ---- the goal form


@each_id
def test_gymnasiums_checker_has_nothing_to_say_of_the_goal_form(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gym.make(name, goal_form=True).unwrapped, skip_render_check=True)


@each_id
@pytest.mark.parametrize("reward", ["sparse", "dense"])
def test_the_reward_is_that_of_the_goals(name, reward):
    env = gym.make(name, goal_form=True, reward=reward)
    rng, rows = np.random.default_rng(0), []
    env.reset(seed=0)
    for _ in range(20):
        observation, paid, _, _, info = env.step(rng.uniform(-1, 1, 7))
        goals = observation["achieved_goal"], observation["desired_goal"]
        assert paid == env.unwrapped.compute_reward(*goals, info)
        rows.append((*goals, paid))
    achieved, desired, paid = (np.array(column) for column in zip(*rows, strict=True))
    np.testing.assert_array_equal(env.unwrapped.compute_reward(achieved, desired, {}), paid)
    assert env.unwrapped.compute_reward(achieved, achieved, [{}] * 20).tolist() == [1.0] * 20


@each_id
def test_the_goal_form_says_all_that_the_other_one_says_but_what_is_desired(name, envs, goal_envs):
    plain, _ = envs[name].reset(seed=5)
    goals, _ = goal_envs[name].reset(seed=5)
    seen = [key for key in plain if key not in ("goal_pose", "motion_index")]
    space = gym.spaces.Dict({key: envs[name].observation_space[key] for key in seen})
    flat = gym.spaces.utils.flatten(space, {key: plain[key] for key in seen})
    np.testing.assert_array_equal(goals["observation"], flat)


def test_a_block_that_is_not_let_go_is_not_there(goal_envs):
    env = goal_envs["onedemo/PlaceOne-v0"].unwrapped
    env.reset(seed=0)
    goal = env.desired_goal()
    held = np.append(goal[:7], 0.0)
    assert env.compute_reward(goal, goal, {}) == 1.0
    assert env.compute_reward(held, goal, {}) == 0.0


@pytest.mark.parametrize("off, there", [(0.0095, 1.0), (0.0105, 0.0)])
def test_tolerances_are_those_of_success(off, there, goal_envs):
    for name in (IDS[0], IDS[1], IDS[3]):
        env = goal_envs[name].unwrapped
        env.reset(seed=0)
        goal = env.desired_goal()
        moved = goal.copy()
        moved[0] += off
        assert env.compute_reward(moved, goal, {}) == there, name


@given(st.floats(-math.pi, math.pi), st.floats(-math.pi, math.pi))
def test_half_turns_count_only_where_they_are_seen(yaw, more):
    a, b = (Pose.from_yaw([0.0, 0.0, 0.0], angle) for angle in (yaw, yaw + more))
    whole = float(turned_by(a.quaternion, b.quaternion, half_turns=False))
    half = float(turned_by(a.quaternion, b.quaternion, half_turns=True))
    # the arc cosine of nearly one is known to about 1e-8
    assert whole == pytest.approx(abs(more), abs=1e-6)
    assert half == pytest.approx(min(abs(more), math.pi - abs(more)), abs=1e-6)


@given(st.lists(st.floats(-0.5, 0.5), min_size=6, max_size=6))
def test_gaps_are_those_of_poses(numbers):
    a = Pose.from_position_quaternion(numbers[:3], [1.0, 0.0, 0.0, 0.0])
    turned = np.array([1.0, *numbers[3:]])
    b = Pose.from_position_quaternion(np.zeros(3), turned / np.linalg.norm(turned))
    distance, angle = gaps(a.vector, b.vector, half_turns=False)
    assert (distance, angle) == pytest.approx(a.distance_to(b), abs=1e-6)


def test_the_goal_forms_dense_reward_has_the_shape_of_the_other(goal_envs):
    env = gym.make("onedemo/Reach-v0", goal_form=True).unwrapped
    env.reset(seed=0)
    goal = env.desired_goal()
    for off in (0.02, 0.1, 0.4):
        moved = goal.copy()
        moved[0] += off
        assert env.compute_reward(moved, goal, {}) == pytest.approx(0.9 * closeness(off, 0.0))


def test_a_block_lifted_from_the_start_that_stands_elsewhere_was_dropped():
    goals = np.array([[0.1, 0.0, 0.825, 1.0, 0.0, 0.0, 0.0]])
    start = np.array([[-0.2, 0.0, 0.825, 1.0, 0.0, 0.0, 0.0]])
    state = SimpleNamespace(
        object_pose=start, object_velocity=np.zeros((1, 3)), tcp_pose=start + 1.0, touching=np.zeros((9, 9))
    )
    for in_hand, reason in ((True, "dropped"), (False, "")):
        progress = GoalProgress(stack_rules(1), goals, start, 0.05, in_hand=0 if in_hand else None)
        progress.update(state)
        assert progress.failure == reason
