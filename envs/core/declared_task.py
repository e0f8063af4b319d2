"""A task as the environment takes it: a scene, and functions that begin, observe and accompany an episode."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

from ...planner import Arm
from ...planner.errors import BadOption
from ..facts.task_facts import TaskFacts
from ..judge.progress import Progress
from ..scene.robots import Robot
from ..scene.scene import CompiledScene
from ..scene.scene_objects import SceneSpec
from ..simulation.render import TABLE_VIEW, Ghost, View
from ..simulation.simulation import Simulation, Start
from ..simulation.state import State
from .description import TaskDescription
from .goal_form import GoalForm
from .placement_context import ObstacleRequest, PlacementMotion


class World(NamedTuple):
    """World of a task: its simulation, and what follows from the scene.

    Attributes:
        sim: the simulation.
        arms: kinematics of the arms.
        task: constant facts that a policy may know.
        dt: time between actions [s].
        rng: source of randomness of the episode.
    """

    sim: Simulation
    arms: tuple[Arm, ...]
    task: TaskDescription
    dt: float
    rng: np.random.Generator


@dataclass
class TaskEpisode:
    """An episode.

    Attributes:
        start: its start, without obstacles.
        goals: (g, 7) goals, x y z [m] and wxyz.
        progress: judges every state.
        constant: further entries of the observation that are constant during the episode.
        layout: places that the task has drawn and needs later.
    """

    start: Start
    goals: np.ndarray
    progress: Progress
    constant: dict[str, np.ndarray] = field(default_factory=dict)
    layout: Any = None


class DeclaredTask:
    """A task; its attributes are constant once `bind` was called, and all that changes is in its episodes.

    Attributes:
        facts: facts about it.
        name: of the task.
        robot: the robot.
        things: scene contents besides the robot.
        goals: number of goal poses.
        motions: largest motion index.
        arms: names of the arms at work; None: the robot's default arm.
        scene: scene compiled elsewhere; None: that of the robot and the things.
        more: further entries of the observation.
        view: camera view.
        form: achieved and desired goals of a single motion; None: the task is none.
        too_short: whether its motion is too short for obstacles.
        only_sparse: why it has no dense reward; "": it has one.
    """

    facts: TaskFacts
    name: str
    robot: Robot
    things: SceneSpec
    goals: int
    motions: int
    arms: tuple[str, ...] | None = None
    scene: CompiledScene | None = None
    more: Mapping[str, gym.spaces.Box] = {}
    view: View = TABLE_VIEW
    form: GoalForm | None = None
    too_short = False
    only_sparse = ""

    def bind(self, world: World) -> None:
        """Check and take over what depends on the compiled scene; called once."""

    def described(self, description: TaskDescription) -> TaskDescription:
        """Return the description of the task, made of what all have in common."""
        return description

    def begin(self, world: World, options: dict[str, Any], layout: str, *, spacious: bool) -> TaskEpisode:
        """Return a new episode.

        Args:
            world: the task's world.
            options: options of `reset`, except "level" and "obstacles"; unknown keys are refused.
            layout: name of the ranges to draw from.
            spacious: whether obstacles will be placed, which need clearance.
        """
        raise NotImplementedError

    def placement_motions(self, world: World, episode: TaskEpisode) -> list[PlacementMotion]:
        """Return the hand's motions that obstacles may block, in order.

        Args:
            world: the task's world.
            episode: the episode, which has just begun.
        """
        raise NotImplementedError

    def paper(self, motions: list[PlacementMotion]) -> list[ObstacleRequest]:
        """Return the obstacles of the paper's experiment."""
        raise BadOption("obstacles", f"the paper shows no obstacle in {self.name}")

    def ghosts(self, episode: TaskEpisode) -> list[Ghost]:
        """Return the shapes drawn without being simulated: the goals, if they are places of objects."""
        return []

    def look(self, world: World, episode: TaskEpisode, state: State, seconds: float, *, shaped: bool) -> None:
        """Let the episode's progress see more than the state before it is judged.

        Args:
            world: the task's world.
            episode: the episode.
            state: the state just reached.
            seconds: time since the start [s].
            shaped: whether a dense reward is wanted.
        """

    def observed(self, episode: TaskEpisode) -> dict[str, np.ndarray]:
        """Return the task's own entries of the observation."""
        return {key: value.copy() for key, value in episode.constant.items()}

    def follow(self, world: World, episode: TaskEpisode, observation: dict[str, np.ndarray]) -> None:
        """Do what others than the robot do after a step.

        Args:
            world: the task's world.
            episode: the episode.
            observation: the present one.
        """
