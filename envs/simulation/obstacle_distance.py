"""Distances of the robot to obstacles: exact, between MuJoCo's collision geoms, computed only where needed."""

from __future__ import annotations

import math

import numpy as np

from ...planner.geometry.pose import Pose
from ...planner.jit import kernel
from ..mujoco_library import mujoco
from ..scene.scene import ARM, FINGERS, FIRST_OBJECT, OTHER_ARM, OTHER_FINGERS, CompiledScene
from .moving_obstacles import CLEARANCE

FAR = 10.0
"""Largest distance that is computed [m]."""
NUDGES = 1e-6 * np.vstack([np.eye(3), -np.eye(3)])
ROBOT = (ARM, FINGERS, OTHER_ARM, OTHER_FINGERS)


@kernel
def _candidates(places, bounds, geoms, center, bound, best, found):
    """Collect the geoms that, by their bounding balls, may be nearer than `best` to a body; return their number."""
    count = 0
    for i in range(len(geoms)):
        geom = geoms[i]
        square = 0.0
        for k in range(3):
            square += (places[geom, k] - center[k]) ** 2
        if math.sqrt(square) - bounds[geom] - bound < best:
            found[count] = geom
            count += 1
    return count


class ObstacleDistance:
    """Distances of a simulated robot, and of objects it holds, to obstacles.

    Attributes:
        so_far: smallest distance [m] of the episode up to now.
    """

    def __init__(self, scene: CompiledScene, model: mujoco.MjModel, data: mujoco.MjData):
        self._model, self._data = model, data
        solid = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
        self._robot = np.flatnonzero(solid & np.isin(scene.owner, ROBOT))
        count = len(scene.objects)
        self._objects = [np.flatnonzero(solid & (scene.owner == FIRST_OBJECT + k)) for k in range(count)]
        self._solid = scene.obstacles[:, 1]
        self._found = np.zeros(model.ngeom, dtype=np.int64)
        self.so_far = math.inf

    def reset(self) -> None:
        """Forget the previous episode."""
        self.so_far = math.inf

    def smallest(self, active: np.ndarray, touching: np.ndarray) -> float:
        """Return the smallest distance [m] so far in the episode, including the present one.

        Args:
            active: (n,) whether each obstacle is present.
            touching: (owners, owners) contacts, see `State`; objects touched by the fingers count as held.
        """
        for slot in np.flatnonzero(active):
            self._take(slot, self._robot)
            for k, geoms in enumerate(self._objects):
                if touching[FINGERS, FIRST_OBJECT + k] or touching[OTHER_FINGERS, FIRST_OBJECT + k]:
                    self._take(slot, geoms)
        return self.so_far

    def has_room(self, slot: int, pose: Pose) -> bool:
        """Return whether an obstacle may appear at a pose: the robot and all objects are `CLEARANCE` away.

        Args:
            slot: index of the obstacle.
            pose: pose of the obstacle in the world.
        """
        data, geom = self._data, self._solid[slot]
        # MuJoCo recomputes both at the next step
        data.geom_xpos[geom], data.geom_xmat[geom] = pose.position, pose.rotation.ravel()
        return all(self._nearest(slot, geoms, CLEARANCE) >= CLEARANCE for geoms in (self._robot, *self._objects))

    def _take(self, slot: int, geoms: np.ndarray) -> None:
        self.so_far = self._nearest(slot, geoms, self.so_far)

    def _nearest(self, slot: int, geoms: np.ndarray, best: float) -> float:
        """Return the smaller of `best` and the distance [m] of an obstacle to the given geoms."""
        model, data, own = self._model, self._data, int(self._solid[slot])
        center, bound = data.geom_xpos[own], model.geom_rbound[own]
        count = _candidates(data.geom_xpos, model.geom_rbound, geoms, center, bound, best, self._found)
        for geom in self._found[:count]:
            best = min(best, self._distance(int(geom), own, min(best, FAR)))
        return best

    def _distance(self, geom: int, own: int, farthest: float) -> float:
        """Return MuJoCo's distance [m]; where it is exactly zero, the distance with the obstacle nudged.

        Up to MuJoCo 3.9 at least, about one in a thousand distances to meshes and boxes comes out as 0.0 for geoms that
        are centimeters apart; with one of them moved by a micrometer, the distance is right.
        """
        distance = mujoco.mj_geomDistance(self._model, self._data, geom, own, farthest, None)
        if distance != 0.0:
            return distance
        place = self._data.geom_xpos[own].copy()
        for nudge in NUDGES:
            self._data.geom_xpos[own] = place + nudge
            distance = max(distance, mujoco.mj_geomDistance(self._model, self._data, geom, own, farthest, None))
        self._data.geom_xpos[own] = place
        return distance
