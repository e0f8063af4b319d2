"""Base class of the single-object tasks for training: end of an episode, and the goal form."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium.spaces.utils import flatten, flatten_space

from ...planner.errors import BadOption
from ..simulation.state import State
from . import spaces as space
from .environment import Observation, ProgressT, TaskEnv
from .levels import level_named

FREQUENCY = 20
"""Default action frequency [Hz]."""
HORIZON = 150
"""Actions per episode."""
LAST_ACTION = "last_action"
TOLD_BY_GOALS = ("goal_pose", "motion_index")
"""Observation entries that tell the goal, or whether it is reached: they would contradict relabeled goals."""


class Agreement(NamedTuple):
    """Agreement of achieved goals with desired ones.

    Attributes:
        close: (...) closeness in [0, 1], 1 without error; see `dense_reward`.
        reached: (...) whether the error is within the task's tolerances.
    """

    close: np.ndarray
    reached: np.ndarray


class SingleMotionEnv(TaskEnv[ProgressT]):
    """A single-object task; see the tasks' own docstrings."""

    GOAL_BOUNDS: tuple[float, ...]
    """Bounds of a goal's entries, one per entry."""

    def _take_form(self, name: str, goal_form: bool, end_on_success: bool | None, *, obstacles: bool = True) -> None:
        """Set up options and spaces that the base class does not know; to be called last in a constructor."""
        for option, value in (("goal_form", goal_form), ("end_on_success", end_on_success)):
            if not isinstance(value, bool) and not (value is None and option == "end_on_success"):
                raise BadOption(option, f"{value!r} is neither True nor False")
        self._task = replace(self._task, name=name)
        self.goal_form, self._obstacles_possible = goal_form, obstacles
        seen: Any = self.observation_space
        # the servos respond some actions late: without the last action a learner sees only half of the state
        self.observation_space: Any = gym.spaces.Dict({**seen.spaces, LAST_ACTION: self.action_space})
        self.boxes = self.observation_space.spaces
        self._check_way(level_named(self.level).obstacles if self.obstacles is None else self.obstacles)
        dense = self.reward_kind == "dense" or goal_form
        self.ends_on_success = not dense if end_on_success is None else end_on_success
        if goal_form:
            bound = np.array(self.GOAL_BOUNDS)
            goal = space.box(-bound, bound, bound.shape)
            entries = self.observation_space.spaces.items()
            self._seen_space = gym.spaces.Dict({key: entry for key, entry in entries if key not in TOLD_BY_GOALS})
            flat: Any = flatten_space(self._seen_space)
            parts: dict[str, gym.Space[Any]] = {"observation": flat, "achieved_goal": goal, "desired_goal": goal}
            self.observation_space = gym.spaces.Dict(parts)

    def _check_way(self, obstacles: Any) -> None:
        if not self._obstacles_possible and obstacles != "none" and len(obstacles):
            reason = f"the motion of {self._task.name} is too short for obstacles; allowed: levels L0, L1, L2, R, S, T"
            raise BadOption("level", reason)

    def _started(self, options: dict[str, Any]) -> Any:
        level = level_named(options.get("level", self.level))
        self._check_way(options.get("obstacles", level.obstacles if self.obstacles is None else self.obstacles))
        return super()._started(options)

    @abstractmethod
    def achieved_goal(self, state: State) -> np.ndarray:
        """Return the goal (g,) that a state has achieved, comparable to `desired_goal`."""

    @abstractmethod
    def desired_goal(self) -> np.ndarray:
        """Return the desired goal (g,)."""

    @abstractmethod
    def agreement(self, achieved: np.ndarray, desired: np.ndarray) -> Agreement:
        """Return how well achieved goals agree with desired ones.

        Args:
            achieved: (..., g) achieved goals.
            desired: (..., g) desired goals.
        """

    def compute_reward(self, achieved_goal: np.ndarray, desired_goal: np.ndarray, info: Any) -> Any:
        """Return the goal form's reward: 1 where goals agree, else 0; with dense rewards, the closeness of the goals.

        Args:
            achieved_goal: (g,) or (n, g) achieved goals.
            desired_goal: desired goals of the same shape.
            info: unused; required by Gymnasium's goal environments.
        """
        found = self.agreement(np.asarray(achieved_goal, dtype=np.float64), np.asarray(desired_goal, dtype=np.float64))
        if self.reward_kind == "dense":
            rewards = np.where(found.reached, 1.0, 0.9 * found.close)
        else:
            rewards = found.reached.astype(np.float64)
        return float(rewards) if rewards.ndim == 0 else rewards

    def _more_observed(self, state: State) -> Observation:
        return {**super()._more_observed(state), LAST_ACTION: np.clip(self._action, -1.0, 1.0)}

    def _judge(self, state: State) -> tuple[float, bool, dict[str, Any]]:
        reward, _, info = super()._judge(state)
        if self.goal_form:
            reward = self.compute_reward(self.achieved_goal(state), self.desired_goal(), info)
        progress = self._progress
        return reward, progress.failed or (self.ends_on_success and progress.success), info

    def _observation(self, state: State) -> Observation:
        whole = super()._observation(state)
        if not self.goal_form:
            return whole
        seen = {key: value for key, value in whole.items() if key not in TOLD_BY_GOALS}
        return {
            "observation": np.asarray(flatten(self._seen_space, seen)),
            "achieved_goal": self.achieved_goal(state),
            "desired_goal": self.desired_goal(),
        }
