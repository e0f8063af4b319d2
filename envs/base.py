"""What all tasks share: the Gymnasium interface around a simulation."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Any

import gymnasium as gym
import numpy as np

from ..planner.errors import BadAction, BadOption, UnknownName
from ..planner.pose import Pose
from . import spaces as space
from .boxes import Box
from .render import Ghost, Renderer
from .sim import PHYSICS_DT, Simulation
from .state import State
from .task import TaskDescription

CONTROL_MODES = ("joint_velocity", "ee_twist")
REWARDS = ("sparse", "dense")
MAX_LINEAR, MAX_ANGULAR = 0.25, 1.2
"""Tcp speeds [m/s, rad/s] of a full `ee_twist` action."""
TWIST_DAMPING = 0.02
METADATA: dict[str, Any] = {"render_modes": ["rgb_array", "human"], "render_fps": 50}
Observation = dict[str, np.ndarray]


def checked_choice(option: str, value: object, known: tuple[str, ...]) -> str:
    """The value if it is among the known ones.

    Raises:
        UnknownName: it is not.
    """
    if not isinstance(value, str) or value not in known:
        raise UnknownName(option, value, known)
    return value


class OneDemoEnv(gym.Env[Observation, np.ndarray], ABC):
    """A task at a table: control at a rate that divides the physics' 500 Hz, success judged by the simulator."""

    metadata = METADATA

    def __init__(
        self,
        *,
        robot: str,
        boxes: tuple[Box, ...],
        control_mode: str,
        reward: str,
        render_mode: str | None,
        control_frequency: int,
    ):
        self.control_mode = checked_choice("control_mode", control_mode, CONTROL_MODES)
        self.reward_kind = checked_choice("reward", reward, REWARDS)
        if render_mode is not None:
            checked_choice("render_mode", render_mode, tuple(self.metadata["render_modes"]))
        self.render_mode = render_mode
        self.substeps = _substeps(control_frequency)
        self.sim = Simulation(robot, boxes)
        self.arms = tuple(index.arm for index in self.sim.scene.arms)
        self.metadata = {**METADATA, "render_fps": control_frequency}
        entries = self.arms[0].dof if control_mode == "joint_velocity" else 6
        self.action_space = space.action_space(entries, len(self.arms))
        self._speed_limits = np.stack([arm.velocity_limits for arm in self.arms])
        self._action = np.zeros(self.action_space.shape or ())
        self._renderer: Renderer | None = None

    @property
    @abstractmethod
    def task(self) -> TaskDescription:
        """What every policy may know beforehand."""

    @property
    def control_dt(self) -> float:
        """Seconds between actions."""
        return self.substeps * PHYSICS_DT

    @abstractmethod
    def _start(self, options: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
        """Joints (n_arms, dof) and object poses (n, 7) of a new episode; sets the task's own state."""

    @abstractmethod
    def _judge(self, state: State) -> tuple[float, bool, dict[str, Any]]:
        """Reward, terminated and info of the state just reached."""

    @abstractmethod
    def _goals(self) -> tuple[np.ndarray, float]:
        """Goal poses (n, 7) and the index of the current motion."""

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode; the same seed and options give the same bits."""
        super().reset(seed=seed)
        joints, poses = self._start(dict(options or {}))
        self.sim.reset(joints, poses)
        state = self.sim.read()
        _, _, info = self._judge(state)
        if self.render_mode == "human":
            self._show()
        return self._observation(state), info

    def step(self, action: np.ndarray) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Act for one control step.

        Raises:
            BadAction: not an array of real numbers, of the wrong shape, or not finite.
        """
        self._take(action)
        if self.control_mode == "joint_velocity":
            bad = self.sim.step(self._action, self._speed_limits, 1.0, self.substeps)
        else:
            bad = self._step_twists()
        if bad >= 0:
            raise BadAction(f"entry {bad} is not finite")
        state = self.sim.read()
        reward, terminated, info = self._judge(state)
        if self.render_mode == "human":
            self._show()
        return self._observation(state), reward, terminated, False, info

    def render(self) -> np.ndarray | None:
        """An image (height, width, 3) uint8 in the mode "rgb_array"; OpenGL is opened by the first call."""
        if self.render_mode != "rgb_array":
            return None
        sizes = [item.size for item in self.task.objects]
        ghosts = [Ghost(pose, size) for pose, size in zip(self._goals()[0], sizes, strict=True)]
        return self._opened_renderer().image(self.sim.data, ghosts)

    def close(self) -> None:
        """Close the window or the image buffer, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _show(self) -> None:
        self._opened_renderer().show(self.sim.data)

    def _opened_renderer(self) -> Renderer:
        if self._renderer is None:
            self._renderer = Renderer(self.sim.model)
        return self._renderer

    def _take(self, action: np.ndarray) -> None:
        """Copy an action, of whatever array type, to where the compiled code reads it."""
        if type(action) is not np.ndarray or action.dtype != np.float64:
            try:
                action = np.asarray(action)
            except ValueError:
                raise BadAction("is not an array of numbers") from None
            if action.dtype.kind not in "fiub":
                raise BadAction(f"is not an array of real numbers, but of {action.dtype.name}")
        if action.shape != self._action.shape:
            raise BadAction(f"has shape {action.shape}; expected {self._action.shape}")
        self._action[:] = action

    def _step_twists(self) -> int:
        """Step with tcp twists in world axes, made joint speeds by damped least squares."""
        finite = np.isfinite(self._action)
        if not finite.all():
            return int(np.argmin(finite))
        rows = np.clip(self._action, -1.0, 1.0).reshape(len(self.arms), -1)
        speeds = np.column_stack([self._resolved(rows), rows[:, -1]])
        return self.sim.step(speeds.ravel(), np.ones_like(self._speed_limits), math.inf, self.substeps)

    def _resolved(self, rows: np.ndarray) -> np.ndarray:
        """Joint speeds (n_arms, dof) of tcp twists in world axes, by damped least squares."""
        speeds = []
        for arm, index, row in zip(self.arms, self.sim.scene.arms, rows, strict=True):
            x, jacobian = arm.fk_jacobian(self.sim.data.qpos[index.qpos])
            to_body = Pose(x).rotation.T
            twist = np.concatenate([to_body @ (MAX_LINEAR * row[:3]), to_body @ (MAX_ANGULAR * row[3:6])])
            gram = jacobian @ jacobian.T + TWIST_DAMPING**2 * np.eye(6)
            wanted = jacobian.T @ np.linalg.solve(gram, twist)
            speeds.append(wanted / max(1.0, float((np.abs(wanted) / arm.velocity_limits).max())))
        return np.array(speeds)

    def _observation(self, state: State) -> Observation:
        goals, motion = self._goals()
        return {
            "joint_positions": state.joint_positions,
            "joint_velocities": state.joint_velocities,
            "tcp_pose": state.tcp_pose,
            "gripper_opening": state.gripper_opening,
            "object_pose": state.object_pose,
            "goal_pose": goals,
            "motion_index": np.array([motion]),
        }


def _substeps(control_frequency: int) -> int:
    physics = round(1.0 / PHYSICS_DT)
    if isinstance(control_frequency, bool) or not isinstance(control_frequency, int) or control_frequency <= 0:
        raise BadOption("control_frequency", f"{control_frequency!r} is not a positive whole number of Hz")
    if physics % control_frequency:
        allowed = ", ".join(str(rate) for rate in range(10, physics + 1) if physics % rate == 0)
        reason = f"{control_frequency} Hz does not divide {physics} Hz; allowed: {allowed}"
        raise BadOption("control_frequency", reason)
    return physics // control_frequency
