"""Collision geoms of a model that never move, as shapes in the world."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ...planner import Box, Capsule, Cylinder, Mesh, Obstacle, Pose, Shape, Sphere
from ...planner.geometry.shapes import MAX_VERTICES, hull_corners
from ..mujoco_library import mujoco

PREFIX = "robot0_"
"""robosuite's name prefix of the parts of the robot."""
SPECK = 0.005
"""Spheres and boxes smaller than this [m] are skipped: some models use one as a placeholder."""


def static_shapes(model: mujoco.MjModel, geoms: Iterable[int]) -> tuple[Obstacle, ...]:
    """Return the collision geoms that are fixed to the world, planes and specks excluded.

    A mesh becomes its convex hull, which MuJoCo collides with, thinned to the number of corners that a shape may have.

    Args:
        model: compiled model.
        geoms: indices of the geoms to consider.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    found = []
    for geom in geoms:
        solid = model.geom_contype[geom] or model.geom_conaffinity[geom]
        if solid and model.body_weldid[model.geom_bodyid[geom]] == 0:
            shape = geom_shape(model, int(geom))
            if shape is not None:
                matrix = np.eye(4)
                matrix[:3, :3], matrix[:3, 3] = data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom]
                name = model.body(model.geom_bodyid[geom]).name.removeprefix(PREFIX)
                found.append(Obstacle(shape, Pose.from_matrix(matrix), name=name))
    return tuple(found)


def geom_shape(model: mujoco.MjModel, geom: int) -> Shape | None:
    """Return the shape of a geom from MuJoCo's half sizes; None for planes and specks.

    Args:
        model: compiled model.
        geom: index of the geom; of a mesh with too many corners only some are kept.
    """
    known, kind = mujoco.mjtGeom, int(model.geom_type[geom])
    x, y, z = (float(size) for size in model.geom_size[geom])
    if kind == known.mjGEOM_MESH:
        points = mesh_points(model, geom)
        return Mesh(some_corners(points[hull_corners(points)]))
    if kind == known.mjGEOM_PLANE or max(x, y, z) < SPECK:
        return None
    if kind == known.mjGEOM_BOX:
        return Box((2.0 * x, 2.0 * y, 2.0 * z))
    if kind == known.mjGEOM_CYLINDER:
        return Cylinder(x, 2.0 * y)
    return Sphere(x) if kind == known.mjGEOM_SPHERE else Capsule(x, 2.0 * y)


def mesh_points(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """Return the vertices (n, 3) [m] of a geom's mesh, in the geom's frame.

    Args:
        model: compiled model.
        geom: index of the geom.
    """
    mesh = int(model.geom_dataid[geom])
    first = int(model.mesh_vertadr[mesh])
    return model.mesh_vert[first : first + int(model.mesh_vertnum[mesh])].astype(np.float64)


def some_corners(corners: np.ndarray) -> np.ndarray:
    """Return the corners (n, 3) of a hull; if too many for a shape, the farthest in evenly spread directions."""
    if len(corners) <= MAX_VERTICES:
        return corners
    k = np.arange(MAX_VERTICES)
    height, turn = 1.0 - (2.0 * k + 1.0) / MAX_VERTICES, k * np.pi * (3.0 - np.sqrt(5.0))
    around = np.sqrt(1.0 - height**2)
    directions = np.column_stack([around * np.cos(turn), around * np.sin(turn), height])
    return corners[np.unique(np.argmax(corners @ directions.T, axis=0))]
