"""What is near a tool: for policies that push away from obstacles where they are, instead of planning round them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...planner.collision.clearance import GAP, KEEP, NORMAL, OTHER, find_near
from ...planner.collision.edge_certificates import tool_arrays
from ...planner.collision.robot_arrays import FRAMES, HEADER, N_NEAR, NEAR, WORLD, place_frames
from ...planner.geometry.shapes import Obstacle, pack
from ...planner.robot.arm import Arm
from ...planner.robot.body import Body
from ...planner.safety.safety_layer import contact_masks

KNOWN_REACH = 0.01
"""Distance [m] at which what belongs to the task (an obstacle with a margin of its own) begins to push."""


class NearestObstacle(NamedTuple):
    """The nearest pair of the tool and an obstacle.

    Attributes:
        slack: distance less the obstacle's own margin [m], negative inside.
        reach: room at which that obstacle begins to push [m].
        normal: (3,) unit, from the obstacle to the tool.
        known: the obstacle belongs to the task.
    """

    slack: float
    reach: float
    normal: np.ndarray
    known: bool


class ToolObstacles:
    """A tool among obstacles, asked where it is close to which.

    Args:
        tool: (m, 7) capsules that move with the tcp, see `Body.tool`.
        obstacles: where they are now. One with a margin of its own belongs to the task.
        masks: per obstacle the capsules of the tool that may touch it, as bits of a number.
    """

    def __init__(self, tool: np.ndarray, obstacles: Sequence[Obstacle], masks: Sequence[int] = ()):
        self._work = tool_arrays(tool, pack(obstacles), masks=masks)
        self.empty = not obstacles

    @staticmethod
    def of(arm: Arm, body: Body, obstacles: Sequence[Obstacle], allowed: Sequence[tuple[str, str]]) -> ToolObstacles:
        """The tool of an arm's body, with the contacts that are wanted."""
        at_tool = np.flatnonzero(body.rows[:, 0] == arm.dof - 1)
        masks = [
            sum(1 << k for k, row in enumerate(at_tool) if mask >> int(row) & 1)
            for mask in contact_masks(body.names, obstacles, allowed)
        ]
        return ToolObstacles(body.tool(arm), obstacles, masks)

    def at(self, position: np.ndarray, quaternion: np.ndarray, reach: float) -> list[NearestObstacle]:
        """What is within reach of the tool at a pose of the tcp.

        Args:
            position: (3,) [m].
            quaternion: (4,) wxyz, unit.
            reach: [m].
        """
        if self.empty:
            return []
        work, least = self._work, {}
        work[FRAMES, 3:6], work[FRAMES, 6:10] = position, quaternion
        place_frames(work, WORLD)
        find_near(work, reach)
        first = int(work[HEADER, NEAR])
        for row in work[first : first + int(work[HEADER, N_NEAR])]:
            known = bool(row[KEEP] > 0.0)
            slack, within = row[GAP] - row[KEEP], min(KNOWN_REACH, reach) if known else reach
            if slack < within and (row[OTHER] not in least or slack < least[row[OTHER]].slack):
                least[row[OTHER]] = NearestObstacle(float(slack), within, row[NORMAL : NORMAL + 3].copy(), known)
        return list(least.values())
