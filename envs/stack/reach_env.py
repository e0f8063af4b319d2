"""Reaching: bringing the hand above a block."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...planner import Box, Pose, Sphere
from ...planner.robot.kinematics import CHAIN
from ..core import spaces as space
from ..core.placement_context import PlacementMotion
from ..core.reset_options import check_known, checked_joints, checked_poses
from ..core.single_motion import FREQUENCY, Agreement, SingleMotionEnv
from ..judge.dense_reward import closeness, gaps
from ..scene.robots import robot_named
from ..scene.scene_objects import FreeBody, SceneSpec
from ..simulation.render import Ghost
from ..simulation.simulation import Start
from ..simulation.state import State
from .facts import REACH
from .grasps import above, block_grasps, block_poses, check_places
from .layout import BASE_GAP, LONG_GAP, RANGES, stack_layout
from .reach_rules import MAX_ANGLE, MAX_OFFSET, ReachProgress
from .rules import BLOCK_SIZE

OPTIONS = ("level", "obstacles", "object_poses", "joint_positions")
HEIGHT = 0.08
"""Height of the hand's goal above the block's center [m]: the fingertips are clear of the block."""


class ReachEnv(SingleMotionEnv[ReachProgress]):
    """Bring the open hand above a block, ready to grasp it."""

    FACTS = REACH
    GOAL_BOUNDS = (*(space.REACH,) * 3, 1.0, 1.0, 1.0, 1.0)

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
