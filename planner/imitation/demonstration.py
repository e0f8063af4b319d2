"""A demonstration: one recorded motion of a tool, cut into segments with their reference objects."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..errors import BadDemonstration, UnknownName
from ..geometry.pose import Pose, PosePath
from .segmentation import dwells

SOURCES = ("teleoperated", "kinesthetic", "scripted")
GRIPPER_ACTIONS = ("close", "open", "none")
ROBOTS = {
    "Panda": (7,),
    "Sawyer": (7,),
    "Baxter": (7, 14),
    "IIWA": (7,),
    "UR5e": (6,),
    "Kinova3": (7,),
    "Jaco": (7,),
    "XArm7": (7,),
}
"""Numbers of recorded joints of well-known robots: one or both arms of Baxter. Other robots may have any number."""
LONGEST_NAME = 100
"""Largest number of characters of a robot's name."""
FARTHEST = 10.0
"""Largest plausible coordinate [m]; larger positions are not in meters."""


@dataclass(frozen=True, slots=True)
class Segment:
    """One motion of a demonstration.

    Attributes:
        name: unique among the segments, like "approach" or "transfer".
        start: first sample.
        stop: last sample, included.
        reference: name of the object the end of the motion is relative to, "" for the world.
        reference_pose: that object's pose in the world at the end of the motion.
        held: name of the object in the hand, "" if the hand is empty.
        gripper: action of the gripper at the end: "close", "open" or "none".
    """

    name: str
    start: int
    stop: int
    reference: str = ""
    reference_pose: Pose = field(default_factory=Pose.identity)
    held: str = ""
    gripper: str = "none"


@dataclass(frozen=True, slots=True, eq=False)
class Demonstration:
    """One recorded motion.

    Attributes:
        name: for messages and reports.
        task: the demonstrated task ("stack"), "" if none.
        robot: name of the robot that was recorded.
        tcp_frame: name of the frame recorded in `path`.
        source: "teleoperated", "kinesthetic" or "scripted".
        licence: of the data.
        time: (n,) [s], increasing.
        path: n poses of the tcp in the world.
        joint_positions: (n, dof) [rad], None if not recorded.
        gripper: (n,) command, positive closes; None if not recorded.
        segments: the motions, in order.
        object_sizes: full extents (3,) [m] of the objects named in the segments.

    Raises:
        BadDemonstration: an invalid field; the error names the field and the reason.
    """

    name: str
    task: str
    robot: str
    tcp_frame: str
    source: str
    licence: str
    time: np.ndarray
    path: PosePath
    joint_positions: np.ndarray | None = None
    gripper: np.ndarray | None = None
    segments: tuple[Segment, ...] = ()
    object_sizes: dict[str, np.ndarray] = field(default_factory=dict)

    def __post_init__(self):
        name = self.robot
        if not (isinstance(name, str) and name.strip() and name.isprintable() and len(name) <= LONGEST_NAME):
            raise self._bad("robot", f"{str(name)[:LONGEST_NAME]!r} is not a name of 1 to {LONGEST_NAME} characters")
        if self.source not in SOURCES:
            raise self._bad("source", f"{self.source!r} is not one of {', '.join(SOURCES)}")
        if not isinstance(self.path, PosePath):
            raise self._bad("path", f"is a {type(self.path).__name__}, no PosePath")
        count = len(self.path)
        if count < 2:
            raise self._bad("path", f"has {count} sample; at least 2 are needed")
        for key, width in (("time", 1), ("joint_positions", 2), ("gripper", 1)):
            value = getattr(self, key)
            if value is not None or key == "time":
                object.__setattr__(self, key, self._checked(key, value, count, width))
        joints = self.joint_positions
        if joints is not None and joints.shape[1] not in ROBOTS.get(self.robot, (joints.shape[1],)):
            allowed = " or ".join(str(number) for number in ROBOTS[self.robot])
            raise self._bad("joint_positions", f"has {joints.shape[1]} columns; the {self.robot} has {allowed} joints")
        steps = np.diff(self.time)
        if (steps <= 0).any():
            raise self._bad("time", f"does not increase at index {int(np.argmax(steps <= 0)) + 1}")
        farthest = np.abs(self.path.positions).max(axis=1)
        if farthest.max() > FARTHEST:
            index = int(farthest.argmax())
            raise self._bad("path", f"sample {index} is {farthest[index]:.4g} m away; are the positions in cm or mm?")
        object.__setattr__(self, "object_sizes", self._checked_sizes())
        self._check_segments(count)

    def _check_segments(self, count: int) -> None:
        names = [segment.name for segment in self.segments]
        if len(set(names)) < len(names):
            raise self._bad("segments", f"names are not unique: {', '.join(names)}")
        before = -1
        for segment in self.segments:
            key = f"segment {segment.name!r}"
            if not 0 <= segment.start < segment.stop < count:
                reason = f"samples {segment.start} to {segment.stop} are not within 0 to {count - 1}"
                raise self._bad(key, reason)
            if segment.start <= before:
                raise self._bad(key, f"begins at {segment.start}, before the one before has ended")
            if segment.gripper not in GRIPPER_ACTIONS:
                raise self._bad(key, f"gripper {segment.gripper!r} is not one of {', '.join(GRIPPER_ACTIONS)}")
            before = segment.stop
            self._check_objects(key, segment)

    def _check_objects(self, key: str, segment: Segment) -> None:
        """Refuse reference and held objects that are unknown, if objects are listed, and poses in another unit."""
        for role, name in (("reference", segment.reference), ("held", segment.held)):
            if self.object_sizes and name not in ("", *self.object_sizes):
                allowed = ", ".join(self.object_sizes)
                raise self._bad(key, f"{role} {name!r} is not in object_names; allowed: {allowed}, ''")
        farthest = float(np.abs(segment.reference_pose.position).max())
        if farthest > FARTHEST:
            raise self._bad(key, f"the reference pose is {farthest:.4g} m away; is it in cm or mm?")

    def _checked_sizes(self) -> dict[str, np.ndarray]:
        sizes = {}
        for name, value in self.object_sizes.items():
            size = self._numbers("object_sizes", value)
            if size.shape != (3,):
                raise self._bad("object_sizes", f"of {name!r} has shape {size.shape}; expected (3,) [m]")
            if not (np.isfinite(size).all() and size.min() > 0.0):
                raise self._bad("object_sizes", f"of {name!r} is {size.tolist()}; expected three positive numbers [m]")
            size.flags.writeable = False
            sizes[name] = size
        return sizes

    def _checked(self, key: str, value: Any, count: int, dimensions: int) -> np.ndarray:
        array = self._numbers(key, value)
        if array.ndim != dimensions or len(array) != count:
            expected = f"({count},)" if dimensions == 1 else f"({count}, joints)"
            raise self._bad(key, f"has shape {array.shape}; expected {expected}")
        bad = np.argwhere(~np.isfinite(array))
        if len(bad):
            raise self._bad(key, f"is not finite at index {int(bad[0][0])}")
        array.flags.writeable = False
        return array

    def _numbers(self, key: str, value: Any) -> np.ndarray:
        """Return a float64 copy of an array of real numbers."""
        try:
            array = np.asarray(value)
        except ValueError:
            raise self._bad(key, "is not an array of real numbers, but ragged") from None
        if array.dtype.kind not in "fiu":
            raise self._bad(key, f"is not an array of real numbers, but of {array.dtype.name}")
        return array.astype(np.float64)

    def _bad(self, key: str, reason: str) -> BadDemonstration:
        return BadDemonstration(self.name, key, reason)

    @property
    def duration(self) -> float:
        """Time [s] from the first to the last sample."""
        return float(self.time[-1] - self.time[0])

    def segment(self, name: str) -> Segment:
        """Return the segment with the given name.

        Raises:
            UnknownName: no segment has the name.
        """
        for segment in self.segments:
            if segment.name == name:
                return segment
        raise UnknownName(f"segment of {self.name!r}", name, [segment.name for segment in self.segments])

    def segment_path(self, name: str) -> PosePath:
        """Return the path of the tcp during a segment, both ends included.

        Raises:
            UnknownName: no segment has the name.
        """
        segment = self.segment(name)
        return self.path[segment.start : segment.stop + 1]


def warnings_of(demonstration: Demonstration) -> list[str]:
    """List peculiarities of a demonstration to know before using it; none of them is an error."""
    found = []
    time, path = demonstration.time, demonstration.path
    for first, last in dwells(time, path):
        found.append(f"pause of {time[last] - time[first]:.1f} s from sample {first} to {last}")
    steps = np.diff(path.lengths())
    repeated = int((steps < 2e-4).sum())
    if repeated > 0.05 * len(steps):
        found.append(f"{repeated} of {len(steps)} steps are shorter than 0.2 mm: pauses or repeated samples")
    intervals = np.diff(time)
    if intervals.max() > 1.5 * np.median(intervals):
        found.append(f"time steps vary from {intervals.min() * 1e3:.0f} to {intervals.max() * 1e3:.0f} ms")
    if not demonstration.segments:
        found.append("no segments: neither gripper events nor pauses were found")
    for segment in demonstration.segments:
        pose = path[segment.stop]
        down = np.degrees(np.arccos(np.clip(-pose.rotation[2, 2], -1.0, 1.0)))
        if segment.gripper != "none" and 2.0 < down < 45.0:
            found.append(f"the tool is tilted by {down:.1f} deg at the end of {segment.name!r}: imitated as it is")
    return found
