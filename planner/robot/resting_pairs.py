"""Pairs of an arm's own capsules that rest against each other, so that self-collision checks must skip them."""

from __future__ import annotations

import numpy as np

from ..geometry.pose import Pose
from .arm import Arm
from .body import BODY, Body
from .joint_frames import joint_frames, moved


def resting_pairs(arm: Arm, body: Body, distance: float = 0.0) -> list[tuple[int, int]]:
    """Return the pairs (i, j), i < j, of an arm's own capsules that self-collision checks must skip.

    Such capsules are in the same or in neighboring frames, where they always touch, or they are close with every joint
    in the middle of its range (at zero if it has none): there the real links are apart, so only the capsules touch.

    Args:
        arm: the arm.
        body: its capsules.
        distance: largest distance [m] of two capsules that counts as close.
    """
    free = ~(np.isfinite(arm.lower) & np.isfinite(arm.upper))
    middle = np.where(free, 0.0, 0.5 * (np.where(free, 0.0, arm.lower) + np.where(free, 0.0, arm.upper)))
    poses = [Pose.identity(), *joint_frames(arm, middle)]
    placed = [(poses[int(row[BODY.frame]) + 1], row) for row in body.rows]
    ends = [[moved(pose, row[first : first + 3]) for first in (BODY.a, BODY.b)] for pose, row in placed]
    pairs = []
    for i in range(len(body)):
        for j in range(i + 1, len(body)):
            gap = segment_distance(*ends[i], *ends[j]) - body.rows[i, BODY.radius] - body.rows[j, BODY.radius]
            if abs(body.rows[i, BODY.frame] - body.rows[j, BODY.frame]) <= 1 or gap <= distance:
                pairs.append((i, j))
    return pairs


def segment_distance(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> float:
    """Return the distance [m] of two segments.

    Args:
        a: (3,) start of the first segment [m].
        b: (3,) its end.
        c: (3,) start of the second segment [m].
        d: (3,) its end.
    """

    def to_segment(point: np.ndarray, start: np.ndarray, end: np.ndarray) -> float:
        along = end - start
        share = np.clip((point - start) @ along / max(along @ along, 1e-300), 0.0, 1.0)
        return float(np.linalg.norm(start + share * along - point))

    u, v, w = b - a, d - c, a - c
    least = min(to_segment(a, c, d), to_segment(b, c, d), to_segment(c, a, b), to_segment(d, a, b))
    determinant = (u @ u) * (v @ v) - (u @ v) ** 2
    if determinant > 1e-12 * (u @ u) * (v @ v):
        s = ((u @ v) * (v @ w) - (v @ v) * (u @ w)) / determinant
        t = ((u @ u) * (v @ w) - (u @ v) * (u @ w)) / determinant
        if 0.0 < s < 1.0 and 0.0 < t < 1.0:
            least = min(least, float(np.linalg.norm(w + s * u - t * v)))
    return least
