"""What is near a tool: for policies that push away from obstacles where they are, instead of planning round them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..planner.arm import Arm
from ..planner.body import Body
from ..planner.clearance import GAP, KEEP, NORMAL, OTHER, find_near
from ..planner.edges import tool_work
from ..planner.pose import Pose
from ..planner.robot_work import FRAMES, HEADER, N_NEAR, NEAR, WORLD, place_frames
from ..planner.safety import contact_masks
from ..planner.shapes import Obstacle, pack

KNOWN_REACH = 0.01
"""Distance [m] at which what belongs to the task (an obstacle with a margin of its own) begins to push."""


class NearTool:
    """A tool among obstacles, asked where it is close to which.

    Args:
        tool: (m, 7) capsules that move with the tcp, see `Body.tool`.
        obstacles: where they are now. One with a margin of its own belongs to the task.
        masks: per obstacle the capsules of the tool that may touch it, as bits of a number.
    """

    def __init__(self, tool: np.ndarray, obstacles: Sequence[Obstacle], masks: Sequence[int] = ()):
        self._work = tool_work(tool, pack(obstacles), masks=masks)
        self.empty = not obstacles

    @staticmethod
    def of(arm: Arm, body: Body, obstacles: Sequence[Obstacle], allowed: Sequence[tuple[str, str]]) -> NearTool:
        """The tool of an arm's body, with the contacts that are wanted."""
        at_tool = np.flatnonzero(body.rows[:, 0] == arm.dof - 1)
        masks = [
            sum(1 << k for k, row in enumerate(at_tool) if mask >> int(row) & 1)
            for mask in contact_masks(body.names, obstacles, allowed)
        ]
        return NearTool(body.tool(arm), obstacles, masks)

    def at(self, pose: Pose, reach: float) -> np.ndarray:
        """Nearest pair per obstacle within reach [m]: (n, 5) room [m], reach of that obstacle [m], unit normal (3).

        The normal points from the obstacle to the tool. Room is distance less the obstacle's own margin.
        """
        if self.empty:
            return np.empty((0, 5))
        work = self._work
        work[FRAMES, 3:6], work[FRAMES, 6:10] = pose.position, pose.dq[:4]
        place_frames(work, WORLD)
        find_near(work, reach)
        first = int(work[HEADER, NEAR])
        near = work[first : first + int(work[HEADER, N_NEAR])]
        near = near[np.argsort(near[:, GAP], kind="stable")]
        near = near[np.unique(near[:, OTHER], return_index=True)[1]]
        known = near[:, KEEP] > 0.0
        room, within = near[:, GAP] - near[:, KEEP], np.where(known, min(KNOWN_REACH, reach), reach)
        rows = np.column_stack([room, within, near[:, NORMAL : NORMAL + 3]])
        return rows[room < within]
