"""An arm and its tool among obstacles, ready for the compiled loops."""

from __future__ import annotations

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
from .robot_work import MARGIN, OBSTACLES, SEEN, SEEN_COUNTS, SEEN_MOVING, among, robot_work
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


class Layout:
    """What of the work arrays belongs to the arm and its body: made once, copied for every scene."""

    def __init__(self, arm: Arm, body: Body, safety: SafetySettings, dt: float):
        nothing = pack(())
        self.names, self.safety = body.names, safety
        self.at_tool = np.flatnonzero(body.rows[:, FRAME] == arm.dof - 1)
        self.robot = robot_work((arm,), (body,), nothing, settings=safety.packed(dt))
        self.tool = tool_work(body.tool(arm), nothing)


class SceneWork:
    """The work arrays of an arm among obstacles: `robot` for the whole arm, `tool(factor)` for the tool.

    Args:
        layout: of the arm and its body.
        obstacles: as they are now.
        distance: for planning, to keep between tool and obstacles without a margin of their own [m].
        allowed: pairs of names (part of the body or held object, obstacle) that may touch.
    """

    def __init__(
        self,
        layout: Layout,
        obstacles: Sequence[Obstacle],
        distance: float,
        allowed: Sequence[tuple[str, str]] = (),
    ):
        packed, self._distance = pack(obstacles), distance
        masks = contact_masks(layout.names, obstacles, allowed)
        self.robot = among(layout.robot, packed, masks, layout.safety.distance)
        tool_masks = [sum(1 << k for k, row in enumerate(layout.at_tool) if mask >> int(row) & 1) for mask in masks]
        self._tool = among(layout.tool, packed, tool_masks, distance)
        self._margins = self._tool[OBSTACLES : OBSTACLES + len(obstacles), MARGIN]
        self._own = packed.rows[:, 23] >= 0.0
        self.robot_distance = layout.safety.distance

    @staticmethod
    def of(
        arm: Arm,
        body: Body,
        obstacles: Sequence[Obstacle],
        settings: PlanSettings,
        allowed: Sequence[tuple[str, str]] = (),
    ) -> SceneWork:
        """The arrays for the distances of these settings, laid out anew."""
        layout = Layout(arm, body, settings.safety, settings.motion.dt)
        return SceneWork(layout, checked_obstacles(obstacles), settings.repet.distance, allowed)

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
