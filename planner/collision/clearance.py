"""Compiled clearances of a robot: which pairs are close, and whether a step stays clear, also between its ends.

A pair is a capsule of the robot with an obstacle, or with another capsule. Its *room* is its distance less what it
must keep. A row of a near pair holds, from column 0 on: kind (0 obstacle, 1 capsule), capsule, obstacle or other
capsule, distance [m], distance to keep [m], unit normal (3) from the other to the capsule, parameter of the closest
point on the capsule, and on the other capsule.
"""

from __future__ import annotations

import math

from ..geometry import screw
from ..jit import inlined, inner, kernel
from .proximity import FAR, between_segments, closest, distance, is_beyond
from .robot_arrays import (
    AFTER,
    ARMS,
    B_BALL,
    B_FRAME,
    B_RADIUS,
    BEFORE,
    BODY,
    FRAMES,
    HEADER,
    MARGIN,
    N_CAPSULES,
    N_NEAR,
    N_OBSTACLES,
    N_PAIRS,
    NEAR,
    NEXT,
    OBSTACLES,
    PAIRS,
    PART,
    SETTINGS,
    SLIDING,
    W_ALL,
    W_CENTER,
    W_REACH,
    WORLD,
    end_a,
    end_b,
    may_touch,
    place_capsules,
)

KIND, FIRST, OTHER, GAP, KEEP, NORMAL, T, S = 0, 1, 2, 3, 4, 5, 8, 9
SELF_MARGIN = 10
"""Column of SETTINGS: distance [m] to keep between capsules of the robot."""
CREEP_TOLERANCE = 1e-4
"""What a pair that is closer than it should be may come closer still [m], so that it can get away at all."""
REFINEMENTS = 5
"""A step is looked at in up to 2^5 parts before it is held not to be clear."""


@inlined
def shifted(g, k, p, seconds):
    """World point as obstacle k will see it after some seconds: less the obstacle's own way."""
    o = OBSTACLES + k
    return (p[0] - seconds * g[o, 17], p[1] - seconds * g[o, 18], p[2] - seconds * g[o, 19])


@inlined
def capsule_beyond(g, world, c, k, seconds, cutoff):
    """True if capsule c surely is farther from obstacle k than the cutoff, after some seconds: by balls about both."""
    row = world + c
    center = shifted(g, k, (g[row, W_CENTER], g[row, W_CENTER + 1], g[row, W_CENTER + 2]), seconds)
    return is_beyond(g, OBSTACLES + k, center, cutoff + g[BODY + c, B_BALL])


@inlined
def obstacle_distance(g, world, c, k, seconds, cutoff):
    """Distance [m] of capsule c, at the rows from `world` on, from obstacle k after some seconds.

    FAR instead if it is surely more than the cutoff.
    """
    if capsule_beyond(g, world, c, k, seconds, cutoff):
        return FAR
    a, b = shifted(g, k, end_a(g, world + c), seconds), shifted(g, k, end_b(g, world + c), seconds)
    return distance(g, OBSTACLES + k, g, a, b) - g[BODY + c, B_RADIUS]


@inlined
def all_beyond(g, world, k, seconds, cutoff):
    """True if all capsules that move surely are farther from obstacle k than the cutoff, after some seconds."""
    center = shifted(g, k, (g[world, W_ALL], g[world, W_ALL + 1], g[world, W_ALL + 2]), seconds)
    return is_beyond(g, OBSTACLES + k, center, cutoff + g[world, W_ALL + 3])


@inlined
def capsule_distance(g, world, i, j):
    """Distance [m] between two capsules of the robot."""
    length = between_segments(end_a(g, world + i), end_b(g, world + i), end_a(g, world + j), end_b(g, world + j))[0]
    return length - g[BODY + i, B_RADIUS] - g[BODY + j, B_RADIUS]


@kernel
def min_slack(g, world, seconds, cutoff):
    """Smallest room [m] of all pairs with the capsules at the rows from `world` on; at most the cutoff."""
    least = cutoff
    for k in range(int(g[HEADER, N_OBSTACLES])):
        margin = g[OBSTACLES + k, MARGIN]
        if all_beyond(g, world, k, seconds, least + margin):
            continue
        for c in range(int(g[HEADER, N_CAPSULES])):
            if g[BODY + c, B_FRAME] >= 0.0 and not may_touch(g, k, c):
                least = min(least, obstacle_distance(g, world, c, k, seconds, least + margin) - margin)
    first = int(g[HEADER, PAIRS])
    for p in range(first, first + int(g[HEADER, N_PAIRS])):
        least = min(least, capsule_distance(g, world, int(g[p, 0]), int(g[p, 1])) - g[SETTINGS, SELF_MARGIN])
    return least


@kernel
def slack_at(g, q, seconds, cutoff):
    """Smallest room [m] of the robot at joints q after some seconds; at most the cutoff."""
    place_capsules(g, q, NEXT)
    return min_slack(g, NEXT, seconds, cutoff)


@inner
def _note(g, row, kind, i, j, distance, margin, normal, t, s):
    g[row, KIND], g[row, FIRST], g[row, OTHER], g[row, GAP], g[row, KEEP] = kind, i, j, distance, margin
    for k in range(3):
        g[row, NORMAL + k] = normal[k]
    g[row, T], g[row, S] = t, s


@kernel
def find_near(g, shell):
    """Collect the pairs with a distance below the shell, capsules placed at WORLD; returns the smallest room."""
    row, first, least = int(g[HEADER, NEAR]), int(g[HEADER, NEAR]), FAR
    for k in range(int(g[HEADER, N_OBSTACLES])):
        if all_beyond(g, WORLD, k, 0.0, shell):
            continue
        for c in range(int(g[HEADER, N_CAPSULES])):
            if g[BODY + c, B_FRAME] < 0.0 or may_touch(g, k, c):
                continue
            if capsule_beyond(g, WORLD, c, k, 0.0, shell):
                continue
            distance, t, normal = closest(g, OBSTACLES + k, g, end_a(g, WORLD + c), end_b(g, WORLD + c))
            distance -= g[BODY + c, B_RADIUS]
            if distance > shell:
                continue
            _note(g, row, 0.0, c, k, distance, g[OBSTACLES + k, MARGIN], normal, t, 0.0)
            least, row = min(least, distance - g[OBSTACLES + k, MARGIN]), row + 1
    pair = int(g[HEADER, PAIRS])
    for p in range(pair, pair + int(g[HEADER, N_PAIRS])):
        i, j = int(g[p, 0]), int(g[p, 1])
        distance, t, s, normal = between_segments(
            end_a(g, WORLD + i), end_b(g, WORLD + i), end_a(g, WORLD + j), end_b(g, WORLD + j)
        )
        distance -= g[BODY + i, B_RADIUS] + g[BODY + j, B_RADIUS]
        if distance <= shell:
            _note(g, row, 1.0, i, j, distance, g[SETTINGS, SELF_MARGIN], normal, t, s)
            least, row = min(least, distance - g[SETTINGS, SELF_MARGIN]), row + 1
    g[HEADER, N_NEAR] = row - first
    return least


@inlined
def _lever_square(g, joint, p):
    """Squared distance [m^2] of a world point from the axis of a joint that turns."""
    f = FRAMES + joint
    axis = (g[f, 0], g[f, 1], g[f, 2])
    arm = screw.cross(axis, (p[0] - g[f, 3], p[1] - g[f, 4], p[2] - g[f, 5]))
    return arm[0] * arm[0] + arm[1] * arm[1] + arm[2] * arm[2]


@kernel
def bound_motion(g, world, step):
    """Longest way [m] of any point of each capsule during a joint step, into column W_REACH of its world row.

    A joint moves a point by its angle times the point's distance from the axis, and only joints after it change
    that distance. So the bound builds up from the capsule's own joint to the base. The frames belong to the
    start of the step. Not in the paper.
    """
    for c in range(int(g[HEADER, N_CAPSULES])):
        frame, displacement = int(g[BODY + c, B_FRAME]), 0.0
        first = first_joint(g, c)
        a, b = end_a(g, world + c), end_b(g, world + c)
        for joint in range(frame, first - 1, -1):
            if step[joint] != 0.0:
                if g[SLIDING, joint] == 1.0:
                    displacement += abs(step[joint])
                else:
                    square = max(_lever_square(g, joint, a), _lever_square(g, joint, b))
                    displacement += abs(step[joint]) * (math.sqrt(square) + displacement)
        g[world + c, W_REACH] = displacement


@kernel
def first_joint(g, c):
    """First joint of the arm that capsule c belongs to."""
    return int(g[ARMS, 3 * int(g[BODY + c, 0])])


@inner
def _farthest_against(g, world, c, normal):
    """The end of capsule c that lies farthest against the normal: its coordinate along the normal."""
    a, b = end_a(g, world + c), end_b(g, world + c)
    return min(
        normal[0] * a[0] + normal[1] * a[1] + normal[2] * a[2], normal[0] * b[0] + normal[1] * b[1] + normal[2] * b[2]
    )


@inner
def _look(g, row, world, seconds):
    """Distance and normal of a near pair with the capsules at the rows from `world` on, after some seconds."""
    i, j = int(g[row, FIRST]), int(g[row, OTHER])
    a, b = end_a(g, world + i), end_b(g, world + i)
    if g[row, KIND] == 1.0:
        length, _, _, normal = between_segments(a, b, end_a(g, world + j), end_b(g, world + j))
        return length - g[BODY + i, B_RADIUS] - g[BODY + j, B_RADIUS], normal
    distance, _, normal = closest(g, OBSTACLES + j, g, shifted(g, j, a, seconds), shifted(g, j, b, seconds))
    return distance - g[BODY + i, B_RADIUS], normal


@inner
def _other_displacement(g, row, start, end, normal, dt):
    """How far the other of a pair comes towards the capsule along the normal between two placements [m]."""
    j = int(g[row, OTHER])
    if g[row, KIND] == 1.0:
        back = (-normal[0], -normal[1], -normal[2])
        return _farthest_against(g, start, j, back) - _farthest_against(g, end, j, back)
    o = OBSTACLES + j
    return dt * (g[o, 17] * normal[0] + g[o, 18] * normal[1] + g[o, 19] * normal[2])


@inner
def _pair_stays_clear(g, row, margin, turning, start, dt):
    """True if a near pair surely keeps its distance while WORLD moves to NEXT, `start` to `start + dt` from now.

    Either the two distances are larger than the way in between (Lipschitz), or a plane that separates the pair at
    one end does so at the other too, less what the path of a capsule's end bends away from its chord:
    an eighth of its second derivative, which is at most twice the turning, of all joints together, times the way.
    Not in the paper.
    """
    i, j = int(g[row, FIRST]), int(g[row, OTHER])
    displacement, other = g[WORLD + i, W_REACH], 0.0
    if g[row, KIND] == 1.0:
        displacement += g[WORLD + j, W_REACH]
    else:
        o = OBSTACLES + j
        other = dt * math.sqrt(g[o, 17] ** 2 + g[o, 18] ** 2 + g[o, 19] ** 2)
    distance, normal = _look(g, row, WORLD, start)
    distance_end, normal_end = _look(g, row, NEXT, start + dt)
    if distance_end < margin or distance < margin:
        return False
    if distance + distance_end - displacement - other >= 2.0 * margin:
        return True
    bend = 0.25 * turning * displacement
    forth = _farthest_against(g, NEXT, i, normal) - _farthest_against(g, WORLD, i, normal)
    if min(distance, distance + forth - _other_displacement(g, row, WORLD, NEXT, normal, dt)) - bend >= margin:
        return True
    back = _farthest_against(g, WORLD, i, normal_end) - _farthest_against(g, NEXT, i, normal_end)
    return (
        min(distance_end, distance_end + back - _other_displacement(g, row, NEXT, WORLD, normal_end, -dt)) - bend
        >= margin
    )


@inner
def _part_is_clear(g, q, step, start, dt):
    """True if all near pairs stay clear during a part of a step; leaves the capsules at its end in NEXT."""
    place_capsules(g, q, WORLD)
    bound_motion(g, WORLD, step)
    for i in range(len(q)):
        g[AFTER, i] = q[i] + step[i]
    place_capsules(g, g[AFTER, : len(q)], NEXT)
    return placed_step_stays_clear(g, step, start, dt)


@kernel
def placed_step_stays_clear(g, step, start, dt):
    """True if all near pairs stay clear from WORLD to NEXT, where they are placed, their ways bound."""
    turning = 0.0
    for i in range(len(step)):
        turning += abs(step[i]) if g[SLIDING, i] == 0.0 else 0.0
    first = int(g[HEADER, NEAR])
    for row in range(first, first + int(g[HEADER, N_NEAR])):
        # a pair that is already closer than wanted may not come closer than a hair
        margin = g[row, KEEP] if g[row, GAP] >= g[row, KEEP] else g[row, GAP] - CREEP_TOLERANCE
        if not _pair_stays_clear(g, row, margin, turning, start, dt):
            return False
    return True


@kernel
def reach_of(g, step, dt):
    """Distance [m] beyond which no pair can come closer than it must keep during the step; capsules at WORLD."""
    bound_motion(g, WORLD, step)
    displacement, fastest, margin = 0.0, 0.0, g[SETTINGS, SELF_MARGIN]
    for c in range(int(g[HEADER, N_CAPSULES])):
        displacement = max(displacement, g[WORLD + c, W_REACH])
    for o in range(OBSTACLES, OBSTACLES + int(g[HEADER, N_OBSTACLES])):
        fastest = max(fastest, math.sqrt(g[o, 17] ** 2 + g[o, 18] ** 2 + g[o, 19] ** 2))
        margin = max(margin, g[o, MARGIN])
    return margin + max(2.0 * displacement, displacement + dt * fastest)


@kernel
def step_stays_clear(g, q, step, dt):
    """True if all near pairs surely keep their distances during a joint step (n,) of dt seconds from q (n,).

    The near pairs are those that `find_near` found at q. The step is looked at as a whole, then in halves, in
    quarters and so on.
    """
    n, part = len(q), g[PART]
    for level in range(REFINEMENTS):
        parts, clear = 2**level, True
        for k in range(parts):
            for i in range(n):
                part[i] = step[i] / parts
                g[BEFORE, i] = q[i] + k * part[i]
            if not _part_is_clear(g, g[BEFORE, :n], part[:n], k * dt / parts, dt / parts):
                clear = False
                break
        if clear:
            return True
    return False


@kernel
def near_pair_slack(g, world, seconds):
    """Smallest room [m] of the near pairs: as found (world < 0), or with the capsules at other rows, later."""
    first, least = int(g[HEADER, NEAR]), math.inf
    for row in range(first, first + int(g[HEADER, N_NEAR])):
        distance = g[row, GAP] if world < 0 else _look(g, row, world, seconds)[0]
        least = min(least, distance - g[row, KEEP])
    return least
