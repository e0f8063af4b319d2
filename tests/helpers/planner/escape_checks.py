"""Measures of a path round obstacles and of the tree that found it."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from helpers.random_scenes import Gauge, at

from onedemo.planner.escape.repet import (
    VERDICTS,
    EscapeTree,
    RepetSettings,
    point_tool,
)
from onedemo.planner.geometry import dualquat as dq
from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.imitation.tsia import screw_path

DEFAULTS = RepetSettings()
FINE = 5e-4
"""Steps of the dense checks: no point of the tool moves more than this [m] between two looks."""
KEPT, EDGE, VISITED, OUTSIDE, HOME = range(len(VERDICTS))


def reach_of(tool: np.ndarray) -> float:
    """Radius [m] of the ball about the tcp that holds a tool."""
    return float((np.linalg.norm(tool[:, :6].reshape(-1, 2, 3), axis=2).max(axis=1) + tool[:, 6]).max())


def between(x: Pose, y: Pose, tool: np.ndarray) -> np.ndarray:
    """Poses on the screw from x to y so near to each other that no point of the tool moves farther than `FINE`."""
    gap, angle = x.distance_to(y)
    # on the short screw the tcp's way is at most a quarter longer than (pi / 2 of) the straight line at half a turn
    count = math.ceil((0.5 * math.pi * gap + angle * reach_of(tool)) / FINE) + 1
    return dq.sclerp(x.dq, y.dq, np.linspace(0.0, 1.0, count + 1))


def least_gap(path: PosePath, tool: np.ndarray, obstacles, keep: float) -> float:
    """Smallest distance [m] of a tool on a path, by fcl every half millimeter.

    A look at distance D says all of the next (D - keep) meters, which are passed over; so a value above `keep` is a
    bound only.
    """
    gauge = Gauge(tool, obstacles)
    least, ahead = gauge(path[-1]), 0
    for x, y in pairwise(path):
        poses = between(x, y, tool)
        while ahead < len(poses):
            gap = gauge(Pose(poses[ahead]))
            least = min(least, gap)
            if gap < keep - 1e-3:
                return least
            ahead += max(1, int((gap - keep) / FINE))
        ahead -= len(poses)
    return least


def shortest(path: PosePath) -> float:
    return float(path.lengths()[-1])


def kept_rows(tree: EscapeTree) -> np.ndarray:
    return np.flatnonzero((tree.verdicts == KEPT) | (tree.verdicts == HOME))


BALL = point_tool(0.02)
ALONG = screw_path(at([-0.3, 0.0, 0.0]), at([0.3, 0.0, 0.0]), 0.01)
