"""Comparison with the demonstration: path lengths, and deviation of the motion from the demonstrated motion."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ...configs import load_demonstration
from ...envs import facts_of
from ...planner import Demonstration, PosePath
from ...planner.imitation.segmentation import resampled, trimmed
from ...planner.judge.deviation import frechet, screw_gaps
from .carry_segments import Carry, tilts
from .trace import Trace

SPACING = 0.004
"""Path length (weighted) between the compared poses [m]: finer spacing changes nothing."""
KEPT = 0.5
"""Share of the demonstrated segment, from its end, that is compared: before it, an imitated path still leads in from
its own start."""
FUMBLING = 0.02
"""Distance [m] from the segment's end within which its tail is replaced by a straight line, because people fumble
there."""
MOST = 500
"""Largest number of compared poses per motion."""


class DemonstrationShape(NamedTuple):
    """The part of a demonstration that carries are compared with.

    Attributes:
        length: length of the tcp's path from the grasp to the end of the compared segment [m].
        tail: (k, 4, 4) poses of the last `KEPT` of the compared segment, relative to its end.
    """

    length: float
    tail: np.ndarray


@lru_cache(maxsize=16)
def demonstration_named(name: str) -> Demonstration | None:
    """Return a demonstration by shipped name or file path; None for an empty name."""
    return load_demonstration(name) if name else None


@lru_cache(maxsize=16)
def shown(demonstration: Demonstration | None, task: str) -> DemonstrationShape | None:
    """Return the demonstrated carry of a task; None if the demonstration lacks the compared segment.

    Args:
        demonstration: the demonstration; None: no demonstration.
        task: name of the task.
    """
    compared_segment = facts_of(task).compared_segment
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
    """Return the length [m] of the polyline through points (n, 3)."""
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def turning_of(quaternions: np.ndarray) -> float:
    """Return the sum of the angles [rad] between successive unit quaternions (n, 4)."""
    a, b = quaternions[:-1], quaternions[1:]
    b = np.where((a * b).sum(axis=1, keepdims=True) < 0.0, -b, b)
    return float((4.0 * np.arctan2(np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1))).sum())


def end_of(trace: Trace, carry: Carry, *, poured: bool) -> int:
    """Return the tick at which a carry reaches its goal: the release, or the largest tilt of a poured glass.

    Args:
        trace: the episode.
        carry: the carry.
        poured: True if the task pours.
    """
    if not poured:
        return carry.last
    return carry.first + int(np.argmax(tilts(trace.objects[carry.first : carry.last + 1, carry.object])))


def way_ratio(trace: Trace, carry: Carry, end: int, wanted: DemonstrationShape) -> float:
    """Return the length of the tcp's path from the grasp to the carry's end, divided by the demonstration's.

    Args:
        trace: the episode.
        carry: the carry.
        end: tick of the carry's end, see `end_of`.
        wanted: the demonstrated carry.
    """
    return length_of(trace.tcp[carry.first : end + 1, carry.arm, :3]) / wanted.length


def deviation(trace: Trace, carry: Carry, end: int, wanted: DemonstrationShape) -> float | None:
    """Return the Frechet distance [m] of the carry's final part to the demonstration moved rigidly to the carry's end.

    "Method-aligned": for a method that imitates by moving the demonstration rigidly the deviation is about zero by
    construction, so it tells whether the method does what it intends, not whether that is good. Angles count 0.2 m per
    radian.

    Args:
        trace: the episode.
        carry: the carry.
        end: tick of the carry's end, see `end_of`.
        wanted: the demonstrated carry.

    Returns:
        The deviation; None for a motion that is too short.
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
