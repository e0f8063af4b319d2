"""Columns of a pose: which they are, and the path that they hold."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import BadDemonstration, UnknownName
from ..geometry.pose import Pose, PosePath
from ..imitation.npz_arrays import unit_poses
from .column_names import Meaning
from .orientations import MATRIX_ORDERS, ROTATIONS, from_rotations, from_three, is_rotation_word, matrices_of
from .orientations import matrix_order as order_of_matrices
from .recording import METERS, QUATERNIONS, RADIANS, SECONDS, Blame, blame_of
from .text_table import TextTable

ORIENTATIONS = ("quaternion", "rotation", "euler", "rpy", "rotvec", "matrix")
ANGLES = ("rotation", "euler", "rpy", "rotvec")
WHOLE_TURN = 2.0 * np.pi + 0.01
"""Largest plausible angle of an orientation [rad]; a larger one is in degrees."""
HALF_TURNS = np.array([np.pi, 0.5 * np.pi, np.pi]) + 0.01
"""Usual ranges of roll, pitch and yaw [rad], with rounding."""
LAYOUTS = {
    "position": ("xyz", "012"),
    "quaternion": ("wxyz", "0123"),
    **{kind: ("xyz", "012") for kind in ANGLES},
}
"""Axes of the numbers of each part of a pose, in order: named, or only numbered."""


class TableRequest(NamedTuple):
    """Facts about a table that its columns' names do not say.

    Attributes:
        units: of positions: "m", "cm" or "mm"; "": what the names say, else m.
        quaternion: order of the quaternion's columns, "wxyz" or "xyzw"; "": what the names say.
        rotation: how three numbers are an orientation, see `ROTATIONS`; "": what the names say.
        matrix: order of a matrix's numbers, "rows" or "columns"; "": what names or numbers say.
        rate: samples per second; None: the table has time stamps.
        time_unit: of the stamps: "s", "ms", "us" or "ns"; "": what the names or the numbers say.
        angles: of joints and orientations: "rad" or "deg"; "": what the names say, else rad.
        columns: names of the columns; empty: those of the file.
        ignored: patterns of names to leave out.
        hand: name of the hand's pose in the file; "": the usual ones.
        closed: value of the closed gripper; None: what the range says.
        tool: `recorded_from_tcp`, pose of the tcp in the recorded frame [m].
    """

    units: str = ""
    quaternion: str = ""
    rotation: str = ""
    matrix: str = ""
    rate: float | None = None
    time_unit: str = ""
    angles: str = ""
    columns: tuple[str, ...] = ()
    ignored: tuple[str, ...] = ()
    hand: str = ""
    closed: float | None = None
    tool: Pose | None = None

    def check_words(self) -> None:
        """Refuse words that are unknown, whatever the file is.

        Raises:
            UnknownName: a word of an option that is none of its words.
        """
        for what, value, known in (
            ("unit", self.units, METERS),
            ("quaternion order", self.quaternion, QUATERNIONS),
            ("time unit", self.time_unit, SECONDS),
            ("unit of angles", self.angles, RADIANS),
            ("matrix order", self.matrix, MATRIX_ORDERS),
        ):
            if value and value not in known:
                raise UnknownName(what, value, known)
        if self.rotation and not is_rotation_word(self.rotation):
            raise UnknownName("rotation", self.rotation, [ROTATIONS])


class PoseColumns(NamedTuple):
    """Columns of a pose.

    Attributes:
        position: columns of x, y, z; empty if the matrix holds them.
        unit: of the position, as the names say; "" if they say none.
        kind: of the orientation, one of `ORIENTATIONS`.
        orientation: its columns: of w, x, y, z; of x, y, z; of a matrix row by row; or by their numbers.
        is_numbered: they are only numbered.
        angle_unit: of angles, as the names say; "" if they say none.
    """

    position: tuple[int, ...]
    unit: str
    kind: str
    orientation: tuple[int, ...]
    is_numbered: bool
    angle_unit: str


Parts = dict[str, dict[str, int]]
"""By kind and axis the column of each part of a pose."""


def pose_columns(table: TextTable, owner: str, parts: Parts, meanings: dict[int, Meaning]) -> PoseColumns:
    """Return the columns of a pose.

    Args:
        table: with names.
        owner: of the pose, "" for the hand.
        parts: of the pose.
        meanings: of the columns.

    Raises:
        BadDemonstration: a part is missing, or there twice.
    """
    blame = blame_of(table.path, "header")
    kinds = [kind for kind in parts if kind in ORIENTATIONS]
    if "rotation" in parts and ("w" in parts["rotation"] or "quaternion" in parts) and kinds:
        # rot_x, rot_y, rot_z, rot_w are a quaternion
        parts["quaternion"] = {**parts.pop("rotation"), **parts.get("quaternion", {})}
        kinds = [kind for kind in parts if kind in ORIENTATIONS]
    if len(kinds) > 1:
        names = " and ".join(repr(table.names[min(parts[kind].values())]) for kind in kinds)
        whose = f"of {owner!r} " if owner else ""
        raise blame(f"the orientation {whose}is there twice, from {names} on; leave one out by --ignore")
    kind = kinds[0] if kinds else "quaternion"
    whose = f" of {owner!r}" if owner else ""
    if kind == "matrix":
        orientation, is_numbered = _matrix_columns(parts["matrix"]), not any("r" in axis for axis in parts["matrix"])
    else:
        orientation, is_numbered = _columns(table, kind, parts.get(kind, {}), whose)
    position: tuple[int, ...] = ()
    if kind != "matrix" or len(orientation) == 9:
        position, _ = _columns(table, "position", parts.get("position", {}), whose)
    elif "position" in parts:
        raise blame(f"the position{whose} is there twice, in the matrix, too; leave one out by --ignore")
    angles = orientation if kind in ANGLES else ()
    return PoseColumns(
        position,
        _unit(table, position, meanings, "x, y and z"),
        kind,
        orientation,
        is_numbered,
        _unit(table, angles, meanings, "the angles"),
    )


def _columns(table: TextTable, kind: str, mine: dict[str, int], whose: str) -> tuple[tuple[int, ...], bool]:
    named, numbered = LAYOUTS[kind]
    for layout in (named, numbered):
        if set(mine) == set(layout):
            return tuple(mine[axis] for axis in layout), layout == numbered
    words = {"quaternion": "q{}", "position": "{}", "rpy": "{}"}.get(kind, "r{}")
    rpy = dict(zip("xyz", ("roll", "pitch", "yaw"), strict=True))
    names = ", ".join(words.format(rpy[a] if kind == "rpy" else a) for a in named if a not in mine)
    have = ", ".join(table.names)
    raise BadDemonstration(table.path, "header", f"the pose{whose} lacks {names}; there are: {have}")


def _matrix_columns(mine: dict[str, int]) -> tuple[int, ...]:
    """Return the columns of a matrix row by row, or in the order of their numbers."""
    return tuple(mine[axis] for axis in sorted(mine, key=lambda axis: (len(axis), axis)))


def _unit(table: TextTable, columns: tuple[int, ...], meanings: dict[int, Meaning], what: str) -> str:
    units = {meanings[k].unit for k in columns}
    if len(units) > 1:
        raise BadDemonstration(
            table.path, "header", f"{what} have the units {', '.join(each or 'none' for each in sorted(units))}"
        )
    return units.pop() if units else ""


def asked_about(columns: PoseColumns) -> str:
    """Return the field of a request that says what a pose's names do not say; "" if they say all."""
    if columns.kind == "quaternion":
        return "quaternion" if columns.is_numbered else ""
    return "rotation" if columns.kind in ("rotation", "euler") else ""


def path_of(table: TextTable, columns: PoseColumns, request: TableRequest) -> tuple[PosePath, str]:
    """Return the path that columns hold, and what was understood of them.

    Args:
        table: the table.
        columns: of the pose.
        request: what its user says.

    Raises:
        BadDemonstration: the numbers are no poses, or nothing says how they are.
    """
    said = chosen_unit(table, "positions", columns.unit, ("--units", request.units), METERS)
    unit = said or "m"
    numbers = np.column_stack([table.numbers(k) for k in columns.orientation])
    if columns.kind == "matrix":
        quaternion, place, words = _from_matrices(table, columns, numbers, request.matrix)
    else:
        place = None
        quaternion, words = (
            _from_components(table, columns, numbers, request.quaternion)
            if columns.kind == "quaternion"
            else _from_angles(table, columns, numbers, request)
        )
    position = np.column_stack([table.numbers(k) for k in columns.position]) if place is None else place
    poses = unit_poses(table.path, "table", np.concatenate([position * METERS[unit], quaternion], axis=1))
    if len(poses) < 2:
        raise BadDemonstration(table.path, "table", f"has {len(poses)} sample(s); at least 2 are needed")
    return PosePath.from_vectors(poses), f"positions are {'in' if said else 'taken to be in'} {unit}, {words}"


def chosen_unit(table: TextTable, what: str, named: str, option: tuple[str, str], known: dict[str, float]) -> str:
    """Return the unit that names or the user give, "" if neither does.

    Args:
        table: for messages.
        what: is in the unit, for messages.
        named: unit that the names of the columns give.
        option: the user's option, and its value.
        known: units that are allowed.

    Raises:
        BadDemonstration: they contradict each other, or it is none of these.
    """
    flag, said = option
    if named and said and named != said:
        raise BadDemonstration(table.path, "header", f"{what} are in {named} there; {flag} {said} contradicts it")
    if named and named not in known:
        raise BadDemonstration(table.path, "header", f"{what} are in {named!r}; allowed: {', '.join(known)}")
    return named or said


def _names(table: TextTable, columns: PoseColumns) -> str:
    return " ".join(table.names[k] for k in columns.orientation)


def _from_components(table: TextTable, columns: PoseColumns, numbers: np.ndarray, said: str) -> tuple[np.ndarray, str]:
    """Return quaternions (n, 4) wxyz, and their order in the file in words."""
    if not columns.is_numbered:
        order = "".join("wxyz"[columns.orientation.index(k)] for k in sorted(columns.orientation))
        if said and order != said:
            names = " ".join(table.names[k] for k in sorted(columns.orientation))
            reason = f"{names} is the order {order}; --quaternion {said} contradicts it"
            raise BadDemonstration(table.path, "header", reason)
        return numbers, f"quaternions {order}"
    if not said:
        reason = f"{_names(table, columns)} numbers the quaternion's components: say --quaternion wxyz or xyzw"
        raise BadDemonstration(table.path, "header", reason)
    return numbers[:, QUATERNIONS[said]], f"quaternions {said}"


def _from_angles(
    table: TextTable, columns: PoseColumns, numbers: np.ndarray, request: TableRequest
) -> tuple[np.ndarray, str]:
    """Return quaternions (n, 4) wxyz of angles or rotation vectors, and what they are in words."""
    blame, names = blame_of(table.path, "header"), _names(table, columns)
    word = request.rotation or {"rotvec": "rotvec", "rpy": "rpy"}.get(columns.kind, "")
    if not word:
        what = "are Euler angles" if columns.kind == "euler" else "may be a rotation vector (as of UR) or Euler angles"
        raise blame(f"{names} {what}: say --rotation {ROTATIONS}")
    if columns.kind != "rotation" and (word == "rotvec") != (columns.kind == "rotvec"):
        raise blame(f"{names} {'is a' if columns.kind == 'rotvec' else 'is no'} rotation vector, "
                    f"by its names; --rotation {word} contradicts it")  # fmt: skip
    said = chosen_unit(table, "angles", columns.angle_unit, ("--angles", request.angles), RADIANS)
    size = np.linalg.norm(numbers, axis=1) if word == "rotvec" else np.abs(numbers).max(axis=1)
    k = int(size.argmax())
    if not said and size[k] > WHOLE_TURN:
        raise blame(f"{names} turn by {size[k]:.4g} at index {k}: in degrees? say --angles deg or rad")
    _check_rpy(word, said, numbers, names, blame)
    unit = said or "rad"
    order = word.lower() if word not in ("rpy", "rotvec") and not columns.is_numbered else ""
    if order and len(set(order)) < 3:
        raise blame(f"{names} are angles about x, y and z; --rotation {word} turns about {order[0]} twice")
    applied = numbers[:, ["xyz".index(axis) for axis in order]] if order else numbers
    quaternions = from_three(applied * RADIANS[unit], word)
    kinds = {"rotvec": "rotation vectors", "rpy": "angles roll, pitch, yaw about the fixed axes x, y, z"}
    moving = f"Euler angles {word}, about {'fixed' if word.islower() else 'moving'} axes"
    return quaternions, f"{kinds.get(word, moving)}, {'in' if said else 'taken to be in'} {unit}"


def _check_rpy(word: str, said: str, numbers: np.ndarray, names: str, blame: Blame) -> None:
    """Ask for the unit of roll, pitch and yaw beyond their usual ranges, which few degrees are, too."""
    if said or word != "rpy":
        return
    excess = np.abs(numbers) - HALF_TURNS
    k, j = (int(each) for each in np.unravel_index(excess.argmax(), excess.shape))
    if excess[k, j] > 0.0:
        name, usual = ("roll", "pitch", "yaw")[j], ("pi", "pi/2", "pi")[j]
        reason = f"{names}: {name} is {numbers[k, j]:.4g} at index {k}, beyond {usual}: in degrees?"
        raise blame(f"{reason} say --angles deg or rad")


def _from_matrices(
    table: TextTable, columns: PoseColumns, numbers: np.ndarray, said: str
) -> tuple[np.ndarray, np.ndarray | None, str]:
    """Return quaternions (n, 4) wxyz and positions (n, 3), None if they are elsewhere, and the order in words."""
    names = f"{table.names[columns.orientation[0]]} to {table.names[columns.orientation[-1]]}"
    blame: Blame = blame_of(table.path, names)
    if columns.is_numbered:
        order = order_of_matrices(numbers, said, blame)
    else:
        order = order_of_matrices(numbers, "rows", blame)
        if said:
            raise blame(f"names rows and columns; --matrix {said} is not needed")
    matrices = matrices_of(numbers, order)
    place = matrices[:, :3, 3] if numbers.shape[1] > 9 else None
    return from_rotations(matrices[:, :3, :3], blame), place, f"matrices written by {order}"
