"""Reaching: bringing the hand above a block."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...planner import Box, Pose, Sphere
from ...planner.robot.kinematics import CHAIN
from ..core.declared_task import DeclaredTask, TaskEpisode, World
from ..core.goal_form import POSE_BOUNDS, Agreement, GoalForm
from ..core.maker import SINGLE_MOTION, EnvironmentMaker
from ..core.placement_context import PlacementMotion
from ..core.reset_options import check_known, checked_joints, checked_poses
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


class Reaching(DeclaredTask):
    """Reaching for a block.

    Args:
        robot: name of the robot.
        arm: name of the arm at work; None: the robot's default arm.
    """

    facts, name, goals, motions = REACH, REACH.name, 1, 1

    def __init__(self, robot: str = "Panda", arm: str | None = None):
        self.robot = robot_named(robot)
        self.things = SceneSpec((FreeBody("block0", Box(BLOCK_SIZE), "WoodLight"),))
        self.arms = self.robot.checked_arms(arm)
        self.form = GoalForm(POSE_BOUNDS, _achieved, _desired, _agreement)

    def begin(self, world: World, options: dict[str, Any], layout: str, *, spacious: bool) -> TaskEpisode:
        """See `DeclaredTask`."""
        check_known(options, OPTIONS)
        home, arm = world.sim.scene.home, world.arms[0]
        axis = arm.chain[0, CHAIN.offset : CHAIN.offset + 2]
        gap = LONG_GAP if spacious and RANGES[layout].block else BASE_GAP
        drawn = stack_layout(world.rng, RANGES[layout], 1, axis, home.shape, gap, self.robot.reach)
        poses, base = block_poses(drawn)
        if "object_poses" in options:
            poses = checked_poses("object_poses", options["object_poses"], 1)
        check_places(poses, base)
        joints = np.clip(home + drawn.joints, arm.lower, arm.upper)
        if "joint_positions" in options:
            joints = checked_joints(options["joint_positions"], world.arms)
        goals = [above(grasp, HEIGHT) for grasp in block_grasps(poses[0])]
        progress = ReachProgress(np.array([goal.dq for goal in goals]), world.dt)
        return TaskEpisode(Start(joints, poses), goals[0].vector[None], progress)

    def placement_motions(self, world: World, episode: TaskEpisode) -> list[PlacementMotion]:
        """See `DeclaredTask`: the motion from the start to above the block."""
        goals = tuple(above(grasp, HEIGHT) for grasp in block_grasps(episode.start.objects[0]))
        fingertip, home = Sphere(0.005), world.arms[0].fk(episode.start.joints[0])
        return [PlacementMotion(home, goals[0], (goals,), fingertip, Pose.identity(), motion=0)]

    def ghosts(self, episode: TaskEpisode) -> list[Ghost]:
        """See `DeclaredTask`."""
        return [Ghost(pose, Sphere(0.012)) for pose in episode.goals]


def _achieved(episode: TaskEpisode, state: State) -> np.ndarray:
    """Return (7,) the pose of the tcp."""
    return state.tcp_pose[0].copy()


def _desired(episode: TaskEpisode) -> np.ndarray:
    """Return (7,) the goal pose of the tcp."""
    return episode.goals[0].copy()


def _agreement(achieved: np.ndarray, desired: np.ndarray) -> Agreement:
    """Return how well poses of the tcp agree, up to half turns of the hand."""
    distance, angle = gaps(achieved, desired, half_turns=True)
    return Agreement(closeness(distance, angle), (distance <= MAX_OFFSET) & (angle <= MAX_ANGLE))


reach_env = EnvironmentMaker(Reaching, **SINGLE_MOTION)
