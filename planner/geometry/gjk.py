"""Compiled distance of a segment from a convex polyhedron (Gilbert, Johnson and Keerthi 1988), with a certificate.

The distance of two sets is that of the origin from their difference. The answer is the *lower* bound that the last
separating plane proves, so that rounding or an early stop can only make things look closer.
"""

from __future__ import annotations

import math

from ..jit import inner, kernel

ITERATIONS = 64
CLOSE = 1e-10
"""Difference [m] between the distance of the best point and the proven bound at which the search ends."""


@inner
def difference(a, b):
    """Return a - b.

    Args:
        a: (3,) vector.
        b: (3,) vector.
    """
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@inner
def dot(a, b):
    """Return the inner product.

    Args:
        a: (3,) vector.
        b: (3,) vector.
    """
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inner
def _edge(a, b):
    """Weights of a and b at the point of the edge that is nearest to the origin."""
    d = difference(b, a)
    length = dot(d, d)
    t = -dot(a, d) / length if length > 0.0 else 0.0
    t = min(1.0, max(0.0, t))
    return 1.0 - t, t


@inner
def _triangle(a, b, c):
    """Weights of a, b and c at the point of the triangle that is nearest to the origin (Ericson 2005, 5.1.5)."""
    ab, ac = difference(b, a), difference(c, a)
    d1, d2 = -dot(ab, a), -dot(ac, a)
    if d1 <= 0.0 and d2 <= 0.0:
        return 1.0, 0.0, 0.0
    d3, d4 = -dot(ab, b), -dot(ac, b)
    if d3 >= 0.0 and d4 <= d3:
        return 0.0, 1.0, 0.0
    d5, d6 = -dot(ab, c), -dot(ac, c)
    if d6 >= 0.0 and d5 <= d6:
        return 0.0, 0.0, 1.0
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        u, v = _edge(a, b)
        return u, v, 0.0
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        u, w = _edge(a, c)
        return u, 0.0, w
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        v, w = _edge(b, c)
        return 0.0, v, w
    total = va + vb + vc
    return va / total, vb / total, vc / total


@inner
def blend(weights, a, b, c, d):
    """Return the weighted sum of four corners.

    Args:
        weights: (4,) numbers.
        a: (3,) corner.
        b: (3,) corner.
        c: (3,) corner.
        d: (3,) corner.
    """
    return (
        weights[0] * a[0] + weights[1] * b[0] + weights[2] * c[0] + weights[3] * d[0],
        weights[0] * a[1] + weights[1] * b[1] + weights[2] * c[1] + weights[3] * d[1],
        weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2] + weights[3] * d[2],
    )


@inner
def _volume(a, b, c, d):
    """Six times the signed volume of a tetrahedron."""
    u, v, w = difference(b, a), difference(c, a), difference(d, a)
    return u[0] * (v[1] * w[2] - v[2] * w[1]) - u[1] * (v[0] * w[2] - v[2] * w[0]) + u[2] * (v[0] * w[1] - v[1] * w[0])


@inner
def tetrahedron(a, b, c, d):
    """Return the weights (4) of the corners at the point nearest to the origin, and True if the origin is inside.

    Args:
        a: (3,) corner.
        b: (3,) corner.
        c: (3,) corner.
        d: (3,) corner.
    """
    zero = (0.0, 0.0, 0.0)
    whole = _volume(a, b, c, d)
    inside = (
        whole != 0.0
        and _volume(zero, b, c, d) / whole >= 0.0
        and _volume(a, zero, c, d) / whole >= 0.0
        and _volume(a, b, zero, d) / whole >= 0.0
        and _volume(a, b, c, zero) / whole >= 0.0
    )
    u, v, w = _triangle(a, b, c)
    best = (u, v, w, 0.0)
    p = blend(best, a, b, c, d)
    least = dot(p, p)
    u, v, w = _triangle(a, b, d)
    other = (u, v, 0.0, w)
    p = blend(other, a, b, c, d)
    if dot(p, p) < least:
        best, least = other, dot(p, p)
    u, v, w = _triangle(a, c, d)
    other = (u, 0.0, v, w)
    p = blend(other, a, b, c, d)
    if dot(p, p) < least:
        best, least = other, dot(p, p)
    u, v, w = _triangle(b, c, d)
    other = (0.0, u, v, w)
    p = blend(other, a, b, c, d)
    if dot(p, p) < least:
        best, least = other, dot(p, p)
    return best, inside


@inner
def folded(weights, size):
    """Return the weights (4) of the first `size` corners; the places after them hold copies of the first corner.

    Args:
        weights: (4,) of all places.
        size: number of corners, 1 to 4.
    """
    a, b, c, d = weights
    if size < 4:
        a, d = a + d, 0.0
    if size < 3:
        a, c = a + c, 0.0
    if size < 2:
        a, b = a + b, 0.0
    return a, b, c, d


@inner
def _support(a, b, vertices, first, count, v):
    """Corner of the difference that is farthest against v, and the end of the segment it comes from (0: a, 1: b)."""
    best, far = first, -1e300
    for i in range(first, first + count):
        s = vertices[i, 0] * v[0] + vertices[i, 1] * v[1] + vertices[i, 2] * v[2]
        if s > far:
            best, far = i, s
    end = 0.0 if dot(a, v) <= dot(b, v) else 1.0
    p = a if end == 0.0 else b
    return (p[0] - vertices[best, 0], p[1] - vertices[best, 1], p[2] - vertices[best, 2]), end


@kernel
def segment_polytope(a, b, vertices, first, count):
    """Compute the proven distance of a segment from the convex hull of vertices.

    Args:
        a: one end (3), in the frame of the vertices [m].
        b: the other end (3).
        vertices: (n, 3) [m].
        first: row of the first vertex.
        count: number of vertices.

    Returns:
        (distance, t, v): distance [m], 0 if they touch; parameter t in [0, 1] of the segment's closest point; vector
        v (3) from the polyhedron to the segment, not of unit length.
    """
    v = difference(a, (vertices[first, 0], vertices[first, 1], vertices[first, 2]))
    p0 = p1 = p2 = p3 = v
    e0 = e1 = e2 = e3 = 0.0
    weights = (1.0, 0.0, 0.0, 0.0)
    size, proven = 1, 0.0
    for _ in range(ITERATIONS):
        length = math.sqrt(dot(v, v))
        if length < CLOSE:
            return 0.0, weights[0] * e0 + weights[1] * e1 + weights[2] * e2 + weights[3] * e3, v
        w, end = _support(a, b, vertices, first, count, v)
        # the bound of this very plane: v is returned as its normal
        proven = max(0.0, dot(v, w) / length)
        if length - proven < CLOSE or w in (p0, p1, p2, p3):
            break
        # corners without weight are dropped, the new one takes the first free place
        if weights[0] == 0.0:
            p0, e0 = w, end
        elif size == 1 or weights[1] == 0.0:
            p1, e1 = w, end
            size = max(size, 2)
        elif size == 2 or weights[2] == 0.0:
            p2, e2 = w, end
            size = max(size, 3)
        else:
            p3, e3 = w, end
            size = 4
        if size < 4:
            p3, e3 = p0, e0
        if size < 3:
            p2, e2 = p0, e0
        if size < 2:
            p1, e1 = p0, e0
        weights, inside = tetrahedron(p0, p1, p2, p3)
        weights = folded(weights, size)
        v = (0.0, 0.0, 0.0) if inside else blend(weights, p0, p1, p2, p3)
    return proven, weights[0] * e0 + weights[1] * e1 + weights[2] * e2 + weights[3] * e3, v
