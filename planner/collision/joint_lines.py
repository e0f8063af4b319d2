"""Compiled certificates of straight lines in joint space: the whole robot is proven clear all along, or refused."""

from __future__ import annotations

from ..geometry.shapes import OBSTACLE
from ..jit import inlined, inner, kernel
from .capsule_placement import may_touch, place_capsules
from .clearance import all_beyond, capsule_distance, hull_distance, obstacle_distance, slack_at
from .hull_distance import asks_hull, asks_hulls, pair_hull_distance
from .robot_arrays import CAPSULE, HEADER, PAIR, PLACED, ROW
from .step_certificates import bound_motion

SMALLEST = 1e-4
"""Length [m] below which a stretch that cannot be proven counts as blocked."""


@inner
def _clear_stretch(g):
    """Fraction of a step, up to 1, that is proven clear from ROW.placed on; -1 if the robot is too close already."""
    stretch, longest = 1.0, 0.0
    for c in range(int(g[ROW.header, HEADER.capsules])):
        longest = max(longest, g[ROW.placed + c, PLACED.reach] + g[ROW.placed + c, PLACED.swing])
    for k in range(int(g[ROW.header, HEADER.obstacles])):
        margin = g[ROW.obstacles + k, OBSTACLE.margin]
        if all_beyond(g, ROW.placed, k, 0.0, margin + stretch * longest):
            continue
        for c in range(int(g[ROW.header, HEADER.capsules])):
            if g[ROW.body + c, CAPSULE.frame] >= 0.0 and not may_touch(g, k, c):
                displacement = g[ROW.placed + c, PLACED.reach]
                slack = obstacle_distance(g, ROW.placed, c, k, 0.0, margin + stretch * displacement) - margin
                if slack >= stretch * displacement:
                    continue
                part = _share(slack, displacement)
                if asks_hull(g, c, slack):
                    displacement += g[ROW.placed + c, PLACED.swing]
                    slack = hull_distance(g, ROW.placed, c, k, 0.0, margin + stretch * displacement) - margin
                    part = max(part, _share(slack, displacement))
                if part < 0.0:
                    return -1.0
                stretch = min(stretch, part)
    first = int(g[ROW.header, HEADER.first_pair])
    for p in range(first, first + int(g[ROW.header, HEADER.pairs])):
        i, j, margin = int(g[p, PAIR.first]), int(g[p, PAIR.second]), g[p, PAIR.margin]
        displacement = g[ROW.placed + i, PLACED.reach] + g[ROW.placed + j, PLACED.reach]
        slack = capsule_distance(g, ROW.placed, i, j) - margin
        if slack >= stretch * displacement:
            continue
        part = _share(slack, displacement)
        if asks_hulls(g, i, j, slack):
            displacement += g[ROW.placed + i, PLACED.swing] + g[ROW.placed + j, PLACED.swing]
            slack = pair_hull_distance(g, ROW.placed, i, j, margin + stretch * displacement)[0] - margin
            part = max(part, _share(slack, displacement))
        if part < 0.0:
            return -1.0
        stretch = min(stretch, part)
    return stretch


@inlined
def _share(slack, displacement):
    """Share of a displacement that a slack covers; negative without slack."""
    if slack < 0.0:
        return -1.0
    return slack / displacement if displacement > 0.0 else 1.0


@kernel
def joint_edge_is_clear(g, start, end):
    """Return whether the robot is proven clear on the straight line in joint space, both ends included.

    Args:
        g: the robot among obstacles, see `robot_arrays`; changed.
        start: (n,) joints.
        end: (n,) joints.
    """
    n, part, at = len(start), g[ROW.part], g[ROW.after]
    for s in (1.0, 0.5, 0.25, 0.75):  # a blocked edge is mostly refused at once
        for i in range(n):
            at[i] = start[i] + s * (end[i] - start[i])
        if slack_at(g, at[:n], 0.0, 0.1) < 0.0:
            return False
    s = 0.0
    for _ in range(1000):
        g[ROW.header, HEADER.proofs] += 1.0
        for i in range(n):
            at[i] = start[i] + s * (end[i] - start[i])
            part[i] = (1.0 - s) * (end[i] - start[i])
        place_capsules(g, at[:n], ROW.placed)
        bound_motion(g, ROW.placed, part)
        stretch = _clear_stretch(g)
        if stretch < 0.0:
            return False
        if stretch >= 1.0:
            return True
        displacement = 0.0
        for c in range(int(g[ROW.header, HEADER.capsules])):
            displacement = max(displacement, g[ROW.placed + c, PLACED.reach])
        if stretch * displacement < SMALLEST:
            return False
        s += stretch * (1.0 - s)
    return False
