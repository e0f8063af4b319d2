"""Plain arrays of .npz files. Reading never runs code and never expands more than the announced size."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path

import numpy as np

from ..errors import BadDemonstration

MAX_BYTES = 64 * 2**20
UNIT_QUATERNION = 1e-3
"""Largest deviation of a quaternion's norm that counts as rounding (recordings in single precision, logs with four
digits); beyond it the numbers are not a quaternion."""
UNREADABLE = (zipfile.BadZipFile, zlib.error, EOFError, OSError, ValueError, SyntaxError, RuntimeError, ArithmeticError)
"""Errors raised by zipfile, zlib and NumPy on damaged files; encrypted or exotic archives raise a RuntimeError."""


def read_arrays(path: Path, max_bytes: int = MAX_BYTES) -> dict[str, np.ndarray]:
    """Read all arrays of an .npz file after checking its headers: no objects, no duplicates, no zip bombs.

    Args:
        path: of the file.
        max_bytes: largest total size of the expanded arrays [bytes].

    Raises:
        BadDemonstration: the file is missing, unreadable, too large or contains other entries than plain arrays.
    """
    if not path.is_file():
        raise BadDemonstration(path, "file", "is a folder" if path.is_dir() else "does not exist")
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


def text(path: Path, key: str, value: np.ndarray) -> str:
    """Return a single text.

    Args:
        path: of the file, for messages.
        key: of the array, for messages.
        value: the array.

    Raises:
        BadDemonstration: it is anything else.
    """
    if value.shape != () or value.dtype.kind != "U":
        raise BadDemonstration(path, key, "is not a text")
    return str(value)


def texts(path: Path, key: str, value: np.ndarray) -> list[str]:
    """Return a list of texts.

    Args:
        path: of the file, for messages.
        key: of the array, for messages.
        value: the array.

    Raises:
        BadDemonstration: it is anything else.
    """
    if value.ndim != 1 or value.dtype.kind != "U":
        raise BadDemonstration(path, key, "is not a list of texts")
    return [str(each) for each in value]


def unique_names(path: Path, key: str, arrays: dict[str, np.ndarray]) -> list[str]:
    """Return the names under a key, none if it is not there.

    Args:
        path: of the file, for messages.
        key: of the names.
        arrays: of the file.

    Raises:
        BadDemonstration: double or empty names.
    """
    names = texts(path, key, arrays.get(key, np.empty(0, dtype=str)))
    if len(set(names)) < len(names) or "" in names:
        raise BadDemonstration(path, key, f"are not unique names: {', '.join(map(repr, names))}")
    return names
