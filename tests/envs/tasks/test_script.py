"""Scripts and conditions of users' own tasks: what they do wrong is one line."""

from __future__ import annotations

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

from onedemo.baselines import ScriptedMotion, Waypoint
from onedemo.baselines.recording.recorders import recorder_of
from onedemo.envs import Range, Success, register_task
from onedemo.envs.errors import BadTask
from onedemo.planner import Pose
from onedemo.planner.errors import OneDemoError

from .test_task import task

DOWN, UP = [0.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]


def reach(quaternion=DOWN, reference="cube", held=""):
    above = Pose.from_position_quaternion([0.0, -0.15, 0.95], quaternion)
    return ScriptedMotion("approach", (Waypoint(above),), reference, held)


def raising(observation):
    yield reach()
    raise ValueError("no such\nplace")


@pytest.mark.parametrize(
    "script, words",
    [
        (lambda seen: [reach(held="tin")], "script: held of 'approach': 'tin' is not there; there are cube, pad"),
        (lambda seen: [reach(reference="tin")], "script: reference of 'approach': 'tin' is not there; there are cube"),
        (lambda seen: [seen["cube_pose"]], "script: KeyError: 'cube_pose'; the observation has joint_positions, "),
        (lambda seen: [("approach",)], "script: yields tuple; expected ScriptedMotion(name, waypoints, …)"),
        (raising, "script: ValueError: no such place"),
        (lambda seen: [reach(UP)], "waypoint 0 of 'approach': the script leaves the reach of the Panda"),
        (lambda seen: [reach(UP)], "there the tool points up: quaternions are wxyz, 0 1 0 0 points down"),
        (lambda seen: [reach()], "no success: start, unfinished; at the end the hand is open, objects are "),
    ],
)
def test_what_is_wrong_with_a_script_is_one_line(script, words, monkeypatch):
    shown = task(name="cube_scripted", script=script)
    monkeypatch.setattr("onedemo.baselines.recording.recorders.task_at", lambda path: shown)
    env = gym.make(register_task(shown))
    try:
        with pytest.raises(OneDemoError) as refused:
            recorder_of("my_tasks:CUBE").record(env.unwrapped)
    finally:
        env.close()
    assert words in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize("key, success", [("also", Success(also=lambda scene: None)), ("tipped", None)])
def test_a_condition_that_says_neither_is_an_error(key, success):
    says = success or Success(failed=(("tipped", lambda scene: 1.0),))
    env = gym.make(register_task(task(name=f"cube_{key}", success=replace(says, seconds=0.1))))
    with pytest.raises(BadTask, match=f"success: {key}: returns (None|1.0); expected True or False"):
        env.reset(seed=0)
        env.step(np.zeros(env.action_space.shape))
    env.close()


def test_a_turn_of_more_than_half_a_turn_is_asked_about():
    with pytest.raises(BadTask, match=r"start: 'cube' turns by \(17, 46\): more than half a turn; in radians"):
        task(start={"cube": Range((0.0, -0.15), turn=(17, 46)), "pad": Range((0.0, 0.12))})
