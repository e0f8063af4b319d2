"""Playback of the ONE demonstration as an episode in an environment's own actions, for learners.

Not in the paper: there, nothing is learned from it. A plain proportional law follows the demonstrated path of the tcp,
without a planner and without avoiding anything.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ...envs import TaskDescription
from ...envs.simulation.twist_control import MAX_ANGULAR, MAX_LINEAR
from ...planner import Controller, ControllerSettings, Demonstration, Pose, PosePath, guide_index, imitated_path
from ...planner.errors import BadOption
from ...planner.geometry.pose import METERS_PER_RADIAN
from ...planner.imitation.demonstration import GRIPPER_ACTIONS
from ...planner.ranges import check_choice, check_ranges
from ..policy import Observation

GRIPS = {"close": 1.0, "open": -1.0}
"""Gripper entry of an action."""
LEVEL = "L0"
"""Level of the starts at which the demonstration is played."""


class Leg(NamedTuple):
    """Part of an episode.

    Attributes:
        path: path of the tcp.
        grip: gripper entry of the actions on it.
        ending: gripper entry of the actions that change the grip at its end; None: it stays as it is.
    """

    path: PosePath
    grip: float
    ending: float | None


LegAt = Callable[[Observation], Leg]
"""Function from the observation where a part of the episode begins to this part."""
Goal = Callable[[Observation], Pose]
"""Function from the first observation to the tcp's pose at the end of the path."""


@dataclass(frozen=True, slots=True)
class Playback:
    """Parameters of following the path, and of the steps after it.

    Path lengths are weighted, see `METERS_PER_RADIAN`.

    Attributes:
        begin: share of the path length at which the path is joined, straight from the start.
        gain: gain of the law [1/s].
        ahead: path length [m] between the tcp and the pose aimed at; with the gain it determines the speed.
        tolerance: path length [m] to the end within which the end is reached.
        patience: time [s] without progress after which the end counts as reached.
        hold: time [s] of standing still at the end of the path.
        ending: gripper action after that: "close", "open", "none"; "": the demonstrated action.
        grip: time [s] for the gripper action.
        withdraw: distance [m] by which the tool then retreats along its own axis.
        rest: time [s] of standing still at the end, in which success may be judged.
    """

    begin: float = 0.0
    gain: float = 5.0
    ahead: float = 0.02
    tolerance: float = 0.002
    patience: float = 1.0
    hold: float = 0.2
    ending: str = ""
    grip: float = 0.5
    withdraw: float = 0.08
    rest: float = 1.0

    def __post_init__(self):
        check_ranges(self, "(0, inf)", "gain", "ahead", "tolerance", "patience")
        check_ranges(self, "[0, inf)", "hold", "grip", "withdraw", "rest")
        check_ranges(self, "[0, 1)", "begin")
        check_choice("ending", self.ending, ("", *GRIPPER_ACTIONS))


class Transitions(NamedTuple):
    """Episode, step by step.

    Attributes:
        observations: (n, ...) per entry, before each step.
        actions: (n, m), in [-1, 1].
        rewards: (n,) rewards.
        next_observations: (n, ...) per entry, after each step.
        terminations: (n,) True where the episode ended.
        success: verdict of the simulator at the end.
    """

    observations: dict[str, np.ndarray]
    actions: np.ndarray
    rewards: np.ndarray
    next_observations: dict[str, np.ndarray]
    terminations: np.ndarray
    success: bool


def demo_episode(
    env: Any,
    demonstration: Demonstration,
    segments: str | Sequence[str],
    *,
    goal: Goal | None = None,
    playback: Playback | None = None,
    seed: int = 0,
) -> Transitions:
    """Play segments of the demonstration from the environment's nominal start, level L0.

    Args:
        env: environment of this project with one arm and a Dict observation, in either control mode; wrapped or not.
        demonstration: the demonstration.
        segments: names of the segments to follow, in order.
        goal: pose to which the end of the path is moved, the path as a whole with it; None: the demonstrated path.
        playback: parameters of the playback; None: the defaults.
        seed: seed of the start.

    Raises:
        UnknownName: no such segment.
        BadOption: the environment has two arms, or another kind of observation.
    """
    names, playback = [segments] if isinstance(segments, str) else list(segments), playback or Playback()
    path = demonstration.segment_path(names[0])
    for name in names[1:]:
        path = path.joined(demonstration.segment_path(name))
    last = demonstration.segment(names[-1])
    ending = GRIPS.get(playback.ending or last.gripper)

    def only(observation: Observation) -> Leg:
        moved = path if goal is None else imitated_path(path, goal(observation))
        joined = moved[guide_index(moved, playback.begin) :] if playback.begin > 0.0 else moved
        return Leg(joined, GRIPS["close" if last.held else "open"], ending)

    return episode_of(env, iter([only]), playback, seed=seed)


def episode_of(env: Any, legs: Iterator[LegAt], playback: Playback, *, seed: int = 0) -> Transitions:
    """Play an episode of several parts from the environment's nominal start, level L0.

    Args:
        env: see `demo_episode`.
        legs: its parts, each a function of the observation where it begins.
        playback: parameters of the playback.
        seed: seed of the start.

    Raises:
        BadOption: see `demo_episode`.
    """
    task: TaskDescription = env.unwrapped.task
    if len(task.arms) != 1:
        raise BadOption("env", f"has {len(task.arms)} arms; a demonstration is played with one")
    if "tcp_pose" not in getattr(env.observation_space, "spaces", {}):
        raise BadOption("env", "has no tcp_pose in its observation: neither flat features nor the goal form will do")
    observation, info = env.reset(seed=seed, options={"level": LEVEL})
    script = _Script(task, playback)
    script.seen = observation
    seen, actions, rewards, ended = [observation], [], [], []
    for action in script.actions(legs):
        observation, reward, terminated, truncated, info = env.step(action)
        script.seen = observation
        seen.append(observation)
        actions.append(action)
        rewards.append(float(reward))
        ended.append(bool(terminated))
        if terminated or truncated:
            break
    entries = {key: np.stack([each[key] for each in seen]) for key in seen[0]}
    return Transitions(
        {key: values[:-1] for key, values in entries.items()},
        np.array(actions),
        np.array(rewards),
        {key: values[1:] for key, values in entries.items()},
        np.array(ended),
        bool(info["success"]),
    )


def tcp_to_goal(goal: int = 0) -> Goal:
    """Return the goal "tcp at goal number `goal`"."""
    return lambda observation: _pose(observation, "goal_pose", goal)


def held_to_goal(index: int = 0, goal: int | None = None) -> Goal:
    """Return the goal "held object at its goal", with the object held as in the first observation.

    Args:
        index: index of the object.
        goal: index of the goal; None: the object's own.
    """

    def place(observation: Observation) -> Pose:
        target = Pose.from_vector(observation["goal_pose"][index if goal is None else goal])
        return target @ _pose(observation, "object_pose", index).inverse() @ _pose(observation, "tcp_pose", 0)

    return place


def as_shown(demonstration: Demonstration, segment: str, index: int) -> Goal:
    """Return the goal "tcp at an object as demonstrated at the segment's reference".

    Args:
        demonstration: the demonstration; the tcp pose is that at the end of the segment.
        segment: name of the segment.
        index: index of the object that stands for the reference.
    """
    reference_from_tcp = (
        demonstration.segment(segment).reference_pose.inverse() @ (demonstration.segment_path(segment)[-1])
    )
    return lambda observation: _pose(observation, "object_pose", index) @ reference_from_tcp


def twist_action(tcp: Pose, target: Pose, gain: float) -> np.ndarray:
    """Return the first six entries of an `ee_twist` action: proportional to the error, scaled as a whole into [-1, 1].

    Args:
        tcp: pose of the tcp in the world.
        target: target pose of the tcp in the world.
        gain: gain of the law [1/s].
    """
    turn = (target @ tcp.inverse()).quaternion
    sine = float(np.linalg.norm(turn[1:]))
    angle = 2.0 * math.atan2(sine, float(turn[0]))
    angular = turn[1:] * (angle / sine if sine > 0.0 else 0.0)
    linear = target.position - tcp.position
    action = gain * np.concatenate([linear / MAX_LINEAR, angular / MAX_ANGULAR])
    return action / max(1.0, float(np.abs(action).max()))


class _Script:
    """Actions that follow a path and end it, in closed loop through `seen`, the last observation."""

    def __init__(self, task: TaskDescription, playback: Playback):
        self._task, self._playback = task, playback
        self._controller = Controller(task.arms[0], ControllerSettings(gain=playback.gain))
        self.seen: Observation = {}

    def actions(self, legs: Iterator[LegAt]) -> Iterator[np.ndarray]:
        playback, grip = self._playback, GRIPS["open"]
        for leg_at in legs:
            path, grip, ending = leg_at(self.seen)
            yield from self._along(path, grip)
            yield from self._still(playback.hold, grip)
            if ending is not None:
                grip = ending
                yield from self._still(playback.grip, grip)
        if playback.withdraw > 0.0:
            back = self._tcp @ Pose.from_position_quaternion([0.0, 0.0, -playback.withdraw])
            yield from self._along(PosePath(back.dq[None]), grip)
        yield from self._still(playback.rest, grip)

    @property
    def _tcp(self) -> Pose:
        return _pose(self.seen, "tcp_pose", 0)

    def _along(self, path: PosePath, grip: float) -> Iterator[np.ndarray]:
        """Aim at the first pose far enough ahead, until the last pose is reached or there is no progress."""
        index, last, nearest, waited = 0, len(path) - 1, math.inf, 0.0
        while waited < self._playback.patience:
            tcp, before = self._tcp, index
            while index < last and _length(tcp, path[index]) < self._playback.ahead:
                index += 1
            left = _length(tcp, path[index])
            if index == last and left <= self._playback.tolerance:
                return
            nearer = index > before or left < nearest - 0.1 * self._playback.tolerance
            nearest = left if nearer else nearest
            waited = 0.0 if nearer else waited + self._task.control_dt
            yield self._toward(tcp, path[index], grip)

    def _still(self, seconds: float, grip: float) -> Iterator[np.ndarray]:
        entries = 6 if self._task.control_mode == "ee_twist" else self._task.arms[0].dof
        for _ in range(round(seconds / self._task.control_dt)):
            yield np.append(np.zeros(entries), grip)

    def _toward(self, tcp: Pose, target: Pose, grip: float) -> np.ndarray:
        if self._task.control_mode == "ee_twist":
            return np.append(twist_action(tcp, target, self._playback.gain), grip)
        speeds = self._controller(self.seen["joint_positions"][0], target) / self._task.arms[0].velocity_limits
        return np.append(speeds / max(1.0, float(np.abs(speeds).max())), grip)


def _pose(observation: Observation, key: str, index: int) -> Pose:
    return Pose.from_vector(observation[key][index])


def _length(start: Pose, end: Pose) -> float:
    """Return the weighted path length [m] between two poses."""
    distance, angle = start.distance_to(end)
    return math.hypot(distance, METERS_PER_RADIAN * angle)
