"""Any of robosuite's tasks for one arm."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...planner.errors import BadOption
from ..core import spaces as space
from ..core.description import TaskDescription
from ..core.environment import SLOTS, Observation, TaskEnv
from ..core.placement_context import PlacementMotion
from ..core.reset_options import check_known, checked_joints, checked_poses
from ..mujoco_library import mujoco
from ..scene.robot_description import robot_parts
from ..scene.scene_objects import SceneSpec
from ..simulation.simulation import PHYSICS_DT, Start
from ..simulation.state import State
from .facts import ROBOSUITE
from .guest_scene import guest_scene
from .judge import Sight
from .motions import placement_motions
from .rules import GuestProgress
from .task_facts import WITHOUT_SHAPED_REWARD, wide_range

OPTIONS = ("level", "obstacles", "object_poses", "joint_positions")
SETTLING = 0.4
"""Time [s] of physics before the start: robosuite drops its objects from up to 6 cm."""
SEEDS = 2**32
JOINT_SLACK = 0.5
"""Bound of a scene joint's excursion beyond its limit, which gives way under force [rad or m]."""


class RobosuiteEnv(TaskEnv[GuestProgress]):
    """One of robosuite's tasks for one arm, at this project's control, with its obstacles and robosuite's judge."""

    FACTS = ROBOSUITE

    def __init__(
        self,
        task: str = "Lift",
        robot: str = "Panda",
        gripper: str = "PandaGripper",
        level: str = "L1",
        range: str = "D0",
        obstacles: str | None = None,
        control_mode: str = "joint_velocity",
        reward: str = "sparse",
        control_frequency: int = 50,
        render_mode: str | None = None,
    ):
        guest = self._guest = guest_scene(task, robot, gripper)
        self._wide = wide_range(task, range)
        if reward == "dense" and task in WITHOUT_SHAPED_REWARD:
            raise BadOption("reward", f"robosuite has no shaped reward in {task}; only sparse is possible")
        more = {}
        if guest.furniture:
            more["furniture_pose"] = space.pose_box(len(guest.furniture))
        if guest.joints:
            low, high = guest.joint_ranges.T
            more["scene_joint_positions"] = space.box(low - JOINT_SLACK, high + JOINT_SLACK, low.shape)
        super().__init__(
            name=task,
            robot=guest.scene.robot,
            things=SceneSpec(),
            scene=guest.scene,
            goals=0,
            motions=1,
            level=level,
            obstacles=obstacles,
            control_mode=control_mode,
            reward=reward,
            render_mode=render_mode,
            control_frequency=control_frequency,
            more=more,
        )
        self._goal_pose = np.zeros((0, 7))
        self._progress = self._new_progress(np.zeros((len(guest.objects), 7)))

    def _described(self, name: str, things: SceneSpec) -> TaskDescription:
        guest, parts = self._guest, robot_parts(self.sim.scene, self._guest.moved)
        return TaskDescription(
            name=name,
            robot=guest.scene.robot.name,
            arms=self.arms,
            control_dt=self.control_dt,
            objects=guest.objects,
            bodies=parts.bodies,
            table_height=guest.table_height,
            fixtures=parts.fixtures,
            gripper_width=(self.sim.widest_opening(0),),
            furniture=guest.furniture,
            touching=parts.touching,
            obstacles=SLOTS,
            control_mode=self.control_mode,
            scene_joints=guest.joints,
        )

    def _new_progress(self, objects: np.ndarray) -> GuestProgress:
        names = tuple(each.name for each in self._guest.objects)
        return GuestProgress(names, objects, self._guest.table_height, self.control_dt)

    def _start(self, options: dict[str, Any], layout: str, spacious: bool) -> Start:
        check_known(options, OPTIONS)
        joints, poses = self.sim.scene.home.copy(), None
        if "joint_positions" in options:
            joints = checked_joints(options["joint_positions"], self.arms)
        if "object_poses" in options:
            poses = checked_poses("object_poses", options["object_poses"], len(self._guest.objects))
        dropped = self._laid_out()
        start = Start(joints, self._settled(dropped) if poses is None else poses)
        self.sim.reset(start)
        self._progress = self._new_progress(start.objects)
        return start._replace(furniture=self._look(shaped=False).furniture)

    def _laid_out(self) -> np.ndarray:
        """Draw a layout, and put fixtures and objects that take no part where it has them.

        Returns:
            (n, 7) poses of the objects before they fall.
        """
        drawn = self._guest.env.drawn(int(self.np_random.integers(SEEDS)), self._wide)
        model, free = self.sim.model, np.arange(7)
        model.body_pos[:], model.body_quat[:] = drawn.body_pos, drawn.body_quat
        # a reset of MuJoCo's data brings free bodies there
        places = (self._guest.hidden[:, None] + free).ravel()
        model.qpos0[places] = drawn.qpos[places]
        return drawn.qpos[self.sim.object_places[:, None] + free]

    def _settled(self, dropped: np.ndarray) -> np.ndarray:
        """Return the poses (n, 7) of the objects after they have come to rest, the arm at its home.

        Args:
            dropped: (n, 7) poses from which they fall.
        """
        self.sim.reset(Start(self.sim.scene.home, dropped))
        mujoco.mj_step(self.sim.model, self.sim.data, round(SETTLING / PHYSICS_DT))
        return self.sim.read().object_pose

    def _placement_motions(self, start: Start) -> list[PlacementMotion]:
        return placement_motions(self._guest, self.arms[0].fk(start.joints[0]), start.objects, start.furniture)

    def _look(self, *, shaped: bool) -> Sight:
        return self._guest.judge.look(self.sim, shaped=shaped)

    def _judge(self, state: State) -> tuple[float, bool, dict[str, Any]]:
        self._progress.sight = self._look(shaped=self.reward_kind == "dense")
        return super()._judge(state)

    def _more_observed(self, state: State) -> Observation:
        sight, more = self._progress.sight, {}
        if self._guest.furniture:
            more["furniture_pose"] = sight.furniture
        if self._guest.joints:
            more["scene_joint_positions"] = sight.joints
        return more
