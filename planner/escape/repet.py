"""REPET: a path led around obstacles by escape trees in tangent planes. Paper: section III-C, algorithm 2.

The body is everything that moves with the tool, held objects included, not a point. A result counts as a success only
if it has been proven clear edge by edge. Method reference section 4 lists the unclear and wrong points of the printed
algorithm, and our reading.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..arrays import check_capacity, checked_array, checked_items, checked_kind, checked_settings
from ..collision.edge_certificates import tool_arrays, tool_slack
from ..columns import packed_row
from ..errors import BadOption
from ..geometry.pose import Pose, PosePath
from ..geometry.shapes import Obstacle, pack
from ..ranges import check_choice, check_count, check_range, check_ranges
from ..robot.body import TOOL_CAPSULE
from .detour import (
    ESCAPED,
    FREE,
    GOAL_IN_COLLISION,
    GUIDED_BLOCKED,
    NO_ESCAPE,
    NODE_LIMIT,
    START_IN_COLLISION,
    TOO_LONG,
    escape,
    last_tree,
)
from .tool_checks import checked_masks, checked_tool
from .tree_arrays import DETOUR_LOG, GROWTH, NODE, OPTION, tree_arrays

Corner = tuple[float, float, float]
REASONS = {
    FREE: "",
    ESCAPED: "",
    START_IN_COLLISION: "start in collision",
    GOAL_IN_COLLISION: "goal in collision",
    NO_ESCAPE: "no escape found",
    NODE_LIMIT: "node limit reached",
    GUIDED_BLOCKED: "blocked where the object is guided",
    TOO_LONG: "the detours do not fit into the longest path allowed",
}
"""Reason for each status of an escape; "" for success."""
VERDICTS = ("kept", "edge not clear", "visited", "outside the workspace", "sees the path again")
"""Names of the verdicts, see `tree_arrays.VERDICT`."""
MAX_OBSTACLES = 1000
"""Largest number of obstacles: every query visits all of them."""


@dataclass(frozen=True, slots=True)
class RepetSettings:
    """Settings of escape trees; defaults for an arm of the Panda's size.

    Attributes:
        distance: margin [m] between tool and obstacles, for obstacles without a margin of their own. It exceeds the
            margin of the safety layer, since a controller cuts corners.
        shell: clearance [m] that the root and the pose of rejoining should have; the paper's sphere of influence.
        trigger: "predictive" (a coming edge is not clear) or "shell" (the tool enters a shell, the paper).
        step: length of an edge of the tree [m].
        levels: largest number of levels of a tree.
        beam: largest number of leaves per level that get children.
        basis: "goal" (planes rotate with the problem) or "world" (the paper).
        square: children at the corners and the middles of the sides of a square (the paper), else on a circle.
        cost: "length" (path so far and path home) or "goal" (path home, the paper).
        orientation: of the nodes: "root" (the paper), "spread" (rotation towards the goal), or "turn" (nodes may
            rotate in place, for passages that need another attitude; not in the paper).
        turn: angle of a rotation in place [rad].
        retries: number of further trees, in turn with longer and shorter edges.
        grow: factor of the step in the first, third … retry.
        shrink: factor of the step in the second, fourth … retry.
        random: number of further children at random places of the plane, in retries.
        away: largest part of a random child's displacement off the plane, in units of the step.
        candidates: largest number of poses of the path at which a detour may rejoin it.
        cell: size of a cell in steps; of the nodes in a cell one is kept.
        nodes: largest number of nodes of a tree.
        rounds: largest number of detours of a path.
        shortcut: remove nodes that a clear edge can skip.
        pull_back: move children back to the shell.
        spacing: path length [m] between the poses of a detour.
        bias: (3,) value of a meter in each world direction, in meters of path length.
        workspace: lowest and highest corner (2, 3) [m] of the nodes' positions, in the world.
        longest: largest number of poses of a path. A planner takes longer paths at even steps of their length, see
            `Plan.reduction`, and has room for as many poses again of blend and detours.
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
            check_choice(name, getattr(self, name), known)
        check_ranges(self, "(0, inf)", "shell", "step", "grow", "shrink", "spacing", "turn", "cell")
        check_ranges(self, "[0, inf)", "distance", "away")
        check_range("beam", self.beam, "[1, 1000]")
        limits = {"levels": 100, "candidates": 100, "nodes": 10**6, "rounds": 100, "longest": 10**6}
        for name, most in limits.items():
            check_count(name, getattr(self, name), f"[1, {most}]")
        check_ranges(self, "[0, 1000]", "retries", "random")
        bias, workspace = checked_array("bias", self.bias, (3,)), checked_array("workspace", self.workspace, (2, 3))
        object.__setattr__(self, "bias", tuple(bias.tolist()))
        object.__setattr__(self, "workspace", tuple(map(tuple, workspace.tolist())))
        if (workspace[0] >= workspace[1]).any():
            raise BadOption("workspace", f"the lowest corner {self.workspace[0]} is not below {self.workspace[1]}")
        if self.shell <= self.distance:
            raise BadOption("shell", f"{self.shell} is not above the distance to keep, {self.distance}")

    def packed(self) -> np.ndarray:
        """Return the options (33,) as the kernels take them, see `tree_arrays.OPTION`.

        Column `largest_margin` holds `distance`; the user writes the largest margin of all obstacles.
        """
        lowest, highest = self.workspace
        same = ("step", "levels", "beam", "square", "random", "away", "nodes", "bias", "pull_back", "cell", "shell",
                "rounds", "retries", "grow", "shrink", "spacing", "shortcut", "candidates")  # fmt: skip
        return packed_row(
            OPTION,
            **{name: getattr(self, name) for name in same},
            world_basis=self.basis == "world",
            goal_cost=self.cost == "goal",
            spread=self.orientation == "spread",
            turn=self.turn if self.orientation == "turn" else 0.0,
            lowest=lowest,
            highest=highest,
            largest_margin=self.distance,
            on_shell=self.trigger == "shell",
            guided=-1.0,
        )


class TangentPlane(NamedTuple):
    """A plane laid through a node, perpendicular to the line to the closest obstacle.

    Attributes:
        origin: (3,) position of the tcp at the node [m].
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
    """A grown tree as data: every child that was considered, with its verdict.

    Attributes:
        poses: (n, 8) of the tcp.
        parents: (n,) row of the parent, -1 for the root.
        verdicts: (n,) index into `VERDICTS`.
        planes: the planes of the nodes with children.
    """

    poses: np.ndarray
    parents: np.ndarray
    verdicts: np.ndarray
    planes: tuple[TangentPlane, ...]

    @staticmethod
    def from_rows(rows: np.ndarray) -> EscapeTree:
        """Return the tree in the rows (n, 21) that the kernels leave behind."""
        rows = checked_array("rows of a tree", rows, (None, NODE.width))
        poses, open_ = rows[:, NODE.pose : NODE.parent].copy(), rows[:, NODE.expanded] == 1.0
        origins = PosePath(poses).positions
        planes = []
        for row, origin in zip(rows[open_], origins[open_], strict=True):
            normal, u = row[NODE.normal : NODE.normal + 3].copy(), row[NODE.u : NODE.u + 3].copy()
            planes.append(TangentPlane(origin, normal, u, np.cross(normal, u)))
        return EscapeTree(poses, rows[:, NODE.parent].astype(int), rows[:, NODE.verdict].astype(int), tuple(planes))


class Escape(NamedTuple):
    """The result of leading a path around obstacles.

    Attributes:
        path: the collision-free path; the given path if none was found.
        reason: "" if `path` is proven clear, else the reason of the failure.
        detours: index ranges (first, last) of the detours in the path.
        tree: the last tree that was grown; None if no tree was needed.
    """

    path: PosePath
    reason: str
    detours: tuple[tuple[int, int], ...]
    tree: EscapeTree | None

    @property
    def found(self) -> bool:
        """True if the path is proven clear."""
        return not self.reason


def escape_path(
    path: PosePath,
    tool: np.ndarray,
    obstacles: Sequence[Obstacle],
    settings: RepetSettings | None = None,
    *,
    masks: Sequence[int] = (),
    seed: int = 0,
    guided: int | None = None,
) -> Escape:
    """Lead a path around obstacles; a clear path is returned unchanged, bit by bit.

    Args:
        path: of the tcp in the world.
        tool: (m, 7) capsules that move with the tcp, see `Body.tool`; `point_tool` for a ball. At most
            `MAX_CAPSULES`.
        obstacles: the obstacles as they are now.
        settings: see `RepetSettings`.
        masks: per obstacle the capsules of the tool that may touch it, as bits of a number.
        seed: of the random children in retries; the same seed gives the same path.
        guided: index of the pose from which on the object is guided along the path: no detour ends behind it; None:
            detours may end anywhere. See `planner.imitation.constraint`.

    Raises:
        WrongType, BadShape, NotFinite: a path or obstacles of a wrong class, a tool that is not (m, 7) finite numbers.
        BadOption: too many obstacles, poses or capsules, masks that fit neither them nor the obstacles, or a seed that
            is no whole number.
    """
    settings = checked_settings(RepetSettings, settings)
    checked_kind("path", path, PosePath)
    obstacles = checked_items("obstacles", obstacles, Obstacle)
    check_capacity("obstacles", len(obstacles), MAX_OBSTACLES)
    tool = checked_tool(tool)
    masks = checked_masks(masks, len(tool), len(obstacles))
    check_count("seed", seed, "(-inf, inf)")
    if len(path) > settings.longest:
        raise BadOption("path", f"has {len(path)} poses; allowed are {settings.longest}")
    work = tool_arrays(tool, pack(obstacles), masks=masks, margin=settings.distance)
    options = settings.packed()
    margins = [settings.distance if o.margin is None else o.margin for o in obstacles]
    options[OPTION.largest_margin] = max([settings.distance, *margins])
    if guided is not None:
        check_count("guided", guided, f"[0, {len(path)}]")
        options[OPTION.guided] = len(path) - guided
    buffers = [np.zeros((settings.longest, 8)) for _ in range(2)]
    buffers[0][: len(path)] = path.dqs
    tree, cells, heap = tree_arrays(settings.nodes, settings.levels)
    log = np.zeros((settings.rounds, DETOUR_LOG.width))
    status, count, detours = escape(
        work, buffers[0], len(path), buffers[1], np.zeros(settings.longest), np.zeros(settings.candidates),
        np.zeros((settings.candidates, 8)), np.zeros((settings.levels + 3, 8)), tree, cells, heap, options,
        np.array([float(int(seed) % 2147483646) + 1.0]), log, np.zeros(GROWTH.width), np.inf,
    )  # fmt: skip
    rows = int(log[last_tree(status, detours, len(log)), DETOUR_LOG.tree_rows])
    grown = EscapeTree.from_rows(tree[:rows]) if rows else None
    if status == FREE:
        return Escape(path, "", (), None)
    if status != ESCAPED:
        return Escape(path, REASONS[status], (), grown)
    spans = tuple((int(row[DETOUR_LOG.first]), int(row[DETOUR_LOG.last])) for row in log[:detours])
    return Escape(PosePath(buffers[0][:count]), "", spans, grown)


def point_tool(radius: float) -> np.ndarray:
    """Return a ball about the tcp as a tool (1, 7), of a radius [m], for planning without an arm's body."""
    return packed_row(TOOL_CAPSULE, a=(0.0, 0.0, 0.0), b=(0.0, 0.0, 0.0), radius=radius)[None]


def clear_of(pose: Pose, tool: np.ndarray, obstacles: Sequence[Obstacle]) -> float:
    """Return the smallest distance [m] of a tool from obstacles, at most 1.

    Args:
        pose: of the tcp.
        tool: (m, 7) capsules, see `Body.tool`.
        obstacles: the obstacles.
    """
    checked_kind("pose", pose, Pose)
    tool, obstacles = checked_tool(tool), checked_items("obstacles", obstacles, Obstacle)
    bare = [replace(obstacle, margin=None) for obstacle in obstacles]
    return float(tool_slack(tool_arrays(tool, pack(bare)), tuple(float(v) for v in pose.dq), 1.0))
