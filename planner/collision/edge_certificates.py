"""Compiled certificates of a tool's motion between poses: nothing is sampled, every edge is proven clear or refused.

The tool is everything that moves with the tcp: hand, fingers and held objects, as capsules. Its packed array (see
`robot_arrays`) is that of a robot without joints whose capsules all sit in frame 0.

- A *slide* keeps the orientation. The distance of two convex bodies is then a convex function of the displacement, so
  the plane that separates them at one place proves how far the next stretch is clear.
- A *screw* turns as well. A point of the tool moves at a constant speed along it, so the slack at one place, divided
  by that speed, proves the next stretch (conservative advancement).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import check_capacity
from ..geometry import screw
from ..geometry.shapes import OBSTACLE, Packed, pack
from ..jit import inlined, inner, kernel
from ..robot.body import MAX_CAPSULES, Hull
from ..robot.kinematics import FRAME
from .capsule_placement import end_a, end_b, may_touch, place_frames
from .clearance import all_beyond, find_near, hull_distance, min_slack, obstacle_distance
from .hull_distance import asks_hull, obstacle_hull_distance
from .proximity import closest
from .robot_arrays import (
    CAPSULE,
    HEADER,
    NEAR_PAIR,
    PLACED,
    ROW,
    lay_capsules,
    robot_arrays,
    with_hulls,
    with_obstacles,
)

SMALLEST = 1e-4
"""Length [m] below which a stretch that cannot be proven counts as blocked."""


def tool_arrays(
    capsules: np.ndarray,
    packed: Packed,
    *,
    hulls: Sequence[Hull | None] = (),
    masks: Sequence[int] = (),
    margin: float = 0.0,
) -> np.ndarray:
    """Return the packed array of a tool among obstacles.

    Args:
        capsules: (m, 7), see `Body.tool`.
        packed: the obstacles.
        hulls: (m,) of the capsules, see `Body.tool_hulls`; (): none.
        masks: per obstacle the capsules of the tool that may touch it, as bits of a number.
        margin: distance [m] to keep from obstacles without a margin of their own.
    """
    check_capacity("capsules", len(capsules), MAX_CAPSULES)
    work = with_hulls(robot_arrays((), (), pack(())), hulls)
    work[ROW.header, HEADER.capsules] = len(capsules)
    lay_capsules(work[ROW.body : ROW.body + len(capsules)], capsules)
    return with_obstacles(work, packed, masks, margin)


def pose_tool(work: np.ndarray, position: ArrayLike, rotation: ArrayLike) -> None:
    """Write the pose of a tool into its array; `place_frames` places the capsules there.

    Args:
        work: array of the tool, see `tool_arrays`.
        position: (3,) of the tcp in the world [m].
        rotation: (4,) unit quaternion wxyz.
    """
    work[ROW.frames, FRAME.origin : FRAME.rotation] = position
    work[ROW.frames, FRAME.rotation : FRAME.width] = rotation


@inlined
def place_tool(g, x, world):
    """Place the tool's capsules at a pose.

    Args:
        g: array of the tool, see `tool_arrays`.
        x: pose of the tcp, a tuple of 8.
        world: first row of the result: ROW.placed or ROW.placed_next.
    """
    p = screw.translation(x)
    for k in range(3):
        g[ROW.frames, FRAME.origin + k] = p[k]
    for k in range(4):
        g[ROW.frames, FRAME.rotation + k] = x[k]
    place_frames(g, world)


@kernel
def tool_slack(g, x, cutoff):
    """Return the smallest slack [m] of the tool at a pose, at most the cutoff.

    Args:
        g: array of the tool, see `tool_arrays`.
        x: pose of the tcp, a tuple of 8.
        cutoff: slack [m].
    """
    place_tool(g, x, ROW.placed_next)
    return min_slack(g, ROW.placed_next, 0.0, cutoff)


@inlined
def _moved(p, shift):
    return (p[0] + shift[0], p[1] + shift[1], p[2] + shift[2])


@inner
def _sliding_distance(g, c, k, shift, hull):
    """Distance [m] of capsule c, or of its hull, from obstacle k after a shift, and the normal there."""
    if hull:
        distance, n, _ = obstacle_hull_distance(g, ROW.placed, c, k, shift, math.inf)
        return distance, n
    a, b = end_a(g, ROW.placed + c), end_b(g, ROW.placed + c)
    distance, _, n = closest(g, ROW.obstacles + k, g, _moved(a, shift), _moved(b, shift))
    return distance - g[ROW.body + c, CAPSULE.radius], n


@inner
def _pair_slides_clear(g, c, k, delta, margin, s, hull):
    """True if capsule c, or its hull, keeps its margin from obstacle k on a slide from fraction s on."""
    length = math.sqrt(delta[0] * delta[0] + delta[1] * delta[1] + delta[2] * delta[2])
    for _ in range(64):
        distance, n = _sliding_distance(g, c, k, (s * delta[0], s * delta[1], s * delta[2]), hull)
        slack = distance - margin
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
    """Return True if the tool slides clear from where it is placed.

    Args:
        g: array of the tool, see `tool_arrays`; placed at ROW.placed, its near pairs found within the slide's length.
        delta: (3,) displacement [m].
    """
    first, k = int(g[ROW.header, HEADER.first_near]), NEAR_PAIR.normal
    for row in range(first, first + int(g[ROW.header, HEADER.near])):
        margin = g[row, NEAR_PAIR.margin]
        slack = g[row, NEAR_PAIR.distance] - margin
        slope = g[row, k] * delta[0] + g[row, k + 1] * delta[1] + g[row, k + 2] * delta[2]
        if slack < 0.0:
            return False
        if slope >= 0.0 or slack + slope >= 0.0:
            continue
        c, obstacle = int(g[row, NEAR_PAIR.capsule]), int(g[row, NEAR_PAIR.other])
        s = -slack / slope
        if _pair_slides_clear(g, c, obstacle, delta, margin, s, False):
            continue
        hull = g[ROW.body + c, CAPSULE.corners] > 0.0
        if not (hull and _pair_slides_clear(g, c, obstacle, delta, margin, s, True)):
            return False
    return True


@kernel
def point_speeds(g, twist):
    """Compute the largest speed of a point of each capsule's core along a screw, into the column PLACED.reach.

    Points of a hull may be faster by PLACED.swing.

    Args:
        g: array of the tool, see `tool_arrays`.
        twist: body twist (v, omega) of the screw, 6 numbers [m, rad].

    Returns:
        The largest speed of all [m per screw].
    """
    fastest = 0.0
    v, w = (twist[0], twist[1], twist[2]), (twist[3], twist[4], twist[5])
    for c in range(int(g[ROW.header, HEADER.capsules])):
        speed, row = 0.0, ROW.body + c
        for end in (CAPSULE.a, CAPSULE.b):
            u = screw.cross(w, (g[row, end], g[row, end + 1], g[row, end + 2]))
            x, y, z = v[0] + u[0], v[1] + u[1], v[2] + u[2]
            speed = max(speed, math.sqrt(x * x + y * y + z * z))
        g[ROW.placed + c, PLACED.reach] = speed
        if g[row, CAPSULE.corners] > 0.0:
            # no point of what the capsule covers is farther from the core than the radius
            swing = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]) * g[row, CAPSULE.radius]
            g[ROW.placed + c, PLACED.swing] = swing
            speed += swing
        fastest = max(fastest, speed)
    return fastest


@kernel
def longest_displacement(g, x, y):
    """Return the longest displacement [m] of any point of a core or hull of the tool along the screw between two poses.

    Args:
        g: array of the tool, see `tool_arrays`.
        x: pose of the tcp at the start, a tuple of 8.
        y: pose at the end.
    """
    return point_speeds(g, screw.twist_of(screw.mul(screw.conj(x), y)))


@inner
def _stretch(g, left, fastest):
    """Fraction of the screw that is proven clear from the tool at ROW.placed_next on; -1 if it is too close already."""
    stretch = left
    for k in range(int(g[ROW.header, HEADER.obstacles])):
        margin = g[ROW.obstacles + k, OBSTACLE.margin]
        if all_beyond(g, ROW.placed_next, k, 0.0, margin + stretch * fastest):
            continue
        for c in range(int(g[ROW.header, HEADER.capsules])):
            speed = g[ROW.placed + c, PLACED.reach]
            if not may_touch(g, k, c):
                slack = obstacle_distance(g, ROW.placed_next, c, k, 0.0, margin + stretch * speed) - margin
                if slack >= stretch * speed:
                    continue
                part = slack / speed if speed > 0.0 else -1.0
                if asks_hull(g, c, slack):
                    speed += g[ROW.placed + c, PLACED.swing]
                    slack = hull_distance(g, ROW.placed_next, c, k, 0.0, margin + stretch * speed) - margin
                    part = max(part, slack / speed if speed > 0.0 else slack)
                if part < 0.0:
                    return -1.0
                stretch = min(stretch, part)
    return stretch


@kernel
def screw_is_clear(g, x, y):
    """Return True if the tool keeps clear along the shorter screw between two poses, ends included.

    Args:
        g: array of the tool, see `tool_arrays`.
        x: pose of the tcp at the start, a tuple of 8.
        y: pose at the end.
    """
    twist = screw.twist_of(screw.mul(screw.conj(x), y))
    for s in (0.5, 0.25, 0.75):  # a blocked screw is mostly refused at once
        if tool_slack(g, screw.mul(x, screw.from_twist(screw.scaled(twist, s))), 0.0) < 0.0:
            return False
    fastest, s = point_speeds(g, twist), 0.0
    for _ in range(2000):
        place_tool(g, screw.mul(x, screw.from_twist(screw.scaled(twist, s))), ROW.placed_next)
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
    """Return True if the tool moves clear from a pose where it is placed to another.

    Args:
        g: array of the tool, see `tool_arrays`; placed at ROW.placed, its near pairs found.
        x: pose of the tcp there, a tuple of 8.
        y: pose at the end.
    """
    if x[0] == y[0] and x[1] == y[1] and x[2] == y[2] and x[3] == y[3]:
        p, q = screw.translation(x), screw.translation(y)
        return slide_is_clear(g, (q[0] - p[0], q[1] - p[1], q[2] - p[2]))
    return screw_is_clear(g, x, y)


@kernel
def is_clear(g, x, y, widest):
    """Return True if the tool moves clear between two poses.

    Args:
        g: array of the tool, see `tool_arrays`.
        x: pose of the tcp at the start, a tuple of 8.
        y: pose at the end.
        widest: largest margin [m] of all obstacles.
    """
    place_tool(g, x, ROW.placed)
    find_near(g, screw.pose_distance(x, y)[0] + widest)
    return edge_is_clear(g, x, y)
