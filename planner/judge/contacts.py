"""Depth of a motion in its allowed contacts, beyond that at its ends.

Not in the paper. A wanted contact, like that of fingers with a block, belongs to an end of a motion; without a bound a
motion with an allowed contact could lead right through the obstacle.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..log.motion_log import MotionLog
from .sweep import Sweep, Sweeper, SweepSettings


def contact_excess(
    log: MotionLog, allowed: np.ndarray, margins: np.ndarray, room: float, settings: SweepSettings
) -> tuple[np.ndarray, Sweep]:
    """Return how much deeper in its allowed contacts a motion is than at its deeper end, and the examination.

    Args:
        log: the motion.
        allowed: (m, k) True for a capsule and an obstacle that may touch.
        margins: (k,) distances [m] to keep from the obstacles otherwise: what is farther is no contact.
        room: excess [m] up to which no more than that need be known.
        settings: accuracy and effort.

    Returns:
        (k,) the excess per obstacle [m], an upper bound between samples too, at least 0; and the sweep.
    """
    if not allowed.any():
        return np.zeros(len(margins)), Sweep(*np.full((3, *allowed.shape), math.inf))
    ends = replace(log, time=log.time[[0, -1]], joints=log.joints[[0, -1]])
    at_ends = Sweeper(ends, np.full(allowed.shape, -math.inf), -math.inf, settings).smallest(allowed)
    floors = np.minimum(margins, at_ends.min(axis=0, initial=math.inf))
    sweep = Sweeper(log, np.where(allowed, floors - room, -math.inf), -math.inf, settings).run()
    deeper = np.where(allowed, floors - sweep.certified, 0.0)
    return deeper.max(axis=0, initial=0.0), sweep
