"""One environment for all tasks that are data: Gymnasium's contract, its judge, its levels, its goal form."""

from __future__ import annotations

import copy
import math
import pickle
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.envs import At, Fixture, Movable, Range, Success, Task, Tolerance, register_task
from onedemo.envs.judge.judge import angle_between, offsets
from onedemo.envs.scene.body_clearance import point_clearance
from onedemo.envs.scene.scene import ARM, FINGERS, FIRST_OBJECT, FURNITURE, OBSTACLE, WORLD
from onedemo.envs.tasks.rules import is_unwanted
from onedemo.planner import Box, Cylinder, Obstacle, Pose
from onedemo.planner.geometry.hulls import corner_points
from onedemo.planner.geometry.shapes import pack


def fell(scene) -> bool:
    """The cup lies on its side."""
    return scene.pose("cup").rotation[2, 2] < 0.5


def on_pad(scene) -> bool:
    """The cup touches the pad, and has done so before."""
    scene.memory["seen"] = scene.memory.get("seen", 0) + scene.touching("cup", "pad")
    return scene.memory["seen"] > 0 and scene.touching("cup", "pad") and not scene.held("cup")


def times_seen(scene) -> int:
    """How often the cup has touched the pad."""
    return scene.memory.get("seen", 0)


CUP_ON_PAD = Task(
    name="cup_on_pad",
    summary="Put a cup on a pad, beside a cube that is to be put on a place on the table.",
    objects=(Movable("cup", Cylinder(0.02, 0.06)), Movable("cube", Box((0.04, 0.04, 0.04)))),
    fixtures=(Fixture("pad", Box((0.08, 0.08, 0.01))),),
    start={
        "cup": Range((0.0, -0.15), shift=(0.03, 0.06)),
        "cube": Range((-0.10, 0.0), shift=(0.03, (0.02, 0.06)), turn=(0.2, 0.5)),
        "pad": Range((0.0, 0.14), shift=(0.03, 0.06), turn=(0.2, 0.5)),
    },
    goals={"cup": At("pad"), "cube": Range((0.10, 0.0), shift=(0.01, 0.02), turn=(0.2, 0.5))},
    success=Success(
        {"cup": Tolerance(xy=0.02)},
        also=on_pad,
        failed=(("tipped", fell),),
        numbers={"seen": times_seen},
    ),
)
NAME = register_task(CUP_ON_PAD)


@pytest.fixture(scope="module")
def env():
    made = gym.make(NAME)
    yield made
    made.close()


def test_it_keeps_the_contract_of_gymnasium(env):
    assert NAME == "onedemo/CupOnPad-v0" and env.spec.max_episode_steps == 3000
    check_env(env.unwrapped, skip_render_check=True)
    assert env.observation_space["object_pose"].shape == (2, 7) and env.observation_space["furniture_pose"].shape == (
        1,
        7,
    )


def test_episodes_are_bitwise_the_same_in_copies_and_pickles(env):
    env.reset(seed=3, options={"level": "L2"})
    rng = np.random.default_rng(0)
    actions = rng.uniform(-0.2, 0.2, (20, 8))
    for action in actions[:10]:
        env.step(action)
    twins = [env, copy.deepcopy(env), copy.copy(env), pickle.loads(pickle.dumps(env))]
    ends = [[twin.step(action) for action in actions[10:]][-1] for twin in twins]
    for other in ends[1:]:
        for key, value in ends[0][0].items():
            assert (value == other[0][key]).all(), key
        assert ends[0][4]["seen"] == other[4]["seen"]


@pytest.mark.parametrize("level, far", [("L0", 0.0), ("L1", 0.03), ("L2", 0.06)])
def test_things_are_moved_as_far_as_their_ranges_say(env, level, far):
    places = []
    for seed in range(12):
        observation, info = env.reset(seed=seed, options={"level": level})
        places.append(observation["object_pose"][0, :2] - [0.0, -0.15])
        assert info["placed"] == 0 and info["stage"] == "start"
        pad = Pose.from_vector(observation["furniture_pose"][0])
        goal = Pose.from_vector(observation["goal_pose"][0])
        assert np.allclose((pad.inverse() @ goal).position, [0.0, 0.0, 0.035])
    moved = np.abs(places)
    assert moved.max() <= far and moved.max() >= 0.5 * far


@pytest.mark.parametrize("level", ["L3", "F"])
def test_obstacles_leave_room(env, level):
    _, info = env.reset(seed=1, options={"level": level})
    assert math.isfinite(info["min_obstacle_distance"]) and info["min_obstacle_distance"] > 0.02


@pytest.mark.parametrize("level", ["L3", "L4"])
def test_obstacles_leave_room_where_an_object_must_pass(level):
    """As a sponge does along a board: whatever the hand does there, the place and what is above it are clear."""
    end, other = At("pad", (0, 0.10, 0.035)), At("pad", (0, -0.06, 0.035))
    declared = replace(CUP_ON_PAD, name="cup_along", goals={"cup": end}, passes={"cup": (other,)}, success=Success())
    env, found = gym.make(register_task(declared)).unwrapped, 0
    for seed in range(12):
        observation, _ = env.reset(seed=seed, options={"level": level})
        pad = Pose.from_vector(observation["furniture_pose"][0])
        places = pack([each for when in np.linspace(0, 6, 25) for each in obstacles_at(env, when)])
        for there in (end, other):
            corners = corner_points(Cylinder(0.02, 0.06)) + (pad @ Pose.from_position_quaternion(there.at)).position
            assert min(point_clearance(corner, places) for corner in corners) > 0.015
        found += len(places.rows)
    assert found > 100


def obstacles_at(env, time: float) -> list[Obstacle]:
    """The obstacles of the episode at a time since its start, or since they appeared."""
    return [Obstacle(each.shape, each.pose(time)) for each in env.sim.obstacles.scheduled_obstacles]


def put(env, cup, cube) -> dict:
    """Info after half a second with the things at these poses, the hand at rest."""
    env.reset(seed=0, options={"level": "L0", "object_poses": [cup, cube]})
    for _ in range(40):
        _, reward, terminated, _, info = env.step(np.zeros(8))
        if terminated:
            break
    return {**info, "terminated": terminated, "reward": reward}


UPRIGHT = [1.0, 0.0, 0.0, 0.0]
ON_PAD, ON_PLACE = [0.0, 0.14, 0.8401, *UPRIGHT], [0.10, 0.0, 0.8201, *UPRIGHT]


def test_success_is_what_the_data_say(env):
    done = put(env, ON_PAD, ON_PLACE)
    assert done["success"] and done["terminated"] and done["reward"] == 1.0 and done["placed"] == 2
    beside = put(env, [0.022, 0.14, 0.8401, *UPRIGHT], ON_PLACE)
    assert (
        not beside["success"]
        and beside["placed"] == 1
        and beside["position_error"][0] == pytest.approx(0.022, abs=1e-3)
    )
    turned = [math.cos(math.pi / 8), 0.0, 0.0, math.sin(math.pi / 8)]
    assert not put(env, ON_PAD, [*ON_PLACE[:3], *turned])["success"]  # a cube turned by 45 degrees
    quarter = [math.cos(math.pi / 4), 0.0, 0.0, math.sin(math.pi / 4)]
    assert put(env, [*ON_PAD[:3], *turned], [*ON_PLACE[:3], *quarter])[
        "success"
    ]  # a cup is round, a cube looks the same


def test_goals_in_order_and_objects_that_must_stay():
    success = replace(CUP_ON_PAD.success, also=None, in_order=True)
    env = gym.make(register_task(replace(CUP_ON_PAD, name="cup_then_cube", success=success)))
    assert put(env, ON_PAD, ON_PLACE)["success"]
    assert put(env, [0.0, -0.15, 0.83, *UPRIGHT], ON_PLACE)["placed"] == 0  # the cube alone, whose turn is later
    goals, success = {"cup": At("pad")}, replace(success, undisturbed={"cube": (0.02, 0.2)})
    env = gym.make(register_task(replace(CUP_ON_PAD, name="cup_beside_cube", goals=goals, success=success)))
    assert put(env, ON_PAD, ON_PLACE)["success"]
    env.reset(seed=0)
    progress, state = env.unwrapped.episode.progress, env.unwrapped.sim.read()
    for shift, failure in ((0.019, ""), (0.021, "constraint")):
        poses = state.object_pose + np.array([[0.0] * 7, [shift, *[0.0] * 6]])
        progress.view.see(state, env.unwrapped.sim, 0.0)
        progress.update(state._replace(object_pose=poses))
        assert (progress.failure, progress.failed) == (failure, bool(failure))


def test_a_condition_of_failure_ends_the_episode(env):
    lying = [math.cos(math.pi / 4), math.sin(math.pi / 4), 0.0, 0.0]
    info = put(env, [0.0, -0.15, 0.82, *lying], ON_PLACE)
    assert info["terminated"] and info["failure_reason"] == "tipped" and not info["success"]
    info = put(env, [0.0, -0.6, 0.7, *UPRIGHT], ON_PLACE)
    assert info["terminated"] and info["failure_reason"] == "off_table"


def test_the_goal_form_agrees_with_the_judge():
    env = gym.make(NAME, goal_form=True, control_frequency=20)
    observation, _ = env.reset(seed=0, options={"level": "L0", "object_poses": [ON_PAD, ON_PLACE]})
    reached = env.unwrapped.compute_reward(observation["achieved_goal"], observation["desired_goal"], {})
    assert reached == 1.0 and observation["desired_goal"].shape == (16,)
    away = observation["achieved_goal"].copy()
    away[0] += 0.05
    both = np.stack([observation["achieved_goal"], away])
    assert env.unwrapped.compute_reward(both, np.stack([observation["desired_goal"]] * 2), {}).tolist() == [1.0, 0.0]
    dense = gym.make(NAME, goal_form=True, reward="dense").unwrapped
    assert 0.0 < dense.compute_reward(away, observation["desired_goal"], {}) < 1.0


@pytest.mark.parametrize("options", [{"robot": "UR5e"}, {"control_mode": "ee_twist", "reward": "dense"}])
def test_robots_and_control_modes_come_for_free(options):
    env = gym.make(NAME, **options)
    env.reset(seed=0)
    _, reward, *_ = env.step(np.zeros(env.action_space.shape))
    assert 0.0 <= reward <= 1.0


def test_the_angle_of_a_pose_ignores_turns_that_look_alike():
    rng = np.random.default_rng(0)
    for _ in range(50):
        goal = np.append(rng.normal(size=3), (q := rng.normal(size=4)) / np.linalg.norm(q))
        tilt, yaw = rng.uniform(0.0, 1.0), rng.uniform(-3.0, 3.0)
        tilted = Pose.from_position_quaternion([0, 0, 0], [math.cos(tilt / 2), math.sin(tilt / 2), 0.0, 0.0])
        pose = (Pose.from_vector(goal) @ tilted @ Pose.from_yaw([0, 0, 0], yaw)).vector
        assert angle_between(pose, goal, 0.0) == pytest.approx(tilt, abs=1e-6)
        turned = (Pose.from_vector(goal) @ Pose.from_yaw([0, 0, 0], math.pi + 0.1)).vector
        assert angle_between(turned, goal, math.pi) == pytest.approx(0.1, abs=1e-6)
        assert angle_between(turned, goal, 2 * math.pi) == pytest.approx(math.pi - 0.1, abs=1e-6)
        moved = (Pose.from_vector(goal) @ Pose.from_position_quaternion([0.03, 0.04, -0.02])).vector
        assert offsets(moved, goal) == pytest.approx((0.05, 0.02))


def test_links_and_obstacles_must_not_touch_anything():
    wanted = [
        (WORLD, FIRST_OBJECT),
        (FINGERS, FIRST_OBJECT),
        (FINGERS, FURNITURE),
        (FURNITURE, FIRST_OBJECT),
        (ARM, ARM),
    ]
    unwanted = [(ARM, FIRST_OBJECT), (ARM, FURNITURE), (WORLD, ARM), (OBSTACLE, FIRST_OBJECT), (FINGERS, OBSTACLE)]
    assert not any(is_unwanted(*pair) for pair in [*wanted, (ARM, FINGERS)])
    assert all(is_unwanted(*pair) for pair in unwanted)
