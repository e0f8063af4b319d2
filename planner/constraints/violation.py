"""Violation of a constraint by a motion: the pose of the object against what a demonstration keeps, in order.

The motion is cut in two at the place that suits it best. Up to there the object is carried: the vertical stays near
what was shown. From there on it is guided: the object passes the imitated path in order, within the bounds. Both curves
are traversed as in the Frechet distance, so that a guided stretch that is left out counts. Not in the paper.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..geometry import dualquat as dq
from ..geometry.pose import PosePath
from ..imitation.constraint import Constraint, rotated
from ..imitation.segmentation import resampled
from ..jit import kernel

SPACING = 0.002
"""Path length [m] between the compared poses of the imitated path."""
COMPONENTS = ("against gravity", "rotation off the path", "position off the path")
UNITS = ("deg", "deg", "mm")
"""Components that may be violated, and their units in messages."""


class Violation(NamedTuple):
    """The largest violation of a constraint.

    Attributes:
        share: largest deviation as a share of its bound; at most 1 if the constraint is kept.
        angle: largest angle against gravity while the object is carried [rad].
        rotation: largest rotation off the imitated path while it is guided [rad].
        position: largest distance off it [m].
        detail: component that is violated most, its largest deviation and its bound, in words.
    """

    share: float
    angle: float
    rotation: float
    position: float
    detail: str

    @property
    def kept(self) -> bool:
        """True if the constraint is kept."""
        return self.share <= 1.0


NONE_VIOLATED = Violation(0.0, 0.0, 0.0, 0.0, "")


@kernel
def traversal(carried, gaps, reach, back):
    """Find the traversal of two curves whose largest gap is least.

    Args:
        carried: (n,) gaps of the poses of the motion while the object is carried.
        gaps: (n, m) gaps to the poses of the guided path.
        reach: (n, m + 1) least largest gaps up to there, a result; column 0: still carried.
        back: (n, m + 1) where each came from, a result: 0 the pose before, 1 both, 2 the column before.

    Returns:
        The largest gap of the best traversal.
    """
    n, m = gaps.shape
    for i in range(n):
        before = reach[i - 1, 0] if i > 0 else 0.0
        reach[i, 0], back[i, 0] = max(before, carried[i]), 0.0
        for j in range(1, m + 1):
            best, way = reach[i, j - 1] if j > 1 else math.inf, 2.0
            if i > 0 and reach[i - 1, j - 1] <= best:
                best, way = reach[i - 1, j - 1], 1.0
            if i > 0 and reach[i - 1, j] < best:
                best, way = reach[i - 1, j], 0.0
            if i == 0 and j == 1:
                best, way = 0.0, 1.0
            reach[i, j], back[i, j] = max(best, gaps[i, j - 1]), way
    return reach[n - 1, m]


def violation_of(constraint: Constraint | None, imitated: PosePath, motion: PosePath) -> Violation:
    """Return how far a motion violates a constraint, at its poses.

    Args:
        constraint: of the imitated path; None: nothing is kept.
        imitated: the path to imitate, at its goal.
        motion: poses of the motion, in order.
    """
    if constraint is None or constraint.keeps_nothing:
        return NONE_VIOLATED
    angles = constraint.deviations(motion)
    if constraint.guided >= constraint.count:
        return _said(constraint, angles, np.zeros(0), np.zeros(0))
    guided = imitated[constraint.guided :]
    guided = resampled(guided, SPACING) if len(guided) > 1 else guided
    rotation, position = _gaps(constraint, motion, guided)
    shares = np.maximum(rotation / constraint.rotation_bound, position / constraint.position_bound)
    reach, back = np.empty((2, len(motion), len(guided) + 1))
    traversal(angles / constraint.bound, shares, reach, back)
    pairs = _pairs(back)
    columns = pairs[:, 1] > 0
    rows, places = pairs[columns, 0], pairs[columns, 1] - 1
    return _said(constraint, angles[pairs[~columns, 0]], rotation[rows, places], position[rows, places])


def _gaps(constraint: Constraint, motion: PosePath, guided: PosePath) -> tuple[np.ndarray, np.ndarray]:
    """Angles (n, m) [rad] and distances (n, m) [m] of the point that counts, between the poses of two paths."""
    there = [each.positions + rotated(each, constraint.point) for each in (motion, guided)]
    distance = np.linalg.norm(there[0][:, None] - there[1][None], axis=2)
    angle = dq.pose_distance(motion.dqs[:, None], guided.dqs[None])[1]
    return angle, distance


def _pairs(back: np.ndarray) -> np.ndarray:
    """Pairs (k, 2) of pose and column of the best traversal; column 0: carried."""
    i, j = len(back) - 1, back.shape[1] - 1
    found = [(i, j)]
    while i > 0 or j > 1:
        way = back[i, j]
        if j == 0:
            if i == 0:
                break
            i -= 1
        elif way == 2.0:
            j -= 1
        else:
            i, j = i - 1, j - int(way == 1.0)
        found.append((i, j))
    return np.array(found)


def _said(constraint: Constraint, angles: np.ndarray, rotation: np.ndarray, position: np.ndarray) -> Violation:
    """The violation of the largest deviations of each component."""
    largest = [float(each.max(initial=0.0)) for each in (angles, rotation, position)]
    bounds = (constraint.bound, constraint.rotation_bound, constraint.position_bound)
    shares = [value / bound for value, bound in zip(largest, bounds, strict=True)]
    k = int(np.argmax(shares))
    factor = 1e3 if UNITS[k] == "mm" else math.degrees(1.0)
    detail = f"{COMPONENTS[k]} {factor * largest[k]:.1f} {UNITS[k]}, of {factor * bounds[k]:.1f} that keep it"
    return Violation(max(shares), largest[0], largest[1], largest[2], detail)
