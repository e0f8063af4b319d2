"""Pouring: its rules on made-up states, its beads and glasses in the physics, its starts and options."""

from __future__ import annotations

from itertools import pairwise

import gymnasium as gym
import mujoco
import numpy as np
import pytest
from helpers.envs import contacts

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.envs.pour.facts import SOURCE, TARGET
from onedemo.envs.pour.geometry import BEADS, GLASSES, TILTED, grasp, pouring, tcp_from_glass
from onedemo.envs.pour.layout import FARTHEST, GAP, NEAREST, RANGES, pour_layout
from onedemo.envs.pour.places import POUR_PLACES, PourPlaces
from onedemo.envs.pour.rules import PourProgress, beads_inside, pour_contacts
from onedemo.envs.scene.beads import poured_into, settled_beads, settling
from onedemo.envs.scene.scene import (
    ARM,
    BEAD,
    FINGERS,
    FIRST_OBJECT,
    FURNITURE,
    OBSTACLE,
    OTHER_ARM,
    OTHER_FINGERS,
    WORLD,
)
from onedemo.envs.simulation.state import State
from onedemo.planner.errors import OneDemoError
from onedemo.planner.geometry.pose import Pose

IDLE = np.zeros(8)
AXIS = np.array([-0.56, 0.0])
START = np.array([[-0.08, -0.18, 1.0, 1, 0, 0, 0], [0.0, 0.1, 1.0, 1, 0, 0, 0]], dtype=float)
SIZES = np.array([[glass.radius, glass.height] for glass in GLASSES])
OWNERS = FIRST_OBJECT + 2


@pytest.fixture(scope="module")
def env():
    made = gym.make("onedemo/Pour-v0").unwrapped
    yield made
    made.close()


def state(target=0, source=0, lying=0, poses=START, held=False, speed=0.0):
    """A made-up state: beads by where they are, the rest of the thirty above the stands."""
    beads = np.tile([0.2, 0.3, 1.0], (30, 1))
    beads[:target] = poses[TARGET, :3]
    beads[target : target + source] = poses[SOURCE, :3]
    beads[target + source : target + source + lying, 2] = 0.81
    touching = np.zeros((OWNERS, OWNERS))
    touching[FINGERS, FIRST_OBJECT + SOURCE] = held
    velocity = np.array([[0.0, 0.0, 0.0], [speed, 0.0, 0.0]])
    return State(np.zeros((1, 7)), np.zeros((1, 7)), poses[:1], np.zeros(1), poses, velocity, touching, beads)


def progress():
    return PourProgress(START, SIZES, 30, 0.02)


def moved(position=(0.0, 0.0, 0.0), tilt=0.0, glass=SOURCE):
    poses = START.copy()
    poses[glass] = (Pose.from_position_quaternion(position) @ Pose.from_vector(START[glass])).vector
    poses[glass, 3:] = [np.cos(0.5 * tilt), np.sin(0.5 * tilt), 0.0, 0.0]
    return poses


@pytest.mark.parametrize(
    "seen, counts",
    [
        (state(27, 3), True),
        (state(26, 4), False),
        (state(29, 0), True),
        (state(28, 0), False),
        (state(30, 0, poses=moved(tilt=np.deg2rad(9.0), glass=TARGET)), True),
        (state(30, 0, poses=moved(tilt=np.deg2rad(11.0), glass=TARGET)), False),
        (state(30, 0, speed=0.02), False),
    ],
)
def test_success_is_nine_tenths_in_a_standing_target_and_one_in_twenty_outside(seen, counts):
    rules = progress()
    for _ in range(25):
        assert not rules.success
        rules.update(seen)
    assert rules.success == counts
    assert rules.info()["is_success"] is rules.info()["success"] is counts


def test_success_must_last_for_half_a_second_without_a_break():
    rules = progress()
    for seen in [*[state(30)] * 24, state(26, 4), *[state(30)] * 24]:
        rules.update(seen)
    assert not rules.success
    rules.update(state(30))
    assert rules.success


def test_beads_are_counted_in_tilted_glasses_and_nowhere_else():
    rng = np.random.default_rng(0)
    pose = Pose.from_position_quaternion([0.1, 0.2, 1.0], np.array([1.0, 0.5, -0.3, 0.2]) / np.sqrt(1.38))
    local = rng.uniform(-0.08, 0.08, (400, 3))
    inside = (np.hypot(local[:, 0], local[:, 1]) <= 0.03) & (np.abs(local[:, 2]) <= 0.05)
    assert 5 < inside.sum() < 200
    assert beads_inside(pose.vector, 0.03, 0.1, pose.position + local @ pose.rotation.T) == inside.sum()


def test_tilt_and_lost_beads_are_those_of_the_carry_alone():
    rules = progress()
    for poses, source in (
        (moved(tilt=0.3), 30),  # not lifted yet
        (moved((0.0, 0.05, 0.1), tilt=0.2), 28),
        (moved((0.05, 0.17, 0.15), tilt=0.1), 29),  # at the target
        (moved((0.05, 0.17, 0.15), tilt=1.9), 10),
    ):
        rules.update(state(0, source, poses=poses, held=True))
    info = rules.info()
    assert info["carry_tilt"] == pytest.approx(0.2, abs=1e-9)
    assert info["beads_lost"] == 2
    assert (info["stage"], rules.motion_index) == ("at the target", 1.0)


@pytest.mark.parametrize(
    "seen, reason, over",
    [
        (state(0, 29, 1), "", False),
        (state(0, 28, 2), "constraint", True),
        (state(0, 30, poses=moved((0.0, 0.0, -0.3))), "off_table", True),
        (state(0, 30, poses=moved((0.0, 0.0, -0.3), glass=TARGET)), "off_table", True),
    ],
)
def test_what_cannot_be_mended_ends_the_episode_and_is_named(seen, reason, over):
    rules = progress()
    rules.update(seen)
    assert (rules.failure, rules.failed) == (reason, over)


def test_a_source_that_was_lifted_and_has_toppled_was_dropped():
    rules = progress()
    rules.update(state(0, 30, poses=moved((0.0, 0.0, 0.1)), held=True))
    assert rules.failure == ""
    rules.update(state(0, 30, poses=moved((0.0, 0.1, 0.0), tilt=1.5)))
    assert rules.failure == "dropped"


def test_wanted_contacts_are_listed_and_all_others_are_not():
    source, target = FIRST_OBJECT + SOURCE, FIRST_OBJECT + TARGET
    allowed = pour_contacts()
    allowed[FURNITURE, source] = 1.0
    wanted = {(ARM, FINGERS), (FINGERS, source), (FURNITURE, source), (FURNITURE, target)}
    wanted |= {(OTHER_ARM, OTHER_FINGERS), (OTHER_FINGERS, target)}
    for low in range(OWNERS):
        for high in range(low, OWNERS):
            expected = low == high or BEAD in (low, high) or (low, high) in wanted
            assert contacts.wanted(allowed, low, high) == expected, (low, high)
    assert not contacts.wanted(pour_contacts(), FURNITURE, source)
    assert not contacts.wanted(allowed, WORLD, source) and not contacts.wanted(allowed, OBSTACLE, source)
    touching = np.zeros((OWNERS, OWNERS))
    touching[FURNITURE, source] = 1.0
    for shift, unwanted in ((0.0, 0), (0.05, 0), (0.07, 1)):
        assert (
            progress().update(state(0, 30, poses=moved((shift, 0.0, 0.0)))._replace(touching=touching)).unwanted
            == unwanted
        )


def test_the_dense_reward_grows_with_what_is_done():
    rules, values = progress(), []
    steps = [state(0, 30), state(0, 30, held=True), state(0, 30, poses=moved((0.05, 0.17, 0.15)), held=True)]
    for seen in [*steps, state(15, 15), *[state(30)] * 25]:
        rules.update(seen)
        values.append(rules.reward(seen))
    assert all(0.0 <= a <= b <= 1.0 for a, b in pairwise(values)) and values[-1] == 1.0


def test_the_shipped_beads_are_what_the_physics_settles_to():
    lying = settled_beads(GLASSES[SOURCE], BEADS).copy()
    lying[:, 2] -= GLASSES[SOURCE].wall - 0.5 * GLASSES[SOURCE].height
    np.testing.assert_allclose(lying, settling(GLASSES[SOURCE], BEADS), atol=2e-4)
    apart = np.linalg.norm(lying[:, None] - lying[None], axis=-1)[np.triu_indices(30, 1)]
    assert apart.min() > 1.9 * BEADS.radius


def test_beads_stay_at_rest_and_the_glasses_stand(env):
    observation, _ = env.reset(seed=0, options={"level": "L2"})
    before, beads = observation["object_pose"], env.sim.read().bead_position
    for _ in range(100):
        observation, *_, info = env.step(IDLE)
        np.testing.assert_array_equal(observation["bead_fraction"], [1.0, 0.0, 0.0])
    assert np.abs(observation["object_pose"] - before).max() < 1e-3
    assert np.abs(env.sim.read().bead_position - beads).max() < 2e-3
    assert info["safe"] and not info["success"]


@pytest.mark.parametrize("speed", [1.0, 2.0, 3.0])
def test_beads_that_fall_into_a_glass_do_not_come_through_it(env, speed):
    observation, _ = env.reset(seed=0, options={"level": "L0"})
    data, index = env.sim.data, env.sim.scene.beads
    above = poured_into(observation["object_pose"][TARGET], GLASSES[SOURCE], BEADS) + np.array([0.0, 0.0, 0.05])
    data.qpos[index] = above
    data.qvel[env.sim.model.jnt_dofadr[np.isin(env.sim.model.jnt_qposadr, index[:, 2])]] = -speed
    mujoco.mj_step(env.sim.model, data, 1000)
    *_, info = env.step(IDLE)
    # a fast one may jump out again over the rim, but none may be below it
    beads = env.sim.read().bead_position - observation["object_pose"][TARGET, :3]
    through = (np.hypot(beads[:, 0], beads[:, 1]) < 0.04) & (beads[:, 2] < -0.05)
    assert not through.any()
    assert info["fraction_in_target"] >= 0.9


def test_a_source_in_the_hand_from_the_start_stays_there():
    env = gym.make("onedemo/Pour-v0", pregrasped=True).unwrapped
    for seed in range(4):
        observation, info = env.reset(seed=seed, options={"level": "L2"})
        assert observation["motion_index"] == 1.0 and info["safe"]
        held = Pose.from_vector(observation["tcp_pose"][0]).inverse() @ Pose.from_vector(observation["object_pose"][0])
        assert held.distance_to(tcp_from_glass(GLASSES[SOURCE]))[0] < 1e-3
        for _ in range(25):
            observation, *_, info = env.step(np.append(np.zeros(7), 1.0))
        assert observation["motion_index"] == 1.0 and info["safe"]
        for _ in range(50):
            observation, *_, info = env.step(np.array([0.0, -0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]))
        assert info["stage"] in ("lifted the source", "at the target")
    env.close()


def test_the_forward_pour_has_its_lip_at_the_pour_point():
    glass, rim = GLASSES[SOURCE], np.array([0.1, 0.2, 1.1])
    for tilt in (0.0, 1.0, TILTED):
        hand = pouring(glass, rim, 0.7, tilt)
        cup = hand @ tcp_from_glass(glass)
        assert cup.tilt == pytest.approx(tilt, abs=1e-9)
        lip = hand @ Pose.from_position_quaternion([0.0, 0.045, 0.032])
        np.testing.assert_allclose(
            lip.position, rim + np.array([-0.028 * np.cos(0.7), -0.028 * np.sin(0.7), 0.02]), atol=1e-9
        )
    center = np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose((grasp(glass, center, 1.3) @ tcp_from_glass(glass)).position, center, atol=1e-12)


@pytest.mark.parametrize("name", sorted(RANGES))
@pytest.mark.parametrize("robot", [robot for robot, places in POUR_PLACES.items() if isinstance(places, PourPlaces)])
def test_layouts_keep_their_ranges_and_distances(name, robot):
    places = POUR_PLACES[robot]
    ranges, nominal, rng = RANGES[name], np.array(places.stands), np.random.default_rng(0)
    for _ in range(200):
        tops = pour_layout(rng, ranges, nominal, AXIS, GAP)
        shift = np.abs(tops - nominal)
        assert (shift[:, :2].max(axis=1) <= [ranges.source + 1e-12, ranges.target + 1e-12]).all()
        assert ((tops - nominal)[:, 2] >= ranges.height[0]).all() and ((tops - nominal)[:, 2] <= ranges.height[1]).all()
        reach = np.linalg.norm(tops[:, :2] - AXIS, axis=1)
        assert (reach >= NEAREST).all() and (reach <= FARTHEST).all()
        assert np.linalg.norm(tops[0, :2] - tops[1, :2]) >= GAP


GOOD = [[-0.1, -0.2, 0.95], [0.0, 0.1, 1.0]]


def test_given_stands_are_where_the_glasses_are(env):
    observation, _ = env.reset(seed=0, options={"stands": GOOD})
    np.testing.assert_allclose(observation["furniture_pose"][:, :3], GOOD)
    np.testing.assert_allclose(observation["object_pose"][:, :3], np.add(GOOD, [0.0, 0.0, 0.05]))
    np.testing.assert_allclose(observation["goal_pose"][0, :3], np.add(GOOD[1], [0.0, 0.0, 0.1]))


@pytest.mark.parametrize(
    "options, message",
    [
        ({"stand": GOOD}, "unknown reset option 'stand'; known: level, obstacles, stands, joint_positions"),
        ({"stands": GOOD[:1]}, r"'stands': has shape \(1, 3\); expected \(2, 3\)"),
        ({"stands": [[0.5, 0.0, 0.95], GOOD[1]]}, r"that of the source at \[0.5, 0.0, 0.95\] is not on the table"),
        ({"stands": [GOOD[0], [0.0, 0.1, 1.5]]}, r"that of the target at \[0.0, 0.1, 1.5\] is not 0.9 to 1.2 m high"),
        ({"stands": [[-0.34, 0.0, 0.95], GOOD[1]]}, "is 0.22 m from the arm's base axis; 0.35 to 0.72 m is in reach"),
        ({"stands": [[0.0, 0.04, 0.95], GOOD[1]]}, "they are 0.06 m apart, inside each other"),
        ({"joint_positions": [0.0] * 6}, "joint_positions"),
        ({"obstacles": "paper"}, "the paper shows no obstacle in pour"),
    ],
)
def test_bad_reset_options_are_named(env, options, message):
    with pytest.raises(OneDemoError, match=message) as caught:
        env.reset(seed=0, options=options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "options, message",
    [
        ({"pregrasped": 1}, "'pregrasped': 1 is neither True nor False"),
        ({"stands": [[0, 0, 0]] * 2}, "'stands': that of the source"),
        ({"ready": [0.0] * 3}, "joint_positions"),
    ],
)
def test_bad_arguments_are_named(options, message):
    with pytest.raises(OneDemoError, match=message):
        gym.make("onedemo/Pour-v0", **options)


@pytest.mark.parametrize("level", ["L3", "L4", "F"])
def test_levels_put_seeded_obstacles_that_leave_room_at_the_start(env, level):
    for seed in range(3):
        first, info = env.reset(seed=seed, options={"level": level})
        assert 1 <= len(env.sim.obstacles.scheduled_obstacles) <= 3
        if env.sim.obstacles.active.any():
            assert info["min_obstacle_distance"] >= 0.05 - 1e-6
        again, _ = env.reset(seed=seed, options={"level": level})
        for key, value in first.items():
            np.testing.assert_array_equal(value, again[key])
