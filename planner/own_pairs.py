"""Which capsules of one arm may hit each other; compiled, since what is held changes in the middle of a motion."""

from __future__ import annotations

import numpy as np

from .arm import Arm
from .body import FRAME, Body
from .clearance import capsule_distance
from .jit import kernel
from .robot_work import WORLD, place_capsules, robot_work
from .shapes import pack

_NOTHING = pack(())


@kernel
def _gaps(g, q, out):
    """Distances [m] of all capsules (n, n) at joints q, above the diagonal."""
    place_capsules(g, q, WORLD)
    for i in range(len(out)):
        for j in range(i + 1, len(out)):
            out[i, j] = capsule_distance(g, WORLD, i, j)


def body_pairs(arm: Arm, body: Body, keep: float) -> list[tuple[int, int]]:
    """Pairs (i, j), i < j, of an arm's own capsules that may hit each other.

    Not those in the same or in neighboring frames, which always touch, and not those that are closer than `keep` [m]
    with every joint in the middle of its range (at zero if it has none), where real links are not: only the capsules
    are.
    """
    limited = np.isfinite(arm.lower) & np.isfinite(arm.upper)
    middle = np.where(limited, 0.5 * (np.where(limited, arm.lower, 0.0) + np.where(limited, arm.upper, 0.0)), 0.0)
    gaps, frames = np.zeros((len(body), len(body))), body.rows[:, FRAME]
    _gaps(robot_work((arm,), (body,), _NOTHING), middle, gaps)
    apart = np.triu((np.abs(frames[:, None] - frames[None]) > 1) & (gaps > keep), 1)
    return [(int(i), int(j)) for i, j in np.argwhere(apart)]
