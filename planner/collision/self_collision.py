"""Pairs of an arm's own capsules that may hit each other; compiled, since held objects change during a motion."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from ..geometry.shapes import pack
from ..jit import kernel
from ..robot.arm import Arm
from ..robot.body import BODY, Body
from ..robot.resting_pairs import resting_pairs
from .capsule_placement import place_capsules
from .clearance import capsule_distance
from .robot_arrays import ROW, robot_arrays

_NOTHING = pack(())


@kernel
def _gaps(g, q, out):
    """Write the distances [m] of all capsules at joints q into `out` (n, n), above the diagonal."""
    place_capsules(g, q, ROW.placed)
    for i in range(len(out)):
        for j in range(i + 1, len(out)):
            out[i, j] = capsule_distance(g, ROW.placed, i, j)


def body_pairs(arm: Arm, body: Body, margin: float) -> list[tuple[int, int]]:
    """Return the pairs (i, j), i < j, of an arm's own capsules that may hit each other.

    Those of the body, if they are known. Else excluded are pairs in the same or in neighboring frames, which always
    touch, and pairs closer than the margin with every joint in the middle of its range (at zero if it has none): there
    the capsules are close, not the real links.

    Args:
        arm: the arm.
        body: its capsules.
        margin: distance [m].
    """
    if body.pairs is not None:
        return list(body.pairs)
    limited = np.isfinite(arm.lower) & np.isfinite(arm.upper)
    middle = np.where(limited, 0.5 * (np.where(limited, arm.lower, 0.0) + np.where(limited, arm.upper, 0.0)), 0.0)
    gaps, frames = np.zeros((len(body), len(body))), body.rows[:, BODY.frame]
    _gaps(robot_arrays((arm,), (body,), _NOTHING), middle, gaps)
    apart = np.triu((np.abs(frames[:, None] - frames[None]) > 1) & (gaps > margin), 1)
    return [(int(i), int(j)) for i, j in np.argwhere(apart)]


def pairs_of(arms: Sequence, bodies: Sequence[Body], *, apart: int = 2) -> list[tuple[int, int]]:
    """Return the pairs of capsules, counted through all bodies, that may hit each other.

    Between two arms these are all pairs. Within one arm, pairs that always touch are excluded.

    Args:
        arms: the arms.
        bodies: their bodies, in the same order.
        apart: within one arm, only pairs at least this many joints apart are checked.
    """
    pairs, first = [], 0
    starts = np.concatenate([[0], np.cumsum([len(body) for body in bodies])])
    for arm, body in zip(arms, bodies, strict=True):
        resting = {tuple(sorted(pair)) for pair in resting_pairs(arm, body)} if body.pairs is None else set()
        frames = body.rows[:, BODY.frame]
        all_pairs = combinations(range(len(body)), 2) if body.pairs is None else body.pairs
        own = [(i, j) for i, j in all_pairs if abs(frames[i] - frames[j]) >= apart and (i, j) not in resting]
        pairs += [(first + i, first + j) for i, j in own]
        first += len(body)
    if len(bodies) == 2:
        pairs += [(i, j) for i in range(starts[1]) for j in range(int(starts[1]), int(starts[2]))]
    return pairs
