"""Carried parts of the geometric tier: segments of the shipped demonstrations, held objects, constraints."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from ...baselines.key_poses import DENSE
from ...configs import load_demonstration
from ...envs import ROBOTS
from ...planner import Arm, Body, Box, Cylinder, Pose, PosePath, Shape
from ...planner.imitation.segmentation import resampled

ROBOT = "Panda"
TILTING = np.deg2rad(5.0)
"""Tilt of the held object [rad] at which a demonstrated pour begins."""
POURING, SLACK = np.deg2rad(60.0), np.deg2rad(5.0)
"""Tilt [rad] from which the lip must be at its demonstrated place, and how much earlier the demonstrated curve
begins."""
FINE = 0.0005
"""Path length (weighted) [m] between the points of that curve."""


@dataclass(frozen=True)
class PartKind:
    """A kind of carried part: a segment of a shipped demonstration.

    Attributes:
        demonstration: name of the shipped demonstration.
        grasping: segment that ends with the grasp of the object.
        segment: segment to be imitated.
        shape: shape of the held object; None: a box of the size in the demonstration.
        level: True: the hand's approach axis must stay level; False: the held object must stay upright.
        raised: height [m] above start and goal of the nominal path on which obstacles are placed.
        blocked: True if obstacles can be placed on the path.
    """

    demonstration: str
    grasping: str
    segment: str
    shape: Shape | None = None
    level: bool = False
    raised: float = 0.0
    blocked: bool = True


KINDS = {
    "pour carry": PartKind("pour", "approach", "carry", Cylinder(0.030, 0.10)),
    "stack transfer": PartKind("stack", "approach", "transfer", raised=0.08),
    "shelve carry": PartKind("shelve", "reach", "carry", level=True),
    "shelve insert": PartKind("shelve", "reach", "insert", blocked=False),
}
"""Kinds by name. A book that turns from lying to standing has no upright axis, so its hand must stay level instead."""


class CarriedPart:
    """A segment with its held object.

    Args:
        name: one of `KINDS`.
    """

    def __init__(self, name: str):
        kind = KINDS[name]
        demonstration = load_demonstration(kind.demonstration)
        grasp = demonstration.segment(kind.grasping)
        carried = demonstration.segment(kind.segment)
        standing = _upright(grasp.reference_pose)
        self.name, self.kind = name, kind
        self.shown = resampled(demonstration.segment_path(kind.segment), DENSE)
        self.tcp_from_object = demonstration.path[grasp.stop].inverse() @ grasp.reference_pose
        x, y, z = (float(extent) for extent in demonstration.object_sizes[grasp.reference])
        self.shape = kind.shape or Box((x, y, z))
        assert demonstration.joint_positions is not None
        self.joints = demonstration.joint_positions[carried.start]
        self.reference = carried.reference_pose.position if carried.reference else self.shown[-1].position
        up = demonstration.path[grasp.stop].rotation.T @ standing.rotation[:, 2]
        if kind.segment == "insert":  # the book was grasped lying, and stands at the end
            up = self.shown[-1].rotation.T @ np.array([0.0, 0.0, 1.0])
        self.axis = np.array([0.0, 0.0, 1.0]) if kind.level else up
        self.shown_tilt = float(np.degrees(self.tilts(self.carried(self.shown)).max()))

    def tilts(self, path: PosePath) -> np.ndarray:
        """Return tilts (n,) [rad]: of the held object from upright, or of the hand from level."""
        heights = np.clip(_turned(path, self.axis)[:, 2], -1.0, 1.0)
        return np.abs(np.arcsin(heights)) if self.kind.level else np.arccos(heights)

    def carried(self, path: PosePath) -> PosePath:
        """Return the part of a path before pouring begins; the whole path if nothing is poured.

        Pouring begins at the first pose whose lip is as near its final place as the demonstrated lip was when the
        demonstrated pour began.
        """
        if self.lip is None:
            return path
        distance = np.linalg.norm(self.lips(path) - self.lips(path[-1:]), axis=1)
        inside = distance <= self._pouring_radius
        return path[: max(1, int(np.argmax(inside)) if inside.any() else len(path))]

    @cached_property
    def lip(self) -> np.ndarray | None:
        """(3,) the glass's lip in the tcp's frame [m], the lowest point of its rim at the end; None without a glass."""
        if not isinstance(self.shape, Cylinder):
            return None
        glass = self.tcp_from_object
        down = -(self.shown[-1] @ glass).rotation[2, :2]
        point = [*(self.shape.radius * down / np.linalg.norm(down)), 0.5 * self.shape.length]
        return glass.rotation @ np.array(point) + glass.position

    @cached_property
    def _pouring_radius(self) -> float:
        first = int(np.argmax(self.tilts(self.shown) > TILTING))
        lips = self.lips(self.shown)
        return float(np.linalg.norm(lips[first] - lips[-1]))

    @cached_property
    def lip_curve(self) -> np.ndarray:
        """(n, 3) demonstrated lip relative to the demonstration's end, while the glass is tilted [m]."""
        dense = resampled(self.shown, FINE)
        return self.lips(dense.moved(self.shown[-1].inverse()))[self.tilts(dense) > POURING - SLACK]

    def lips(self, path: PosePath) -> np.ndarray:
        """Return the lip (n, 3) in the world along a path [m]."""
        assert self.lip is not None
        return path.positions + _turned(path, self.lip)


def _upright(pose: Pose) -> Pose:
    """Return a pose with its z axis along the world's: standing objects are measured slightly tilted."""
    return Pose.from_yaw(pose.position, pose.yaw)


def _turned(path: PosePath, vector: np.ndarray) -> np.ndarray:
    """Return a vector of the tcp's frame in the world's axes along a path (n, 3)."""
    w, turn = path.quaternions[:, :1], path.quaternions[:, 1:]
    cross = np.cross(turn, vector)
    return vector + 2.0 * (w * cross + np.cross(turn, cross))


@cache
def part_named(name: str) -> CarriedPart:
    """Return a carried part by name; loaded once."""
    return CarriedPart(name)


class ArmWithBody(NamedTuple):
    """A robot for planning.

    Attributes:
        arm: its kinematics.
        body: its capsules, with an empty hand.
    """

    arm: Arm
    body: Body


@cache
def robot() -> ArmWithBody:
    """Return the Panda."""
    from ...envs.scene.robot_bodies import robot_body
    from ...envs.scene.scene import compiled_scene

    return ArmWithBody(compiled_scene(ROBOTS[ROBOT]).arms[0].arm, robot_body(ROBOTS[ROBOT]))


@cache
def holding(name: str) -> Body:
    """Return the Panda's body with the object of a part in its hand."""
    part = part_named(name)
    return robot().body.holding("held", part.shape, part.tcp_from_object, robot().arm)


@cache
def tool_of(name: str) -> np.ndarray:
    """Return the capsules (m, 7) of hand and held object, see `Body.tool`."""
    return holding(name).tool(robot().arm)
