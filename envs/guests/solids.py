"""Collision geoms of a model's bodies as convex solids that contain them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...planner import Mesh, Obstacle, Pose, Shape
from ...planner.geometry.hulls import corner_points
from ...planner.geometry.shapes import MAX_VERTICES, hull_corners
from ..mujoco_library import mujoco
from ..scene.fixed_shapes import geom_shape, mesh_points, some_corners


def solid_geoms(model: mujoco.MjModel, bodies: Sequence[int]) -> list[int]:
    """Return the geoms of some bodies that collide with anything, in the order of the model.

    Args:
        model: compiled model.
        bodies: body ids.
    """
    solid = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    return [int(geom) for geom in np.flatnonzero(solid & np.isin(model.geom_bodyid, list(bodies)))]


def body_solids(model: mujoco.MjModel, body: int, geoms: Sequence[int], name: str) -> tuple[Obstacle, ...]:
    """Return geoms as convex solids in the frame of a body: primitives as they are, meshes as their hulls.

    Specks, of which some models build the round end of a rod, become one hull together.

    Args:
        model: compiled model.
        body: body id of the frame.
        geoms: geoms that do not move in this frame.
        name: name of the solids.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    body_from_world = _pose(data.xpos[body], data.xmat[body]).inverse()
    found, specks = [], []
    for geom in geoms:
        pose = body_from_world @ _pose(data.geom_xpos[geom], data.geom_xmat[geom])
        shape = _shape(model, geom)
        if shape is None:
            specks.append(_moved(pose, _speck_corners(model.geom_size[geom])))
        else:
            found.append(Obstacle(shape, pose, name=name))
    if specks:
        found.append(Obstacle(containing_hull(np.concatenate(specks)), name=name))
    return tuple(found)


def hull_of(parts: Sequence[Obstacle]) -> Shape:
    """Return the convex hull of solids in their common frame; of a single one that is centered there, its shape."""
    if len(parts) == 1 and np.allclose(parts[0].pose.dq, Pose.identity().dq, atol=1e-12):
        return parts[0].shape
    return containing_hull(np.concatenate([_moved(part.pose, corner_points(part.shape)) for part in parts]))


def containing_hull(points: np.ndarray) -> Mesh:
    """Return a convex polyhedron that contains points (n, 3) [m]: their hull, or with fewer corners a larger one."""
    from scipy.spatial import ConvexHull

    corners = points[hull_corners(points)]
    if len(corners) <= MAX_VERTICES:
        return Mesh(corners)
    kept = some_corners(corners)
    middle, facets = kept.mean(axis=0), ConvexHull(kept).equations
    inner = -(facets[:, :3] @ middle + facets[:, 3])
    grown = ((corners - middle) @ facets[:, :3].T / inner).max()
    return Mesh(middle + grown * (kept - middle))


def _shape(model: mujoco.MjModel, geom: int) -> Shape | None:
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
        return containing_hull(mesh_points(model, geom))
    return geom_shape(model, geom)


def _speck_corners(half: np.ndarray) -> np.ndarray:
    """Return the corners (8, 3) of a box that contains a primitive of any kind, given its half sizes (3,)."""
    x, y, z = (float(each) for each in half)
    box = (x, y, z) if min(x, y, z) > 0.0 else (x, x, x + y)  # a sphere, capsule or cylinder has fewer sizes
    return np.array([[i * box[0], j * box[1], k * box[2]] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])


def _pose(position: np.ndarray, matrix: np.ndarray) -> Pose:
    whole = np.eye(4)
    whole[:3, :3], whole[:3, 3] = matrix.reshape(3, 3), position
    return Pose.from_matrix(whole)


def _moved(pose: Pose, points: np.ndarray) -> np.ndarray:
    return points @ pose.rotation.T + pose.position
