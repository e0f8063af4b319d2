"""Compiled growth of an escape tree: poses in planes that touch obstacles, until one sees the way home.

From a root near an obstacle a plane is laid through the tool, perpendicular to the line to the obstacle's closest
point. Sliding in it cannot bring the tool closer to that obstacle (method reference section 4, supporting-plane
lemma). The best leaf gets a plane of its own and children in it, unless it sees the way home: a clear screw to a
pose of the path behind the obstacle. Every edge is proven clear. Paper: section III-C and algorithm 2, whose
printed form starts again from the root for each leaf and never grows.

A row of the tree: pose (8), parent, level, verdict, length of the way so far [m], score, normal (3), direction u (3) of
the plane laid at it (v = normal x u), room [m], 1 if it has been expanded.
"""

from __future__ import annotations

import math

import numpy as np

from ..collision.clearance import GAP, KEEP, NORMAL, find_near
from ..collision.edge_certificates import edge_is_clear, place_tool, screw_is_clear, slide_is_clear, tool_slack
from ..collision.robot_arrays import HEADER, N_NEAR, NEAR, WORLD
from ..geometry import screw
from ..jit import inlined, inner, kernel
from .heap import pop, push
from .tangent_plane import SIDES, child_direction, plane_basis

PARENT, LEVEL, VERDICT, LENGTH, SCORE, NORMAL_AT, U_AT, ROOM, EXPANDED, TREE_WIDTH = (
    8,
    9,
    10,
    11,
    12,
    13,
    16,
    19,
    20,
    21,
)
KEPT, REJECTED_EDGE, VISITED, OUTSIDE, GOAL_EDGE = 0, 1, 2, 3, 4
"""Verdicts on a child: kept; its edge is not clear; a kept one is there already; outside the workspace; it sees the
path again."""
CELLS = 8192
"""Size of the table of visited cells, a power of two."""

STEP, LEVELS, BEAM, WORLD_BASIS, SQUARE, GOAL_COST, SPREAD, TURN, RANDOM, AWAY, MOST = range(11)
BIAS, LOWEST, HIGHEST, PULL, CELL, WIDEST, SHELL, ROUNDS, RETRIES, GROW, SHRINK = (
    11,
    14,
    17,
    20,
    21,
    22,
    23,
    24,
    25,
    26,
    27,
)
ON_SHELL, SPACING, SHORTCUT, CANDIDATES, OPTIONS = 28, 29, 30, 31, 32
"""Columns of the settings, see `repet.RepetSettings`."""


@inlined
def _shifted(x, delta):
    """The pose moved by a world vector, turned by nothing."""
    p = screw.translation(x)
    return screw.from_pose((p[0] + delta[0], p[1] + delta[1], p[2] + delta[2]), (x[0], x[1], x[2], x[3]))


@inlined
def _attitude_key(tree, x):
    """A number for the orientation of a pose as seen from the root, the same for nearly the same ones."""
    r = screw.qmul((tree[0, 0], -tree[0, 1], -tree[0, 2], -tree[0, 3]), (x[0], x[1], x[2], x[3]))
    sign = 1.0 if r[0] >= 0.0 else -1.0
    key = 17
    for value in (sign * r[1], sign * r[2], sign * r[3]):
        key = key * 31 + math.floor(5.0 * value + 0.5) + 8
    return key


@inlined
def _visited(p, attitude, size, cells):
    """True if a kept pose lies in the same cell as the position p with its attitude; else the cell is marked."""
    # the middle of a cell at the root: whole steps from it lie inside cells, not on their edges
    x, y, z = math.floor(p[0] / size + 0.5), math.floor(p[1] / size + 0.5), math.floor(p[2] / size + 0.5)
    number = ((x * 73856093) ^ (y * 19349663) ^ (z * 83492791) ^ (attitude * 2654435761)) & 0x7FFFFFFF
    slot, key = number & (len(cells) - 1), float(number)
    for _ in range(len(cells)):
        if cells[slot] == key:
            return True
        if cells[slot] < 0.0:
            cells[slot] = key
            return False
        slot = (slot + 1) & (len(cells) - 1)
    return True


@inlined
def _outside(p, options):
    outside = False
    for k in range(3):
        outside |= p[k] < options[LOWEST + k] or p[k] > options[HIGHEST + k]
    return outside


@inlined
def lay_plane(g, tree, row, towards, options, step):
    """Find the obstacle closest to a node and lay the plane through it; the tool is left at WORLD, near pairs found."""
    x = screw.load8(tree, row)
    place_tool(g, x, WORLD)
    least, normal = math.inf, (0.0, 0.0, 1.0)
    longest = step * max(2.0, math.sqrt(2.0 + options[AWAY] * options[AWAY]))  # of a random child's way
    for widening in (1.0, 4.0, 1e6):
        find_near(g, widening * longest + options[WIDEST])
        first = int(g[HEADER, NEAR])
        for k in range(first, first + int(g[HEADER, N_NEAR])):
            if g[k, GAP] - g[k, KEEP] < least:
                least = g[k, GAP] - g[k, KEEP]
                normal = (g[k, NORMAL], g[k, NORMAL + 1], g[k, NORMAL + 2])
        if least < math.inf:
            break
    u, v = plane_basis(normal, towards, options[WORLD_BASIS])
    for k in range(3):
        tree[row, NORMAL_AT + k], tree[row, U_AT + k] = normal[k], u[k]
    tree[row, ROOM], tree[row, EXPANDED] = least, 1.0
    return normal, u, v


@inlined
def _add_node(tree, row, x, parent, verdict, length, score):
    screw.store8(tree, row, x)
    tree[row, PARENT], tree[row, VERDICT] = parent, verdict
    tree[row, LEVEL] = tree[parent, LEVEL] + 1.0 if parent >= 0 else 0.0
    tree[row, LENGTH], tree[row, SCORE] = length, score
    for k in range(NORMAL_AT, TREE_WIDTH):
        tree[row, k] = 0.0


@inner
def _turned(x, axis, angle):
    """The pose turned about its own origin by an angle about a world axis."""
    s, c = math.sin(0.5 * angle), math.cos(0.5 * angle)
    r = screw.qmul((c, s * axis[0], s * axis[1], s * axis[2]), (x[0], x[1], x[2], x[3]))
    return screw.from_pose(screw.translation(x), r)


@inlined
def _from_root(tree):
    """What turns world points into the root's frame, so that the cells turn with the problem: turn and position."""
    x = screw.load8(tree, 0)
    return (x[0], -x[1], -x[2], -x[3]), screw.translation(x)


@inlined
def _judge(tree, row, count, y, p, clear, distance, home, goal, cells, options, step, attitude, from_root):
    """Append a child at pose y, position p, with the verdict on it."""
    verdict, (turn, q) = KEPT, from_root
    if _outside(p, options):
        verdict = OUTSIDE
    elif not clear:
        verdict = REJECTED_EDGE
    elif _visited(screw.rotate(turn, (p[0] - q[0], p[1] - q[1], p[2] - q[2])), attitude, options[CELL] * step, cells):
        verdict = VISITED
    length = tree[row, LENGTH] + distance
    cost = home + (0.0 if options[GOAL_COST] == 1.0 else length)
    for k in range(3):
        cost -= options[BIAS + k] * (p[k] - goal[k])
    _add_node(tree, count, y, row, verdict, length, cost)


@inner
def _add_slides(g, tree, row, count, x, plane, goal, cells, options, step, state):
    """Children that keep their parent's orientation, and so all that hangs on it; the new number of rows."""
    normal, u, v = plane
    p, q, attitude = screw.translation(x), screw.translation(goal), _attitude_key(tree, x)
    turn, r, from_root, slack = (
        0.2 * screw.pose_distance(x, goal)[1],
        (x[0], x[1], x[2], x[3]),
        _from_root(tree),
        tree[row, ROOM],
    )
    for k in range(SIDES + int(options[RANDOM])):
        if count >= len(tree):
            break
        d = child_direction(k, normal, u, v, options[SQUARE], options[AWAY], state)
        delta = (step * d[0], step * d[1], step * d[2])
        end = (p[0] + delta[0], p[1] + delta[1], p[2] + delta[2])
        distance = math.sqrt(delta[0] * delta[0] + delta[1] * delta[1] + delta[2] * delta[2])
        x_, y_, z_ = q[0] - end[0], q[1] - end[1], q[2] - end[2]
        home = math.sqrt(x_ * x_ + y_ * y_ + z_ * z_ + turn * turn)
        clear = distance < slack or slide_is_clear(g, delta)
        y = screw.from_pose(end, r)
        _judge(tree, row, count, y, end, clear, distance, home, q, cells, options, step, attitude, from_root)
        count += 1
    return count


@inner
def _add_others(g, tree, row, count, x, plane, goal, cells, options, step, state):
    """Children that turn on the way home, are pulled back to the shell, or turn where they are and go straight on."""
    normal, u, v = plane
    q, moves = screw.translation(goal), SIDES + int(options[RANDOM])
    first, from_root = 0 if options[SPREAD] == 1.0 or options[PULL] == 1.0 else moves, _from_root(tree)
    for k in range(first, moves + (7 if options[TURN] > 0.0 else 0)):
        if count >= len(tree):
            break
        if k == moves + 6:
            y = _towards(x, q, step)
        elif k >= moves:
            y = _turned(x, (normal, u, v)[(k - moves) // 2], options[TURN] if k % 2 == 0 else -options[TURN])
        else:
            d = child_direction(k, normal, u, v, options[SQUARE], options[AWAY], state)
            y = _shifted(x, (step * d[0], step * d[1], step * d[2]))
            if options[SPREAD] == 1.0:
                y = _turned_home(x, y, goal, step)
            elif k < SIDES:
                y = _pulled(g, x, y, normal, options)
        distance, angle = screw.pose_distance(x, y)
        home, left = screw.pose_distance(y, goal)
        clear = edge_is_clear(g, x, y)
        _judge(tree, row, count, y, screw.translation(y), clear, math.hypot(distance, 0.2 * angle),
               math.hypot(home, 0.2 * left), q, cells, options, step, _attitude_key(tree, y), from_root)  # fmt: skip
        count += 1
    return count


@inner
def _towards(x, q, step):
    """The pose a step straight towards a point: once it is turned, a tool may pass where no plane leads."""
    p = screw.translation(x)
    d = (q[0] - p[0], q[1] - p[1], q[2] - p[2])
    part = step / max(math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]), step)
    return _shifted(x, (part * d[0], part * d[1], part * d[2]))


@inner
def _turned_home(x, y, goal, step):
    """The pose y with the orientation on the screw from x to the goal, in proportion to the way made."""
    home = screw.pose_distance(x, goal)[0]
    part = screw.sclerp(x, goal, min(1.0, step / max(home + step, 1e-9)))
    return screw.from_pose(screw.translation(y), (part[0], part[1], part[2], part[3]))


@inner
def _pulled(g, x, y, normal, options):
    """The child y brought back towards the obstacle of its parent's plane, to the shell."""
    excess = tool_slack(g, y, 10.0) - (options[SHELL] - options[WIDEST])
    if excess <= 0.0:
        return y
    back = min(excess, 0.5 * screw.pose_distance(x, y)[0])
    return _shifted(y, (-back * normal[0], -back * normal[1], -back * normal[2]))


@kernel
def expand(g, tree, row, count, goal, cells, options, step, state):
    """Give a node its children; returns the new number of rows of the tree."""
    x, towards = screw.load8(tree, row), screw.translation(goal)
    p = screw.translation(x)
    plane = lay_plane(g, tree, row, (towards[0] - p[0], towards[1] - p[1], towards[2] - p[2]), options, step)
    if options[SPREAD] != 1.0 and options[PULL] != 1.0:
        count = _add_slides(g, tree, row, count, x, plane, goal, cells, options, step, state)
    if options[SPREAD] == 1.0 or options[PULL] == 1.0 or options[TURN] > 0.0:
        count = _add_others(g, tree, row, count, x, plane, goal, cells, options, step, state)
    return count


@inner
def _seen(g, x, candidates):
    """The first candidate pose with a clear screw from x to it; -1 if there is none."""
    for j in range(len(candidates)):
        if screw_is_clear(g, x, screw.load8(candidates, j)):
            return j
    return -1


@kernel
def grow(g, root, candidates, tree, cells, heap, options, step, state):
    """Grow a tree from a root pose (8,) until a node sees one of the candidate poses (m, 8).

    The cheapest open leaf is taken next, at most BEAM per level; what it costs is a lower bound of what it can lead
    to, so the first that sees a candidate is the cheapest of this tree.

    Returns:
        (row, candidate, count): the node that sees a candidate, or (-1, -1), and the number of rows of the tree.
    """
    for k in range(len(cells)):
        cells[k] = -1.0
    goal, used = screw.load8(candidates, 0), heap[len(heap) - 1 - int(options[LEVELS]) :, 2]
    for k in range(len(used)):
        used[k] = 0.0
    x = (root[0], root[1], root[2], root[3], root[4], root[5], root[6], root[7])
    home, turn = screw.pose_distance(x, goal)
    _add_node(tree, 0, x, -1, KEPT, 0.0, math.hypot(home, 0.2 * turn))
    _visited((0.0, 0.0, 0.0), _attitude_key(tree, x), options[CELL] * step, cells)
    count, size = 1, push(heap, 0, tree[0, SCORE], 0)
    while size > 0 and count < min(len(tree), int(options[MOST])):
        row = pop(heap, size)
        size -= 1
        level = int(tree[row, LEVEL])
        if used[level] >= options[BEAM]:
            continue
        used[level] += 1.0
        j = _seen(g, screw.load8(tree, row), candidates)
        if j >= 0:
            tree[row, VERDICT] = GOAL_EDGE
            return row, j, count
        if level < int(options[LEVELS]):
            end = expand(g, tree, row, count, goal, cells, options, step, state)
            for k in range(count, end):
                if tree[k, VERDICT] == KEPT:
                    size = push(heap, size, tree[k, SCORE], k)
            count = end
    return -1, -1, count


def tree_arrays(most: int, levels: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Room for a tree of so many rows: the tree, the visited cells, the open leaves."""
    return np.zeros((most, TREE_WIDTH)), np.full(CELLS, -1.0), np.zeros((most + levels + 1, 3))
