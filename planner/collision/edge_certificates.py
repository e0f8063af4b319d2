"""Compiled certificates of a tool's motion between poses: nothing is sampled, every edge is proven clear or not.

The tool is all that moves with the tcp: hand, fingers and what they hold, as capsules. In a work array (see
`robot_arrays`) it is a robot without joints whose capsules all sit in frame 0.

- A *slide* keeps the orientation. The distance of two convex bodies is then a convex function of the way, so the
  plane that separates them at one place proves how far the next stretch is clear.
- A *screw* turns as well. A point of the tool moves at a constant speed along it, so the room left at one place,
  divided by that speed, proves the next stretch (conservative advancement).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..geometry import screw
from ..geometry.shapes import Packed, pack
from ..jit import inlined, inner, kernel
from .clearance import FIRST, GAP, KEEP, NORMAL, OTHER, all_beyond, find_near, min_slack, obstacle_distance
from .proximity import closest
from .robot_arrays import (
    B_A,
    B_B,
    B_RADIUS,
    BODY,
    FRAMES,
    HEADER,
    MARGIN,
    N_CAPSULES,
    N_NEAR,
    N_OBSTACLES,
    NEAR,
    NEXT,
    OBSTACLES,
    W_REACH,
    WORLD,
    end_a,
    end_b,
    lay_capsules,
    may_touch,
    place_frames,
    robot_arrays,
    with_obstacles,
)

SMALLEST = 1e-4
"""Way [m] below which a stretch that cannot be proven is held to be blocked."""


def tool_arrays(capsules: np.ndarray, packed: Packed, *, masks: Sequence[int] = (), margin: float = 0.0) -> np.ndarray:
    """The work array of a tool among obstacles.

    Args:
        capsules: (m, 7), see `Body.tool`.
        packed: the obstacles.
        masks: per obstacle the capsules of the tool that may touch it, as bits of a number.
        margin: distance [m] to keep from obstacles without one of their own.
    """
    work = robot_arrays((), (), pack(()))
    work[HEADER, N_CAPSULES] = len(capsules)
    lay_capsules(work[BODY : BODY + len(capsules)], capsules)
    return with_obstacles(work, packed, masks, margin)


@inlined
def place_tool(g, x, world):
    """The tool's capsules at the pose x (a tuple of 8) into the rows from `world` on."""
    p = screw.translation(x)
    for k in range(3):
        g[FRAMES, 3 + k] = p[k]
    for k in range(4):
        g[FRAMES, 6 + k] = x[k]
    place_frames(g, world)


@kernel
def tool_slack(g, x, cutoff):
    """Smallest room [m] of the tool at a pose; at most the cutoff."""
    place_tool(g, x, NEXT)
    return min_slack(g, NEXT, 0.0, cutoff)


@inlined
def _moved(p, delta, s):
    return (p[0] + s * delta[0], p[1] + s * delta[1], p[2] + s * delta[2])


@inner
def _pair_slides_clear(g, c, k, delta, margin, s):
    """True if capsule c, placed at WORLD, keeps its distance from obstacle k on a slide from fraction s on."""
    a, b, radius = end_a(g, WORLD + c), end_b(g, WORLD + c), g[BODY + c, B_RADIUS]
    length = math.sqrt(delta[0] * delta[0] + delta[1] * delta[1] + delta[2] * delta[2])
    for _ in range(64):
        distance, _, n = closest(g, OBSTACLES + k, g, _moved(a, delta, s), _moved(b, delta, s))
        slack = distance - radius - margin
        if slack < 0.0:
            return False
        slope = n[0] * delta[0] + n[1] * delta[1] + n[2] * delta[2]
        if slope >= 0.0 or s - slack / slope >= 1.0:
            return True
        if -slack / slope * length < SMALLEST:
            return False
        s -= slack / slope
    return False


@inlined
def slide_is_clear(g, delta):
    """True if the tool, placed at WORLD with its near pairs found within the slide's length, slides clear."""
    first = int(g[HEADER, NEAR])
    for row in range(first, first + int(g[HEADER, N_NEAR])):
        slack = g[row, GAP] - g[row, KEEP]
        slope = g[row, NORMAL] * delta[0] + g[row, NORMAL + 1] * delta[1] + g[row, NORMAL + 2] * delta[2]
        if slack < 0.0:
            return False
        if slope >= 0.0 or slack + slope >= 0.0:
            continue
        c, k = int(g[row, FIRST]), int(g[row, OTHER])
        if not _pair_slides_clear(g, c, k, delta, g[row, KEEP], -slack / slope):
            return False
    return True


@kernel
def point_speeds(g, twist):
    """Largest speed [m] of a point of each capsule along a screw of this body twist, into column W_REACH."""
    fastest = 0.0
    v, w = (twist[0], twist[1], twist[2]), (twist[3], twist[4], twist[5])
    for c in range(int(g[HEADER, N_CAPSULES])):
        speed = 0.0
        for end in (B_A, B_B):
            u = screw.cross(w, (g[BODY + c, end], g[BODY + c, end + 1], g[BODY + c, end + 2]))
            x, y, z = v[0] + u[0], v[1] + u[1], v[2] + u[2]
            speed = max(speed, math.sqrt(x * x + y * y + z * z))
        g[WORLD + c, W_REACH] = speed
        fastest = max(fastest, speed)
    return fastest


@kernel
def longest_displacement(g, x, y):
    """Longest way [m] of any point of the tool along the screw from pose x to pose y."""
    return point_speeds(g, screw.twist_of(screw.mul(screw.conj(x), y)))


@inner
def _stretch(g, left, fastest):
    """Fraction of the screw that is proven clear from the tool at NEXT on; -1 if it is too close already."""
    stretch = left
    for k in range(int(g[HEADER, N_OBSTACLES])):
        margin = g[OBSTACLES + k, MARGIN]
        if all_beyond(g, NEXT, k, 0.0, margin + stretch * fastest):
            continue
        for c in range(int(g[HEADER, N_CAPSULES])):
            speed = g[WORLD + c, W_REACH]
            if not may_touch(g, k, c):
                slack = obstacle_distance(g, NEXT, c, k, 0.0, margin + stretch * speed) - margin
                if slack < 0.0:
                    return -1.0
                if slack < stretch * speed:
                    stretch = slack / speed
    return stretch


@kernel
def screw_is_clear(g, x, y):
    """True if the tool keeps clear along the screw from pose x to pose y, the shorter way round, ends included."""
    twist = screw.twist_of(screw.mul(screw.conj(x), y))
    for s in (0.5, 0.25, 0.75):  # what is blocked is mostly seen at once
        if tool_slack(g, screw.mul(x, screw.from_twist(screw.scaled(twist, s))), 0.0) < 0.0:
            return False
    fastest, s = point_speeds(g, twist), 0.0
    for _ in range(2000):
        place_tool(g, screw.mul(x, screw.from_twist(screw.scaled(twist, s))), NEXT)
        stretch = _stretch(g, 1.0 - s, fastest)
        if stretch < 0.0:
            return False
        s += stretch
        if s >= 1.0:
            return tool_slack(g, y, 0.0) >= 0.0
        if stretch * fastest < SMALLEST:
            return False
    return False


@kernel
def edge_is_clear(g, x, y):
    """True if the tool moves clear from x, where it is placed at WORLD with its near pairs found, to y."""
    if x[0] == y[0] and x[1] == y[1] and x[2] == y[2] and x[3] == y[3]:
        p, q = screw.translation(x), screw.translation(y)
        return slide_is_clear(g, (q[0] - p[0], q[1] - p[1], q[2] - p[2]))
    return screw_is_clear(g, x, y)


@kernel
def is_clear(g, x, y, widest):
    """True if the tool moves clear from pose x to pose y; `widest` is the largest distance to keep [m]."""
    place_tool(g, x, WORLD)
    find_near(g, screw.pose_distance(x, y)[0] + widest)
    return edge_is_clear(g, x, y)
