"""Segmentation of a recording into motions, and removal of human artifacts."""

from __future__ import annotations

import numpy as np

from ..errors import BadOption
from ..geometry import dualquat as dq
from ..geometry.pose import PosePath
from ..ranges import check_range

DWELL_SPEED = 0.05
"""Fraction of the median speed below which the hand counts as resting."""
DWELL_SECONDS = 0.3
"""Shortest duration of a rest [s]."""
MAX_POSES = 1_000_000
"""Number of poses beyond which a step is taken for a mistake."""
SAME = 1e-9
"""Path length [m] below which two poses count as equal."""


def gripper_events(gripper: np.ndarray) -> np.ndarray:
    """Return the last sample (k,) before each sign change of the gripper command (n,)."""
    return np.flatnonzero(np.diff(np.sign(gripper)) != 0)


def dwells(time: np.ndarray, path: PosePath) -> list[tuple[int, int]]:
    """Find the rests of a path: sample ranges, both ends included, slow for longer than 0.3 s.

    Args:
        time: (n,) [s].
        path: n poses.
    """
    steps = np.diff(path.lengths())
    speed = steps / np.diff(time)
    moving = speed[steps > SAME]
    if not len(moving):
        return [(0, len(path) - 1)]
    slow = speed < DWELL_SPEED * np.median(moving)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], slow.astype(int), [0]])))
    ranges = zip(edges[::2], edges[1::2], strict=True)
    return [(int(a), int(b)) for a, b in ranges if time[b] - time[a] > DWELL_SECONDS]


def resampled(path: PosePath, step: float) -> PosePath:
    """Resample a path at equal steps of path length; both ends are kept exactly.

    Removes the weight of pauses and trembling from rules that count poses. Poses in between lie on the screw between
    their two neighbors: nothing is smoothed.

    Args:
        path: the path.
        step: largest step [m] of path length.

    Raises:
        BadOption: the step is not positive, or so small that the path would have more than `MAX_POSES`.
    """
    check_range("step", step, "(0, inf]")
    lengths = path.lengths()
    keep = np.concatenate([[True], np.diff(lengths) > SAME])
    poses, known = path.dqs[keep], lengths[keep]
    if len(poses) == 1:
        return PosePath(path.dqs[[0, -1]])
    if known[-1] / step > MAX_POSES:
        raise BadOption("step", f"{step:g} m would take {known[-1] / step:.3g} poses; allowed are {MAX_POSES}")
    wanted = np.linspace(0.0, known[-1], int(np.ceil(known[-1] / step)) + 1)
    left = np.clip(np.searchsorted(known, wanted, side="right") - 1, 0, len(known) - 2)
    tau = (wanted - known[left]) / (known[left + 1] - known[left])
    out = dq.sclerp(poses[left], poses[left + 1], tau)
    out[0], out[-1] = path.dqs[0], path.dqs[-1]
    return PosePath(out)


def key_poses(path: PosePath, count: int) -> PosePath:
    """Return poses at equal steps of path length, on the screws between a path's poses; both ends are kept exactly.

    Args:
        path: the path.
        count: number of poses, at least 2; a path that stands still gives 2.

    Raises:
        BadOption: a count below 2.
    """
    if count < 2:
        raise BadOption("count", f"{count} is not a number of poses from 2 on")
    lengths = path.lengths()
    if lengths[-1] <= SAME:
        return PosePath(path.dqs[[0, -1]])
    wanted = np.linspace(0.0, lengths[-1], count)
    left = np.clip(np.searchsorted(lengths, wanted, side="right") - 1, 0, len(path) - 2)
    tau = (wanted - lengths[left]) / (lengths[left + 1] - lengths[left])
    poses = dq.sclerp(path.dqs[left], path.dqs[left + 1], np.clip(tau, 0.0, 1.0))
    poses[0], poses[-1] = path.dqs[0], path.dqs[-1]
    return PosePath(poses)


def trimmed(path: PosePath, radius: float) -> PosePath:
    """Cut a path at its first entry into a ball about its last position, then append its last pose.

    Removes human artifacts at the very end: lowering too far, shifting, rising. Only positions count: the
    orientation may settle later.

    Args:
        path: the path.
        radius: of the ball [m].
    """
    positions = path.positions
    inside = np.linalg.norm(positions - positions[-1], axis=1) <= radius
    first = int(np.argmax(inside))
    return path[: first + 1].joined(path[len(path) - 1 :])
