"""Stacking wooden blocks."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...planner import Box, Pose
from ...planner.errors import BadOption
from ...planner.robot.kinematics import CHAIN
from ..core.environment import TaskEnv
from ..core.placement_context import ObstacleRequest, PlacementMotion
from ..core.reset_options import check_known, checked_joints, checked_poses
from ..scene.robots import robot_named
from ..scene.scene_objects import FreeBody, SceneSpec
from ..simulation.render import Ghost
from ..simulation.simulation import Start
from .grasps import above, block_grasps, block_poses, check_places
from .layout import BASE_GAP, LONG_GAP, RANGES, stack_layout
from .rules import BLOCK, BLOCK_SIZE, StackProgress
from .skill import STACK_SKILL

TEXTURES = ("WoodLight", "WoodRed", "WoodGreen", "WoodBlue", "WoodDark", "WoodLight")
OPTIONS = ("level", "obstacles", "object_poses", "base_pose", "joint_positions")
RAISED = 0.10
"""Height [m] of the hand above a grasp or a goal at the ends of a carry."""
ABOVE = (0.0, 0.04, 0.08)
"""Heights [m] above grasps and goals at which the hand must have clearance from obstacles."""
PAPER_SPEED = 0.1
"""Peak speed of the obstacle that swings in front of the last block [m/s]."""


class StackEnv(TaskEnv[StackProgress]):
    """Stack wooden blocks at a given place, in order, with one arm.

    ## Description
    Wooden blocks (60 x 40 x 50 mm, 72 g) lie on a table. Block 0 must be put at the base place, block 1 onto it,
    and so on. Only friction holds them between the fingers. Success is judged from the simulator: for half a second
    every block is within 10 mm horizontally, 10 degrees of yaw (a block looks the same after half a turn) and 5 mm
    in height of its goal, touched by no finger and at rest, and the hand has withdrawn by 5 cm.

    ## Action Space
    `Box(-1, 1, (8,), float64)` for an arm of seven joints, at 50 Hz; `(7,)` with `control_mode="ee_twist"`.

    | control mode | entry | meaning |
    |---|---|---|
    | `joint_velocity` | 0 to 6 | joint speed as a fraction of the joint's limit |
    | `ee_twist` | 0 to 2 | velocity of the tcp in world axes as a fraction of 0.25 m/s |
    | `ee_twist` | 3 to 5 | angular velocity of the tcp in world axes as a fraction of 1.2 rad/s |
    | both | last | gripper: above 0 closes it, below 0 opens it to that fraction of its width, 0 leaves it unchanged |

    ## Observation Space
    A `Dict` of float64 boxes; the first axis counts arms or blocks. Poses are `x y z [m]`, then quaternion wxyz.

    | key | shape | meaning |
    |---|---|---|
    | `joint_positions` | (1, 7) | [rad] |
    | `joint_velocities` | (1, 7) | [rad/s] |
    | `tcp_pose` | (1, 7) | point between the finger pads; fingers close along its x, the hand points along its z |
    | `gripper_opening` | (1,) | gap between the finger pads [m] |
    | `object_pose` | (n, 7) | poses of the blocks |
    | `goal_pose` | (n, 7) | goal of each block; constant during an episode |
    | `motion_index` | (1,) | 2k while block k is to be fetched, 2k + 1 while it is held, 2n when all are placed |
    | `obstacle_active` | (3,) | 1 for a present obstacle; all entries of absent ones are 0 |
    | `obstacle_shape` | (3,) | 1 sphere, 2 box, 3 capsule |
    | `obstacle_size` | (3, 3) | box: extents; capsule: radius, radius, length of its segment; sphere: radius |
    | `obstacle_pose` | (3, 7) | poses of the obstacles |
    | `obstacle_velocity` | (3, 3) | velocities of their centers [m/s] |

    ## Rewards
    `reward="dense"`: in [0, 1], the completed share of the task, including reaching, grasping and carrying of the
    current block. `reward="sparse"`: 1 with success, else 0.

    ## Starting State
    By `level`: L0 the nominal row; L1 blocks moved by up to 10 cm and turned by up to 30 degrees, the base place by
    up to 5 cm, start joints by up to 0.05 rad; L2 up to 20 cm, 120 degrees, 10 cm and 0.15 rad. Blocks are at least
    12 cm apart, 17 cm from the base place, and 0.32 to 0.70 m from the arm's base axis, where a Panda's hand can point
    straight down; blocks and base place keep to a robot's own reach, `ROBOTS[robot].reach`, where it differs.

    L3, L4 and F are L2 with obstacles: L3 has one to three static ones of 3 to 10 cm on the hand's path, L4 one that
    swings across the path at up to 0.3 m/s or appears during a carry, F a static one where the forearm passes.
    R, S and T start as L1 does. Obstacles are solid. They overlap the volume that hand and block sweep on the
    straight path, and leave clearance at the start, at every grasp and at every goal, for any method.

    ## Episode End
    `terminated` with a settled success, or when a block has fallen off the table. `truncated` after 60 s for three
    blocks (Gymnasium's `TimeLimit`).

    ## Info
    `is_success`, `success`, `safe` (no unwanted contact so far), `stage`, `failure_reason`, `collision`,
    `n_contacts` (steps with an obstacle touched), `min_obstacle_distance` [m] (smallest so far, of the whole arm and
    the held object), `layouts_refused` (starts that had no space for the obstacles), `blocks_placed`,
    `position_error` (n,) [m], `yaw_error` (n,) [rad].

    ## Arguments
    `robot="Panda"`, `n_blocks=3` (1 to 6), `level="L1"`, `obstacles=None` (those of the level) or `"none" |
    "static" | "appear" | "moving" | "unforeseen" | "forearm" | "paper"`, `control_mode="joint_velocity" | "ee_twist"`,
    `reward="sparse" | "dense"`, `control_frequency=50`, `render_mode=None | "rgb_array" | "human"`,
    `arm=None` (the robot's default arm; of Baxter's "right" and "left", the other one is parked).
    `reset(options=...)` takes `level`, `obstacles` (a kind, or a list of `ScheduledObstacle`), `object_poses` (n, 7),
    `base_pose` (7,) of the lowest block's goal, and `joint_positions` (7,).

    ## Version History
    * v0: first version.
    """

    SKILL = STACK_SKILL

    def __init__(
        self,
        robot: str = "Panda",
        n_blocks: int = 3,
        level: str = "L1",
        obstacles: str | None = None,
        control_mode: str = "joint_velocity",
        reward: str = "sparse",
        control_frequency: int = 50,
        render_mode: str | None = None,
        arm: str | None = None,
    ):
        if isinstance(n_blocks, bool) or not isinstance(n_blocks, int) or not 1 <= n_blocks <= 6:
            raise BadOption("n_blocks", f"{n_blocks!r} is not a whole number from 1 to 6")
        kind = robot_named(robot)
        kind.check_grip(BLOCK, "a block")
        blocks = tuple(FreeBody(f"block{k}", Box(BLOCK_SIZE), TEXTURES[k]) for k in range(n_blocks))
        super().__init__(
            name="stack",
            robot=kind,
            things=SceneSpec(blocks),
            goals=n_blocks,
            motions=2 * n_blocks,
            level=level,
            obstacles=obstacles,
            control_mode=control_mode,
            reward=reward,
            render_mode=render_mode,
            control_frequency=control_frequency,
            arms=kind.checked_arms(arm),
        )
        self.n_blocks, self._reach = n_blocks, kind.reach
        self._goal_pose = np.zeros((n_blocks, 7))
        self._progress = StackProgress(self._goal_pose, self._goal_pose, self.control_dt)

    def _start(self, options: dict[str, Any], layout: str, spacious: bool) -> Start:
        check_known(options, OPTIONS)
        home = self.sim.scene.home
        axis = self.arms[0].chain[0, CHAIN.offset : CHAIN.offset + 2]
        gap = LONG_GAP if spacious and RANGES[layout].block else BASE_GAP
        drawn = stack_layout(self.np_random, RANGES[layout], self.n_blocks, axis, home.shape, gap, self._reach)
        poses, base = block_poses(drawn)
        if "object_poses" in options:
            poses = checked_poses("object_poses", options["object_poses"], self.n_blocks)
        if "base_pose" in options:
            base = checked_poses("base_pose", [options["base_pose"]], 1)[0]
        check_places(poses, base)
        joints = np.clip(home + drawn.joints, [a.lower for a in self.arms], [a.upper for a in self.arms])
        if "joint_positions" in options:
            joints = checked_joints(options["joint_positions"], self.arms)
        self._goal_pose = np.repeat(base[None], self.n_blocks, axis=0)
        self._goal_pose[:, 2] += BLOCK_SIZE[2] * np.arange(self.n_blocks)
        self._progress = StackProgress(self._goal_pose, poses, self.control_dt)
        return Start(joints, poses)

    def _placement_motions(self, start: Start) -> list[PlacementMotion]:
        """Return the carries: from above a block to above its goal."""
        return [
            PlacementMotion(
                start=above(block_grasps(block)[0], RAISED),
                end=above(block_grasps(goal)[0], RAISED),
                keys=tuple(
                    tuple(above(grasp, up) for grasp in block_grasps(pose)) for pose in (block, goal) for up in ABOVE
                ),
                shape=Box(BLOCK_SIZE),
                tcp_from_object=block_grasps(block)[0].inverse() @ Pose.from_vector(block),
                motion=2 * k + 1,
            )
            for k, (block, goal) in enumerate(zip(start.objects, self._goal_pose, strict=True))
        ]

    def _paper(self, motions: list[PlacementMotion]) -> list[ObstacleRequest]:
        """Return an obstacle that swings in front of the last block."""
        return [ObstacleRequest("moving", len(motions) - 1, PAPER_SPEED)]

    def _ghosts(self) -> list[Ghost]:
        return [Ghost(pose, Box(BLOCK_SIZE)) for pose in self._goal_pose]
