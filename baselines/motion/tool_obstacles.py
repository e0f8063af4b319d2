"""Obstacles near a tool: for methods that push away from present obstacles instead of planning around them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...planner import Arm, Body, Obstacle
from ...planner.collision.capsule_placement import place_frames
from ...planner.collision.clearance import find_near
from ...planner.collision.edge_certificates import pose_tool, tool_arrays
from ...planner.collision.robot_arrays import HEADER, NEAR_PAIR, ROW
from ...planner.geometry.shapes import pack
from ...planner.robot.body import BODY
from ...planner.safety.robot_checks import contact_masks

KNOWN_REACH = 0.01
"""Distance [m] at which an obstacle that belongs to the task (one with its own margin) begins to push."""


class NearestObstacle(NamedTuple):
    """The nearest pair of the tool and an obstacle.

    Attributes:
        slack: distance minus the obstacle's own margin [m], negative inside.
        reach: slack at which that obstacle begins to push [m].
        normal: (3,) unit, from the obstacle to the tool.
        known: True: the obstacle belongs to the task.
    """

    slack: float
    reach: float
    normal: np.ndarray
    known: bool


class ToolObstacles:
    """A tool among obstacles, for proximity queries.

    Args:
        tool: (m, 7) capsules that move with the tcp, see `Body.tool`.
        obstacles: at present. An obstacle with its own margin belongs to the task.
        masks: per obstacle the capsules of the tool that may touch it, as bits of a number.
    """

    def __init__(self, tool: np.ndarray, obstacles: Sequence[Obstacle], masks: Sequence[int] = ()):
        self._work = tool_arrays(tool, pack(obstacles), masks=masks)
        self.empty = not obstacles

    @staticmethod
    def of(arm: Arm, body: Body, obstacles: Sequence[Obstacle], allowed: Sequence[tuple[str, str]]) -> ToolObstacles:
        """Take the tool from an arm's body, with its allowed contacts.

        Args:
            arm: the arm.
            body: its capsules, held objects included.
            obstacles: at present.
            allowed: allowed contacts, (body name, obstacle name).
        """
        at_tool = np.flatnonzero(body.rows[:, BODY.frame] == arm.dof - 1)
        masks = [
            sum(1 << k for k, row in enumerate(at_tool) if mask >> int(row) & 1)
            for mask in contact_masks(body.names, obstacles, allowed)
        ]
        return ToolObstacles(body.tool(arm), obstacles, masks)

    def at(self, position: np.ndarray, quaternion: np.ndarray, reach: float) -> list[NearestObstacle]:
        """Return the nearest pair for each obstacle within reach of the tool at a pose of the tcp.

        Args:
            position: (3,) [m].
            quaternion: (4,) wxyz, unit.
            reach: [m].
        """
        if self.empty:
            return []
        work, least = self._work, {}
        pose_tool(work, position, quaternion)
        place_frames(work, ROW.placed)
        find_near(work, reach)
        first = int(work[ROW.header, HEADER.first_near])
        for row in work[first : first + int(work[ROW.header, HEADER.near])]:
            known = bool(row[NEAR_PAIR.margin] > 0.0)
            slack, other = row[NEAR_PAIR.distance] - row[NEAR_PAIR.margin], row[NEAR_PAIR.other]
            within, normal = min(KNOWN_REACH, reach) if known else reach, slice(NEAR_PAIR.normal, NEAR_PAIR.t)
            if slack < within and (other not in least or slack < least[other].slack):
                least[other] = NearestObstacle(float(slack), within, row[normal].copy(), known)
        return list(least.values())
