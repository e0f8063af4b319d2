"""Rules of stacking, as data: tolerances and wanted contacts."""

from __future__ import annotations

import math

import numpy as np

from ..judge.goal_progress import GoalRules, contacts, goal_row
from ..judge.judge import MEASURE
from ..scene.scene import FINGERS, FIRST_OBJECT, WORLD

BLOCK_SIZE = (0.06, 0.04, 0.05)
BLOCK = 0.04
"""Width of a block between the fingers; blocks whose centers are horizontally nearer than this overlap [m]."""
MAX_OFFSET, MAX_YAW, MAX_HEIGHT = 0.010, np.deg2rad(10.0), 0.005
"""Tolerances of a block at its goal: horizontal distance [m], yaw [rad], height [m]."""
WITHDRAWN = 0.05
"""Distance of the tcp to every block's center from which the hand counts as withdrawn [m]."""
LOST = 0.02
"""Horizontal distance from its goal beyond which a block that was lifted and is at rest was dropped [m]."""


def stack_rules(n: int) -> GoalRules:
    """Return the rules for n blocks.

    Wanted contacts are blocks on the table, a block on the next lower one of the stack, and the fingers on the block
    that is being fetched, is held or was released last.
    """
    blocks = range(FIRST_OBJECT, FIRST_OBJECT + n)
    wanted = [(low, block) for block in blocks for low in (WORLD, FINGERS)]
    wanted += [(block, block + 1) for block in blocks[:-1]]
    limits = {"horizontal": MAX_OFFSET, "yaw": MAX_YAW, "height": MAX_HEIGHT}
    return GoalRules(
        rows=np.array([goal_row(k, math.pi, LOST, **limits) for k in range(n)]),
        stays=np.full((n, 2), math.inf),
        allowed=contacts(n, wanted),
        withdrawn=WITHDRAWN,
        words=("block", "placed"),
        numbers={"position_error": MEASURE.horizontal, "yaw_error": MEASURE.yaw},
    )
