"""Names of columns: what they say about time, poses, joints and the gripper, in the words that other programs use."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from typing import NamedTuple

POSITION = {"pos", "position", "translation", "trans", "point", "p", "t", "location"}
QUATERNION = {"quaternion", "quat", "q"}
ORIENTATION = QUATERNION | {"orientation", "orient", "ori", "rotation", "rot", "o", "r"}
ROLL = {"roll": "x", "pitch": "y", "yaw": "z"}
VECTOR = {"rotvec", "rodrigues", "axisangle", "aa"}
VECTORS = ({"rot", "vec"}, {"rotation", "vector"}, {"rotation", "vec"}, {"axis", "angle"})
"""Words that together name a rotation vector."""
WHOLE = {"pose", "transform", "tf", "matrix", "mat", "rotmat", "dcm", "h"}
"""Words of a position and an orientation in one."""
POSE = POSITION | ORIENTATION | VECTOR | WHOLE | {"field", "msg", "world", "euler", "rpy", "angles", "angle"}
POSE |= {"axis", "vec", "vector"}
"""Words that say that a pose is meant, and not whose."""
BEFORE = {"field", "msg", "pose", "transform", "tf", "actual", "measured", "obs", "observation", "base", "world"}
"""Words in front of whose pose it is."""
HAND = {
    "tcp", "ee", "eef", "hand", "tool", "tool0", "effector", "endeffector", "end", "flange", "gripper", "gripper0",
    "grip", "site", "robot", "robot0", "arm", "link8", "wrist",
}  # fmt: skip
"""Words of the recorded hand; a pose under any other name is that of an object, or of another hand."""
OTHER_HAND = re.compile(r"left|right|leader|follower|master|slave|puppet|(robot|arm|hand|ee|eef|tcp|tool|gripper)\d*")
WISHES = {
    "desired", "des", "cmd", "command", "commanded", "setpoint", "action", "actions", "reference", "ref", "waypoint",
}  # fmt: skip
"""Words of a command, whatever stands beside them."""
GOALS = WISHES | {"target", "goal", "d"}
"""Words of a command, where they stand beside words of the robot; alone they may be the name of an object."""
JOINTS = {"joint", "joints", "jnt", "qpos"}
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
    "ns": "ns", "nsec": "ns", "nanos": "ns", "nanoseconds": "ns", "rad": "rad", "radians": "rad", "deg": "deg",
    "degrees": "deg", "°": "deg", "µs": "us", "μs": "us", "millimeters": "mm", "centimeters": "cm",
}  # fmt: skip
UNKNOWN_UNITS = {
    "inch", "inches", "ft", "feet", "foot", "um", "µm", "μm", "micron", "microns", "micrometers", "km", "dm", "yd",
    "nm", "min", "minutes", "mrad", "grad", "gon", "turns", "rev",
}  # fmt: skip
"""Units that are not read, and must not be taken for another one."""
OPEN, CLOSED = OPENINGS | {"open", "opened"}, {"closed", "close", "closing"}
UR_JOINTS = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
JOINT = re.compile(r"(?:q|j|joint|jnt|axis|qpos)(\d+)")


class Meaning(NamedTuple):
    """Meaning of a column's name.

    Attributes:
        kind: "time", "secs", "nsecs", "gripper", "finger", "joint" or "counter"; "position", or of an orientation
            "quaternion", "rotation" (any of the following), "euler", "rpy", "rotvec" or "matrix"; "q" (of a
            quaternion, or a joint); or what is not read: "rate", "command", "count" or "unknown".
        owner: of a pose: "" for the hand, else the object's name.
        axis: "x", "y", "z" or "w" of a pose, or a number; row and column of a matrix, like "r0c3"; number of a joint;
            "open" or "closed", the state of the gripper at its largest value, "" if nothing says so.
        unit: that the name gives, else "".
    """

    kind: str
    owner: str = ""
    axis: str = ""
    unit: str = ""


def meanings_of(names: Sequence[str]) -> list[Meaning]:
    """Return what the columns' names say; those that are only numbered, like pose_0 to pose_6, are read together.

    Args:
        names: in the header.
    """
    found = [meaning_of(name) for name in names]
    groups: dict[tuple[str, ...], dict[str, int]] = {}
    units = []
    for k, name in enumerate(names):
        words, unit = _words(name)
        units.append(unit)
        stem, number = _numbered(words)
        if number and number not in groups.setdefault(stem, {}):
            groups[stem][number] = k
    for stem, members in groups.items():
        together = _together(stem, sorted(members, key=int))
        for number, meaning in together.items():
            found[members[number]] = meaning._replace(unit=units[members[number]])
    return found


def meaning_of(name: str) -> Meaning:
    """Return what a column's name says by itself.

    Args:
        name: in the header, like "x [mm]", "field.pose.orientation.w", "cup_qx", "panda_joint3" or "timestamp_ns".
    """
    words, unit = _words(name)
    low = [word.lower() for word in words]
    if RATES & set(low):
        return Meaning("rate")
    for found in (_time(low, unit), _joint(low, unit), _pose(words, unit), _gripper(low, unit)):
        if found is not None:
            return Meaning("command") if found.kind not in ("time", "gripper") and _is_command(low) else found
    if (low or [""])[0 if low[:1] == ["unnamed"] else -1] in COUNTERS:
        return Meaning("counter")
    return Meaning("command" if _is_command(low) else "unknown")


def unknown_unit(name: str) -> str:
    """Return the unit at the end of a name that is not read; "" if there is none."""
    last = re.search(r"[\W_]([^\W\d_]+)\W*$", name)
    if re.search(r"[\[(]\s*in\s*[\])]\s*$", name):
        return "in"
    return last[1] if last and last[1].lower() in UNKNOWN_UNITS else ""


def _is_command(low: list[str]) -> bool:
    return bool(WISHES & set(low)) or bool(GOALS & set(low) and (HAND | JOINTS | {"q"}) & set(low))


def _words(name: str) -> tuple[list[str], str]:
    """Return the words of a name, and its unit."""
    unit = ""
    given = re.search(r"[\[(]\s*([^\[\]()]*?)\s*[\])]\s*$", name)
    if given and given[1].lower() in UNITS:
        unit, name = UNITS[given[1].lower()], name[: given.start()]
    words = [word for word in re.split(r"[^A-Za-z0-9]+", name) if word]
    if given and not unit and not re.search(r"[A-Za-z0-9]", given[1]) and given[1] not in ("", "-"):
        words.append(given[1])  # a unit in signs that are not known
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
    if low[-1].isdigit() and JOINTS & set(low[:-1]):
        return Meaning("joint", axis=low[-1], unit=unit)
    for k, name in enumerate(UR_JOINTS, 1):
        if low[-1] == "joint" and "_".join(low[:-1]).endswith(name):
            return Meaning("joint", axis=str(k), unit=unit)
    return None


def _pose(words: list[str], unit: str) -> Meaning | None:
    low = [word.lower() for word in words]
    for k in (-1, -2):
        # "x_pos" is "pos_x"
        if len(low) < -k or (k == -2 and low[-1] not in POSE):
            continue
        axis = re.fullmatch(r"(q|p|t|o|r)?([xyzw])", low[k])
        if not axis and low[k] not in ROLL:
            continue
        rest = [word for j, word in enumerate(words) if j != len(words) + k]
        about = {word.lower() for word in rest} | ({axis[1]} if axis and axis[1] else set())
        letter = axis[2] if axis else ROLL[low[k]]
        kind = "rpy" if not axis else _kind(about) or ("quaternion" if letter == "w" else "position")
        return Meaning(kind, _owner(rest), letter, unit)
    return None


def _kind(about: set[str]) -> str:
    """Return the kind of orientation that words name; "" if they name none."""
    if VECTOR & about or any(words <= about for words in VECTORS):
        return "rotvec"
    for kind in ("rpy", "euler"):
        if kind in about:
            return kind
    return "quaternion" if QUATERNION & about else "rotation" if ORIENTATION & about else ""


def _numbered(words: list[str]) -> tuple[tuple[str, ...], str]:
    """Return the words before a number, and the number; "" if there is none."""
    if not words:
        return (), ""
    glued = re.fullmatch(r"([A-Za-z]+)(\d+)", words[-1])
    if glued and glued[1].lower() in POSE | HAND:
        return (*words[:-1], glued[1]), glued[2]
    return (tuple(words[:-1]), words[-1]) if words[-1].isdigit() else ((), "")


def _together(stem: tuple[str, ...], numbers: list[str]) -> dict[str, Meaning]:
    """Return what numbered columns mean by their number; nothing if each speaks for itself."""
    low = [word.lower() for word in stem]
    is_pose = bool(low) and (low[-1] in POSE or set(low) <= HAND | BEFORE or "t" in low[1:-1])
    # a hand of several fingers has numbered positions, too
    is_finger = bool(GRIPPER & set(low)) and not WHOLE & set(low)
    if not is_pose or is_finger or (RATES | JOINTS) & set(low):
        return {}
    if _is_command(low):
        return {number: Meaning("command") for number in numbers}
    kinds = _layout(low, numbers)
    if not kinds and low[-1] == "q":
        return {number: Meaning("joint", axis=number) for number in numbers}
    if not kinds:
        return {number: Meaning("count", axis=str(len(numbers))) for number in numbers}
    owner = _owner(list(stem))
    return {number: Meaning(kind, owner, axis) for number, (kind, axis) in zip(numbers, kinds, strict=True)}


def _layout(low: list[str], numbers: list[str]) -> list[tuple[str, str]]:
    """Return kind and axis of each of some numbers that belong together; [] if they are none that are known."""
    for base, rows, columns in itertools.product((0, 1), (3, 4), (3, 4)):
        grid = {f"{base + r}{base + c}": f"r{r}c{c}" for r in range(rows) for c in range(columns)}
        if rows <= columns and set(numbers) == set(grid):
            return [("matrix", grid[number]) for number in numbers]
    count = len(numbers)
    if [int(number) for number in numbers] not in (list(range(count)), list(range(1, count + 1))):
        return []
    kind, last = _kind(set(low)), low[-1]
    place = [("position", str(k)) for k in range(3)]
    turn = {3: kind if kind in ("rotvec", "rpy", "euler") else "rotation", 4: "q" if last == "q" else "quaternion"}
    if last in POSITION and count == 3:
        return place
    if kind and last not in WHOLE and count in turn and (count == 4 or kind != "quaternion"):
        return [(turn[count], str(k)) for k in range(count)]
    if (count in (12, 16) and last not in QUATERNION) or (count == 9 and last in WHOLE | {"rotation", "rot", "r"}):
        return [("matrix", str(k)) for k in range(count)]
    if count in (6, 7) and (last in WHOLE or last not in POSE):
        return [*place, *((turn[count - 3], str(k)) for k in range(count - 3))]
    return []


def is_hand(owner: str) -> bool:
    """Return whether the owner of a pose is a hand by its name: the usual one, or another one's."""
    return all(word in HAND or OTHER_HAND.fullmatch(word) for word in owner.lower().split("_") if word)


def _owner(words: list[str]) -> str:
    """Return whose pose it is: the words before those that say that it is a pose; "" for the hand."""
    low = [word.lower() for word in words]
    if "t" in low[1:-1]:
        # the pose of b in a is a_T_b
        words = words[low.index("t", 1) + 1 :]
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
        most = "open" if OPEN & set(low) else "closed" if CLOSED & set(low) else ""
        return Meaning("gripper", axis=most, unit=unit)
    return None
