"""What the geometric tier carries: segments of the shipped demonstrations, what is held, what must be kept."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from ...baselines.key_poses import DENSE
from ...configs.shipped_files import shipped_demonstration
from ...planner.geometry.pose import Pose, PosePath
from ...planner.geometry.shapes import Box, Cylinder, Shape
from ...planner.imitation.demonstration_files import load_demonstration
from ...planner.imitation.segmentation import resampled
from ...planner.robot.arm import Arm
from ...planner.robot.body import Body

ROBOT = "Panda"
TILTING = np.deg2rad(5.0)
"""Tilt of the held object [rad] at which a demonstrated pour begins."""
POURING, SLACK = np.deg2rad(60.0), np.deg2rad(5.0)
"""Tilt [rad] from which on the lip must be where it was shown, and how much earlier its curve begins."""
FINE = 0.0005
"""Screw length [m] between the points of that curve."""


@dataclass(frozen=True)
class PartKind:
    """A segment.

    Attributes:
        demonstration: the shipped one.
        grasping: the segment at whose end the object is taken.
        segment: the one that is carried out.
        shape: of what is held; None: the box that the demonstration says.
        level: True: the hand's approach axis is to stay level; False: the held object is to stay upright.
        raised: how far [m] above its ends the nominal way is that obstacles are put on.
        blocked: obstacles have room on it.
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
"""By name. On its way turned from lying to standing, a book has no upright; its hand stays level."""


class CarriedPart:
    """A segment with what is held.

    Args:
        name: one of `KINDS`.
    """

    def __init__(self, name: str):
        kind = KINDS[name]
        demonstration = load_demonstration(shipped_demonstration(kind.demonstration))
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
        if kind.segment == "insert":  # it was taken lying, and stands at the end
            up = self.shown[-1].rotation.T @ np.array([0.0, 0.0, 1.0])
        self.axis = np.array([0.0, 0.0, 1.0]) if kind.level else up
        self.shown_tilt = float(np.degrees(self.tilts(self.carried(self.shown)).max()))

    def tilts(self, path: PosePath) -> np.ndarray:
        """(n,) [rad]: of the held object against upright, or of the hand against level."""
        heights = np.clip(_turned(path, self.axis)[:, 2], -1.0, 1.0)
        return np.abs(np.arcsin(heights)) if self.kind.level else np.arccos(heights)

    def carried(self, path: PosePath) -> PosePath:
        """The part of a path before pouring begins; all of it where nothing is poured.

        Pouring may begin where the lip first is as near its last place as it was when it began in the demonstration.
        """
        if self.lip is None:
            return path
        distance = np.linalg.norm(self.lips(path) - self.lips(path[-1:]), axis=1)
        inside = distance <= self._pouring_radius
        return path[: max(1, int(np.argmax(inside)) if inside.any() else len(path))]

    @cached_property
    def lip(self) -> np.ndarray | None:
        """(3,) the glass's lip in the tcp's frame, the lowest point of its rim at the end; None without a glass."""
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
        """(n, 3) where the demonstration has the lip, as seen from its end, while the glass is tilted [m]."""
        dense = resampled(self.shown, FINE)
        return self.lips(dense.moved(self.shown[-1].inverse()))[self.tilts(dense) > POURING - SLACK]

    def lips(self, path: PosePath) -> np.ndarray:
        """(n, 3) the lip in the world [m]."""
        assert self.lip is not None
        return path.positions + _turned(path, self.lip)


def _upright(pose: Pose) -> Pose:
    """A pose whose z axis is the world's: what stands is measured a little tilted."""
    return Pose.from_yaw(pose.position, pose.yaw)


def _turned(path: PosePath, vector: np.ndarray) -> np.ndarray:
    """(n, 3) a vector of the tcp's frame in the world's axes."""
    w, turn = path.quaternions[:, :1], path.quaternions[:, 1:]
    cross = np.cross(turn, vector)
    return vector + 2.0 * (w * cross + np.cross(turn, cross))


@cache
def part_named(name: str) -> CarriedPart:
    """A part, loaded once."""
    return CarriedPart(name)


class ArmWithBody(NamedTuple):
    """Whose hand moves.

    Attributes:
        arm: its kinematics.
        body: its capsules, with an empty hand.
    """

    arm: Arm
    body: Body


@cache
def robot() -> ArmWithBody:
    """The Panda."""
    from ...envs.scene.robot_bodies import robot_body
    from ...envs.scene.scene import compiled_scene

    return ArmWithBody(compiled_scene(ROBOT).arms[0].arm, robot_body(ROBOT))


@cache
def holding(name: str) -> Body:
    """The Panda's body with what a part holds."""
    part = part_named(name)
    return robot().body.holding("held", part.shape, part.tcp_from_object, robot().arm)


@cache
def tool_of(name: str) -> np.ndarray:
    """(m, 7) capsules of hand and held object, see `Body.tool`."""
    return holding(name).tool(robot().arm)
