"""Users' own tasks, as the environment takes them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ...planner import Mesh, Pose
from ...planner.robot.kinematics import CHAIN
from ..core import spaces as space
from ..core.carries import carry_motion, corners_at, grasp_from_above, reach_motion
from ..core.declared_task import DeclaredTask, TaskEpisode, World
from ..core.description import TaskDescription, TaskObject
from ..core.goal_form import POSE_BOUNDS, Agreement, GoalForm
from ..core.maker import GOAL_FORM, EnvironmentMaker
from ..core.placement_context import PlacementMotion
from ..core.reset_options import check_known, checked_joints, checked_poses
from ..errors import BadTask
from ..judge.dense_reward import closeness
from ..judge.judge import GOAL, MEASURE, is_met, measure
from ..scene.robots import robot_named
from ..scene.scene import FINGERS, FIRST_OBJECT
from ..scene.scene_objects import SceneSpec
from ..simulation.render import Ghost
from ..simulation.simulation import Start
from ..simulation.state import State
from .arrangement import Arrangement
from .facts import own_facts
from .layout import JOINTS, TaskLayout, TaskLayouts
from .places import Range
from .rules import TaskProgress, task_rules
from .success import SceneView
from .task import Task

OPTIONS = ("level", "obstacles", "object_poses", "joint_positions")


class OwnTask(DeclaredTask):
    """A user's own task.

    Args:
        declared: the task as data.
        robot: name of the robot.
        arm: name of the arm at work; None: the robot's default arm.
    """

    def __init__(self, declared: Task, robot: str = "Panda", arm: str | None = None):
        if not isinstance(declared, Task):
            raise BadTask(declared, "", f"is a {type(declared).__name__}, not a Task")
        self.data, self.facts, self.name = declared, own_facts(declared), declared.name
        self.robot, self.robot_name = robot_named(robot), robot
        fixtures = tuple(each.furniture for each in declared.fixtures)
        self.things = SceneSpec(tuple(each.body for each in declared.objects), fixtures)
        self.goals, self.motions = len(declared.goals), 2 * len(declared.goals) + 1
        self.arms, self.rules = self.robot.checked_arms(arm), task_rules(declared)
        self.more: Mapping[str, Any] = {"furniture_pose": space.pose_box(len(fixtures))} if fixtures else {}
        bounds = (*POSE_BOUNDS, 1.0) * len(declared.goals)
        self.form = GoalForm(bounds, self.achieved_goal, self.desired_goal, self.agreement)

    def bind(self, world: World) -> None:
        """See `DeclaredTask`."""
        axis = world.arms[0].chain[0, CHAIN.offset : CHAIN.offset + 2]
        layouts = TaskLayouts(self.data, self.robot_name, axis, self.robot.reach)
        self.arrangement = Arrangement(layouts, world.sim)

    def described(self, description: TaskDescription) -> TaskDescription:
        """See `DeclaredTask`."""
        return replace(description, skill=self.data.skill)

    def begin(self, world: World, options: dict[str, Any], layout: str, *, spacious: bool) -> TaskEpisode:
        """See `DeclaredTask`."""
        check_known(options, OPTIONS)
        home, poses = world.sim.scene.home, None
        if "object_poses" in options:
            poses = checked_poses("object_poses", options["object_poses"], len(self.data.objects))
        drawn = self.arrangement.drawn(world.sim, world.rng, layout, poses)
        offsets = world.rng.uniform(-JOINTS[layout], JOINTS[layout], home.shape)
        joints = np.clip(home + offsets, [a.lower for a in world.arms], [a.upper for a in world.arms])
        if "joint_positions" in options:
            joints = checked_joints(options["joint_positions"], world.arms)
        constant = {"furniture_pose": drawn.fixtures} if self.data.fixtures else {}
        start = Start(joints, drawn.objects, drawn.fixtures)
        return TaskEpisode(start, drawn.goals, self._new_progress(drawn, world.dt), constant)

    def _new_progress(self, layout: TaskLayout, dt: float) -> TaskProgress:
        names, fixed = (tuple(each.name for each in part) for part in (self.data.objects, self.data.fixtures))
        fixtures = {name: Pose.from_vector(row) for name, row in zip(fixed, layout.fixtures, strict=True)}
        goals = {name: Pose.from_vector(row) for name, row in zip(self.data.goals, layout.goals, strict=True)}
        view = SceneView(names, fixtures, goals)
        return TaskProgress(self.data, view, self.rules, layout.goals, layout.objects, dt)

    def placement_motions(self, world: World, episode: TaskEpisode) -> list[PlacementMotion]:
        """See `DeclaredTask`."""
        start, objects, motions = episode.start, world.task.objects, []
        for g, (name, goal) in enumerate(zip(self.data.goals, episode.goals, strict=True)):
            thing, pose = self._thing(g), Pose.from_vector(start.objects[self._thing(g)])
            shape = objects[thing].shape
            holds = self.data.grasps.get(name)
            grasp = pose @ holds[0] if holds else grasp_from_above(corners_at(shape, pose))
            held = pose.inverse() @ grasp
            passing = [place @ held for place in self.arrangement.passed(name, start.objects, start.furniture)]
            motions.append(carry_motion(shape, pose, grasp, Pose.from_vector(goal) @ held, passing))
        if not motions:
            home, poses = world.arms[0].fk(start.joints[0]), zip(objects, start.objects, strict=True)
            motions = [reach_motion(home, corners_at(each.shape, Pose.from_vector(row))) for each, row in poses]
        return motions

    def _thing(self, goal: int) -> int:
        """Return the index of a goal's object."""
        return int(self.rules.rows[goal, GOAL.thing])

    def ghosts(self, episode: TaskEpisode) -> list[Ghost]:
        """Return the goals that are ranges on the table; at another thing, that thing is seen."""
        goals = zip(self.data.goals.values(), episode.goals, strict=True)
        free = [(g, Pose.from_vector(row)) for g, (where, row) in enumerate(goals) if isinstance(where, Range)]
        return [
            Ghost((goal @ part.pose).vector, part.shape)
            for g, goal in free
            for part in TaskObject.of(self.things.objects[self._thing(g)]).parts
            if not isinstance(part.shape, Mesh)
        ]

    def look(self, world: World, episode: TaskEpisode, state: State, seconds: float, *, shaped: bool) -> None:
        """See `DeclaredTask`."""
        assert isinstance(episode.progress, TaskProgress)
        episode.progress.view.see(state, world.sim, seconds)

    def achieved_goal(self, episode: TaskEpisode, state: State) -> np.ndarray:
        """Return (8 g,) the pose of each object with a goal, and 1 where it is released, else 0.

        Args:
            episode: the episode.
            state: the state.
        """
        rows = []
        for g in range(self.goals):
            thing = self._thing(g)
            released = state.touching[FINGERS, FIRST_OBJECT + thing] == 0.0
            rows.append(np.append(state.object_pose[thing], float(released)))
        return np.concatenate(rows)

    def desired_goal(self, episode: TaskEpisode) -> np.ndarray:
        """Return (8 g,) the goals, each with 1 for released."""
        return np.column_stack([episode.goals, np.ones(len(episode.goals))]).ravel()

    def agreement(self, achieved: np.ndarray, desired: np.ndarray) -> Agreement:
        """Return how well goals agree: all objects must be at their goals, the closeness is the mean of theirs.

        Args:
            achieved: (..., 8 g) achieved goals.
            desired: (..., 8 g) desired goals.
        """
        shape = (*np.shape(achieved)[:-1], self.goals, 8)
        are, wanted = np.broadcast_to(achieved, desired.shape).reshape(shape), np.asarray(desired).reshape(shape)
        flat = zip(are.reshape(-1, *shape[-2:]), wanted.reshape(-1, *shape[-2:]), strict=True)
        found = np.array([self._agreement(one, other) for one, other in flat]).reshape(*shape[:-2], 2)
        return Agreement(found[..., 0], found[..., 1] == 1.0)

    def _agreement(self, are: np.ndarray, wanted: np.ndarray) -> tuple[float, float]:
        """Return closeness and whether all goals (g, 8) are reached."""
        near, reached = [], True
        for row, one, goal in zip(self.rules.rows, are, wanted, strict=True):
            errors = np.zeros(MEASURE.width)
            measure(one[:7], goal[:7], row[GOAL.yaw_symmetry], errors)
            reached = reached and is_met(errors, row) and one[7] >= goal[7]
            far = float(np.hypot(errors[MEASURE.across], errors[MEASURE.along]))
            near.append(closeness(far, errors[MEASURE.angle]))
        return float(np.mean(near)), float(reached)


declared_env = EnvironmentMaker(OwnTask, **GOAL_FORM)
