"""Safety layer around any policy: a Gymnasium action wrapper."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np

from ..planner import SafetyLayer, SafetySettings
from ..planner.collision.robot_arrays import ROW
from ..planner.collision.self_collision import pairs_of
from ..planner.errors import BadOption
from .policy import Observation
from .programs.world_model import WorldModel

MARGIN = 0.005
"""Margin [m] to the table and to objects: more than the arm's lag, less than a grasp needs."""
SAFE = SafetySettings(self_distance=0.005, rest_weight=0.05, acceleration=5.0)
"""Default settings, with smooth commands: the robots' wrists cannot follow sudden changes, and must follow commands."""
WITHIN_REACH = 0.06
"""Distance [m] between an object's center and the tcp below which fingers may touch the object."""


class SafeActions(gym.Wrapper):
    """Wrapper that changes every action such that no arm touches a forbidden body.

    The arm must not touch the table, objects, obstacles or itself; fingers may touch an object between them.
    `info["safety"]` is the status: 0 unchanged, 1 command changed, 2 command shortened, 3 blocked (the constraints are
    infeasible). A held object is unknown to the wrapper and not guarded.

    Commanded joints are guarded, not measured ones: the servos lag by 40 ms. Put the worst tracking error, 2.5 mm in
    the shipped scenes, into `settings.distance`.

    Args:
        env: environment of this project in the control mode `joint_velocity`.
        settings: see `SafetySettings`; None: `SAFE`.

    Raises:
        BadOption: another control mode.
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
        """Start an episode; the commanded joints are the observed ones."""
        observation, info = self.env.reset(**kwargs)
        self._q = np.array(observation["joint_positions"])
        # a new layer: the old one remembers speeds of the last episode
        self._observation, self._layer = observation, None
        return observation, {**info, "safety": 0}

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Take the safe action; see `safe_action`."""
        safe, status = self.safe_action(np.asarray(action, dtype=np.float64))
        self._observation, reward, terminated, truncated, info = self.env.step(safe)
        return self._observation, reward, terminated, truncated, {**info, "safety": status}

    def safe_action(self, action: np.ndarray) -> tuple[np.ndarray, int]:
        """Return the safe action taken instead of `action`, and the status; the commanded joints are advanced."""
        arms, dt = self._task.arms, self._task.control_dt
        rows = action.reshape(len(arms), -1)
        limits = np.array([arm.velocity_limits for arm in arms])
        filtered = self._bound_layer()(self._q.ravel(), (np.clip(rows[:, :-1], -1.0, 1.0) * limits).ravel())
        speeds = filtered.velocity.reshape(limits.shape)
        self._q = self._q + dt * speeds
        return np.column_stack([speeds / limits, rows[:, -1]]).reshape(action.shape), filtered.status

    def _bound_layer(self) -> SafetyLayer:
        """Return the layer for the current surroundings, rebuilt only after a change."""
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
                self._layer.work[ROW.previous] = before.work[ROW.previous]
        return self._layer

    def _near_objects(self) -> list[str]:
        centers = self._observation["object_pose"][:, :3]
        reach = np.linalg.norm(centers[:, None] - self._observation["tcp_pose"][None, :, :3], axis=2).min(axis=1)
        return [each.name for each, distance in zip(self._task.objects, reach, strict=True) if distance < WITHIN_REACH]
