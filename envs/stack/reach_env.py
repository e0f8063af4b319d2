"""Reaching: bringing the hand above a block."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...planner import Box, Pose, Sphere
from ...planner.robot.kinematics import CHAIN
from ..core.dense_reward import closeness
from ..core.placement_context import PlacementMotion
from ..core.reset_options import check_known, checked_joints, checked_poses
from ..core.single_motion import FREQUENCY, Agreement, SingleMotionEnv, gaps
from ..core.spaces import REACH
from ..scene.robots import robot_named
from ..scene.scene_objects import FreeBody, SceneSpec
from ..simulation.render import Ghost
from ..simulation.simulation import Start
from ..simulation.state import State
from .grasps import above, block_grasps, block_poses, check_places
from .layout import BASE_GAP, LONG_GAP, RANGES, stack_layout
from .reach_rules import MAX_ANGLE, MAX_OFFSET, ReachProgress
from .rules import BLOCK_SIZE
from .skill import REACH_SKILL

OPTIONS = ("level", "obstacles", "object_poses", "joint_positions")
HEIGHT = 0.08
"""Height of the hand's goal above the block's center [m]: the fingertips are clear of the block."""


class ReachEnv(SingleMotionEnv[ReachProgress]):
    """Bring the open hand above a block, ready to grasp it.

    ## Description
    A wooden block (60 x 40 x 50 mm) lies on a table. The hand's goal is 8 cm above the block's center, pointing
    straight down, with the fingers on both sides of its narrow axis; half a turn of the hand makes no difference.
    Success is judged from the simulator: the hand stays within 10 mm and 10 degrees of its goal for half a second.

    ## Action Space
    `Box(-1, 1, (7,), float64)` at 20 Hz; `(8,)` with `control_mode="joint_velocity"` for an arm of seven joints.

    | control mode | entry | meaning |
    |---|---|---|
    | `ee_twist` | 0 to 2 | velocity of the tcp in world axes as a fraction of 0.25 m/s |
    | `ee_twist` | 3 to 5 | angular velocity of the tcp in world axes as a fraction of 1.2 rad/s |
    | `joint_velocity` | 0 to 6 | joint speed as a fraction of the joint's limit |
    | both | last | gripper: above 0 closes it, below 0 opens it to that fraction of its width, 0 leaves it unchanged |

    ## Observation Space
    A `Dict` of float64 boxes; the first axis counts arms or objects. Poses are `x y z [m]`, then quaternion wxyz.

    | key | shape | meaning |
    |---|---|---|
    | `joint_positions` | (1, 7) | [rad] |
    | `joint_velocities` | (1, 7) | [rad/s] |
    | `tcp_pose` | (1, 7) | point between the finger pads; fingers close along its x, the hand points along its z |
    | `gripper_opening` | (1,) | gap between the finger pads [m] |
    | `object_pose` | (1, 7) | pose of the block |
    | `goal_pose` | (1, 7) | goal of the tcp; constant during an episode |
    | `motion_index` | (1,) | 1 while the hand is at its goal, else 0 |
    | `obstacle_active` | (3,) | 1 for a present obstacle; all entries of absent ones are 0 |
    | `obstacle_shape` | (3,) | 1 sphere, 2 box, 3 capsule |
    | `obstacle_size` | (3, 3) | box: extents; capsule: radius, radius, length of its segment; sphere: radius |
    | `obstacle_pose` | (3, 7) | poses of the obstacles |
    | `obstacle_velocity` | (3, 3) | velocities of their centers [m/s] |
    | `last_action` | that of the action | last action; zeros at the start |

    With `goal_form=True` the keys are `observation` (all of the above except `goal_pose` and `motion_index`, as one
    vector), `achieved_goal` and `desired_goal`
    (7,): pose and goal of the tcp; `reward="sparse"` is 1 within the tolerances.
    `compute_reward(achieved, desired, info)` accepts one goal or many. Stable-Baselines3's HER works with it.

    ## Rewards
    `reward="dense"` (default): in [0, 1], closeness of the hand to its goal, 1 once it has been there for half a
    second. `reward="sparse"`: 1 with success, else 0.

    ## Starting State
    By `level`: L0 the nominal place; L1 the block moved by up to 10 cm and turned by up to 30 degrees, start joints by
    up to 0.05 rad; L2 up to 20 cm, 120 degrees and 0.15 rad. L3, L4 and F are L2 with obstacles on the hand's path, see
    `onedemo/Stack-v0`. R, S and T start as L1 does.

    ## Episode End
    `terminated` never: the task can always succeed.
    `truncated` after 150 actions, 7.5 s at 20 Hz (Gymnasium's `TimeLimit`: give `max_episode_steps` with another
    `control_frequency`). A settled success ends the episode with
    `end_on_success=True`, the default of `reward="sparse"`; with dense rewards, which are never negative, an early end
    would pay less than waiting beside the goal, so there and in the goal form the episode continues.

    ## Info
    `is_success`, `success`, `safe` (no unwanted contact so far), `stage`, `failure_reason`, `collision`,
    `n_contacts` (steps with an obstacle touched), `min_obstacle_distance` [m], `layouts_refused`, `position_error`
    [m], `angle_error` [rad].

    ## Arguments
    `robot="Panda"` (Baxter and every robot of `onedemo/Stack-v0`), `level="L1"`, `obstacles=None` (those of the
    level) or `"none" | "static" | "appear" | "moving" | "unforeseen" | "forearm"`, `control_mode="ee_twist" |
    "joint_velocity"`, `reward="dense" | "sparse"`, `control_frequency=20` (10, 20, 25 or 50: any that divides 500),
    `goal_form=False`, `end_on_success=None`, `render_mode=None | "rgb_array" | "human"`, `arm=None`.
    `reset(options=...)` takes `level`, `obstacles`, `object_poses` (1, 7) and `joint_positions` (7,).

    ## Version History
    * v0: first version.
    """

    SKILL = REACH_SKILL
    GOAL_BOUNDS = (REACH, REACH, REACH, 1.0, 1.0, 1.0, 1.0)

    def __init__(
        self,
        robot: str = "Panda",
        level: str = "L1",
        obstacles: str | None = None,
        control_mode: str = "ee_twist",
        reward: str = "dense",
        control_frequency: int = FREQUENCY,
        goal_form: bool = False,
        end_on_success: bool | None = None,
        render_mode: str | None = None,
        arm: str | None = None,
    ):
        kind = robot_named(robot)
        super().__init__(
            name="reach",
            robot=kind,
            things=SceneSpec((FreeBody("block0", Box(BLOCK_SIZE), "WoodLight"),)),
            goals=1,
            motions=1,
            level=level,
            obstacles=obstacles,
            control_mode=control_mode,
            reward=reward,
            render_mode=render_mode,
            control_frequency=control_frequency,
            arms=kind.checked_arms(arm),
        )
        self._reach = kind.reach
        self._goal_pose = np.zeros((1, 7))
        self._take_form("reach", goal_form, end_on_success)

    def _start(self, options: dict[str, Any], layout: str, spacious: bool) -> Start:
        check_known(options, OPTIONS)
        home, axis = self.sim.scene.home, self.arms[0].chain[0, CHAIN.offset : CHAIN.offset + 2]
        gap = LONG_GAP if spacious and RANGES[layout].block else BASE_GAP
        drawn = stack_layout(self.np_random, RANGES[layout], 1, axis, home.shape, gap, self._reach)
        poses, base = block_poses(drawn)
        if "object_poses" in options:
            poses = checked_poses("object_poses", options["object_poses"], 1)
        check_places(poses, base)
        joints = np.clip(home + drawn.joints, self.arms[0].lower, self.arms[0].upper)
        if "joint_positions" in options:
            joints = checked_joints(options["joint_positions"], self.arms)
        goals = [above(grasp, HEIGHT) for grasp in block_grasps(poses[0])]
        self._goal_pose = goals[0].vector[None]
        self._progress = ReachProgress(np.array([goal.dq for goal in goals]), self.control_dt)
        return Start(joints, poses)

    def _placement_motions(self, start: Start) -> list[PlacementMotion]:
        """Return the motion from the start to above the block."""
        goals = tuple(above(grasp, HEIGHT) for grasp in block_grasps(start.objects[0]))
        fingertip = Sphere(0.005)
        return [
            PlacementMotion(self.arms[0].fk(start.joints[0]), goals[0], (goals,), fingertip, Pose.identity(), motion=0)
        ]

    def _ghosts(self) -> list[Ghost]:
        return [Ghost(pose, Sphere(0.012)) for pose in self._goal_pose]

    def achieved_goal(self, state: State) -> np.ndarray:
        """See `SingleMotionEnv`: (7,) pose of the tcp."""
        return state.tcp_pose[0].copy()

    def desired_goal(self) -> np.ndarray:
        """See `SingleMotionEnv`: (7,) goal pose of the tcp."""
        return self._goal_pose[0].copy()

    def agreement(self, achieved: np.ndarray, desired: np.ndarray) -> Agreement:
        """See `SingleMotionEnv`: poses of the tcp up to half turns of the hand."""
        distance, angle = gaps(achieved, desired, half_turns=True)
        return Agreement(closeness(distance, angle), (distance <= MAX_OFFSET) & (angle <= MAX_ANGLE))
