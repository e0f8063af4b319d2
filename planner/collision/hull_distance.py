"""Compiled distances of the convex hulls in a robot's capsules, asked for where a capsule alone is close.

A capsule is wider than what it covers. What it covers lies in its hull too, so the larger of the two distances holds
for it; both are lower bounds. Not in the paper, which moves a point.
"""

from __future__ import annotations

import math

from ..geometry.convex_distance import HULL, convex_distance, farthest_along
from ..geometry.shapes import OBSTACLE, SHAPE_KIND
from ..jit import inlined, inner, kernel
from .capsule_placement import end_a, end_b
from .robot_arrays import CAPSULE, HEADER, PLACED, ROW

CLOSE = 0.02
"""Slack [m] of a capsule below which its hull is asked: the distances of hulls are exact up to this slack."""
NONE = -1e30
"""Distance of hulls that touch: then the capsules' distance counts, which is negative."""


@inlined
def asks_hull(g, c, slack):
    """Return True if a capsule is so close that its hull decides.

    Args:
        g: array of the robot, see `robot_arrays`.
        c: number of the capsule.
        slack: of the capsule [m].
    """
    return slack < CLOSE and g[ROW.body + c, CAPSULE.corners] > 0.0


@inlined
def asks_hulls(g, i, j, slack):
    """Return True if two capsules are so close that a hull decides.

    Args:
        g: array of the robot, see `robot_arrays`.
        i: number of one capsule.
        j: number of the other.
        slack: of the capsules [m].
    """
    return slack < CLOSE and (g[ROW.body + i, CAPSULE.corners] > 0.0 or g[ROW.body + j, CAPSULE.corners] > 0.0)


@inner
def _corners(g, c):
    """Row of the first corner, and number of corners, of a capsule's hull."""
    body = ROW.body + c
    return int(g[ROW.header, HEADER.first_corner] + g[body, CAPSULE.first_corner]), int(g[body, CAPSULE.corners])


@inner
def _origin(g, row):
    return (g[row, PLACED.origin], g[row, PLACED.origin + 1], g[row, PLACED.origin + 2])


@inner
def _turn(g, row):
    """Rotation of a placed capsule's frame, a tuple of 9, row by row."""
    r = PLACED.rotation
    w, x, y, z = g[row, r], g[row, r + 1], g[row, r + 2], g[row, r + 3]
    return (
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
        2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x),
        2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y),
    )  # fmt: skip


@inner
def _from_core(g, first, count, turn, place, row, cutoff):
    """Distance, normal and point of a hull against the core of a placed capsule."""
    a, b = end_a(g, row), end_b(g, row)
    x, y, z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    length = math.sqrt(x * x + y * y + z * z)
    scale = 1.0 / length if length > 0.0 else 0.0
    along = (0.0, 0.0, scale * x, 0.0, 0.0, scale * y, 0.0, 0.0, scale * z)
    middle = (0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2]))
    half = (0.0, 0.0, 0.5 * length)
    return convex_distance(g, first, count, turn, place, SHAPE_KIND.capsule, half, 0, 0, along, middle, cutoff)


@kernel
def obstacle_hull_distance(g, world, c, k, shift, cutoff):
    """Compute the distance of a capsule's hull from an obstacle.

    Args:
        g: array of the robot, see `robot_arrays`.
        world: first row of the placed capsules.
        c: number of the capsule; it has a hull.
        k: number of the obstacle.
        shift: (3,) displacement of the hull before the query [m].
        cutoff: distance [m] beyond which a lower bound suffices.

    Returns:
        (distance, normal, point): proven distance [m], `NONE` if the two touch; unit normal (3) from the obstacle to
        the hull; closest point (3) of the hull, displaced, in the world.
    """
    o, r, row = ROW.obstacles + k, OBSTACLE.rotation, world + c
    first, count = _corners(g, c)
    place = _origin(g, row)
    place = (place[0] + shift[0], place[1] + shift[1], place[2] + shift[2])
    half = (g[o, OBSTACLE.half_extents], g[o, OBSTACLE.half_extents + 1], g[o, OBSTACLE.half_extents + 2])
    turn = (
        g[o, r], g[o, r + 1], g[o, r + 2], g[o, r + 3], g[o, r + 4], g[o, r + 5], g[o, r + 6], g[o, r + 7], g[o, r + 8],
    )  # fmt: skip
    center = (g[o, OBSTACLE.center], g[o, OBSTACLE.center + 1], g[o, OBSTACLE.center + 2])
    vertex, vertices = int(g[o, OBSTACLE.first_vertex]), int(g[o, OBSTACLE.vertices])
    rounding = g[ROW.body + c, CAPSULE.rounding]
    less = rounding + g[o, OBSTACLE.rounding]
    core, normal, p = convex_distance(
        g, first, count, _turn(g, row), place, g[o, OBSTACLE.kind], half, vertex, vertices, turn, center, cutoff + less
    )
    point = (p[0] - rounding * normal[0], p[1] - rounding * normal[1], p[2] - rounding * normal[2])
    return (core - less if core > 0.0 else NONE), normal, point


@inner
def _from_hull(g, world, i, j, cutoff):
    """Distance, normal and points of two capsules, of which the first has a hull; see `pair_hull_distance`."""
    first, count = _corners(g, i)
    turn, place = _turn(g, world + i), _origin(g, world + i)
    rounding = g[ROW.body + i, CAPSULE.rounding]
    if g[ROW.body + j, CAPSULE.corners] == 0.0:
        less = rounding + g[ROW.body + j, CAPSULE.radius]
        core, n, p = _from_core(g, first, count, turn, place, world + j, cutoff + less)
    else:
        less = rounding + g[ROW.body + j, CAPSULE.rounding]
        other_first, other_count = _corners(g, j)
        core, n, p = convex_distance(
            g, first, count, turn, place, HULL, (0.0, 0.0, 0.0),
            other_first, other_count, _turn(g, world + j), _origin(g, world + j), cutoff + less,
        )  # fmt: skip
    point = (p[0] - rounding * n[0], p[1] - rounding * n[1], p[2] - rounding * n[2])
    beyond = core - less
    other_point = (point[0] - beyond * n[0], point[1] - beyond * n[1], point[2] - beyond * n[2])
    return (beyond if core > 0.0 else NONE), n, point, other_point


@kernel
def pair_hull_distance(g, world, i, j, cutoff):
    """Compute the distance of two capsules' hulls; a capsule without a hull counts itself.

    Args:
        g: array of the robot, see `robot_arrays`.
        world: first row of the placed capsules.
        i: number of one capsule.
        j: number of the other; one of the two has a hull.
        cutoff: distance [m] beyond which a lower bound suffices.

    Returns:
        (distance, normal, point, other point): proven distance [m], `NONE` if the two touch; unit normal (3) from the
        other to the first; closest points (3) in the world.
    """
    if g[ROW.body + i, CAPSULE.corners] == 0.0:
        distance, n, other_point, point = _from_hull(g, world, j, i, cutoff)
        return distance, (-n[0], -n[1], -n[2]), point, other_point
    return _from_hull(g, world, i, j, cutoff)


@inner
def farthest_against(g, world, c, normal):
    """Return the coordinate [m] along a normal of the point of what a capsule covers that lies farthest against it.

    Roundings are left out, as the distance of hulls and cores takes them off.

    Args:
        g: array of the robot, see `robot_arrays`.
        world: first row of the placed capsules.
        c: number of the capsule.
        normal: (3,) unit.
    """
    row = world + c
    if g[ROW.body + c, CAPSULE.corners] > 0.0:
        first, count = _corners(g, c)
        back = (-normal[0], -normal[1], -normal[2])
        return -farthest_along(g, first, count, _turn(g, row), _origin(g, row), back)
    a, b = end_a(g, row), end_b(g, row)
    return min(
        normal[0] * a[0] + normal[1] * a[1] + normal[2] * a[2], normal[0] * b[0] + normal[1] * b[1] + normal[2] * b[2]
    )
