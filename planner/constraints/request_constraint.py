"""The constraint of one request: found in its demonstrated path, and fitted to its start and goal."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from ..geometry import dualquat as dq
from ..geometry.pose import Pose, PosePath
from ..imitation.constraint import Constraint, ConstraintSettings, rotated
from ..imitation.kept_components import found_constraint

ROOM = 1.05
"""Factor by which a bound exceeds what start and goal ask for."""
REMEMBERED = 64
"""Number of paths whose constraints are remembered: a motion is planned to many goals."""


@lru_cache(REMEMBERED)
def _found(poses: bytes, settings: ConstraintSettings) -> Constraint:
    return found_constraint(PosePath(np.frombuffer(poses).reshape(-1, 8)), settings)


def remembered_constraint(path: PosePath, settings: ConstraintSettings) -> Constraint:
    """Return the constraint found in a path, see `found_constraint`.

    Args:
        path: the path.
        settings: tolerances.
    """
    return _found(path.dqs.tobytes(), settings)


def fitted(constraint: Constraint, imitated: PosePath, start: Pose) -> Constraint:
    """Return a constraint with bounds that start and goal of a request do not violate by themselves.

    A goal that is tilted against the demonstration tilts the whole imitated path, and a start may be tilted: no motion
    could keep what they do not.

    Args:
        constraint: of the demonstrated path.
        imitated: that path at its goal.
        start: pose of the tcp at the start.
    """
    if constraint.guided == 0:
        point = start.rotation @ constraint.point + start.position
        there = imitated[:1].positions + rotated(imitated[:1], constraint.point)
        distance, angle = float(np.linalg.norm(point - there)), float(dq.pose_distance(start.dq, imitated.dqs[0])[1])
        # from farther away the object comes freely; a little off, it is where it should be already
        if distance <= 3.0 * constraint.position_bound and angle <= 3.0 * constraint.rotation_bound:
            return replace(
                constraint,
                position_bound=max(constraint.position_bound, ROOM * distance),
                rotation_bound=max(constraint.rotation_bound, ROOM * angle),
            )
    carried = PosePath(np.vstack([start.dq, imitated.dqs[: constraint.last_carried + 1]]))
    return replace(constraint, bound=max(constraint.bound, ROOM * float(constraint.deviations(carried).max())))
