"""Demonstrations from recordings of any kind that is known, by the options of the command."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...baselines.recording.import_pour import pour_from_poses
from ...configs import BadConfig
from ...planner import Arm, Demonstration, Pose
from ...planner.errors import BadDemonstration
from ...planner.recordings.cuts import LEAVING, SegmentRequest
from ...planner.recordings.import_recording import demonstration_of
from ...planner.recordings.kinematic_check import check_object, gaps_in_words, reach_in_words
from ...planner.recordings.pose_columns import TableRequest
from ...planner.recordings.pose_table import recording_from_table
from ...planner.recordings.recording import Recording, blame_of
from ...planner.recordings.teleoperation import recording_from_teleoperation
from ..console import COMMAND_LINE
from .hdf5_episode import ENDINGS, recording_from_hdf5
from .robot_checks import about_robot, joints_in_words, known_arm, robot_named_like

GRIP_SITE = "grip_site"
"""Name of the tcp of the robots at the table."""

UNREAD = {
    ".json": "JSON", ".jsonl": "JSON", ".yaml": "YAML", ".bag": "a rosbag", ".db3": "a rosbag", ".mcap": "a rosbag",
    ".parquet": "Parquet", ".xlsx": "an Excel workbook", ".xls": "an Excel workbook", ".ods": "a spreadsheet",
    ".mat": "a file of MATLAB", ".pkl": "a pickle", ".pickle": "a pickle", ".zip": "an archive", ".gz": "compressed",
}  # fmt: skip
"""Kinds of files that hold recordings and are not read, by their ending."""


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
    request = request._replace(robot=robot_named_like(request.robot))
    arm = known_arm(request.robot)
    recording = _recording(raw, request, arm)
    notes = [note for note in (about_robot(request.robot), *recording.notes) if note]
    if recording.is_computed or raw.suffix.lower() in ENDINGS:  # tables with poses were looked at with their units
        notes.append(reach_in_words(recording.hand, recording.time, arm, "m", blame_of(raw, "poses")))
        _check_objects(recording)
    if recording.joints is not None and arm is not None:
        _check_dof(raw, arm, recording.joints)
        poses = None if recording.is_computed else recording.hand
        notes.append(f"the joints are {joints_in_words(raw, recording.joints, recording.time, arm, poses)}")
    notes += gaps_in_words(recording.hand, recording.time)
    if request.places:
        recording = _placed(recording, request.places)
    _check_sizes(recording, request.sizes)
    task, names, about_task = _task(request.task)
    lacks_glasses = task == "pour" and not (recording.objects or recording.fixtures)
    # a motion with the glass in the hand from the start: poses of a real Panda's hand, and nothing else
    is_bare_pour = lacks_glasses and not request.segments and recording.gripper is None and recording.joints is None
    if lacks_glasses and not is_bare_pour:
        reason = "needs the glasses source and target, and none was recorded: say with --place where they stood"
        raise BadDemonstration(raw, "task pour", reason)
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
        demonstration, about_glasses = _with_glasses(demonstration)
        notes += about_glasses
    return demonstration, (*notes, *about_task, *_left_over(demonstration, recording))


def _check_objects(recording: Recording) -> None:
    """Refuse objects of a teleoperation or an episode that are none."""
    is_npz = recording.file.suffix.lower() not in ENDINGS
    for name, path in recording.objects.items():
        way_out = f"leave it out with --ignore 'obj_{name}*'" if is_npz else "cut the episode, or take another one"
        blame, at = blame_of(recording.file, f"obj_{name}" if is_npz else name), (recording.hand, recording.time)
        check_object(name, path, *at, recording.gripper, blame, way_out)


def _recording(raw: Path, request: ImportRequest, arm: Arm | None) -> Recording:
    kind, table = raw.suffix.lower(), request.table
    if kind in UNREAD and raw.is_file():
        raise BadDemonstration(raw, "file", f"is {UNREAD[kind]}, which is not read: write it as .csv, .npy or .npz")
    if request.episode and kind not in ENDINGS:
        raise BadConfig(COMMAND_LINE, "--demo", f"is for HDF5 files ({', '.join(ENDINGS)})")
    if kind not in (".npz", *ENDINGS):
        return recording_from_table(raw, table, arm)
    if kind in ENDINGS:
        _refuse_others(table, ("hand",), "an HDF5 file")
        return recording_from_hdf5(raw, request.episode, table.hand)
    _refuse_others(table, ("ignored", "time_unit"), "a teleoperation")
    if arm is None:
        raise BadConfig(COMMAND_LINE, "--robot", f"{request.robot!r} is no shipped robot, and {raw} holds joints alone")
    table.check_words()
    return recording_from_teleoperation(raw, arm, tcp_frame=GRIP_SITE, ignored=table.ignored, time_unit=table.time_unit)


def _refuse_others(table: TableRequest, used: tuple[str, ...], kind: str) -> None:
    """Refuse options of tables that a file of another kind does not need, so that none is ignored."""
    options = {"ignored": "--ignore", "closed": "--gripper-closed", "time_unit": "--time-unit"}
    for key, value in table._asdict().items():
        if key not in used and value != TableRequest._field_defaults[key]:
            raise BadConfig(COMMAND_LINE, options.get(key, f"--{key}"), f"is for tables of poses, not for {kind}")


def _with_glasses(demonstration: Demonstration) -> tuple[Demonstration, list[str]]:
    """Return a pouring without glasses with them, and where they are taken to stand, a line each."""
    placed = pour_from_poses(demonstration)
    notes = []
    for glass, top in zip(("source", "target"), placed.stands, strict=True):
        place = " ".join(f"{value:.3f}" for value in top)
        notes.append(f"the {glass}, which was not recorded, is taken to stand at {place} m")
    return placed.demonstration, notes


def _left_over(demonstration: Demonstration, recording: Recording) -> list[str]:
    """Return a note about what the hand does after the last motion, if it moves on."""
    last, lengths = max((each.stop for each in demonstration.segments), default=-1), recording.hand.lengths()
    if last < 0 or lengths[-1] - lengths[last] <= LEAVING:
        return []
    since, end = (recording.time[k] - recording.time[0] for k in (last, -1))
    return [f"what the hand does after the last motion, from {since:.1f} to {end:.1f} s, is part of no motion"]


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
    from ...envs import TASKS, task_at
    from ...envs.dotted_names import is_dotted

    if not task:
        return "", (), ()
    if is_dotted(task):
        return task_at(task).name, (), ()
    named = {name: facts.skill for name, facts in TASKS.items() if facts.skill is not None}
    if task not in named:
        return task, (), (f"{task!r} is none of the shipped tasks ({', '.join(named)}): its motions have no names",)
    shown = TASKS[task].demonstrated_task or task
    return shown, named[task].required, ()
