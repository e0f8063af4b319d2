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
from ..core.dense_reward import closeness
from ..core.description import TaskDescription
from ..core.environment import Observation
from ..core.placement_context import PlacementMotion
from ..core.reset_options import check_known, checked_joints, checked_poses
from ..core.single_motion import Agreement, SingleMotionEnv
from ..errors import BadTask
from ..scene.robots import robot_named
from ..scene.scene import FINGERS, FIRST_OBJECT
from ..scene.scene_objects import SceneSpec
from ..simulation.render import Ghost
from ..simulation.simulation import Start
from ..simulation.state import State
from .arrangement import Arrangement
from .judge import GOAL, angle_between, offsets
from .layout import JOINTS, TaskLayout, TaskLayouts
from .places import Range
from .rules import TaskProgress, goal_rows
from .success import SceneView
from .task import FREQUENCY, Task

OPTIONS = ("level", "obstacles", "object_poses", "joint_positions")


class DeclaredEnv(SingleMotionEnv[TaskProgress]):
    """A user's own task, declared as data.

    ## Description
    See the task's own summary. Success is judged from the simulator: for `Success.seconds` every object with a goal is
    within its tolerance, touched by no finger and at rest, the hand has withdrawn, and the task's own condition holds.

    ## Action Space
    `Box(-1, 1, (8,), float64)` for an arm of seven joints, at 50 Hz; `(7,)` with `control_mode="ee_twist"`.

    | control mode | entry | meaning |
    |---|---|---|
    | `joint_velocity` | 0 to 6 | joint speed as a fraction of the joint's limit |
    | `ee_twist` | 0 to 2 | velocity of the tcp in world axes as a fraction of 0.25 m/s |
    | `ee_twist` | 3 to 5 | angular velocity of the tcp in world axes as a fraction of 1.2 rad/s |
    | both | last | gripper: above 0 closes it, below 0 opens it to that fraction of its width, 0 leaves it unchanged |

    ## Observation Space
    A `Dict` of float64 boxes; the first axis counts arms or things. Poses are `x y z [m]`, then quaternion wxyz.

    | key | shape | meaning |
    |---|---|---|
    | `joint_positions` | (1, 7) | [rad] |
    | `joint_velocities` | (1, 7) | [rad/s] |
    | `tcp_pose` | (1, 7) | point between the finger pads; fingers close along its x, the hand points along its z |
    | `gripper_opening` | (1,) | gap between the finger pads [m] |
    | `object_pose` | (n, 7) | poses of the objects |
    | `goal_pose` | (g, 7) | goals, in the order of the task; constant during an episode |
    | `motion_index` | (1,) | 2k while k objects are in place, 2k + 1 while the fingers touch an object |
    | `furniture_pose` | (m, 7) | poses of the fixtures; only where there are any |
    | `obstacle_active` | (3,) | 1 for a present obstacle; all entries of absent ones are 0 |
    | `obstacle_shape` | (3,) | 1 sphere, 2 box, 3 capsule |
    | `obstacle_size` | (3, 3) | box: extents; capsule: radius, radius, length of its segment; sphere: radius |
    | `obstacle_pose` | (3, 7) | poses of the obstacles |
    | `obstacle_velocity` | (3, 3) | velocities of their centers [m/s] |
    | `last_action` | that of the action | last action; zeros at the start |

    With `goal_form=True` the keys are `observation` (all of the above except `goal_pose` and `motion_index`, as one
    vector), `achieved_goal` and `desired_goal` (8 g,): pose of each object with a goal, and 1 where it is released,
    else 0; its goal and 1. A task without goals has no goal form.

    ## Rewards
    `reward="sparse"` (default): 1 with success, else 0. `reward="dense"`: in [0, 1], mean over the goals: up to 0.75
    for bringing the object there, from 0.75 to 1 for withdrawing; without goals it is that of success.

    ## Starting State
    By `level`: L0 the nominal layout; L1 and L2 things and goals moved as the task's ranges say. L3, L4 and F are L2
    with obstacles on the way of the objects, see `onedemo/Stack-v0`. R, S and T start as L1 does.

    ## Episode End
    `terminated` with a settled success (with sparse rewards, or `end_on_success=True`), when an object has fallen off
    the table, or when one of the task's conditions of failure holds. `truncated` after the task's time limit.

    ## Info
    `is_success`, `success`, `safe` (so far an obstacle was touched by neither robot nor object, and nothing else by a
    link of the arm), `stage`, `failure_reason`, `collision`, `n_contacts`, `min_obstacle_distance` [m],
    `layouts_refused`, `placed`, `position_error` (g,) [m], `angle_error` (g,) [rad], and the task's own numbers.

    ## Arguments
    `robot="Panda"` (any, with one arm at work), `level="L1"`, `obstacles=None` (those of the level) or `"none" |
    "static" | "appear" | "moving" | "unforeseen" | "forearm"`, `control_mode="joint_velocity" | "ee_twist"`,
    `reward="sparse" | "dense"`, `control_frequency=50`, `goal_form=False`, `end_on_success=None`,
    `render_mode=None | "rgb_array" | "human"`, `arm=None`. `reset(options=...)` takes `level`, `obstacles`,
    `object_poses` (n, 7) and `joint_positions` (7,).

    ## Version History
    * v0: first version.
    """

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
        self.declared, kind = declared, robot_named(robot)
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
        self._rows = goal_rows(declared)
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
        return TaskProgress(self.declared, view, self._rows, layout.goals, layout.objects, self.control_dt)

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
        return int(self._rows[goal, GOAL.thing])

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
        for row, one, goal in zip(self._rows, are, wanted, strict=True):
            across, along = offsets(one, goal)
            angle = angle_between(one, goal, row[GOAL.yaw_symmetry])
            there = across <= row[GOAL.xy] and along <= row[GOAL.z] and angle <= row[GOAL.angle]
            reached = reached and there and one[7] >= goal[7]
            near.append(closeness(float(np.hypot(across, along)), angle))
        return float(np.mean(near)), float(reached)

    def _judge(self, state: State) -> tuple[float, bool, dict[str, Any]]:
        self._progress.view.see(state, self.sim, self._steps * self.control_dt)
        return super()._judge(state)

    def _more_observed(self, state: State) -> Observation:
        fixtures = {"furniture_pose": self._fixtures.copy()} if self.declared.fixtures else {}
        return {**super()._more_observed(state), **fixtures}
