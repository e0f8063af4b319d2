"""Reduction of very long paths to a number of poses that a plan takes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..geometry import dualquat as dq
from ..geometry.pose import METERS_PER_RADIAN, PosePath
from ..ranges import check_range
from .segmentation import SAME


class ReducedPath(NamedTuple):
    """A path with a bounded number of poses.

    Attributes:
        path: the poses; the given path itself if it is short enough.
        deviation: largest weighted distance [m] of a given pose from this path at the same path length; 0 for the given
            path itself. It is measured, and no more than the spacing of the poses: the path's length over their number.
    """

    path: PosePath
    deviation: float


def reduced(path: PosePath, most: int) -> ReducedPath:
    """Return a path of at most a number of poses: the path itself, or poses at even steps of its path length.

    Poses lie on the screws between their two neighbors, both ends are kept exactly. Not in the paper: a recording at
    1 kHz has a thousand times the poses that a controller can follow.

    Args:
        path: the path.
        most: largest number of poses, at least 2.

    Raises:
        BadOption: the number is below 2.
    """
    check_range("most", most, "[2, inf)")
    if len(path) <= most:
        return ReducedPath(path, 0.0)
    lengths = path.lengths()
    moving = np.concatenate([[True], np.diff(lengths) > SAME])
    known, poses = lengths[moving], path.dqs[moving]
    if len(known) == 1:
        return ReducedPath(PosePath(path.dqs[[0, -1]]), _deviation(path, lengths, path.dqs[[0, -1]], lengths[[0, -1]]))
    wanted = np.linspace(0.0, known[-1], most)
    out = _between(poses, known, wanted)
    out[0], out[-1] = path.dqs[0], path.dqs[-1]
    kept = PosePath(out)
    return ReducedPath(kept, _deviation(path, lengths, kept.dqs, wanted))


def _between(poses: np.ndarray, lengths: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return the poses (m, 8) of a path (n, 8) at path lengths (m,) [m]; the path's own lengths (n,) increase."""
    left = np.clip(np.searchsorted(lengths, wanted, side="right") - 1, 0, len(lengths) - 2)
    steps = lengths[left + 1] - lengths[left]
    fraction = np.divide(wanted - lengths[left], steps, out=np.zeros(len(wanted)), where=steps > 0.0)
    return dq.sclerp(poses[left], poses[left + 1], np.clip(fraction, 0.0, 1.0))


def _deviation(path: PosePath, lengths: np.ndarray, poses: np.ndarray, places: np.ndarray) -> float:
    """Return the largest weighted distance [m] of a path's poses from other poses (m, 8) at path lengths (m,)."""
    distance, angle = dq.pose_distance(_between(poses, places, lengths), path.dqs)
    return float(np.hypot(distance, METERS_PER_RADIAN * angle).max())
