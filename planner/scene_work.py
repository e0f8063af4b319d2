"""An arm and its tool among obstacles, ready for the compiled loops."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from .arm import Arm
from .body import FRAME, Body
from .clearance import room_at
from .edges import tool_room, tool_work
from .errors import BadOption
from .pose import Pose
from .repet import MAX_OBSTACLES
from .robot_work import MARGIN, OBSTACLES, SEEN, SEEN_COUNTS, SEEN_MOVING, robot_work
from .safety import SafetySettings, contact_masks
from .shapes import Obstacle, pack

if TYPE_CHECKING:
    from .planning import PlanSettings


def checked_obstacles(obstacles: Sequence[Obstacle]) -> tuple[Obstacle, ...]:
    """The obstacles, if they are not too many for queries that look at all of them."""
    if len(obstacles) > MAX_OBSTACLES:
        raise BadOption("obstacles", f"there are {len(obstacles)}; allowed are {MAX_OBSTACLES}")
    return tuple(obstacles)


PLACE = slice(2, 20)
"""Columns of an obstacle that change when it moves."""


class SceneWork:
    """The work arrays of an arm among obstacles: `robot` for the whole arm, `tool(factor)` for the tool."""

    def __init__(
        self,
        arm: Arm,
        body: Body,
        obstacles: Sequence[Obstacle],
        safety: SafetySettings,
        distance: float,
        dt: float,
        allowed: Sequence[tuple[str, str]] = (),
    ):
        packed = pack(obstacles)
        masks = contact_masks(body.names, obstacles, allowed)
        self.robot = robot_work(
            (arm,), (body,), packed, masks=masks, margin=safety.distance, settings=safety.packed(dt), most_near=0
        )
        at_tool = np.flatnonzero(body.rows[:, FRAME] == arm.dof - 1)
        tool_masks = [sum(1 << k for k, row in enumerate(at_tool) if mask >> int(row) & 1) for mask in masks]
        self._tool = tool_work(body.tool(arm), packed, masks=tool_masks, margin=distance)
        self._margins = self._tool[OBSTACLES : OBSTACLES + len(obstacles), MARGIN]
        self._own = np.array([obstacle.margin is not None for obstacle in obstacles], dtype=bool)
        self._distance = distance

    @staticmethod
    def of(
        arm: Arm,
        body: Body,
        obstacles: Sequence[Obstacle],
        settings: PlanSettings,
        allowed: Sequence[tuple[str, str]] = (),
    ) -> SceneWork:
        """The arrays for the distances of these settings."""
        distance, dt = settings.repet.distance, settings.motion.dt
        return SceneWork(arm, body, obstacles, settings.safety, distance, dt, allowed)

    def move(self, obstacles: Sequence[Obstacle]) -> None:
        """The same obstacles at other places, with other velocities."""
        rows = pack(obstacles).rows
        for work in (self.robot, self._tool):
            work[OBSTACLES : OBSTACLES + len(rows), PLACE] = rows[:, PLACE]
            work[SEEN, SEEN_COUNTS], work[SEEN, SEEN_MOVING] = 0.0, np.any(rows[:, 17:20])

    def tool(self, factor: float = 1.0) -> np.ndarray:
        """The tool's array, planning distances scaled where an obstacle has none of its own."""
        self._margins[~self._own] = factor * self._distance
        return self._tool

    def widest(self, factor: float = 1.0) -> float:
        """Largest distance to keep [m] in the tool's array."""
        return max([factor * self._distance, *self._margins[self._own]])

    def room(self, q: np.ndarray) -> float:
        """Room [m] of the whole arm at joints q (dof,), up to 1 m."""
        return float(room_at(self.robot, q, 0.0, 1.0))

    def tool_room(self, pose: Pose) -> float:
        """Room [m] of the tool at a pose of the tcp, with the safety distance, up to 1 m."""
        factor = self.robot_distance / self._distance if self._distance > 0 else 1.0
        work = self.tool(factor)
        return float(tool_room(work, tuple(float(value) for value in pose.dq), 1.0))

    @property
    def robot_distance(self) -> float:
        """Safety distance [m] of the whole arm."""
        free = np.flatnonzero(~self._own)
        if not len(free):
            return self._distance
        margin = float(self.robot[OBSTACLES + int(free[0]), MARGIN])
        return margin if math.isfinite(margin) else self._distance
