"""Stacking wooden blocks."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...planner import Box, Pose
from ...planner.errors import BadOption
from ...planner.robot.kinematics import CHAIN
from ..core.declared_task import DeclaredTask, TaskEpisode, World
from ..core.maker import EnvironmentMaker
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


class Stacking(DeclaredTask):
    """Stacking blocks.

    Args:
        robot: name of the robot.
        n_blocks: number of blocks.
        arm: name of the arm at work; None: the robot's default arm.
    """

    facts, name = STACK, STACK.name

    def __init__(self, robot: str = "Panda", n_blocks: int = 3, arm: str | None = None):
        if isinstance(n_blocks, bool) or not isinstance(n_blocks, int) or not 1 <= n_blocks <= 6:
            raise BadOption("n_blocks", f"{n_blocks!r} is not a whole number from 1 to 6")
        self.robot = robot_named(robot)
        self.robot.check_grip(BLOCK, "a block")
        blocks = tuple(FreeBody(f"block{k}", Box(BLOCK_SIZE), TEXTURES[k]) for k in range(n_blocks))
        self.things, self.goals, self.motions = SceneSpec(blocks), n_blocks, 2 * n_blocks
        self.arms, self.n_blocks, self.rules = self.robot.checked_arms(arm), n_blocks, stack_rules(n_blocks)

    def begin(self, world: World, options: dict[str, Any], layout: str, *, spacious: bool) -> TaskEpisode:
        """See `DeclaredTask`."""
        check_known(options, OPTIONS)
        home, arms = world.sim.scene.home, world.arms
        axis = arms[0].chain[0, CHAIN.offset : CHAIN.offset + 2]
        gap = LONG_GAP if spacious and RANGES[layout].block else BASE_GAP
        drawn = stack_layout(world.rng, RANGES[layout], self.n_blocks, axis, home.shape, gap, self.robot.reach)
        poses, base = block_poses(drawn)
        if "object_poses" in options:
            poses = checked_poses("object_poses", options["object_poses"], self.n_blocks)
        if "base_pose" in options:
            base = checked_poses("base_pose", [options["base_pose"]], 1)[0]
        check_places(poses, base)
        joints = np.clip(home + drawn.joints, [a.lower for a in arms], [a.upper for a in arms])
        if "joint_positions" in options:
            joints = checked_joints(options["joint_positions"], arms)
        goals = np.repeat(base[None], self.n_blocks, axis=0)
        goals[:, 2] += BLOCK_SIZE[2] * np.arange(self.n_blocks)
        return TaskEpisode(Start(joints, poses), goals, GoalProgress(self.rules, goals, poses, world.dt))

    def placement_motions(self, world: World, episode: TaskEpisode) -> list[PlacementMotion]:
        """See `DeclaredTask`: the carries: from above a block to above its goal."""
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
            for k, (block, goal) in enumerate(zip(episode.start.objects, episode.goals, strict=True))
        ]

    def paper(self, motions: list[PlacementMotion]) -> list[ObstacleRequest]:
        """Return an obstacle that swings in front of the last block."""
        return [ObstacleRequest("moving", len(motions) - 1, PAPER_SPEED)]

    def ghosts(self, episode: TaskEpisode) -> list[Ghost]:
        """See `DeclaredTask`."""
        return [Ghost(pose, Box(BLOCK_SIZE)) for pose in episode.goals]


stack_env = EnvironmentMaker(Stacking)
