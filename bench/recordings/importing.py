"""Demonstrations from recordings of any kind that is known, by the options of the command."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...baselines.recording.import_pour import pour_from_poses
from ...configs import BadConfig
from ...envs import ROBOTS
from ...planner import Arm, Demonstration, Pose
from ...planner.errors import BadDemonstration
from ...planner.recordings.cuts import SegmentRequest
from ...planner.recordings.import_recording import demonstration_of
from ...planner.recordings.kinematic_check import checked_against_joints, joints_path
from ...planner.recordings.pose_table import TableRequest, recording_from_table
from ...planner.recordings.recording import Recording
from ...planner.recordings.teleoperation import recording_from_teleoperation
from ..console import COMMAND_LINE
from .hdf5_episode import ENDINGS, recording_from_hdf5

GRIP_SITE = "grip_site"
"""Name of the tcp of the robots at the table."""


class ImportRequest(NamedTuple):
    """Options of an import.

    Attributes:
        name: of the demonstration.
        robot: that was recorded.
        task: that was demonstrated, "" if none.
        licence: of the data.
        source: "teleoperated", "kinesthetic" or "scripted"; "": what is usual for the file.
        table: what the names of a table's columns do not say.
        episode: of an HDF5 file, "" for its first one.
        segments: what the user says of the motions.
        cut: where motions end.
        sizes: of objects, by name, (3,) [m].
        places: poses of things that stood still, by name.
    """

    name: str
    robot: str
    task: str
    licence: str
    source: str
    table: TableRequest
    episode: str
    segments: tuple[SegmentRequest, ...]
    cut: str
    sizes: Mapping[str, np.ndarray]
    places: Mapping[str, Pose]


def imported(raw: Path, request: ImportRequest) -> tuple[Demonstration, tuple[str, ...]]:
    """Return the demonstration of a recording, and what was understood of the file, a line each.

    Args:
        raw: the recording: .npz, .hdf5, .npy or text.
        request: what its user says.

    Raises:
        BadDemonstration, UnknownName, BadConfig: the file or an option cannot be used; one line says why.
    """
    arm = known_arm(request.robot)
    recording = _recording(raw, request, arm)
    notes = list(recording.notes)
    if recording.joints is not None and arm is not None and raw.suffix.lower() != ".npz":
        _check_dof(raw, arm, recording.joints)
        agreement = checked_against_joints(raw, "poses", recording.hand, joints_path(arm, recording.joints))
        notes.append(f"the path of the hand {agreement}")
    if request.places:
        recording = _placed(recording, request.places)
    _check_sizes(recording, request.sizes)
    task, names, about_task = _task(request.task)
    known = bool(recording.objects or recording.fixtures or request.segments)
    is_bare_pour = task == "pour" and not known
    demonstration = demonstration_of(
        recording,
        name=request.name,
        task=task,
        robot=request.robot,
        source=request.source or ("kinesthetic" if recording.joints is None else "teleoperated"),
        licence=request.licence,
        requests=request.segments,
        names=() if is_bare_pour else names,
        cut=request.cut,
        sizes=request.sizes,
    )
    if is_bare_pour:
        placed = pour_from_poses(demonstration)
        demonstration = placed.demonstration
        for glass, top in zip(("source", "target"), placed.stands, strict=True):
            place = " ".join(f"{value:.3f}" for value in top)
            notes.append(f"the {glass}, which was not recorded, is taken to stand at {place} m")
    return demonstration, (*notes, *about_task)


def _recording(raw: Path, request: ImportRequest, arm: Arm | None) -> Recording:
    kind, table = raw.suffix.lower(), request.table
    if request.episode and kind not in ENDINGS:
        raise BadConfig(COMMAND_LINE, "--demo", f"is for HDF5 files ({', '.join(ENDINGS)})")
    if kind not in (".npz", *ENDINGS):
        return recording_from_table(raw, table, arm)
    if kind in ENDINGS:
        _refuse_others(table, ("hand",), "an HDF5 file")
        return recording_from_hdf5(raw, request.episode, table.hand)
    _refuse_others(table, ("ignored",), "a teleoperation")
    if arm is None:
        raise BadConfig(COMMAND_LINE, "--robot", f"{request.robot!r} is no shipped robot, and {raw} holds joints alone")
    return recording_from_teleoperation(raw, arm, tcp_frame=GRIP_SITE, ignored=table.ignored)


def _refuse_others(table: TableRequest, used: tuple[str, ...], kind: str) -> None:
    """Refuse options of tables that a file of another kind does not need, so that none is ignored."""
    options = {"ignored": "--ignore", "closed": "--gripper-closed", "time_unit": "--time-unit"}
    for key, value in table._asdict().items():
        if key not in used and value != TableRequest._field_defaults[key]:
            raise BadConfig(COMMAND_LINE, options.get(key, f"--{key}"), f"is for tables of poses, not for {kind}")


def known_arm(robot: str) -> Arm | None:
    """Return the arm of a shipped robot at the table; None of another robot."""
    from ...envs.scene.robots import robot_named
    from ...envs.scene.scene import robot_arm

    return robot_arm(robot_named(robot)) if robot in ROBOTS else None


def _check_dof(raw: Path, arm: Arm, joints: np.ndarray) -> None:
    if joints.shape[1] != arm.dof:
        reason = f"are {joints.shape[1]}; the {arm.name} has {arm.dof}: say --robot"
        raise BadDemonstration(raw, "joints", reason)


def _placed(recording: Recording, places: Mapping[str, Pose]) -> Recording:
    double = sorted(set(places) & {*recording.objects, *recording.fixtures})
    if double:
        raise BadConfig(COMMAND_LINE, "--place", f"{double[0]!r} is in the recording already")
    return replace(recording, fixtures={**recording.fixtures, **places})


def _check_sizes(recording: Recording, sizes: Mapping[str, np.ndarray]) -> None:
    known = [*recording.objects, *recording.fixtures]
    for name in sizes:
        if name not in known:
            there = ", ".join(known) or "none; say with --place where it stood"
            raise BadConfig(COMMAND_LINE, "--size", f"no object {name!r} was recorded; there are: {there}")


def _task(task: str) -> tuple[str, tuple[str, ...], tuple[str, ...]]:
    """Return the task of a demonstration, the names of the motions that it needs, and what to say about it."""
    from ...baselines.screw_policy import PROGRAMS
    from ..task_table import TASKS

    if not task:
        return "", (), ()
    if task not in TASKS:
        return task, (), (f"{task!r} is none of the shipped tasks ({', '.join(TASKS)}): its motions have no names",)
    shown = TASKS[task].demonstrated_task or task
    return shown, PROGRAMS[task].SEGMENTS, ()
