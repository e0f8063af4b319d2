"""Base class of all tasks: the Gymnasium interface around a simulation."""

from __future__ import annotations

import copy
import math
from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Any, Generic, TypeVar

import gymnasium as gym
import numpy as np

from ...planner import Obstacle, Pose
from ...planner.errors import BadOption
from ..errors import BadAction, NoRoom
from ..facts.page import Page
from ..facts.task_facts import TaskFacts
from ..judge.progress import Progress
from ..scene.robot_description import robot_parts
from ..scene.robots import Robot
from ..scene.scene import OBSTACLE, CompiledScene, compiled_scene
from ..scene.scene_objects import TABLE_HEIGHT, SceneSpec
from ..simulation.moving_obstacles import ScheduledObstacle
from ..simulation.render import TABLE_VIEW, Ghost, Renderer, View
from ..simulation.simulation import PHYSICS_DT, Simulation, Start, substeps_at
from ..simulation.state import State
from ..simulation.twist_control import TwistDrive
from . import spaces as space
from .description import TaskDescription, TaskFurniture, TaskObject
from .levels import checked_obstacles, level_named
from .obstacle_placement import placed
from .placement_context import ObstacleRequest, PlacementContext, PlacementMotion
from .reset_options import checked_choice

CONTROL_MODES = ("joint_velocity", "ee_twist")
REWARDS = ("sparse", "dense")
METADATA: dict[str, Any] = {"render_modes": ["rgb_array", "human"], "render_fps": 50}
SLOTS = 3
"""Largest number of obstacles at once."""
MAX_LAYOUTS = 40
"""Largest number of starts drawn per reset until the obstacles fit."""
Observation = dict[str, np.ndarray]
ProgressT = TypeVar("ProgressT", bound=Progress)
"""Progress class of a task."""


class TaskEnv(gym.Env[Observation, np.ndarray], ABC, Generic[ProgressT]):
    """A task at a table: control at a rate that divides the physics' 500 Hz, success judged by the simulator.

    Args:
        name: task name.
        robot: the robot.
        goals: number of goal poses.
        motions: largest motion index.
        more: task-specific entries of the observation.
        things: scene contents besides the robot.
        scene: scene compiled elsewhere; None: that of the robot and the things.
        view: camera view.

    All environments share the other arguments: `print(env.unwrapped.__doc__)` is the page of a made environment.
    """

    FACTS: TaskFacts
    """Facts about the task, its documentation among them."""

    _goal_pose: np.ndarray
    _progress: ProgressT

    metadata = METADATA

    def __init__(
        self,
        *,
        name: str,
        robot: Robot,
        things: SceneSpec,
        goals: int,
        motions: int,
        level: str,
        obstacles: str | None,
        control_mode: str,
        reward: str,
        render_mode: str | None,
        control_frequency: int,
        arms: tuple[str, ...] | None = None,
        scene: CompiledScene | None = None,
        view: View = TABLE_VIEW,
        more: dict[str, gym.spaces.Box] | None = None,
    ):
        level_named(level)
        self.level, self.obstacles = level, None if obstacles is None else checked_obstacles(obstacles, SLOTS)
        self.control_mode = checked_choice("control_mode", control_mode, CONTROL_MODES)
        self.reward_kind = checked_choice("reward", reward, REWARDS)
        if render_mode is not None:
            checked_choice("render_mode", render_mode, tuple(self.metadata["render_modes"]))
        self.render_mode = render_mode
        self.substeps = substeps_at(control_frequency)
        self.sim = Simulation.of(scene or compiled_scene(robot, replace(things, obstacles=SLOTS), arms))
        self.arms = tuple(index.arm for index in self.sim.scene.arms)
        self.metadata = {**METADATA, "render_fps": control_frequency}
        entries = self.arms[0].dof if control_mode == "joint_velocity" else 6
        self.action_space = space.action_space(entries, len(self.arms))
        self._drive = TwistDrive(self.sim, self.control_dt)
        self._speed_limits = np.stack([arm.velocity_limits for arm in self.arms])
        self._action = np.zeros(self.action_space.shape or ())
        self._renderer: Renderer | None = None
        self._view, self._steps, self._contacts, self._refused = view, 0, 0, 0
        self._task = self._described(name, things)
        widths, objects = self._task.gripper_width, len(self._task.objects)
        self.observation_space: Any = space.observation_space(
            self.arms, widths, objects, goals, motions, SLOTS, **(more or {})
        )
        self.boxes = self.observation_space.spaces

    def _described(self, name: str, things: SceneSpec) -> TaskDescription:
        parts = robot_parts(self.sim.scene)
        return TaskDescription(
            name=name,
            robot=self.sim.scene.robot.name,
            arms=self.arms,
            control_dt=self.control_dt,
            objects=tuple(TaskObject.of(each) for each in things.objects),
            bodies=parts.bodies,
            table_height=TABLE_HEIGHT,
            fixtures=parts.fixtures,
            gripper_width=tuple(self.sim.widest_opening(k) for k in range(len(self.arms))),
            furniture=tuple(TaskFurniture.of(each) for each in things.furniture),
            touching=parts.touching,
            obstacles=SLOTS,
            control_mode=self.control_mode,
            skill=self.FACTS.skill,
        )

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        cls.__doc__ = Page(str(cls.__doc__))  # type: ignore[assignment]

    def __getstate__(self) -> dict[str, Any]:
        """Return what makes a twin, in this process or another: all but an open image or window."""
        for draws in (self, self.action_space):
            _ = draws.np_random  # made at its first use: each twin would make another
        return {**self.__dict__, "_renderer": None}

    def __copy__(self) -> TaskEnv[ProgressT]:
        return copy.deepcopy(self)

    @property
    def task(self) -> TaskDescription:
        """Constant facts that a policy may know before the first observation."""
        return self._task

    @property
    def control_dt(self) -> float:
        """Time between actions [s]."""
        return self.substeps * PHYSICS_DT

    @abstractmethod
    def _start(self, options: dict[str, Any], layout: str, spacious: bool) -> Start:
        """Return the start of an episode, without obstacles; set `_goal_pose`, `_progress` and the task's own state.

        Args:
            options: options of `reset`, except "level" and "obstacles"; unknown keys are refused.
            layout: name of the ranges to draw from.
            spacious: whether obstacles will be placed, which need clearance.
        """

    @abstractmethod
    def _placement_motions(self, start: Start) -> list[PlacementMotion]:
        """Return the hand's motions that obstacles may block, in order."""

    def _ghosts(self) -> list[Ghost]:
        """Return the shapes drawn without being simulated: the goals, if they are places of objects."""
        return []

    def _paper(self, motions: list[PlacementMotion]) -> list[ObstacleRequest]:
        """Return the obstacles of the paper's experiment."""
        raise BadOption("obstacles", f"the paper shows no obstacle in {self.task.name}")

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode; the same seed and options give bitwise identical episodes.

        Args:
            seed: seed of the episode's random numbers; None: continue the random sequence.
            options: start options, see the environment's docstring.

        Raises:
            UnknownName: an unknown option, level or kind of obstacles.
            BadOption: an unusable value, or no start with clearance for the obstacles (`NoRoom`).
        """
        super().reset(seed=seed)
        self._steps = self._contacts = 0
        self._action[:] = 0.0
        self._drive.reset()
        self.sim.reset(self._started(dict(options or {})))
        observation, *_, info = self._reached()
        return observation, info

    def _started(self, options: dict[str, Any]) -> Start:
        """Return a start with its obstacles; draw another start while the obstacles do not fit."""
        level = level_named(options.pop("level", self.level))
        wanted = level.obstacles if self.obstacles is None else self.obstacles
        wanted = checked_obstacles(options.pop("obstacles", wanted), SLOTS)
        self._refused = 0
        for _ in range(MAX_LAYOUTS):
            start = self._start(dict(options), level.layout, isinstance(wanted, str) and wanted != "none")
            scheduled_obstacles = wanted if isinstance(wanted, tuple) else self._scheduled_obstacles(wanted, start)
            if scheduled_obstacles is not None:
                return start._replace(scheduled_obstacles=scheduled_obstacles)
            self._refused += 1
        raise NoRoom(wanted)

    def _scheduled_obstacles(self, kind: str, start: Start) -> tuple[ScheduledObstacle, ...] | None:
        if kind == "none":
            return ()
        task, motions = self.task, self._placement_motions(start)
        things: list[Obstacle] = []
        poses = (*start.objects, *start.furniture)
        for each, pose in zip((*task.objects, *task.furniture), poses, strict=True):
            things += each.at(Pose.from_vector(pose))
        solids = [*task.fixtures, *things]
        stage = PlacementContext(
            motions, task.arms[0], task.bodies[0], start.joints[0], solids, things, task.table_height
        )
        return placed(self.np_random, kind, stage, self._paper(motions) if kind == "paper" else None)

    def _reached(self) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Return Gymnasium's step results for the current state of the simulation."""
        state = self.sim.read()
        reward, terminated, info = self._judge(state)
        if self.sim.obstacles.scheduled_obstacles:
            touching = state.touching
            self._contacts += bool(touching[OBSTACLE].any() or touching[:, OBSTACLE].any())
        info["n_contacts"], info["min_obstacle_distance"] = self._contacts, self.sim.nearest_obstacle()
        info["layouts_refused"] = self._refused
        if self.render_mode == "human":
            self._show()
        return self._observation(state), reward, terminated, False, info

    def _judge(self, state: State) -> tuple[float, bool, dict[str, Any]]:
        """Return reward, terminated and info of the state just reached."""
        progress = self._progress
        verdict = progress.update(state)
        if verdict.unwanted:
            progress.collision = self.sim.contact_name((verdict.low, verdict.high))
        reward = progress.reward(state) if self.reward_kind == "dense" else float(progress.success)
        return reward, progress.success or progress.failed, progress.info()

    def step(self, action: np.ndarray) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Apply an action for one control step.

        Raises:
            BadAction: not an array of real numbers, of the wrong shape, or not finite.
        """
        self._take(action)
        if self.sim.obstacles.scheduled_obstacles:
            self.sim.advance_obstacles((self._steps + 1) * self.control_dt, self._progress.motion_index)
        if self.control_mode == "joint_velocity":
            bad = self.sim.step(self._action, self._speed_limits, 1.0, self.substeps)
        else:
            bad = self._step_twists()
        if bad >= 0:
            raise BadAction(f"entry {bad} is not finite")
        self._steps += 1
        return self._reached()

    def render(self) -> np.ndarray | None:
        """Return an image (height, width, 3) uint8 in the mode "rgb_array"; the first call opens OpenGL."""
        if self.render_mode != "rgb_array":
            return None
        return self._opened_renderer().image(self.sim.data, self._ghosts())

    def close(self) -> None:
        """Close the window or the image buffer, if open."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _show(self) -> None:
        self._opened_renderer().show(self.sim.data)

    def _opened_renderer(self) -> Renderer:
        if self._renderer is None:
            self._renderer = Renderer(self.sim.model, self._view)
        return self._renderer

    def _take(self, action: np.ndarray) -> None:
        """Copy an action of any array type into the buffer that the compiled code reads."""
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
        """Step with tcp twists in world axes."""
        finite = np.isfinite(self._action)
        if not finite.all():
            return int(np.argmin(finite))
        rows = np.clip(self._action, -1.0, 1.0).reshape(len(self.arms), -1)
        commands = np.column_stack([self._drive.commands(rows), rows[:, -1]])
        return self.sim.step(commands.ravel(), np.ones_like(self._speed_limits), math.inf, self.substeps)

    def _observation(self, state: State) -> Observation:
        return {
            "joint_positions": state.joint_positions,
            "joint_velocities": state.joint_velocities,
            "tcp_pose": state.tcp_pose,
            "gripper_opening": state.gripper_opening,
            "object_pose": state.object_pose,
            "goal_pose": self._goal_pose.copy(),
            "motion_index": np.array([self._progress.motion_index]),
            **self.sim.obstacles.observed(self._steps * self.control_dt),
            **self._more_observed(state),
        }

    def _more_observed(self, state: State) -> Observation:
        """Return the task-specific entries of the observation."""
        return {}
