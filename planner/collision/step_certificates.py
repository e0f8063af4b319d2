"""Compiled certificates of a robot's joint steps: whether the near pairs stay clear, also between the ends of a step.

The near pairs are those of `clearance.find_near`, see `robot_arrays.NEAR_PAIR`. Not in the paper.
"""

from __future__ import annotations

import math

from ..geometry import screw
from ..geometry.shapes import OBSTACLE
from ..jit import inlined, inner, kernel
from ..robot.kinematics import FRAME
from .capsule_placement import end_a, end_b, place_capsules
from .clearance import first_joint, shifted
from .hull_distance import asks_hull, asks_hulls, farthest_against, obstacle_hull_distance, pair_hull_distance
from .proximity import between_segments, closest
from .robot_arrays import CAPSULE, HEADER, NEAR_PAIR, PLACED, ROW, SETTING

CREEP_TOLERANCE = 1e-4
"""Distance [m] by which a pair within its margin may come closer still, so that it can separate at all."""
REFINEMENTS = 5
"""A step is checked in up to 2^5 parts before it counts as not clear."""


@inlined
def _lever_square(g, joint, p):
    """Squared distance [m^2] of a world point from the axis of a joint that turns."""
    f, o = ROW.frames + joint, FRAME.origin
    axis = (g[f, FRAME.axis], g[f, FRAME.axis + 1], g[f, FRAME.axis + 2])
    arm = screw.cross(axis, (p[0] - g[f, o], p[1] - g[f, o + 1], p[2] - g[f, o + 2]))
    return arm[0] * arm[0] + arm[1] * arm[1] + arm[2] * arm[2]


@kernel
def bound_motion(g, world, step):
    """Bound the displacement [m] of each capsule's core during a joint step, into the column PLACED.reach.

    Points of a hull may be displaced by PLACED.swing more.

    A joint moves a point by its angle times the point's distance from the axis, and only joints after it change
    that distance. So the bound builds up from the capsule's own joint to the base.

    Args:
        g: array of the robot, see `robot_arrays`; its frames belong to the start of the step.
        world: first row of the placed capsules.
        step: (n,) [rad or m].
    """
    for c in range(int(g[ROW.header, HEADER.capsules])):
        frame, displacement = int(g[ROW.body + c, CAPSULE.frame]), 0.0
        first = first_joint(g, c)
        a, b = end_a(g, world + c), end_b(g, world + c)
        for joint in range(frame, first - 1, -1):
            if step[joint] != 0.0:
                if g[ROW.sliding, joint] == 1.0:
                    displacement += abs(step[joint])
                else:
                    square = max(_lever_square(g, joint, a), _lever_square(g, joint, b))
                    displacement += abs(step[joint]) * (math.sqrt(square) + displacement)
        g[world + c, PLACED.reach] = displacement
        if g[ROW.body + c, CAPSULE.corners] > 0.0:
            turning = 0.0
            for joint in range(first, frame + 1):
                turning += abs(step[joint]) if g[ROW.sliding, joint] == 0.0 else 0.0
            # no point of what the capsule covers is farther from the core than the radius
            g[world + c, PLACED.swing] = turning * g[ROW.body + c, CAPSULE.radius]


@inner
def _farthest(g, world, c, normal, hulls):
    """Coordinate along the normal of the point of capsule c's core, or of its hull, that lies farthest against it."""
    if hulls:
        return farthest_against(g, world, c, normal)
    a, b = end_a(g, world + c), end_b(g, world + c)
    return min(
        normal[0] * a[0] + normal[1] * a[1] + normal[2] * a[2], normal[0] * b[0] + normal[1] * b[1] + normal[2] * b[2]
    )


@inner
def _look(g, row, world, seconds):
    """Distance and normal of a near pair with the capsules at the rows from `world` on, after some seconds."""
    i, j = int(g[row, NEAR_PAIR.capsule]), int(g[row, NEAR_PAIR.other])
    a, b = end_a(g, world + i), end_b(g, world + i)
    if g[row, NEAR_PAIR.self_pair] == 1.0:
        length, _, _, normal = between_segments(a, b, end_a(g, world + j), end_b(g, world + j))
        return length - g[ROW.body + i, CAPSULE.radius] - g[ROW.body + j, CAPSULE.radius], normal
    distance, _, normal = closest(g, ROW.obstacles + j, g, shifted(g, j, a, seconds), shifted(g, j, b, seconds))
    return distance - g[ROW.body + i, CAPSULE.radius], normal


@inner
def _look_at_hulls(g, row, world, seconds):
    """Distance and normal of the hulls of a near pair, as `_look` gives those of the capsules."""
    i, j = int(g[row, NEAR_PAIR.capsule]), int(g[row, NEAR_PAIR.other])
    if g[row, NEAR_PAIR.self_pair] == 1.0:
        distance, normal, _, _ = pair_hull_distance(g, world, i, j, math.inf)
        return distance, normal
    shift = shifted(g, j, (0.0, 0.0, 0.0), seconds)
    distance, normal, _ = obstacle_hull_distance(g, world, i, j, shift, math.inf)
    return distance, normal


@inlined
def _asks_hulls(g, row, slack):
    """True if a near pair is so close that hulls decide."""
    i, j = int(g[row, NEAR_PAIR.capsule]), int(g[row, NEAR_PAIR.other])
    return asks_hulls(g, i, j, slack) if g[row, NEAR_PAIR.self_pair] == 1.0 else asks_hull(g, i, slack)


@inlined
def _speed(g, o):
    """Speed [m/s] of the obstacle in row o."""
    v = OBSTACLE.velocity
    return math.sqrt(g[o, v] ** 2 + g[o, v + 1] ** 2 + g[o, v + 2] ** 2)


@inner
def _other_displacement(g, row, start, end, normal, dt, hulls):
    """Displacement [m] of the other of a pair towards the capsule, along the normal, between two placements."""
    j = int(g[row, NEAR_PAIR.other])
    if g[row, NEAR_PAIR.self_pair] == 1.0:
        back = (-normal[0], -normal[1], -normal[2])
        return _farthest(g, start, j, back, hulls) - _farthest(g, end, j, back, hulls)
    o, v = ROW.obstacles + j, OBSTACLE.velocity
    return dt * (g[o, v] * normal[0] + g[o, v + 1] * normal[1] + g[o, v + 2] * normal[2])


@inlined
def _reach(g, c, hulls):
    """Bound of the displacement [m] of a capsule's core, or of its hull, during the step."""
    return g[ROW.placed + c, PLACED.reach] + (g[ROW.placed + c, PLACED.swing] if hulls else 0.0)


@inner
def _stays_clear(g, row, margin, turning, start, dt, hulls):
    """True if a near pair surely keeps its margin from ROW.placed to ROW.placed_next, `start` to `start + dt` from now.

    Either the two distances exceed the displacement in between (Lipschitz), or a plane that separates the pair at
    one end separates it at the other too, less the bend of the path of a capsule's end away from its chord: an
    eighth of its second derivative, which is at most twice the turning, of all joints together, times the
    displacement. With `hulls` distances and displacements are those of the hulls.
    """
    i, j = int(g[row, NEAR_PAIR.capsule]), int(g[row, NEAR_PAIR.other])
    now, then = ROW.placed, ROW.placed_next
    displacement, other = _reach(g, i, hulls), 0.0
    if g[row, NEAR_PAIR.self_pair] == 1.0:
        displacement += _reach(g, j, hulls)
    else:
        other = dt * _speed(g, ROW.obstacles + j)
    distance, normal = _look_at_hulls(g, row, now, start) if hulls else _look(g, row, now, start)
    distance_end, normal_end = _look_at_hulls(g, row, then, start + dt) if hulls else _look(g, row, then, start + dt)
    if distance_end < margin or distance < margin:
        return False
    if distance + distance_end - displacement - other >= 2.0 * margin:
        return True
    bend = 0.25 * turning * displacement
    forth = _farthest(g, then, i, normal, hulls) - _farthest(g, now, i, normal, hulls)
    if min(distance, distance + forth - _other_displacement(g, row, now, then, normal, dt, hulls)) - bend >= margin:
        return True
    back = _farthest(g, now, i, normal_end, hulls) - _farthest(g, then, i, normal_end, hulls)
    other_back = _other_displacement(g, row, then, now, normal_end, -dt, hulls)
    return min(distance_end, distance_end + back - other_back) - bend >= margin


@inner
def _pair_stays_clear(g, row, margin, turning, start, dt):
    """True if a near pair surely keeps its margin, judged by its capsules or by its hulls."""
    if _stays_clear(g, row, margin, turning, start, dt, False):
        return True
    return _asks_hulls(g, row, -math.inf) and _stays_clear(g, row, margin, turning, start, dt, True)


@inner
def _part_is_clear(g, q, step, start, dt):
    """True if all near pairs stay clear during a part of a step; leaves the capsules at its end in ROW.placed_next."""
    place_capsules(g, q, ROW.placed)
    bound_motion(g, ROW.placed, step)
    for i in range(len(q)):
        g[ROW.after, i] = q[i] + step[i]
    place_capsules(g, g[ROW.after, : len(q)], ROW.placed_next)
    return placed_step_stays_clear(g, step, start, dt)


@kernel
def placed_step_stays_clear(g, step, start, dt):
    """Return True if all near pairs surely stay clear during a step whose capsules are placed.

    Args:
        g: array of the robot, see `robot_arrays`; its capsules are placed at ROW.placed and ROW.placed_next and
            their displacement bounds computed.
        step: (n,) joint step [rad or m].
        start: start of the step, from now [s].
        dt: duration of the step [s].
    """
    turning = 0.0
    for i in range(len(step)):
        turning += abs(step[i]) if g[ROW.sliding, i] == 0.0 else 0.0
    first = int(g[ROW.header, HEADER.first_near])
    for row in range(first, first + int(g[ROW.header, HEADER.near])):
        distance, margin = g[row, NEAR_PAIR.distance], g[row, NEAR_PAIR.margin]
        margin = margin if distance >= margin else distance - CREEP_TOLERANCE
        if not _pair_stays_clear(g, row, margin, turning, start, dt):
            return False
    return True


@kernel
def reach_of(g, step, dt):
    """Return the distance [m] beyond which no pair can come within its margin during a step.

    Args:
        g: array of the robot, see `robot_arrays`; its capsules are placed at ROW.placed.
        step: (n,) joint step [rad or m].
        dt: duration of the step [s].
    """
    bound_motion(g, ROW.placed, step)
    displacement, fastest, margin = 0.0, 0.0, g[ROW.settings, SETTING.self_margin]
    for c in range(int(g[ROW.header, HEADER.capsules])):
        displacement = max(displacement, g[ROW.placed + c, PLACED.reach] + g[ROW.placed + c, PLACED.swing])
    for o in range(ROW.obstacles, ROW.obstacles + int(g[ROW.header, HEADER.obstacles])):
        fastest = max(fastest, _speed(g, o))
        margin = max(margin, g[o, OBSTACLE.margin])
    return margin + max(2.0 * displacement, displacement + dt * fastest)


@kernel
def step_stays_clear(g, q, step, dt):
    """Return True if all near pairs surely keep their margins during a joint step.

    The step is checked as a whole, then in halves, in quarters and so on.

    Args:
        g: array of the robot, see `robot_arrays`; its near pairs were found at q.
        q: (n,) joints at the start.
        step: (n,) joint step [rad or m].
        dt: duration of the step [s].
    """
    n, part = len(q), g[ROW.part]
    for level in range(REFINEMENTS):
        parts, clear = 2**level, True
        for k in range(parts):
            for i in range(n):
                part[i] = step[i] / parts
                g[ROW.before, i] = q[i] + k * part[i]
            if not _part_is_clear(g, g[ROW.before, :n], part[:n], k * dt / parts, dt / parts):
                clear = False
                break
        if clear:
            return True
    return False


@kernel
def near_pair_slack(g, world, seconds):
    """Return the smallest slack [m] of the near pairs; infinite without any.

    Args:
        g: array of the robot, see `robot_arrays`.
        world: first row of the placed capsules; negative: take the distances as found.
        seconds: time from now [s].
    """
    first, least = int(g[ROW.header, HEADER.first_near]), math.inf
    for row in range(first, first + int(g[ROW.header, HEADER.near])):
        distance, margin = g[row, NEAR_PAIR.distance], g[row, NEAR_PAIR.margin]
        if world >= 0:
            distance = _look(g, row, world, seconds)[0]
            if distance - margin < least and _asks_hulls(g, row, distance - margin):
                distance = max(distance, _look_at_hulls(g, row, world, seconds)[0])
        least = min(least, distance - margin)
    return least
