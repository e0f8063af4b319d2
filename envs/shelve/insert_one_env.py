"""Inserting one book that is in the hand."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from ...planner import Pose
from ...planner.errors import BadOption
from ..core.grasped_start import SQUEEZE, can_follow, holding_joints
from ..core.single_motion import FREQUENCY, Agreement, SingleMotionEnv
from ..core.spaces import REACH
from ..judge.dense_reward import closeness, gaps
from ..judge.goal_progress import GoalProgress, one_placed
from ..judge.judge import MEMORY
from ..simulation.simulation import Start
from ..simulation.state import State
from .facts import INSERT_ONE
from .parts import BOOK_SIZE
from .rules import MAX_ANGLE, MAX_OFFSET, WITHDRAWN
from .shelve_env import GRASP, INSERTION_DEPTH, ShelveEnv

ASIDE, TURN = {"L0": 0.0, "L1": 0.01, "L2": 0.02}, {"L0": 0.0, "L1": np.deg2rad(3.0), "L2": np.deg2rad(6.0)}
"""Largest shift [m] in x, y and z and largest turn [rad] of the held book, by layout name."""
INSERTION_STEPS = (0.75, 0.5, 0.25, 0.0)
"""Shares of the insertion distance at which a posture must be reachable from the start."""
MAX_STARTS = 200


BY_HAND = partial(one_placed, k=0, half_turns=False)
"""Dense reward of the book."""


class InsertOneEnv(SingleMotionEnv[GoalProgress], ShelveEnv):
    """Insert the book in the hand into its slot."""

    FACTS = INSERT_ONE
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
            self._progress = GoalProgress(
                self._rules, self._goal_pose, poses, self.control_dt, in_hand=0, dense=BY_HAND
            )
            self._progress.memory[MEMORY.height, 0] = -np.inf
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
