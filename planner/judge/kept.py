"""Violation of what a demonstration keeps by a motion, recomputed: Pinocchio's kinematics, and bounds between samples.

Up to a place of its choice the motion carries the object: the vertical, as the hand sees it, must stay near kept
directions. From there on it must follow the end of the demonstrated path in order, within bounds. Not in the paper.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple, Protocol

import numpy as np

from ..log.motion_log import MotionLog
from .deviation import frechet
from .geometry import Kinematics

STEP = 0.01
"""Largest sum of joint changes [rad] between two samples: the vertical turns by no more as the hand sees it."""
SPACING = 0.001
"""Distance [m] between the compared poses of the demonstrated path, a radian counted as 0.2 m."""


class KeptConstraint(Protocol):
    """A constraint: kept directions of the vertical, then a path to follow from an index on, with their bounds."""

    directions: np.ndarray
    bound: float
    guided: int
    point: np.ndarray
    position_bound: float
    rotation_bound: float


class KeptFinding(NamedTuple):
    """The violation of a constraint by a motion, as a share of its bound.

    Attributes:
        sampled: at the samples.
        certified: an upper bound, also between them.
    """

    sampled: float
    certified: float


def kept_finding(log: MotionLog, constraint: KeptConstraint) -> KeptFinding:
    """Return how far a motion violates a constraint of its demonstrated path.

    Args:
        log: the motion, with the path.
        constraint: of the path.
    """
    kinematics = Kinematics(log.arm, log.body)
    parts = np.maximum(np.ceil(np.abs(np.diff(log.joints, axis=0)).sum(axis=1) / STEP), 1).astype(int)
    rows = [
        a + np.arange(n)[:, None] / n * (b - a) for a, b, n in zip(log.joints[:-1], log.joints[1:], parts, strict=True)
    ]
    joints = np.concatenate([*rows, log.joints[-1:]])
    tool = kinematics.moment(np.zeros(len(joints)), joints).tool
    angles = _from_kept(tool, constraint.directions)
    turned = np.abs(np.diff(joints, axis=0)).sum(axis=1).max(initial=0.0)
    shares = angles / constraint.bound
    room = 0.5 * turned / constraint.bound if len(constraint.directions) else 0.0
    guided = _guided(kinematics, log, constraint)
    if not len(guided):
        return KeptFinding(float(shares.max()), float(shares.max() + room))
    gaps, moved = _gaps(tool, guided, constraint)
    sampled = frechet(np.column_stack([np.maximum.accumulate(shares), gaps]))
    certified = frechet(np.column_stack([np.maximum.accumulate(shares + room), gaps + 0.5 * moved]))
    return KeptFinding(sampled, certified)


def _from_kept(tool: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Return the angles (n,) [rad] of the vertical, in the axes of poses (n, 4, 4), from the nearest kept direction."""
    if not len(directions):
        return np.zeros(len(tool))
    seen = tool[:, 2, :3]
    return np.min([np.arccos(np.clip(seen @ each, -1.0, 1.0)) for each in _dense(directions)], axis=0)


def _dense(directions: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the directions, and nine more between each two."""
    yield directions[0]
    for a, b in pairwise(directions):
        for share in np.linspace(0.0, 1.0, 11)[1:]:
            point = a + share * (b - a)
            yield point / np.linalg.norm(point)


def _guided(kinematics: Kinematics, log: MotionLog, constraint: KeptConstraint) -> np.ndarray:
    """Return near poses (m, 4, 4) of the part of the demonstrated path that must be followed."""
    if log.demonstrated is None or constraint.guided >= len(log.demonstrated):
        return np.empty((0, 4, 4))
    path = np.array([pose.matrix for pose in log.demonstrated[constraint.guided :]])
    if len(path) == 1:
        return path
    way = np.linalg.norm(np.diff(path[:, :3, 3], axis=0), axis=1)
    turn = np.linalg.norm(np.diff(path[:, :3, :3].reshape(len(path), 9), axis=0), axis=1)
    counts = np.maximum(np.ceil((way + 0.2 * turn) / SPACING), 1).astype(int)
    return kinematics.interpolated(path, [np.arange(n) / n for n in counts])


def _gaps(tool: np.ndarray, guided: np.ndarray, constraint: KeptConstraint) -> tuple[np.ndarray, float]:
    """Return the gaps (n, m) of two curves as shares of the bounds, and the longest step of either."""
    places = [each[:, :3, 3] + each[:, :3, :3] @ constraint.point for each in (tool, guided)]
    turns = [each[:, :3, :3].reshape(len(each), 9) for each in (tool, guided)]

    def shares(distance: np.ndarray, chord: np.ndarray) -> np.ndarray:
        angle = 2.0 * np.arcsin(np.clip(chord / np.sqrt(8.0), 0.0, 1.0))
        return np.maximum(distance / constraint.position_bound, angle / constraint.rotation_bound)

    def norms(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        square = (a * a).sum(axis=1)[:, None] + (b * b).sum(axis=1) - 2.0 * a @ b.T
        return np.sqrt(np.maximum(square, 0.0))

    steps = [
        shares(*(np.linalg.norm(np.diff(each, axis=0), axis=1) for each in pair)).max(initial=0.0)
        for pair in zip(places, turns, strict=True)
    ]
    return shares(norms(*places), norms(*turns)), float(max(steps))
