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
from ..judge.goal_progress import GoalProgress
from ..scene.robots import robot_named
from ..scene.scene_objects import FreeBody, SceneSpec
from ..simulation.render import Ghost
from ..simulation.simulation import Start
from .facts import STACK
from .grasps import above, block_grasps, block_poses, check_places
from .layout import BASE_GAP, LONG_GAP, RANGES, stack_layout
from .rules import BLOCK, BLOCK_SIZE, stack_rules

TEXTURES = ("WoodLight", "WoodRed", "WoodGreen", "WoodBlue", "WoodDark", "WoodLight")
OPTIONS = ("level", "obstacles", "object_poses", "base_pose", "joint_positions")
RAISED = 0.10
"""Height [m] of the hand above a grasp or a goal at the ends of a carry."""
ABOVE = (0.0, 0.04, 0.08)
"""Heights [m] above grasps and goals at which the hand must have clearance from obstacles."""
PAPER_SPEED = 0.1
"""Peak speed of the obstacle that swings in front of the last block [m/s]."""


class StackEnv(TaskEnv[GoalProgress]):
    """Stack wooden blocks at a given place, in order, with one arm."""

    FACTS = STACK

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
        self._rules = stack_rules(n_blocks)
        self._progress = GoalProgress(self._rules, self._goal_pose, self._goal_pose, self.control_dt)

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
        self._progress = GoalProgress(self._rules, self._goal_pose, poses, self.control_dt)
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
