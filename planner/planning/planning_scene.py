"""An arm and its tool among obstacles, ready for the compiled loops."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..collision.clearance import FIRST, GAP, KEEP, KIND, OTHER, SELF_MARGIN, find_near, slack_at
from ..collision.edge_certificates import tool_arrays, tool_slack
from ..collision.robot_arrays import (
    FRAMES,
    HEADER,
    MARGIN,
    N_NEAR,
    N_OBSTACLES,
    NEAR,
    OBSTACLES,
    SEEN,
    SEEN_COUNTS,
    SEEN_MOVING,
    SETTINGS,
    WORLD,
    place_capsules,
    place_frames,
    robot_arrays,
    with_obstacles,
)
from ..collision.self_collision import body_pairs
from ..errors import BadOption
from ..escape.repet import MAX_OBSTACLES
from ..geometry.pose import Pose
from ..geometry.shapes import Obstacle, pack
from ..robot.arm import Arm
from ..robot.body import FRAME, Body
from ..safety.safety_layer import SafetySettings, contact_masks

if TYPE_CHECKING:
    from .settings import PlanSettings


def checked_obstacles(obstacles: Sequence[Obstacle]) -> tuple[Obstacle, ...]:
    """The obstacles, if they are not too many for queries that look at all of them."""
    if len(obstacles) > MAX_OBSTACLES:
        raise BadOption("obstacles", f"there are {len(obstacles)}; allowed are {MAX_OBSTACLES}")
    return tuple(obstacles)


PLACE = slice(2, 20)
"""Columns of an obstacle that change when it moves."""


class Tightest(NamedTuple):
    """The pair that has least room.

    Attributes:
        part: name of the part of the body, or of what it holds.
        other: name of the obstacle, or of another part; "obstacle 3", counted from 0, if it has none.
        distance: distance between them [m], negative inside.
        margin: distance that they must keep [m].
    """

    part: str
    other: str
    distance: float
    margin: float

    def __str__(self) -> str:
        """For messages."""
        if self.distance <= 0.0:
            return f"{self.part} touches {self.other}"
        return f"{self.part} is {1e3 * self.distance:.1f} mm from {self.other}, which must be {1e3 * self.margin:.1f}"


class SceneTemplate:
    """What of the work arrays belongs to the arm and its body: made once, copied for every scene.

    Without a guard the arm that follows a path is among nothing: it is not held back by what is there.
    """

    def __init__(self, arm: Arm, body: Body, safety: SafetySettings, dt: float, *, guard: bool = True):
        nothing = pack(())
        self.names, self.safety = body.names, safety
        self.at_tool = np.flatnonzero(body.rows[:, FRAME] == arm.dof - 1)
        self.tool_names = tuple(body.names[row] for row in self.at_tool)
        pairs = body_pairs(arm, body, safety.self_distance)
        self.robot = robot_arrays((arm,), (body,), nothing, pairs=pairs, settings=safety.packed(dt))
        self.alone = None if guard else robot_arrays((arm,), (body,), nothing, settings=safety.packed(dt))
        self.tool = tool_arrays(body.tool(arm), nothing)


class PlanningScene:
    """The work arrays of an arm among obstacles: `robot` for the whole arm, `tool(factor)` for the tool.

    `seen` is the whole arm among them for queries, also where the layout has no guard and `robot` is among nothing.

    Args:
        layout: of the arm and its body.
        obstacles: as they are now.
        distance: for planning, to keep between tool and obstacles without a margin of their own [m].
        allowed: pairs of names (part of the body or held object, obstacle) that may touch.
    """

    def __init__(
        self,
        layout: SceneTemplate,
        obstacles: Sequence[Obstacle],
        distance: float,
        allowed: Sequence[tuple[str, str]] = (),
    ):
        packed, self._distance = pack(obstacles), distance
        self._template = layout
        self._names = [obstacle.name or f"obstacle {k}" for k, obstacle in enumerate(obstacles)]
        masks = contact_masks(layout.names, obstacles, allowed)
        self.seen = with_obstacles(layout.robot, packed, masks, layout.safety.distance)
        self.robot = (
            self.seen if layout.alone is None else with_obstacles(layout.alone, pack(()), (), layout.safety.distance)
        )
        tool_masks = [sum(1 << k for k, row in enumerate(layout.at_tool) if mask >> int(row) & 1) for mask in masks]
        self._tool = with_obstacles(layout.tool, packed, tool_masks, distance)
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
    ) -> PlanningScene:
        """The arrays for the distances of these settings, laid out anew."""
        layout = SceneTemplate(arm, body, settings.safety, settings.motion.dt, guard=settings.guard)
        return PlanningScene(layout, checked_obstacles(obstacles), settings.repet.distance, allowed)

    def move(self, obstacles: Sequence[Obstacle]) -> None:
        """The same obstacles at other places, with other velocities."""
        rows = pack(obstacles).rows
        for work in (self.seen, self._tool):
            work[OBSTACLES : OBSTACLES + len(rows), PLACE] = rows[:, PLACE]
            work[SEEN, SEEN_COUNTS], work[SEEN, SEEN_MOVING] = 0.0, np.any(rows[:, 17:20])

    def tool(self, factor: float = 1.0) -> np.ndarray:
        """The tool's array, planning distances scaled where an obstacle has none of its own."""
        self._margins[~self._own] = factor * self._distance
        return self._tool

    def widest(self, factor: float = 1.0) -> float:
        """Largest distance to keep [m] in the tool's array."""
        return max([factor * self._distance, *self._margins[self._own]])

    def slack(self, q: np.ndarray) -> float:
        """Room [m] of the whole arm at joints q (dof,), up to 1 m."""
        return float(slack_at(self.seen, q, 0.0, 1.0))

    def tool_slack(self, pose: Pose) -> float:
        """Room [m] of the tool at a pose of the tcp, with the safety distance, up to 1 m."""
        return float(tool_slack(self.safe_tool(), tuple(float(value) for value in pose.dq), 1.0))

    def safe_tool(self) -> np.ndarray:
        """The tool's array with the safety distance in place of the planning distance."""
        return self.tool(self._safe_factor)

    @property
    def widest_safe(self) -> float:
        """Largest distance to keep [m] in `safe_tool`."""
        return self.widest(self._safe_factor)

    @property
    def _safe_factor(self) -> float:
        return self.robot_distance / self._distance if self._distance > 0 else 1.0

    def tightest(self, q: np.ndarray) -> Tightest | None:
        """The pair of the whole arm with least room at joints q (dof,); None if nothing is within its distance."""
        place_capsules(self.seen, q, WORLD)
        return self._tightest(self.seen, self._template.names)

    def tightest_of_tool(self, pose: Pose, factor: float | None = None) -> Tightest | None:
        """The pair of the tool with least room at a pose; with the safety distance, or a factor of the planning one."""
        work = self.safe_tool() if factor is None else self.tool(factor)
        work[FRAMES, 3:6], work[FRAMES, 6:10] = pose.position, pose.dq[:4]
        place_frames(work, WORLD)
        return self._tightest(work, self._template.tool_names)

    def meets_mover(self) -> bool:
        """True if an obstacle that moves is among the near pairs of the whole arm that were found last."""
        near = self._near(self.robot)
        others = near[near[:, KIND] == 0.0, OTHER].astype(int)
        return bool(self.robot[OBSTACLES + others, 17:20].any())

    @staticmethod
    def _near(work: np.ndarray) -> np.ndarray:
        first = int(work[HEADER, NEAR])
        return work[first : first + int(work[HEADER, N_NEAR])]

    def _tightest(self, work: np.ndarray, names: Sequence[str]) -> Tightest | None:
        margins = work[OBSTACLES : OBSTACLES + int(work[HEADER, N_OBSTACLES]), MARGIN]
        find_near(work, max([work[SETTINGS, SELF_MARGIN], *margins]))
        return self.tightest_seen(work, names)

    def tightest_seen(self, work: np.ndarray | None = None, names: Sequence[str] = ()) -> Tightest | None:
        """The same of the near pairs that were found last; None if there were none."""
        work, names = (self.robot, self._template.names) if work is None else (work, names)
        near = self._near(work)
        if not len(near):
            return None
        row = near[np.argmin(near[:, GAP] - near[:, KEEP])]
        others = self._names if row[KIND] == 0.0 else names
        return Tightest(names[int(row[FIRST])], others[int(row[OTHER])], float(row[GAP]), float(row[KEEP]))
