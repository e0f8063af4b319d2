"""A demonstration of a few key poses: what is left of it, and how the way between them is read.

Between two key poses nobody knows what was shown. A method that interpolates along screws reads screws, one that
moves position and orientation apart reads straight lines with slerp: what it would have done itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..planner.geometry.pose import Pose, PosePath
from ..planner.imitation.demonstration import Demonstration
from ..planner.imitation.segmentation import key_poses, resampled

DENSE = 0.005
"""Screw length [m] between the poses that are read between key poses, and between those that these are chosen from."""
Join = Callable[[Pose, Pose, float], PosePath]
"""Poses from one to another, both included, at most a screw length [m] apart."""


def filled(keys: PosePath, join: Join) -> PosePath:
    """Key poses with the way between them."""
    out = keys[:1]
    for k in range(len(keys) - 1):
        out = out.joined(join(keys[k], keys[k + 1], DENSE))
    return out


def sparse(shown: Demonstration, count: int, join: Join | None = None) -> Demonstration:
    """A demonstration of which every segment is so many key poses; what is between the segments stays.

    Joints and gripper are those at the same share of the segment's way, the time goes evenly.

    Args:
        shown: the whole.
        count: key poses of a segment, at equal steps of its screw length, both ends included.
        join: what is read between them; None: nothing, the key poses are all there is.
    """
    whole, pieces, segments, at = _columns(shown), [], [], 0
    length = 0
    for segment in shown.segments:
        keys = key_poses(resampled(shown.segment_path(segment.name), DENSE), count)
        path = keys if join is None else filled(keys, join)
        pieces += [whole[at : segment.start], _following(path, shown.path, whole, segment.start, segment.stop)]
        length += segment.start - at
        segments.append(replace(segment, start=length, stop=length + len(path) - 1))
        length, at = length + len(path), segment.stop + 1
    rows = np.vstack([*pieces, whole[at:]])
    joints = 0 if shown.joint_positions is None else shown.joint_positions.shape[1]
    return replace(
        shown,
        time=rows[:, 0],
        path=PosePath(rows[:, 1:9]),
        joint_positions=rows[:, 9 : 9 + joints] if joints else None,
        gripper=rows[:, 9 + joints] if shown.gripper is not None else None,
        segments=tuple(segments),
    )


def _columns(shown: Demonstration) -> np.ndarray:
    """(n, ...) time, pose (8), and joints and gripper where they were recorded."""
    more = [array for array in (shown.joint_positions, shown.gripper) if array is not None]
    return np.column_stack([shown.time, shown.path.dqs, *more])


def _following(path: PosePath, recorded: PosePath, whole: np.ndarray, start: int, stop: int) -> np.ndarray:
    """Rows (m, ...) of a path that stands for the samples from start to stop."""
    then, now = path.lengths(), recorded[start : stop + 1].lengths()
    share = then / then[-1] if then[-1] > 0.0 else np.linspace(0.0, 1.0, len(then))
    rest = [np.interp(share * now[-1], now, column) for column in whole[start : stop + 1, 9:].T]
    return np.column_stack([np.linspace(whole[start, 0], whole[stop, 0], len(path)), path.dqs, *rest])
