"""The cupboard, handing over, and when shelving counts as done."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from helpers.envs import contacts
from hypothesis import given, settings
from hypothesis import strategies as st

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.envs.judge.goal_progress import GoalProgress
from onedemo.envs.scene.scene import ARM, FINGERS, FIRST_OBJECT, FURNITURE, OBSTACLE, WORLD
from onedemo.envs.shelve import parts
from onedemo.envs.shelve.layout import RANGES, shelf_layout
from onedemo.envs.shelve.parts import BOOK_SIZE, CLEAR, PITCH, SHELVES, handed
from onedemo.envs.shelve.places import SHELF_PLACES, ShelfPlaces
from onedemo.envs.shelve.rules import hand_over, shelve_rules
from onedemo.envs.shelve.shelve_env import GRASP
from onedemo.planner.control.inverse_kinematics import inverse_kinematics
from onedemo.planner.errors import BadOption, OneDemoError
from onedemo.planner.geometry.pose import Pose

IDLE = np.zeros(8)
N, CLUTTER = 3, FIRST_OBJECT + 3
PANDAS = SHELF_PLACES["Panda"]
STANDING = Pose.from_yaw(PANDAS.stand, PANDAS.stand_yaw).vector.tolist()
FRONT = Pose.from_yaw([*PANDAS.cupboard, 0.8], PANDAS.cupboard_yaw).vector.tolist()


@pytest.fixture(scope="module")
def env():
    made = gym.make("onedemo/Shelve-v0", level="L0").unwrapped
    yield made
    made.close()


def put(env, poses):
    """Books to poses, by hand; the simulator goes on from there."""
    for k, pose in poses.items():
        env.sim.put(k, np.asarray(pose, dtype=float))


def shelved(env, moved=(0.0, 0.0, 0.0), turned=0.0, axis=(0.0, 0.0, 1.0), books=(0, 1, 2)):
    """Poses of books in their slots, the last of them moved and turned in the cupboard's frame."""
    poses = {k: env.episode.goals[k].copy() for k in books}
    half = np.sin(turned / 2) * np.array(axis)
    off = Pose.from_position_quaternion(moved, [np.cos(turned / 2), *half])
    poses[books[-1]] = (Pose.from_vector(poses[books[-1]]) @ off).vector
    return poses


def outcome(env, steps=40, lowered=0.0, **changes):
    """What comes of books put into their slots, with `changes` as in `shelved`."""
    env.reset(seed=0)
    poses = shelved(env, **changes)
    for pose in poses.values():
        pose[2] -= lowered
    put(env, poses)
    flags = []
    for _ in range(steps):
        *_, terminated, _, info = env.step(IDLE)
        flags.append(info["success"])
        if terminated:
            break
    return flags, info


def test_everything_stands_still_at_the_start_and_nothing_unwanted_touches(env):
    for level in ("L0", "L2"):
        first, _ = env.reset(seed=3, options={"level": level})
        for _ in range(100):
            last, *_, info = env.step(IDLE)
        assert np.abs(last["object_pose"][:, :3] - first["object_pose"][:, :3]).max() < 2e-3
        assert info["safe"] and info["stage"] == "start"


def test_shelved_books_are_a_success_after_half_a_second_and_not_before(env):
    flags, info = outcome(env)
    assert flags[-1] and flags.index(True) == pytest.approx(24, abs=8)
    assert (info["stage"], info["books_placed"], info["safe"]) == ("shelved 3 of 3", 3, True)
    assert info["is_success"] is info["success"] is True


@pytest.mark.parametrize(
    "changes, counts",
    [
        ({"moved": (0.008, 0.0, 0.0)}, True),
        ({"moved": (-0.0115, 0.0, 0.0)}, False),
        ({"moved": (0.0, 0.0115, 0.0)}, False),
        ({"turned": np.deg2rad(4)}, True),
        ({"turned": np.deg2rad(6)}, False),
        ({"turned": np.pi}, False),
        ({"books": (0, 1)}, False),
        ({"books": (1, 2)}, False),
    ],
)
def test_success_is_all_books_within_10_mm_and_5_degrees(env, changes, counts):
    assert outcome(env, **changes)[0][-1] == counts


def test_the_wrong_shelf_does_not_count(env):
    assert not any(outcome(env, lowered=SHELVES["upper"] - SHELVES["lower"])[0])


@pytest.mark.parametrize("change, over", [((0.06, 0.0), True), ((0.03, 0.0), False), ((0.0, 16.0), True)])
def test_a_clutter_book_pushed_over_is_no_success(env, change, over):
    env.reset(seed=0)
    state = env.sim.read()
    progress = GoalProgress(env.declared.rules, env.episode.goals, state.object_pose, env.control_dt)
    poses = state.object_pose.copy()
    poses[:N] = env.episode.goals
    half = 0.5 * np.deg2rad(change[1])
    fallen = Pose.from_vector(poses[4]) @ Pose.from_position_quaternion(
        [change[0], 0, 0], [np.cos(half), np.sin(half), 0, 0]
    )
    poses[4] = fallen.vector
    for _ in range(30):
        verdict = progress.update(state._replace(object_pose=poses, touching=np.zeros_like(state.touching)))
    assert (verdict.disturbed == 1, progress.success) == (over, not over)
    assert progress.failure == ("constraint" if over else "")


def test_a_book_in_the_hand_or_moving_or_beside_the_hand_does_not_count(env):
    env.reset(seed=0)
    state = env.sim.read()
    poses = state.object_pose.copy()
    poses[:N] = env.episode.goals
    quiet = state._replace(object_pose=poses, touching=np.zeros_like(state.touching))

    def succeeds(**changes):
        progress = GoalProgress(env.declared.rules, env.episode.goals, state.object_pose, env.control_dt)
        for _ in range(30):
            progress.update(quiet._replace(**changes))
        return progress.success

    assert succeeds()
    held = np.zeros_like(state.touching)
    held[FINGERS, FIRST_OBJECT + 1] = 1.0
    assert not succeeds(touching=held)
    assert not succeeds(object_velocity=np.full_like(state.object_velocity, 0.02))
    near = state.tcp_pose.copy()
    near[0, :3] = poses[0, :3] + [0.0, -0.1, 0.0]
    assert not succeeds(tcp_pose=near)


def test_a_lifted_book_that_rests_elsewhere_was_dropped(env):
    env.reset(seed=0)
    state = env.sim.read()
    progress = GoalProgress(env.declared.rules, env.episode.goals, state.object_pose, env.control_dt)

    def failure(height, gripped):
        poses, touching = state.object_pose.copy(), np.zeros_like(state.touching)
        poses[0, 2] += height
        touching[FINGERS, FIRST_OBJECT] = gripped
        progress.update(state._replace(object_pose=poses, touching=touching))
        return progress.failure

    assert [failure(0.0, 1), failure(0.0, 0)] == ["", ""], "it was never lifted"
    assert failure(0.021, 1) == ""
    assert progress.info()["stage"] == "lifted book 1 of 3"
    assert failure(0.0, 0) == "dropped"


def test_wanted_contacts():
    def wanted(low, high, placed=1, handed=2):
        start = np.tile([0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0], (N + len(parts.CLUTTER), 1))
        progress = GoalProgress(shelve_rules(N), start[:N], start, 0.02)
        for k in range(1, handed):
            hand_over(progress, k, start[k])
        return contacts.wanted(progress.allowed, low, high, placed)

    book = FIRST_OBJECT
    for pair in ((FURNITURE, book), (FURNITURE, CLUTTER), (WORLD, book + 2), (CLUTTER, CLUTTER + 1)):
        assert wanted(*pair), pair
    assert wanted(FINGERS, book) and wanted(FINGERS, book + 1), "let go last, and held"
    assert wanted(book + 1, book + 2, 0, 1), "both in the pile"
    for own in ((ARM, ARM), (ARM, FINGERS), (FINGERS, FINGERS), (WORLD, WORLD), (book, book)):
        assert wanted(*own), own
    for pair in (
        (FINGERS, book + 2),
        (FINGERS, CLUTTER),
        (ARM, book + 1),
        (WORLD, book + 1),
        (WORLD, CLUTTER),
        (book, book + 1),
        (book + 1, book + 2),
        (book + 1, CLUTTER),
        (ARM, FURNITURE),
        (FINGERS, FURNITURE),
        (FINGERS, OBSTACLE),
        (OBSTACLE, book + 1),
    ):
        assert not wanted(*pair), pair


def test_the_next_book_is_handed_over_when_the_last_is_shelved_and_the_robot_is_away(env):
    near = env.episode.layout.layout.handed(0) @ GRASP @ Pose.from_position_quaternion([0.0, 0.0, -0.09])
    joints = inverse_kinematics(env.arms[0], near, PANDAS.ready)
    env.reset(seed=0, options={"joint_positions": joints})
    pile = env.step(IDLE)[0]["object_pose"][1]
    assert pile[2] < 0.9
    put(env, shelved(env, books=(0,)))
    # the hand still is before the stand
    for _ in range(20):
        after, *_, info = env.step(IDLE)
    assert info["books_placed"] == 1 and after["object_pose"][1, 2] < 0.9
    back = np.array([0.0, -0.8, 0.0, -0.3, 0.0, 0.0, 0.0, 0.0])
    heights = [env.step(back)[0]["object_pose"][1, 2] for _ in range(60)]
    assert heights[0] < 0.9 and heights[-1] > 1.1
    for _ in range(30):
        after, *_, info = env.step(IDLE)
    np.testing.assert_allclose(after["object_pose"][1], env.episode.layout.layout.handed(1).vector, atol=2e-3)
    assert info["safe"] and info["books_placed"] == 1
    assert after["object_pose"][2, 2] < 0.9, "one at a time"


@pytest.mark.parametrize("shelf", SHELVES)
def test_goals_are_upright_in_the_named_shelf_and_fit(shelf):
    env = gym.make("onedemo/Shelve-v0", shelf=shelf, level="L2").unwrapped
    observation, _ = env.reset(seed=4)
    cupboard = Pose.from_vector(observation["furniture_pose"][0])
    goals = [cupboard.inverse() @ Pose.from_vector(goal) for goal in observation["goal_pose"]]
    for goal in goals:
        assert goal.tilt < 1e-6 and abs(goal.yaw) < 1e-6
        assert goal.position[2] == pytest.approx(SHELVES[shelf] + 0.11)
        assert goal.position[0] > 0.5 * BOOK_SIZE[0]
    np.testing.assert_allclose(np.diff([goal.position[1] for goal in goals]), PITCH)
    assert BOOK_SIZE[2] < CLEAR


@settings(max_examples=50, deadline=None)
@given(
    st.integers(0, 2**31),
    st.sampled_from(sorted(RANGES)),
    st.integers(1, 3),
    st.sampled_from([places for places in SHELF_PLACES.values() if isinstance(places, ShelfPlaces)]),
)
def test_layouts_keep_their_ranges(seed, name, count, places):
    ranges = RANGES[name]
    layout = shelf_layout(np.random.default_rng(seed), ranges, places, count, (1, 7))
    off = layout.stand.position - places.stand
    assert np.abs(off[:2]).max() <= ranges.stand + 1e-12
    assert -ranges.lower - 1e-12 <= off[2] <= ranges.higher + 1e-12
    assert abs(layout.stand.yaw - places.stand_yaw) <= ranges.stand_yaw + 1e-12
    assert np.abs(layout.cupboard.position[:2] - places.cupboard).max() <= ranges.cupboard + 1e-12
    assert abs(layout.cupboard.yaw - places.cupboard_yaw) <= ranges.cupboard_yaw + 1e-12
    assert abs(layout.slots) <= ranges.slots
    assert np.abs(layout.joints).max() <= ranges.joints
    assert len(layout.goals("upper")) == count and len(layout.objects()) == count + 5


@pytest.mark.parametrize(
    "options, message",
    [
        ({"shelf": "upper"}, "unknown reset option 'shelf'; known: level, obstacles, stand_pose"),
        ({"stand_pose": [0.5, *STANDING[1:]]}, r"'stand_pose': \[0.5, -0.3, 1.15\] is out of reach"),
        ({"stand_pose": [*STANDING[:2], 1.4, *STANDING[3:]]}, "out of reach or not a place; x 0.15, y -0.3 by 0.12 m"),
        ({"stand_pose": [*STANDING[:3], 0.8, 0.6, 0.0, 0.0]}, "'stand_pose': is tilted"),
        ({"stand_pose": [*STANDING[:3], 1.0, 0.0, 0.0, -1.0]}, "has norm 1.41421"),
        (
            {"stand_pose": [*STANDING[:3], 0.8, 0.0, 0.0, -0.6]},
            "yaw of -74 degrees cannot be reached; allowed: 30 by 45",
        ),
        ({"cupboard_pose": [*FRONT[:2], 0.9, *FRONT[3:]]}, "'cupboard_pose': .* not a place"),
        ({"cupboard_pose": [*FRONT[:3], 1.0, 0.0, 0.0, 0.0]}, "yaw of 0 degrees cannot be reached; allowed: 75 by 20"),
        ({"slots": 0.2}, "leave -0.[0-9]+ m beside the slots of the lower shelf; 0.03 m are needed"),
        ({"slots": "left"}, "'slots': is not an array of numbers"),
        ({"books": np.zeros((2, 3))}, r"'books': has shape \(2, 3\); expected \(3, 3\)"),
        ({"books": [[0, 0, 0], [0, 0.05, 0], [0, 0, 0]]}, r"book 1 at \[0.0, 0.05, 0.0\] would not lie on the stand"),
        ({"clutter": np.full((5, 2), 0.1)}, "with the clutter on the left leave"),
        ({"clutter": np.full((5, 2), -0.1)}, "gap -0.1 m is negative"),
        ({"joint_positions": np.zeros(6)}, "joint_positions"),
        ({"obstacles": "many"}, "unknown obstacles 'many'"),
    ],
)
def test_bad_reset_options_are_named(env, options, message):
    with pytest.raises(OneDemoError, match=message) as caught:
        env.reset(options=options)
    assert "\n" not in str(caught.value)


def test_given_books_lie_where_they_are_wanted_and_stay_there(env):
    wanted = [[0.015, -0.03, 0.3], [-0.015, 0.03, -0.3], [0.0, 0.0, 0.0]]
    observation, _ = env.reset(seed=0, options={"books": wanted})
    stand, first = (Pose.from_vector(observation[key][k]) for key, k in (("furniture_pose", 1), ("object_pose", 0)))
    off = (stand.inverse() @ first).position - handed(np.zeros(3)).position
    np.testing.assert_allclose(off, [0.015, -0.03, 0.0], atol=1e-9)
    for k in range(3):
        put(env, {0: env.episode.layout.layout.handed(k).vector})
        for _ in range(50):
            after, *_ = env.step(IDLE)
        assert np.abs(after["object_pose"][0, :3] - env.episode.layout.layout.handed(k).position).max() < 2e-3


@pytest.mark.parametrize("n_books", [0, 4, 2.0, True, "3"])
def test_a_bad_number_of_books_is_named(n_books):
    with pytest.raises(BadOption, match="is not a whole number from 1 to 3"):
        gym.make("onedemo/Shelve-v0", n_books=n_books)


def test_an_unknown_shelf_is_named():
    with pytest.raises(OneDemoError, match="unknown shelf 'middle'; known: lower, upper"):
        gym.make("onedemo/Shelve-v0", shelf="middle")


def test_the_papers_obstacles_are_of_different_size_and_appear_with_the_last_two_books(env):
    env.reset(seed=0, options={"obstacles": "paper", "level": "L1"})
    first, second = env.sim.obstacles.scheduled_obstacles
    assert (first.motion, second.motion) == (3, 5)
    assert first.shape != second.shape
