"""Held steps of program policies: what the arm does while the next action is being computed."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from helpers.policies import installed

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.baselines import make_policy
from onedemo.baselines.factory import settings_of
from onedemo.configs import BadConfig, load_demonstration
from onedemo.planner import Obstacle, Sphere
from onedemo.planner.geometry.pose import Pose

ROBOTS = {"stack": "Panda", "bimanual_pour": "Baxter"}
NAMES = {"stack": "Stack", "bimanual_pour": "BimanualPour"}


def begun(task="stack", method="screw", ticks=40, **options):
    """A policy some ticks after its beginning: policy, state and the observation that it has just answered."""
    env = gym.make(f"onedemo/{NAMES[task]}-v0", robot=ROBOTS[task], level="L1")
    shown = load_demonstration("stack" if task == "stack" else "pour")
    policy, state = make_policy(method, env.unwrapped.task, shown, **options), None
    observation, _ = env.reset(seed=0)
    for _ in range(ticks):
        action, state = policy.predict(observation, state)
        observation = env.step(action)[0]
    _, state = policy.predict(observation, state)
    env.close()
    return policy, state, observation


@pytest.mark.parametrize("task", NAMES)
def test_a_guarded_hold_stands_still_and_the_motion_goes_on_as_if_nothing_had_been(task):
    # two hands settle and think for 41 ticks
    (one, memory, seen), (other, undisturbed, _) = (begun(task, ticks=60) for _ in range(2))
    for _ in range(3):
        action = one.hold(seen, memory)
        rows = action.reshape(len(one.task.arms), -1)
        np.testing.assert_allclose(rows[:, :-1], 0.0, atol=1e-12)
    moved, _ = one.predict(seen, memory)
    expected, _ = other.predict(seen, undisturbed)
    np.testing.assert_array_equal(moved, expected)
    assert np.abs(moved.reshape(rows.shape)[:, :-1]).max() > 0.01


def test_the_gripper_is_held_as_it_was_commanded():
    policy, memory, seen = begun()
    answered = memory[0].executor._gripper
    assert policy.hold(seen, memory)[-1] == answered


def test_a_guarded_hold_retreats_from_what_comes_close_from_where_the_arm_is_commanded_to_be():
    policy, memory, seen = begun(ticks=60)
    executor = memory[0].executor
    layer, here = executor._planner, executor.before.copy()
    assert not np.array_equal(here, executor.q), "the last action is not taken yet"
    tool = executor.arm.fk(here).position
    beside = Pose.from_position_quaternion([tool[0], tool[1] + 0.13, tool[2]])
    ball = Obstacle(Sphere(0.05), beside, np.array([0.0, -0.3, 0.0]))
    executor.world_model.obstacles = lambda observation: (ball,)
    motion, ahead = layer.motion, executor.q - here
    action = policy.hold(seen, memory)
    assert np.abs(action[:-1]).max() > 0.0, "it would be reached by the ball"
    assert layer.motion is motion
    np.testing.assert_allclose(executor.q - executor.before, ahead, atol=1e-15)
    step = executor.settings.dt * action[:-1] * executor.arm.velocity_limits
    np.testing.assert_allclose(executor.before, here + step, atol=1e-12)
    closer = executor.arm.fk(executor.before).position[1] - tool[1]
    assert closer < 0.0, "away from the ball"


def test_a_hold_without_the_guard_is_a_plain_one():
    policy, memory, seen = begun(method="screw-no-guard")
    assert not policy.hold(seen, memory)[:-1].any()


@pytest.mark.parametrize("name", installed("decoupled", "replay", "dmp-goal", "dmp-world", "potential", "rrt"))
def test_opponents_hold_plainly_unless_they_are_told_otherwise(name):
    assert settings_of(name).hold == "plain"
    assert settings_of(name, {"hold": "guarded"}).hold == "guarded"


@pytest.mark.parametrize("name", ["screw", "screw-trees-only", "screw-guard-only", "screw-ee-only", "tsia"])
def test_the_method_and_its_ablations_hold_guarded_unless_they_are_told_otherwise(name):
    assert settings_of(name).hold == "guarded"
    assert settings_of(name, {"hold": "plain"}).hold == "plain"


@pytest.mark.parametrize("method, hold", [("screw", "plain"), ("replay", None)])
def test_a_plain_hold_leaves_the_action_to_the_runner(method, hold):
    policy, memory, seen = begun(method=method, ticks=2, settings={"hold": hold} if hold else None)
    before = memory[0].executor.q.copy()
    assert policy.hold(seen, memory) is None
    np.testing.assert_array_equal(memory[0].executor.q, before)


def test_another_frame_of_the_hand_holds_guarded_too():
    policy, memory, seen = begun(tool=Pose.from_yaw([0.1, 0.0, 0.0], 1.0))
    np.testing.assert_allclose(policy.hold(seen, memory)[:-1], 0.0, atol=1e-12)


def test_a_misspelt_hold_is_refused_in_one_line():
    with pytest.raises(BadConfig, match=r"settings of 'screw': hold: .*'guarded', 'plain'|guarded, plain"):
        settings_of("screw", {"hold": "guardd"})
