"""Placing one block that is in the hand."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from ...planner.errors import BadOption
from ..core.grasped_start import SQUEEZE, holding_joints
from ..core.placement_context import PlacementMotion
from ..core.reset_options import checked_choice, checked_joints, checked_poses
from ..core.single_motion import FREQUENCY, Agreement, SingleMotionEnv
from ..core.spaces import REACH
from ..judge.dense_reward import closeness, gaps
from ..judge.goal_progress import GoalProgress, one_placed
from ..simulation.simulation import Start
from ..simulation.state import State
from .facts import PLACE_ONE
from .grasps import block_grasps
from .rules import BLOCK, MAX_HEIGHT, MAX_OFFSET, MAX_YAW, WITHDRAWN
from .stack_env import StackEnv

ONTO = ("table", "block")
HELD = {"L0": (0.12, 0.12), "L1": (0.08, 0.16), "L2": (0.06, 0.20)}
"""Range of the held block's height above the table [m], by layout name."""
UP = 0.008
"""Height of the hand above the center of a block held from the start [m]: people grasp blocks by the upper half."""
MAX_STARTS = 200


BY_HAND = partial(one_placed, k=-1, half_turns=True)
"""Dense reward of the last block."""


class PlaceOneEnv(SingleMotionEnv[GoalProgress], StackEnv):
    """Put the block in the hand at its goal, on the table or on another block."""

    FACTS = PLACE_ONE
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
            held, dt = self.n_blocks - 1 if self.pregrasped else None, self.control_dt
            self._progress = GoalProgress(self._rules, self._goal_pose, start.objects, dt, in_hand=held, dense=BY_HAND)
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
