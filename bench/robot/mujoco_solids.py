"""The true shapes of the bodies of a compiled MuJoCo model: MuJoCo places them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ...planner.models.mujoco_model import geoms_of, mujoco_joint_names, solid_geoms
from .true_solids import TrueShape, TrueSolids, box_shape, ellipsoid_shape, mesh_shape, round_shape

ROUND = {2: "Sphere", 3: "Capsule", 5: "Cylinder"}
"""mjGEOM_SPHERE, CAPSULE and CYLINDER."""
ELLIPSOID, BOX, MESHES = 4, 6, (7, 8)
"""mjGEOM_ELLIPSOID and BOX; mjGEOM_MESH and SDF."""


class MujocoSolids(TrueSolids):
    """The geoms that can collide, but planes and height fields, which are no solids of an arm.

    Joints that are neither the arm's nor held stand at their reference, or at the nearer limit.

    Args:
        model: `mujoco.MjModel`.
        joint_names: of the arm.
        held: joint name: position [rad or m].
        names: of each body from 1 on, "" for those that do not count.
        visuals: bodies of which no geom collides have all of their geoms.
    """

    def __init__(
        self,
        model: Any,
        joint_names: Sequence[str],
        held: Mapping[str, float],
        names: Sequence[str],
        *,
        visuals: bool = False,
    ):
        from ...envs.mujoco_library import mujoco

        self._mujoco, self._model, self._data = mujoco, model, mujoco.MjData(model)
        self._geoms = [
            (geom, name)
            for body, name in enumerate(names, start=1)
            for geom in (solid_geoms(model, body) or (geoms_of(model, body) if visuals else ()))
            if name and int(model.geom_type[geom]) in (*ROUND, ELLIPSOID, BOX, *MESHES)
        ]
        known = mujoco_joint_names(model)
        address = {name: int(model.jnt_qposadr[k]) for k, name in enumerate(known)}
        self._rest = _start(model)
        for name, value in held.items():
            if int(model.jnt_type[known.index(name)]) in (2, 3):  # a free or ball joint stays where the model has it
                self._rest[address[name]] = value
        self._own = [address[name] for name in joint_names]
        moved = {int(model.jnt_bodyid[known.index(name)]) for name in joint_names}
        self._moving = frozenset(k for k, (geom, _) in enumerate(self._geoms) if moved & set(self._above(geom)))
        super().__init__(_shape_of(model, geom, name) for geom, name in self._geoms)

    @property
    def moving(self) -> frozenset[int]:
        """Indices of the elements that the arm moves."""
        return self._moving

    def _above(self, geom: int) -> Iterator[int]:
        """Yield the body of a geom and all bodies above it."""
        body = int(self._model.geom_bodyid[geom])
        while body != 0:
            yield body
            body = int(self._model.body_parentid[body])

    def _poses(self, q: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        self._data.qpos[:] = self._rest
        self._data.qpos[self._own] = q
        self._mujoco.mj_kinematics(self._model, self._data)
        for geom, _ in self._geoms:
            yield self._data.geom_xmat[geom].reshape(3, 3).copy(), self._data.geom_xpos[geom].copy()


def _start(model: Any) -> np.ndarray:
    """Return the reference configuration, joints that turn or slide within their limits."""
    start = np.array(model.qpos0, dtype=np.float64)
    for k in range(int(model.njnt)):
        if model.jnt_limited[k] and int(model.jnt_type[k]) in (2, 3):  # mjJNT_SLIDE and mjJNT_HINGE
            place = int(model.jnt_qposadr[k])
            start[place] = np.clip(start[place], *model.jnt_range[k])
    return start


def _shape_of(model: Any, geom: int, link: str) -> TrueShape:
    kind, size = int(model.geom_type[geom]), np.array(model.geom_size[geom], dtype=np.float64)
    if kind in ROUND:
        return round_shape(link, ROUND[kind], float(size[0]), 2.0 * float(size[1]))
    if kind == ELLIPSOID:
        return ellipsoid_shape(link, size)
    if kind == BOX:
        return box_shape(link, 2.0 * size)
    mesh = int(model.geom_dataid[geom])
    first, face = int(model.mesh_vertadr[mesh]), int(model.mesh_faceadr[mesh])
    vertices = np.array(model.mesh_vert[first : first + int(model.mesh_vertnum[mesh])], dtype=np.float64)
    return mesh_shape(link, vertices[np.array(model.mesh_face[face : face + int(model.mesh_facenum[mesh])])])
