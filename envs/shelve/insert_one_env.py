"""Inserting one book that is in the hand."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...planner import Pose
from ...planner.errors import BadOption
from ..core.dense_reward import closeness, placing
from ..core.grasped_start import SQUEEZE, can_follow, holding_joints
from ..core.single_motion import FREQUENCY, Agreement, SingleMotionEnv, gaps
from ..core.spaces import REACH
from ..simulation.simulation import Start
from ..simulation.state import State
from .parts import BOOK_SIZE
from .rules import MAX_ANGLE, MAX_OFFSET, WITHDRAWN, ShelveProgress
from .shelve_env import GRASP, INSERTION_DEPTH, ShelveEnv

ASIDE, TURN = {"L0": 0.0, "L1": 0.01, "L2": 0.02}, {"L0": 0.0, "L1": np.deg2rad(3.0), "L2": np.deg2rad(6.0)}
"""Largest shift [m] in x, y and z and largest turn [rad] of the held book, by layout name."""
INSERTION_STEPS = (0.75, 0.5, 0.25, 0.0)
"""Shares of the insertion distance at which a posture must be reachable from the start."""
MAX_STARTS = 200


class InsertProgress(ShelveProgress):
    """Progress of inserting one book that is in the hand from the start."""

    def reward(self, state: State) -> float:
        """See `Progress`."""
        pose, goal, tcp = state.object_pose[0], self._goals[0], state.tcp_pose[0]
        distance, angle = gaps(pose, goal, half_turns=False)
        reach = float(np.linalg.norm(pose[:3] - tcp[:3]))
        away = min(1.0, reach / WITHDRAWN)
        return float(placing(reach, float(distance), float(angle), self.held, self.placed == 1, away))


class InsertOneEnv(SingleMotionEnv[ShelveProgress], ShelveEnv):
    """Insert the book in the hand into its slot.

    ## Description
    A book (160 x 220 x 35 mm, 0.3 kg) is in the hand, upright, spine to the hand, 22 cm in front of its slot in a
    cluttered cupboard, held only by friction between the fingers. It must be inserted and released, and the hand
    withdrawn by 15 cm. Success is judged from the simulator as in `onedemo/Shelve-v0`: for half a second the book is
    within 10 mm and 5 degrees of its slot, touched by no finger and at rest, and no clutter book was moved by more than
    5 cm or turned by more than 15 degrees.

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
    | `object_pose` | (6, 7) | the book, then the clutter; a book's x points away from its spine, z along it |
    | `goal_pose` | (1, 7) | goal of the book; constant during an episode |
    | `furniture_pose` | (3, 7) | cupboard, stand and the stand's foot; constant during an episode |
    | `motion_index` | (1,) | 1 while the book is held, 0 while it is not, 2 when it is shelved |
    | `obstacle_active` | (3,) | 0: there is no obstacle |
    | `obstacle_shape` | (3,) | 0 |
    | `obstacle_size` | (3, 3) | 0 |
    | `obstacle_pose` | (3, 7) | 0 |
    | `obstacle_velocity` | (3, 3) | 0 |
    | `last_action` | that of the action | last action; zeros at the start |

    With `goal_form=True` the keys are `observation` (all of the above except `goal_pose` and `motion_index`, as one
    vector), `achieved_goal` and `desired_goal`
    (8,): pose of the book, and 1 once it is released and the hand is 15 cm away, else 0; its slot and 1.
    `compute_reward(achieved, desired, info)` accepts one goal or many. Stable-Baselines3's HER works with it.

    ## Rewards
    `reward="dense"` (default): in [0, 1]: up to 0.75 for bringing the held book into its slot, from 0.75 to 1 for
    withdrawing once it stands there. `reward="sparse"`: 1 with success, else 0.

    ## Starting State
    By `level`: cupboard and clutter as in `onedemo/Shelve-v0`; the book moved by up to 1 cm and 3 degrees (L1) or 2 cm
    and 6 degrees (L2) about the vertical. L0 is the nominal place; R, S and T start as L1 does. The motion is too
    short for obstacles: L3, L4 and F do not exist.

    ## Episode End
    `terminated` when a book has fallen off the table.
    `truncated` after 150 actions, 7.5 s at 20 Hz (Gymnasium's `TimeLimit`: give `max_episode_steps` with another
    `control_frequency`). A settled success ends the episode with
    `end_on_success=True`, the default of `reward="sparse"`; with dense rewards, which are never negative, an early end
    would pay less than waiting beside the goal, so there and in the goal form the episode continues.

    ## Info
    `is_success`, `success`, `safe` (no unwanted contact so far), `stage`, `failure_reason`, `collision`,
    `n_contacts`, `min_obstacle_distance` [m], `layouts_refused`, `books_placed`, `position_error` (1,) [m],
    `angle_error` (1,) [rad], `clutter_pushed_over`.

    ## Arguments
    `robot="Panda"` (Baxter and every robot of `onedemo/Shelve-v0`), `shelf="upper" | "lower"`, `level="L1"`,
    `obstacles=None` or `"none"`, `control_mode="ee_twist" | "joint_velocity"`, `reward="dense" | "sparse"`,
    `control_frequency=20` (10, 20, 25 or 50: any that divides 500), `goal_form=False`, `end_on_success=None`,
    `render_mode=None | "rgb_array" | "human"`. `reset(options=...)` takes `level`, `cupboard_pose` (7,), `slots` (shift
    along the shelf [m]), `clutter` (5, 2: gaps [m] from neighbor or wall, and from the front) and `joint_positions`
    (7,), which the book follows.

    ## Version History
    * v0: first version.
    """

    GOAL_BOUNDS = (REACH, REACH, REACH, 1.0, 1.0, 1.0, 1.0, 1.0)

    def __init__(
        self,
        robot: str = "Panda",
        shelf: str = "upper",
        level: str = "L1",
        obstacles: str | None = None,
        control_mode: str = "ee_twist",
        reward: str = "dense",
        control_frequency: int = FREQUENCY,
        goal_form: bool = False,
        end_on_success: bool | None = None,
        render_mode: str | None = None,
    ):
        super().__init__(
            robot=robot,
            n_books=1,
            shelf=shelf,
            level=level,
            obstacles=obstacles,
            control_mode=control_mode,
            reward=reward,
            control_frequency=control_frequency,
            render_mode=render_mode,
        )
        self._take_form("insert_one", goal_form, end_on_success, obstacles=False)

    def _start(self, options: dict[str, Any], layout: str, spacious: bool) -> Start:
        """Return a start with cupboard and clutter as in shelving, and the book in the hand in front of its slot."""
        for _ in range(MAX_STARTS):
            start = super()._start(options, layout, spacious)
            joints = self._before_slot(layout) if "joint_positions" not in options else start.joints
            if joints is None:
                continue
            poses = start.objects.copy()
            poses[0] = (self.arms[0].fk(joints[0]) @ GRASP.inverse()).vector
            self._progress = InsertProgress(self._goal_pose, poses, self.control_dt, in_hand=True)
            return Start(joints, poses, start.furniture, grips=np.array([BOOK_SIZE[1] - SQUEEZE]))
        raise BadOption("cupboard_pose", "the hand cannot be before the slot, or not go straight in from there")

    def _before_slot(self, layout: str) -> np.ndarray | None:
        """Return joints (1, dof) that hold the book in front of its slot and can insert it straight, or None."""
        release = Pose.from_vector(self._goal_pose[0]) @ GRASP
        back = [
            release @ Pose.from_position_quaternion([0.0, 0.0, -part * INSERTION_DEPTH])
            for part in (1.0, *INSERTION_STEPS)
        ]
        aside, turn = ASIDE[layout], TURN[layout]
        shift = self.np_random.uniform(-aside, aside, 3)
        book = back[0] @ GRASP.inverse() @ Pose.from_yaw([0, 0, 0], self.np_random.uniform(-turn, turn))
        hand = Pose.from_position_quaternion(shift) @ book @ GRASP
        q = holding_joints(self.arms[0], [hand], self._ready[0])
        return q[None] if q is not None and can_follow(self.arms[0], q, back[1:]) else None

    def achieved_goal(self, state: State) -> np.ndarray:
        """See `SingleMotionEnv`: (8,) pose of the book, and 1 once it is released and the hand is away, else 0."""
        pose = state.object_pose[0]
        away = float(np.linalg.norm(pose[:3] - state.tcp_pose[0, :3])) >= WITHDRAWN
        return np.append(pose, float(away and not self._progress.held))

    def desired_goal(self) -> np.ndarray:
        """See `SingleMotionEnv`: (8,) slot of the book, and 1 for released."""
        return np.append(self._goal_pose[0], 1.0)

    def agreement(self, achieved: np.ndarray, desired: np.ndarray) -> Agreement:
        """See `SingleMotionEnv`: poses of the book, released in both goals or in neither."""
        distance, angle = gaps(achieved, desired, half_turns=False)
        free = np.abs(achieved[..., 7] - desired[..., 7]) < 0.5
        there = (distance <= MAX_OFFSET) & (angle <= MAX_ANGLE)
        return Agreement(closeness(distance, angle), there & free)
