"""Environment of users' own tasks."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ...planner import Mesh, Pose
from ...planner.errors import BadOption
from ...planner.robot.kinematics import CHAIN
from ..core import spaces as space
from ..core.carries import carry_motion, corners_at, grasp_from_above, reach_motion
from ..core.description import TaskDescription
from ..core.environment import Observation
from ..core.placement_context import PlacementMotion
from ..core.reset_options import check_known, checked_joints, checked_poses
from ..core.single_motion import Agreement, SingleMotionEnv
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
from .task import FREQUENCY, Task

OPTIONS = ("level", "obstacles", "object_poses", "joint_positions")


class DeclaredEnv(SingleMotionEnv[TaskProgress]):
    """A user's own task, declared as data."""

    def __init__(
        self,
        declared: Task,
        robot: str = "Panda",
        level: str = "L1",
        obstacles: str | None = None,
        control_mode: str = "joint_velocity",
        reward: str = "sparse",
        control_frequency: int = FREQUENCY,
        goal_form: bool = False,
        end_on_success: bool | None = None,
        render_mode: str | None = None,
        arm: str | None = None,
    ):
        if not isinstance(declared, Task):
            raise BadTask(declared, "", f"is a {type(declared).__name__}, not a Task")
        self.declared, self.FACTS, kind = declared, own_facts(declared), robot_named(robot)
        fixtures = tuple(each.furniture for each in declared.fixtures)
        if goal_form and not declared.goals:
            raise BadOption("goal_form", f"{declared.name} has no goals: success is only a condition")
        super().__init__(
            name=declared.name,
            robot=kind,
            things=SceneSpec(tuple(each.body for each in declared.objects), fixtures),
            goals=len(declared.goals),
            motions=2 * len(declared.goals) + 1,
            level=level,
            obstacles=obstacles,
            control_mode=control_mode,
            reward=reward,
            render_mode=render_mode,
            control_frequency=control_frequency,
            arms=kind.checked_arms(arm),
            more={"furniture_pose": space.pose_box(len(fixtures))} if fixtures else {},
        )
        axis = self.arms[0].chain[0, CHAIN.offset : CHAIN.offset + 2]
        self._arrangement = Arrangement(TaskLayouts(declared, robot, axis, kind.reach), self.sim)
        self._rules = task_rules(declared)
        self.GOAL_BOUNDS = (*(space.REACH,) * 3, *(1.0,) * 5) * len(declared.goals)
        self._take_form(declared.name, goal_form, end_on_success)
        layout = self._arrangement.nominal
        self._fixtures, self._goal_pose = layout.fixtures, layout.goals
        self._progress = self._new_progress(layout)

    def _described(self, name: str, things: SceneSpec) -> TaskDescription:
        return replace(super()._described(name, things), skill=self.declared.skill)

    def _new_progress(self, layout: TaskLayout) -> TaskProgress:
        names = tuple(each.name for each in self.declared.objects)
        fixed = [each.name for each in self.declared.fixtures]
        fixtures = {name: Pose.from_vector(row) for name, row in zip(fixed, layout.fixtures, strict=True)}
        goals = {name: Pose.from_vector(row) for name, row in zip(self.declared.goals, layout.goals, strict=True)}
        view = SceneView(names, fixtures, goals)
        return TaskProgress(self.declared, view, self._rules, layout.goals, layout.objects, self.control_dt)

    def _start(self, options: dict[str, Any], layout: str, spacious: bool) -> Start:
        check_known(options, OPTIONS)
        home, poses = self.sim.scene.home, None
        if "object_poses" in options:
            poses = checked_poses("object_poses", options["object_poses"], len(self.declared.objects))
        drawn = self._arrangement.drawn(self.sim, self.np_random, layout, poses)
        offsets = self.np_random.uniform(-JOINTS[layout], JOINTS[layout], home.shape)
        joints = np.clip(home + offsets, [a.lower for a in self.arms], [a.upper for a in self.arms])
        if "joint_positions" in options:
            joints = checked_joints(options["joint_positions"], self.arms)
        self._fixtures, self._goal_pose = drawn.fixtures, drawn.goals
        self._progress = self._new_progress(drawn)
        return Start(joints, drawn.objects, drawn.fixtures)

    def _placement_motions(self, start: Start) -> list[PlacementMotion]:
        home, motions = self.arms[0].fk(start.joints[0]), []
        for g, (name, goal) in enumerate(zip(self.declared.goals, self._goal_pose, strict=True)):
            thing, pose = self._thing(g), Pose.from_vector(start.objects[self._thing(g)])
            shape = self.task.objects[thing].shape
            holds = self.declared.grasps.get(name)
            grasp = pose @ holds[0] if holds else grasp_from_above(corners_at(shape, pose))
            held = pose.inverse() @ grasp
            passing = [place @ held for place in self._arrangement.passed(name, start.objects, start.furniture)]
            motions.append(carry_motion(shape, pose, grasp, Pose.from_vector(goal) @ held, passing))
        if not motions:
            poses = zip(self.task.objects, start.objects, strict=True)
            motions = [reach_motion(home, corners_at(each.shape, Pose.from_vector(row))) for each, row in poses]
        return motions

    def _thing(self, goal: int) -> int:
        """Return the index of a goal's object."""
        return int(self._rules.rows[goal, GOAL.thing])

    def _ghosts(self) -> list[Ghost]:
        """Return the goals that are ranges on the table; at another thing, that thing is seen."""
        goals = zip(self.declared.goals.values(), self._goal_pose, strict=True)
        free = [(g, Pose.from_vector(row)) for g, (where, row) in enumerate(goals) if isinstance(where, Range)]
        return [
            Ghost((goal @ part.pose).vector, part.shape)
            for g, goal in free
            for part in self.task.objects[self._thing(g)].parts
            if not isinstance(part.shape, Mesh)
        ]

    def achieved_goal(self, state: State) -> np.ndarray:
        """See `SingleMotionEnv`."""
        rows = []
        for g in range(len(self.declared.goals)):
            thing = self._thing(g)
            released = state.touching[FINGERS, FIRST_OBJECT + thing] == 0.0
            rows.append(np.append(state.object_pose[thing], float(released)))
        return np.concatenate(rows)

    def desired_goal(self) -> np.ndarray:
        """See `SingleMotionEnv`."""
        return np.column_stack([self._goal_pose, np.ones(len(self._goal_pose))]).ravel()

    def agreement(self, achieved: np.ndarray, desired: np.ndarray) -> Agreement:
        """See `SingleMotionEnv`; all objects must be at their goals, the closeness is the mean of theirs."""
        shape = (*np.shape(achieved)[:-1], len(self.declared.goals), 8)
        are, wanted = np.broadcast_to(achieved, desired.shape).reshape(shape), np.asarray(desired).reshape(shape)
        flat = zip(are.reshape(-1, *shape[-2:]), wanted.reshape(-1, *shape[-2:]), strict=True)
        found = np.array([self._agreement(one, other) for one, other in flat]).reshape(*shape[:-2], 2)
        return Agreement(found[..., 0], found[..., 1] == 1.0)

    def _agreement(self, are: np.ndarray, wanted: np.ndarray) -> tuple[float, float]:
        """Return closeness and whether all goals (g, 8) are reached."""
        near, reached = [], True
        for row, one, goal in zip(self._rules.rows, are, wanted, strict=True):
            errors = np.zeros(MEASURE.width)
            measure(one[:7], goal[:7], row[GOAL.yaw_symmetry], errors)
            reached = reached and is_met(errors, row) and one[7] >= goal[7]
            far = float(np.hypot(errors[MEASURE.across], errors[MEASURE.along]))
            near.append(closeness(far, errors[MEASURE.angle]))
        return float(np.mean(near)), float(reached)

    def _judge(self, state: State) -> tuple[float, bool, dict[str, Any]]:
        self._progress.view.see(state, self.sim, self._steps * self.control_dt)
        return super()._judge(state)

    def _more_observed(self, state: State) -> Observation:
        fixtures = {"furniture_pose": self._fixtures.copy()} if self.declared.fixtures else {}
        return {**super()._more_observed(state), **fixtures}
