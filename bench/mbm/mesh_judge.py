"""A judge of motions by a robot's true meshes: Pinocchio places them, fcl finds contacts; it shares nothing with plans.

It samples: between two samples no joint moves more than a step. What the planner proves, it can only contradict.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...configs import BadConfig
from ...planner import Box, Capsule, Cylinder, Obstacle, Sphere
from .robot import TrackRobot

STEP = 0.01
"""Largest change [rad or m] of any joint between two samples."""
OWN_EVERY = 4
"""Samples from one check of the robot's own parts to the next: they move less than the arm through the world."""


class Contact(NamedTuple):
    """A pair in contact.

    Attributes:
        sample: index of the sample.
        link: of the robot.
        other: obstacle, or another link.
    """

    sample: int
    link: str
    other: str


class MeshJudge:
    """Judge of one robot.

    Args:
        robot: its model is read anew, with Pinocchio.

    Raises:
        BadConfig: the model or its SRDF cannot be read, or a joint is not in it.
    """

    def __init__(self, robot: TrackRobot):
        import pinocchio as pin

        self._pin, urdf = pin, robot.files.urdf
        folders = [str(folder) for folder in urdf.resolve().parents]
        try:
            self._model = pin.buildModelFromUrdf(str(urdf))
            geometry = pin.buildGeomFromUrdf(self._model, str(urdf), pin.COLLISION, package_dirs=folders)
        except (ValueError, RuntimeError) as error:
            raise BadConfig(urdf, "collision geometry", str(error).strip().splitlines()[0]) from None
        self._geometry, self._data = geometry, self._model.createData()
        self._placed = geometry.createData()
        items = geometry.geometryObjects
        self._links = [str(self._model.frames[int(item.parentFrame)].name) for item in items]
        self._solids = [_solid_of(item, urdf) for item in items]
        boxes = [_box_of(item) for item in items]
        self._centers = [0.5 * (low + high) for low, high in boxes]
        self._balls = np.array([0.5 * np.linalg.norm(high - low) for low, high in boxes])
        self._base = robot.files.world_from_base
        self._rest = pin.neutral(self._model)
        for name, value in robot.others.items():
            self._put(self._rest, self._joint(name, urdf), value)
        self._moving = [self._joint(name, urdf) for name in robot.arm.joint_names]
        own = pairs_of_links(self._links, _neighbors(self._model, items), robot.files.srdf)
        self._own = [pair for pair in own if not self._is_fixed(items, *pair)]
        # the root cannot run into what stands still
        self._free = {k for k, item in enumerate(items) if int(item.parentJoint) > 0}

    def _joint(self, name: str, urdf: Path) -> Any:
        if not self._model.existJointName(name):
            raise BadConfig(urdf, name, f"no such joint; known: {', '.join(self._model.names[1:])}")
        joint = self._model.joints[self._model.getJointId(name)]
        if int(joint.nv) != 1:
            raise BadConfig(urdf, name, "is neither a hinge nor a slide")
        return joint

    @staticmethod
    def _put(q: np.ndarray, joint: Any, value: float) -> None:
        """Write a joint's position [rad or m] into a configuration: of an endless joint its cosine and sine."""
        first, count = int(joint.idx_q), int(joint.nq)
        q[first : first + count] = value if count == 1 else (np.cos(value), np.sin(value))

    @staticmethod
    def _is_fixed(items: Any, first: int, second: int) -> bool:
        return int(items[first].parentJoint) == int(items[second].parentJoint)

    def first_contact(self, joints: np.ndarray, obstacles: Sequence[Obstacle]) -> Contact | None:
        """Return the first contact on straight lines in joint space; None if there is none.

        Args:
            joints: (t, dof) points of the motion.
            obstacles: in the world; they stand still.
        """
        import fcl

        names = [obstacle.name for obstacle in obstacles]
        world = [_placed(fcl, _fcl_shape(fcl, obstacle), obstacle.pose) for obstacle in obstacles]
        centers = np.array([obstacle.pose.position for obstacle in obstacles]).reshape(-1, 3)
        balls = np.array([_ball_of(obstacle) for obstacle in obstacles])
        for k, q in enumerate(densely(joints, STEP)):
            mine = self._move(q)
            gaps = np.linalg.norm(mine[:, None] - centers, axis=2) - self._balls[:, None] - balls
            for one, other in np.argwhere(gaps <= 0.0):
                if one in self._free and fcl.collide(self._solids[one], world[other]) > 0:
                    return Contact(k, self._links[one], names[other])
            for one, other in self._own if k % OWN_EVERY == 0 else ():
                if np.linalg.norm(mine[one] - mine[other]) > self._balls[one] + self._balls[other]:
                    continue
                if fcl.collide(self._solids[one], self._solids[other]) > 0:
                    return Contact(k, self._links[one], self._links[other])
        return None

    def _move(self, q: np.ndarray) -> np.ndarray:
        """Place the solids, and return the centers (n, 3) of the balls that contain them [m]."""
        import fcl

        rest, centers = self._rest.copy(), np.empty((len(self._solids), 3))
        for joint, value in zip(self._moving, q, strict=True):
            self._put(rest, joint, value)
        self._pin.updateGeometryPlacements(self._model, self._data, self._geometry, self._placed, rest)
        rotation, position = self._base.rotation, self._base.position
        for k, (solid, pose) in enumerate(zip(self._solids, self._placed.oMg, strict=True)):
            turned, place = rotation @ pose.rotation, rotation @ pose.translation + position
            solid.setTransform(fcl.Transform(turned, place))
            centers[k] = turned @ self._centers[k] + place
        return centers


def densely(joints: np.ndarray, step: float) -> np.ndarray:
    """Return points on the lines of a motion between which no joint moves more than a step.

    Args:
        joints: (t, dof) points.
        step: largest change of a joint [rad or m].
    """
    rows = [joints[:1]]
    kept = joints[0]
    for row in joints[1:]:
        count = int(np.ceil(np.abs(row - kept).max() / step))
        if count:
            rows.append(kept + np.arange(1, count + 1)[:, None] / count * (row - kept))
            kept = row
    return np.vstack(rows)


def pairs_of_links(links: Sequence[str], neighbors: set[frozenset[str]], srdf: Path | None) -> list[tuple[int, int]]:
    """Return the pairs of solids that are checked against each other.

    Args:
        links: of each solid.
        neighbors: pairs of links that a joint connects.
        srdf: file of the pairs that are not checked; None: only neighbors are left out.

    Raises:
        BadConfig: the file is no SRDF.
    """
    left_out = set(neighbors)
    if srdf is not None:
        try:
            found = ElementTree.parse(srdf).getroot().iter("disable_collisions")
        except ElementTree.ParseError as error:
            raise BadConfig(srdf, "SRDF", str(error)) from None
        left_out |= {frozenset((each.get("link1", ""), each.get("link2", ""))) for each in found}
    pairs = combinations(range(len(links)), 2)
    return [(i, j) for i, j in pairs if links[i] != links[j] and frozenset((links[i], links[j])) not in left_out]


def _neighbors(model: Any, items: Any) -> set[frozenset[str]]:
    """Pairs of links on one joint, or on a joint and the one before it."""
    joints = [(int(item.parentJoint), str(model.frames[int(item.parentFrame)].name)) for item in items]
    return {
        frozenset((one, other))
        for (j, one), (k, other) in combinations(joints, 2)
        if j == k or int(model.parents[j]) == k or int(model.parents[k]) == j
    }


def _fcl_shape(fcl: Any, obstacle: Obstacle) -> Any:
    match obstacle.shape:
        case Box(size):
            return fcl.Box(*size)
        case Cylinder(radius, length):
            return fcl.Cylinder(radius, length)
        case Sphere(radius):
            return fcl.Sphere(radius)
        case Capsule(radius, length):
            return fcl.Capsule(radius, length)
    raise BadConfig("problems", obstacle.name, f"is a {type(obstacle.shape).__name__}; judged are primitives")


def _ball_of(obstacle: Obstacle) -> float:
    """Radius [m] of a ball about an obstacle's center that contains it."""
    match obstacle.shape:
        case Box(size):
            return 0.5 * float(np.linalg.norm(size))
        case Cylinder(radius, length):
            return float(np.hypot(radius, 0.5 * length))
        case Capsule(radius, length):
            return radius + 0.5 * length
        case Sphere(radius):
            return radius
    return np.inf


def _box_of(item: Any) -> tuple[np.ndarray, np.ndarray]:
    """Corners (3,) [m] of a box about a collision element, in its own frame."""
    item.geometry.computeLocalAABB()
    box = item.geometry.aabb_local
    return np.array(box.min_), np.array(box.max_)


def _placed(fcl: Any, shape: Any, pose: Any) -> Any:
    return fcl.CollisionObject(shape, fcl.Transform(pose.rotation, pose.position))


def _solid_of(item: Any, urdf: Path) -> Any:
    """Return a collision element as an object of fcl: a mesh with its triangles, or a primitive."""
    import fcl

    form, name = item.geometry, type(item.geometry).__name__
    if name == "Box":
        return fcl.CollisionObject(fcl.Box(*(2.0 * float(half) for half in form.halfSide)))
    if name in ("Cylinder", "Capsule"):
        return fcl.CollisionObject(getattr(fcl, name)(float(form.radius), 2.0 * float(form.halfLength)))
    if name == "Sphere":
        return fcl.CollisionObject(fcl.Sphere(float(form.radius)))
    if not hasattr(form, "tri_indices"):
        raise BadConfig(urdf, str(item.name), f"is a {name}; known are boxes, balls, capsules, cylinders and meshes")
    points = np.array(form.vertices(), dtype=np.float64).reshape(-1, 3)
    triangles = [[int(form.tri_indices(k)[corner]) for corner in range(3)] for k in range(int(form.num_tris))]
    mesh = fcl.BVHModel()
    mesh.beginModel(len(points), len(triangles))
    mesh.addSubModel(points, np.array(triangles))
    mesh.endModel()
    return fcl.CollisionObject(mesh)
