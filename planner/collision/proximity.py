"""Compiled closest points of a segment and an obstacle: the query that all clearances rest on.

A capsule of the body is a segment with a radius. Distances are from its core to the obstacle's surface: the
clearance is the distance less the body's own radius. They are exact, also where a core is within the rounding radius
of a sphere or capsule; a core that enters a box, cylinder or mesh has distance 0. Where a distance is not exact, it
is a lower bound. See `shapes.OBSTACLE` for the rows.
"""

from __future__ import annotations

import math

from ..geometry.gjk import segment_polytope
from ..geometry.shapes import OBSTACLE, SHAPE_KIND
from ..jit import inlined, inner, kernel

FAR = 1e30
"""Distance returned for a pair beyond the cutoff."""
TINY = 1e-300
"""Added to squared lengths before a division by them."""


@inlined
def clamped(x, low, high):
    """Return the number x clamped to [low, high].

    Args:
        x: the number.
        low: lower bound.
        high: upper bound.
    """
    return min(max(x, low), high)


@inlined
def _from_center(rows, k, p):
    """World vector from the obstacle's center to a world point."""
    c = OBSTACLE.center
    return (p[0] - rows[k, c], p[1] - rows[k, c + 1], p[2] - rows[k, c + 2])


@inlined
def _half_extents(rows, k):
    return (rows[k, OBSTACLE.half_extents], rows[k, OBSTACLE.half_extents + 1], rows[k, OBSTACLE.half_extents + 2])


@inlined
def _into(rows, k, p):
    """World point in the obstacle's frame."""
    r, (x, y, z) = OBSTACLE.rotation, _from_center(rows, k, p)
    return (
        rows[k, r] * x + rows[k, r + 3] * y + rows[k, r + 6] * z,
        rows[k, r + 1] * x + rows[k, r + 4] * y + rows[k, r + 7] * z,
        rows[k, r + 2] * x + rows[k, r + 5] * y + rows[k, r + 8] * z,
    )


@inlined
def _turned(rows, k, v):
    """World direction of a direction in the obstacle's frame."""
    r = OBSTACLE.rotation
    return (
        rows[k, r] * v[0] + rows[k, r + 1] * v[1] + rows[k, r + 2] * v[2],
        rows[k, r + 3] * v[0] + rows[k, r + 4] * v[1] + rows[k, r + 5] * v[2],
        rows[k, r + 6] * v[0] + rows[k, r + 7] * v[1] + rows[k, r + 8] * v[2],
    )


@inlined
def _from_ball(rows, k, a, b):
    """Parameter of the segment's point nearest to a ball's center, and the vector from there, in the world."""
    p = _from_center(rows, k, a)
    d = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
    dd = max(d[0] * d[0] + d[1] * d[1] + d[2] * d[2], TINY)
    t = clamped(-(p[0] * d[0] + p[1] * d[1] + p[2] * d[2]) / dd, 0.0, 1.0)
    return t, (p[0] + t * d[0], p[1] + t * d[1], p[2] + t * d[2])


@inlined
def _from_capsule(rows, k, a, b):
    """Parameter of the segment's point nearest to a capsule's core, and the vector from there, in the world.

    The core's points are `center + s axis`, s within the half length (Ericson 2005, 5.1.9, with a unit axis). Where
    the two are parallel, any t will do to start from. The divisions do not depend on earlier results, so they overlap.
    """
    r, h = OBSTACLE.rotation, rows[k, OBSTACLE.half_extents + 2]
    axis = (rows[k, r + 2], rows[k, r + 5], rows[k, r + 8])
    p = _from_center(rows, k, a)
    d = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
    dd = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    da = d[0] * axis[0] + d[1] * axis[1] + d[2] * axis[2]
    pd = p[0] * d[0] + p[1] * d[1] + p[2] * d[2]
    pa = p[0] * axis[0] + p[1] * axis[1] + p[2] * axis[2]
    t = clamped((da * pa - pd) * (1.0 / max(dd - da * da, 1e-14 * dd + TINY)), 0.0, 1.0)
    s = clamped(pa + t * da, -h, h)
    t = clamped((s * da - pd) * (1.0 / max(dd, TINY)), 0.0, 1.0)
    return t, (p[0] + t * d[0] - s * axis[0], p[1] + t * d[1] - s * axis[1], p[2] + t * d[2] - s * axis[2])


@inlined
def _excess(x, half):
    """Signed distance of x from the interval [-half, half]."""
    return x - clamped(x, -half, half)


@inner
def _segment_box(p, d, hx, hy, hz, t):
    """Parameter of the point of `p + t d` nearest to a box: the root of a rising, piecewise linear slope.

    The search starts where a straight line between the slopes at both ends crosses zero.
    """
    low, high = 0.0, 1.0
    for _ in range(40):
        x, y, z = p[0] + t * d[0], p[1] + t * d[1], p[2] + t * d[2]
        ex, ey, ez = _excess(x, hx), _excess(y, hy), _excess(z, hz)
        slope = d[0] * ex + d[1] * ey + d[2] * ez
        if abs(slope) < 1e-15:
            return t
        if slope > 0.0:
            high = t
        else:
            low = t
        steep = (d[0] * d[0] if ex != 0.0 else 0.0) + (d[1] * d[1] if ey != 0.0 else 0.0)
        steep += d[2] * d[2] if ez != 0.0 else 0.0
        step = t - slope / steep if steep > 0.0 else low
        new = step if low < step < high else 0.5 * (low + high)
        if abs(new - t) < 1e-15:
            return t
        t = new
    return t


@inner
def _cylinder_excess(x, y, z, radius, half):
    """Vector from the nearest point of a cylinder."""
    r = math.sqrt(x * x + y * y)
    out = 1.0 - radius / r if r > radius else 0.0
    return x * out, y * out, _excess(z, half)


@inner
def _segment_cylinder(p, d, radius, half):
    """Parameter of the point of `p + t d` nearest to a cylinder: the root of a rising slope, by bisection."""
    ex, ey, ez = _cylinder_excess(p[0], p[1], p[2], radius, half)
    if ex * d[0] + ey * d[1] + ez * d[2] >= 0.0:
        return 0.0
    ex, ey, ez = _cylinder_excess(p[0] + d[0], p[1] + d[1], p[2] + d[2], radius, half)
    if ex * d[0] + ey * d[1] + ez * d[2] <= 0.0:
        return 1.0
    low, high = 0.0, 1.0
    for _ in range(46):
        t = 0.5 * (low + high)
        ex, ey, ez = _cylinder_excess(p[0] + t * d[0], p[1] + t * d[1], p[2] + t * d[2], radius, half)
        if ex * d[0] + ey * d[1] + ez * d[2] > 0.0:
            high = t
        else:
            low = t
    return 0.5 * (low + high)


@inner
def _exit(rows, k, x, y, z):
    """Direction out of the obstacle for a point (in its frame) inside or on its core."""
    if rows[k, OBSTACLE.kind] == SHAPE_KIND.box:
        hx, hy, hz = _half_extents(rows, k)
        dx, dy, dz = hx - abs(x), hy - abs(y), hz - abs(z)
        if dx <= dy and dx <= dz:
            return (1.0 if x >= 0.0 else -1.0, 0.0, 0.0)
        if dy <= dz:
            return (0.0, 1.0 if y >= 0.0 else -1.0, 0.0)
        return (0.0, 0.0, 1.0 if z >= 0.0 else -1.0)
    length = math.sqrt(x * x + y * y + z * z)
    if length < 1e-9:
        return (0.0, 0.0, 1.0)
    return (x / length, y / length, z / length)


@inlined
def _from_box(rows, k, a, b):
    """Parameter of the segment's point nearest to a box, and the vector from there, in the box's frame."""
    p, q = _into(rows, k, a), _into(rows, k, b)
    hx, hy, hz = _half_extents(rows, k)
    d = (q[0] - p[0], q[1] - p[1], q[2] - p[2])
    e = (_excess(p[0], hx), _excess(p[1], hy), _excess(p[2], hz))
    f = (_excess(q[0], hx), _excess(q[1], hy), _excess(q[2], hz))
    slope, end = d[0] * e[0] + d[1] * e[1] + d[2] * e[2], d[0] * f[0] + d[1] * f[1] + d[2] * f[2]
    if slope < 0.0 and end > 0.0:
        t = _segment_box(p, d, hx, hy, hz, slope / (slope - end))
        x, y, z = p[0] + t * d[0], p[1] + t * d[1], p[2] + t * d[2]
        return t, (_excess(x, hx), _excess(y, hy), _excess(z, hz))
    # mostly an end is nearest; which one is unpredictable, so the end is selected without a branch
    last = slope < 0.0
    return 1.0 if last else 0.0, (f[0] if last else e[0], f[1] if last else e[1], f[2] if last else e[2])


@inner
def _from_other(rows, k, vertices, a, b):
    """Parameter and vector for a cylinder or a mesh; and the proven distance, negative if the vector has its length."""
    p, q = _into(rows, k, a), _into(rows, k, b)
    if rows[k, OBSTACLE.kind] == SHAPE_KIND.cylinder:
        radius, _, half = _half_extents(rows, k)
        d = (q[0] - p[0], q[1] - p[1], q[2] - p[2])
        t = _segment_cylinder(p, d, radius, half)
        x, y, z = p[0] + t * d[0], p[1] + t * d[1], p[2] + t * d[2]
        return t, _cylinder_excess(x, y, z, radius, half), -1.0
    first, count = int(rows[k, OBSTACLE.first_vertex]), int(rows[k, OBSTACLE.vertices])
    proven, t, v = segment_polytope(p, q, vertices, first, count)
    return t, v, proven


@inlined
def _length(v):
    return math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])


@inlined
def closest(rows, k, vertices, a, b):
    """Compute the closest points of a segment and an obstacle.

    Args:
        rows: obstacles, see `shapes.OBSTACLE`.
        k: row of the obstacle.
        vertices: (n, 3) of the meshes [m].
        a: one end (3) in the world [m].
        b: the other end (3).

    Returns:
        (distance, t, normal): distance [m] of the segment from the obstacle's surface, negative within the
        rounding radius; parameter t in [0, 1] of the segment's closest point; unit normal (3) from the obstacle
        to the segment. Paper: section III-B, with the closest point instead of the shell's center.
    """
    kind, proven = rows[k, OBSTACLE.kind], -1.0
    if kind == SHAPE_KIND.sphere:
        t, v = _from_ball(rows, k, a, b)
    elif kind == SHAPE_KIND.capsule:
        t, v = _from_capsule(rows, k, a, b)
    elif kind == SHAPE_KIND.box:
        t, v = _from_box(rows, k, a, b)
    else:
        t, v, proven = _from_other(rows, k, vertices, a, b)
    length = _length(v)
    if length > 1e-12:
        scale = 1.0 / length
        unit = (scale * v[0], scale * v[1], scale * v[2])
        normal = unit if kind == SHAPE_KIND.sphere or kind == SHAPE_KIND.capsule else _turned(rows, k, unit)
    else:
        p = _into(rows, k, (a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])))
        normal = _turned(rows, k, _exit(rows, k, p[0], p[1], p[2]))
    return (proven if proven >= 0.0 else length) - rows[k, OBSTACLE.rounding], t, normal


@inlined
def distance(rows, k, vertices, a, b):
    """Return the distance [m] of a segment from an obstacle: the number that `closest` gives.

    Args:
        rows: obstacles, see `shapes.OBSTACLE`.
        k: row of the obstacle.
        vertices: (n, 3) of the meshes [m].
        a: one end (3) in the world [m].
        b: the other end (3).
    """
    kind = rows[k, OBSTACLE.kind]
    if kind == SHAPE_KIND.sphere:
        return _length(_from_ball(rows, k, a, b)[1]) - rows[k, OBSTACLE.rounding]
    if kind == SHAPE_KIND.capsule:
        return _length(_from_capsule(rows, k, a, b)[1]) - rows[k, OBSTACLE.rounding]
    if kind == SHAPE_KIND.box:
        return _length(_from_box(rows, k, a, b)[1]) - rows[k, OBSTACLE.rounding]
    _, v, proven = _from_other(rows, k, vertices, a, b)
    return (proven if proven >= 0.0 else _length(v)) - rows[k, OBSTACLE.rounding]


@inlined
def is_beyond(rows, k, center, reach):
    """Return True if a ball surely is clear of an obstacle: a quick test that spares most distances.

    Args:
        rows: obstacles, see `shapes.OBSTACLE`.
        k: row of the obstacle.
        center: (3,) of the ball in the world [m].
        reach: radius of the ball [m].
    """
    x, y, z = _from_center(rows, k, center)
    far = reach + rows[k, OBSTACLE.ball]
    return x * x + y * y + z * z > far * far


@kernel
def between_segments(a, b, c, d):
    """Compute the closest points of two segments.

    Args:
        a: one end (3) of the first segment [m].
        b: its other end.
        c: one end of the second segment.
        d: its other end.

    Returns:
        (distance, t, s, normal): distance [m], parameters in [0, 1] of the closest points on the first and on the
        second segment, unit normal (3) from the second to the first.
    """
    u = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
    v = (d[0] - c[0], d[1] - c[1], d[2] - c[2])
    w = (a[0] - c[0], a[1] - c[1], a[2] - c[2])
    uu = u[0] * u[0] + u[1] * u[1] + u[2] * u[2]
    vv = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    uv = u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
    uw = u[0] * w[0] + u[1] * w[1] + u[2] * w[2]
    vw = v[0] * w[0] + v[1] * w[1] + v[2] * w[2]
    determinant = uu * vv - uv * uv
    t = clamped((uv * vw - uw * vv) / determinant, 0.0, 1.0) if determinant > 1e-14 * uu * vv else 0.0
    s = clamped((uv * t + vw) / vv, 0.0, 1.0) if vv > 0.0 else 0.0
    t = clamped((uv * s - uw) / uu, 0.0, 1.0) if uu > 0.0 else 0.0
    x, y, z = w[0] + t * u[0] - s * v[0], w[1] + t * u[1] - s * v[1], w[2] + t * u[2] - s * v[2]
    length = math.sqrt(x * x + y * y + z * z)
    if length < 1e-12:
        return 0.0, t, s, (0.0, 0.0, 1.0)
    return length, t, s, (x / length, y / length, z / length)
