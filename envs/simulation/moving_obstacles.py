"""Obstacle bodies: solid, kinematic (mocap), scheduled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...planner import Box, Capsule, Pose, Shape, Sphere
from ...planner.geometry.shapes import SHAPE_KIND
from ..mujoco_library import mujoco
from ..scene.scene import CompiledScene
from ..scene.scene_objects import extents, half_sizes

KINDS: dict[type, float] = {Sphere: SHAPE_KIND.sphere, Box: SHAPE_KIND.box, Capsule: SHAPE_KIND.capsule}
"""Codes of `obstacle_shape`; 0 for no obstacle."""
GEOM = {
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
}
PARKED_AT = (0.0, 0.0, -3.0)
"""Position of an inactive obstacle [m]."""
CLEARANCE = 0.05
"""Least distance [m] of an appearing obstacle to the robot and all objects; the obstacle waits until it has it."""


@dataclass(frozen=True)
class ScheduledObstacle:
    """A scheduled obstacle, with its center at `center + long sin(w t + phase) + short cos(w t + phase)`.

    Attributes:
        shape: sphere, box or capsule.
        center: (3,) center of the trajectory [m].
        rotation: (4,) constant rotation, wxyz.
        long: (3,) one half axis of the elliptic trajectory [m]; zero for a static obstacle.
        short: (3,) other half axis [m], perpendicular to `long`.
        frequency: angular frequency w [rad/s].
        phase: phase [rad].
        motion: index of the task's motion during which the obstacle appears; 0: present from the start.
        delay: time after the start of that motion [s].
        blocked_motion: index of the motion that the obstacle was placed to block.
    """

    shape: Shape
    center: tuple[float, float, float]
    rotation: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)
    long: tuple[float, float, float] = (0.0, 0.0, 0.0)
    short: tuple[float, float, float] = (0.0, 0.0, 0.0)
    frequency: float = 0.0
    phase: float = 0.0
    motion: int = 0
    delay: float = 0.0
    blocked_motion: int = 0

    def position(self, seconds: float) -> np.ndarray:
        """Return the center (3,) [m] at a time [s]."""
        angle = self.frequency * seconds + self.phase
        return np.array(self.center) + np.sin(angle) * np.array(self.long) + np.cos(angle) * np.array(self.short)

    def velocity(self, seconds: float) -> np.ndarray:
        """Return the velocity (3,) [m/s] of the center at a time [s]."""
        angle = self.frequency * seconds + self.phase
        along, across = np.cos(angle) * np.array(self.long), np.sin(angle) * np.array(self.short)
        return self.frequency * (along - across)

    def pose(self, seconds: float) -> Pose:
        """Return the pose at a time [s]."""
        return Pose.from_position_quaternion(self.position(seconds), self.rotation)


def described(shape: Shape) -> np.ndarray:
    """Return a shape's `obstacle_size` (3,) [m]: extents; radius, radius, length; or radius, radius, radius.

    Raises:
        TypeError: the shape is no box, capsule or sphere.
    """
    if isinstance(shape, Box):
        return np.array(shape.size)
    if isinstance(shape, Capsule):
        return np.array([shape.radius, shape.radius, shape.length])
    if isinstance(shape, Sphere):
        return np.array([shape.radius] * 3)
    raise TypeError(f"an obstacle is a sphere, a box or a capsule, not {type(shape).__name__}")


class ObstacleBodies:
    """Obstacles of an episode in a simulation's model and data, and their observation.

    Attributes:
        scheduled_obstacles: obstacles of this episode.
        active: (n,) whether each obstacle is present.
    """

    def __init__(self, scene: CompiledScene, model: mujoco.MjModel, data: mujoco.MjData):
        self._index, self._model, self._data = scene.obstacles, model, data
        self._mocap = model.body_mocapid[scene.obstacles[:, 0]]
        count = len(scene.obstacles)
        self.scheduled_obstacles: tuple[ScheduledObstacle, ...] = ()
        self.active = np.zeros(count, dtype=bool)
        self._due = np.full(count, np.inf)

    @property
    def count(self) -> int:
        """Largest number of obstacles at once."""
        return len(self._index)

    def reset(self, scheduled_obstacles: tuple[ScheduledObstacle, ...]) -> None:
        """Take over the obstacles of a new episode; those present from the start are put in place."""
        self.scheduled_obstacles = scheduled_obstacles
        self.active[:] = False
        self._due[:] = np.inf
        for slot in range(self.count):
            self._park(slot)
        for slot, each in enumerate(scheduled_obstacles):
            self._form(slot, each.shape)
            if each.motion == 0:
                self._due[slot] = 0.0
                self._show(slot, 0.0)

    def kept(self) -> tuple[Any, ...]:
        """Return what a copy takes over, beside what stands in model and data."""
        return self.scheduled_obstacles, self.active, self._due

    def take_over(self, kept: tuple[Any, ...]) -> None:
        """Continue another's episode; see `kept`."""
        self.scheduled_obstacles, self.active[:], self._due[:] = kept

    def advance(self, seconds: float, motion: float, has_room: Any) -> None:
        """Move all obstacles to their place at a time, and make due ones appear.

        Args:
            seconds: time since the episode's start [s], at the end of the coming control step.
            motion: index of the current motion.
            has_room: function of slot and pose that returns whether an obstacle may appear there.
        """
        for slot, each in enumerate(self.scheduled_obstacles):
            if self.active[slot]:
                if each.frequency:
                    self._data.mocap_pos[self._mocap[slot]] = each.position(seconds)
                continue
            if np.isinf(self._due[slot]) and motion >= each.motion:
                self._due[slot] = seconds + each.delay
            if seconds >= self._due[slot] and has_room(slot, each.pose(seconds)):
                self._show(slot, seconds)

    def observed(self, seconds: float) -> dict[str, np.ndarray]:
        """Return the obstacle entries of the observation at a time [s], in new arrays."""
        entries = self._blank()
        if not self.scheduled_obstacles:
            return entries
        for slot in np.flatnonzero(self.active):
            each = self.scheduled_obstacles[slot]
            entries["obstacle_active"][slot] = 1.0
            entries["obstacle_shape"][slot] = KINDS[type(each.shape)]
            entries["obstacle_size"][slot] = described(each.shape)
            entries["obstacle_pose"][slot] = each.pose(seconds).vector
            entries["obstacle_velocity"][slot] = each.velocity(seconds)
        return entries

    def _blank(self) -> dict[str, np.ndarray]:
        rows = {"active": (), "shape": (), "size": (3,), "pose": (7,), "velocity": (3,)}
        return {f"obstacle_{key}": np.zeros((self.count, *shape)) for key, shape in rows.items()}

    def _form(self, slot: int, shape: Shape) -> None:
        """Give a slot's geoms a shape, and the bounds for MuJoCo's broad phase."""
        model, (body, solid, seen) = self._model, self._index[slot]
        kind, half = half_sizes(shape)
        box = np.concatenate([np.zeros(3), 0.5 * extents(shape)])
        for geom in (solid, seen):
            model.geom_type[geom], model.geom_size[geom] = GEOM[kind], half
            model.geom_rbound[geom] = np.linalg.norm(box[3:]) if kind == "box" else box[3:].max()
            model.geom_aabb[geom] = box
        nodes = slice(model.body_bvhadr[body], model.body_bvhadr[body] + model.body_bvhnum[body])
        model.bvh_aabb[nodes] = box

    def _show(self, slot: int, seconds: float) -> None:
        pose, solid = self.scheduled_obstacles[slot].pose(seconds), self._index[slot, 1]
        self._model.geom_contype[solid] = self._model.geom_conaffinity[solid] = 1
        self._data.mocap_pos[self._mocap[slot]] = pose.position
        self._data.mocap_quat[self._mocap[slot]] = pose.quaternion
        self.active[slot] = True

    def _park(self, slot: int) -> None:
        solid = self._index[slot, 1]
        self._model.geom_contype[solid] = self._model.geom_conaffinity[solid] = 0
        self._data.mocap_pos[self._mocap[slot]] = PARKED_AT
