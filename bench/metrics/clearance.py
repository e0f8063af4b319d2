"""Clearance of robot and held object from obstacles, judged by python-fcl on the robot's real collision geometry.

Not in the paper: the judge of all methods must share no code with any of them. This module uses neither the planner's
capsules and distance queries nor the simulator's (`envs/simulation/obstacle_distance.py`), only the compiled model's
collision geoms, placed by the measured joints.
"""

from __future__ import annotations

from typing import Any, NamedTuple
from weakref import WeakKeyDictionary, proxy

import fcl
import numpy as np

from ...envs.mujoco_library import mujoco
from ...envs.scene.scene import FIRST_OBJECT
from ...envs.simulation.obstacle_distance import ROBOT
from ...planner import Box, Capsule, Cylinder, Shape, Sphere
from ...planner.geometry.shapes import core_of
from ...planner.judge.geometry import UNIT, fcl_convex, fcl_geometry
from .trace import Trace, geom_poses

SOLID = mujoco.mjtGeom
AT_ONCE = 4000
"""Number of pairs of a geom and an obstacle sorted per batch."""


class Clearance(NamedTuple):
    """Smallest distances of an episode [m]: 0 at contact, None if there was nothing to measure.

    Attributes:
        robot: distance of any link, hand or finger to an obstacle.
        held: distance of the held object to an obstacle.
        second: time at which the smaller distance was reached [s].
    """

    robot: float | None
    held: float | None
    second: float | None

    @property
    def smallest(self) -> float | None:
        """The smaller of the two distances [m]."""
        return min((value for value in (self.robot, self.held) if value is not None), default=None)


class Solids:
    """The collision geoms of a simulation's robot and objects in fcl; built once for many episodes."""

    def __init__(self, sim: Any):
        model, owner = sim.model, sim.scene.owner
        solid = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
        known = np.isin(owner, ROBOT) | ((owner >= FIRST_OBJECT) & (owner < FIRST_OBJECT + len(sim.scene.objects)))
        self.geoms = np.flatnonzero(solid & known & (model.geom_type != SOLID.mjGEOM_PLANE))
        self.owner = np.maximum(owner[self.geoms] - FIRST_OBJECT, -1)
        """(g,) index of the object that owns the geom; -1: the robot."""
        self.middle, self.half = model.geom_aabb[self.geoms, :3], model.geom_aabb[self.geoms, 3:]
        self.bodies = [fcl.CollisionObject(_geometry(model, int(geom))) for geom in self.geoms]
        self._sim = proxy(sim)

    def clearance(self, trace: Trace) -> Clearance:
        """Return the smallest distances of an episode."""
        ticks = np.flatnonzero(trace.active.any(axis=1))
        if not len(ticks):
            return Clearance(None, None, None)
        places, turns = geom_poses(self._sim, trace, ticks, self.geoms)
        touched = trace.held[ticks].any(axis=1)
        wanted = np.where(self.owner < 0, True, touched[:, self.owner])
        robot, first = self._nearest(trace, ticks, places, turns, wanted & (self.owner < 0))
        held, second = self._nearest(trace, ticks, places, turns, wanted & (self.owner >= 0))
        when = first if held is None or (robot is not None and robot <= held) else second
        return Clearance(robot, held, None if when is None else float(trace.time[when]))

    def _nearest(
        self, trace: Trace, ticks: np.ndarray, places: np.ndarray, turns: np.ndarray, wanted: np.ndarray
    ) -> tuple[float | None, int | None]:
        """Return the smallest distance [m] over ticks and geoms (t, g) and its tick, by best-first search."""
        slots = np.flatnonzero(trace.kinds > 0)
        bounds = np.stack([self._at_least(trace, ticks, places, turns, slot) for slot in slots], axis=-1)
        bounds[~(wanted[:, :, None] & trace.active[ticks][:, None, slots])] = np.inf
        flat, best, when = bounds.ravel(), np.inf, None
        request, obstacles = fcl.DistanceRequest(), [_obstacle(trace.shape(slot)) for slot in slots]
        while np.isfinite(least := flat.min(initial=np.inf)) and least < best:
            count = min(AT_ONCE, len(flat))
            part = np.argpartition(flat, count - 1)[:count]
            for cell in part[np.argsort(flat[part])]:
                if flat[cell] >= best:
                    break
                row, geom, k = np.unravel_index(cell, bounds.shape)
                body, other = self.bodies[geom], obstacles[k]
                body.setTransform(fcl.Transform(turns[row, geom], UNIT * places[row, geom]))
                pose = trace.obstacles[ticks[row], slots[k]]
                other.setTransform(fcl.Transform(pose[3:], UNIT * pose[:3]))
                distance = max(fcl.distance(body, other, request, fcl.DistanceResult()) / UNIT, 0.0)
                if distance < best:
                    best, when = distance, int(ticks[row])
            flat[part] = np.inf
        return (None, None) if when is None else (float(best), when)

    def _at_least(
        self, trace: Trace, ticks: np.ndarray, places: np.ndarray, turns: np.ndarray, slot: int
    ) -> np.ndarray:
        """Return lower bounds (t, g) [m]: obstacle's center to the geom's box, minus the obstacle's bounding radius."""
        away = trace.obstacles[ticks, slot, None, :3] - places
        beyond = np.abs(np.einsum("tgij,tgi->tgj", turns, away) - self.middle) - self.half
        return np.linalg.norm(np.maximum(beyond, 0.0), axis=-1) - core_of(trace.shape(slot))[3]


def solids_of(sim: Any) -> Solids:
    """Return the solids of a simulation, built at the first call."""
    if sim not in _MADE:
        _MADE[sim] = Solids(sim)
    return _MADE[sim]


_MADE: WeakKeyDictionary[Any, Solids] = WeakKeyDictionary()


def _obstacle(shape: Shape) -> Any:
    return fcl.CollisionObject(fcl_geometry(shape))


def _geometry(model: mujoco.MjModel, geom: int) -> Any:
    """Return a geom in fcl; a mesh becomes its convex hull, as in MuJoCo's collision checks."""
    kind, (x, y, z) = int(model.geom_type[geom]), (float(size) for size in model.geom_size[geom])
    if kind == SOLID.mjGEOM_MESH:
        first, count = (int(table[model.geom_dataid[geom]]) for table in (model.mesh_vertadr, model.mesh_vertnum))
        return fcl_convex(UNIT * model.mesh_vert[first : first + count].astype(np.float64))
    if kind == SOLID.mjGEOM_BOX:
        return fcl_geometry(Box((2.0 * x, 2.0 * y, 2.0 * z)))
    if kind == SOLID.mjGEOM_SPHERE:
        return fcl_geometry(Sphere(x))
    if kind == SOLID.mjGEOM_CAPSULE:
        return fcl_geometry(Capsule(x, 2.0 * y))
    if kind == SOLID.mjGEOM_CYLINDER:
        return fcl_geometry(Cylinder(x, 2.0 * y))
    raise TypeError(f"a collision geom of MuJoCo's type {kind} has no counterpart in fcl")
