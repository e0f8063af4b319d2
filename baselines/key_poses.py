"""Demonstrations reduced to a few key poses, and the interpolation between these.

The demonstrated motion between two key poses is unknown. A method that interpolates along screws assumes screws, and a
method that moves position and orientation separately assumes straight lines with slerp: each assumes its own motion.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..planner import Demonstration, Pose, PosePath
from ..planner.imitation.segmentation import key_poses, resampled

DENSE = 0.005
"""Weighted path length [m] between interpolated poses, and between the poses from which key poses are chosen."""
Join = Callable[[Pose, Pose, float], PosePath]
"""Interpolation from one pose to another, both included, with poses at most a path length [m] apart."""


def filled(keys: PosePath, join: Join) -> PosePath:
    """Return key poses with interpolated poses between them.

    Args:
        keys: the key poses.
        join: the interpolation.
    """
    out = keys[:1]
    for k in range(len(keys) - 1):
        out = out.joined(join(keys[k], keys[k + 1], DENSE))
    return out


def sparse(shown: Demonstration, count: int, join: Join | None = None) -> Demonstration:
    """Return a demonstration with every segment reduced to key poses; samples between segments stay.

    Joints and gripper are those at the same share of the segment's path length; time is spread evenly. Of objects, only
    where segments end relative to them remains.

    Args:
        shown: the complete demonstration.
        count: key poses per segment, at equal steps of its path length, both ends included.
        join: interpolation between the key poses; None: none, only the key poses remain.
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
        object_paths={},
        other_joints={},
        commanded=None,
    )


def _columns(shown: Demonstration) -> np.ndarray:
    """Return rows (n, ...) of time, pose (8), and joints and gripper if they were recorded."""
    more = [array for array in (shown.joint_positions, shown.gripper) if array is not None]
    return np.column_stack([shown.time, shown.path.dqs, *more])


def _following(path: PosePath, recorded: PosePath, whole: np.ndarray, start: int, stop: int) -> np.ndarray:
    """Return rows (m, ...) for a path that replaces the samples from start to stop."""
    then, now = path.lengths(), recorded[start : stop + 1].lengths()
    share = then / then[-1] if then[-1] > 0.0 else np.linspace(0.0, 1.0, len(then))
    rest = [np.interp(share * now[-1], now, column) for column in whole[start : stop + 1, 9:].T]
    return np.column_stack([np.linspace(whole[start, 0], whole[stop, 0], len(path)), path.dqs, *rest])
