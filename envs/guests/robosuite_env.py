"""Any of robosuite's tasks for one arm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..core import spaces as space
from ..core.declared_task import DeclaredTask, TaskEpisode, World
from ..core.description import TaskDescription
from ..core.maker import EnvironmentMaker
from ..core.placement_context import PlacementMotion
from ..core.reset_options import check_known, checked_joints, checked_poses
from ..mujoco_library import mujoco
from ..scene.robot_description import robot_parts
from ..scene.scene_objects import SceneSpec
from ..simulation.simulation import PHYSICS_DT, Start
from ..simulation.state import State
from .facts import ROBOSUITE
from .guest_scene import guest_scene
from .motions import placement_motions
from .rules import GuestProgress
from .task_facts import WITHOUT_SHAPED_REWARD, wide_range

OPTIONS = ("level", "obstacles", "object_poses", "joint_positions")
SETTLING = 0.4
"""Time [s] of physics before the start: robosuite drops its objects from up to 6 cm."""
SEEDS = 2**32
JOINT_SLACK = 0.5
"""Bound of a scene joint's excursion beyond its limit, which gives way under force [rad or m]."""


class DeclaredGuest(DeclaredTask):
    """One of robosuite's tasks.

    Args:
        task: robosuite's name of the task.
        robot: name of the robot.
        gripper: robosuite's name of the gripper.
        range: "D0" or "D1".
    """

    facts, goals, motions, things = ROBOSUITE, 0, 1, SceneSpec()

    def __init__(self, task: str = "Lift", robot: str = "Panda", gripper: str = "PandaGripper", range: str = "D0"):
        guest = self.guest = guest_scene(task, robot, gripper)
        self.name, self.wide, self.robot, self.scene = task, wide_range(task, range), guest.scene.robot, guest.scene
        if task in WITHOUT_SHAPED_REWARD:
            self.only_sparse = f"robosuite has no shaped reward in {task}; only sparse is possible"
        more = {}
        if guest.furniture:
            more["furniture_pose"] = space.pose_box(len(guest.furniture))
        if guest.joints:
            low, high = guest.joint_ranges.T
            more["scene_joint_positions"] = space.box(low - JOINT_SLACK, high + JOINT_SLACK, low.shape)
        self.more: Mapping[str, Any] = more

    def described(self, description: TaskDescription) -> TaskDescription:
        """See `DeclaredTask`."""
        guest, parts = self.guest, robot_parts(self.guest.scene, self.guest.moved)
        return replace(
            description,
            objects=guest.objects,
            bodies=parts.bodies,
            table_height=guest.table_height,
            fixtures=parts.fixtures,
            furniture=guest.furniture,
            touching=parts.touching,
            scene_joints=guest.joints,
        )

    def begin(self, world: World, options: dict[str, Any], layout: str, *, spacious: bool) -> TaskEpisode:
        """See `DeclaredTask`."""
        check_known(options, OPTIONS)
        guest, joints, poses = self.guest, world.sim.scene.home.copy(), None
        if "joint_positions" in options:
            joints = checked_joints(options["joint_positions"], world.arms)
        if "object_poses" in options:
            poses = checked_poses("object_poses", options["object_poses"], len(guest.objects))
        dropped = self._laid_out(world)
        start = Start(joints, self._settled(world, dropped) if poses is None else poses)
        world.sim.reset(start)
        names = tuple(each.name for each in guest.objects)
        progress = GuestProgress(names, start.objects, guest.table_height, world.dt)
        furniture = guest.judge.look(world.sim, shaped=False).furniture
        return TaskEpisode(start._replace(furniture=furniture), np.zeros((0, 7)), progress)

    def _laid_out(self, world: World) -> np.ndarray:
        """Draw a layout, and put fixtures and objects that take no part where it has them.

        Returns:
            (n, 7) poses of the objects before they fall.
        """
        drawn = self.guest.env.drawn(int(world.rng.integers(SEEDS)), self.wide)
        model, free = world.sim.model, np.arange(7)
        model.body_pos[:], model.body_quat[:] = drawn.body_pos, drawn.body_quat
        # a reset of MuJoCo's data brings free bodies there
        places = (self.guest.hidden[:, None] + free).ravel()
        model.qpos0[places] = drawn.qpos[places]
        return drawn.qpos[world.sim.object_places[:, None] + free]

    def _settled(self, world: World, dropped: np.ndarray) -> np.ndarray:
        """Return the poses (n, 7) of the objects after they have come to rest, the arm at its home.

        Args:
            world: the task's world.
            dropped: (n, 7) poses from which they fall.
        """
        world.sim.reset(Start(world.sim.scene.home, dropped))
        mujoco.mj_step(world.sim.model, world.sim.data, round(SETTLING / PHYSICS_DT))
        return world.sim.read().object_pose

    def placement_motions(self, world: World, episode: TaskEpisode) -> list[PlacementMotion]:
        """See `DeclaredTask`."""
        start = episode.start
        return placement_motions(self.guest, world.arms[0].fk(start.joints[0]), start.objects, start.furniture)

    def look(self, world: World, episode: TaskEpisode, state: State, seconds: float, *, shaped: bool) -> None:
        """See `DeclaredTask`."""
        assert isinstance(episode.progress, GuestProgress)
        episode.progress.sight = self.guest.judge.look(world.sim, shaped=shaped)

    def observed(self, episode: TaskEpisode) -> dict[str, np.ndarray]:
        """See `DeclaredTask`."""
        assert isinstance(episode.progress, GuestProgress)
        sight, more = episode.progress.sight, {}
        if self.guest.furniture:
            more["furniture_pose"] = sight.furniture
        if self.guest.joints:
            more["scene_joint_positions"] = sight.joints
        return more


robosuite_env = EnvironmentMaker(DeclaredGuest)
