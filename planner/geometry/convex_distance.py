"""Compiled distance of a placed convex hull from another convex shape, with a certificate; see `gjk`.

A hull is given by its corners, `PER_ROW` in each row of an array, in its own frame. Not in the paper, which moves a
point.
"""

from __future__ import annotations

import math

from ..jit import inlined, inner, kernel
from .gjk import ITERATIONS, blend, difference, dot, folded, tetrahedron
from .shapes import SHAPE_KIND

PER_ROW = 13
"""Corners in a row."""
HULL = 6.0
"""Kind of a shape given by its corners, like the first; the other kinds are those of `shapes.SHAPE_KIND`."""
CLOSE = 1e-7
"""Difference [m] between the distance of the best point and the proven bound at which the search ends."""


@inlined
def _turned(turn, v):
    return (
        turn[0] * v[0] + turn[1] * v[1] + turn[2] * v[2],
        turn[3] * v[0] + turn[4] * v[1] + turn[5] * v[2],
        turn[6] * v[0] + turn[7] * v[1] + turn[8] * v[2],
    )


@inlined
def _turned_back(turn, v):
    return (
        turn[0] * v[0] + turn[3] * v[1] + turn[6] * v[2],
        turn[1] * v[0] + turn[4] * v[1] + turn[7] * v[2],
        turn[2] * v[0] + turn[5] * v[1] + turn[8] * v[2],
    )


@inner
def _farthest_corner(g, first, count, d):
    """Corner of a hull that is farthest along d, in the hull's frame."""
    far, best, column, row, left = -1e300, first, 0, first, count
    while left > 0:
        for k in range(min(left, PER_ROW)):
            s = g[row, 3 * k] * d[0] + g[row, 3 * k + 1] * d[1] + g[row, 3 * k + 2] * d[2]
            if s > far:
                far, best, column = s, row, 3 * k
        row, left = row + 1, left - PER_ROW
    return (g[best, column], g[best, column + 1], g[best, column + 2])


@inner
def _farthest_vertex(g, first, count, d):
    """Vertex of a mesh, one in a row, that is farthest along d, in the mesh's frame."""
    far, best = -1e300, first
    for row in range(first, first + count):
        s = g[row, 0] * d[0] + g[row, 1] * d[1] + g[row, 2] * d[2]
        if s > far:
            far, best = s, row
    return (g[best, 0], g[best, 1], g[best, 2])


@inner
def _farthest(g, kind, half, first, count, d):
    """Point of a shape's core that is farthest along d, in the shape's frame."""
    if kind == HULL:
        return _farthest_corner(g, first, count, d)
    if kind == SHAPE_KIND.mesh:
        return _farthest_vertex(g, first, count, d)
    z = half[2] if d[2] > 0.0 else -half[2]
    if kind == SHAPE_KIND.cylinder:
        r = math.sqrt(d[0] * d[0] + d[1] * d[1])
        scale = half[0] / r if r > 0.0 else 0.0
        return (scale * d[0], scale * d[1], z)
    # the core of a sphere or a capsule is a box without width
    return (half[0] if d[0] > 0.0 else -half[0], half[1] if d[1] > 0.0 else -half[1], z)


@kernel
def farthest_along(g, first, count, turn, place, d):
    """Return the coordinate [m] along a direction of the hull's point that is farthest along the direction.

    Args:
        g: array that holds the corners.
        first: row of the first corner.
        count: number of corners.
        turn: rotation of the hull, `world_from_hull`, a tuple of 9, row by row.
        place: position (3) of the hull's frame [m].
        d: (3,) unit direction in the world.
    """
    p = _farthest_corner(g, first, count, _turned_back(turn, d))
    return dot(_turned(turn, p), d) + dot(place, d)


@kernel
def convex_distance(
    g, first, count, turn, place, kind, half, other_first, other_count, other_turn, other_place, cutoff
):
    """Compute the proven distance of a hull from the core of another convex shape.

    Args:
        g: array that holds the corners of both.
        first: row of the hull's first corner.
        count: number of its corners.
        turn: rotation of the hull, `world_from_hull`, a tuple of 9, row by row.
        place: position (3) of the hull's frame [m].
        kind: of the other shape, see `HULL`.
        half: half extents (3) of its core [m]; not used for hulls and meshes.
        other_first: row of its first corner.
        other_count: number of its corners.
        other_turn: its rotation, a tuple of 9.
        other_place: position (3) of its frame [m].
        cutoff: the search ends as soon as the distance surely exceeds this [m].

    Returns:
        (distance, normal, point): lower bound [m] of the distance that a plane with this unit normal (3), from the
        other shape to the hull, proves; 0 if the two touch. Point (3) of the hull that is closest to the other shape.
    """
    v = difference(place, other_place)
    back = (-v[0], -v[1], -v[2])
    a = _at(g, HULL, half, first, count, turn, place, back)
    b = _at(g, kind, half, other_first, other_count, other_turn, other_place, v)
    v = difference(a, b)
    p0 = p1 = p2 = p3 = v
    a0 = a1 = a2 = a3 = a
    weights = (1.0, 0.0, 0.0, 0.0)
    size, proven, normal = 1, 0.0, (0.0, 0.0, 1.0)
    for _ in range(ITERATIONS):
        length = math.sqrt(dot(v, v))
        if length < CLOSE:
            break
        a = _at(g, HULL, half, first, count, turn, place, (-v[0], -v[1], -v[2]))
        b = _at(g, kind, half, other_first, other_count, other_turn, other_place, v)
        w = difference(a, b)
        bound = dot(v, w) / length
        if bound > proven:
            proven, normal = bound, (v[0] / length, v[1] / length, v[2] / length)
        if proven > max(cutoff, 0.0) or length - proven < CLOSE or w in (p0, p1, p2, p3):
            break
        # corners without weight are dropped, the new one takes the first free place
        if weights[0] == 0.0:
            p0, a0 = w, a
        elif size == 1 or weights[1] == 0.0:
            p1, a1 = w, a
            size = max(size, 2)
        elif size == 2 or weights[2] == 0.0:
            p2, a2 = w, a
            size = max(size, 3)
        else:
            p3, a3 = w, a
            size = 4
        if size < 4:
            p3, a3 = p0, a0
        if size < 3:
            p2, a2 = p0, a0
        if size < 2:
            p1, a1 = p0, a0
        weights, inside = tetrahedron(p0, p1, p2, p3)
        weights = folded(weights, size)
        # what a plane has separated is not inside: the tetrahedron is flat, and its faces hold the closest point
        v = (0.0, 0.0, 0.0) if inside and proven == 0.0 else blend(weights, p0, p1, p2, p3)
    return proven, normal, blend(weights, a0, a1, a2, a3)


@inner
def _at(g, kind, half, first, count, turn, place, d):
    """World point of a placed shape's core that is farthest along d."""
    p = _turned(turn, _farthest(g, kind, half, first, count, _turned_back(turn, d)))
    return (p[0] + place[0], p[1] + place[1], p[2] + place[2])
