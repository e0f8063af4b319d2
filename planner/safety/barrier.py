"""Bounds on joint speeds that keep what is close from coming too close, and the nearest speeds that keep them.

For every close pair the approach is at most proportional to the room that is left,
`n . (J qdot - v) >= -alpha * slack`; all pairs at once, by the nearest joint speeds in the sense of the tools' motion.
Method reference section 7, velocity form. The paper projects a pose error instead, and its formula adds a vector to
a unit dual quaternion (section 12, item 5).
"""

from __future__ import annotations

from ..collision.clearance import FIRST, GAP, KEEP, KIND, NORMAL, OTHER, S, T, first_joint
from ..collision.robot_arrays import (
    ACTIVE,
    ARMS,
    B_FRAME,
    BODY,
    BOUNDS,
    FACTOR,
    FRAMES,
    HEADER,
    HIGH,
    LOW,
    N_ARMS,
    N_JOINTS,
    N_NEAR,
    NEAR,
    OBSTACLES,
    PREVIOUS,
    SETTINGS,
    SLIDING,
    SPEED,
    TCPS,
    WEIGHT,
    WORLD,
    end_a,
    end_b,
)
from ..geometry.screw import translation
from ..jit import inner, kernel
from .qp import BOUND, MULTIPLIER, SLACK, SOFTNESS, all_hold, inverse_weight, solve

SHELL, ALPHA, BUFFER, LIMIT_GAIN, ROTATION_WEIGHT, REST_WEIGHT, DECAY, HALVINGS, SLEW = range(9)
"""Columns of SETTINGS, see `safety.SafetySettings`; column 10 is the distance between parts of the robot."""


@inner
def _add_column(g, row, first, c, p, normal, sign):
    """Add `sign n . J` of world point p on capsule c to a row of bounds."""
    start = first_joint(g, c)
    for joint in range(start, int(g[BODY + c, B_FRAME]) + 1):
        f = FRAMES + joint
        x, y, z = g[f, 0], g[f, 1], g[f, 2]
        if g[SLIDING, joint] == 0.0:
            u, v, w = p[0] - g[f, 3], p[1] - g[f, 4], p[2] - g[f, 5]
            x, y, z = y * w - z * v, z * u - x * w, x * v - y * u
        g[row, first + joint] += sign * (normal[0] * x + normal[1] * y + normal[2] * z)


@inner
def _on_core(g, c, t):
    a, b = end_a(g, WORLD + c), end_b(g, WORLD + c)
    return (a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2]))


@inner
def _lay_bounds(g, q):
    """Rows of the quadratic program: near pairs, then joint limits; returns their number."""
    n, row, alpha = int(g[HEADER, N_JOINTS]), int(g[HEADER, BOUNDS]), g[SETTINGS, ALPHA]
    first, near = int(g[HEADER, NEAR]), int(g[HEADER, N_NEAR])
    for k in range(first, first + near):
        for i in range(n):
            g[row, i] = 0.0
        normal = (g[k, NORMAL], g[k, NORMAL + 1], g[k, NORMAL + 2])
        i, j, need = int(g[k, FIRST]), int(g[k, OTHER]), -alpha * (g[k, GAP] - g[k, KEEP] - g[SETTINGS, BUFFER])
        _add_column(g, row, 0, i, _on_core(g, i, g[k, T]), normal, 1.0)
        if g[k, KIND] == 1.0:
            _add_column(g, row, 0, j, _on_core(g, j, g[k, S]), normal, -1.0)
        else:
            o = OBSTACLES + j
            need += normal[0] * g[o, 17] + normal[1] * g[o, 18] + normal[2] * g[o, 19]
        g[row, BOUND], g[row, SOFTNESS] = need, SLACK
        row += 1
    for i in range(n):
        low, high = _reachable_speeds(g, q, i)
        for sign in (1.0, -1.0):
            for j in range(n):
                g[row, j] = 0.0
            g[row, i] = sign
            g[row, BOUND], g[row, SOFTNESS] = low if sign > 0.0 else -high, 0.0
            row += 1
    return near + 2 * n


@kernel
def allowed_speeds(g, q, i):
    """Lowest and highest speed of joint i: its largest speed, and its approach to a position limit."""
    gain = g[SETTINGS, LIMIT_GAIN]
    low = max(-g[SPEED, i], min(0.0, gain * (g[LOW, i] - q[i])))
    return low, min(g[SPEED, i], max(0.0, gain * (g[HIGH, i] - q[i])))


@inner
def _reachable_speeds(g, q, i):
    """Of the allowed speeds of joint i those within the slew of its last one; the nearest one if there is none."""
    low, high = allowed_speeds(g, q, i)
    slower, faster = g[PREVIOUS, i] - g[SETTINGS, SLEW], g[PREVIOUS, i] + g[SETTINGS, SLEW]
    return min(high, max(low, slower)), max(low, min(high, faster))


@inner
def _lay_weight(g):
    """`J^T J` of all tools plus a little of every joint, so that the elbow gives way before the hand; inverted."""
    n = int(g[HEADER, N_JOINTS])
    for i in range(n):
        for j in range(n):
            g[WEIGHT + i, j] = g[SETTINGS, REST_WEIGHT] if i == j else 0.0
    for k in range(int(g[HEADER, N_ARMS])):
        first, dof = int(g[ARMS, 3 * k]), int(g[ARMS, 3 * k + 1])
        p = translation((g[TCPS + k, 0], g[TCPS + k, 1], g[TCPS + k, 2], g[TCPS + k, 3],
                         g[TCPS + k, 4], g[TCPS + k, 5], g[TCPS + k, 6], g[TCPS + k, 7]))  # fmt: skip
        for i in range(first, first + dof):
            for j in range(first, i + 1):
                v, w = _velocity(g, i, p), _velocity(g, j, p)
                s = v[0] * w[0] + v[1] * w[1] + v[2] * w[2]
                turn = g[FRAMES + i, 0] * g[FRAMES + j, 0] + g[FRAMES + i, 1] * g[FRAMES + j, 1]
                turn += g[FRAMES + i, 2] * g[FRAMES + j, 2]
                if g[SLIDING, i] == 1.0 or g[SLIDING, j] == 1.0:
                    turn = 0.0
                g[WEIGHT + i, j] += s + g[SETTINGS, ROTATION_WEIGHT] * turn
                g[WEIGHT + j, i] = g[WEIGHT + i, j]
    inverse_weight(g[WEIGHT:], n)


@inner
def _velocity(g, joint, p):
    """Velocity of world point p per unit speed of a joint."""
    f = FRAMES + joint
    x, y, z = g[f, 0], g[f, 1], g[f, 2]
    if g[SLIDING, joint] == 1.0:
        return (x, y, z)
    u, v, w = p[0] - g[f, 3], p[1] - g[f, 4], p[2] - g[f, 5]
    return (y * w - z * v, z * u - x * w, x * v - y * u)


@kernel
def scale_to_speeds(g, x):
    """Scale all speeds together to the largest that the joints can; their direction is kept."""
    scale = 1.0
    for i in range(len(x)):
        scale = min(scale, g[SPEED, i] / max(abs(x[i]), 1e-300))
    if scale < 1.0:
        for i in range(len(x)):
            x[i] *= scale


@kernel
def exceeds_limits(g, q, x):
    """True if a joint approaches one of its limits faster than it may, or changes its speed by more."""
    for i in range(len(x)):
        low, high = _reachable_speeds(g, q, i)
        if x[i] > high or x[i] < low:
            return True
    return False


@kernel
def clip_to_limits(g, q, x):
    """Every joint within its bounds, exactly: for the last digits that the quadratic program leaves."""
    for i in range(len(q)):
        low, high = allowed_speeds(g, q, i)
        x[i] = min(max(x[i], low), high)


@kernel
def constrain(g, q, x):
    """Change the speeds x to the nearest ones that keep all bounds; True if a bound of an obstacle cannot hold."""
    n = int(g[HEADER, N_JOINTS])
    count = _lay_bounds(g, q)
    first = int(g[HEADER, BOUNDS])
    rows = g[first : first + count]
    if all_hold(rows, count, x, n):
        return False
    _lay_weight(g)
    ok = solve(x, g[WEIGHT:], rows, count, g[ACTIVE], g[FACTOR : FACTOR + 32], n)
    missed = not ok
    for k in range(int(g[HEADER, N_NEAR])):
        if SLACK * rows[k, MULTIPLIER] > 1e-4:
            missed = True
    return missed
