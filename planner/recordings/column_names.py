"""Names of columns: what they say about time, poses, joints and the gripper, in the words that other programs use."""

from __future__ import annotations

import re
from typing import NamedTuple

POSITION = {"pos", "position", "translation", "trans", "point", "p", "t", "location"}
ORIENTATION = {"orientation", "orient", "quaternion", "quat", "rotation", "rot", "q", "o"}
POSE = POSITION | ORIENTATION | {"pose", "transform", "tf", "field", "msg", "world"}
"""Words that say that a pose is meant, and not whose."""
BEFORE = {"field", "msg", "pose", "transform", "tf"}
"""Words in front of whose pose it is."""
HAND = {
    "tcp", "ee", "eef", "hand", "tool", "tool0", "effector", "endeffector", "end", "flange", "gripper", "gripper0",
    "grip", "site", "robot", "robot0", "arm", "link8", "right", "wrist",
}  # fmt: skip
"""Words of the recorded hand; a pose under any other name is that of an object."""
TIME = {"time", "t", "stamp", "timestamp", "timestamps", "elapsed", "clock"}
AROUND_TIME = {"field", "header", "msg", "rosbag", "ros", "log", "recv", "receive", "sim", "relative", "wall", "record"}
SECOND_PARTS = {"secs": "s", "sec": "s", "seconds": "s", "nsecs": "ns", "nsec": "ns", "nanosec": "ns", "nanosecs": "ns"}
COUNTERS = {"", "index", "idx", "seq", "row", "sample", "frame", "step", "count", "unnamed", "id", "no", "n"}
GRIPPER = {"gripper", "grip", "finger", "fingers", "jaw", "jaws", "grasp"}
OPENINGS = {"width", "opening", "aperture"}
RATES = {
    "vel", "velocity", "velocities", "speed", "dq", "qd", "qdot", "acc", "twist", "linear", "angular", "effort",
    "torque", "tau", "force", "wrench", "current", "covariance",
}  # fmt: skip
"""Words of what is neither a position nor a command, and is not read."""
UNITS = {
    "m": "m", "meter": "m", "meters": "m", "cm": "cm", "mm": "mm", "s": "s", "sec": "s", "seconds": "s", "ms": "ms",
    "msec": "ms", "millis": "ms", "milliseconds": "ms", "us": "us", "usec": "us", "micros": "us", "microseconds": "us",
    "ns": "ns", "nsec": "ns", "nanos": "ns", "nanoseconds": "ns", "rad": "rad", "deg": "deg", "degrees": "deg",
}  # fmt: skip
JOINT = re.compile(r"(?:q|j|joint|jnt|axis|qpos)(\d+)")


class Meaning(NamedTuple):
    """Meaning of a column's name.

    Attributes:
        kind: "time", "secs", "nsecs", "position", "quaternion", "gripper", "finger", "joint", "counter" or "unknown".
        owner: of a pose: "" for the hand, else the object's name.
        axis: "x", "y", "z" or "w" of a pose, or a digit; the number of a joint.
        unit: that the name gives, else "".
    """

    kind: str
    owner: str = ""
    axis: str = ""
    unit: str = ""


def meaning_of(name: str) -> Meaning:
    """Return what a column's name says.

    Args:
        name: in the header, like "x [mm]", "field.pose.orientation.w", "cup_qx", "panda_joint3" or "timestamp_ns".
    """
    words, unit = _words(name)
    low = [word.lower() for word in words]
    if RATES & set(low):
        return Meaning("unknown")
    for found in (_time(low, unit), _joint(low, unit), _pose(words, unit), _gripper(low, unit)):
        if found is not None:
            return found
    if (low or [""])[0 if low[:1] == ["unnamed"] else -1] in COUNTERS:
        return Meaning("counter")
    return Meaning("unknown")


def _words(name: str) -> tuple[list[str], str]:
    """Return the words of a name, and its unit."""
    unit = ""
    given = re.search(r"[\[(]\s*([A-Za-z]+)\s*[\])]\s*$", name)
    if given and given[1].lower() in UNITS:
        unit, name = UNITS[given[1].lower()], name[: given.start()]
    words = [word for word in re.split(r"[^A-Za-z0-9]+", name) if word]
    if not unit and len(words) > 1 and words[-1].lower() in UNITS and words[-1].lower() not in SECOND_PARTS:
        unit = UNITS[words.pop().lower()]
    if words:
        # posX, quatW
        camel = re.fullmatch(r"([A-Za-z]*[a-z])([XYZW])", words[-1])
        if camel and camel[1].lower() in POSE:
            words[-1:] = [camel[1], camel[2]]
    return words, unit


def _time(low: list[str], unit: str) -> Meaning | None:
    if not low or not set(low[:-1]) <= TIME | AROUND_TIME:
        return None
    if low[-1] in TIME:
        return Meaning("time", unit=unit)
    if low[-1] in SECOND_PARTS:
        after_time = len(low) > 1 and low[-2] in TIME - {"stamp"}
        part = SECOND_PARTS[low[-1]]
        return Meaning("time", unit=part) if after_time else Meaning("secs" if part == "s" else "nsecs")
    return None


def _joint(low: list[str], unit: str) -> Meaning | None:
    if not low or (GRIPPER & set(low)):
        return None
    number = JOINT.fullmatch(low[-1])
    if number:
        return Meaning("joint", axis=number[1], unit=unit)
    if low[-1].isdigit() and {"joint", "joints", "jnt", "qpos"} & set(low[:-1]):
        return Meaning("joint", axis=low[-1], unit=unit)
    return None


def _pose(words: list[str], unit: str) -> Meaning | None:
    low = [word.lower() for word in words]
    for k in (-1, -2):
        # "x_pos" is "pos_x"
        if len(low) < -k or (k == -2 and low[-1] not in POSE):
            continue
        axis = re.fullmatch(r"(q|p|t|o)?([xyzw])", low[k])
        digit = k == -1 and low[k].isdigit() and set(low[:k]) & (POSITION | ORIENTATION) and not set(low) & GRIPPER
        if not axis and not digit:
            continue
        about = {word for j, word in enumerate(low) if j != len(low) + k} | ({axis[1]} if axis and axis[1] else set())
        letter = axis[2] if axis else low[k]
        kind = "quaternion" if letter == "w" or about & ORIENTATION else "position"
        return Meaning(kind, _owner([word for j, word in enumerate(words) if j != len(words) + k]), letter, unit)
    return None


def _owner(words: list[str]) -> str:
    """Return whose pose it is: the words before those that say that it is a pose; "" for the hand."""
    while words and words[-1].lower() in POSE:
        words = words[:-1]
    while words and words[0].lower() in BEFORE:
        words = words[1:]
    return "" if all(word.lower() in HAND for word in words) else "_".join(words)


def _gripper(low: list[str], unit: str) -> Meaning | None:
    if not low:
        return None
    last = low[-1]
    if (GRIPPER & set(low) and re.fullmatch(r"(joint)?\d+|left|right", last)) or re.fullmatch(r"(finger|jaw)\d+", last):
        return Meaning("finger", axis=last, unit=unit)
    if GRIPPER & set(low) or last in OPENINGS:
        return Meaning("gripper", unit=unit)
    return None
