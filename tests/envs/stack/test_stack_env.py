"""Layouts, the physics of arm and grasp, and when stacking counts as done."""

from __future__ import annotations

from itertools import product

import gymnasium as gym
import mujoco
import numpy as np
import pytest
from helpers.envs.contacts import wanted
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.envs.judge.goal_progress import GoalProgress
from onedemo.envs.scene.robots import ROBOTS
from onedemo.envs.scene.scene import ARM, FINGERS, FIRST_OBJECT, WORLD
from onedemo.envs.simulation.state import read_arms, read_objects
from onedemo.envs.stack.layout import BASE_GAP, BLOCK_GAP, RANGES, fits, nominal_blocks, stack_layout
from onedemo.envs.stack.rules import BLOCK_SIZE, stack_rules
from onedemo.planner.errors import BadOption, OneDemoError
from onedemo.planner.geometry.pose import Pose

AXIS = np.array([-0.56, 0.0])
BASE = [0.1, 0.0, 0.825, 1.0, 0.0, 0.0, 0.0]
IDLE = np.zeros(8)


@pytest.fixture(scope="module")
def env():
    made = gym.make("onedemo/Stack-v0").unwrapped
    yield made
    made.close()


def stacked(offset=(0.0, 0.0), yaw=0.0, order=(0, 1, 2)):
    """A finished stack at BASE with its top block moved and turned."""
    poses = np.tile(BASE, (3, 1))
    for height, block in enumerate(order):
        poses[block, 2] += 0.05 * height
    top = order[2]
    poses[top, :2] += offset
    poses[top, 3:] = [np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)]
    return poses


def outcome(env, poses, steps=40, **options):
    env.reset(seed=0, options={"object_poses": poses, "base_pose": BASE, **options})
    flags = []
    for _ in range(steps):
        *_, terminated, _, info = env.step(IDLE)
        flags.append(info["success"])
        if terminated:
            break
    return flags, info


def test_a_finished_stack_is_a_success_after_half_a_second_and_not_before(env):
    flags, info = outcome(env, stacked())
    assert flags[-1]
    assert flags.index(True) == pytest.approx(24, abs=8)
    assert (info["stage"], info["blocks_placed"], info["safe"]) == ("placed 3 of 3", 3, True)
    assert info["is_success"] is info["success"] is True


@pytest.mark.parametrize(
    "poses, counts",
    [
        (stacked(offset=(0.009, 0.0)), True),
        (stacked(offset=(0.0, 0.011)), False),
        (stacked(yaw=np.deg2rad(9)), True),
        (stacked(yaw=np.deg2rad(11)), False),
        (stacked(yaw=np.pi), True),
        (stacked(yaw=np.pi / 2), False),
        (stacked(order=(1, 0, 2)), False),
    ],
)
def test_success_is_within_10_mm_and_10_degrees_half_turns_apart_in_order(env, poses, counts):
    assert outcome(env, poses)[0][-1] == counts


def test_a_hand_that_stays_at_the_stack_is_no_success(env):
    from onedemo.planner.control.inverse_kinematics import inverse_kinematics

    above = Pose.from_position_quaternion([0.1, 0.0, 0.97], [0.0, 1.0, 0.0, 0.0])
    home = env.sim.scene.home[0]
    near, far = (
        inverse_kinematics(env.arms[0], Pose.from_position_quaternion([0, 0, up]) @ above, home) for up in (0.0, 0.1)
    )
    assert not any(outcome(env, stacked(), joint_positions=near)[0])
    assert outcome(env, stacked(), joint_positions=far)[0][-1]


def test_a_block_off_the_table_ends_the_episode(env):
    env.reset(seed=0)
    address = env.sim._object_places[1]
    env.sim.data.qpos[address : address + 3] = [0.9, 0.0, 0.5]
    *_, terminated, _, info = env.step(IDLE)
    assert (terminated, info["failure_reason"], info["success"]) == (True, "off_table", False)


@pytest.mark.parametrize(
    "options, message",
    [
        ({"levle": "L1"}, "unknown reset option 'levle'; known: level, obstacles, object_poses"),
        ({"level": "L7"}, "unknown level 'L7'; known: L0 .*, L1 .*, L2 "),
        ({"object_poses": np.zeros((2, 7))}, r"'object_poses': has shape \(2, 7\); expected \(3, 7\)"),
        ({"object_poses": "here"}, "is not an array of numbers"),
        ({"object_poses": np.full((3, 7), np.nan)}, r"not finite at index \(0, 0\)"),
        ({"object_poses": stacked() * 2}, "quaternion 0 has norm 2; expected 1"),
        ({"object_poses": stacked(offset=(0.5, 0.0))}, r"block 2 at \[0.6, 0.0, 0.925\] is not on the table"),
        ({"object_poses": np.tile(BASE, (3, 1))}, "blocks 0 and 1 are inside each other"),
        ({"base_pose": [0.6, 0, 0.825, 1, 0, 0, 0]}, "is not a place on the table"),
        ({"base_pose": [0.1, 0, 0.825, 0.8, 0.6, 0, 0]}, "is tilted"),
        ({"joint_positions": np.zeros(6)}, "joint_positions"),
        (
            {"joint_positions": [0, 0, 0, 0.5, 0, 2, 0]},
            r"robot0_joint4 at 0.500 rad is beyond its upper limit of -0.070 rad by 0.570 rad",
        ),
    ],
)
def test_bad_reset_options_are_named(env, options, message):
    with pytest.raises(OneDemoError, match=message) as caught:
        env.reset(options=options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("n_blocks", [0, 7, 2.0, True, "3"])
def test_a_bad_number_of_blocks_is_named(n_blocks):
    with pytest.raises(BadOption, match="is not a whole number from 1 to 6"):
        gym.make("onedemo/Stack-v0", n_blocks=n_blocks)


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**31), st.sampled_from(sorted(RANGES)), st.integers(2, 5), st.sampled_from(sorted(ROBOTS)))
def test_layouts_keep_their_ranges_and_distances(seed, name, count, robot):
    # a second row is too near for some, and refused
    count = count if robot == "Panda" else min(count, 3)
    level, reach = RANGES[name], ROBOTS[robot].reach
    layout = stack_layout(np.random.default_rng(seed), level, count, AXIS, (1, 7), reach=reach)
    shift = np.abs(layout.blocks[:, :2] - nominal_blocks(count))
    assert shift.max() <= level.block + 1e-12
    assert np.abs(layout.base[:2] - [0.1, 0.0]).max() <= level.base + 1e-12
    assert max(np.abs(layout.blocks[:, 2]).max(), abs(layout.base[2])) <= level.yaw + 1e-12
    assert np.abs(layout.joints).max() <= level.joints
    places = layout.blocks[:, :2]
    for k in range(count):
        assert reach.nearest <= np.linalg.norm(places[k] - AXIS) <= reach.farthest
        assert np.linalg.norm(places[k] - layout.base[:2]) >= BASE_GAP
        for j in range(k):
            assert np.linalg.norm(places[k] - places[j]) >= BLOCK_GAP
    assert np.linalg.norm(layout.base[:2] - AXIS) <= reach.stack
    assert fits(places, layout.base[:2], AXIS, reach=reach)
    assert not fits(np.repeat(places[:1], count, axis=0), layout.base[:2], AXIS)


def test_blocks_that_no_layout_puts_within_an_arms_reach_are_refused():
    with pytest.raises(
        BadOption, match=r"5 blocks do not fit on the table at this level, 0\.44 to 0\.70 m from the arm"
    ):
        gym.make("onedemo/Stack-v0", robot="IIWA", n_blocks=5).reset(seed=0, options={"level": "L0"})


def test_the_nominal_level_is_one_layout(env):
    starts = [env.reset(seed=seed, options={"level": "L0"})[0] for seed in (1, 2)]
    for key in starts[0]:
        np.testing.assert_array_equal(starts[0][key], starts[1][key])


ALLOWED = stack_rules(3).allowed


def test_wanted_contacts():
    block, placed = FIRST_OBJECT, 0
    assert wanted(ALLOWED, WORLD, block, placed)
    assert wanted(ALLOWED, FINGERS, block, placed)
    assert wanted(ALLOWED, FINGERS, block, placed + 1), "let go last"
    assert wanted(ALLOWED, block, block + 1, placed)
    for own in ((ARM, ARM), (ARM, FINGERS), (FINGERS, FINGERS), (WORLD, WORLD), (block, block)):
        assert wanted(ALLOWED, *own, placed), own
    for pair in ((FINGERS, block + 1), (ARM, block), (WORLD, ARM), (WORLD, FINGERS), (block, block + 2)):
        assert not wanted(ALLOWED, *pair, placed), pair
    assert not wanted(ALLOWED, FINGERS, block, placed + 2)


def test_every_unwanted_pair_counts_and_the_last_one_is_named(env):
    env.reset(seed=0)
    progress = env.episode.progress
    touching = np.zeros_like(env.sim.read().touching)
    for pair in ((WORLD, FIRST_OBJECT), (ARM, FINGERS), (WORLD, FINGERS), (ARM, FIRST_OBJECT + 1)):
        touching[pair] = 1.0
    verdict = progress.update(env.sim.read()._replace(touching=touching))
    assert (verdict.unwanted, verdict.low, verdict.high) == (2, ARM, FIRST_OBJECT + 1)
    assert progress.collisions == 2
    assert not progress.info()["safe"]


def test_a_lifted_block_that_stands_elsewhere_was_dropped_and_one_in_the_hand_was_not(env):
    env.reset(seed=0)
    state = env.sim.read()
    progress = GoalProgress(env.declared.rules, env.episode.goals, state.object_pose, env.control_dt)

    def failure(height, gripped, speed=0.0):
        poses, touching = state.object_pose.copy(), np.zeros_like(state.touching)
        poses[0, 2] += height
        touching[FINGERS, FIRST_OBJECT] = gripped
        moving = np.full_like(state.object_velocity, speed)
        progress.update(state._replace(object_pose=poses, object_velocity=moving, touching=touching))
        return progress.failure

    assert failure(0.0, gripped=True) == ""
    assert failure(0.0, gripped=False) == "", "it was never lifted"
    assert failure(0.021, gripped=True) == ""
    assert progress.info()["stage"] == "lifted block 1 of 3"
    assert failure(0.021, gripped=False, speed=0.5) == "", "it still falls"
    assert failure(0.0, gripped=False) == "dropped"


def test_touching_is_what_mujoco_says(env):
    env.reset(seed=0)
    for _ in range(60):
        env.step(np.array([0, 0.4, 0, -0.1, 0, 0, 0, 1.0]))
    owners, touching = env.sim.scene.owner, env.sim.read().touching
    pairs = {tuple(sorted(owners[geom] for geom in contact.geom)) for contact in env.sim.data.contact}
    assert {tuple(pair) for pair in np.argwhere(touching)} == pairs
    assert {(WORLD, FIRST_OBJECT), (WORLD, FINGERS)} <= pairs
    for pair in pairs:
        assert "-" in env.sim.contact_name(pair)


def test_reading_compiles_nothing_anew_however_few_contacts_there_are(env):
    """An array of one row is another type to the compiler than one of twelve."""
    env.reset(seed=0)
    model, data, places = env.sim.model, env.sim.data, env.sim._object_places
    turn = Rotation.from_euler("xyz", [0.6, 0.5, 0.3])
    lowest = turn.apply(0.5 * np.array(BLOCK_SIZE) * np.array(list(product((-1, 1), repeat=3))))[:, 2].min()
    counts = []
    for on_corner in (False, True):
        data.qpos[places + 2] = [2.0, 3.0, 4.0]
        if on_corner:
            data.qpos[places[0] : places[0] + 3] = [0.1, 0.0, 0.7995 - lowest]
            data.qpos[places[0] + 3 : places[0] + 7] = turn.as_quat()[[3, 0, 1, 2]]
        mujoco.mj_forward(model, data)
        counts.append(data.ncon)
        assert env.sim.read().touching[WORLD, FIRST_OBJECT] == on_corner
    assert counts == [0, 1]
    assert len(read_objects.signatures) == len(read_arms.signatures) == 1


def test_an_arm_driven_into_the_table_is_unsafe_and_named(env):
    env.reset(seed=0)
    names = set()
    for _ in range(60):
        *_, info = env.step(np.array([0, 0.4, 0, -0.1, 0, 0, 0, 0.0]))
        names.add(info["collision"])
    assert "fingers-table" in names
    assert not info["safe"]
    assert info["n_contacts"] == 0  # those count obstacles


def test_joints_move_at_the_commanded_speed_and_stand_still_without_one(env):
    env.reset(seed=0)
    action = np.array([0.1, -0.05, 0.1, 0.1, -0.1, 0.1, 0.1, 0.0])
    for _ in range(25):
        start = env.step(action)[0]["joint_positions"][0]
    for _ in range(25):
        end = env.step(action)[0]["joint_positions"][0]
    speed = (end - start) / (25 * env.control_dt)
    np.testing.assert_allclose(speed, action[:7] * env.arms[0].velocity_limits, rtol=0.02, atol=1e-4)
    for _ in range(50):
        rest = env.step(IDLE)[0]["tcp_pose"][0, :3]
    for _ in range(100):
        later = env.step(IDLE)[0]["tcp_pose"][0, :3]
    assert np.linalg.norm(later - rest) < 1e-4


@pytest.mark.parametrize("axis", range(6))
def test_a_twist_moves_the_tool_along_the_named_axis_of_the_world(axis):
    env = gym.make("onedemo/Stack-v0", control_mode="ee_twist").unwrapped
    observation, _ = env.reset(seed=0, options={"level": "L0"})
    action = np.zeros(7)
    action[axis] = 0.5
    for _ in range(15):  # the servos lag
        observation, *_ = env.step(action)
    start = Pose.from_vector(observation["tcp_pose"][0])
    for _ in range(25):
        observation, *_ = env.step(action)
    end = Pose.from_vector(observation["tcp_pose"][0])
    turn = (
        Pose.from_position_quaternion([0, 0, 0], end.quaternion)
        @ Pose.from_position_quaternion([0, 0, 0], start.quaternion).inverse()
    )
    moved = np.concatenate([end.position - start.position, 2 * turn.quaternion[1:]])
    expected = np.zeros(6)
    expected[axis] = 0.5 * (0.25 if axis < 3 else 1.2) * 0.5
    np.testing.assert_allclose(moved, expected, atol=0.1 * expected.max())


def test_the_observed_tool_is_the_forward_kinematics_of_the_observed_joints(env):
    rng = np.random.default_rng(0)
    env.reset(seed=5)
    for _ in range(50):
        observation, *_ = env.step(rng.uniform(-1, 1, 8))
        expected = env.arms[0].fk(observation["joint_positions"][0])
        distance, angle = Pose.from_vector(observation["tcp_pose"][0]).distance_to(expected)
        assert distance < 1e-9
        assert angle < 1e-7


def lifted(env, friction):
    """Height gained by block 0 after the hand closed on it and rose."""
    from onedemo.planner.control.inverse_kinematics import inverse_kinematics

    poses = stacked()
    poses[0] = [0.0, 0.0, 0.825, 1, 0, 0, 0]
    poses[1], poses[2] = poses[0] + [0.0, 0.25, 0, 0, 0, 0, 0], poses[0] - [0.0, 0.25, 0, 0, 0, 0, 0]
    home, arm = env.sim.scene.home[0], env.arms[0]
    grasp = Pose.from_position_quaternion([0, 0, 0.825], [0, np.sqrt(0.5), np.sqrt(0.5), 0])
    q = inverse_kinematics(arm, grasp, home)
    high = inverse_kinematics(arm, Pose.from_position_quaternion([0, 0, 0.1]) @ grasp, q)
    geoms = np.flatnonzero(env.sim.scene.owner >= FINGERS)
    kept = env.sim.model.geom_friction.copy()
    env.sim.model.geom_friction[geoms] = friction
    try:
        env.reset(seed=0, options={"object_poses": poses, "joint_positions": q})
        heights = []
        for target in (q, high):
            for _ in range(75):
                observed = env.step(np.append(np.zeros(7), 1.0))[0]
                error = np.clip(2.0 * (target - observed["joint_positions"][0]), -0.5, 0.5)
                observed = env.step(np.append(error / arm.velocity_limits, 1.0))[0]
            heights.append((observed["object_pose"][0, 2], observed["gripper_opening"][0]))
    finally:
        env.sim.model.geom_friction[:] = kept
    return heights


def test_blocks_are_held_by_friction_and_by_nothing_else(env):
    (_, opening), (height, _) = lifted(env, [1.0, 0.005, 0.0001])
    assert opening == pytest.approx(0.04, abs=0.002)
    assert height > 0.89
    assert lifted(env, [0.001, 0.0, 0.0])[1][0] < 0.84
