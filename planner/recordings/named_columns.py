"""Roles of a table's columns: the hand's pose, the objects', time, joints and gripper."""

from __future__ import annotations

import re
from collections.abc import Sequence
from fnmatch import fnmatchcase
from typing import NamedTuple

import numpy as np

from ..errors import BadDemonstration, UnknownName
from .column_names import UNITS, Meaning, is_hand, meanings_of, unknown_unit
from .pose_columns import ORIENTATIONS, Parts, PoseColumns, TableRequest, pose_columns
from .recording import blame_of
from .text_table import TextTable

WHY = {
    "unknown": "says nothing that is known",
    "counter": "counts, but not the rows",
    "rate": "is neither a position nor a command of the gripper",
    "command": "is a command, not what was measured",
    "count": "is one of {count} numbers, which are no pose (a position and a quaternion are 7)",
}
"""Why a column is not read, by the kind of its meaning."""

NUMBERS = {"time": "seconds, or other numbers with --time-unit,", "gripper": "numbers, like 0 open and 1 closed,"}
"""Numbers that are read in the place of words, by the kind of a column's meaning."""


class Roles(NamedTuple):
    """Meaning of a table's columns.

    Attributes:
        hand: columns of the hand's pose; None if there are none.
        objects: name: columns of each object's pose.
        time: column of the stamps, and its unit; a second one of nanoseconds if there is one.
        joints: columns of the arm's joints, in order, and their unit.
        gripper: column of the gripper's signal; None if there is none.
        gripper_end: its state at its largest value, "open" or "closed", as the names say; "" if they do not.
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
    gripper_end: str
    fingers: tuple[int, ...]
    notes: tuple[str, ...]


def named(table: TextTable, request: TableRequest) -> TextTable:
    """Return a table with names for its columns: those given, its own, or those of a usual layout without a header.

    Args:
        table: the table.
        request: what its user says.

    Raises:
        BadDemonstration: another number of names, or columns that nothing names.
    """
    width = len(table.columns)
    if request.columns:
        names = [name for word in request.columns for name in _counted(word)]
        if len(names) != width:
            raise BadDemonstration(table.path, "--columns", f"names {len(names)}; the file has {width} columns")
        double = sorted({name for name in names if names.count(name) > 1})
        if double:
            raise BadDemonstration(table.path, "--columns", f"names {double[0]!r} twice")
        _check_names(table, names)
        notes = ("the header is replaced by --columns",) if table.names else ()
        return table._replace(names=tuple(names), notes=(*table.notes, *notes))
    if table.names:
        return table
    found, why = _usual(table, width, request)
    said = f"columns are taken as {' '.join(found)}, {why}"
    return table._replace(names=tuple(found), notes=(*table.notes, said))


def _check_names(table: TextTable, names: list[str]) -> None:
    """Refuse names of --columns that call another part of a pose what the header calls one."""
    parts = ("position", "quaternion", "time")
    for name, own, new, old in zip(names, table.names, meanings_of(names), meanings_of(table.names), strict=False):
        is_part = new.kind in parts and old.kind in parts and not (new.axis + old.axis).isdigit()
        if is_part and (new.kind, new.axis) != (old.kind, old.axis):
            reason = f"calls {name!r} what the header calls {own!r}; rename it in the file if the header is wrong"
            raise BadDemonstration(table.path, "--columns", reason)


def _counted(word: str) -> list[str]:
    """Return the names that a word stands for: O_T_EE_0..15 are sixteen."""
    found = re.fullmatch(r"(.*?)(\d+)\.\.(\d+)", word)
    return [f"{found[1]}{k}" for k in range(int(found[2]), int(found[3]) + 1)] if found else [word]


def _usual(table: TextTable, width: int, request: TableRequest) -> tuple[list[str], str]:
    """Return names for the columns of a table without a header, and why."""
    blame, place = blame_of(table.path, "table"), ["x", "y", "z"]
    if width in (12, 16):
        return [f"pose_{k}" for k in range(width)], "matrices, for lack of a header"
    if width == 6 and request.rotation:
        return [f"pose_{k}" for k in range(6)], "as said"
    if width == 6:
        reason = "a position and angles? say --rotation; or joints? say --columns q1..6"
        raise blame(f"has 6 columns and no header: {reason}")
    if width not in (7, 8):
        reason = f"has {width} columns and no header: name them, like --columns time,x,y,z,qw,qx,qy,qz,gripper"
        raise blame(reason)
    is_tum = width == 8 and table.separator is None
    order = request.quaternion or ("xyzw" if is_tum else "")
    if not order:
        what = "time and a pose" if width == 8 else "a position and a quaternion"
        raise blame(f"has {width} columns and no header: {what}? say --quaternion wxyz or xyzw")
    why = "as said" if request.quaternion else "as in files of TUM"
    own = [*place, *(f"q{letter}" for letter in order)]
    return (own if width == 7 else ["time", *own]), why


def rows_of_frame(table: TextTable, frame: str) -> tuple[TextTable, bool]:
    """Return the rows of one frame of a table whose rows are of several, and whether the name of a frame chose them.

    Args:
        table: with names.
        frame: name that the user gives to the hand.

    Raises:
        BadDemonstration: there are several frames, and the user names none of them.
    """
    for name, column in zip(table.names, table.columns, strict=True):
        if not isinstance(column, tuple) or not re.search(r"frame|body", name.lower()) or len(set(column)) < 2:
            continue
        frames = sorted(set(column))
        if frame not in frames:
            shown = ", ".join(frames[:8])
            reason = f"column {name!r} names several frames, {shown}: say by --hand whose rows are the hand's"
            raise BadDemonstration(table.path, "table", reason)
        rows = np.array([each == frame for each in column])
        columns = tuple(
            tuple(word for word, is_row in zip(each, rows, strict=True) if is_row)
            if isinstance(each, tuple)
            else each[rows]
            for each in table.columns
        )
        note = f"of {len(rows)} rows, the {int(rows.sum())} are read in which {name!r} is {frame!r}"
        return table._replace(columns=columns, lines=table.lines[rows], notes=(*table.notes, note)), True
    return table, False


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
    meanings, notes = _meanings(table, ignored)
    poses = _poses(table, meanings)
    joints = sorted((int(m.axis), k) for k, m in meanings.items() if m.kind == "joint")
    own = _hand(table, poses, hand, bool(joints))
    notes += [f"the hand's pose is that of {own!r}"] if own and not hand else []
    mine = poses.pop(own, None)
    for name in [name for name in poses if hand and is_hand(name)]:
        poses.pop(name)
        notes.append(f"the pose of {name or 'the hand without a name'!r}, another hand than {hand!r}, is left out")
    found, time_notes = _time(table, meanings)
    _check_unique(table, [str(number) for number, _ in joints], "joint")
    grippers = [k for k, m in meanings.items() if m.kind == "gripper"]
    if len(grippers) > 1:
        names = ", ".join(repr(table.names[k]) for k in grippers)
        raise BadDemonstration(
            table.path, "header", f"{names} are all of the gripper; leave out all but one by --ignore"
        )
    units = {meanings[k].unit for _, k in joints}
    if len(units) > 1:
        raise BadDemonstration(
            table.path, "header", f"joints have the units {', '.join(each or 'none' for each in sorted(units))}"
        )
    return Roles(
        hand=mine,
        objects={name or "hand": columns for name, columns in poses.items()},
        time=found,
        time_unit=meanings[found[0]].unit if len(found) == 1 else "",
        joints=tuple(k for _, k in joints),
        joint_unit=units.pop() if units else "",
        gripper=grippers[0] if grippers else None,
        gripper_end=meanings[grippers[0]].axis if grippers else "",
        fingers=tuple(k for k, m in meanings.items() if m.kind == "finger"),
        notes=(*notes, *time_notes),
    )


def _meanings(table: TextTable, ignored: Sequence[str]) -> tuple[dict[int, Meaning], list[str]]:
    """Return the meaning of each column that is read, and why others are not."""
    meanings, notes = {}, []
    for k, (name, meaning) in enumerate(zip(table.names, meanings_of(table.names), strict=True)):
        column = table.columns[k]
        if any(fnmatchcase(name, pattern) for pattern in ignored):
            notes.append(f"column {name!r} is left out, as said")
        elif isinstance(column, tuple):
            notes.append(_about_words(table, name, column, meaning.kind))
        elif unknown_unit(name):
            known = ", ".join(dict.fromkeys(UNITS.values()))
            raise BadDemonstration(table.path, "header", f"{name!r} is in {unknown_unit(name)}; known units: {known}")
        elif meaning.kind == "counter" and (len(column) == 1 or (np.diff(column) == 1.0).all()):
            notes.append(f"column {name!r} counts the rows and is left out")
        elif meaning.kind in WHY:
            why = WHY[meaning.kind].format(count=meaning.axis)
            reason = f"{name!r} {why}; leave it out with --ignore {name!r}, or name it by --columns"
            raise BadDemonstration(table.path, "header", reason)
        else:
            meanings[k] = meaning
    return _settled(meanings), notes


def _settled(meanings: dict[int, Meaning]) -> dict[int, Meaning]:
    """Decide whether q0 to q3 are a quaternion, which only a position without another orientation lacks, or joints."""
    kinds = {(meaning.owner, meaning.kind) for meaning in meanings.values()}
    out = {}
    for k, meaning in meanings.items():
        if meaning.kind == "q":
            has_turn = any((meaning.owner, kind) in kinds for kind in ORIENTATIONS)
            is_turn = ((meaning.owner, "position") in kinds and not has_turn) or meaning.owner != ""
            meaning = meaning._replace(kind="quaternion") if is_turn else Meaning("joint", axis=meaning.axis)
        out[k] = meaning
    return out


def _about_words(table: TextTable, name: str, words: tuple[str, ...], kind: str) -> str:
    if kind in NUMBERS and (kind != "gripper" or len(set(words)) > 1):
        reason = f"column {name!r} holds words like {words[0]!r}; {NUMBERS[kind]} are read: convert it"
        raise BadDemonstration(table.path, f"line {table.lines[0]}", reason)
    if len(set(words)) > 1:
        row = next(k for k, word in enumerate(words) if word != words[0])
        reason = f"column {name!r} holds words, {words[0]!r} and {words[row]!r}; leave it out with --ignore {name!r}"
        raise BadDemonstration(table.path, f"line {table.lines[row]}", reason)
    return f"column {name!r} says {words[0]!r} in each row and is left out"


def _poses(table: TextTable, meanings: dict[int, Meaning]) -> dict[str, PoseColumns]:
    """Return the columns of the pose of each owner."""
    parts: dict[str, Parts] = {}
    for k, meaning in meanings.items():
        if meaning.kind == "position" or meaning.kind in ORIENTATIONS:
            mine = parts.setdefault(meaning.owner, {}).setdefault(meaning.kind, {})
            if meaning.axis in mine:
                both = f"{table.names[mine[meaning.axis]]!r} and {table.names[k]!r}"
                reason = f"{both} are both the {meaning.axis} of one {meaning.kind}"
                raise BadDemonstration(table.path, "header", reason)
            mine[meaning.axis] = k
    return {owner: pose_columns(table, owner, mine, meanings) for owner, mine in parts.items()}


def _hand(table: TextTable, poses: dict[str, PoseColumns], hand: str, has_joints: bool) -> str:
    """Return the owner of the pose that is the hand's; "" also if none is, and joints say where the hand is."""
    if hand:
        if hand not in poses:
            raise UnknownName("hand among the poses", hand, [name for name in poses if name])
        return hand
    hands = [name for name in poses if is_hand(name)]
    if len(hands) < 2 and ("" in poses or has_joints):
        return ""
    if len(poses) == 1 or len(hands) == 1:
        return next(iter(hands or poses))
    if not poses:
        return ""
    names, others = ", ".join(name or "the one without a name" for name in hands or poses), max(hands or poses)
    say = f"say so with --hand, or leave others out with --ignore '{others}_*'"
    raise BadDemonstration(table.path, "header", f"which pose is the hand's? {say}; there are: {names}")


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
        reason = f"two columns are the {what} {double[0]}; leave one out by --ignore"
        raise BadDemonstration(table.path, "header", reason)
