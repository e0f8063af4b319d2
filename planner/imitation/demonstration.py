"""A demonstration: one recorded motion of a tool, cut into segments with their reference objects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..arrays import checked_items, checked_kind
from ..errors import BadDemonstration, UnknownName
from ..geometry.pose import Pose, PosePath
from ..ranges import check_count
from .corrections import Corrections

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
LONGEST = 3600.0
"""Longest plausible duration [s]; a longer one is not in seconds."""
SLOWEST, SOME_WAY = 1e-3, 0.05
"""Least plausible mean speed [m/s] of a hand that covers this distance [m]; a slower one has time in another unit."""


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
        object_sizes: full extents (3,) [m] of objects.
        object_paths: n poses in the world of each object that was recorded.
        fixtures: pose in the world of each thing that stood still.
        other_joints: (n,) positions [rad or m] of joints that are not the arm's: of fingers, doors, drawers.
        commanded: n poses in the world that the tcp was sent to; None if not recorded.
        corrections: what a person says of its skill; no part of the recording, but in a file of its own.

    Raises:
        BadDemonstration: an invalid field; the error names the field and the reason.
        WrongType, BadOption: a segment, or one of its fields, is of a wrong class.
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
    object_sizes: Mapping[str, np.ndarray] = field(default_factory=dict)
    object_paths: Mapping[str, PosePath] = field(default_factory=dict)
    fixtures: Mapping[str, Pose] = field(default_factory=dict)
    other_joints: Mapping[str, np.ndarray] = field(default_factory=dict)
    commanded: PosePath | None = None
    corrections: Corrections = field(default_factory=Corrections)

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
        self._check_places("path", self.path)
        self._check_duration()
        object.__setattr__(self, "object_sizes", self._checked_sizes())
        self._check_scene(count)
        self._check_segments(count)

    def _check_places(self, key: str, path: PosePath) -> None:
        farthest = np.abs(path.positions).max(axis=1)
        if farthest.max() > FARTHEST:
            index = int(farthest.argmax())
            raise self._bad(key, f"sample {index} is {farthest[index]:.4g} m away; are the positions in cm or mm?")

    def _check_duration(self) -> None:
        seconds = self.duration
        way = float(np.linalg.norm(np.diff(self.path.positions, axis=0), axis=1).sum())
        if seconds > LONGEST:
            raise self._bad("time", f"lasts {seconds:.6g} s; is it in ms, us or ns?")
        if way > SOME_WAY and way < SLOWEST * seconds:
            reason = (
                f"lasts {seconds:.6g} s for a way of {way:.3g} m: is it in ms, us or ns, or the path not in meters?"
            )
            raise self._bad("time", reason)

    def _check_scene(self, count: int) -> None:
        """Check what was recorded besides the arm, and keep it where nobody changes it."""
        for key, kind in (("object_paths", PosePath), ("fixtures", Pose)):
            for name, value in checked_kind(key, getattr(self, key), Mapping).items():
                if not isinstance(value, kind):
                    raise self._bad(key, f"of {name!r} is a {type(value).__name__}, no {kind.__name__}")
        paths = {f"object_paths of {name!r}": path for name, path in self.object_paths.items()}
        if self.commanded is not None:
            if not isinstance(self.commanded, PosePath):
                raise self._bad("commanded", f"is a {type(self.commanded).__name__}, no PosePath")
            paths["commanded"] = self.commanded
        for key, path in paths.items():
            if len(path) != count:
                raise self._bad(key, f"has {len(path)} poses; path has {count}")
            self._check_places(key, path)
        for name, pose in self.fixtures.items():
            self._check_places(f"fixtures of {name!r}", PosePath(pose.dq[None]))
        both = sorted(set(self.object_paths) & set(self.fixtures))
        if both:
            raise self._bad("fixtures", f"{both[0]!r} is among object_paths, too")
        others = {
            name: self._checked(f"other_joints of {name!r}", value, count, 1)
            for name, value in checked_kind("other_joints", self.other_joints, Mapping).items()
        }
        for key, value in (
            ("object_paths", dict(self.object_paths)),
            ("fixtures", dict(self.fixtures)),
            ("other_joints", others),
        ):
            object.__setattr__(self, key, value)

    def _check_segments(self, count: int) -> None:
        object.__setattr__(self, "segments", checked_items("segments", self.segments, Segment))
        for segment in self.segments:
            for key in ("name", "reference", "held", "gripper"):
                checked_kind(f"segment: {key}", getattr(segment, key), str)
            checked_kind(f"segment {segment.name!r}: reference_pose", segment.reference_pose, Pose)
            for key in ("start", "stop"):
                check_count(f"segment {segment.name!r}: {key}", getattr(segment, key), "(-inf, inf)")
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
        known = list(dict.fromkeys([*self.object_sizes, *self.object_paths, *self.fixtures]))
        for role, name in (("reference", segment.reference), ("held", segment.held)):
            if known and name not in ("", *known):
                raise self._bad(key, f"{role} {name!r} is not in object_names; allowed: {', '.join(known)}, ''")
        farthest = float(np.abs(segment.reference_pose.position).max())
        if farthest > FARTHEST:
            raise self._bad(key, f"the reference pose is {farthest:.4g} m away; is it in cm or mm?")

    def _checked_sizes(self) -> dict[str, np.ndarray]:
        sizes = {}
        for name, value in checked_kind("object_sizes", self.object_sizes, Mapping).items():
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
