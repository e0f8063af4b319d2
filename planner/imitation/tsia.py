"""Task-space imitation (TSIA): one demonstrated path transferred to a new start and a new goal.

The imitated path is the demonstrated path moved rigidly so that it ends at the goal; the final path follows one screw
from the start to a guiding pose on the imitated path, then the imitated path. Paper: section III.
"""

from __future__ import annotations

import math

import numpy as np

from ..arrays import checked_kind
from ..errors import BadOption
from ..geometry import dualquat as dq
from ..geometry.pose import METERS_PER_RADIAN, Pose, PosePath
from ..ranges import check_count, check_range
from .segmentation import MAX_POSES

STILL = 1e-9
"""Path length [m] up to which a path stands still: any motion is rounding."""
BLEND_STEP, LEAST_STEP = 0.005, 1e-5
"""Path length [m] between the poses of a blend into a path that stands still; the minimum for any other path."""
GUIDE_START = 0.2
"""Fraction of the imitated path where blending ends; the value of the paper's experiments."""


def transfer_to(demonstrated: PosePath, goal: Pose) -> Pose:
    """Return the displacement `g = x_f d_n*` that moves the end of the demonstrated path to the goal.

    Args:
        demonstrated: the demonstrated path d.
        goal: pose x_f.
    """
    return goal @ demonstrated[-1].inverse()


def imitated_path(demonstrated: PosePath, goal: Pose) -> PosePath:
    """Move the demonstrated path rigidly so that it ends at the goal; every relative motion is preserved.

    Constraints in frames of the goal object are preserved; constraints against gravity are preserved if and only if
    the tilt of `transfer_to(...)` is zero. Paper: eq. (5) and (6), which are this one product.

    Args:
        demonstrated: the demonstrated path.
        goal: of the last pose, reached exactly.
    """
    checked_kind("goal", goal, Pose)
    moved = checked_kind("demonstrated", demonstrated, PosePath).moved(transfer_to(demonstrated, goal))
    # the product of d_n with its own inverse is 1 only up to rounding
    sign = 1.0 if moved.dqs[-1, :4] @ goal.dq[:4] >= 0 else -1.0
    return PosePath(np.concatenate([moved.dqs[:-1], sign * goal.dq[None]]))


def guide_index(path: PosePath, fraction: float = GUIDE_START, *, by: str = "length") -> int:
    """Return the index of the guiding pose, where blending into the path ends.

    Args:
        path: the imitated path.
        fraction: in [0, 1] of the path from its start.
        by: "length" (path length: left-invariant) or "index" (invariant to both world and tool changes).

    Raises:
        BadOption: a fraction outside [0, 1], or another `by`.

    Paper: "20 % to 70 % of the length" without specifying the metric or the end it is measured from.
    """
    check_range("fraction", fraction, "[0, 1]")
    last = len(checked_kind("path", path, PosePath)) - 1
    if by == "index":
        index = math.ceil(fraction * last)
    elif by == "length":
        lengths = path.lengths()
        index = int(np.argmax(lengths >= fraction * lengths[-1])) if lengths[-1] > STILL else last
    else:
        raise BadOption("by", f"{by!r} is not one of length, index")
    return min(max(index, 1), last)


def imitated_share(imitated: np.ndarray, path: np.ndarray, guide: float) -> float:
    """Return the share of an imitated path behind its guiding pose that another path contains, by path length.

    Poses are compared bit by bit: followed poses are copies. Not in the paper.

    Args:
        imitated: (n, 8) poses of the imitated path.
        path: (m, 8) poses of the other path.
        guide: fraction of the imitated path before the guiding pose.
    """
    if len(imitated) < 2:
        return 1.0
    rows = {row.tobytes() for row in path}
    there = np.array([row.tobytes() in rows for row in imitated])
    whole = PosePath(imitated)
    lengths = whole.lengths()
    wanted = lengths[-1] - lengths[guide_index(whole, guide)]
    return float(np.diff(lengths) @ (there[1:] & there[:-1]) / wanted) if wanted > 0.0 else 1.0


def screw_path(start: Pose, end: Pose, step: float) -> PosePath:
    """Sample the screw from one pose to another, both included.

    Args:
        start: first pose.
        end: last pose.
        step: largest path length [m] between neighbors.

    Raises:
        BadOption: the step is no positive number, or so small that the path would have more than `MAX_POSES`.
    """
    check_range("step", step, "(0, inf]")
    twist = dq.twist_from_dq(dq.mul(dq.conj(start.dq), end.dq))
    length = math.hypot(np.linalg.norm(twist[:3]), METERS_PER_RADIAN * np.linalg.norm(twist[3:]))
    if length / step > MAX_POSES:
        raise BadOption("step", f"{step:g} m would take {length / step:.3g} poses; allowed are {MAX_POSES}")
    tau = np.linspace(0.0, 1.0, max(1, math.ceil(length / step)) + 1)
    poses = dq.sclerp(start.dq, end.dq, tau)
    poses[0], poses[-1] = start.dq, end.dq
    return PosePath(poses)


def final_path(start: Pose, imitated: PosePath, guide: int) -> PosePath:
    """Join one screw from the start to the guiding pose and the imitated path; both ends are exact.

    Args:
        start: present pose of the tcp.
        imitated: the imitated path.
        guide: index of the guiding pose in the imitated path.

    Raises:
        BadOption: there is no such pose.
    """
    checked_kind("start", start, Pose)
    check_count("guide", guide, f"[0, {len(checked_kind('imitated', imitated, PosePath)) - 1}]")
    length = imitated.lengths()[-1]
    step = max(length / (len(imitated) - 1), LEAST_STEP) if length > STILL else BLEND_STEP
    blend = screw_path(start, imitated[guide], step)
    tail = imitated[guide:]
    return PosePath(np.concatenate([blend.dqs[:-1], tail.dqs]))


def departure(demonstrated: PosePath, start: Pose, length: float) -> PosePath:
    """Imitate the beginning of a demonstration from the start: `x_0 d_1* d_j`.

    Args:
        demonstrated: the segment whose beginning is imitated; `reversed()` of a segment gives the withdrawal.
        start: present pose of the tcp.
        length: path length [m] of the beginning; infinite for all of it.

    Raises:
        BadOption: the length is negative or not a number.

    Not in the paper: goal-anchored imitation loses the lift and the withdrawal, and drags the held object.
    """
    check_range("length", length, "[0, inf]")
    count = int(np.searchsorted(demonstrated.lengths(), length, side="right"))
    part = demonstrated[: max(1, count)]
    return part.moved(start @ demonstrated[0].inverse())


def ending(demonstrated: PosePath, length: float) -> PosePath:
    """Return the end of a path.

    Args:
        demonstrated: the path.
        length: path length [m] of the end; infinite for all of it.

    Raises:
        BadOption: the length is negative or not a number.
    """
    check_range("length", length, "[0, inf]")
    lengths = demonstrated.lengths()
    first = int(np.searchsorted(lengths, lengths[-1] - length)) if length < lengths[-1] else 0
    return demonstrated if first == 0 else demonstrated[min(first, len(demonstrated) - 2) :]


def two_sided_path(demonstrated: PosePath, start: Pose, goal: Pose) -> PosePath:
    """Imitate with both ends anchored: the demonstrated beginning from the start, the demonstrated end to the goal.

    Meets both ends and is the demonstration itself where the start fits the goal. The weight between the
    two is a smooth step over the path length. Not in the paper.

    Args:
        demonstrated: the demonstrated path.
        start: first pose of the result.
        goal: last pose of the result.
    """
    from_start = demonstrated.moved(start @ demonstrated[0].inverse())
    to_goal = imitated_path(demonstrated, goal)
    lengths = demonstrated.lengths()
    s = lengths / lengths[-1] if lengths[-1] > STILL else np.linspace(0.0, 1.0, len(demonstrated))
    # one sense of rotation for the whole path: the scalar part between the two is equal at every pose
    sign = 1.0 if dq.mul(dq.conj(from_start.dqs[0]), to_goal.dqs[0])[0] >= 0.0 else -1.0
    return PosePath(dq.sclerp(from_start.dqs, sign * to_goal.dqs, s * s * (3.0 - 2.0 * s), shortest=False))
