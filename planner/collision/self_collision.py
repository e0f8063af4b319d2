"""Which capsules of one arm may hit each other; compiled, since what is held changes in the middle of a motion."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from ..geometry.shapes import pack
from ..jit import kernel
from ..robot.arm import Arm
from ..robot.body import FRAME, Body
from ..robot.body_readers import resting_pairs
from .clearance import capsule_distance
from .robot_arrays import WORLD, place_capsules, robot_arrays

_NOTHING = pack(())


@kernel
def _gaps(g, q, out):
    """Distances [m] of all capsules (n, n) at joints q, above the diagonal."""
    place_capsules(g, q, WORLD)
    for i in range(len(out)):
        for j in range(i + 1, len(out)):
            out[i, j] = capsule_distance(g, WORLD, i, j)


def body_pairs(arm: Arm, body: Body, margin: float) -> list[tuple[int, int]]:
    """Pairs (i, j), i < j, of an arm's own capsules that may hit each other.

    Not those in the same or in neighboring frames, which always touch, and not those that are closer than `margin` [m]
    with every joint in the middle of its range (at zero if it has none), where real links are not: only the capsules
    are.
    """
    limited = np.isfinite(arm.lower) & np.isfinite(arm.upper)
    middle = np.where(limited, 0.5 * (np.where(limited, arm.lower, 0.0) + np.where(limited, arm.upper, 0.0)), 0.0)
    gaps, frames = np.zeros((len(body), len(body))), body.rows[:, FRAME]
    _gaps(robot_arrays((arm,), (body,), _NOTHING), middle, gaps)
    apart = np.triu((np.abs(frames[:, None] - frames[None]) > 1) & (gaps > margin), 1)
    return [(int(i), int(j)) for i, j in np.argwhere(apart)]


def pairs_of(arms: Sequence, bodies: Sequence[Body], *, apart: int = 2) -> list[tuple[int, int]]:
    """Capsules, counted through all bodies, that may hit each other: of two arms all, of one arm some.

    Args:
        arms: the arms.
        bodies: theirs.
        apart: of one arm only capsules are looked at that so many joints are between, and that do not always touch.
    """
    pairs, first = [], 0
    starts = np.concatenate([[0], np.cumsum([len(body) for body in bodies])])
    for arm, body in zip(arms, bodies, strict=True):
        resting = {tuple(sorted(pair)) for pair in resting_pairs(arm, body)}
        frames, all_pairs = body.rows[:, FRAME], combinations(range(len(body)), 2)
        own = [(i, j) for i, j in all_pairs if abs(frames[i] - frames[j]) >= apart and (i, j) not in resting]
        pairs += [(first + i, first + j) for i, j in own]
        first += len(body)
    if len(bodies) == 2:
        pairs += [(i, j) for i in range(starts[1]) for j in range(int(starts[1]), int(starts[2]))]
    return pairs
