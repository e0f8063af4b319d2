"""REPET: a path led round obstacles by escape trees in tangent planes. Paper: section III-C, algorithm 2.

The body is all that moves with the tool, with what it holds, not a point. Nothing is called a success that has not
been proven clear edge by edge. Method reference section 4 says what was unclear or wrong in print, and our reading.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..collision.edge_certificates import tool_arrays
from ..errors import BadOption, BadShape
from ..geometry.pose import Pose, PosePath
from ..geometry.shapes import Obstacle, pack
from .detour import (
    ESCAPED,
    FREE,
    GOAL_IN_COLLISION,
    NO_ESCAPE,
    NODE_LIMIT,
    START_IN_COLLISION,
    TOO_LONG,
    escape,
    last_tree,
)
from .escape_tree import BIAS, EXPANDED, HIGHEST, LOWEST, NORMAL_AT, OPTIONS, PARENT, U_AT, VERDICT, tree_arrays

Corner = tuple[float, float, float]
REASONS = {
    FREE: "",
    ESCAPED: "",
    START_IN_COLLISION: "start in collision",
    GOAL_IN_COLLISION: "goal in collision",
    NO_ESCAPE: "no escape found",
    NODE_LIMIT: "node limit reached",
    TOO_LONG: "the detours do not fit into the longest path allowed",
}
VERDICTS = ("kept", "edge not clear", "visited", "outside the workspace", "sees the path again")
MAX_OBSTACLES = 1000
"""More of them are refused: every query looks at all."""


@dataclass(frozen=True, slots=True)
class RepetSettings:
    """How escape trees grow; defaults for an arm of the Panda's size.

    Attributes:
        distance: to keep between tool and obstacles [m], where an obstacle has no margin of its own. More than the
            safety layer keeps, since a controller cuts corners.
        shell: clearance [m] that the root and the way back should have; the paper's sphere of influence.
        trigger: "predictive" (a coming edge is not clear) or "shell" (the tool enters a shell, the paper).
        step: length of an edge of the tree [m].
        levels: most levels of a tree.
        beam: most leaves that get children, per level.
        basis: "goal" (planes turn with the problem) or "world" (the paper).
        square: children at the corners and the middles of the sides of a square (the paper), else on a circle.
        cost: "length" (way so far and way home) or "goal" (way home, the paper).
        orientation: of the nodes: "root" (the paper), "spread" (turning towards the way home), or "turn" (nodes may
            turn where they stand, for what passes only in another attitude; not in the paper).
        turn: angle [rad] of a turn.
        retries: further trees, in turn with longer and shorter edges.
        grow: factor of the step in the first, third … retry.
        shrink: factor in the second, fourth … retry.
        random: further children at random places of the plane, in retries.
        away: largest part of a random child's way off the plane, in planes' units.
        candidates: most poses of the path at which it may go on.
        cell: of two nodes in the same cell of this size, in steps, one is kept.
        nodes: most rows of a tree.
        rounds: most detours of a path.
        shortcut: leave out nodes that can be jumped over.
        pull_back: bring children back to the shell.
        spacing: screw length [m] between the poses of a detour.
        bias: (3,) what a metre in this world direction is worth in metres of way.
        workspace: lowest and highest corner (2, 3) [m] of where nodes may be, in the world.
        longest: most poses of a path.
    """

    distance: float = 0.02
    shell: float = 0.05
    trigger: str = "predictive"
    step: float = 0.06
    levels: int = 14
    beam: int = 48
    basis: str = "goal"
    square: bool = False
    cost: str = "length"
    orientation: str = "root"
    turn: float = 0.8
    retries: int = 4
    grow: float = 1.5
    shrink: float = 0.4
    random: int = 8
    away: float = 1.0
    candidates: int = 5
    cell: float = 1.0
    nodes: int = 4000
    rounds: int = 10
    shortcut: bool = True
    pull_back: bool = False
    spacing: float = 0.01
    bias: Corner = (0.0, 0.0, 0.0)
    workspace: tuple[tuple[float, float, float], tuple[float, float, float]] = (
        (-10.0, -10.0, -10.0),
        (10.0, 10.0, 10.0),
    )
    longest: int = 4000

    def __post_init__(self):
        choices = {
            "trigger": ("predictive", "shell"),
            "basis": ("goal", "world"),
            "cost": ("length", "goal"),
            "orientation": ("root", "spread", "turn"),
        }
        for name, known in choices.items():
            if getattr(self, name) not in known:
                raise BadOption(name, f"{getattr(self, name)!r} is not one of {', '.join(known)}")
        for name in ("shell", "step", "grow", "shrink", "spacing", "turn", "cell"):
            if not 0 < getattr(self, name) < math.inf:
                raise BadOption(name, f"{getattr(self, name)} is not a positive number")
        for name in ("distance", "away"):
            if not 0 <= getattr(self, name) < math.inf:
                raise BadOption(name, f"{getattr(self, name)} is not a number >= 0")
        limits = {"levels": 100, "beam": 1000, "candidates": 100, "nodes": 10**6, "rounds": 100, "longest": 10**6}
        for name, most in limits.items():
            if not 1 <= getattr(self, name) <= most:
                raise BadOption(name, f"{getattr(self, name)} is not from 1 to {most}")
        for name in ("retries", "random"):
            if not 0 <= getattr(self, name) <= 1000:
                raise BadOption(name, f"{getattr(self, name)} is not from 0 to 1000")
        numbers = np.array([*self.bias, *self.workspace[0], *self.workspace[1]], dtype=np.float64)
        if not np.isfinite(numbers).all():
            raise BadOption("bias", f"or workspace: {self.bias}, {self.workspace} hold a number that is not finite")
        if (np.array(self.workspace[0]) >= np.array(self.workspace[1])).any():
            raise BadOption("workspace", f"the lowest corner {self.workspace[0]} is not below {self.workspace[1]}")
        if self.shell <= self.distance:
            raise BadOption("shell", f"{self.shell} is not above the distance to keep, {self.distance}")

    def packed(self) -> np.ndarray:
        """(32,) the settings as the kernels take them; the largest margin is filled in later."""
        head = [
            self.step, self.levels, self.beam, self.basis == "world", self.square, self.cost == "goal",
            self.orientation == "spread", self.turn if self.orientation == "turn" else 0.0, self.random, self.away,
            self.nodes,
        ]  # fmt: skip
        tail = [
            self.pull_back, self.cell, self.distance, self.shell, self.rounds, self.retries, self.grow, self.shrink,
            self.trigger == "shell", self.spacing, self.shortcut, self.candidates,
        ]  # fmt: skip
        out = np.zeros(OPTIONS)
        out[: len(head)] = head
        out[BIAS : BIAS + 3], out[LOWEST : LOWEST + 3], out[HIGHEST : HIGHEST + 3] = self.bias, *self.workspace
        out[20 : 20 + len(tail)] = tail
        return out


class TangentPlane(NamedTuple):
    """A plane laid through a node, perpendicular to the line to the closest obstacle.

    Attributes:
        origin: (3,) the tcp at the node [m].
        normal: (3,) unit, away from the obstacle.
        u: (3,) unit, in the plane.
        v: (3,) unit, in the plane; u, v and the normal are right-handed: u x v = normal.
    """

    origin: np.ndarray
    normal: np.ndarray
    u: np.ndarray
    v: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class EscapeTree:
    """A grown tree as data: every child that was looked at, with the verdict on it.

    Attributes:
        poses: (n, 8) the tcp.
        parents: (n,) row of the parent, -1 for the root.
        verdicts: (n,) index into `VERDICTS`.
        planes: the planes laid at the nodes that have children.
    """

    poses: np.ndarray
    parents: np.ndarray
    verdicts: np.ndarray
    planes: tuple[TangentPlane, ...]

    @staticmethod
    def from_rows(rows: np.ndarray) -> EscapeTree:
        """The tree in the rows that the kernels leave behind."""
        poses, open_ = rows[:, :8].copy(), rows[:, EXPANDED] == 1.0
        origins = PosePath(poses).positions
        planes = []
        for row, origin in zip(rows[open_], origins[open_], strict=True):
            normal, u = row[NORMAL_AT : NORMAL_AT + 3].copy(), row[U_AT : U_AT + 3].copy()
            planes.append(TangentPlane(origin, normal, u, np.cross(normal, u)))
        return EscapeTree(poses, rows[:, PARENT].astype(int), rows[:, VERDICT].astype(int), tuple(planes))


class Escape(NamedTuple):
    """A path led round obstacles.

    Attributes:
        path: the collision-free path; the path as it was where none was found.
        reason: "" if `path` is proven clear, else why none was found.
        detours: index ranges (first, last) of the detours in the path.
        tree: the last tree that was grown, None if none was needed.
    """

    path: PosePath
    reason: str
    detours: tuple[tuple[int, int], ...]
    tree: EscapeTree | None

    @property
    def found(self) -> bool:
        """The path is proven clear."""
        return not self.reason


def escape_path(
    path: PosePath,
    tool: np.ndarray,
    obstacles: Sequence[Obstacle],
    settings: RepetSettings | None = None,
    *,
    masks: Sequence[int] = (),
    seed: int = 0,
) -> Escape:
    """Lead a path round obstacles; if it is clear it comes back as it is, bit by bit.

    Args:
        path: of the tcp in the world.
        tool: (m, 7) capsules that move with the tcp, see `Body.tool`; `point_tool` for a ball.
        obstacles: where they are now.
        settings: see `RepetSettings`.
        masks: per obstacle the capsules of the tool that may touch it, as bits of a number.
        seed: of the random children in retries; the same seed gives the same path.
    """
    settings = settings or RepetSettings()
    tool = np.asarray(tool, dtype=np.float64)
    if tool.ndim != 2 or tool.shape[1] != 7 or not np.isfinite(tool).all():
        raise BadShape("tool", tool.shape, "(m, 7), finite")
    if len(obstacles) > MAX_OBSTACLES:
        raise BadOption("obstacles", f"there are {len(obstacles)}; allowed are {MAX_OBSTACLES}")
    if len(path) > settings.longest:
        raise BadOption("path", f"has {len(path)} poses; allowed are {settings.longest}")
    work = tool_arrays(tool, pack(obstacles), masks=masks, margin=settings.distance)
    options = settings.packed()
    margins = [settings.distance if o.margin is None else o.margin for o in obstacles]
    options[22] = max([settings.distance, *margins])
    buffers = [np.zeros((settings.longest, 8)) for _ in range(2)]
    buffers[0][: len(path)] = path.dqs
    tree, cells, heap = tree_arrays(settings.nodes, settings.levels)
    log = np.zeros((settings.rounds, 4))
    status, count, detours = escape(
        work, buffers[0], len(path), buffers[1], np.zeros(settings.longest), np.zeros(settings.candidates),
        np.zeros((settings.candidates, 8)), np.zeros((settings.levels + 3, 8)), tree, cells, heap, options,
        np.array([float(seed % 2147483646) + 1.0]), log,
    )  # fmt: skip
    rows = int(log[last_tree(status, detours, len(log)), 0])
    grown = EscapeTree.from_rows(tree[:rows]) if rows else None
    if status == FREE:
        return Escape(path, "", (), None)
    if status != ESCAPED:
        return Escape(path, REASONS[status], (), grown)
    spans = tuple((int(first), int(last)) for _, first, last, _ in log[:detours])
    return Escape(PosePath(buffers[0][:count]), "", spans, grown)


def point_tool(radius: float) -> np.ndarray:
    """(1, 7) a ball about the tcp as the tool, for planning without an arm's body."""
    return np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, radius]])


def clear_of(pose: Pose, tool: np.ndarray, obstacles: Sequence[Obstacle]) -> float:
    """Smallest distance [m] of the tool at a pose from obstacles; 1 if they are farther."""
    from ..collision.edge_certificates import tool_slack

    bare = [replace(obstacle, margin=None) for obstacle in obstacles]
    return float(tool_slack(tool_arrays(tool, pack(bare)), tuple(float(v) for v in pose.dq), 1.0))
