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
    """One of robosuite's tasks for one arm, at this project's control, with its obstacles and robosuite's judge.

    ## Description
    `task` is one of robosuite's names: Lift, Stack, NutAssembly, NutAssemblySingle, NutAssemblySquare,
    NutAssemblyRound, PickPlace, PickPlaceSingle, PickPlaceMilk, PickPlaceBread, PickPlaceCereal, PickPlaceCan, Door,
    ToolHang, or a task for one arm that you have registered with robosuite. Model, placement and success are
    robosuite's own; the arm has the velocity servos of the other environments here. Success is judged from the
    simulator: robosuite's `_check_success` holds for half a second.

    The objects of `task.objects` are the free bodies that take part, each with its convex solids `parts`. Objects that
    robosuite hides stand on the floor beside the scene: left out where it is always the same ones, kept where each
    episode draws which one takes part. The table is the fixture "table"; all else that is solid and not free (pegs,
    bins, the door, its frame and its latch) is `task.furniture`. Parts of a whole, like those of the door, name it as
    their `assembly`; its own frame, without solids, is in the list, too. Joints of the scene are named in
    `task.scene_joints`.

    ## Action Space
    `Box(-1, 1, (8,), float64)` for an arm of seven joints, at 50 Hz; `(7,)` with `control_mode="ee_twist"`.

    | control mode | entry | meaning |
    |---|---|---|
    | `joint_velocity` | 0 to 6 | joint speed as a fraction of the joint's limit |
    | `ee_twist` | 0 to 2 | velocity of the tcp in world axes as a fraction of 0.25 m/s |
    | `ee_twist` | 3 to 5 | angular velocity of the tcp in world axes as a fraction of 1.2 rad/s |
    | both | last | gripper: above 0 closes it, below 0 opens it to that fraction of its width, 0 leaves it unchanged |

    ## Observation Space
    A `Dict` of float64 boxes; the first axis counts arms or objects. Poses are `x y z [m]`, then quaternion wxyz.

    | key | shape | meaning |
    |---|---|---|
    | `joint_positions` | (1, 7) | [rad] |
    | `joint_velocities` | (1, 7) | [rad/s] |
    | `tcp_pose` | (1, 7) | point between the finger pads; fingers close along its x, the hand points along its z |
    | `gripper_opening` | (1,) | gap between the finger pads [m] |
    | `object_pose` | (n, 7) | poses of the objects |
    | `goal_pose` | (0, 7) | constant: robosuite's tasks have no goal poses |
    | `motion_index` | (1,) | 1 while the fingers touch an object, else 0 |
    | `furniture_pose` | (m, 7) | poses of the fixtures; only where there are any |
    | `scene_joint_positions` | (k,) | positions of the scene's joints [rad or m]; only where there are any |
    | `obstacle_active` | (3,) | 1 for a present obstacle; all entries of absent ones are 0 |
    | `obstacle_shape` | (3,) | 1 sphere, 2 box, 3 capsule |
    | `obstacle_size` | (3, 3) | box: extents; capsule: radius, radius, length of its segment; sphere: radius |
    | `obstacle_pose` | (3, 7) | poses of the obstacles |
    | `obstacle_velocity` | (3, 3) | velocities of their centers [m/s] |

    ## Rewards
    `reward="sparse"`: 1 with success, else 0. `reward="dense"`: robosuite's own shaped reward, scaled to [0, 1];
    ToolHang has none.

    ## Starting State
    By `range`: D0 is robosuite's own placement, D1 a wider one: in Stack both cubes within 20 cm of the table's middle
    in x and y; in NutAssemblySquare the nut within 11.5 cm in x and 25.5 cm in y with any yaw, its peg at x from -0.1
    to 0.3 m and y from -0.2 to 0.2 m, where nut and pegs are 14 cm apart. The objects are dropped as in robosuite and
    settle for 0.4 s before the first observation. The arm starts at rest at its home joints, gripper open, without
    noise.

    By `level`: L0, L1, L2, R, S and T start alike. L3 has one to three static obstacles of 3 to 10 cm on the hand's
    path, L4 one that swings across the path at up to 0.3 m/s or appears during it, F a static one where the forearm
    passes. They block the way from above an object to above its place, or from the start to what the hand moves,
    and leave clearance at the start and at both ends, for any method. Where that way is short, as in
    Stack at D0, none fits, and the reset is refused by `NoRoom`.

    ## Episode End
    `terminated` with a settled success, or when an object has fallen off the table. `truncated` after 60 s
    (Gymnasium's `TimeLimit`).

    ## Info
    `is_success`, `success`, `safe` (so far no obstacle was touched by robot or object, and table or fixtures by no link
    of the arm but its hand), `stage`, `failure_reason`, `collision`, `n_contacts` (steps with an obstacle touched),
    `min_obstacle_distance` [m] (smallest so far, of the whole arm and the held object), `layouts_refused` (starts that
    had no space for the obstacles), `robosuite_success` (`_check_success` at this instant).

    ## Arguments
    `task="Lift"`, `robot="Panda"` (any with one arm), `gripper="PandaGripper"` (Sawyer also "RethinkGripper"),
    `level="L1"`, `range="D0" | "D1"`, `obstacles=None` (those of the level) or `"none" | "static" | "appear" |
    "moving" | "unforeseen" | "forearm"`, `control_mode="joint_velocity" | "ee_twist"`, `reward="sparse" | "dense"`,
    `control_frequency=50`, `render_mode=None | "rgb_array" | "human"`. `reset(options=...)` takes `level`,
    `obstacles` (a kind, or a list of `ScheduledObstacle`), `object_poses` (n, 7), which do not settle, and
    `joint_positions` (7,).

    ## Version History
    * v0: first version.
    """

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
