"""Compiled growth of an escape tree: poses in planes that touch obstacles, until one of them sees the path again.

From a root near an obstacle a plane is laid through the tool, perpendicular to the line to the obstacle's closest
point. Sliding in it cannot bring the tool closer to that obstacle (method reference section 4, supporting-plane
lemma). The best leaf gets a plane of its own and children in it, unless it sees the path: a clear screw leads to a
pose of the path behind the obstacle. Every edge is proven clear. Paper: section III-C and algorithm 2, whose printed
form starts again from the root for each leaf and never grows. See `tree_arrays` for the arrays.
"""

from __future__ import annotations

import math

from ..collision.clearance import find_near
from ..collision.edge_certificates import edge_is_clear, place_tool, screw_is_clear, slide_is_clear, tool_slack
from ..collision.robot_arrays import HEADER, NEAR_PAIR, ROW
from ..geometry import screw
from ..jit import inlined, inner, kernel
from .heap import pop, push
from .tangent_plane import SIDES, child_direction, plane_basis
from .tree_arrays import GROWTH, HEAP, NODE, OPTION, VERDICT


@inlined
def _shifted(x, delta):
    """Pose translated by a world vector, with its orientation."""
    p = screw.translation(x)
    return screw.from_pose((p[0] + delta[0], p[1] + delta[1], p[2] + delta[2]), (x[0], x[1], x[2], x[3]))


@inlined
def _attitude_key(tree, x):
    """Number for the orientation of a pose relative to the root, equal for similar orientations."""
    r = screw.qmul((tree[0, 0], -tree[0, 1], -tree[0, 2], -tree[0, 3]), (x[0], x[1], x[2], x[3]))
    sign = 1.0 if r[0] >= 0.0 else -1.0
    key = 17
    for value in (sign * r[1], sign * r[2], sign * r[3]):
        key = key * 31 + math.floor(5.0 * value + 0.5) + 8
    return key


@inlined
def _visited(p, attitude, size, cells):
    """True if a kept pose lies in the cell of position p and its attitude; else the cell is marked."""
    # the root is in the middle of a cell: whole steps from it lie inside cells, not on their edges
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
        outside |= p[k] < options[OPTION.lowest + k] or p[k] > options[OPTION.highest + k]
    return outside


@inlined
def lay_plane(g, tree, row, towards, options, step):
    """Lay a plane through a node, perpendicular to the line to the closest point of the tightest obstacle.

    Args:
        g: the tool among obstacles, see `tool_arrays`; left at the node (ROW.placed), its near pairs found.
        tree: nodes, see `tree_arrays.NODE`; the plane is written into the row.
        row: row of the node.
        towards: (3,) world direction to the pose of the path to reach.
        options: see `tree_arrays.OPTION`.
        step: length of an edge [m].

    Returns:
        (normal, u, v): the unit normal away from the obstacle and two directions in the plane.
    """
    x = screw.load8(tree, row)
    place_tool(g, x, ROW.placed)
    least, normal = math.inf, (0.0, 0.0, 1.0)
    away = options[OPTION.away]
    longest = step * max(2.0, math.sqrt(2.0 + away * away))  # displacement of a random child
    for widening in (1.0, 4.0, 1e6):
        find_near(g, widening * longest + options[OPTION.largest_margin])
        first = int(g[ROW.header, HEADER.first_near])
        for k in range(first, first + int(g[ROW.header, HEADER.near])):
            slack = g[k, NEAR_PAIR.distance] - g[k, NEAR_PAIR.margin]
            if slack < least:
                least = slack
                normal = (g[k, NEAR_PAIR.normal], g[k, NEAR_PAIR.normal + 1], g[k, NEAR_PAIR.normal + 2])
        if least < math.inf:
            break
    u, v = plane_basis(normal, towards, options[OPTION.world_basis])
    for k in range(3):
        tree[row, NODE.normal + k], tree[row, NODE.u + k] = normal[k], u[k]
    tree[row, NODE.slack], tree[row, NODE.expanded] = least, 1.0
    return normal, u, v


@inlined
def _add_node(tree, row, x, parent, verdict, length, score):
    screw.store8(tree, row, x)
    tree[row, NODE.parent], tree[row, NODE.verdict] = parent, verdict
    tree[row, NODE.level] = tree[parent, NODE.level] + 1.0 if parent >= 0 else 0.0
    tree[row, NODE.length], tree[row, NODE.score] = length, score
    for k in range(NODE.normal, NODE.width):
        tree[row, k] = 0.0


@inner
def _turned(x, axis, angle):
    """Pose rotated about its own origin by an angle about a world axis."""
    s, c = math.sin(0.5 * angle), math.cos(0.5 * angle)
    r = screw.qmul((c, s * axis[0], s * axis[1], s * axis[2]), (x[0], x[1], x[2], x[3]))
    return screw.from_pose(screw.translation(x), r)


@inlined
def _from_root(tree):
    """Rotation and position from world points into the root's frame, so that the cells rotate with the problem."""
    x = screw.load8(tree, 0)
    return (x[0], -x[1], -x[2], -x[3]), screw.translation(x)


@inlined
def _judge(tree, row, count, y, p, clear, distance, home, goal, cells, options, step, attitude, from_root):
    """Append a child at pose y, position p, with its verdict."""
    verdict, (turn, q) = VERDICT.kept, from_root
    if _outside(p, options):
        verdict = VERDICT.outside
    elif not clear:
        verdict = VERDICT.rejected_edge
    else:
        place = screw.rotate(turn, (p[0] - q[0], p[1] - q[1], p[2] - q[2]))
        if _visited(place, attitude, options[OPTION.cell] * step, cells):
            verdict = VERDICT.visited
    length = tree[row, NODE.length] + distance
    cost = home + (0.0 if options[OPTION.goal_cost] == 1.0 else length)
    for k in range(3):
        cost -= options[OPTION.bias + k] * (p[k] - goal[k])
    _add_node(tree, count, y, row, verdict, length, cost)


@inner
def _add_slides(g, tree, row, count, x, plane, goal, cells, options, step, state):
    """Append the children with their parent's orientation; returns the new number of rows."""
    normal, u, v = plane
    p, q, attitude = screw.translation(x), screw.translation(goal), _attitude_key(tree, x)
    turn, from_root, slack = 0.2 * screw.pose_distance(x, goal)[1], _from_root(tree), tree[row, NODE.slack]
    for k in range(SIDES + int(options[OPTION.random])):
        if count >= len(tree):
            break
        d = child_direction(k, normal, u, v, options[OPTION.square], options[OPTION.away], state)
        delta = (step * d[0], step * d[1], step * d[2])
        end = (p[0] + delta[0], p[1] + delta[1], p[2] + delta[2])
        distance = math.sqrt(delta[0] * delta[0] + delta[1] * delta[1] + delta[2] * delta[2])
        x_, y_, z_ = q[0] - end[0], q[1] - end[1], q[2] - end[2]
        home = math.sqrt(x_ * x_ + y_ * y_ + z_ * z_ + turn * turn)
        clear = distance < slack or slide_is_clear(g, delta)
        y = screw.from_pose(end, (x[0], x[1], x[2], x[3]))
        _judge(tree, row, count, y, end, clear, distance, home, q, cells, options, step, attitude, from_root)
        count += 1
    return count


@inner
def _add_others(g, tree, row, count, x, plane, goal, cells, options, step, state):
    """Append the children that rotate towards the goal, are pulled back, rotate in place, or go straight."""
    normal, u, v = plane
    q, moves, angle_of_turn = screw.translation(goal), SIDES + int(options[OPTION.random]), options[OPTION.turn]
    spread, from_root = options[OPTION.spread] == 1.0, _from_root(tree)
    first = 0 if spread or options[OPTION.pull_back] == 1.0 else moves
    for k in range(first, moves + (7 if angle_of_turn > 0.0 else 0)):
        if count >= len(tree):
            break
        if k == moves + 6:
            y = _towards(x, q, step)
        elif k >= moves:
            y = _turned(x, (normal, u, v)[(k - moves) // 2], angle_of_turn if k % 2 == 0 else -angle_of_turn)
        else:
            d = child_direction(k, normal, u, v, options[OPTION.square], options[OPTION.away], state)
            y = _shifted(x, (step * d[0], step * d[1], step * d[2]))
            if spread:
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
    """Pose a step straight towards a point: a rotated tool may pass where no plane leads."""
    p = screw.translation(x)
    d = (q[0] - p[0], q[1] - p[1], q[2] - p[2])
    part = step / max(math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]), step)
    return _shifted(x, (part * d[0], part * d[1], part * d[2]))


@inner
def _turned_home(x, y, goal, step):
    """Pose y with an orientation on the screw from x to the goal, in proportion to the displacement."""
    home = screw.pose_distance(x, goal)[0]
    part = screw.sclerp(x, goal, min(1.0, step / max(home + step, 1e-9)))
    return screw.from_pose(screw.translation(y), (part[0], part[1], part[2], part[3]))


@inner
def _pulled(g, x, y, normal, options):
    """Child y moved back towards the obstacle of its parent's plane, to the shell."""
    excess = tool_slack(g, y, 10.0) - (options[OPTION.shell] - options[OPTION.largest_margin])
    if excess <= 0.0:
        return y
    back = min(excess, 0.5 * screw.pose_distance(x, y)[0])
    return _shifted(y, (-back * normal[0], -back * normal[1], -back * normal[2]))


@kernel
def expand(g, tree, row, count, goal, cells, options, step, state):
    """Append the children of a node; returns the new number of rows of the tree.

    Args:
        g: the tool among obstacles, see `tool_arrays`.
        tree: nodes, see `tree_arrays.NODE`.
        row: row of the node.
        count: number of rows in use.
        goal: pose of the path to reach, a tuple of 8.
        cells: (CELLS,) table of visited cells.
        options: see `tree_arrays.OPTION`.
        step: length of an edge [m].
        state: (1,) of the random numbers.
    """
    x, towards = screw.load8(tree, row), screw.translation(goal)
    p = screw.translation(x)
    plane = lay_plane(g, tree, row, (towards[0] - p[0], towards[1] - p[1], towards[2] - p[2]), options, step)
    moved = options[OPTION.spread] == 1.0 or options[OPTION.pull_back] == 1.0
    if not moved:
        count = _add_slides(g, tree, row, count, x, plane, goal, cells, options, step, state)
    if moved or options[OPTION.turn] > 0.0:
        count = _add_others(g, tree, row, count, x, plane, goal, cells, options, step, state)
    return count


@inner
def _seen(g, x, candidates):
    """Number of the first candidate pose with a clear screw from x to it; -1 if no candidate has one."""
    for j in range(len(candidates)):
        if screw_is_clear(g, x, screw.load8(candidates, j)):
            return j
    return -1


@kernel
def plant(root, goal, tree, cells, heap, options, step, growth):
    """Begin a tree: its root and nothing else.

    Args:
        root: (8,) pose of the tcp.
        goal: pose of the path to reach, a tuple of 8.
        tree: nodes, see `tree_arrays.NODE`.
        cells: (CELLS,) table of visited cells.
        heap: open leaves, see `tree_arrays.HEAP`.
        options: see `tree_arrays.OPTION`.
        step: length of an edge [m].
        growth: see `tree_arrays.GROWTH`.
    """
    for k in range(len(cells)):
        cells[k] = -1.0
    used = heap[len(heap) - 1 - int(options[OPTION.levels]) :, HEAP.used]
    for k in range(len(used)):
        used[k] = 0.0
    x = (root[0], root[1], root[2], root[3], root[4], root[5], root[6], root[7])
    home, turn = screw.pose_distance(x, goal)
    _add_node(tree, 0, x, -1, VERDICT.kept, 0.0, math.hypot(home, 0.2 * turn))
    _visited((0.0, 0.0, 0.0), _attitude_key(tree, x), options[OPTION.cell] * step, cells)
    growth[GROWTH.rows], growth[GROWTH.open] = 1.0, push(heap, 0, tree[0, NODE.score], 0)


@kernel
def grow_on(g, candidates, tree, cells, heap, options, step, state, growth, rows):
    """Grow a tree on until a node sees one of the candidate poses, no leaf is open, or it has a number of rows.

    The cheapest open leaf is expanded next, at most `beam` leaves per level; its score is a lower bound of the cost of
    all paths through it, so the first leaf that sees a candidate is the cheapest of this tree.

    Args:
        g: the tool among obstacles, see `tool_arrays`.
        candidates: (m, 8) poses of the path to reach.
        tree: nodes, see `tree_arrays.NODE`.
        cells: (CELLS,) table of visited cells.
        heap: open leaves, see `tree_arrays.HEAP`.
        options: see `tree_arrays.OPTION`.
        step: length of an edge [m].
        state: (1,) of the random numbers.
        growth: see `tree_arrays.GROWTH`; changed.
        rows: number of rows from which on no leaf is expanded.

    Returns:
        (row, candidate): the node that sees a candidate and the candidate, or -1 and -1.
    """
    goal, used = screw.load8(candidates, 0), heap[len(heap) - 1 - int(options[OPTION.levels]) :, HEAP.used]
    count, size, row, j = int(growth[GROWTH.rows]), int(growth[GROWTH.open]), -1, -1
    while size > 0 and count < rows:
        row = pop(heap, size)
        size -= 1
        level = int(tree[row, NODE.level])
        if used[level] >= options[OPTION.beam]:
            continue
        used[level] += 1.0
        j = _seen(g, screw.load8(tree, row), candidates)
        if j >= 0:
            tree[row, NODE.verdict] = VERDICT.goal_edge
            break
        if level < int(options[OPTION.levels]):
            end = expand(g, tree, row, count, goal, cells, options, step, state)
            for k in range(count, end):
                if tree[k, NODE.verdict] == VERDICT.kept:
                    size = push(heap, size, tree[k, NODE.score], k)
            count = end
    growth[GROWTH.rows], growth[GROWTH.open] = count, size
    return (row, j) if j >= 0 else (-1, -1)
