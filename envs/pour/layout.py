"""Start layouts of pouring: levels as data, seeded, independent of any method."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...planner.errors import BadOption, told_apart
from ..core.reset_options import checked_array
from ..scene.scene_objects import TABLE_HEIGHT

LOWEST, HIGHEST = 0.10, 0.40
"""Range of the stands' heights above the table [m]."""
GAP, LONG_GAP = 0.20, 0.30
"""Least distance of the glasses' axes [m]: for a hand between the glasses; for a hand beside an obstacle."""
CLOSEST = 0.11
"""Least distance of the axes of two stands that do not overlap [m]."""
NEAREST, FARTHEST = 0.35, 0.72
"""Range of a glass's distance from the arm's base axis [m]: an arm reaches it with a level hand."""
TABLE_EDGE = 0.35
"""Largest |x| and |y| of a glass's axis on the table [m]."""
MAX_TRIES = 2000


@dataclass(frozen=True, slots=True)
class PourRanges:
    """Largest deviations of a start from the nominal one.

    Attributes:
        source: largest shift of the source in x and in y [m].
        target: largest shift of the target in x and in y [m].
        height: range of the change of a stand's height [m].
        joints: largest change of a start joint [rad].
    """

    source: float
    target: float
    height: tuple[float, float]
    joints: float


RANGES = {
    "L0": PourRanges(0.0, 0.0, (0.0, 0.0), 0.0),
    "L1": PourRanges(0.05, 0.10, (0.0, 0.0), 0.05),
    "L2": PourRanges(0.15, 0.20, (-0.05, 0.15), 0.15),
}
"""Ranges by layout name, see `levels`. No yaw is drawn: a round glass has none."""


def pour_layout(
    rng: np.random.Generator,
    ranges: PourRanges,
    nominal: np.ndarray,
    arm_axis: np.ndarray,
    gap: float,
) -> np.ndarray:
    """Draw the tops (2, 3) of the stands [m] by rejection, independent of any method.

    Args:
        rng: source of randomness.
        ranges: largest deviations from the nominal tops.
        nominal: (2, 3) nominal tops [m].
        arm_axis: (2,) x, y of the arm's base axis [m].
        gap: least distance of the glasses' axes [m].

    Raises:
        BadOption: no layout was found in `MAX_TRIES` tries.
    """
    reach = np.array([[ranges.source], [ranges.target]])
    for _ in range(MAX_TRIES):
        tops = np.array(nominal)
        tops[:, :2] += rng.uniform(-reach, reach, (2, 2))
        tops[:, 2] += rng.uniform(*ranges.height, 2)
        if fits(tops, arm_axis, gap):
            return tops
    raise BadOption("stands", "near the nominal places there is none where both glasses can stand")


def fits(tops: np.ndarray, arm_axis: np.ndarray, gap: float) -> bool:
    """Return whether stands keep their distances to each other, to the table's edge and to the arm's axis.

    Args:
        tops: (2, 3) tops of the stands [m].
        arm_axis: (2,) x, y of the arm's base axis [m].
        gap: least distance of the glasses' axes [m].
    """
    reach = np.linalg.norm(tops[:, :2] - arm_axis, axis=1)
    return bool(
        (reach >= NEAREST).all()
        and (reach <= FARTHEST).all()
        and (np.abs(tops[:, :2]) <= TABLE_EDGE).all()
        and np.linalg.norm(tops[0, :2] - tops[1, :2]) >= gap
    )


def checked_stands(value: Any, arm_axis: np.ndarray) -> np.ndarray:
    """Return given tops (2, 3) of the stands [m] after checking them.

    Args:
        value: tops (2, 3) [m], source first.
        arm_axis: (2,) x, y of the arm's base axis [m].

    Raises:
        BadOption: the value has another shape, or a stand is off the table, overlaps the other or is out of reach.
    """
    tops = checked_array("stands", value, (2, 3))
    for name, top in zip(("source", "target"), tops, strict=True):
        place = f"that of the {name} at {np.round(top, 3).tolist()}"
        if np.abs(top[:2]).max() > TABLE_EDGE:
            raise BadOption("stands", f"{place} is not on the table, |x| and |y| <= {TABLE_EDGE}")
        if not LOWEST - 1e-9 <= top[2] - TABLE_HEIGHT <= HIGHEST + 1e-9:
            low, high = TABLE_HEIGHT + LOWEST, TABLE_HEIGHT + HIGHEST
            raise BadOption("stands", f"{place} is not {low:g} to {high:g} m high")
        reach = float(np.linalg.norm(top[:2] - arm_axis))
        if not NEAREST <= reach <= FARTHEST:
            found, _ = told_apart(reach, NEAREST if reach < NEAREST else FARTHEST, 2)
            limits = f"{NEAREST} to {FARTHEST} m"
            raise BadOption("stands", f"{place} is {found} m from the arm's base axis; {limits} is in reach")
    apart = float(np.linalg.norm(tops[0, :2] - tops[1, :2]))
    if apart < CLOSEST:
        found, least = told_apart(apart, CLOSEST, 2)
        raise BadOption("stands", f"they are {found} m apart, inside each other; at least {least} m is needed")
    return tops
