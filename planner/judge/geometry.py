"""The judge's own geometry: placement of an arm's capsules by Pinocchio and their distances by fcl.

Not in the paper: a judge must not share the errors of the judged, so nothing here uses the planner's own
kinematics (`robot.kinematics`) or distance queries. Both sides share only the description: arm, body, obstacles.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import fcl
import numpy as np

from ..geometry.shapes import Box, Capsule, Cylinder, Mesh, Obstacle, Shape, Sphere
from ..robot.arm import Arm
from ..robot.body import BODY, Body, Hull
from ..robot.kinematics import CHAIN, REVOLUTE

UNIT = 1e4
"""fcl works in tenths of millimeters: it stops at an absolute tolerance, so that distances to cylinders in meters
are up to 0.2 mm too long, in this unit less than 1e-7 m (measured)."""


ASKED = 0.05
"""Distance [m] of a capsule below which its hull is asked."""


class Moment(NamedTuple):
    """The arm in n configurations; world frame.

    Attributes:
        time: (n,) [s].
        joints: (n, dof) [rad or m].
        axes: (n, dof, 3) unit vectors along the joints' axes.
        origins: (n, dof, 3) a point on each axis [m].
        ends: (n, m, 2, 3) ends of the capsules' cores [m].
        turns: (n, m, 3, 3) rotations of the capsules, z along the core.
        places: (n, m, 4, 4) poses of the frames that the capsules move with; (n, 0, 4, 4) for a body without hulls.
        tool: (n, 4, 4) poses of the tcp.
    """

    time: np.ndarray
    joints: np.ndarray
    axes: np.ndarray
    origins: np.ndarray
    ends: np.ndarray
    turns: np.ndarray
    places: np.ndarray
    tool: np.ndarray

    def at(self, index: Any) -> Moment:
        """Select configurations by index, slice or mask."""
        return Moment(*(array[index] for array in self))

    def joined(self, other: Moment) -> Moment:
        """Append the configurations of another moment."""
        return Moment(*(np.concatenate(pair) for pair in zip(self, other, strict=True)))


class Kinematics:
    """Kinematics of an arm and its body in Pinocchio."""

    def __init__(self, arm: Arm, body: Body):
        import pinocchio as pin

        self._pin, self._model, parent = pin, pin.Model(), 0
        for k, row in enumerate(arm.chain[:-1]):
            joint = pin.JointModelRZ() if row[CHAIN.kind] == REVOLUTE else pin.JointModelPZ()
            parent = self._model.addJoint(parent, joint, self._placement(row), f"joint{k}")
        self._data = self._model.createData()
        self._tool = self._placement(arm.chain[-1]).homogeneous
        self._frames = body.rows[:, BODY.frame].astype(int) + 1
        self._ends = np.stack([body.rows[:, BODY.a : BODY.b], body.rows[:, BODY.b : BODY.radius]], axis=1)
        self._turns = np.array([_turn_of(b - a) for a, b in self._ends]).reshape(-1, 3, 3)
        self._has_hulls = any(hull is not None for hull in body.hulls)

    def _placement(self, row: np.ndarray) -> Any:
        w, x, y, z = row[CHAIN.rotation : CHAIN.offset] / np.linalg.norm(row[CHAIN.rotation : CHAIN.offset])
        return self._pin.SE3(self._pin.Quaternion(w, x, y, z).matrix(), row[CHAIN.offset : CHAIN.kind].copy())

    def moment(self, time: np.ndarray, joints: np.ndarray) -> Moment:
        """Compute the arm's configurations.

        Args:
            time: (n,) [s].
            joints: (n, dof) [rad or m].
        """
        count, dof = joints.shape
        frames = np.zeros((count, dof + 1, 4, 4))
        frames[:, 0] = np.eye(4)
        for into, q in zip(frames, joints, strict=True):
            self._pin.forwardKinematics(self._model, self._data, q)
            for k in range(1, dof + 1):
                into[k] = self._data.oMi[k].homogeneous
        mine = frames[:, self._frames]
        ends = np.einsum("nmij,mej->nmei", mine[..., :3, :3], self._ends) + mine[..., None, :3, 3]
        turns = mine[..., :3, :3] @ self._turns
        axes, origins = frames[:, 1:, :3, 2], frames[:, 1:, :3, 3]
        places = mine if self._has_hulls else mine[:, :0]
        return Moment(time, joints, axes, origins, ends, turns, places, frames[:, -1] @ self._tool)

    def interpolated(self, path: np.ndarray, fractions: Sequence[np.ndarray]) -> np.ndarray:
        """Sample the screw motions through poses.

        Args:
            path: (k, 4, 4) homogeneous matrices.
            fractions: k - 1 arrays of fractions in [0, 1), one per step.

        Returns:
            (n, 4, 4) poses, the last pose of the path included.
        """
        poses = [self._pin.SE3(pose[:3, :3], pose[:3, 3].copy()) for pose in path]
        steps = zip(poses[:-1], poses[1:], fractions, strict=True)
        dense = [self._pin.SE3.Interpolate(a, b, float(s)) for a, b, at in steps for s in at]
        return np.array([pose.homogeneous for pose in [*dense, poses[-1]]])


def _turn_of(direction: np.ndarray) -> np.ndarray:
    """Return a rotation matrix with its z axis along a vector; the identity if the vector is zero."""
    length = np.linalg.norm(direction)
    if length < 1e-12:
        return np.eye(3)
    z = direction / length
    x = np.cross(z, np.eye(3)[int(np.abs(z).argmin())])
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


class CollisionWorld:
    """Capsules and obstacles in fcl.

    A capsule is queried by its core alone, as a capsule of radius 0, and the radius is subtracted afterwards: exact
    as long as the core stays outside, whereas fcl's own answers in penetration are not distances. Where a capsule is
    close, its hull is asked too: what the capsule covers lies in both, so the larger distance counts.
    """

    def __init__(self, body: Body, obstacles: Sequence[Obstacle]):
        lengths = np.linalg.norm(body.rows[:, BODY.b : BODY.radius] - body.rows[:, BODY.a : BODY.b], axis=1)
        self.radii = body.rows[:, BODY.radius]
        cores = [fcl.Sphere(0.0) if length < 1e-12 else fcl.Capsule(0.0, length * UNIT) for length in lengths]
        self._cores = [fcl.CollisionObject(core) for core in cores]
        self.hulls = [hull is not None for hull in body.hulls] or [False] * len(body)
        self._hulls = [None if hull is None else _hull_object(hull) for hull in body.hulls or [None] * len(body)]
        self._obstacles = [_object_of(obstacle) for obstacle in obstacles]
        self._request = fcl.DistanceRequest()
        self.velocities = np.array([o.velocity for o in obstacles]).reshape(-1, 3)
        self._places = np.array([o.pose.position for o in obstacles]).reshape(-1, 3)
        self._turns = np.array([o.pose.rotation for o in obstacles]).reshape(-1, 3, 3)
        self._boxes = np.array([_box_of(o.shape) for o in obstacles]).reshape(-1, 2, 3)

    def distances(self, moment: Moment, cells: np.ndarray) -> np.ndarray:
        """Compute distances of capsules to obstacles; at worst minus the radius, in penetration.

        Args:
            moment: configurations and times.
            cells: (c, 3) indices: configuration, capsule, obstacle.

        Returns:
            (c,) distances [m].
        """
        n, k, o = cells.T
        centers = moment.ends[n, k].mean(axis=1) - moment.time[n, None] * self.velocities[o]
        out = np.empty(len(cells))
        for c, (center, turn) in enumerate(zip(centers * UNIT, moment.turns[n, k], strict=True)):
            core, obstacle = self._cores[k[c]], self._obstacles[o[c]]
            core.setTransform(fcl.Transform(turn, center))
            out[c] = fcl.distance(core, obstacle, self._request, fcl.DistanceResult())
        out = np.maximum(out / UNIT, 0.0) - self.radii[k]
        for c in np.flatnonzero(np.array(self.hulls)[k] & (out < ASKED)):
            out[c] = max(out[c], self._hull_distance(moment, *cells[c]))
        return out

    def _hull_distance(self, moment: Moment, n: int, k: int, o: int) -> float:
        """Distance [m] of a capsule's hull from an obstacle; minus infinity if they touch."""
        known = self._hulls[k]
        assert known is not None
        hull, rounding = known
        place = moment.places[n, k]
        position = place[:3, 3] - moment.time[n] * self.velocities[o]
        hull.setTransform(fcl.Transform(place[:3, :3], UNIT * position))
        found = fcl.distance(hull, self._obstacles[o], self._request, fcl.DistanceResult()) / UNIT
        return found - rounding if found > 0.0 else -np.inf

    def at_least(self, moment: Moment) -> np.ndarray:
        """Return lower bounds (n, m, k) of all distances [m]: from the core's center to a box around the obstacle."""
        a, b = moment.ends[:, :, 0], moment.ends[:, :, 1]
        reach = 0.5 * np.linalg.norm(b - a, axis=-1) + self.radii
        out = np.empty((*reach.shape, len(self._places)))
        for o, (place, turn, (middle, half)) in enumerate(zip(self._places, self._turns, self._boxes, strict=True)):
            center = place + moment.time[:, None, None] * self.velocities[o]
            beyond = np.abs((0.5 * (a + b) - center) @ turn - middle) - half
            out[:, :, o] = np.linalg.norm(np.maximum(beyond, 0.0), axis=-1) - reach
        return out


def _box_of(shape: Shape) -> tuple[np.ndarray, np.ndarray]:
    """Return center and half extents of a box that contains a shape, in the shape's own frame."""
    if isinstance(shape, Mesh):
        low, high = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
        return 0.5 * (low + high), 0.5 * (high - low)
    if isinstance(shape, Sphere):
        return np.zeros(3), np.full(3, shape.radius)
    if isinstance(shape, Box):
        return np.zeros(3), 0.5 * np.array(shape.size)
    ends = shape.radius if isinstance(shape, Capsule) else 0.0
    return np.zeros(3), np.array([shape.radius, shape.radius, 0.5 * shape.length + ends])


def _hull_object(hull: Hull) -> tuple[Any, float]:
    """Return a hull in fcl, in its own frame, and its rounding radius [m]."""
    return fcl.CollisionObject(fcl_convex(UNIT * np.asarray(hull.corners))), hull.rounding


def _object_of(obstacle: Obstacle) -> Any:
    place = fcl.Transform(obstacle.pose.rotation, UNIT * obstacle.pose.position)
    return fcl.CollisionObject(fcl_geometry(obstacle.shape), place)


def fcl_geometry(shape: Shape) -> Any:
    """Return a shape as fcl geometry, in its own frame, with lengths in `UNIT`."""
    if isinstance(shape, Sphere):
        return fcl.Sphere(UNIT * shape.radius)
    if isinstance(shape, Capsule):
        return fcl.Capsule(UNIT * shape.radius, UNIT * shape.length)
    if isinstance(shape, Box):
        return fcl.Box(*(UNIT * extent for extent in shape.size))
    if isinstance(shape, Cylinder):
        return fcl.Cylinder(UNIT * shape.radius, UNIT * shape.length)
    return fcl_convex(UNIT * shape.vertices)


def fcl_convex(vertices: np.ndarray) -> Any:
    """Return a convex polyhedron with outward triangles, from vertices (n, 3) in `UNIT`."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(vertices)
    corners = vertices[hull.simplices]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inwards = np.einsum("ij,ij->i", normals, hull.equations[:, :3]) < 0
    triangles = np.where(inwards[:, None], hull.simplices[:, [0, 2, 1]], hull.simplices)
    faces = np.column_stack([np.full(len(triangles), 3), triangles])
    return fcl.Convex(vertices, len(triangles), faces.ravel())
