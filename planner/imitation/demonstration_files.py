"""Demonstrations as .npz files. Reading never runs code and never expands more than the announced size."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import BadDemonstration, OneDemoError
from ..geometry.pose import Pose, PosePath
from .demonstration import Demonstration, Segment

FORMAT_VERSION = 1
UNITS = "m s rad wxyz"
MAX_BYTES = 64 * 2**20
UNIT_QUATERNION = 1e-3
"""Largest deviation of a quaternion's norm that counts as rounding (recordings in single precision, logs with four
digits); beyond it the numbers are not a quaternion."""
UNREADABLE = (zipfile.BadZipFile, zlib.error, EOFError, OSError, ValueError, SyntaxError, RuntimeError, ArithmeticError)
"""Errors raised by zipfile, zlib and NumPy on damaged files; encrypted or exotic archives raise a RuntimeError."""
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
)


def save_demonstration(demonstration: Demonstration, path: str | Path) -> None:
    """Write a demonstration to an .npz file; the file appears only when complete.

    Args:
        demonstration: the demonstration.
        path: of the file, overwritten if present.
    """
    demo, segments = demonstration, demonstration.segments
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
    texts = {key: np.array(value, dtype=str) for key, value in arrays.items() if _is_text(value)}
    path = Path(path)
    part = path.with_name(f"{path.name}.part")
    try:
        with part.open("wb") as file:
            np.savez_compressed(file, **{**arrays, **texts})
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def read_demonstration(path: str | Path) -> Demonstration:
    """Read a demonstration from an .npz file.

    Raises:
        BadDemonstration: the file or one of its entries is invalid; the error names the entry.
    """
    path = Path(path)
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
    texts = {key: _text(path, key, arrays[key]) for key in TEXTS}
    if texts.pop("units") != UNITS:
        raise BadDemonstration(path, "units", f"must be {UNITS!r}; convert with: onedemo demo import")
    try:
        return Demonstration(
            **texts,
            time=numbers(path, "time", arrays["time"], 1),
            path=PosePath.from_vectors(unit_poses(path, "poses", arrays["poses"])),
            joint_positions=numbers(path, "joint_positions", arrays["joint_positions"], 2)
            if "joint_positions" in arrays
            else None,
            gripper=numbers(path, "gripper", arrays["gripper"], 1) if "gripper" in arrays else None,
            segments=_segments(path, arrays),
            object_sizes=_object_sizes(path, arrays),
        )
    except BadDemonstration as error:
        raise BadDemonstration(path, error.key, error.reason) from None
    except (OneDemoError, ValueError, TypeError) as error:
        raise BadDemonstration(path, "content", str(error).splitlines()[0]) from None


def read_arrays(path: Path, max_bytes: int = MAX_BYTES) -> dict[str, np.ndarray]:
    """Read all arrays of an .npz file after checking its headers: no objects, no duplicates, no zip bombs.

    Args:
        path: of the file.
        max_bytes: largest total size of the expanded arrays [bytes].

    Raises:
        BadDemonstration: the file is missing, unreadable, too large or contains other entries than plain arrays.
    """
    if not path.is_file():
        raise BadDemonstration(path, "file", "does not exist")
    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
            doubled = [name for name in names if names.count(name) > 1]
            if doubled:
                raise BadDemonstration(path, doubled[0], "stands in the file twice")
            total = 0
            for name in names:
                if not name.endswith(".npy") or "/" in name or "\\" in name:
                    raise BadDemonstration(path, name, "is not a plain array entry")
                total += _announced_bytes(path, archive, name)
            if total > max_bytes:
                raise BadDemonstration(path, "file", f"expands to {total} bytes; at most {max_bytes} are read")
        with np.load(path, allow_pickle=False) as data:
            return {key: data[key] for key in data.files}
    except UNREADABLE as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise BadDemonstration(path, "file", f"is not a readable .npz file ({reason})") from None


def _announced_bytes(path: Path, archive: zipfile.ZipFile, name: str) -> int:
    """Return the size of an entry [bytes] from its header alone."""
    with archive.open(name) as file:
        version = np.lib.format.read_magic(file)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, dtype = read(file)
    if dtype.hasobject:
        raise BadDemonstration(path, name.removesuffix(".npy"), "holds Python objects, which are never loaded")
    announced = int(np.prod(shape, dtype=object)) * dtype.itemsize if shape else dtype.itemsize
    return max(announced, archive.getinfo(name).file_size)


def unit_poses(path: Path | str, key: str, value: np.ndarray) -> np.ndarray:
    """Return pose vectors (n, 7) with normalized quaternions.

    Args:
        path: of the file, for messages.
        key: of the array, for messages.
        value: (n, 7): x y z [m], then quaternion wxyz, unit up to rounding.

    Raises:
        BadDemonstration: another shape, a number that is not finite, or a quaternion that is not unit.
    """
    poses = numbers(path, key, value, 2)
    if poses.shape[1] != 7:
        raise BadDemonstration(path, key, f"has shape {poses.shape}; expected (n, 7): x y z [m], quaternion wxyz")
    norms = np.linalg.norm(poses[:, 3:], axis=1)
    worst = int(np.abs(norms - 1.0).argmax()) if len(norms) else 0
    if len(norms) and abs(norms[worst] - 1.0) > UNIT_QUATERNION:
        raise BadDemonstration(path, key, f"the quaternion at index {worst} has norm {norms[worst]:.4g}; expected 1")
    return np.concatenate([poses[:, :3], poses[:, 3:] / norms[:, None]], axis=1)


def _is_text(value: Any) -> bool:
    return isinstance(value, str) or (isinstance(value, list) and all(isinstance(v, str) for v in value))


def _text(path: Path, key: str, value: np.ndarray) -> str:
    if value.shape != () or value.dtype.kind != "U":
        raise BadDemonstration(path, key, "is not a text")
    return str(value)


def _texts(path: Path, key: str, value: np.ndarray) -> list[str]:
    if value.ndim != 1 or value.dtype.kind != "U":
        raise BadDemonstration(path, key, "is not a list of texts")
    return [str(text) for text in value]


def numbers(path: Path | str, key: str, value: np.ndarray, dimensions: int) -> np.ndarray:
    """Return an array of finite real numbers as float64.

    Args:
        path: of the file, for messages.
        key: of the array, for messages.
        value: the array.
        dimensions: required number of dimensions.

    Raises:
        BadDemonstration: anything else; the error names the file, the key and the index.
    """
    if value.dtype.kind not in "fiu" or value.ndim != dimensions:
        raise BadDemonstration(path, key, f"is not an array of numbers with {dimensions} dimension(s)")
    array = value.astype(np.float64)
    bad = np.argwhere(~np.isfinite(array))
    if len(bad):
        raise BadDemonstration(path, key, f"is not finite at index {int(bad[0][0])}")
    return array


def _segments(path: Path, arrays: dict[str, np.ndarray]) -> tuple[Segment, ...]:
    keys = [key for key in OPTIONAL if key.startswith("segment_")]
    present = [key for key in keys if key in arrays]
    if not present:
        return ()
    missing = [key for key in keys if key not in arrays]
    if missing:
        raise BadDemonstration(path, missing[0], "is missing, although other segment entries are there")
    keys = ("segment_names", "segment_references", "segment_held", "segment_gripper")
    names, references, held, gripper = (_texts(path, key, arrays[key]) for key in keys)
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


def _object_sizes(path: Path, arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    names = _texts(path, "object_names", arrays.get("object_names", np.empty(0, dtype=str)))
    if len(set(names)) < len(names) or "" in names:
        raise BadDemonstration(path, "object_names", f"are not unique names: {', '.join(map(repr, names))}")
    sizes = numbers(path, "object_sizes", arrays.get("object_sizes", np.empty((0, 3))), 2)
    if sizes.shape != (len(names), 3):
        raise BadDemonstration(path, "object_sizes", f"has shape {sizes.shape}; expected ({len(names)}, 3)")
    return dict(zip(names, sizes, strict=True))
