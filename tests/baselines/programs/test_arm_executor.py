"""The hand of a program: what it holds is guarded where it has slipped to, and missed when it is lost."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.baselines.programs.arm_executor import GLANCE, LOST, OFF, ArmExecutor
from onedemo.baselines.programs.world_model import WorldModel
from onedemo.baselines.screw_policy import ScrewSettings
from onedemo.planner.errors import PlanFailed
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.imitation.tsia import screw_path

GRASP = Pose.from_position_quaternion([0.0, 0.0, 0.01])
"""`tcp_from_object` when it was grasped."""


@pytest.fixture(scope="module")
def env():
    made = gym.make("onedemo/Stack-v0", level="L0").unwrapped
    yield made
    made.close()


@pytest.fixture
def hand(env):
    task = env.task
    observation, _ = env.reset(seed=0)
    hand = ArmExecutor(task.arms[0], task.bodies[0], ScrewSettings().reactive, WorldModel(task), observation)
    hand.hold(0, task.objects[0].shape, GRASP)
    hand.observation = observed(hand, GRASP)
    return hand


def observed(hand, tcp_from_object):
    """An observation in which the first object is in the hand like this."""
    poses = hand.observation["object_pose"].copy()
    poses[0] = (hand.measured_tcp @ tcp_from_object).vector
    return {**hand.observation, "object_pose": poses}


def upwards(hand, way=0.2):
    start = hand.arm.fk(hand.q)
    return screw_path(start, Pose.from_position_quaternion([0.0, 0.0, way]) @ start, 0.005)


def held_ends(hand):
    """Where the guard takes the held object to be, in the last frame."""
    body = hand._planner.body
    return body.rows[[k for k, name in enumerate(body.names) if name == "held"]]


def test_what_slips_in_the_hand_is_guarded_where_it_is_now(hand):
    before, actions = held_ends(hand), hand.follow(upwards(hand))
    next(actions)
    np.testing.assert_array_equal(held_ends(hand), before)
    slipped = Pose.from_position_quaternion([0.0, 0.0, 0.008]) @ GRASP
    hand.observation = observed(hand, slipped)
    for _ in range(GLANCE):
        next(actions)
    fresh = hand.body_with(hand._held.shape, slipped)
    expected = fresh.rows[[k for k, name in enumerate(fresh.names) if name == "held"]]
    np.testing.assert_allclose(held_ends(hand), expected, atol=1e-9)
    assert np.abs(held_ends(hand) - before).max() > 0.005


def test_what_is_lost_ends_the_motion_as_dropped(hand):
    actions = hand.follow(upwards(hand))
    next(actions)
    hand.observation = observed(hand, Pose.from_position_quaternion([0.0, 0.0, LOST + 0.005]) @ GRASP)
    with pytest.raises(PlanFailed, match="block0 is not in the hand") as failed:
        for _ in range(GLANCE):
            next(actions)
    assert failed.value.reason == "dropped"


def test_what_a_lift_has_left_behind_was_dropped(hand):
    """A little slip is how it is held now, measured from where it was grasped."""
    slipped = Pose.from_position_quaternion([0.0, 0.0, LOST - 0.005]) @ GRASP
    hand.observation = observed(hand, slipped)
    assert hand.lifted().distance_to(slipped)[0] < 1e-9
    hand.observation = observed(hand, Pose.from_position_quaternion([0.0, 0.0, LOST + 0.005]) @ GRASP)
    with pytest.raises(PlanFailed, match="block0 is not in the hand after the lift") as failed:
        hand.lifted()
    assert failed.value.reason == "dropped"


def test_an_empty_hand_misses_nothing(hand):
    hand.release()
    hand.observation = observed(hand, Pose.from_position_quaternion([0.3, 0.0, 0.0]))
    actions = hand.follow(upwards(hand))
    for _ in range(3 * GLANCE):
        next(actions)


def test_leaving_is_strict_until_it_is_off_and_reaches_the_end(hand):
    calls = []
    go = hand._planner.go

    def noted(path, **how):
        calls.append((path, how))
        go(path, **how)

    hand._planner.go = noted
    path = upwards(hand)
    for _ in hand.leave(path, OFF):
        hand.observation = observed(hand, GRASP)
    (first, strict), (rest, free) = calls
    assert not strict["detours"] and free.get("detours", True) and not strict["exact"] and not free["exact"]
    assert OFF < np.linalg.norm(first[-1].position - path[0].position) < OFF + 0.01
    np.testing.assert_array_equal(np.vstack([first.dqs, rest.dqs[1:]]), path.dqs)


@pytest.mark.parametrize("pace", [0.5, 1.0])
def test_a_slower_hand_keeps_what_it_holds_and_its_limits(hand, pace):
    before, full = held_ends(hand), hand.arm.velocity_limits.copy()
    hand.slow_down(pace)
    np.testing.assert_array_equal(held_ends(hand), before)
    np.testing.assert_allclose(hand.arm.velocity_limits, pace * full)
    action = next(hand.follow(upwards(hand)))
    assert np.abs(action[:-1]).max() <= pace + 1e-9


def aside(hand, way=0.4):
    start = hand.arm.fk(hand.q)
    return screw_path(start, Pose.from_position_quaternion([0.0, way, 0.0]) @ start, 0.005)


@pytest.mark.parametrize("blocked", [True, False])
def test_a_way_round_an_obstacle_is_kept_for_drawing(env, hand, blocked):
    hand.release()
    path, radius, seen = aside(hand), 0.04, env.reset(seed=0)[0]
    middle = path.positions[len(path) // 2]
    if blocked:
        seen["obstacle_active"][0], seen["obstacle_shape"][0], seen["obstacle_size"][0] = 1, 1, radius
        seen["obstacle_pose"][0] = [*middle, 1.0, 0.0, 0.0, 0.0]
    hand.observation = seen
    commanded = [hand.arm.fk(hand.q).position for _ in hand.follow(path)]
    assert len(hand.drawn) == blocked
    for drawn in hand.drawn:
        assert drawn.label == "escape"
        assert np.linalg.norm(drawn.poses.positions - middle, axis=1).min() > radius
        gaps = np.linalg.norm(drawn.poses.positions[:, None] - np.array(commanded)[None], axis=2).min(axis=1)
        assert gaps.max() < 0.02
        assert np.linalg.norm(drawn.poses.positions[-1] - path.positions[-1]) < 0.02
