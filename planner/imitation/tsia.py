"""Task-space imitation (TSIA): one demonstrated path carried to a new start and a new goal.

The imitated path is the demonstration moved rigidly so that it ends at the goal; the final path blends from
the start to a guiding pose on it along one screw, and then is the imitated path. Paper: section III.
"""

from __future__ import annotations

import math

import numpy as np

from ..errors import BadOption
from ..geometry import dualquat as dq
from ..geometry.pose import METERS_PER_RADIAN, Pose, PosePath

STILL = 1e-9
"""A path whose screw length [m] is not above this stands still: what there is of it is rounding."""
BLEND_STEP, LEAST_STEP = 0.005, 1e-5
"""Screw length [m] between the poses of a blend into a path that stands still, and the least into any other."""
GUIDE_START = 0.2
"""Fraction of the imitated path where blending ends; the value of the paper's experiments."""


def transfer_to(demonstrated: PosePath, goal: Pose) -> Pose:
    """The displacement `g = x_f d_n*` that carries the demonstrated path to the goal."""
    return goal @ demonstrated[-1].inverse()


def imitated_path(demonstrated: PosePath, goal: Pose) -> PosePath:
    """The demonstrated path moved rigidly so that it ends at the goal; every relative motion is kept.

    Constraints in frames of the goal object are kept; constraints against gravity are kept if and only if
    the tilt of `transfer_to(...)` is zero. Paper: eq. (5) and (6), which are this one product.
    """
    moved = demonstrated.moved(transfer_to(demonstrated, goal))
    # the product of d_n with its own inverse is 1 only up to rounding
    sign = 1.0 if moved.dqs[-1, :4] @ goal.dq[:4] >= 0 else -1.0
    return PosePath(np.concatenate([moved.dqs[:-1], sign * goal.dq[None]]))


def guide_index(path: PosePath, fraction: float = GUIDE_START, *, by: str = "length") -> int:
    """Index of the guiding pose, at which blending into the path ends.

    Args:
        path: the imitated path.
        fraction: in [0, 1] of the path from its start.
        by: "length" (screw length: left-invariant) or "index" (invariant to both world and tool changes).

    Paper: "20 % to 70 % of the length" without saying of which metric, nor from which end.
    """
    if not 0.0 <= fraction <= 1.0:
        raise BadOption("fraction", f"{fraction} is not in [0, 1]")
    last = len(path) - 1
    if by == "index":
        index = math.ceil(fraction * last)
    elif by == "length":
        lengths = path.lengths()
        index = int(np.argmax(lengths >= fraction * lengths[-1])) if lengths[-1] > STILL else last
    else:
        raise BadOption("by", f"{by!r} is not one of length, index")
    return min(max(index, 1), last)


def screw_path(start: Pose, end: Pose, step: float) -> PosePath:
    """Poses along the screw from start to end, both included, at most `step` [m] of screw length apart."""
    twist = dq.twist_from_dq(dq.mul(dq.conj(start.dq), end.dq))
    length = math.hypot(np.linalg.norm(twist[:3]), METERS_PER_RADIAN * np.linalg.norm(twist[3:]))
    tau = np.linspace(0.0, 1.0, max(1, math.ceil(length / step)) + 1)
    poses = dq.sclerp(start.dq, end.dq, tau)
    poses[0], poses[-1] = start.dq, end.dq
    return PosePath(poses)


def final_path(start: Pose, imitated: PosePath, guide: int) -> PosePath:
    """One screw from the start to the guiding pose, then the imitated path: begins and ends exactly.

    Args:
        start: where the tcp is.
        imitated: the imitated path.
        guide: index of the guiding pose in it.
    """
    length = imitated.lengths()[-1]
    step = max(length / (len(imitated) - 1), LEAST_STEP) if length > STILL else BLEND_STEP
    blend = screw_path(start, imitated[guide], step)
    tail = imitated[guide:]
    return PosePath(np.concatenate([blend.dqs[:-1], tail.dqs]))


def departure(demonstrated: PosePath, start: Pose, length: float) -> PosePath:
    """How the demonstration leaves its beginning, done from the start: `x_0 d_1* d_j`.

    Args:
        demonstrated: the segment whose beginning is imitated; `reversed()` of a segment gives the withdrawal.
        start: where the tcp is.
        length: screw length [m] to keep.

    Not in the paper: goal-anchored imitation forgets the lift and the withdrawal, and drags what it holds.
    """
    count = int(np.searchsorted(demonstrated.lengths(), length, side="right"))
    part = demonstrated[: max(1, count)]
    return part.moved(start @ demonstrated[0].inverse())


def two_sided_path(demonstrated: PosePath, start: Pose, goal: Pose) -> PosePath:
    """Imitation anchored at both ends: the beginning as shown from the start, the end as shown to the goal.

    Meets both ends and is the demonstration itself where the start fits the goal. The weight between the
    two is a smooth step over the screw length. Not in the paper.
    """
    from_start = demonstrated.moved(start @ demonstrated[0].inverse())
    to_goal = imitated_path(demonstrated, goal)
    lengths = demonstrated.lengths()
    s = lengths / lengths[-1] if lengths[-1] > STILL else np.linspace(0.0, 1.0, len(demonstrated))
    # one way round for the whole path: the scalar part between the two is the same at every pose
    sign = 1.0 if dq.mul(dq.conj(from_start.dqs[0]), to_goal.dqs[0])[0] >= 0.0 else -1.0
    return PosePath(dq.sclerp(from_start.dqs, sign * to_goal.dqs, s * s * (3.0 - 2.0 * s), shortest=False))
