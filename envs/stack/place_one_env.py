"""Placing one block that is in the hand."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...planner.errors import BadOption
from ..core.dense_reward import closeness, placing
from ..core.grasped_start import SQUEEZE, holding_joints
from ..core.placement_context import PlacementMotion
from ..core.reset_options import checked_choice, checked_joints, checked_poses
from ..core.single_motion import FREQUENCY, Agreement, SingleMotionEnv, gaps
from ..core.spaces import REACH
from ..simulation.simulation import Start
from ..simulation.state import State
from .grasps import block_grasps
from .rules import BLOCK, MAX_HEIGHT, MAX_OFFSET, MAX_YAW, WITHDRAWN, StackProgress
from .stack_env import StackEnv

ONTO = ("table", "block")
HELD = {"L0": (0.12, 0.12), "L1": (0.08, 0.16), "L2": (0.06, 0.20)}
"""Range of the held block's height above the table [m], by layout name."""
UP = 0.008
"""Height of the hand above the center of a block held from the start [m]: people grasp blocks by the upper half."""
MAX_STARTS = 200


class PlaceProgress(StackProgress):
    """Progress of placing the last block, which may be in the hand from the start."""

    def reward(self, state: State) -> float:
        """See `Progress`."""
        pose, goal, tcp = state.object_pose[-1], self._goals[-1], state.tcp_pose[0]
        distance, angle = gaps(pose, goal, half_turns=True)
        reach = float(np.linalg.norm(pose[:3] - tcp[:3]))
        away = min(1.0, reach / WITHDRAWN)
        return float(placing(reach, float(distance), float(angle), self.held, self.placed == self.n_blocks, away))


class PlaceOneEnv(SingleMotionEnv[StackProgress], StackEnv):
    """Put the block in the hand at its goal, on the table or on another block.

    ## Description
    A wooden block (60 x 40 x 50 mm, 72 g) is in the hand, held only by friction between the fingers. It must be put at
    its goal and released, and the hand withdrawn by 5 cm. Success is judged from the simulator as in
    `onedemo/Stack-v0`: for half a second the block is within 10 mm horizontally, 10 degrees of yaw (a block looks the
    same after half a turn) and 5 mm in height of its goal, touched by no finger and at rest.

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
    | `object_pose` | (n, 7) | with `onto="block"` the block already in place, then the one to place |
    | `goal_pose` | (n, 7) | goal of each block; constant during an episode |
    | `motion_index` | (1,) | 2k while block k is to be fetched, 2k + 1 while it is held, 2n when all are placed |
    | `obstacle_active` | (3,) | 1 for a present obstacle; all entries of absent ones are 0 |
    | `obstacle_shape` | (3,) | 1 sphere, 2 box, 3 capsule |
    | `obstacle_size` | (3, 3) | box: extents; capsule: radius, radius, length of its segment; sphere: radius |
    | `obstacle_pose` | (3, 7) | poses of the obstacles |
    | `obstacle_velocity` | (3, 3) | velocities of their centers [m/s] |
    | `last_action` | that of the action | last action; zeros at the start |

    With `goal_form=True` the keys are `observation` (all of the above except `goal_pose` and `motion_index`, as one
    vector), `achieved_goal` and `desired_goal`
    (8,): pose of the block, and 1 once it is released and the hand is 5 cm away, else 0; its goal and 1.
    `compute_reward(achieved, desired, info)` accepts one goal or many. Stable-Baselines3's HER works with it.

    ## Rewards
    `reward="dense"` (default): in [0, 1]: up to 0.75 for bringing the held block to its goal, from 0.75 to 1 for
    withdrawing once it stands there. `reward="sparse"`: 1 with success, else 0.

    ## Starting State
    By `level`: L0 the nominal place; L1 the block moved by up to 10 cm and turned by up to 30 degrees, its goal by up
    to 5 cm and 30 degrees, held 8 to 16 cm above the table; L2 up to 20 cm, 10 cm, 120 degrees, 6 to 20 cm. L3, L4 and
    F are L2 with obstacles on the block's path, see `onedemo/Stack-v0`. R, S and T start as L1 does. With
    `pregrasped=False` the block stands on the table and the hand is at its ready posture; give `max_episode_steps=300`.

    ## Episode End
    `terminated` when a block has fallen off the table.
    `truncated` after 150 actions, 7.5 s at 20 Hz (Gymnasium's `TimeLimit`: give `max_episode_steps` with another
    `control_frequency`). A settled success ends the episode with
    `end_on_success=True`, the default of `reward="sparse"`; with dense rewards, which are never negative, an early end
    would pay less than waiting beside the goal, so there and in the goal form the episode continues.

    ## Info
    `is_success`, `success`, `safe` (no unwanted contact so far), `stage`, `failure_reason`, `collision`,
    `n_contacts` (steps with an obstacle touched), `min_obstacle_distance` [m], `layouts_refused`, `blocks_placed`,
    `position_error` (n,) [m], `yaw_error` (n,) [rad].

    ## Arguments
    `robot="Panda"` (Baxter and every robot of `onedemo/Stack-v0`), `onto="table" | "block"`, `pregrasped=True`,
    `level="L1"`, `obstacles=None` (those of the level) or `"none" | "static" | "appear" | "moving" | "unforeseen" |
    "forearm"`, `control_mode="ee_twist" | "joint_velocity"`, `reward="dense" | "sparse"`, `control_frequency=20` (10,
    20, 25 or 50: any that divides 500), `goal_form=False`, `end_on_success=None`, `render_mode=None | "rgb_array" |
    "human"`, `arm=None`. `reset(options=...)` takes `level`, `obstacles`, `object_poses` (n, 7; a block in the hand
    is held there), `base_pose` (7,) of the lowest goal, and `joint_positions` (7,), which a block in the hand
    follows.

    ## Version History
    * v0: first version.
    """

    GOAL_BOUNDS = (REACH, REACH, REACH, 1.0, 1.0, 1.0, 1.0, 1.0)

    def __init__(
        self,
        robot: str = "Panda",
        onto: str = "table",
        pregrasped: bool = True,
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
        if not isinstance(pregrasped, bool):
            raise BadOption("pregrasped", f"{pregrasped!r} is neither True nor False")
        self.onto, self.pregrasped = checked_choice("onto", onto, ONTO), pregrasped
        super().__init__(
            robot=robot,
            n_blocks=1 + (onto == "block"),
            level=level,
            obstacles=obstacles,
            control_mode=control_mode,
            reward=reward,
            control_frequency=control_frequency,
            render_mode=render_mode,
            arm=arm,
        )
        self._progress = PlaceProgress(self._goal_pose, self._goal_pose, self.control_dt)
        self._take_form("place_one", goal_form, end_on_success)

    def _start(self, options: dict[str, Any], layout: str, spacious: bool) -> Start:
        """Return a start as in stacking, with the lower block at its place and the other one in the hand."""
        for _ in range(MAX_STARTS):
            start = super()._start(options, layout, spacious)
            poses, grips, joints = start.objects.copy(), None, start.joints
            poses[:-1] = self._goal_pose[:-1]
            if self.pregrasped:
                grips = np.array([BLOCK - SQUEEZE])
                found = self._in_hand(options, layout, poses, joints)
                if found is None:
                    continue
                joints = found
            self._progress = PlaceProgress(self._goal_pose, start.objects, self.control_dt, in_hand=self.pregrasped)
            return Start(joints, poses, grips=grips)
        raise BadOption("object_poses", "the hand cannot hold the block there")

    def _in_hand(
        self, options: dict[str, Any], layout: str, poses: np.ndarray, joints: np.ndarray
    ) -> np.ndarray | None:
        """Return joints (1, dof) that hold the last of the blocks (n, 7), updating its pose; None if no joints do."""
        arm = self.arms[0]
        if "joint_positions" in options:
            hand = arm.fk(checked_joints(options["joint_positions"], self.arms)[0])
            origin = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
            poses[-1] = (hand @ block_grasps(origin, UP)[0].inverse()).vector
            return checked_joints(options["joint_positions"], self.arms)
        if "object_poses" in options:
            poses[-1] = checked_poses("object_poses", options["object_poses"], self.n_blocks)[-1]
        else:
            poses[-1, 2] += self.np_random.uniform(*HELD[layout])
        q = holding_joints(arm, block_grasps(poses[-1], UP), joints[0])
        return None if q is None else q[None]

    def _placement_motions(self, start: Start) -> list[PlacementMotion]:
        return super()._placement_motions(start)[-1:]

    def achieved_goal(self, state: State) -> np.ndarray:
        """See `SingleMotionEnv`: (8,) pose of the block, and 1 once it is released and the hand is away, else 0."""
        pose = state.object_pose[-1]
        away = float(np.linalg.norm(pose[:3] - state.tcp_pose[0, :3])) >= WITHDRAWN
        return np.append(pose, float(away and not self._progress.held))

    def desired_goal(self) -> np.ndarray:
        """See `SingleMotionEnv`: (8,) place of the block, and 1 for released."""
        return np.append(self._goal_pose[-1], 1.0)

    def agreement(self, achieved: np.ndarray, desired: np.ndarray) -> Agreement:
        """See `SingleMotionEnv`: poses of the block up to half turns, released in both goals or in neither."""
        distance, angle = gaps(achieved, desired, half_turns=True)
        away = np.abs(achieved - desired)
        aside = np.hypot(away[..., 0], away[..., 1])
        there = (aside <= MAX_OFFSET) & (away[..., 2] <= MAX_HEIGHT) & (angle <= MAX_YAW)
        return Agreement(closeness(distance, angle), there & (away[..., 7] < 0.5))
