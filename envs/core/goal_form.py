"""Single motions: end of an episode, and the goal form of Gymnasium's goal environments."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium.spaces.utils import flatten_space

from ...planner.errors import BadOption
from ..simulation.state import State
from . import spaces as space

if TYPE_CHECKING:
    pass

HORIZON = 150
"""Actions per episode."""
LAST_ACTION = "last_action"
TOLD_BY_GOALS = ("goal_pose", "motion_index")
"""Observation entries that tell the goal, or whether it is reached: they would contradict relabeled goals."""
POSE_BOUNDS = (space.REACH, space.REACH, space.REACH, 1.0, 1.0, 1.0, 1.0)
"""Bounds of a pose's entries."""


class Agreement(NamedTuple):
    """Agreement of achieved goals with desired ones.

    Attributes:
        close: (...) closeness in [0, 1], 1 without error; see `dense_reward`.
        reached: (...) whether the error is within the task's tolerances.
    """

    close: np.ndarray
    reached: np.ndarray


@dataclass(frozen=True, slots=True)
class GoalForm:
    """Goals of a single motion as numbers.

    Attributes:
        bounds: bounds of a goal's entries, one per entry.
        achieved: function of an episode and a state that returns the goal (g,) that the state has achieved.
        desired: function of an episode that returns the desired goal (g,).
        agreement: function of achieved and desired goals (..., g) that returns how well they agree.
    """

    bounds: tuple[float, ...]
    achieved: Callable[[Any, State], np.ndarray]
    desired: Callable[[Any], np.ndarray]
    agreement: Callable[[np.ndarray, np.ndarray], Agreement]

    def reward(self, achieved: Any, desired: Any, *, dense: bool) -> Any:
        """Return the reward: 1 where goals agree, else 0; if dense, the closeness of the goals.

        Args:
            achieved: (g,) or (n, g) achieved goals.
            desired: desired goals of the same shape.
            dense: see above.
        """
        found = self.agreement(np.asarray(achieved, dtype=np.float64), np.asarray(desired, dtype=np.float64))
        rewards = np.where(found.reached, 1.0, 0.9 * found.close) if dense else found.reached.astype(np.float64)
        return float(rewards) if rewards.ndim == 0 else rewards


def released_at_goal(k: int, withdrawn: float, agreement: Callable[[np.ndarray, np.ndarray], Agreement]) -> GoalForm:
    """Return the goals (8,) of placing an object: its pose, and 1 once it is released and the hand is away, else 0.

    Args:
        k: index of the object and of its goal.
        withdrawn: least distance [m] of the tcp that is away from it.
        agreement: see `GoalForm`.
    """
    return GoalForm((*POSE_BOUNDS, 1.0), partial(_released, k, withdrawn), partial(_goal, k), agreement)


def _released(k: int, withdrawn: float, episode: Any, state: State) -> np.ndarray:
    pose = state.object_pose[k]
    away = float(np.linalg.norm(pose[:3] - state.tcp_pose[0, :3])) >= withdrawn
    return np.append(pose, float(away and not episode.progress.held))


def _goal(k: int, episode: Any) -> np.ndarray:
    return np.append(episode.goals[k], 1.0)


def check_flags(**flags: bool | None) -> None:
    """Refuse options that are neither True nor False; `end_on_success` may be None."""
    for option, value in flags.items():
        if not isinstance(value, bool) and not (value is None and option == "end_on_success"):
            raise BadOption(option, f"{value!r} is neither True nor False")


def seen_in_goal_form(entries: dict[str, Any]) -> dict[str, Any]:
    """Return the entries of an observation, or of its space, that the goal form's vector consists of."""
    return {key: entry for key, entry in entries.items() if key not in TOLD_BY_GOALS}


def goal_form_space(form: GoalForm, seen: gym.spaces.Dict) -> gym.spaces.Dict:
    """Return the observation space of the goal form.

    Args:
        form: goals of the task.
        seen: space of the entries that the vector consists of.
    """
    bound, flat = np.array(form.bounds), flatten_space(seen)
    goal, parts = space.box(-bound, bound, bound.shape), {}
    parts.update({"observation": flat, "achieved_goal": goal, "desired_goal": goal})
    return gym.spaces.Dict(parts)


def check_long_enough(name: str, obstacles: Any) -> None:
    """Refuse obstacles in a task whose motion is too short for them.

    Args:
        name: of the task.
        obstacles: kind of obstacles, or given ones.
    """
    if obstacles != "none" and len(obstacles):
        reason = f"the motion of {name} is too short for obstacles; allowed: levels L0, L1, L2, R, S, T"
        raise BadOption("level", reason)
