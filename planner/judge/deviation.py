"""Deviation of the end of a motion from its demonstrated path.

Not in the paper. The measure is the Frechet distance: both curves are traversed in order, so that another route, an
omitted part or a reversal counts. The start of the compared end is chosen in the motion's favor. Executed
motions are linear in the joints between samples, demonstrated paths screw motions between poses.
"""

from __future__ import annotations

import numpy as np

from ..log.motion_log import MotionLog
from .geometry import Kinematics

METERS_PER_RADIAN = 0.2
"""Lever [m/rad] of the weighted distance; repeated here to be independent of the planner."""
COARSE, FINE = 5e4, 5e5
"""Numbers of compared pairs of points in the first and in the last pass."""
FINEST = 1e-4
"""Smallest spacing [m] of the points; finer spacing changes nothing."""


def deviation_of(kinematics: Kinematics, log: MotionLog) -> tuple[float, float]:
    """Measure the deviation of a log that has a demonstrated path.

    Points on both curves represent the curves; a coarse pass first finds the relevant part of the motion.

    Args:
        kinematics: of the log's arm and body.
        log: the log.

    Returns:
        Deviation [m], and the largest amount [m] by which the true deviation may be smaller.
    """
    assert log.demonstrated is not None
    path = np.array([pose.matrix for pose in log.demonstrated])
    tool = kinematics.moment(log.time, log.joints).tool
    coarse, wanted, spacing = _pass(kinematics, log.joints, tool, path, COARSE)
    away = screw_gaps(tool, wanted).min(axis=1) > coarse + 2.0 * spacing
    start = int(np.flatnonzero(away).max(initial=0))
    fine, _, spacing = _pass(kinematics, log.joints[start:], tool[start:], path, FINE)
    return fine, spacing


def _pass(
    kinematics: Kinematics, joints: np.ndarray, tool: np.ndarray, path: np.ndarray, pairs: float
) -> tuple[float, np.ndarray, float]:
    """Return the deviation [m], the points of the path used for it, and the widest gap between points [m]."""
    displacements = [_steps(tool), _steps(path)]
    spacing = max(
        FINEST, float(np.sqrt(max(displacements[0].sum(), FINEST) * max(displacements[1].sum(), FINEST) / pairs))
    )
    fractions = [
        [np.arange(n) / n for n in np.maximum(np.ceil(displacement / spacing), 1).astype(int)]
        for displacement in displacements
    ]
    dense = [q + s[:, None] * (p - q) for q, p, s in zip(joints[:-1], joints[1:], fractions[0], strict=True)]
    fine = np.concatenate([*dense, joints[-1:]])
    executed = kinematics.moment(np.zeros(len(fine)), fine).tool
    wanted = kinematics.interpolated(path, fractions[1])
    widest = max(float(_steps(curve).max(initial=0.0)) for curve in (executed, wanted))
    return frechet(screw_gaps(executed, wanted)), wanted, widest


def frechet(gaps: np.ndarray) -> float:
    """Return the smallest possible largest gap of traversals, from any row and the first column to the last of both.

    Args:
        gaps: (n, m) distances [m] of the points of one curve to those of the other.
    """
    n, m = gaps.shape
    if m == 1:
        return float(gaps[-1, 0])
    flat = np.ascontiguousarray(gaps).ravel()
    # Diagonals of the table of reachable gaps, each shifted by one row to make room for a row before the first.
    before, last = np.full(n + 1, np.inf), np.full(n + 1, np.inf)
    for diagonal in range(n + m - 1):
        low, high = max(0, diagonal - m + 1), min(n, diagonal + 1)
        here = flat[low * m + diagonal - low :: m - 1][: high - low]
        reach = np.minimum(last[low:high], before[low:high])
        np.minimum(reach, last[low + 1 : high + 1], out=reach)
        if diagonal < n:
            reach[-1] = 0.0
        before, last = last, before
        last[:] = np.inf
        np.maximum(here, reach, out=last[low + 1 : high + 1])
    return float(last[n])


def _vectors(poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return poses[:, :3, 3], poses[:, :3, :3].reshape(len(poses), 9)


def screw_gaps(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the weighted distances (n, m) [m] between poses.

    Args:
        a: (n, 4, 4) homogeneous matrices.
        b: (m, 4, 4) homogeneous matrices.
    """
    (p, r), (q, s) = _vectors(a), _vectors(b)
    square = (p * p).sum(axis=1)[:, None] + (q * q).sum(axis=1) - 2.0 * p @ q.T
    chord = np.maximum(0.125 * (6.0 - 2.0 * r @ s.T), 0.0)
    angle = 2.0 * np.arcsin(np.minimum(np.sqrt(chord), 1.0))
    return np.sqrt(np.maximum(square, 0.0) + (METERS_PER_RADIAN * angle) ** 2)


def _steps(poses: np.ndarray) -> np.ndarray:
    """Return the weighted distances (n - 1,) [m] from pose to pose."""
    p, r = (np.linalg.norm(np.diff(values, axis=0), axis=1) for values in _vectors(poses))
    return np.hypot(p, 2.0 * METERS_PER_RADIAN * np.arcsin(np.minimum(r / np.sqrt(8.0), 1.0)))
