"""Bounds on joint speeds that keep near pairs apart, and the nearest speeds that satisfy them.

For every near pair the approach is at most proportional to the slack, `n . (J qdot - v) >= -alpha * slack`; all pairs
at once, by the nearest joint speeds in the metric of the tools' motion. Method reference section 7, velocity form.
The paper projects a pose error instead, and its formula adds a vector to a unit dual quaternion (section 12, item 5).
"""

from __future__ import annotations

from ..collision.capsule_placement import end_a, end_b
from ..collision.clearance import first_joint
from ..collision.robot_arrays import ARM_ENTRY, CAPSULE, HEADER, NEAR_PAIR, ROW, SETTING
from ..geometry import screw
from ..geometry.shapes import OBSTACLE
from ..jit import inlined, inner, kernel
from ..robot.kinematics import FRAME
from .qp import QP, SLACK, all_hold, inverse_weight, solve


@inlined
def _axis(g, joint):
    """World axis (3) of a joint."""
    f = ROW.frames + joint
    return (g[f, FRAME.axis], g[f, FRAME.axis + 1], g[f, FRAME.axis + 2])


@inlined
def _from_origin(g, joint, p):
    """World vector (3) from the origin of a joint's frame to a world point."""
    f, o = ROW.frames + joint, FRAME.origin
    return (p[0] - g[f, o], p[1] - g[f, o + 1], p[2] - g[f, o + 2])


@inner
def _add_column(g, row, first, c, p, normal, sign):
    """Add `sign n . J` of world point p on capsule c to a row of bounds."""
    start = first_joint(g, c)
    for joint in range(start, int(g[ROW.body + c, CAPSULE.frame]) + 1):
        x, y, z = _axis(g, joint)
        if g[ROW.sliding, joint] == 0.0:
            u, v, w = _from_origin(g, joint, p)
            x, y, z = y * w - z * v, z * u - x * w, x * v - y * u
        g[row, first + joint] += sign * (normal[0] * x + normal[1] * y + normal[2] * z)


@inner
def _closest_point(g, k, c, t, point):
    """Closest point of a near pair: on the hull of capsule c, or on its core."""
    if g[k, NEAR_PAIR.exact] == 1.0:
        return (g[k, point], g[k, point + 1], g[k, point + 2])
    return _on_core(g, c, g[k, t])


@inner
def _on_core(g, c, t):
    a, b = end_a(g, ROW.placed + c), end_b(g, ROW.placed + c)
    return (a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2]))


@inner
def _lay_bounds(g, q):
    """Write the rows of the quadratic program, near pairs, then joint limits; returns their number."""
    n, row = int(g[ROW.header, HEADER.joints]), int(g[ROW.header, HEADER.first_bound])
    alpha, buffer = g[ROW.settings, SETTING.alpha], g[ROW.settings, SETTING.buffer]
    first, near = int(g[ROW.header, HEADER.first_near]), int(g[ROW.header, HEADER.near])
    for k in range(first, first + near):
        for i in range(n):
            g[row, i] = 0.0
        normal = (g[k, NEAR_PAIR.normal], g[k, NEAR_PAIR.normal + 1], g[k, NEAR_PAIR.normal + 2])
        i, j = int(g[k, NEAR_PAIR.capsule]), int(g[k, NEAR_PAIR.other])
        need = -alpha * (g[k, NEAR_PAIR.distance] - g[k, NEAR_PAIR.margin] - buffer)
        _add_column(g, row, 0, i, _closest_point(g, k, i, NEAR_PAIR.t, NEAR_PAIR.point), normal, 1.0)
        if g[k, NEAR_PAIR.self_pair] == 1.0:
            _add_column(g, row, 0, j, _closest_point(g, k, j, NEAR_PAIR.s, NEAR_PAIR.other_point), normal, -1.0)
        else:
            o, v = ROW.obstacles + j, OBSTACLE.velocity
            need += normal[0] * g[o, v] + normal[1] * g[o, v + 1] + normal[2] * g[o, v + 2]
        g[row, QP.bound], g[row, QP.softness] = need, SLACK
        row += 1
    for i in range(n):
        low, high = _reachable_speeds(g, q, i)
        for sign in (1.0, -1.0):
            for j in range(n):
                g[row, j] = 0.0
            g[row, i] = sign
            g[row, QP.bound], g[row, QP.softness] = low if sign > 0.0 else -high, 0.0
            row += 1
    return near + 2 * n


@kernel
def allowed_speeds(g, q, i):
    """Return the lowest and the highest speed of a joint by its speed limit and its approach to a position limit.

    Args:
        g: array of the robot, see `robot_arrays`.
        q: (n,) joints of all arms.
        i: number of the joint.
    """
    gain = g[ROW.settings, SETTING.limit_gain]
    low = max(-g[ROW.speed, i], min(0.0, gain * (g[ROW.lower, i] - q[i])))
    return low, min(g[ROW.speed, i], max(0.0, gain * (g[ROW.upper, i] - q[i])))


@inner
def _reachable_speeds(g, q, i):
    """Allowed speeds of joint i within the slew of its last speed; the nearest allowed speed if there are none."""
    low, high = allowed_speeds(g, q, i)
    slew = g[ROW.settings, SETTING.slew]
    slower, faster = g[ROW.previous, i] - slew, g[ROW.previous, i] + slew
    return min(high, max(low, slower)), max(low, min(high, faster))


@inner
def _lay_weight(g):
    """Compute `J^T J` of all tools plus a small weight of every joint, so that the elbow yields first; inverted."""
    n = int(g[ROW.header, HEADER.joints])
    for i in range(n):
        for j in range(n):
            g[ROW.weight + i, j] = g[ROW.settings, SETTING.rest_weight] if i == j else 0.0
    for k in range(int(g[ROW.header, HEADER.arms])):
        entry = ARM_ENTRY.width * k
        first, dof = int(g[ROW.arms, entry + ARM_ENTRY.first_joint]), int(g[ROW.arms, entry + ARM_ENTRY.joints])
        p = screw.translation(screw.load8(g, ROW.tcps + k))
        for i in range(first, first + dof):
            for j in range(first, i + 1):
                v, w = _velocity(g, i, p), _velocity(g, j, p)
                s = v[0] * w[0] + v[1] * w[1] + v[2] * w[2]
                a, b = _axis(g, i), _axis(g, j)
                turn = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
                if g[ROW.sliding, i] == 1.0 or g[ROW.sliding, j] == 1.0:
                    turn = 0.0
                g[ROW.weight + i, j] += s + g[ROW.settings, SETTING.rotation_weight] * turn
                g[ROW.weight + j, i] = g[ROW.weight + i, j]
    inverse_weight(g[ROW.weight :], n)


@inner
def _velocity(g, joint, p):
    """Velocity of world point p per unit speed of a joint."""
    x, y, z = _axis(g, joint)
    if g[ROW.sliding, joint] == 1.0:
        return (x, y, z)
    u, v, w = _from_origin(g, joint, p)
    return (y * w - z * v, z * u - x * w, x * v - y * u)


@kernel
def scale_to_speeds(g, x):
    """Scale all speeds together to the speed limits of the joints, in place; their direction is kept.

    Args:
        g: array of the robot, see `robot_arrays`.
        x: (n,) joint speeds.
    """
    scale = 1.0
    for i in range(len(x)):
        scale = min(scale, g[ROW.speed, i] / max(abs(x[i]), 1e-300))
    if scale < 1.0:
        for i in range(len(x)):
            x[i] *= scale


@kernel
def exceeds_limits(g, q, x):
    """Return True if a joint approaches a limit too fast, or changes its speed by more than the slew.

    Args:
        g: array of the robot, see `robot_arrays`.
        q: (n,) joints of all arms.
        x: (n,) joint speeds.
    """
    for i in range(len(x)):
        low, high = _reachable_speeds(g, q, i)
        if x[i] > high or x[i] < low:
            return True
    return False


@kernel
def clip_to_limits(g, q, x):
    """Clip every speed to its bounds, in place: the quadratic program meets them only up to rounding.

    Args:
        g: array of the robot, see `robot_arrays`.
        q: (n,) joints of all arms.
        x: (n,) joint speeds.
    """
    for i in range(len(q)):
        low, high = allowed_speeds(g, q, i)
        x[i] = min(max(x[i], low), high)


@kernel
def constrain(g, q, x):
    """Change speeds to the nearest ones that satisfy all bounds; returns True if a bound of a pair cannot hold.

    Args:
        g: array of the robot, see `robot_arrays`; its near pairs found and its capsules placed at ROW.placed.
        q: (n,) joints of all arms.
        x: (n,) joint speeds, changed in place.
    """
    n = int(g[ROW.header, HEADER.joints])
    count = _lay_bounds(g, q)
    first = int(g[ROW.header, HEADER.first_bound])
    rows = g[first : first + count]
    if all_hold(rows, count, x, n):
        return False
    _lay_weight(g)
    ok = solve(x, g[ROW.weight :], rows, count, g[ROW.active], g[ROW.factor : ROW.obstacles], n)
    missed = not ok
    for k in range(int(g[ROW.header, HEADER.near])):
        if SLACK * rows[k, QP.multiplier] > 1e-4:
            missed = True
    return missed
