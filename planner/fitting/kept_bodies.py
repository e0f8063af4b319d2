"""Bodies that were fitted before, kept beside the compiled kernels: a fit takes from seconds to a minute.

A body's file is named after all that decides about it: the arm, the model's geometry, the libraries, and, as with the
kernels, the content of the files that fit. Not in the paper, which moves a point.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import OneDemoError
from ..geometry.pose import Pose
from ..jit import cache_folder
from ..robot.arm import Arm
from ..robot.body import Body, Hull
from . import link_capsules
from .link_capsules import Split, body_of
from .robot_model import RobotModel

LIBRARIES = ("numpy", "scipy", "numba", "python-fcl")
"""Libraries whose versions decide about the last digits."""


def kept_body_of(robot: RobotModel, arm: Arm, split: Split, *, exact: bool = True) -> tuple[Body, tuple[str, ...]]:
    """Return `body_of` these, read from the cache if it was fitted before; what cannot be read or kept is fitted.

    Args:
        robot: see `body_of`.
        arm: see `body_of`.
        split: see `body_of`.
        exact: see `body_of`; without, a body is fitted soon, and not kept.

    Raises:
        BadModel, UnknownName: as `body_of`.
    """
    folder = cache_folder(Path(link_capsules.__file__)) if exact else None
    if folder is None:
        return body_of(robot, arm, split, exact=exact)
    file = folder / f"body-{_digest(robot, arm, split)}.npz"
    with suppress(OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, OneDemoError):
        return _read(file)
    body, doubts = body_of(robot, arm, split)
    with suppress(OSError):  # a full disk, for example
        _write(file, body, doubts)
    return body, doubts


def _digest(robot: RobotModel, arm: Arm, split: Split) -> str:
    digest = hashlib.sha256()
    libraries = [version(name) for name in LIBRARIES]
    limits = (arm.joint_names, arm.chain, arm.lower, arm.upper)
    _feed(digest, (libraries, limits, robot.parts, robot.reference, robot.joints, split))
    return digest.hexdigest()[:32]


def _feed(digest: Any, value: Any) -> None:
    """Feed a value to a digest, with its structure, so that no two values feed the same."""
    if isinstance(value, np.ndarray):
        digest.update(f"{value.dtype.str}{value.shape}".encode())
        digest.update(np.ascontiguousarray(value).tobytes())
    elif isinstance(value, Pose):
        _feed(digest, value.dq)
    elif isinstance(value, Mapping):
        _feed(digest, sorted(value.items()))
    elif isinstance(value, list | tuple):
        digest.update(f"({len(value)}".encode())
        for each in value:
            _feed(digest, each)
    else:
        digest.update(f"{value!r};".encode())


def _write(file: Path, body: Body, doubts: Sequence[str]) -> None:
    """Write a body's file at once, so that no process reads half of one.

    Raises:
        OSError: it cannot be written.
    """
    hulls = list({id(hull): hull for hull in body.hulls if hull is not None}.values())
    numbers = {id(hull): k for k, hull in enumerate(hulls)}
    table = {
        "rows": body.rows,
        "names": np.array(body.names),
        "corners": np.vstack([np.zeros((0, 3)), *(hull.corners for hull in hulls)]),
        "counts": np.array([len(hull.corners) for hull in hulls], dtype=np.int64),
        "roundings": np.array([hull.rounding for hull in hulls], dtype=np.float64),
        "hull_of": np.array([numbers.get(id(hull), -1) for hull in body.hulls], dtype=np.int64),
        "pairs": np.array(body.pairs, dtype=np.int64).reshape(-1, 2),
        "doubts": np.array(doubts, dtype=np.str_),
        "margins": np.array([(*pair, margin) for pair, margin in body.margins.items()]).reshape(-1, 3),
    }
    with tempfile.NamedTemporaryFile(dir=file.parent, suffix=".part", delete=False) as part:
        try:
            np.savez_compressed(part, **table)
            part.close()
            os.replace(part.name, file)
        except OSError:
            Path(part.name).unlink(missing_ok=True)
            raise


def _read(file: Path) -> tuple[Body, tuple[str, ...]]:
    """Return a body from its file, and what is doubtful about it.

    Raises:
        OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, OneDemoError: there is none, or it is damaged.
    """
    with np.load(file, allow_pickle=False) as kept:
        table = {key: kept[key] for key in kept.files}
    corners = np.split(table["corners"], np.cumsum(table["counts"])[:-1])[: len(table["counts"])]
    hulls = [Hull(points, float(radius)) for points, radius in zip(corners, table["roundings"], strict=True)]
    body = Body(
        table["rows"],
        tuple(map(str, table["names"])),
        hulls=tuple(None if k < 0 else hulls[k] for k in table["hull_of"]),
        pairs=tuple((int(i), int(j)) for i, j in table["pairs"]),
        margins={(int(i), int(j)): float(margin) for i, j, margin in table["margins"]},
    )
    return body, tuple(map(str, table["doubts"]))
