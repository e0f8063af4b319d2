"""The environment of all tasks: the Gymnasium interface around a simulation."""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.spaces.utils import flatten

from ...planner import Obstacle, Pose
from ...planner.errors import BadOption
from ..errors import BadAction, NoRoom
from ..facts.page import Page
from ..scene.scene import OBSTACLE, compiled_scene
from ..simulation.moving_obstacles import ScheduledObstacle
from ..simulation.render import Ghost, Renderer
from ..simulation.simulation import PHYSICS_DT, Simulation, Start, substeps_at
from ..simulation.state import State
from ..simulation.twist_control import TwistDrive
from . import goal_form as forms
from . import spaces as space
from .declared_task import DeclaredTask, TaskEpisode, World
from .description import SLOTS, TaskDescription, described_scene
from .levels import checked_obstacles, level_named
from .obstacle_placement import placed
from .placement_context import PlacementContext
from .reset_options import checked_choice

CONTROL_MODES = ("joint_velocity", "ee_twist")
REWARDS = ("sparse", "dense")
METADATA: dict[str, Any] = {"render_modes": ["rgb_array", "human"], "render_fps": 50}
MAX_LAYOUTS = 40
"""Largest number of starts drawn per reset until the obstacles fit."""
Observation = dict[str, np.ndarray]


class TaskEnv(gym.Env[Observation, np.ndarray]):
    """A task at a table: control at a rate that divides the physics' 500 Hz, success judged by the simulator.

    `print(env.unwrapped.__doc__)` shows the page of a made environment: spaces, rewards, starts, arguments.

    Args:
        declared: the task.
        level: starts and obstacles, see `LEVELS`.
        obstacles: kind of obstacles; None: those of the level.
        control_mode: "joint_velocity" or "ee_twist".
        reward: "sparse" or "dense".
        render_mode: None, "rgb_array" or "human".
        control_frequency: actions per second [Hz].
        goal_form: whether observations are those of Gymnasium's goal environments; only of single motions.
        end_on_success: whether a settled success ends an episode of a single motion; None: with sparse rewards that are
            not in the goal form. Dense rewards are never negative: an early end would pay less than waiting.
    """

    __doc__ = Page(__doc__)  # type: ignore[assignment]
    metadata = METADATA

    def __init__(
        self,
        declared: DeclaredTask,
        *,
        level: str,
        obstacles: str | None,
        control_mode: str,
        reward: str,
        render_mode: str | None,
        control_frequency: int,
        goal_form: bool = False,
        end_on_success: bool | None = None,
    ):
        if declared.only_sparse and reward == "dense":
            raise BadOption("reward", declared.only_sparse)
        level_named(level)
        self.declared = declared
        self.level, self.obstacles = level, None if obstacles is None else checked_obstacles(obstacles, SLOTS)
        self.control_mode = checked_choice("control_mode", control_mode, CONTROL_MODES)
        self.reward_kind = checked_choice("reward", reward, REWARDS)
        if render_mode is not None:
            checked_choice("render_mode", render_mode, tuple(self.metadata["render_modes"]))
        self.render_mode = render_mode
        self.substeps = substeps_at(control_frequency)
        things = replace(declared.things, obstacles=SLOTS)
        self.sim = Simulation.of(declared.scene or compiled_scene(declared.robot, things, declared.arms))
        self.arms = tuple(index.arm for index in self.sim.scene.arms)
        self.metadata = {**METADATA, "render_fps": control_frequency}
        entries = self.arms[0].dof if control_mode == "joint_velocity" else 6
        self.action_space = space.action_space(entries, len(self.arms))
        self._drive = TwistDrive(self.sim, self.control_dt)
        self._speed_limits = np.stack([arm.velocity_limits for arm in self.arms])
        self._action = np.zeros(self.action_space.shape or ())
        self._renderer: Renderer | None = None
        self._steps, self._contacts, self._refused = 0, 0, 0
        self._episode: TaskEpisode | None = None
        description = described_scene(
            self.sim, declared.name, declared.things, self.control_dt, self.control_mode, declared.facts.skill
        )
        self._task = declared.described(description)
        declared.bind(self._world(np.random.default_rng(0)))
        self._take_form(goal_form, end_on_success)

    def _take_form(self, goal_form: bool, end_on_success: bool | None) -> None:
        """Set up the observation space, and what only single motions have."""
        declared, widths, objects = self.declared, self._task.gripper_width, len(self._task.objects)
        forms.check_flags(goal_form=goal_form, end_on_success=end_on_success)
        if goal_form and not self._form.bounds:
            raise BadOption("goal_form", f"{declared.name} has no goals: success is only a condition")
        # the servos respond some actions late: without the last action a learner sees only half of the state
        last = {} if declared.form is None else {forms.LAST_ACTION: self.action_space}
        more: Any = {**declared.more, **last}
        self.observation_space: Any = space.observation_space(
            self.arms, widths, objects, declared.goals, declared.motions, SLOTS, **more
        )
        self.boxes = self.observation_space.spaces
        if declared.too_short:
            forms.check_long_enough(
                declared.name, level_named(self.level).obstacles if self.obstacles is None else self.obstacles
            )
        self.goal_form = goal_form
        dense = self.reward_kind == "dense" or goal_form
        self.ends_on_success = (not dense or declared.form is None) if end_on_success is None else end_on_success
        if goal_form and declared.form is not None:
            self._seen_space = gym.spaces.Dict(forms.seen_in_goal_form(self.boxes))
            self.observation_space = forms.goal_form_space(declared.form, self._seen_space)

    def __getstate__(self) -> dict[str, Any]:
        """Return what makes a twin, in this process or another: all but an open image or window."""
        for draws in (self, self.action_space):
            _ = draws.np_random  # made at its first use: each twin would make another
        return {**self.__dict__, "_renderer": None}

    def __copy__(self) -> TaskEnv:
        return copy.deepcopy(self)

    @property
    def task(self) -> TaskDescription:
        """Constant facts that a policy may know before the first observation."""
        return self._task

    @property
    def control_dt(self) -> float:
        """Time between actions [s]."""
        return self.substeps * PHYSICS_DT

    @property
    def episode(self) -> TaskEpisode:
        """The present episode."""
        if self._episode is None:
            raise BadAction("there is no episode yet: call reset first")
        return self._episode

    def _world(self, rng: np.random.Generator) -> World:
        return World(self.sim, self.arms, self._task, self.control_dt, rng)

    def _ghosts(self) -> list[Ghost]:
        return [] if self._episode is None else self.declared.ghosts(self._episode)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode; the same seed and options give bitwise identical episodes.

        Args:
            seed: seed of the episode's random numbers; None: continue the random sequence.
            options: start options, see the environment's page.

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
        wanted = options.pop("obstacles", level.obstacles if self.obstacles is None else self.obstacles)
        if self.declared.too_short:
            forms.check_long_enough(self.declared.name, wanted)
        wanted = checked_obstacles(wanted, SLOTS)
        self._refused, world = 0, self._world(self.np_random)
        spacious = isinstance(wanted, str) and wanted != "none"
        for _ in range(MAX_LAYOUTS):
            episode = self._episode = self.declared.begin(world, dict(options), level.layout, spacious=spacious)
            scheduled = wanted if isinstance(wanted, tuple) else self._scheduled_obstacles(wanted, world, episode)
            if scheduled is not None:
                return episode.start._replace(scheduled_obstacles=scheduled)
            self._refused += 1
        raise NoRoom(wanted)

    def _scheduled_obstacles(
        self, kind: str, world: World, episode: TaskEpisode
    ) -> tuple[ScheduledObstacle, ...] | None:
        if kind == "none":
            return ()
        task, start, motions = self.task, episode.start, self.declared.placement_motions(world, episode)
        things: list[Obstacle] = []
        poses = (*start.objects, *start.furniture)
        for each, pose in zip((*task.objects, *task.furniture), poses, strict=True):
            things += each.at(Pose.from_vector(pose))
        solids = [*task.fixtures, *things]
        stage = PlacementContext(
            motions, task.arms[0], task.bodies[0], start.joints[0], solids, things, task.table_height
        )
        return placed(self.np_random, kind, stage, self.declared.paper(motions) if kind == "paper" else None)

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
        episode, dense = self.episode, self.reward_kind == "dense"
        progress, world = episode.progress, self._world(self.np_random)
        self.declared.look(world, episode, state, self._steps * self.control_dt, shaped=dense)
        verdict = progress.update(state)
        if verdict.unwanted:
            progress.collision = self.sim.contact_name((verdict.low, verdict.high))
        reward = progress.reward(state) if dense else float(progress.success)
        info = progress.info()
        if self.goal_form:
            reward = self.compute_reward(self.achieved_goal(state), self.desired_goal(), info)
        return reward, progress.failed or (self.ends_on_success and progress.success), info

    @property
    def _form(self) -> forms.GoalForm:
        if self.declared.form is None:
            raise BadOption("goal_form", f"{self.task.name} is no single motion: it has no goal form")
        return self.declared.form

    def achieved_goal(self, state: State) -> np.ndarray:
        """Return the goal (g,) that a state has achieved, comparable to `desired_goal`."""
        return self._form.achieved(self.episode, state)

    def desired_goal(self) -> np.ndarray:
        """Return the desired goal (g,)."""
        return self._form.desired(self.episode)

    def compute_reward(self, achieved_goal: np.ndarray, desired_goal: np.ndarray, info: Any) -> Any:
        """Return the goal form's reward, see `GoalForm.reward`.

        Args:
            achieved_goal: (g,) or (n, g) achieved goals.
            desired_goal: desired goals of the same shape.
            info: unused; required by Gymnasium's goal environments.
        """
        return self._form.reward(achieved_goal, desired_goal, dense=self.reward_kind == "dense")

    def step(self, action: np.ndarray) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Apply an action for one control step.

        Raises:
            BadAction: not an array of real numbers, of the wrong shape, or not finite.
        """
        space.take_action(action, self._action)
        if self.sim.obstacles.scheduled_obstacles:
            self.sim.advance_obstacles((self._steps + 1) * self.control_dt, self.episode.progress.motion_index)
        if self.control_mode == "joint_velocity":
            bad = self.sim.step(self._action, self._speed_limits, 1.0, self.substeps)
        else:
            bad = self._drive.step(self._action, self.substeps)
        if bad >= 0:
            raise BadAction(f"entry {bad} is not finite")
        self._steps += 1
        reached = self._reached()
        self.declared.follow(self._world(self.np_random), self.episode, reached[0])
        return reached

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
            self._renderer = Renderer(self.sim.model, self.declared.view)
        return self._renderer

    def _observation(self, state: State) -> Observation:
        episode, declared = self.episode, self.declared
        last = {} if declared.form is None else {forms.LAST_ACTION: np.clip(self._action, -1.0, 1.0)}
        whole = {
            "joint_positions": state.joint_positions,
            "joint_velocities": state.joint_velocities,
            "tcp_pose": state.tcp_pose,
            "gripper_opening": state.gripper_opening,
            "object_pose": state.object_pose,
            "goal_pose": episode.goals.copy(),
            "motion_index": np.array([episode.progress.motion_index]),
            **self.sim.obstacles.observed(self._steps * self.control_dt),
            **declared.observed(episode),
            **last,
        }
        if not self.goal_form:
            return whole
        return {
            "observation": np.asarray(flatten(self._seen_space, forms.seen_in_goal_form(whole))),
            "achieved_goal": self.achieved_goal(state),
            "desired_goal": self.desired_goal(),
        }
