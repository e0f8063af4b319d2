"""Start layouts of stacking: levels as data, seeded layouts as pure functions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...planner.errors import BadOption
from ..scene.robots import WHOLE_TABLE, Reach

BASE_PLACE = (0.10, 0.0)
"""Nominal position x, y [m] of the stack on the table."""
SPACING, ROW_X = 0.22, (-0.08, -0.22)
"""Distance of blocks in a row, and x of the first and second row [m]; three blocks fill a row."""
BLOCK_GAP, BASE_GAP = 0.12, 0.17
"""Least distance of block centers to each other and to the base place [m]."""
TABLE_EDGE = 0.36
"""Largest |x| and |y| of a block's center on the table [m]."""
LONG_GAP = 0.30
"""Least distance of blocks to the base place with obstacles [m]: a shorter path leaves no clearance for one."""
MAX_TRIES = 20_000


@dataclass(frozen=True, slots=True)
class StackRanges:
    """Largest deviations of a layout from the nominal one.

    Attributes:
        block: largest shift of a block in x and in y [m].
        base: largest shift of the base place in x and in y [m].
        yaw: largest turn of blocks and base place [rad].
        joints: largest change of a start joint [rad].
    """

    block: float
    base: float
    yaw: float
    joints: float


RANGES = {
    "L0": StackRanges(0.0, 0.0, 0.0, 0.0),
    "L1": StackRanges(0.10, 0.05, np.deg2rad(30.0), 0.05),
    "L2": StackRanges(0.20, 0.10, np.deg2rad(120.0), 0.15),
}
"""Ranges by layout name, see `levels`."""


@dataclass(frozen=True, slots=True)
class StackLayout:
    """Layout of a start.

    Attributes:
        blocks: (n, 3) x, y [m] and yaw [rad] of the blocks.
        base: (3,) x, y [m] and yaw [rad] of the base place.
        joints: (n_arms, dof) offsets from the home joints [rad].
    """

    blocks: np.ndarray
    base: np.ndarray
    joints: np.ndarray


def nominal_blocks(count: int) -> np.ndarray:
    """Return the positions (count, 2) [m] of the blocks at level L0."""
    order = (-1.0, 0.0, 1.0)
    return np.array([[ROW_X[k // 3], SPACING * order[k % 3]] for k in range(count)])


def stack_layout(
    rng: np.random.Generator,
    ranges: StackRanges,
    count: int,
    arm_axis: np.ndarray,
    joints: tuple[int, ...],
    base_gap: float = BASE_GAP,
    reach: Reach = WHOLE_TABLE,
) -> StackLayout:
    """Draw a layout of blocks and base place by rejection, independent of any method.

    Args:
        rng: source of randomness.
        ranges: largest deviations from the nominal layout.
        count: number of blocks.
        arm_axis: (2,) x, y of the arm's base axis [m].
        joints: shape (n_arms, dof) of the start joints.
        base_gap: least distance of the blocks to the base place [m].
        reach: least and largest distance of the blocks, and largest of the base place, from the arm's axis [m].

    Raises:
        BadOption: no layout was found in `MAX_TRIES` tries.
    """
    offsets = rng.uniform(-ranges.joints, ranges.joints, joints)
    nominal = nominal_blocks(count)
    for _ in range(MAX_TRIES):
        places = nominal + rng.uniform(-ranges.block, ranges.block, (count, 2))
        base = np.array(BASE_PLACE) + rng.uniform(-ranges.base, ranges.base, 2)
        if fits(places, base, arm_axis, base_gap, reach):
            yaws = rng.uniform(-ranges.yaw, ranges.yaw, count + 1)
            blocks = np.column_stack([places, yaws[:count]])
            return StackLayout(blocks, np.append(base, yaws[count]), offsets)
    within = f"{reach.nearest:.2f} to {reach.farthest:.2f} m from the arm's axis"
    raise BadOption("n_blocks", f"{count} blocks do not fit on the table at this level, {within}")


def fits(
    places: np.ndarray,
    base: np.ndarray,
    arm_axis: np.ndarray,
    base_gap: float = BASE_GAP,
    reach: Reach = WHOLE_TABLE,
) -> bool:
    """Return whether blocks keep their distances to each other, to the base place and to the arm's axis.

    Args:
        places: (n, 2) positions of the blocks [m].
        base: (2,) position of the base place [m].
        arm_axis: (2,) x, y of the arm's base axis [m].
        base_gap: least distance of the blocks to the base place [m].
        reach: least and largest distance of the blocks, and largest of the base place, from the arm's axis [m].
    """
    away = np.linalg.norm(places - arm_axis, axis=1)
    between = np.linalg.norm(places[:, None] - places[None], axis=-1)[np.triu_indices(len(places), 1)]
    return bool(
        (away >= reach.nearest).all()
        and (away <= reach.farthest).all()
        and np.linalg.norm(base - arm_axis) <= reach.stack
        and (np.abs(places) <= TABLE_EDGE).all()
        and (between >= BLOCK_GAP).all()
        and (np.linalg.norm(places - base, axis=1) >= base_gap).all()
    )
