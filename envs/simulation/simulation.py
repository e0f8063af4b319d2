"""Simulation of a scene by MuJoCo alone."""

from __future__ import annotations

import copy
import math
from typing import Any, NamedTuple

import numpy as np

from ...planner.errors import BadOption
from ...planner.robot.kinematics import FRAME
from ..mujoco_library import mujoco
from ..scene.arm_index import ArmIndex
from ..scene.robots import Robot
from ..scene.scene import FINGERS, FIRST_OBJECT, CompiledScene, compiled_scene
from ..scene.scene_objects import SceneSpec
from .moving_obstacles import ObstacleBodies, ScheduledObstacle
from .obstacle_distance import ObstacleDistance
from .snapshot import put, taken
from .state import State, command, read_arms, read_objects

PHYSICS_DT = 0.002


class Start(NamedTuple):
    """Initial state of an episode.

    Attributes:
        joints: (n_arms, dof) joint positions [rad].
        objects: (n_objects, 7) world poses, x y z [m] and wxyz.
        furniture: (n_furniture, 7) world poses, likewise; furniture that is part of the model stands where it does.
        beads: (n_beads, 3) world positions [m].
        scheduled_obstacles: obstacles of the episode.
        grips: (n_arms,) gap of the finger pads [m] of a gripper that is closing on an object; nan for an open gripper.
    """

    joints: np.ndarray
    objects: np.ndarray
    furniture: np.ndarray = np.zeros((0, 7))
    beads: np.ndarray = np.zeros((0, 3))
    scheduled_obstacles: tuple[ScheduledObstacle, ...] = ()
    grips: np.ndarray | None = None


class Simulation:
    """A simulated scene: action in, physics, state out.

    Copies and pickles go on as the simulation would. They hold its state, not what is compiled or only looks into
    MuJoCo's memory.
    """

    def __init__(self, robot: Robot, things: SceneSpec, sides: tuple[str, ...] | None = None):
        self._build(compiled_scene(robot, things, sides))

    @classmethod
    def of(cls, scene: CompiledScene) -> Simulation:
        """Return the simulation of a scene, however it was compiled."""
        made = cls.__new__(cls)
        made._build(scene)
        return made

    def __getstate__(self) -> dict[str, Any]:
        return {
            "scene": self.scene,
            "physics": taken(self.scene.model, self.model, self.data),
            "touching": self._touching,
            "obstacles": self.obstacles.kept(),
            "nearest": self._near.so_far,
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._build(state["scene"])
        put(state["physics"], self.model, self.data)
        self._touching[:] = state["touching"]
        self.obstacles.take_over(state["obstacles"])
        self._near.so_far = state["nearest"]

    def _build(self, scene: CompiledScene) -> None:
        self.scene = scene
        self.model = copy.copy(self.scene.model)
        self.data = mujoco.MjData(self.model)
        arms, data, model = self.scene.arms, self.data, self.model
        self._widest = [self._measured_opening(arm) for arm in arms]
        self._views = (data.qpos, data.qvel, data.site_xmat, data.geom_xpos)
        self._ctrl = data.ctrl
        self._servos = np.array([arm.ctrl for arm in arms])
        self._grips = np.array([np.column_stack([arm.grip, arm.opened, arm.closed]) for arm in arms])
        offsets = [wide - self._pad_distance(arm) for wide, arm in zip(self._widest, arms, strict=True)]
        attitudes = [arm.arm.fk(q).quaternion for arm, q in zip(arms, self.scene.home, strict=True)]
        self._homes = np.column_stack([attitudes, offsets])
        self._chains = np.array([arm.arm.chain for arm in arms])
        self._frames = np.empty((arms[0].arm.dof, FRAME.width))
        self._arm_index = np.array([[*arm.qpos, *arm.qvel, arm.site, *arm.pads] for arm in arms])
        bodies, owners = self.scene.objects, FIRST_OBJECT + len(self.scene.objects)
        self._object_places = model.jnt_qposadr[model.body_jntadr[bodies]].astype(np.int64)
        self._object_index = np.column_stack([self._object_places, model.body_dofadr[bodies]])
        self._touching = np.zeros((owners, owners))
        self.obstacles = ObstacleBodies(self.scene, model, data)
        self._near = ObstacleDistance(self.scene, model, data)
        self._no_beads = np.zeros((0, 3))

    def reset(self, start: Start) -> None:
        """Put everything in place, at rest, with grippers open unless they hold an object."""
        mujoco.mj_resetData(self.model, self.data)
        grips = np.full(len(self.scene.arms), np.nan) if start.grips is None else start.grips
        for arm, q, gap, widest in zip(self.scene.arms, start.joints, grips, self._widest, strict=True):
            self._put(arm, q, 0.5 * (widest - gap) if np.isfinite(gap) else 0.0)
        for arm, q in zip(self.scene.parked, self.scene.parked_joints, strict=True):
            self._put(arm, q, 0.0)
        for address, pose in zip(self._object_places, start.objects, strict=True):
            self.data.qpos[address : address + 7] = pose
        if len(self.scene.furniture):
            self.data.mocap_pos[self.scene.furniture] = start.furniture[:, :3]
            self.data.mocap_quat[self.scene.furniture] = start.furniture[:, 3:]
        if len(start.beads):
            self.data.qpos[self.scene.beads] = start.beads
        self.obstacles.reset(start.scheduled_obstacles)
        self._near.reset()
        mujoco.mj_forward(self.model, self.data)

    def put(self, index: int, pose: np.ndarray) -> None:
        """Place an object at rest: for a human's actions, never for objects that the robot touches.

        Args:
            index: index of the object.
            pose: (7,) pose of the object, x y z [m] and wxyz.
        """
        address, dof = self._object_index[index]
        self.data.qpos[address : address + 7] = pose
        self.data.qvel[dof : dof + 6] = 0.0

    def _put(self, arm: ArmIndex, q: np.ndarray, inwards: float) -> None:
        """Put an arm at joints q (dof,), its gripper open, or closing with each finger some distance [m] inwards."""
        self.data.qpos[arm.qpos] = q
        self.data.act[arm.act] = q
        self.data.ctrl[arm.grip] = arm.closed if inwards else arm.opened
        self.data.qpos[arm.finger_qpos] = arm.finger_open + inwards * arm.finger_inwards

    def advance_obstacles(self, seconds: float, motion: float) -> None:
        """Move the obstacles to their place at a time.

        Args:
            seconds: time since the start of the episode [s].
            motion: the task's motion index.
        """
        if self.obstacles.scheduled_obstacles:
            self.obstacles.advance(seconds, motion, self._near.has_room)

    def nearest_obstacle(self) -> float:
        """Return the episode's smallest distance [m] of robot or held object to an obstacle; infinite if none."""
        if not self.obstacles.scheduled_obstacles:
            return math.inf
        return self._near.smallest(self.obstacles.active, self._touching)

    def step(self, action: np.ndarray, full: np.ndarray, bound: float, substeps: int) -> int:
        """Hold an action for some physics steps.

        Args:
            action: (n_arms * (dof + 1),) per arm its joints, then its gripper.
            full: (n_arms, dof) joint speeds [rad/s] of an entry 1.
            bound: entries are clipped to plus and minus this bound.
            substeps: number of physics steps.

        Returns:
            -1, or the index of an entry that is not finite; in this case nothing is simulated.
        """
        bad = command(action, full, bound, self._servos, self._grips, self._ctrl)
        if bad < 0:
            mujoco.mj_step(self.model, self.data, substeps)
        return bad

    def held(self) -> np.ndarray:
        """Return (n_arms, n_objects) whether the fingers of each arm touched an object in the last state read."""
        fingers = FINGERS + 2 * np.arange(len(self._servos))
        return self._touching[fingers, FIRST_OBJECT:] != 0.0

    @property
    def object_places(self) -> np.ndarray:
        """(n_objects,) addresses of the objects' poses in `qpos`."""
        return self._object_places

    def widest_opening(self, index: int) -> float:
        """Return the gap between the finger pads of an arm's open gripper [m]."""
        return self._widest[index]

    def read(self) -> State:
        """Return the present state, in new arrays."""
        (count, dof), objects = self._servos.shape, len(self._object_index)
        q, qdot, tcp, opening = np.empty((count, dof)), np.empty((count, dof)), np.empty((count, 7)), np.empty(count)
        poses, velocities = np.empty((objects, 7)), np.empty((objects, 3))
        geoms = self.data.contact.geom.copy()  # a view of one contact has another type, which would be compiled anew
        qpos, qvel, *frames = self._views
        read_arms(qpos, qvel, *frames, self._chains, self._frames, self._arm_index, self._homes, q, qdot, tcp, opening)
        read_objects(qpos, qvel, self._object_index, geoms, self.scene.owner, poses, velocities, self._touching)
        beads = qpos[self.scene.beads] if len(self.scene.beads) else self._no_beads
        return State(q, qdot, tcp, opening, poses, velocities, self._touching, beads)

    def contact_name(self, pair: tuple[int, int]) -> str:
        """Return the name of a contact between two owners, like `link5-block1`."""
        geoms = self.data.contact.geom
        owners = np.sort(self.scene.owner[geoms], axis=1)
        hit = np.flatnonzero((owners == pair).all(axis=1))[0]
        return "-".join(sorted(self.scene.labels[geom] for geom in geoms[hit]))

    def _pad_distance(self, arm: ArmIndex) -> float:
        left, right = self.data.geom_xpos[arm.pads[0]], self.data.geom_xpos[arm.pads[1]]
        closing = self.data.site_xmat[arm.site][::3]
        return abs(float((left - right) @ closing))

    def _measured_opening(self, arm: ArmIndex) -> float:
        """Measure the gap of the open pads [m]; leaves the grippers open in the state."""
        mujoco.mj_resetData(self.model, self.data)
        for each in self.scene.arms:
            self.data.qpos[each.finger_qpos] = each.finger_open
        mujoco.mj_forward(self.model, self.data)
        return mujoco.mj_geomDistance(self.model, self.data, *arm.pads, 1.0, None)


def substeps_at(control_frequency: int) -> int:
    """Return the number of physics steps per action at a control frequency [Hz].

    Raises:
        BadOption: the frequency does not divide that of the physics.
    """
    physics = round(1.0 / PHYSICS_DT)
    if isinstance(control_frequency, bool) or not isinstance(control_frequency, int) or control_frequency <= 0:
        raise BadOption("control_frequency", f"{control_frequency!r} is not a positive whole number of Hz")
    if physics % control_frequency:
        allowed = ", ".join(str(rate) for rate in range(10, physics + 1) if physics % rate == 0)
        reason = f"{control_frequency} Hz does not divide {physics} Hz; allowed: {allowed}"
        raise BadOption("control_frequency", reason)
    return physics // control_frequency
