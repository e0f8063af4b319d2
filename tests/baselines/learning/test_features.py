"""What a learner sees: named, bounded, the same for both signs of a quaternion, nothing that jumps."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.utils.env_checker import check_env
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import onedemo.envs
from onedemo.baselines.learning.feature_scaling import CLIP, FlatFeatures, Normalization, measured_normalization
from onedemo.baselines.learning.features import RELATIVE, Features
from onedemo.planner.errors import BadOption, BadShape, NotFinite, UnknownName
from onedemo.planner.geometry.pose import Pose

ALL = sorted(onedemo.envs.IDS)
POSES = {"tcp_pose": (1, 7), "object_pose": (2, 7), "goal_pose": (2, 7)}
SEEN = Features(tuple(POSES.items()), (*POSES, *RELATIVE))
entries = st.floats(-2.0, 2.0, width=32)


@st.composite
def poses(draw, count):
    rows = draw(arrays(np.float64, (count, 7), elements=entries))
    rows[:, 3] += 0.1
    norms = np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)
    rows[:, 3:] = np.where(norms > 1e-3, rows[:, 3:] / np.maximum(norms, 1e-3), [1.0, 0.0, 0.0, 0.0])
    return rows


observations = st.fixed_dictionaries({key: poses(shape[0]) for key, shape in POSES.items()})


@pytest.fixture(scope="module")
def env():
    made = gym.make("onedemo/Stack-v0", n_blocks=2, control_mode="ee_twist", control_frequency=20)
    yield made
    made.close()


def value(features, observation, name):
    return features(observation)[features.names.index(name)]


@pytest.mark.parametrize("name", ALL)
def test_of_every_id_each_number_has_a_name_and_stays_within_its_bounds(name):
    env, rng = gym.make(name), np.random.default_rng(0)
    features = Features.of(env.observation_space, obstacles=True)
    low, high = features.bounds(env.observation_space)
    assert len(set(features.names)) == len(features.names) == features.size == len(low) == len(high)
    assert (low < high).all()
    observation, _ = env.reset(seed=0, options={"level": "L1"})
    seen = []
    for _ in range(50):
        numbers = features(observation)
        assert numbers.dtype == np.float32 and numbers.shape == (features.size,)
        assert ((numbers >= low - 1e-6) & (numbers <= high + 1e-6)).all()
        seen.append(observation)
        observation, *_ = env.step(rng.uniform(-1, 1, env.action_space.shape))
    batch = {key: np.stack([each[key] for each in seen]) for key in seen[0]}
    np.testing.assert_array_equal(features(batch), [features(each) for each in seen])
    env.close()


@given(observations, st.sampled_from(sorted(POSES)))
def test_both_signs_of_a_quaternion_are_the_same(observation, key):
    other = {**observation, key: observation[key] * np.array([1, 1, 1, -1, -1, -1, -1])}
    np.testing.assert_array_equal(SEEN(observation), SEEN(other))


@given(observations, st.integers(0, 2**32 - 1))
def test_a_small_motion_is_a_small_change_wherever_it_begins(observation, seed):
    """Also at half turns, where the numbers of a quaternion with a chosen sign jump."""
    rng, moved = np.random.default_rng(seed), {}
    for key, rows in observation.items():
        turns = np.column_stack([np.ones(len(rows)), rng.uniform(-1e-4, 1e-4, (len(rows), 3))])
        turned = [Pose.from_position_quaternion(np.zeros(3), t / np.linalg.norm(t)) for t in turns]
        moved[key] = np.array([(Pose.from_vector(row) @ turn).vector for row, turn in zip(rows, turned, strict=True)])
    assert np.abs(SEEN(observation) - SEEN(moved)).max() < 3e-3


@given(st.floats(-3.1, 3.1), st.floats(-3.1, 3.1), arrays(np.float64, (2, 3), elements=entries))
def test_differences_are_those_of_upright_frames(first, second, places):
    start, end = Pose.from_yaw(places[0], first), Pose.from_yaw(places[1], second)
    observation = {
        "tcp_pose": start.vector[None],
        "object_pose": np.stack([end.vector, start.vector]),
        "goal_pose": np.stack([end.vector, end.vector]),
    }
    names = [f"object_minus_tcp[0,0].{end}" for end in ("x", "y", "z", "cos", "sin")]
    found = [value(SEEN, observation, name) for name in names]
    turn = second - first
    np.testing.assert_allclose(found, [*(places[1] - places[0]), np.cos(turn), np.sin(turn)], atol=1e-5)
    np.testing.assert_allclose(
        [value(SEEN, observation, f"goal_minus_object[1,1].{end}") for end in ("x", "cos")],
        [places[1][0] - places[0][0], np.cos(turn)], atol=1e-5,
    )  # fmt: skip


def test_axes_are_columns_of_the_rotation():
    rng = np.random.default_rng(0)
    for _ in range(20):
        quaternion = rng.normal(size=4)
        pose = Pose.from_position_quaternion(rng.normal(size=3), quaternion / np.linalg.norm(quaternion))
        features = Features((("tcp_pose", (1, 7)),), ("tcp_pose",))
        expected = [*pose.position, *pose.rotation[:, 0], *pose.rotation[:, 2]]
        np.testing.assert_allclose(features({"tcp_pose": pose.vector[None]}), expected, atol=1e-6)


def test_goals_and_objects_are_paired_only_where_there_are_as_many():
    shapes = (("goal_pose", (1, 7)), ("object_pose", (3, 7)))
    features = Features(shapes, ("goal_minus_object",))
    assert features.size == 24 and features.names[8] == "goal_minus_object[0,1].x"
    assert Features((("goal_pose", (3, 7)), ("object_pose", (3, 7))), ("goal_minus_object",)).size == 24


def test_differences_are_told_finely_where_they_are_small():
    features = Features((("goal_pose", (1, 7)), ("tcp_pose", (1, 7))), ("goal_minus_tcp",))
    tcp, gap = np.array([[0.3, -0.2, 1.0, 1, 0, 0, 0]]), np.array([0.003, -0.02, 0.5])
    goal = tcp + np.r_[gap, 0, 0, 0, 0]
    seen = dict(zip(features.names, features({"goal_pose": goal, "tcp_pose": tcp}), strict=True))
    for axis, length in zip("xyz", gap, strict=True):
        assert seen[f"goal_minus_tcp[0,0].{axis}"] == pytest.approx(length, abs=1e-6)
        assert seen[f"goal_minus_tcp[0,0].near_{axis}"] == pytest.approx(np.tanh(length / 0.02), abs=1e-5)


def test_obstacles_are_seen_only_if_they_are_asked_for(env):
    assert not any("obstacle" in name for name in Features.of(env.observation_space).names)
    assert any("obstacle" in name for name in Features.of(env.observation_space, obstacles=True).names)
    chosen = Features.of(env.observation_space, ("tcp_pose", "obstacle_pose"))
    assert chosen.size == 9 * 4 and chosen.blocks == ("tcp_pose", "obstacle_pose")
    assert "goal_minus_tcp" in Features.of(env.observation_space, ("tcp_pose", "goal_pose")).blocks
    assert not set(RELATIVE) & set(Features.of(env.observation_space, relative=False).blocks)


def test_raw_is_what_gymnasium_makes_of_it(env):
    features, (observation, _) = Features.raw(env.observation_space), env.reset(seed=0)
    flat = spaces.flatten(env.observation_space, observation)
    np.testing.assert_array_equal(features(observation), flat.astype(np.float32))


def test_what_cannot_be_seen_is_named(env):
    with pytest.raises(UnknownName, match="unknown feature 'colour'; known: goal_pose, "):
        Features.of(env.observation_space, ("colour",))
    with pytest.raises(UnknownName, match="unknown feature 'goal_minus_tcp'"):
        Features((("tcp_pose", (1, 7)),), ("goal_minus_tcp",))
    with pytest.raises(BadOption, match=r"tcp_pose has shape \(7,\); poses are \(n, 7\)"):
        Features((("tcp_pose", (7,)),), ("tcp_pose",))
    with pytest.raises(BadOption, match="tcp_pose is there twice"):
        Features((("tcp_pose", (1, 7)),), ("tcp_pose", "tcp_pose"))
    with pytest.raises(BadOption, match="is a Box, not a Dict of boxes"):
        Features.of(env.action_space)
    with pytest.raises(BadOption, match="kind is a Discrete, not a Box"):
        Features.of(spaces.Dict({"kind": spaces.Discrete(3)}))


def test_the_wrapper_is_a_bounded_environment(env):
    features = Features.of(env.observation_space)
    flat = FlatFeatures(env, features, measured_normalization(env, features, episodes=2, steps=50))
    box = flat.observation_space
    assert box.dtype == np.float32 and np.isfinite(box.low).all() and np.abs(box.high).max() <= CLIP
    observation, _ = flat.reset(seed=3)
    for _ in range(20):
        assert box.contains(observation)
        observation, *_ = flat.step(flat.action_space.sample())
    check_env(FlatFeatures(gym.make("onedemo/Reach-v0").unwrapped), skip_render_check=True)


def test_measuring_is_repeatable_and_nothing_is_blown_up(env):
    features = Features.of(env.observation_space)
    first, again = (measured_normalization(env, features, episodes=2, steps=60, seed=5) for _ in range(2))
    np.testing.assert_array_equal(first.mean, again.mean)
    np.testing.assert_array_equal(first.scale, again.scale)
    other = measured_normalization(env, features, episodes=2, steps=60, seed=6)
    assert (first.mean != other.mean).any()
    scale = dict(zip(features.names, first.scale, strict=True))
    assert scale["goal_pose[0].z"] == pytest.approx(0.05)  # never changes
    assert scale["goal_pose[0].z_axis.z"] == pytest.approx(0.25)
    assert scale["joint_velocities[0,0]"] > 0.25 and scale["tcp_pose[0].x"] > 0.05


def test_normalization_is_affine_and_cut():
    scaled = Normalization(np.array([1.0, 2.0]), np.array([2.0, 0.1]))(np.array([5.0, 9.0], dtype=np.float32))
    assert scaled.dtype == np.float32
    np.testing.assert_array_equal(scaled, np.array([2.0, CLIP], dtype=np.float32))
    assert Normalization(np.zeros(1), np.ones(1), None)(np.array([99.0], dtype=np.float32)) == 99.0
    with pytest.raises(BadShape, match=r"scale has shape \(2,\)"):
        Normalization(np.zeros(3), np.ones(2))
    with pytest.raises(NotFinite, match="mean"):
        Normalization(np.array([np.nan]), np.ones(1))
    with pytest.raises(BadOption, match="entry 1 is not positive"):
        Normalization(np.zeros(2), np.array([1.0, 0.0]))
    with pytest.raises(BadOption, match="'clip'"):
        Normalization(np.zeros(1), np.ones(1), 0.0)
