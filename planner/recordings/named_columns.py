"""Roles of a table's columns: the hand's pose, the objects', time, joints and gripper."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatchcase
from typing import NamedTuple

import numpy as np

from ..errors import BadDemonstration, UnknownName
from .column_names import Meaning, meaning_of
from .recording import QUATERNIONS
from .text_table import TextTable

POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")


class PoseColumns(NamedTuple):
    """Columns of a pose.

    Attributes:
        position: columns of x, y, z.
        unit: of the position, as the names say; "" if they say none.
        quaternion: columns of w, x, y, z, or of four numbered components.
        order: of the components: "wxyz" if the names give the components, "" if they are only numbered.
    """

    position: tuple[int, ...]
    unit: str
    quaternion: tuple[int, ...]
    order: str


class Roles(NamedTuple):
    """Meaning of a table's columns.

    Attributes:
        hand: columns of the hand's pose; None if there are none.
        objects: name: columns of each object's pose.
        time: column of the stamps, and its unit; a second one of nanoseconds if there is one.
        joints: columns of the arm's joints, in order, and their unit.
        gripper: column of the gripper's signal; None if there is none.
        fingers: columns of the fingers' joints.
        notes: what is left out, a line each.
    """

    hand: PoseColumns | None
    objects: dict[str, PoseColumns]
    time: tuple[int, ...]
    time_unit: str
    joints: tuple[int, ...]
    joint_unit: str
    gripper: int | None
    fingers: tuple[int, ...]
    notes: tuple[str, ...]


def named(table: TextTable, names: Sequence[str], quaternion: str) -> TextTable:
    """Return a table with names for its columns: those given, its own, or those of a usual layout without a header.

    Args:
        table: the table.
        names: given by the user; empty: none.
        quaternion: order of the quaternion's columns that the user names, "" if none.

    Raises:
        BadDemonstration: another number of names, or columns that nothing names.
    """
    width = len(table.columns)
    if names:
        if len(names) != width:
            raise BadDemonstration(table.path, "--columns", f"names {len(names)}; the file has {width} columns")
        double = sorted({name for name in names if names.count(name) > 1})
        if double:
            raise BadDemonstration(table.path, "--columns", f"names {double[0]!r} twice")
        notes = ("the header is replaced by --columns",) if table.names else ()
        return table._replace(names=tuple(names), notes=(*table.notes, *notes))
    if table.names:
        return table
    if width not in (7, 8):
        reason = f"has {width} columns and no header: name them, like --columns time,x,y,z,qw,qx,qy,qz,gripper"
        raise BadDemonstration(table.path, "table", reason)
    is_tum = width == 8 and table.separator is None
    order = quaternion or ("xyzw" if is_tum else "wxyz" if width == 7 else "")
    if not order:
        reason = "has 8 columns and no header: time and a pose? say --quaternion wxyz or xyzw"
        raise BadDemonstration(table.path, "table", reason)
    own = ("x", "y", "z", *(f"q{letter}" for letter in order))
    words = "as in files of TUM" if is_tum and not quaternion else "as said" if quaternion else "for lack of a header"
    found = own if width == 7 else ("time", *own)
    return table._replace(names=found, notes=(*table.notes, f"columns are taken as {' '.join(found)}, {words}"))


def roles_of(table: TextTable, ignored: Sequence[str], hand: str) -> Roles:
    """Return the meaning of each column; one of which nothing is known is an error, so that nothing is lost unseen.

    Args:
        table: with names.
        ignored: patterns of names that the user leaves out, like "vel_*".
        hand: name of the object whose pose is the hand's, as the columns call it; "" for the usual names.

    Raises:
        BadDemonstration: an unknown column, one of which a part is missing, or two for the same thing.
        UnknownName: a pattern that no column matches.
    """
    for pattern in ignored:
        if not any(fnmatchcase(name, pattern) for name in table.names):
            raise UnknownName("column to ignore", pattern, table.names)
    meanings, notes = {}, []
    for k, name in enumerate(table.names):
        column, meaning = table.columns[k], meaning_of(name)
        if any(fnmatchcase(name, pattern) for pattern in ignored):
            notes.append(f"column {name!r} is left out, as said")
        elif isinstance(column, tuple):
            notes.append(_about_words(table, name, column))
        elif meaning.kind == "counter" and (len(column) == 1 or (np.diff(column) == 1.0).all()):
            notes.append(f"column {name!r} counts the rows and is left out")
        elif meaning.kind in ("unknown", "counter"):
            reason = (
                f"{name!r} says nothing that is known; leave it out with --ignore {name!r}, or name it by --columns"
            )
            raise BadDemonstration(table.path, "header", reason)
        else:
            meanings[k] = meaning
    poses = _poses(table, meanings)
    own = _hand(table, poses, hand)
    found, time_notes = _time(table, meanings)
    joints = sorted((int(m.axis), k) for k, m in meanings.items() if m.kind == "joint")
    _check_unique(table, [str(number) for number, _ in joints], "joint")
    grippers = [k for k, m in meanings.items() if m.kind == "gripper"]
    if len(grippers) > 1:
        names = ", ".join(repr(table.names[k]) for k in grippers)
        raise BadDemonstration(
            table.path, "header", f"{names} are all of the gripper; leave out all but one by --ignore"
        )
    units = {meanings[k].unit for _, k in joints}
    if len(units) > 1:
        raise BadDemonstration(table.path, "header", f"joints have the units {', '.join(sorted(units))}")
    return Roles(
        hand=poses.pop(own) if own in poses else None,
        objects=poses,
        time=found,
        time_unit=meanings[found[0]].unit if len(found) == 1 else "",
        joints=tuple(k for _, k in joints),
        joint_unit=units.pop() if units else "",
        gripper=grippers[0] if grippers else None,
        fingers=tuple(k for k, m in meanings.items() if m.kind == "finger"),
        notes=(*notes, *time_notes),
    )


def _about_words(table: TextTable, name: str, words: tuple[str, ...]) -> str:
    if len(set(words)) > 1:
        row = next(k for k, word in enumerate(words) if word != words[0])
        reason = f"column {name!r} holds words, {words[0]!r} and {words[row]!r}; leave it out with --ignore {name!r}"
        raise BadDemonstration(table.path, f"line {table.lines[row]}", reason)
    return f"column {name!r} says {words[0]!r} in each row and is left out"


def _poses(table: TextTable, meanings: dict[int, Meaning]) -> dict[str, PoseColumns]:
    """Return the columns of the pose of each owner."""
    parts: dict[str, dict[tuple[str, str], int]] = {}
    for k, meaning in meanings.items():
        if meaning.kind in ("position", "quaternion"):
            mine = parts.setdefault(meaning.owner, {})
            key = (meaning.kind, meaning.axis)
            if key in mine:
                reason = f"{table.names[mine[key]]!r} and {table.names[k]!r} are both the {key[1]} of one {key[0]}"
                raise BadDemonstration(table.path, "header", reason)
            mine[key] = k
    return {owner: _pose(table, owner, mine, meanings) for owner, mine in parts.items()}


def _pose(table: TextTable, owner: str, mine: dict[tuple[str, str], int], meanings: dict[int, Meaning]) -> PoseColumns:
    def columns(kind: str, *layouts: str) -> tuple[tuple[int, ...], str]:
        there = {axis for each, axis in mine if each == kind}
        for layout in layouts:
            if there == set(layout):
                return tuple(mine[kind, axis] for axis in layout), layout
        absent = [axis for axis in layouts[0] if axis not in there]
        whose = f" of {owner!r}" if owner else ""
        names = ", ".join(f"q{axis}" if kind == "quaternion" else axis for axis in absent)
        have = ", ".join(table.names)
        raise BadDemonstration(table.path, "header", f"the pose{whose} lacks {names}; there are: {have}")

    position, _ = columns("position", "xyz", "012")
    quaternion, layout = columns("quaternion", "wxyz", "0123")
    units = {meanings[k].unit for k in position}
    if len(units) > 1:
        raise BadDemonstration(table.path, "header", f"x, y and z have the units {', '.join(sorted(units)) or '-'}")
    return PoseColumns(position, units.pop(), quaternion, "" if layout == "0123" else layout)


def _hand(table: TextTable, poses: dict[str, PoseColumns], hand: str) -> str:
    """Return the owner of the pose that is the hand's."""
    if hand:
        if hand not in poses:
            raise UnknownName("hand among the poses", hand, [name for name in poses if name])
        return hand
    if "" in poses or not poses:
        return ""
    if len(poses) == 1:
        return next(iter(poses))
    names = ", ".join(poses)
    raise BadDemonstration(table.path, "header", f"which pose is the hand's? say so with --hand; there are: {names}")


def _time(table: TextTable, meanings: dict[int, Meaning]) -> tuple[tuple[int, ...], list[str]]:
    """Return the columns of the stamps, and what is left out beside them."""
    whole = [k for k, m in meanings.items() if m.kind == "time"]
    seconds = [k for k, m in meanings.items() if m.kind == "secs"]
    nanos = [k for k, m in meanings.items() if m.kind == "nsecs"]
    _check_unique(table, ["secs"] * len(seconds), "part of the time")
    _check_unique(table, ["nsecs"] * len(nanos), "part of the time")
    if not whole:
        return (*seconds, *nanos), []
    # of a message's own stamp and the time of its arrival, the stamp is when it was measured
    stamped = [k for k in whole if "stamp" in table.names[k].lower() and "header" in table.names[k].lower()]
    chosen = (stamped or whole)[0]
    rest = [k for k in (*whole, *seconds, *nanos) if k != chosen]
    if rest and not stamped and len(whole) > 1:
        names = ", ".join(repr(table.names[k]) for k in whole)
        raise BadDemonstration(table.path, "header", f"{names} are all times; leave out all but one by --ignore")
    return (chosen,), [f"column {table.names[k]!r} is left out beside {table.names[chosen]!r}" for k in rest]


def _check_unique(table: TextTable, numbers: list[str], what: str) -> None:
    double = sorted({number for number in numbers if numbers.count(number) > 1})
    if double:
        raise BadDemonstration(table.path, "header", f"two columns are the {what} {double[0]}")


def check_order(table: TextTable, columns: PoseColumns, quaternion: str) -> str:
    """Return the order of a quaternion's columns as they stand.

    Args:
        table: the table.
        columns: of the pose.
        quaternion: order that the user names, "" if none.

    Raises:
        BadDemonstration: the names contradict the user, or nothing gives the order.
    """
    if columns.order:
        letters = "".join("wxyz"[columns.quaternion.index(k)] for k in sorted(columns.quaternion))
        if quaternion and letters != quaternion:
            names = " ".join(table.names[k] for k in sorted(columns.quaternion))
            reason = f"{names} is the order {letters}; --quaternion {quaternion} contradicts it"
            raise BadDemonstration(table.path, "header", reason)
        return letters
    if not quaternion:
        reason = "numbers the quaternion's components: say --quaternion wxyz or xyzw"
        raise BadDemonstration(table.path, "header", reason)
    return quaternion


def components(columns: PoseColumns, order: str) -> list[int]:
    """Return the columns of w, x, y, z.

    Args:
        columns: of the pose.
        order: of its numbered components, see `check_order`.
    """
    return list(columns.quaternion) if columns.order else [columns.quaternion[k] for k in QUATERNIONS[order]]
