"""Recordings in tables: rows of a pose, and perhaps of time, joints, a gripper and objects."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import BadDemonstration, UnknownName
from ..geometry.pose import Pose, PosePath
from ..imitation.npz_arrays import unit_poses
from ..robot.arm import Arm
from .gripper_signal import gripper_command
from .named_columns import PoseColumns, Roles, check_order, components, named, roles_of
from .recording import METERS, QUATERNIONS, RADIANS, SECONDS, Recording, blame_of
from .text_table import TextTable, read_table
from .time_stamps import seconds_of

MOST_RADIANS = 4.0 * np.pi
"""Largest plausible position of a joint that turns [rad]."""


class TableRequest(NamedTuple):
    """Facts about a table that its columns' names do not say.

    Attributes:
        units: of positions: "m", "cm" or "mm"; "": what the names say, else m.
        quaternion: order of the quaternion's columns, "wxyz" or "xyzw"; "": what the names say.
        rate: samples per second; None: the table has time stamps.
        time_unit: of the stamps: "s", "ms", "us" or "ns"; "": what the names or the numbers say.
        angles: of the joints: "rad" or "deg"; "": what the names say, else rad.
        columns: names of the columns; empty: those of the file.
        ignored: patterns of names to leave out.
        hand: name of the hand's pose in the file; "": the usual ones.
        closed: value of the closed gripper; None: what the range says.
        tool: `recorded_from_tcp`, pose of the tcp in the recorded frame [m].
    """

    units: str = ""
    quaternion: str = ""
    rate: float | None = None
    time_unit: str = ""
    angles: str = ""
    columns: tuple[str, ...] = ()
    ignored: tuple[str, ...] = ()
    hand: str = ""
    closed: float | None = None
    tool: Pose | None = None


def recording_from_table(path: str | Path, request: TableRequest, arm: Arm | None = None) -> Recording:
    """Read a table of poses: text with any separator, with or without a header, or .npy.

    Args:
        path: of the file.
        request: what its names do not say.
        arm: the robot; joints without a pose of the hand become one by its forward kinematics.

    Raises:
        UnknownName: an unknown unit, order or column to leave out.
        BadDemonstration: the file or one of its entries is invalid; the error names the line or the column.
    """
    path = Path(path)
    for what, value, known in (
        ("unit", request.units, METERS),
        ("quaternion order", request.quaternion, QUATERNIONS),
        ("time unit", request.time_unit, SECONDS),
        ("unit of angles", request.angles, RADIANS),
    ):
        if value and value not in known:
            raise UnknownName(what, value, known)
    table = named(read_table(path), request.columns, request.quaternion)
    roles = roles_of(table, request.ignored, request.hand)
    time, about_time = _time(table, roles, request)
    joints, about_joints = _joints(table, roles, request)
    hand, about_hand = _hand_path(table, roles, request, joints, arm)
    gripper, about_gripper = _gripper(table, roles, request)
    objects = {name: _path(table, columns, request)[0] for name, columns in roles.objects.items()}
    notes = (*table.notes, about_hand, about_time, about_joints, about_gripper, *roles.notes)
    if objects:
        notes = (*notes, f"objects: {', '.join(objects)}")
    return Recording(
        file=path,
        time=time,
        hand=hand if request.tool is None else hand.with_tool(request.tool),
        joints=joints,
        other_joints={table.names[k]: _numbers(table, k) for k in roles.fingers},
        gripper=gripper,
        objects=objects,
        notes=tuple(note for note in notes if note),
    )


def _numbers(table: TextTable, k: int) -> np.ndarray:
    """Return a column (n,) of finite numbers."""
    column = np.asarray(table.columns[k], dtype=np.float64)
    bad = np.flatnonzero(~np.isfinite(column))
    if len(bad):
        where = f"line {table.lines[bad[0]]}" if table.path.suffix != ".npy" else f"row {bad[0]}"
        raise BadDemonstration(table.path, table.label(k), f"is not finite at index {bad[0]} ({where})")
    return column


def _path(table: TextTable, columns: PoseColumns, request: TableRequest) -> tuple[PosePath, str]:
    """Return the path that columns hold, and what was understood of them."""
    order = check_order(table, columns, request.quaternion)
    if columns.unit and request.units and columns.unit != request.units:
        reason = f"positions are in {columns.unit} there; --units {request.units} contradicts it"
        raise BadDemonstration(table.path, "header", reason)
    unit = columns.unit or request.units or "m"
    if unit not in METERS:
        raise BadDemonstration(table.path, "header", f"positions are in {unit!r}; allowed: {', '.join(METERS)}")
    position = np.column_stack([_numbers(table, k) for k in columns.position]) * METERS[unit]
    quaternion = np.column_stack([_numbers(table, k) for k in components(columns, order)])
    poses = unit_poses(table.path, "table", np.concatenate([position, quaternion], axis=1))
    if len(poses) < 2:
        raise BadDemonstration(table.path, "table", f"has {len(poses)} sample(s); at least 2 are needed")
    return PosePath.from_vectors(poses), f"positions are in {unit}, quaternions {order}"


def _hand_path(
    table: TextTable, roles: Roles, request: TableRequest, joints: np.ndarray | None, arm: Arm | None
) -> tuple[PosePath, str]:
    if roles.hand is not None:
        return _path(table, roles.hand, request)
    if joints is None:
        have = ", ".join(table.names)
        raise BadDemonstration(table.path, "header", f"names no pose x y z qw qx qy qz of the hand; there are: {have}")
    if arm is None or joints.shape[1] != arm.dof:
        known = "" if arm is None else f"; the {arm.name} has {arm.dof}"
        reason = f"has {joints.shape[1]} joints and no pose of the hand{known}: say --robot"
        raise BadDemonstration(table.path, "header", reason)
    return PosePath(np.array([arm.fk(row).dq for row in joints])), "the hand's path is that of the joints"


def _time(table: TextTable, roles: Roles, request: TableRequest) -> tuple[np.ndarray, str]:
    if not roles.time:
        if request.time_unit:
            raise BadDemonstration(table.path, "--time-unit", "is given, and no column holds time stamps")
        if request.rate is None:
            raise BadDemonstration(table.path, "rate", "is needed, since no column holds time stamps: say --rate")
        if not 0.0 < request.rate < np.inf:
            reason = f"{request.rate} is not a positive number of samples per second"
            raise BadDemonstration(table.path, "rate", reason)
        return np.arange(len(table.lines)) / request.rate, ""
    names = " and ".join(repr(table.names[k]) for k in roles.time)
    if request.rate is not None:
        raise BadDemonstration(
            table.path, "rate", f"is not needed: {names} holds the time stamps; or leave it out by --ignore"
        )
    if roles.time_unit and request.time_unit and roles.time_unit != request.time_unit:
        reason = f"{names} is in {roles.time_unit}; --time-unit {request.time_unit} contradicts it"
        raise BadDemonstration(table.path, "header", reason)
    stamps = _numbers(table, roles.time[0])
    blame = blame_of(table.path, table.label(roles.time[0]))
    if len(roles.time) == 1:
        return seconds_of(stamps, roles.time_unit or request.time_unit, blame)
    whole = (stamps - stamps[0]) + 1e-9 * _numbers(table, roles.time[1])
    return seconds_of(whole, "s", blame)


def _joints(table: TextTable, roles: Roles, request: TableRequest) -> tuple[np.ndarray | None, str]:
    if not roles.joints:
        return None, ""
    if roles.joint_unit and request.angles and roles.joint_unit != request.angles:
        reason = f"joints are in {roles.joint_unit} there; --angles {request.angles} contradicts it"
        raise BadDemonstration(table.path, "header", reason)
    unit = roles.joint_unit or request.angles or "rad"
    if unit not in RADIANS:
        raise BadDemonstration(table.path, "header", f"joints are in {unit!r}; allowed: {', '.join(RADIANS)}")
    joints = np.column_stack([_numbers(table, k) for k in roles.joints])
    worst = np.unravel_index(np.abs(joints).argmax(), joints.shape)
    if unit == "rad" and not request.angles and abs(joints[worst]) > MOST_RADIANS:
        reason = f"is {joints[worst]:.4g} at index {worst[0]}: in degrees? say --angles deg or rad"
        raise BadDemonstration(table.path, table.label(roles.joints[worst[1]]), reason)
    return joints * RADIANS[unit], f"{joints.shape[1]} joints are in {unit}"


def _gripper(table: TextTable, roles: Roles, request: TableRequest) -> tuple[np.ndarray | None, str]:
    if roles.gripper is not None:
        values, key = _numbers(table, roles.gripper), table.label(roles.gripper)
    elif roles.fingers:
        values, key = np.sum([np.abs(_numbers(table, k)) for k in roles.fingers], axis=0), "fingers"
    else:
        if request.closed is not None:
            raise BadDemonstration(table.path, "--gripper-closed", "is given, and no column is of the gripper")
        return None, ""
    return gripper_command(values, request.closed, blame_of(table.path, key))
