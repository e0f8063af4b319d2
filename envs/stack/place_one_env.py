"""Placing one block that is in the hand."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from ...planner.errors import BadOption
from ..core.declared_task import DeclaredTask, TaskEpisode, World
from ..core.goal_form import Agreement, released_at_goal
from ..core.grasped_start import SQUEEZE, holding_joints
from ..core.maker import SINGLE_MOTION, EnvironmentMaker
from ..core.placement_context import PlacementMotion
from ..core.reset_options import checked_choice, checked_joints, checked_poses
from ..judge.dense_reward import closeness, gaps
from ..judge.goal_progress import GoalProgress, one_placed
from ..simulation.render import Ghost
from ..simulation.simulation import Start
from .facts import PLACE_ONE
from .grasps import block_grasps
from .rules import BLOCK, MAX_HEIGHT, MAX_OFFSET, MAX_YAW, WITHDRAWN
from .stack_env import Stacking

ONTO = ("table", "block")
HELD = {"L0": (0.12, 0.12), "L1": (0.08, 0.16), "L2": (0.06, 0.20)}
"""Range of the held block's height above the table [m], by layout name."""
UP = 0.008
"""Height of the hand above the center of a block held from the start [m]: people grasp blocks by the upper half."""
MAX_STARTS = 200
BY_HAND = partial(one_placed, k=-1, half_turns=True)
"""Dense reward of the last block."""


class PlacingOne(DeclaredTask):
    """Placing the block in the hand.

    Args:
        robot: name of the robot.
        onto: "table" or "block".
        pregrasped: whether the block is in the hand from the start.
        arm: name of the arm at work; None: the robot's default arm.
    """

    facts, name = PLACE_ONE, PLACE_ONE.name

    def __init__(self, robot: str = "Panda", onto: str = "table", pregrasped: bool = True, arm: str | None = None):
        if not isinstance(pregrasped, bool):
            raise BadOption("pregrasped", f"{pregrasped!r} is neither True nor False")
        self.onto, self.pregrasped = checked_choice("onto", onto, ONTO), pregrasped
        stacking = self.stacking = Stacking(robot, 1 + (onto == "block"), arm)
        self.robot, self.things, self.arms = stacking.robot, stacking.things, stacking.arms
        self.n_blocks, self.goals, self.motions = stacking.n_blocks, stacking.goals, stacking.motions
        self.form = released_at_goal(-1, WITHDRAWN, _agreement)

    def begin(self, world: World, options: dict[str, Any], layout: str, *, spacious: bool) -> TaskEpisode:
        """See `DeclaredTask`: as in stacking, with the lower block at its place, the other in the hand."""
        for _ in range(MAX_STARTS):
            stacked = self.stacking.begin(world, options, layout, spacious=spacious)
            (joints, before, *_), goals = stacked.start, stacked.goals
            poses, grips = before.copy(), None
            poses[:-1] = goals[:-1]
            if self.pregrasped:
                grips = np.array([BLOCK - SQUEEZE])
                found = self._in_hand(world, options, layout, poses, joints)
                if found is None:
                    continue
                joints = found
            held = self.n_blocks - 1 if self.pregrasped else None
            progress = GoalProgress(self.stacking.rules, goals, before, world.dt, in_hand=held, dense=BY_HAND)
            return TaskEpisode(Start(joints, poses, grips=grips), goals, progress)
        raise BadOption("object_poses", "the hand cannot hold the block there")

    def _in_hand(
        self, world: World, options: dict[str, Any], layout: str, poses: np.ndarray, joints: np.ndarray
    ) -> np.ndarray | None:
        """Return joints (1, dof) that hold the last of the blocks (n, 7), updating its pose; None if no joints do."""
        arm = world.arms[0]
        if "joint_positions" in options:
            given = checked_joints(options["joint_positions"], world.arms)
            origin = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
            poses[-1] = (arm.fk(given[0]) @ block_grasps(origin, UP)[0].inverse()).vector
            return given
        if "object_poses" in options:
            poses[-1] = checked_poses("object_poses", options["object_poses"], self.n_blocks)[-1]
        else:
            poses[-1, 2] += world.rng.uniform(*HELD[layout])
        q = holding_joints(arm, block_grasps(poses[-1], UP), joints[0])
        return None if q is None else q[None]

    def placement_motions(self, world: World, episode: TaskEpisode) -> list[PlacementMotion]:
        """See `DeclaredTask`."""
        return self.stacking.placement_motions(world, episode)[-1:]

    def paper(self, motions: list[PlacementMotion]) -> list[Any]:
        """See `DeclaredTask`."""
        return self.stacking.paper(motions)

    def ghosts(self, episode: TaskEpisode) -> list[Ghost]:
        """See `DeclaredTask`."""
        return self.stacking.ghosts(episode)


def _agreement(achieved: np.ndarray, desired: np.ndarray) -> Agreement:
    """Return how well poses of the block agree, up to half turns, released in both goals or in neither."""
    distance, angle = gaps(achieved, desired, half_turns=True)
    away = np.abs(achieved - desired)
    aside = np.hypot(away[..., 0], away[..., 1])
    there = (aside <= MAX_OFFSET) & (away[..., 2] <= MAX_HEIGHT) & (angle <= MAX_YAW)
    return Agreement(closeness(distance, angle), there & (away[..., 7] < 0.5))


place_one_env = EnvironmentMaker(PlacingOne, **SINGLE_MOTION)
