"""Checks of the capsules of a tool and of their masks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np

from ..arrays import check_capacity, checked_array, checked_items
from ..collision.robot_arrays import MAX_CAPSULES
from ..errors import BadOption
from ..ranges import check_count
from ..robot.body import TOOL_CAPSULE


def checked_tool(tool: np.ndarray) -> np.ndarray:
    """Return the capsules of a tool (m, 7) as the kernels take them, see `Body.tool`.

    Raises:
        WrongType, BadShape, NotFinite: not (m, 7) finite numbers.
        BadOption: there are more than fit into the packed array.
    """
    rows = checked_array("tool", tool, (None, TOOL_CAPSULE.width))
    check_capacity("capsules of the tool", len(rows), MAX_CAPSULES)
    return rows


def checked_masks(masks: Sequence[int], capsules: int, obstacles: int) -> Sequence[int]:
    """Return masks of allowed contacts, see `escape_path`.

    Args:
        masks: one per obstacle, or none at all.
        capsules: number of the tool's capsules.
        obstacles: number of obstacles.

    Raises:
        BadOption: another number of masks, or one with more bits than there are capsules.
    """
    masks = cast(Sequence[int], checked_items("masks", masks, object))
    if len(masks) not in (0, obstacles):
        raise BadOption("masks", f"there are {len(masks)} for {obstacles} obstacles")
    for k, mask in enumerate(masks):
        check_count(f"masks[{k}]", mask, f"[0, {2**capsules - 1}]")
    return masks
