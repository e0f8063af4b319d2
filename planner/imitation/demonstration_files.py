"""Demonstrations as .npz files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import checked_file, checked_kind
from ..errors import BadDemonstration, OneDemoError
from ..geometry.pose import Pose, PosePath
from .demonstration import Demonstration, Segment
from .npz_arrays import numbers, read_arrays, text, texts, unique_names, unit_poses

FORMAT_VERSION = 1
UNITS = "m s rad wxyz"
TEXTS = ("name", "task", "robot", "tcp_frame", "source", "licence", "units")
REQUIRED = (*TEXTS, "format_version", "time", "poses")
OPTIONAL = (
    "joint_positions",
    "gripper",
    "segment_names",
    "segment_ranges",
    "segment_references",
    "segment_reference_poses",
    "segment_held",
    "segment_gripper",
    "object_names",
    "object_sizes",
    "object_path_names",
    "object_paths",
    "fixture_names",
    "fixture_poses",
    "other_joint_names",
    "other_joints",
    "commanded_poses",
)


def save_demonstration(demonstration: Demonstration, path: str | Path) -> None:
    """Write a demonstration to an .npz file; the file appears only when complete.

    Args:
        demonstration: the demonstration.
        path: of the file, overwritten if present.

    Raises:
        WrongType: no demonstration, or no path.
    """
    demo, path = checked_kind("demonstration", demonstration, Demonstration), checked_file(path)
    segments = demo.segments
    arrays: dict[str, Any] = {
        "format_version": FORMAT_VERSION,
        "units": UNITS,
        **{key: getattr(demo, key) for key in TEXTS if key != "units"},
        "time": demo.time,
        "poses": demo.path.vectors,
        "segment_names": [s.name for s in segments],
        "segment_ranges": np.array([(s.start, s.stop) for s in segments], dtype=np.int64).reshape(-1, 2),
        "segment_references": [s.reference for s in segments],
        "segment_reference_poses": np.array([s.reference_pose.vector for s in segments]).reshape(-1, 7),
        "segment_held": [s.held for s in segments],
        "segment_gripper": [s.gripper for s in segments],
        "object_names": list(demo.object_sizes),
        "object_sizes": np.array(list(demo.object_sizes.values()), dtype=np.float64).reshape(-1, 3),
    }
    for key in ("joint_positions", "gripper"):
        if getattr(demo, key) is not None:
            arrays[key] = getattr(demo, key)
    arrays |= _scene_arrays(demo)
    words = {key: np.array(value, dtype=str) for key, value in arrays.items() if _is_text(value)}
    path = Path(path)
    part = path.with_name(f"{path.name}.part")
    try:
        with part.open("wb") as file:
            np.savez_compressed(file, **{**arrays, **words})
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def _scene_arrays(demo: Demonstration) -> dict[str, Any]:
    """Return the entries of what was recorded besides the arm; none for what was not."""
    arrays: dict[str, Any] = {}
    if demo.object_paths:
        arrays["object_path_names"] = list(demo.object_paths)
        arrays["object_paths"] = np.array([path.vectors for path in demo.object_paths.values()])
    if demo.fixtures:
        arrays["fixture_names"] = list(demo.fixtures)
        arrays["fixture_poses"] = np.array([pose.vector for pose in demo.fixtures.values()])
    if demo.other_joints:
        arrays["other_joint_names"] = list(demo.other_joints)
        arrays["other_joints"] = np.column_stack(list(demo.other_joints.values()))
    if demo.commanded is not None:
        arrays["commanded_poses"] = demo.commanded.vectors
    return arrays


def read_demonstration(path: str | Path) -> Demonstration:
    """Read a demonstration from an .npz file.

    Raises:
        WrongType: no path.
        BadDemonstration: the file or one of its entries is invalid; the error names the entry.
    """
    path = checked_file(path)
    arrays = read_arrays(path)
    missing = [key for key in REQUIRED if key not in arrays]
    if missing:
        raise BadDemonstration(path, missing[0], f"is missing; a demonstration holds: {', '.join(REQUIRED)}")
    unknown = [key for key in arrays if key not in REQUIRED + OPTIONAL]
    if unknown:
        raise BadDemonstration(path, unknown[0], f"is unknown; allowed: {', '.join(REQUIRED + OPTIONAL)}")
    version = arrays["format_version"]
    if version.shape != () or version.dtype.kind not in "iu" or int(version) != FORMAT_VERSION:
        raise BadDemonstration(path, "format_version", f"is {version.tolist()}; this program reads {FORMAT_VERSION}")
    words = {key: text(path, key, arrays[key]) for key in TEXTS}
    if words.pop("units") != UNITS:
        raise BadDemonstration(path, "units", f"must be {UNITS!r}; convert with: onedemo demo import")
    try:
        return Demonstration(
            **words,
            time=numbers(path, "time", arrays["time"], 1),
            path=PosePath.from_vectors(unit_poses(path, "poses", arrays["poses"])),
            joint_positions=numbers(path, "joint_positions", arrays["joint_positions"], 2)
            if "joint_positions" in arrays
            else None,
            gripper=numbers(path, "gripper", arrays["gripper"], 1) if "gripper" in arrays else None,
            segments=_segments(path, arrays),
            object_sizes=_object_sizes(path, arrays),
            **_scene(path, arrays),
        )
    except BadDemonstration as error:
        raise BadDemonstration(path, error.key, error.reason) from None
    except (OneDemoError, ValueError, TypeError) as error:
        raise BadDemonstration(path, "content", str(error).splitlines()[0]) from None


def _is_text(value: Any) -> bool:
    return isinstance(value, str) or (isinstance(value, list) and all(isinstance(v, str) for v in value))


def _segments(path: Path, arrays: dict[str, np.ndarray]) -> tuple[Segment, ...]:
    keys = [key for key in OPTIONAL if key.startswith("segment_")]
    present = [key for key in keys if key in arrays]
    if not present:
        return ()
    missing = [key for key in keys if key not in arrays]
    if missing:
        raise BadDemonstration(path, missing[0], "is missing, although other segment entries are there")
    keys = ("segment_names", "segment_references", "segment_held", "segment_gripper")
    names, references, held, gripper = (texts(path, key, arrays[key]) for key in keys)
    ranges = arrays["segment_ranges"]
    if ranges.dtype.kind not in "iu" or ranges.ndim != 2 or ranges.shape[1] != 2:
        reason = f"is {ranges.dtype.name} of shape {ranges.shape}; expected whole numbers (segments, 2)"
        raise BadDemonstration(path, "segment_ranges", reason)
    poses = unit_poses(path, "segment_reference_poses", arrays["segment_reference_poses"])
    for key in present:
        if len(arrays[key]) != len(names):
            raise BadDemonstration(path, key, f"does not have {len(names)} entries as segment_names has")
    return tuple(
        Segment(
            name=names[k],
            start=int(ranges[k, 0]),
            stop=int(ranges[k, 1]),
            reference=references[k],
            reference_pose=Pose.from_vector(poses[k]),
            held=held[k],
            gripper=gripper[k],
        )
        for k in range(len(names))
    )


def _scene(path: Path, arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    """Return the fields of what was recorded besides the arm."""
    found: dict[str, Any] = {}
    for key, names_key in (
        ("object_paths", "object_path_names"),
        ("fixture_poses", "fixture_names"),
        ("other_joints", "other_joint_names"),
    ):
        if (key in arrays) != (names_key in arrays):
            missing, there = (names_key, key) if key in arrays else (key, names_key)
            raise BadDemonstration(path, missing, f"is missing, although {there} is there")
    if "object_paths" in arrays:
        names, poses = (
            unique_names(path, "object_path_names", arrays),
            numbers(path, "object_paths", arrays["object_paths"], 3),
        )
        _check_count(path, "object_paths", len(poses), names)
        found["object_paths"] = {
            name: PosePath.from_vectors(unit_poses(path, f"object_paths of {name!r}", rows))
            for name, rows in zip(names, poses, strict=True)
        }
    if "fixture_poses" in arrays:
        names, poses = (
            unique_names(path, "fixture_names", arrays),
            unit_poses(path, "fixture_poses", arrays["fixture_poses"]),
        )
        _check_count(path, "fixture_poses", len(poses), names)
        found["fixtures"] = {name: Pose.from_vector(row) for name, row in zip(names, poses, strict=True)}
    if "other_joints" in arrays:
        names, values = (
            unique_names(path, "other_joint_names", arrays),
            numbers(path, "other_joints", arrays["other_joints"], 2),
        )
        _check_count(path, "other_joints", values.shape[1], names)
        found["other_joints"] = dict(zip(names, values.T, strict=True))
    if "commanded_poses" in arrays:
        found["commanded"] = PosePath.from_vectors(unit_poses(path, "commanded_poses", arrays["commanded_poses"]))
    return found


def _check_count(path: Path, key: str, count: int, names: list[str]) -> None:
    if count != len(names):
        raise BadDemonstration(path, key, f"is for {count}; there are {len(names)} names: {', '.join(names)}")


def _object_sizes(path: Path, arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    names = unique_names(path, "object_names", arrays)
    sizes = numbers(path, "object_sizes", arrays.get("object_sizes", np.empty((0, 3))), 2)
    if sizes.shape != (len(names), 3):
        raise BadDemonstration(path, "object_sizes", f"has shape {sizes.shape}; expected ({len(names)}, 3)")
    return dict(zip(names, sizes, strict=True))
