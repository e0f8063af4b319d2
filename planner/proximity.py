"""Compiled closest points of a segment and an obstacle: the one query that everything about clearance rests on.

A capsule of the body is a segment with a radius. Distances are from its core to the obstacle's surface: the
clearance is the distance less the body's own radius. They are exact, also where a core is within the rounding radius
of a sphere or capsule; a core that enters a box, cylinder or mesh has distance 0. Distances are bounds from below
where they are not exact. See `shapes` for the rows.
"""

from __future__ import annotations

import math

from .gjk import segment_polytope
from .jit import inner, kernel

FAR = 1e30
"""Distance that is returned for what is beyond the cutoff."""


@kernel
def clamped(x, low, high):
    """Number x moved into [low, high]."""
    return min(max(x, low), high)


@inner
def _into(rows, k, p):
    """World point in the obstacle's frame."""
    x, y, z = p[0] - rows[k, 2], p[1] - rows[k, 3], p[2] - rows[k, 4]
    return (
        rows[k, 5] * x + rows[k, 8] * y + rows[k, 11] * z,
        rows[k, 6] * x + rows[k, 9] * y + rows[k, 12] * z,
        rows[k, 7] * x + rows[k, 10] * y + rows[k, 13] * z,
    )


@inner
def _turned(rows, k, v):
    """Direction in the obstacle's frame as a world direction."""
    return (
        rows[k, 5] * v[0] + rows[k, 6] * v[1] + rows[k, 7] * v[2],
        rows[k, 8] * v[0] + rows[k, 9] * v[1] + rows[k, 10] * v[2],
        rows[k, 11] * v[0] + rows[k, 12] * v[1] + rows[k, 13] * v[2],
    )


@inner
def _point_on_segment(p, d):
    """Parameter of the point of `p + t d` that is nearest to the origin."""
    length = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    if length == 0.0:
        return 0.0
    return clamped(-(p[0] * d[0] + p[1] * d[1] + p[2] * d[2]) / length, 0.0, 1.0)


@inner
def _segments(p, d, half):
    """Parameters of the closest points of `p + t d` and the z axis between +- half (Ericson 2005, 5.1.9)."""
    a = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    # the second segment starts at z = -half and runs along z
    z = p[2] + half
    e = 4.0 * half * half
    f = 2.0 * half * z
    c = p[0] * d[0] + p[1] * d[1] + z * d[2]
    b = 2.0 * half * d[2]
    if a <= 1e-18:
        return 0.0, clamped(f / e, 0.0, 1.0)
    determinant = a * e - b * b
    t = clamped((b * f - c * e) / determinant, 0.0, 1.0) if determinant > 1e-14 * a * e else 0.0
    s = (b * t + f) / e
    if s < 0.0:
        return clamped(-c / a, 0.0, 1.0), 0.0
    if s > 1.0:
        return clamped((b - c) / a, 0.0, 1.0), 1.0
    return t, s


@inner
def _excess(x, half):
    """How far x is beyond [-half, half]."""
    return x - clamped(x, -half, half)


@inner
def _segment_box(p, d, hx, hy, hz):
    """Parameter of the point of `p + t d` nearest to a box: the root of a rising, piecewise linear slope."""
    slope = d[0] * _excess(p[0], hx) + d[1] * _excess(p[1], hy) + d[2] * _excess(p[2], hz)
    if slope >= 0.0:
        return 0.0
    q = (p[0] + d[0], p[1] + d[1], p[2] + d[2])
    end = d[0] * _excess(q[0], hx) + d[1] * _excess(q[1], hy) + d[2] * _excess(q[2], hz)
    if end <= 0.0:
        return 1.0
    low, high = 0.0, 1.0
    t = slope / (slope - end)
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
def _way_out(rows, k, x, y, z):
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


@inner
def _local(rows, k, vertices, p, d):
    """In the obstacle's frame: parameter t of `p + t d`, and the vector from the nearest core point to that point."""
    kind = rows[k, 0]
    if kind == 0.0:
        t = _point_on_segment(p, d)
        return t, (p[0] + t * d[0], p[1] + t * d[1], p[2] + t * d[2]), -1.0
    if kind == 2.0:
        t = _segment_box(p, d, rows[k, 14], rows[k, 15], rows[k, 16])
        x, y, z = p[0] + t * d[0], p[1] + t * d[1], p[2] + t * d[2]
        return t, (_excess(x, rows[k, 14]), _excess(y, rows[k, 15]), _excess(z, rows[k, 16])), -1.0
    if kind == 1.0:
        t, s = _segments(p, d, rows[k, 16])
        z = p[2] + t * d[2] - (2.0 * s - 1.0) * rows[k, 16]
        return t, (p[0] + t * d[0], p[1] + t * d[1], z), -1.0
    if kind == 3.0:
        t = _segment_cylinder(p, d, rows[k, 14], rows[k, 16])
        x, y, z = p[0] + t * d[0], p[1] + t * d[1], p[2] + t * d[2]
        return t, _cylinder_excess(x, y, z, rows[k, 14], rows[k, 16]), -1.0
    end = (p[0] + d[0], p[1] + d[1], p[2] + d[2])
    proven, t, v = segment_polytope(p, end, vertices, int(rows[k, 21]), int(rows[k, 22]))
    return t, v, proven


@kernel
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
    p = _into(rows, k, a)
    q = _into(rows, k, b)
    d = (q[0] - p[0], q[1] - p[1], q[2] - p[2])
    t, v, proven = _local(rows, k, vertices, p, d)
    length = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    if length > 1e-12:
        unit = (v[0] / length, v[1] / length, v[2] / length)
    else:
        unit = _way_out(rows, k, p[0] + t * d[0], p[1] + t * d[1], p[2] + t * d[2])
    if proven >= 0.0:
        length = proven
    return length - rows[k, 1], t, _turned(rows, k, unit)


@kernel
def distance(rows, k, vertices, a, b, cutoff):
    """Distance [m] of the segment from obstacle k, or FAR if it is surely more than the cutoff."""
    x = 0.5 * (a[0] + b[0]) - rows[k, 2]
    y = 0.5 * (a[1] + b[1]) - rows[k, 3]
    z = 0.5 * (a[2] + b[2]) - rows[k, 4]
    u, v, w = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    reach = cutoff + rows[k, 20] + 0.5 * math.sqrt(u * u + v * v + w * w)
    if x * x + y * y + z * z > reach * reach:
        return FAR
    p = _into(rows, k, a)
    q = _into(rows, k, b)
    _, away, proven = _local(rows, k, vertices, p, (q[0] - p[0], q[1] - p[1], q[2] - p[2]))
    if proven >= 0.0:
        return proven - rows[k, 1]
    return math.sqrt(away[0] * away[0] + away[1] * away[1] + away[2] * away[2]) - rows[k, 1]


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
