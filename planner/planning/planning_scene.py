"""An arm and its tool among obstacles, ready for the compiled loops."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import check_capacity, checked_array, checked_items, checked_kind
from ..collision.capsule_placement import place_capsules, place_frames
from ..collision.clearance import find_near, slack_at
from ..collision.edge_certificates import pose_tool, tool_arrays, tool_slack
from ..collision.robot_arrays import HEADER, LAST_LOOK, NEAR_PAIR, ROW, SETTING, robot_arrays, with_obstacles
from ..collision.self_collision import body_pairs
from ..errors import BadOption, told_apart
from ..escape.repet import MAX_OBSTACLES
from ..geometry.pose import Pose
from ..geometry.shapes import OBSTACLE, Obstacle, pack
from ..robot.arm import Arm
from ..robot.body import BODY, Body
from ..safety.robot_checks import check_bodies, contact_masks
from ..safety.safety_layer import SafetySettings

if TYPE_CHECKING:
    from .settings import PlanSettings


def checked_obstacles(obstacles: Sequence[Obstacle]) -> tuple[Obstacle, ...]:
    """Return the obstacles as a tuple.

    Raises:
        WrongType: an item is no obstacle.
        BadOption: there are more than `MAX_OBSTACLES`: every query visits all of them.
    """
    checked = checked_items("obstacles", obstacles, Obstacle)
    check_capacity("obstacles", len(checked), MAX_OBSTACLES)
    return checked


PLACE = slice(OBSTACLE.center, OBSTACLE.ball)
"""Columns of an obstacle that change when it moves."""
VELOCITY = slice(OBSTACLE.velocity, OBSTACLE.ball)
"""Columns of the velocity of an obstacle."""


TEMPLATES = 16
"""Number of arms with bodies whose arrays are kept: one motion is planned and followed by several planners."""
CONTACT_ROOM = 0.005
"""Distance [m] by which a wanted contact may be deeper on the way than at the ends: edges are proven with some room."""
ROUNDING = 1e-6
"""Slack [m] that rounding may take from a step that was proven."""


class Tightest(NamedTuple):
    """The pair with the least slack.

    Attributes:
        part: name of the part of the body, or of what it holds.
        other: name of the obstacle, or of another part; "obstacle 3", counted from 0, if it has none.
        distance: between them [m], negative inside.
        margin: required distance [m].
    """

    part: str
    other: str
    distance: float
    margin: float

    @property
    def slack(self) -> float:
        """Distance beyond the required one [m]."""
        return self.distance - self.margin

    def __str__(self) -> str:
        """The pair in words, for messages."""
        if self.distance <= 0.0:
            return f"{self.part} touches {self.other}"
        distance, margin = told_apart(1e3 * self.distance, 1e3 * self.margin, 1)
        if self.slack >= 0.0:
            return f"{self.part} is {distance} mm from {self.other}, and {margin} are enough"
        return f"{self.part} is {distance} mm from {self.other}, which must be {margin}"


class SceneTemplate:
    """The arrays of an arm and its body without obstacles: made once, copied for every scene.

    Args:
        arm: the arm.
        body: its capsules, held object included.
        safety: settings of the safety layer.
        dt: seconds per tick.
        guard: False: the arm follows paths as if there were no obstacles.
    """

    def __init__(self, arm: Arm, body: Body, safety: SafetySettings, dt: float, *, guard: bool = True):
        check_bodies((checked_kind("arm", arm, Arm),), (checked_kind("body", body, Body),))
        nothing = pack(())
        self.arm = arm
        self.names, self.safety = body.names, safety
        self.at_tool = np.flatnonzero(body.rows[:, BODY.frame] == arm.dof - 1)
        self.tool_names = tuple(body.names[row] for row in self.at_tool)
        pairs = body_pairs(arm, body, safety.self_distance)
        self.robot = robot_arrays((arm,), (body,), nothing, pairs=pairs, settings=safety.packed(dt))
        self.alone = None if guard else robot_arrays((arm,), (body,), nothing, settings=safety.packed(dt))
        self.tool = tool_arrays(body.tool(arm), nothing, hulls=body.tool_hulls(arm))


@lru_cache(maxsize=TEMPLATES)
def scene_template(arm: Arm, body: Body, safety: SafetySettings, dt: float, guard: bool) -> SceneTemplate:
    """Return the arrays of an arm and its body, the same object for the same ones.

    Args:
        arm: the arm.
        body: its capsules, held object included.
        safety: settings of the safety layer.
        dt: seconds per tick.
        guard: False: the arm follows paths as if there were no obstacles.
    """
    return SceneTemplate(arm, body, safety, dt, guard=guard)


class PlanningScene:
    """The arrays of an arm among obstacles: `robot` to follow paths, `seen` for queries, `tool(factor)` for the tool.

    Without a guard `robot` is among no obstacles; `seen` always is among all of them.

    Args:
        template: the arrays of the arm and its body.
        obstacles: as they are now.
        distance: planning margin [m] of the tool from obstacles without a margin of their own.
        allowed: pairs of names (part of the body or held object, obstacle) that may touch.
    """

    def __init__(
        self,
        template: SceneTemplate,
        obstacles: Sequence[Obstacle],
        distance: float,
        allowed: Sequence[tuple[str, str]] = (),
    ):
        packed, self._distance = pack(obstacles), distance
        self._template = template
        self._obstacles, self._allowed = tuple(obstacles), tuple(allowed)
        self._names = [obstacle.name or f"obstacle {k}" for k, obstacle in enumerate(obstacles)]
        masks = contact_masks(template.names, obstacles, allowed)
        self.seen = with_obstacles(template.robot, packed, masks, template.safety.distance)
        self.robot = (
            self.seen
            if template.alone is None
            else with_obstacles(template.alone, pack(()), (), template.safety.distance)
        )
        tool_masks = [sum(1 << k for k, row in enumerate(template.at_tool) if mask >> int(row) & 1) for mask in masks]
        self._tool = with_obstacles(template.tool, packed, tool_masks, distance)
        self._margins = self._tool[ROW.obstacles : ROW.obstacles + len(obstacles), OBSTACLE.margin]
        self._own = packed.rows[:, OBSTACLE.own_margin] >= 0.0
        self.robot_distance = template.safety.distance

    @staticmethod
    def of(
        arm: Arm,
        body: Body,
        obstacles: Sequence[Obstacle],
        settings: PlanSettings,
        allowed: Sequence[tuple[str, str]] = (),
    ) -> PlanningScene:
        """Lay out a scene anew.

        Args:
            arm: the arm.
            body: its capsules, held object included.
            obstacles: as they are now.
            settings: of the planner: margins, time step, guard.
            allowed: pairs of names (part of the body or held object, obstacle) that may touch.

        Raises:
            BadOption: there are too many obstacles.
        """
        template = scene_template(arm, body, settings.safety, settings.motion.dt, settings.guard)
        return PlanningScene(template, checked_obstacles(obstacles), settings.repet.distance, allowed)

    def with_contacts_as_at(self, *ends: np.ndarray) -> np.ndarray:
        """Return the array for queries in which wanted contacts are no deeper than at the ends of a motion.

        `seen` exempts a wanted contact altogether, so that a way may lead right through the obstacle. Here the obstacle
        stands twice: once for all other parts, once for those that may touch it, with a margin of its own.

        Args:
            ends: (dof,) joints each.
        """
        names, count = self._template.names, len(self._obstacles)
        masks = contact_masks(names, self._obstacles, self._allowed)
        touched = [k for k, mask in enumerate(masks) if mask]
        if not touched:
            return self.seen
        twins = pack((*self._obstacles, *(self._obstacles[k] for k in touched)))
        others = [((1 << len(names)) - 1) & ~masks[k] for k in touched]
        work = with_obstacles(self._template.robot, twins, [*masks, *others], self.robot_distance)
        margins = work[ROW.obstacles + count : ROW.obstacles + len(twins.rows), OBSTACLE.margin]
        wanted, widest = margins.copy(), float(margins.max())
        for q in ends:
            place_capsules(work, q, ROW.placed)
            find_near(work, widest)
            for row in self._near(work):
                twin = int(row[NEAR_PAIR.other]) - count
                if row[NEAR_PAIR.self_pair] == 0.0 and twin >= 0:
                    wanted[twin] = min(wanted[twin], row[NEAR_PAIR.distance] - CONTACT_ROOM)
        margins[:] = wanted
        work[ROW.last_look, LAST_LOOK.valid] = 0.0
        return work

    def keeps_contacts(self, joints: np.ndarray) -> bool:
        """Return whether a guarded motion (t, dof) is nowhere deeper in a wanted contact than at its ends."""
        if not self._allowed or self._template.alone is not None:
            return True
        seen = self.with_contacts_as_at(joints[0], joints[-1])
        return all(slack_at(seen, q, 0.0, 0.1) >= -ROUNDING for q in joints)

    def move(self, obstacles: Sequence[Obstacle]) -> None:
        """Move the same obstacles to other places, with other velocities.

        Raises:
            BadOption: there are fewer or more than before.
        """
        if len(obstacles) != len(self._names):
            raise BadOption("obstacles", f"there are {len(obstacles)}; the scene has {len(self._names)}")
        rows = pack(obstacles).rows
        for work in (self.seen, self._tool):
            work[ROW.obstacles : ROW.obstacles + len(rows), PLACE] = rows[:, PLACE]
            work[ROW.last_look, LAST_LOOK.valid] = 0.0
            work[ROW.last_look, LAST_LOOK.moving] = np.any(rows[:, VELOCITY])

    def tool(self, factor: float = 1.0) -> np.ndarray:
        """Return the tool's array, with the planning margin scaled for obstacles without a margin of their own."""
        self._margins[~self._own] = factor * self._distance
        return self._tool

    def widest(self, factor: float = 1.0) -> float:
        """Return the largest margin [m] in the tool's array."""
        return max([factor * self._distance, *self._margins[self._own]])

    def checked_joints(self, joints: ArrayLike) -> np.ndarray:
        """Return joints (t, dof) as the kernels take them."""
        return checked_array("joints", joints, (None, self._template.arm.dof))

    def slack(self, q: np.ndarray) -> float:
        """Return the slack [m] of the whole arm at joints q (dof,), up to 1 m."""
        return float(slack_at(self.seen, self._template.arm.checked(q), 0.0, 1.0))

    def tool_slack(self, pose: Pose) -> float:
        """Return the slack [m] of the tool at a pose of the tcp beyond the safety margin, up to 1 m."""
        checked_kind("pose", pose, Pose)
        return float(tool_slack(self.safe_tool(), tuple(float(value) for value in pose.dq), 1.0))

    def safe_tool(self) -> np.ndarray:
        """Return the tool's array with the safety margin in place of the planning margin."""
        return self.tool(self._safe_factor)

    @property
    def widest_safe(self) -> float:
        """Largest margin [m] in `safe_tool`."""
        return self.widest(self._safe_factor)

    @property
    def _safe_factor(self) -> float:
        return self.robot_distance / self._distance if self._distance > 0 else 1.0

    def tightest(self, q: np.ndarray) -> Tightest | None:
        """Return the whole arm's pair with the least slack at joints q (dof,); None beyond the largest margin."""
        place_capsules(self.seen, self._template.arm.checked(q), ROW.placed)
        return self._tightest(self.seen, self._template.names)

    def tightest_of_tool(self, pose: Pose, factor: float | None = None) -> Tightest | None:
        """Return the tool's pair with the least slack at a pose.

        Args:
            pose: of the tcp.
            factor: of the planning margin; None: the safety margin.
        """
        work = self.safe_tool() if factor is None else self.tool(factor)
        pose_tool(work, pose.position, pose.dq[:4])
        place_frames(work, ROW.placed)
        return self._tightest(work, self._template.tool_names)

    def meets_mover(self) -> bool:
        """Return whether a moving obstacle is among the most recent near pairs of the whole arm."""
        near = self._near(self.robot)
        others = near[near[:, NEAR_PAIR.self_pair] == 0.0, NEAR_PAIR.other].astype(int)
        return bool(self.robot[ROW.obstacles + others, VELOCITY].any())

    @staticmethod
    def _near(work: np.ndarray) -> np.ndarray:
        first = int(work[ROW.header, HEADER.first_near])
        return work[first : first + int(work[ROW.header, HEADER.near])]

    def _tightest(self, work: np.ndarray, names: Sequence[str]) -> Tightest | None:
        margins = work[ROW.obstacles : ROW.obstacles + int(work[ROW.header, HEADER.obstacles]), OBSTACLE.margin]
        find_near(work, max([work[ROW.settings, SETTING.self_margin], *margins]))
        return self.tightest_seen(work, names)

    def tightest_seen(self, work: np.ndarray | None = None, names: Sequence[str] = ()) -> Tightest | None:
        """Return the tightest of the most recent near pairs; None without any.

        Args:
            work: the array whose near pairs count; None: that of the whole arm.
            names: of its capsules.
        """
        work, names = (self.robot, self._template.names) if work is None else (work, names)
        near = self._near(work)
        if not len(near):
            return None
        row = near[np.argmin(near[:, NEAR_PAIR.distance] - near[:, NEAR_PAIR.margin])]
        others = self._names if row[NEAR_PAIR.self_pair] == 0.0 else names
        part, other = names[int(row[NEAR_PAIR.capsule])], others[int(row[NEAR_PAIR.other])]
        return Tightest(part, other, float(row[NEAR_PAIR.distance]), float(row[NEAR_PAIR.margin]))
