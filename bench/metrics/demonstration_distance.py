"""What was done, beside what was shown: lengths of the way, and how far the motion strays from the demonstration's."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ...configs.shipped_files import demonstration_path
from ...planner.geometry.pose import PosePath
from ...planner.imitation.demonstration import Demonstration
from ...planner.imitation.demonstration_files import load_demonstration
from ...planner.imitation.segmentation import resampled, trimmed
from ...planner.judge.deviation import frechet, screw_gaps
from ..task_table import TASKS
from .carry_segments import Carry, tilts
from .trace import Trace

SPACING = 0.004
"""Screw length between the compared poses [m]: less than this tells nothing."""
KEPT = 0.5
"""Share of the demonstrated segment, from its end, that counts: before it an imitation comes from wherever it was."""
FUMBLING = 0.02
"""Distance [m] to the segment's end at which its tail is replaced by a straight way, because people fumble there."""
MOST = 500
"""Poses of a motion that are compared."""


class DemonstrationShape(NamedTuple):
    """What of a demonstration the carries of an episode are compared with.

    Attributes:
        length: of the tcp's way from the grasp to the end of the kept segment [m].
        tail: (k, 4, 4) poses of the kept segment from `KEPT` on, relative to its end.
    """

    length: float
    tail: np.ndarray


@lru_cache(maxsize=16)
def demonstration_named(name: str) -> Demonstration | None:
    """A shipped demonstration or that of a file; None of an empty name."""
    return load_demonstration(demonstration_path(name)) if name else None


@lru_cache(maxsize=16)
def shown(demonstration: Demonstration | None, task: str) -> DemonstrationShape | None:
    """The demonstrated carry of a task; None where the demonstration has none to compare with."""
    compared_segment = TASKS[task].compared_segment
    segments = {} if demonstration is None else {segment.name: segment for segment in demonstration.segments}
    if demonstration is None or compared_segment not in segments:
        return None
    first = min(segment.start for segment in segments.values() if segment.held)
    carried = demonstration.path.positions[first : segments[compared_segment].stop + 1]
    path = resampled(trimmed(demonstration.segment_path(compared_segment), FUMBLING), SPACING)
    start = int(np.searchsorted(path.lengths(), (1.0 - KEPT) * path.lengths()[-1]))
    tail = path[start:].moved(path[-1].inverse())
    return DemonstrationShape(length_of(carried), np.array([pose.matrix for pose in tail]))


def length_of(points: np.ndarray) -> float:
    """Length [m] of the way through points (n, 3)."""
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def turning_of(quaternions: np.ndarray) -> float:
    """Sum of the angles [rad] between unit quaternions (n, 4) that follow each other."""
    a, b = quaternions[:-1], quaternions[1:]
    b = np.where((a * b).sum(axis=1, keepdims=True) < 0.0, -b, b)
    return float((4.0 * np.arctan2(np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1))).sum())


def end_of(trace: Trace, carry: Carry, *, poured: bool) -> int:
    """The tick that a carry leads to: the release, or what tilts a poured glass the most."""
    if not poured:
        return carry.last
    return carry.first + int(np.argmax(tilts(trace.objects[carry.first : carry.last + 1, carry.object])))


def way_ratio(trace: Trace, carry: Carry, end: int, wanted: DemonstrationShape) -> float:
    """Length of the tcp's way from the grasp to the carry's end over the demonstration's."""
    return length_of(trace.tcp[carry.first : end + 1, carry.arm, :3]) / wanted.length


def deviation(trace: Trace, carry: Carry, end: int, wanted: DemonstrationShape) -> float | None:
    """Frechet distance [m] of the carry's end to the demonstration moved rigidly to where the carry ended.

    "Method-aligned": a method that imitates by moving the demonstration rigidly has about zero by construction, so
    this says whether it does what it means to, not whether that is good. Angles count 0.2 m per radian.
    """
    poses = trace.tcp[carry.first : end + 1, carry.arm]
    if len(poses) < 2:
        return None
    path = PosePath.from_vectors(poses)
    length = float(path.lengths()[-1])
    if length < SPACING:
        return None
    executed = np.array([pose.matrix for pose in resampled(path, max(SPACING, length / MOST))])
    return float(frechet(screw_gaps(executed, executed[-1] @ wanted.tail)))
