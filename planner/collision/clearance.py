"""Compiled clearances of a robot: which pairs are close, and how close.

A pair is a capsule of the robot with an obstacle, or with another capsule. Its *slack* is its distance less its
margin. Near pairs are rows of the packed array, see `robot_arrays.NEAR_PAIR`.
"""

from __future__ import annotations

from ..geometry.shapes import OBSTACLE
from ..jit import inlined, inner, kernel
from .capsule_placement import end_a, end_b, may_touch, place_capsules
from .hull_distance import asks_hull, asks_hulls, obstacle_hull_distance, pair_hull_distance
from .proximity import FAR, between_segments, closest, distance, is_beyond
from .robot_arrays import ARM_ENTRY, CAPSULE, HEADER, NEAR_PAIR, PAIR, PLACED, ROW


@inlined
def shifted(g, k, p, seconds):
    """Return a world point as obstacle k will see it after some seconds: less the obstacle's own displacement.

    Args:
        g: array of the robot, see `robot_arrays`.
        k: number of the obstacle.
        p: (3,) point [m].
        seconds: time from now [s].
    """
    o, v = ROW.obstacles + k, OBSTACLE.velocity
    return (p[0] - seconds * g[o, v], p[1] - seconds * g[o, v + 1], p[2] - seconds * g[o, v + 2])


@inlined
def capsule_beyond(g, world, c, k, seconds, cutoff):
    """Return True if a capsule surely is farther from an obstacle than the cutoff, judged by balls about both.

    Args:
        g: array of the robot, see `robot_arrays`.
        world: first row of the placed capsules.
        c: number of the capsule.
        k: number of the obstacle.
        seconds: time from now [s].
        cutoff: distance [m].
    """
    row, m = world + c, PLACED.center
    center = shifted(g, k, (g[row, m], g[row, m + 1], g[row, m + 2]), seconds)
    return is_beyond(g, ROW.obstacles + k, center, cutoff + g[ROW.body + c, CAPSULE.ball])


@inlined
def obstacle_distance(g, world, c, k, seconds, cutoff):
    """Return the distance [m] of a capsule from an obstacle, or FAR if it surely exceeds the cutoff.

    Args:
        g: array of the robot, see `robot_arrays`.
        world: first row of the placed capsules.
        c: number of the capsule.
        k: number of the obstacle.
        seconds: time from now [s].
        cutoff: distance [m].
    """
    if capsule_beyond(g, world, c, k, seconds, cutoff):
        return FAR
    a, b = shifted(g, k, end_a(g, world + c), seconds), shifted(g, k, end_b(g, world + c), seconds)
    return distance(g, ROW.obstacles + k, g, a, b) - g[ROW.body + c, CAPSULE.radius]


@inner
def hull_distance(g, world, c, k, seconds, cutoff):
    """Return the distance [m] of a capsule's hull from an obstacle; beyond the cutoff a lower bound.

    Args:
        g: array of the robot, see `robot_arrays`.
        world: first row of the placed capsules.
        c: number of the capsule; it has a hull.
        k: number of the obstacle.
        seconds: time from now [s].
        cutoff: distance [m].
    """
    return obstacle_hull_distance(g, world, c, k, shifted(g, k, (0.0, 0.0, 0.0), seconds), cutoff)[0]


@inlined
def all_beyond(g, world, k, seconds, cutoff):
    """Return True if all capsules that move surely are farther from an obstacle than the cutoff.

    Args:
        g: array of the robot, see `robot_arrays`.
        world: first row of the placed capsules.
        k: number of the obstacle.
        seconds: time from now [s].
        cutoff: distance [m].
    """
    m = PLACED.all_center
    center = shifted(g, k, (g[world, m], g[world, m + 1], g[world, m + 2]), seconds)
    return is_beyond(g, ROW.obstacles + k, center, cutoff + g[world, PLACED.all_radius])


@inlined
def capsule_distance(g, world, i, j):
    """Return the distance [m] between two capsules of the robot.

    Args:
        g: array of the robot, see `robot_arrays`.
        world: first row of the placed capsules.
        i: number of one capsule.
        j: number of the other.
    """
    length = between_segments(end_a(g, world + i), end_b(g, world + i), end_a(g, world + j), end_b(g, world + j))[0]
    return length - g[ROW.body + i, CAPSULE.radius] - g[ROW.body + j, CAPSULE.radius]


@kernel
def min_slack(g, world, seconds, cutoff):
    """Return the smallest slack [m] of all pairs, at most the cutoff.

    Args:
        g: array of the robot, see `robot_arrays`.
        world: first row of the placed capsules.
        seconds: time from now [s].
        cutoff: slack [m].
    """
    least = cutoff
    for k in range(int(g[ROW.header, HEADER.obstacles])):
        margin = g[ROW.obstacles + k, OBSTACLE.margin]
        if all_beyond(g, world, k, seconds, least + margin):
            continue
        for c in range(int(g[ROW.header, HEADER.capsules])):
            if g[ROW.body + c, CAPSULE.frame] >= 0.0 and not may_touch(g, k, c):
                slack = obstacle_distance(g, world, c, k, seconds, least + margin) - margin
                if slack < least and asks_hull(g, c, slack):
                    slack = max(slack, hull_distance(g, world, c, k, seconds, least + margin) - margin)
                least = min(least, slack)
    first = int(g[ROW.header, HEADER.first_pair])
    for p in range(first, first + int(g[ROW.header, HEADER.pairs])):
        i, j, margin = int(g[p, PAIR.first]), int(g[p, PAIR.second]), g[p, PAIR.margin]
        slack = capsule_distance(g, world, i, j) - margin
        if slack < least and asks_hulls(g, i, j, slack):
            slack = max(slack, pair_hull_distance(g, world, i, j, least + margin)[0] - margin)
        least = min(least, slack)
    return least


@kernel
def slack_at(g, q, seconds, cutoff):
    """Return the smallest slack [m] of the robot at joints q, at most the cutoff.

    Args:
        g: array of the robot, see `robot_arrays`.
        q: (n,) joints of all arms.
        seconds: time from now [s].
        cutoff: slack [m].
    """
    place_capsules(g, q, ROW.placed_next)
    return min_slack(g, ROW.placed_next, seconds, cutoff)


@inner
def _note(g, row, self_pair, i, j, distance, margin, normal, t, s):
    g[row, NEAR_PAIR.self_pair], g[row, NEAR_PAIR.capsule], g[row, NEAR_PAIR.other] = self_pair, i, j
    g[row, NEAR_PAIR.distance], g[row, NEAR_PAIR.margin] = distance, margin
    for k in range(3):
        g[row, NEAR_PAIR.normal + k] = normal[k]
    g[row, NEAR_PAIR.t], g[row, NEAR_PAIR.s], g[row, NEAR_PAIR.exact] = t, s, 0.0


@inner
def _note_hulls(g, row, distance, normal, p, q):
    """Put the closest points of the hulls in place of those of the capsules."""
    g[row, NEAR_PAIR.distance], g[row, NEAR_PAIR.exact] = distance, 1.0
    for k in range(3):
        g[row, NEAR_PAIR.normal + k] = normal[k]
        g[row, NEAR_PAIR.point + k], g[row, NEAR_PAIR.other_point + k] = p[k], q[k]


@kernel
def find_near(g, shell):
    """Collect the pairs with a distance below the shell and return their smallest slack [m].

    Args:
        g: array of the robot, see `robot_arrays`; its capsules are placed at ROW.placed.
        shell: distance [m].
    """
    first, least = int(g[ROW.header, HEADER.first_near]), FAR
    row = first
    for k in range(int(g[ROW.header, HEADER.obstacles])):
        if all_beyond(g, ROW.placed, k, 0.0, shell):
            continue
        margin = g[ROW.obstacles + k, OBSTACLE.margin]
        for c in range(int(g[ROW.header, HEADER.capsules])):
            if g[ROW.body + c, CAPSULE.frame] < 0.0 or may_touch(g, k, c):
                continue
            if capsule_beyond(g, ROW.placed, c, k, 0.0, shell):
                continue
            a, b = end_a(g, ROW.placed + c), end_b(g, ROW.placed + c)
            distance, t, normal = closest(g, ROW.obstacles + k, g, a, b)
            distance -= g[ROW.body + c, CAPSULE.radius]
            if distance > shell:
                continue
            _note(g, row, 0.0, c, k, distance, margin, normal, t, 0.0)
            if asks_hull(g, c, distance - margin):
                further, normal, p = obstacle_hull_distance(g, ROW.placed, c, k, (0.0, 0.0, 0.0), shell)
                if further > shell:
                    continue
                if further > distance:
                    distance = further
                    _note_hulls(g, row, distance, normal, p, p)
            least, row = min(least, distance - margin), row + 1
    pair = int(g[ROW.header, HEADER.first_pair])
    for p in range(pair, pair + int(g[ROW.header, HEADER.pairs])):
        i, j, margin = int(g[p, PAIR.first]), int(g[p, PAIR.second]), g[p, PAIR.margin]
        one, other = ROW.placed + i, ROW.placed + j
        distance, t, s, normal = between_segments(end_a(g, one), end_b(g, one), end_a(g, other), end_b(g, other))
        distance -= g[ROW.body + i, CAPSULE.radius] + g[ROW.body + j, CAPSULE.radius]
        if distance > shell:
            continue
        _note(g, row, 1.0, i, j, distance, margin, normal, t, s)
        if asks_hulls(g, i, j, distance - margin):
            further, normal, p, q = pair_hull_distance(g, ROW.placed, i, j, shell)
            if further > shell:
                continue
            if further > distance:
                distance = further
                _note_hulls(g, row, distance, normal, p, q)
        least, row = min(least, distance - margin), row + 1
    g[ROW.header, HEADER.near] = row - first
    return least


@kernel
def first_joint(g, c):
    """Return the first joint of the arm that capsule c belongs to.

    Args:
        g: array of the robot, see `robot_arrays`.
        c: number of the capsule.
    """
    return int(g[ROW.arms, ARM_ENTRY.width * int(g[ROW.body + c, CAPSULE.arm]) + ARM_ENTRY.first_joint])
