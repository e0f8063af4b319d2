"""The demonstration as one episode: it succeeds in every task of one object, in the environment's own actions."""

from __future__ import annotations

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.baselines.learning.demonstration_episode import (
    Playback,
    as_shown,
    demo_episode,
    held_to_goal,
    twist_action,
)
from onedemo.baselines.learning.features import Features
from onedemo.baselines.learning.task_demonstrations import single_skill, task_episode
from onedemo.baselines.programs.task_skills import skill_of
from onedemo.configs.shipped_files import shipped_demonstration
from onedemo.envs import TASKS
from onedemo.envs.simulation.twist_control import MAX_ANGULAR, MAX_LINEAR
from onedemo.planner.errors import BadOption, UnknownName
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.imitation.demonstration_files import read_demonstration

MODES = ("ee_twist", "joint_velocity")


def shown(name):
    return read_demonstration(shipped_demonstration(name))


def replayed(env, transitions, seed=0):
    """The environment's answers to the actions of an episode."""
    observation, _ = env.reset(seed=seed, options={"level": "L0"})
    for k, action in enumerate(transitions.actions):
        for key, value in observation.items():
            np.testing.assert_array_equal(value, transitions.observations[key][k])
        observation, reward, terminated, _, info = env.step(action)
        assert (reward, terminated) == (transitions.rewards[k], transitions.terminations[k])
        for key, value in observation.items():
            np.testing.assert_array_equal(value, transitions.next_observations[key][k])
    return info


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("task", [name for name, facts in TASKS.items() if facts.playback is not None])
def test_it_succeeds_in_every_task_of_one_object(task, mode):
    env = gym.make(TASKS[task].id, control_mode=mode)
    transitions = task_episode(env, shown(TASKS[task].demonstrated_task))
    assert transitions.success and transitions.rewards[-1] == 1.0
    assert all(env.action_space.contains(action) for action in transitions.actions)
    assert replayed(env, transitions)["success"]
    features = Features.of(env.observation_space)
    assert features(transitions.observations).shape == (len(transitions.actions), features.size)


@pytest.mark.parametrize("robot", ["Sawyer", "UR5e"])
def test_another_arm_follows_it_too(robot):
    for task in ("reach", "place_one", "insert_one"):
        assert task_episode(gym.make(TASKS[task].id, robot=robot), shown(TASKS[task].demonstrated_task)).success, task
    assert task_episode(gym.make(TASKS["place_one"].id, robot=robot, onto="block"), shown("stack")).success


def test_an_episode_that_ends_with_success_says_so():
    env = gym.make(TASKS["reach"].id, reward="sparse")
    transitions = task_episode(env, shown("stack"))
    assert transitions.terminations[-1] and not transitions.terminations[:-1].any()
    assert transitions.rewards[-1] == 1.0 and not transitions.rewards[:-1].any()


def test_several_segments_are_followed_one_after_the_other():
    env = gym.make("onedemo/Pour-v0", pregrasped=True, control_mode="ee_twist", control_frequency=20)
    transitions = demo_episode(env, shown("pour"), ("lift", "carry"), playback=Playback(hold=2.0, withdraw=0.0))
    assert transitions.success


def test_the_hand_closes_round_a_block_and_goes_back():
    env = gym.make("onedemo/Stack-v0", n_blocks=2, control_mode="ee_twist", control_frequency=20)
    demonstration, seen = shown("stack"), None
    goal = as_shown(demonstration, "approach", 0)
    seen = demo_episode(env, demonstration, "approach", goal=goal, playback=Playback(withdraw=0.1, rest=0.0))
    tcp, grip = seen.next_observations["tcp_pose"][:, 0], seen.actions[:, -1]
    closing = int(np.argmax(grip > 0.0))
    assert (grip[:closing] == -1.0).all() and (grip[closing:] == 1.0).all()
    first = {key: value[0] for key, value in seen.observations.items()}
    distance, angle = goal(first).distance_to(Pose.from_vector(tcp[closing - 1]))
    assert distance < 0.003 and angle < 0.02
    axis = Pose.from_vector(tcp[-1]).rotation[:, 2]
    np.testing.assert_allclose(tcp[closing - 1, :3] - tcp[-1, :3], 0.1 * axis, atol=0.006)
    assert seen.next_observations["object_pose"][-1, 0, 2] > 0.86  # taken along


def test_a_path_may_be_joined_later():
    env, demonstration = gym.make(TASKS["place_one"].id), shown("stack")
    goal = held_to_goal(-1)
    lengths = [
        len(demo_episode(env, demonstration, "transfer", goal=goal, playback=Playback(begin=begin)).actions)
        for begin in (0.3, 0.6)
    ]
    assert lengths[0] > lengths[1]


poses = st.builds(
    lambda place, turn: Pose.from_position_quaternion(place, np.array(turn) / np.linalg.norm(turn)),
    st.tuples(*[st.floats(-1.0, 1.0)] * 3),
    st.tuples(st.floats(0.1, 1.0), *[st.floats(-1.0, 1.0)] * 3),
)


@given(poses, poses, st.floats(0.5, 10.0))
def test_a_twist_leads_from_one_pose_toward_another(tcp, target, gain):
    action = twist_action(tcp, target, gain)
    assert np.abs(action).max() <= 1.0 + 1e-12
    distance, angle = tcp.distance_to(target)
    dt = 1e-4
    turn = 0.5 * dt * MAX_ANGULAR * action[3:]
    step = Pose.from_position_quaternion([0, 0, 0], [np.sqrt(1.0 - turn @ turn), *turn])
    turned = Pose.from_position_quaternion([0, 0, 0], (step @ Pose(tcp.dq)).quaternion)
    after = Pose.from_position_quaternion(tcp.position + dt * MAX_LINEAR * action[:3], turned.quaternion)
    nearer, less = after.distance_to(target)
    expected = gain * dt
    unbound = gain * np.concatenate([(target.position - tcp.position) / MAX_LINEAR, [angle / MAX_ANGULAR]])
    if np.abs(unbound).max() <= 1.0:
        assert nearer == pytest.approx(distance * (1.0 - expected), abs=1e-7)
        assert less == pytest.approx(angle * (1.0 - expected), abs=1e-6)
    assert nearer <= distance + 1e-9 and less <= angle + 1e-6


def test_what_cannot_be_played_is_named():
    env, demonstration = gym.make(TASKS["reach"].id), shown("stack")
    with pytest.raises(UnknownName, match="unknown segment of 'stack' 'fly'; known: approach, transfer"):
        demo_episode(env, demonstration, "fly")
    with pytest.raises(BadOption, match="has 2 arms"):
        demo_episode(gym.make("onedemo/BimanualPour-v0"), demonstration, "approach")
    with pytest.raises(BadOption, match="has no tcp_pose in its observation"):
        demo_episode(gym.make(TASKS["reach"].id, goal_form=True), demonstration, "approach")
    with pytest.raises(UnknownName, match="'stack'; known: reach, place_one, tilt_pour, insert_one"):
        task_episode(gym.make("onedemo/Stack-v0"), demonstration)
    skill = skill_of(shown("nut_assembly"))
    nut = next(phase for phase in skill.phases if phase.kind == "carry")
    for phases, words in {
        (): "shows nothing that is carried",
        (nut, replace(nut, thing="other")): f"shows {nut.thing} and other",
        (nut, replace(nut, kind="articulate", thing="door")): f"shows {nut.thing} and door on its hinge",
    }.items():
        with pytest.raises(BadOption, match=f"{words}; an episode for learners can be played of one carried object"):
            single_skill(replace(skill, phases=phases))
    for key, value in {"gain": 0.0, "ahead": -1.0, "begin": 1.0, "rest": -1.0, "ending": "throw"}.items():
        with pytest.raises(BadOption, match=f"option '{key}'"):
            Playback(**{key: value})
