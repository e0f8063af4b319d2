"""The safety layer around any policy: a Gymnasium action wrapper."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np

from ..planner.collision.robot_arrays import PREVIOUS
from ..planner.collision.self_collision import pairs_of
from ..planner.errors import BadOption
from ..planner.safety.safety_layer import SafetyLayer, SafetySettings
from .policy import Observation
from .programs.world_model import WorldModel

MARGIN = 0.005
"""Distance [m] to keep from the table and from objects: more than the arm lags, less than a grasp needs."""
SAFE = SafetySettings(self_distance=0.005, rest_weight=0.05, acceleration=5.0)
"""The robots' wrists cannot follow sudden changes: what is commanded must be what is done."""
WITHIN_REACH = 0.06
"""Distance [m] of an object's center from the tcp within which fingers may touch it."""


class SafeActions(gym.Wrapper):
    """Change every action, whoever chose it, so that no arm touches what it should not.

    The arm must not touch the table, nor objects, nor obstacles, nor itself; fingers may touch an object between
    them. `info["safety"]` says what was done: 0 nothing, 1 the command was changed, 2 it was shortened, 3 blocked
    (what must hold cannot hold). What is held is not known to the wrapper and not guarded.

    The joints that were commanded are guarded, not those measured: the servos lag by 40 ms. Put the worst tracking
    error, 2.5 mm in the shipped scenes, into `settings.distance`.

    Args:
        env: an environment of this project in the control mode `joint_velocity`.
        settings: see `SafetySettings`.
    """

    def __init__(self, env: gym.Env, settings: SafetySettings | None = None):
        super().__init__(env)
        inner: Any = env.unwrapped
        if getattr(inner, "control_mode", None) != "joint_velocity":
            raise BadOption("control_mode", "the safety layer needs joint_velocity")
        self.settings, self._task = settings or SAFE, inner.task
        self._pairs = pairs_of(self._task.arms, self._task.bodies)
        self._world_model = WorldModel(self._task, table_margin=MARGIN, margin=MARGIN)
        self._q = np.zeros((len(self._task.arms), self._task.arms[0].dof))
        self._key: tuple[Any, ...] = ()
        self._layer: SafetyLayer | None = None
        self._observation: Observation = {}

    def reset(self, **kwargs: Any) -> tuple[Any, dict[str, Any]]:
        """Start an episode; the commanded joints are those observed."""
        observation, info = self.env.reset(**kwargs)
        self._q = np.array(observation["joint_positions"])
        # nothing of the last episode: the layer remembers speeds
        self._observation, self._layer = observation, None
        return observation, {**info, "safety": 0}

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Act as safely as can be."""
        safe, status = self.safe_action(np.asarray(action, dtype=np.float64))
        self._observation, reward, terminated, truncated, info = self.env.step(safe)
        return self._observation, reward, terminated, truncated, {**info, "safety": status}

    def safe_action(self, action: np.ndarray) -> tuple[np.ndarray, int]:
        """The action that is taken instead, and what was done to it; the commanded joints move on with it."""
        arms, dt = self._task.arms, self._task.control_dt
        rows = action.reshape(len(arms), -1)
        limits = np.array([arm.velocity_limits for arm in arms])
        filtered = self._bound_layer()(self._q.ravel(), (np.clip(rows[:, :-1], -1.0, 1.0) * limits).ravel())
        speeds = filtered.velocity.reshape(limits.shape)
        self._q = self._q + dt * speeds
        return np.column_stack([speeds / limits, rows[:, -1]]).reshape(action.shape), filtered.status

    def _bound_layer(self) -> SafetyLayer:
        """The layer for what is around now; made anew only when something has moved."""
        obstacles = self._world_model.obstacles(self._observation)
        near = tuple(self._near_objects())
        if self._layer is None or self._key[0] is not obstacles or self._key[1] != near:
            self._key = (obstacles, near)
            task = self._task
            allowed = [*task.touching, *(("fingers", name) for name in near)]
            before, self._layer = self._layer, SafetyLayer(
                task.arms, task.bodies, obstacles, task.control_dt,
                settings=self.settings, allowed=allowed, pairs=self._pairs,
            )  # fmt: skip
            if before is not None:
                self._layer.work[PREVIOUS] = before.work[PREVIOUS]
        return self._layer

    def _near_objects(self) -> list[str]:
        centers = self._observation["object_pose"][:, :3]
        reach = np.linalg.norm(centers[:, None] - self._observation["tcp_pose"][None, :, :3], axis=2).min(axis=1)
        return [each.name for each, distance in zip(self._task.objects, reach, strict=True) if distance < WITHIN_REACH]
