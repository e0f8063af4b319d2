"""Compiled closest points of a segment and an obstacle: the one query that everything about clearance rests on.

A capsule of the body is a segment with a radius. Distances are from its core to the obstacle's surface: the
clearance is the distance less the body's own radius. They are exact, also where a core is within the rounding radius
of a sphere or capsule; a core that enters a box, cylinder or mesh has distance 0. Distances are bounds from below
where they are not exact. See `shapes` for the rows.
"""

from __future__ import annotations

import math

from ..jit import inlined, inner, kernel
from .gjk import segment_polytope

FAR = 1e30
"""Distance that is returned for what is beyond the cutoff."""
TINY = 1e-300
"""Added to squared lengths that are divided by."""


@inlined
def clamped(x, low, high):
    """Number x moved into [low, high]."""
    return min(max(x, low), high)


@inlined
def _into(rows, k, p):
    """World point in the obstacle's frame."""
    x, y, z = p[0] - rows[k, 2], p[1] - rows[k, 3], p[2] - rows[k, 4]
    return (
        rows[k, 5] * x + rows[k, 8] * y + rows[k, 11] * z,
        rows[k, 6] * x + rows[k, 9] * y + rows[k, 12] * z,
        rows[k, 7] * x + rows[k, 10] * y + rows[k, 13] * z,
    )


@inlined
def _turned(rows, k, v):
    """Direction in the obstacle's frame as a world direction."""
    return (
        rows[k, 5] * v[0] + rows[k, 6] * v[1] + rows[k, 7] * v[2],
        rows[k, 8] * v[0] + rows[k, 9] * v[1] + rows[k, 10] * v[2],
        rows[k, 11] * v[0] + rows[k, 12] * v[1] + rows[k, 13] * v[2],
    )


@inlined
def _from_ball(rows, k, a, b):
    """Parameter of the segment's point nearest to a ball's center, and the vector from there, in the world."""
    p = (a[0] - rows[k, 2], a[1] - rows[k, 3], a[2] - rows[k, 4])
    d = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
    dd = max(d[0] * d[0] + d[1] * d[1] + d[2] * d[2], TINY)
    t = clamped(-(p[0] * d[0] + p[1] * d[1] + p[2] * d[2]) / dd, 0.0, 1.0)
    return t, (p[0] + t * d[0], p[1] + t * d[1], p[2] + t * d[2])


@inlined
def _from_capsule(rows, k, a, b):
    """Parameter of the segment's point nearest to a capsule's core, and the vector from there, in the world.

    The core's points are `center + s axis`, s within the half length (Ericson 2005, 5.1.9, with a unit axis). Where
    the two are parallel any t will do to start from. The divisions are free of what comes before: they overlap.
    """
    axis, h = (rows[k, 7], rows[k, 10], rows[k, 13]), rows[k, 16]
    p = (a[0] - rows[k, 2], a[1] - rows[k, 3], a[2] - rows[k, 4])
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
    """How far x is beyond [-half, half]."""
    return x - clamped(x, -half, half)


@inner
def _segment_box(p, d, hx, hy, hz, t):
    """Parameter of the point of `p + t d` nearest to a box: the root of a rising, piecewise linear slope.

    It starts from where a straight line between the slopes at both ends crosses zero.
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
    """A direction out of the obstacle for a core point (in its frame) that is inside or on its core."""
    if rows[k, 0] == 2.0:
        dx, dy, dz = rows[k, 14] - abs(x), rows[k, 15] - abs(y), rows[k, 16] - abs(z)
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
    hx, hy, hz = rows[k, 14], rows[k, 15], rows[k, 16]
    d = (q[0] - p[0], q[1] - p[1], q[2] - p[2])
    e = (_excess(p[0], hx), _excess(p[1], hy), _excess(p[2], hz))
    f = (_excess(q[0], hx), _excess(q[1], hy), _excess(q[2], hz))
    slope, end = d[0] * e[0] + d[1] * e[1] + d[2] * e[2], d[0] * f[0] + d[1] * f[1] + d[2] * f[2]
    if slope < 0.0 and end > 0.0:
        t = _segment_box(p, d, hx, hy, hz, slope / (slope - end))
        x, y, z = p[0] + t * d[0], p[1] + t * d[1], p[2] + t * d[2]
        return t, (_excess(x, hx), _excess(y, hy), _excess(z, hz))
    # mostly an end is nearest; which one is as good as random, so it is selected, not branched to
    last = slope < 0.0
    return 1.0 if last else 0.0, (f[0] if last else e[0], f[1] if last else e[1], f[2] if last else e[2])


@inner
def _from_other(rows, k, vertices, a, b):
    """The same for a cylinder or a mesh; and the distance that is proven, negative if the vector's length is it."""
    p, q = _into(rows, k, a), _into(rows, k, b)
    if rows[k, 0] == 3.0:
        d = (q[0] - p[0], q[1] - p[1], q[2] - p[2])
        t = _segment_cylinder(p, d, rows[k, 14], rows[k, 16])
        x, y, z = p[0] + t * d[0], p[1] + t * d[1], p[2] + t * d[2]
        return t, _cylinder_excess(x, y, z, rows[k, 14], rows[k, 16]), -1.0
    proven, t, v = segment_polytope(p, q, vertices, int(rows[k, 21]), int(rows[k, 22]))
    return t, v, proven


@inlined
def _length(v):
    return math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])


@inlined
def closest(rows, k, vertices, a, b):
    """Closest points of the segment from a to b and obstacle k.

    Args:
        rows: obstacles, see `shapes`.
        k: which.
        vertices: (n, 3) of the meshes.
        a: one end (3) in the world [m].
        b: the other end (3).

    Returns:
        (distance, t, normal): distance [m] of the segment from the obstacle's surface, negative within the
        rounding radius; parameter t in [0, 1] of the segment's closest point; unit normal (3) from the obstacle
        to the segment. Paper: section III-B, with the closest point instead of the shell's center.
    """
    kind, proven = rows[k, 0], -1.0
    if kind == 0.0:
        t, v = _from_ball(rows, k, a, b)
    elif kind == 1.0:
        t, v = _from_capsule(rows, k, a, b)
    elif kind == 2.0:
        t, v = _from_box(rows, k, a, b)
    else:
        t, v, proven = _from_other(rows, k, vertices, a, b)
    length = _length(v)
    if length > 1e-12:
        scale = 1.0 / length
        unit = (scale * v[0], scale * v[1], scale * v[2])
        normal = unit if kind <= 1.0 else _turned(rows, k, unit)
    else:
        p = _into(rows, k, (a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])))
        normal = _turned(rows, k, _exit(rows, k, p[0], p[1], p[2]))
    return (proven if proven >= 0.0 else length) - rows[k, 1], t, normal


@inlined
def distance(rows, k, vertices, a, b):
    """Distance [m] of the segment from obstacle k: the same number as `closest` gives."""
    kind = rows[k, 0]
    if kind == 0.0:
        return _length(_from_ball(rows, k, a, b)[1]) - rows[k, 1]
    if kind == 1.0:
        return _length(_from_capsule(rows, k, a, b)[1]) - rows[k, 1]
    if kind == 2.0:
        return _length(_from_box(rows, k, a, b)[1]) - rows[k, 1]
    _, v, proven = _from_other(rows, k, vertices, a, b)
    return (proven if proven >= 0.0 else _length(v)) - rows[k, 1]


@inlined
def is_beyond(rows, k, center, reach):
    """True if a ball about a point (3) surely stays clear of obstacle k: the test that spares most of the others."""
    x, y, z = center[0] - rows[k, 2], center[1] - rows[k, 3], center[2] - rows[k, 4]
    far = reach + rows[k, 20]
    return x * x + y * y + z * z > far * far


@kernel
def between_segments(a, b, c, d):
    """Closest points of two segments: distance [m], parameters t and s, unit normal from the second to the first."""
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
