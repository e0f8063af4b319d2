"""Inserting one book that is in the hand."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from ...planner import Pose
from ...planner.errors import BadOption
from ..core.declared_task import DeclaredTask, TaskEpisode, World
from ..core.goal_form import Agreement, released_at_goal
from ..core.grasped_start import SQUEEZE, can_follow, holding_joints
from ..core.maker import SINGLE_MOTION, EnvironmentMaker
from ..core.placement_context import PlacementMotion
from ..judge.dense_reward import closeness, gaps
from ..judge.goal_progress import GoalProgress, one_placed
from ..judge.judge import MEMORY
from ..simulation.render import Ghost
from ..simulation.simulation import Start
from .facts import INSERT_ONE
from .parts import BOOK_SIZE
from .rules import MAX_ANGLE, MAX_OFFSET, WITHDRAWN
from .shelve_env import GRASP, INSERTION_DEPTH, VIEW, Shelving

ASIDE, TURN = {"L0": 0.0, "L1": 0.01, "L2": 0.02}, {"L0": 0.0, "L1": np.deg2rad(3.0), "L2": np.deg2rad(6.0)}
"""Largest shift [m] in x, y and z and largest turn [rad] of the held book, by layout name."""
INSERTION_STEPS = (0.75, 0.5, 0.25, 0.0)
"""Shares of the insertion distance at which a posture must be reachable from the start."""
MAX_STARTS = 200


BY_HAND = partial(one_placed, k=0, half_turns=False)
"""Dense reward of the book."""


class InsertingOne(DeclaredTask):
    """Inserting the book in the hand.

    Args:
        robot: name of the robot.
        shelf: "upper" or "lower".
    """

    facts, name, goals, motions, view, too_short = INSERT_ONE, INSERT_ONE.name, 1, 2, VIEW, True

    def __init__(self, robot: str = "Panda", shelf: str = "upper"):
        shelving = self.shelving = Shelving(robot, 1, shelf)
        self.robot, self.things, self.more, self.shelf = shelving.robot, shelving.things, shelving.more, shelf
        self.n_books = 1
        self.form = released_at_goal(0, WITHDRAWN, _agreement)

    def begin(self, world: World, options: dict[str, Any], layout: str, *, spacious: bool) -> TaskEpisode:
        """See `DeclaredTask`: cupboard and clutter as in shelving, the book in the hand in front of its slot."""
        for _ in range(MAX_STARTS):
            shelved = self.shelving.begin(world, options, layout, spacious=spacious)
            (joints, poses, furniture, *_), goals = shelved.start, shelved.goals
            found = self._before_slot(world, goals[0], layout) if "joint_positions" not in options else joints
            if found is None:
                continue
            poses = poses.copy()
            poses[0] = (world.arms[0].fk(found[0]) @ GRASP.inverse()).vector
            progress = GoalProgress(self.shelving.rules, goals, poses, world.dt, in_hand=0, dense=BY_HAND)
            progress.memory[MEMORY.height, 0] = -np.inf
            start = Start(found, poses, furniture, grips=np.array([BOOK_SIZE[1] - SQUEEZE]))
            return TaskEpisode(start, goals, progress, shelved.constant, shelved.layout)
        raise BadOption("cupboard_pose", "the hand cannot be before the slot, or not go straight in from there")

    def _before_slot(self, world: World, goal: np.ndarray, layout: str) -> np.ndarray | None:
        """Return joints (1, dof) that hold the book in front of its slot and can insert it straight, or None."""
        release = Pose.from_vector(goal) @ GRASP
        back = [
            release @ Pose.from_position_quaternion([0.0, 0.0, -part * INSERTION_DEPTH])
            for part in (1.0, *INSERTION_STEPS)
        ]
        aside, turn = ASIDE[layout], TURN[layout]
        shift = world.rng.uniform(-aside, aside, 3)
        book = back[0] @ GRASP.inverse() @ Pose.from_yaw([0, 0, 0], world.rng.uniform(-turn, turn))
        hand = Pose.from_position_quaternion(shift) @ book @ GRASP
        q = holding_joints(world.arms[0], [hand], self.shelving.ready[0])
        return q[None] if q is not None and can_follow(world.arms[0], q, back[1:]) else None

    def placement_motions(self, world: World, episode: TaskEpisode) -> list[PlacementMotion]:
        """See `DeclaredTask`."""
        return self.shelving.placement_motions(world, episode)

    def ghosts(self, episode: TaskEpisode) -> list[Ghost]:
        """See `DeclaredTask`."""
        return self.shelving.ghosts(episode)


def _agreement(achieved: np.ndarray, desired: np.ndarray) -> Agreement:
    """Return how well poses of the book agree, released in both goals or in neither."""
    distance, angle = gaps(achieved, desired, half_turns=False)
    free = np.abs(achieved[..., 7] - desired[..., 7]) < 0.5
    there = (distance <= MAX_OFFSET) & (angle <= MAX_ANGLE)
    return Agreement(closeness(distance, angle), there & free)


insert_one_env = EnvironmentMaker(InsertingOne, **SINGLE_MOTION)
