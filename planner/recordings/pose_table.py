"""Recordings in tables: rows of a pose, and perhaps of time, joints, a gripper and objects."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ..errors import BadDemonstration
from ..geometry.pose import PosePath
from ..robot.arm import Arm
from .column_names import OPENINGS, meanings_of
from .gripper_signal import check_sense, closed_share, gripper_command
from .kinematic_check import check_object, joints_path, reach_in_words
from .named_columns import Roles, named, roles_of, rows_of_frame
from .pose_columns import ANGLES, PoseColumns, TableRequest, asked_about, chosen_unit, path_of
from .recording import METERS, RADIANS, SECONDS, Recording, blame_of
from .text_table import TextTable, read_table
from .time_stamps import seconds_of

MOST_RADIANS = 4.0 * np.pi
"""Largest plausible position of a joint that turns [rad]."""


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
    request.check_words()
    table = named(read_table(path), request)
    table, is_chosen = rows_of_frame(table, request.hand)
    roles = roles_of(table, request.ignored, "" if is_chosen else request.hand)
    _check_needed(table, roles, request)
    time, about_time = _time(table, roles, request)
    joints, about_joints = _joints(table, roles, request)
    hand, about_hand = _hand_path(table, roles, request, time, joints, arm)
    gripper, about_gripper = _gripper(table, roles, request)
    objects = {
        name: path_of(table, each, _request_for(each, roles, request))[0] for name, each in roles.objects.items()
    }
    _check_gripper(table, roles, request, gripper, hand, objects)
    for name, path_ in objects.items():
        ignored = f"leave it out with --ignore '{name}_*'"
        check_object(name, path_, hand, time, gripper, blame_of(table.path, "table"), ignored)
    notes = (*table.notes, about_hand, about_time, about_joints, about_gripper, *roles.notes)
    if objects:
        notes = (*notes, f"objects: {', '.join(objects)}")
    return Recording(
        file=path,
        time=time,
        hand=hand if request.tool is None else hand.with_tool(request.tool),
        joints=joints,
        other_joints={table.names[k]: table.numbers(k) for k in roles.fingers},
        gripper=gripper,
        objects=objects,
        is_computed=roles.hand is None,
        notes=tuple(note for note in notes if note),
    )


def _poses(roles: Roles) -> list[PoseColumns]:
    return [*([] if roles.hand is None else [roles.hand]), *roles.objects.values()]


def _request_for(columns: PoseColumns, roles: Roles, request: TableRequest) -> TableRequest:
    """Return a request without the options that are for other poses of the table, whose names say less."""
    others = {asked_about(pose) for pose in _poses(roles)} - {asked_about(columns), ""}
    return request._replace(**dict.fromkeys(others, ""))


def _check_needed(table: TextTable, roles: Roles, request: TableRequest) -> None:
    """Refuse options about what the table does not hold, so that none is ignored."""
    poses = _poses(roles)
    kinds = {pose.kind for pose in poses}
    turns = bool(kinds & set(ANGLES))
    for option, value, is_needed, what in (
        ("--units", request.units, poses, "pose"),
        ("--quaternion", request.quaternion, "quaternion" in kinds, "quaternion"),
        ("--rotation", request.rotation, turns, "orientation of three numbers"),
        ("--matrix", request.matrix, "matrix" in kinds, "matrix"),
        ("--angles", request.angles, turns or roles.joints, "joint or angle"),
        ("--time-unit", request.time_unit, roles.time, "time stamp"),
        ("--gripper-closed", request.closed is not None, roles.gripper is not None or roles.fingers, "gripper"),
    ):
        if value and not is_needed:
            raise BadDemonstration(table.path, option, f"is given, and no column is of a {what}")


def _hand_path(
    table: TextTable, roles: Roles, request: TableRequest, time: np.ndarray, joints: np.ndarray | None, arm: Arm | None
) -> tuple[PosePath, str]:
    if roles.hand is not None:
        path, about = path_of(table, roles.hand, _request_for(roles.hand, roles, request))
        unit = roles.hand.unit or request.units
        return path, f"{about}; {reach_in_words(path, time, arm, unit, blame_of(table.path, 'table'))}"
    if joints is None:
        have = ", ".join(table.names)
        raise BadDemonstration(table.path, "header", f"names no pose x y z qw qx qy qz of the hand; there are: {have}")
    if arm is None or joints.shape[1] != arm.dof:
        known = "" if arm is None else f"; the {arm.name} has {arm.dof}"
        reason = f"has {joints.shape[1]} joints and no pose of the hand{known}: say --robot"
        raise BadDemonstration(table.path, "header", reason)
    return joints_path(arm, joints), "the hand's path is that of the joints"


def _time(table: TextTable, roles: Roles, request: TableRequest) -> tuple[np.ndarray, str]:
    if not roles.time:
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
    unit = chosen_unit(table, names, roles.time_unit, ("--time-unit", request.time_unit), SECONDS)
    stamps = table.numbers(roles.time[0])
    blame = blame_of(table.path, table.label(roles.time[0]))
    if len(roles.time) == 1:
        return seconds_of(stamps, unit, blame)
    whole = (stamps - stamps[0]) + 1e-9 * table.numbers(roles.time[1])
    return seconds_of(whole, "s", blame)


def _joints(table: TextTable, roles: Roles, request: TableRequest) -> tuple[np.ndarray | None, str]:
    if not roles.joints:
        return None, ""
    said = chosen_unit(table, "joints", roles.joint_unit, ("--angles", request.angles), RADIANS)
    unit = said or "rad"
    joints = np.column_stack([table.numbers(k) for k in roles.joints])
    worst = np.unravel_index(np.abs(joints).argmax(), joints.shape)
    if unit == "rad" and not request.angles and abs(joints[worst]) > MOST_RADIANS:
        reason = f"is {joints[worst]:.4g} at index {worst[0]}: in degrees? say --angles deg or rad"
        raise BadDemonstration(table.path, table.label(roles.joints[worst[1]]), reason)
    return joints * RADIANS[unit], f"{joints.shape[1]} joints are {'in' if said else 'taken to be in'} {unit}"


def _check_gripper(
    table: TextTable,
    roles: Roles,
    request: TableRequest,
    gripper: np.ndarray | None,
    hand: PosePath,
    objects: dict[str, PosePath],
) -> None:
    """Refuse a gripper's column that the objects contradict; what the user says of it counts."""
    if gripper is None or roles.gripper is None or request.closed is not None:
        return
    name, values = table.names[roles.gripper], table.numbers(roles.gripper)
    meaning = meanings_of([name])[0]
    is_named = bool(roles.gripper_end or meaning.unit in METERS or OPENINGS & set(re.split(r"[\W_]+", name.lower())))
    share = closed_share(gripper, hand, objects.values())
    check_sense(values, name, is_named, share, blame_of(table.path, table.label(roles.gripper)))


def _gripper(table: TextTable, roles: Roles, request: TableRequest) -> tuple[np.ndarray | None, str]:
    if roles.gripper is not None:
        values, key = table.numbers(roles.gripper), table.label(roles.gripper)
    elif roles.fingers:
        values, key = np.sum([np.abs(table.numbers(k)) for k in roles.fingers], axis=0), "fingers"
    else:
        return None, ""
    blame = blame_of(table.path, key)
    low, high = float(values.min()), float(values.max())
    if not roles.gripper_end or low == high:
        return gripper_command(values, request.closed, blame)
    named = high if roles.gripper_end == "closed" else low
    if request.closed is not None and abs(request.closed - named) > abs(request.closed - (low + high - named)):
        raise blame(
            f"is {roles.gripper_end} at {high:g} by its name; --gripper-closed {request.closed:g} contradicts it"
        )
    return gripper_command(values, named, blame)
