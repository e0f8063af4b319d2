"""The packed arrays of an escape tree: its nodes, its options, its heap of open leaves, and the log of detours."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

CELLS = 8192
"""Size of the table of visited cells, a power of two."""


class NodeColumns(NamedTuple):
    """Columns of a node of the tree."""

    pose: int = 0  # (8) of the tcp
    parent: int = 8  # row of the parent; -1 for the root
    level: int = 9
    verdict: int = 10  # see VERDICT
    length: int = 11  # length of the path from the root [m]
    score: int = 12  # lower bound of the cost of a path through the node [m]
    normal: int = 13  # (3) of the plane laid through the node, away from the obstacle
    u: int = 16  # (3) direction in the plane; v = normal x u
    slack: int = 19  # of the tool at the node [m]
    expanded: int = 20  # 1 once the node has children
    width: int = 21


class Verdicts(NamedTuple):
    """Verdicts on a child."""

    kept: int = 0
    rejected_edge: int = 1  # its edge is not clear
    visited: int = 2  # a kept node lies in the same cell
    outside: int = 3  # it lies outside the workspace
    goal_edge: int = 4  # it sees the path again


class OptionColumns(NamedTuple):
    """Columns of the options, see `repet.RepetSettings`."""

    step: int = 0  # [m]
    levels: int = 1
    beam: int = 2
    world_basis: int = 3  # 1: basis "world"
    square: int = 4
    goal_cost: int = 5  # 1: cost "goal"
    spread: int = 6  # 1: orientation "spread"
    turn: int = 7  # angle of a turn [rad]; 0 unless the orientation is "turn"
    random: int = 8
    away: int = 9
    nodes: int = 10
    bias: int = 11  # (3)
    lowest: int = 14  # (3) lowest corner of the workspace [m]
    highest: int = 17  # (3) its highest corner [m]
    pull_back: int = 20
    cell: int = 21
    largest_margin: int = 22  # of all obstacles [m]; `packed` writes `distance`, the user the largest of the scene
    shell: int = 23  # [m]
    rounds: int = 24
    retries: int = 25
    grow: int = 26
    shrink: int = 27
    on_shell: int = 28  # 1: trigger "shell"
    spacing: int = 29  # path length [m]
    shortcut: int = 30
    candidates: int = 31
    guided: int = 32  # number of last poses of the path that the object is guided along, without a detour; -1: none
    width: int = 33


class HeapColumns(NamedTuple):
    """Columns of the heap of open leaves."""

    cost: int = 0
    row: int = 1  # of the node
    used: int = 2  # in the last rows, one per level: number of leaves of the level that were expanded
    width: int = 3


class DetourLogColumns(NamedTuple):
    """Columns of the log of detours, one row per detour."""

    tree_rows: int = 0  # rows of its tree
    first: int = 1  # index of its first pose in the path
    last: int = 2  # index of its last pose
    width: int = 3


class GrowthColumns(NamedTuple):
    """State of a tree that grows, and of the detours of a path: what it takes to go on after a pause."""

    rows: int = 0  # rows of the tree in use
    open: int = 1  # open leaves in its heap
    growing: int = 2  # 1 while a tree grows, 0 before the next detour
    detour: int = 3  # number of detours so far
    count: int = 4  # poses of the path
    certain: int = 5  # index of the pose up to which it is proven clear
    root: int = 6  # index of the pose in which the tree is rooted
    candidates: int = 7  # number of poses at which the detour may rejoin the path
    attempt: int = 8  # number of trees before this one
    full: int = 9  # 1 if one of them had no room for more nodes
    width: int = 10


NODE, VERDICT, OPTION, HEAP = NodeColumns(), Verdicts(), OptionColumns(), HeapColumns()
DETOUR_LOG, GROWTH = DetourLogColumns(), GrowthColumns()


def tree_arrays(most: int, levels: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return empty arrays for a tree: its nodes, the table of visited cells, the heap.

    Args:
        most: largest number of nodes.
        levels: largest number of levels.
    """
    heap = np.zeros((most + levels + 1, HEAP.width))
    return np.zeros((most, NODE.width)), np.full(CELLS, -1.0), heap
