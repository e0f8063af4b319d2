"""Bugs of the planner, each with the tests that must notice it."""

from __future__ import annotations

from typing import NamedTuple


class Bug(NamedTuple):
    """A change of the source, and the test file and expression (as of pytest's -k) that must notice.

    Attributes:
        name: what it is.
        file: in the planner.
        old: text that stands there once.
        new: what it becomes.
        tests: file and names of tests, in tests/planner.
    """

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, str]


SEARCH = ("proximity", "exhaustive or parallel_segments or within_the_rounding")
PLANE = ("proximity", "separating_plane or tangent_plane")
CUTOFF = ("proximity", "quick_query")
PAIR = ("proximity", "two_segments or two_capsules")
NEAR = ("clearance", "near_pairs or smallest_room")
MASKED = ("clearance", "masked_pairs")
ROWS = ("clearance", "bounds_are_the_derivatives")
ARMS = ("clearance", "bounds_of_two_arms")
WAY = ("clearance", "farther_than_its_bound or bound_of_one_joint or bound_grows")
STEP = ("steps", "tunnel or small_ball or one_joint_bends or too_close_may_part or short_motion")
EDGE = ("steps", "edge_past or edge_of_a_tool")
ROOM = ("repet", "first_blocked")
CLOSED = ("safety_layer", "closed_form or along_a_surface or rises")
GUARD = ("safety_layer", "jumped_over or margin_goes_before or too_close_is_left")
LIMITS = ("safety_layer", "limits_are_never or pushed or beyond_a_limit")
MOVING = ("safety_layer", "sphere")
HULL = ("hull_distance", "of_fcl or slack_is_exact")
HULL_STEP = ("hull_distance", "turns_about_its_end or proven_motion")

BUGS = [
    Bug(
        "rounding radius dropped",
        "collision/proximity",
        "else length) - rows[k, OBSTACLE.rounding], t, normal",
        "else length), t, normal",
        SEARCH,
    ),
    Bug(
        "rounding radius dropped from the quick query",
        "collision/proximity",
        "_from_capsule(rows, k, a, b)[1]) - rows[k, OBSTACLE.rounding]",
        "_from_capsule(rows, k, a, b)[1])",
        CUTOFF,
    ),
    Bug(
        "world into shape turned the wrong way",
        "collision/proximity",
        "rows[k, r] * x + rows[k, r + 3] * y + rows[k, r + 6] * z",
        "rows[k, r] * x + rows[k, r + 1] * y + rows[k, r + 2] * z",
        SEARCH,
    ),
    Bug(
        "normal into world turned the wrong way",
        "collision/proximity",
        "rows[k, r] * v[0] + rows[k, r + 1] * v[1] + rows[k, r + 2] * v[2]",
        "rows[k, r] * v[0] + rows[k, r + 3] * v[1] + rows[k, r + 6] * v[2]",
        PLANE,
    ),
    Bug(
        "ball of the shape dropped from the cutoff",
        "collision/proximity",
        "far = reach + rows[k, OBSTACLE.ball]",
        "far = reach",
        CUTOFF,
    ),
    Bug("box search stopped early", "collision/proximity", "for _ in range(40):", "for _ in range(1):", SEARCH),
    Bug(
        "capsule end not looked at again",
        "collision/proximity",
        "t = clamped((s * da - pd) * (1.0 / max(dd, TINY)), 0.0, 1.0)",
        "t = 1.0 * t",
        SEARCH,
    ),
    Bug("cylinder hollow", "collision/proximity", "if r > radius else 0.0", "if r > 0.0 else 0.0", SEARCH),
    Bug(
        "segment end not looked at again",
        "collision/proximity",
        "t = clamped((uv * s - uw) / uu, 0.0, 1.0) if uu > 0.0 else 0.0",
        "t = 1.0 * t",
        PAIR,
    ),
    Bug(
        "distance of polytopes not proven",
        "geometry/gjk",
        "proven = max(0.0, dot(v, w) / length)",
        "proven = length",
        ("proximity", "proven_from_below"),
    ),
    Bug(
        "obstacle moves backwards",
        "collision/clearance",
        "p[0] - seconds * g[o, v]",
        "p[0] + seconds * g[o, v]",
        ("clearance", "later_means"),
    ),
    Bug("radius of the arm dropped", "collision/clearance", "a, b) - g[ROW.body + c, CAPSULE.radius]", "a, b)", NEAR),
    Bug(
        "radius dropped from near pairs",
        "collision/clearance",
        "            distance -= g[ROW.body + c, CAPSULE.radius]\n",
        "",
        NEAR,
    ),
    Bug(
        "first pair of the robot left out",
        "collision/clearance",
        "for p in range(pair, pair + int",
        "for p in range(pair + 1, pair + int",
        NEAR,
    ),
    Bug(
        "last obstacle left out",
        "collision/clearance",
        "for k in range(int(g[ROW.header, HEADER.obstacles])):\n        if all_beyond(g, ROW.placed",
        "for k in range(int(g[ROW.header, HEADER.obstacles]) - 1):\n        if all_beyond(g, ROW.placed",
        NEAR,
    ),
    Bug(
        "margin of near pairs dropped",
        "collision/clearance",
        "c, k, distance, margin, normal",
        "c, k, distance, 0.0, normal",
        NEAR,
    ),
    Bug(
        "ball about the arm too small",
        "collision/capsule_placement",
        "v * v + w * w) + g[ROW.body + c, CAPSULE.ball])",
        "v * v + w * w))",
        NEAR,
    ),
    Bug(
        "ball about a capsule without its radius",
        "collision/robot_arrays",
        "axis=1) + capsules[:, TOOL_CAPSULE.radius]",
        "axis=1)",
        NEAR,
    ),
    Bug(
        "mask of the wrong obstacle",
        "collision/capsule_placement",
        "g[ROW.obstacles + obstacle, OBSTACLE.mask",
        "g[ROW.obstacles, OBSTACLE.mask",
        MASKED,
    ),
    Bug(
        "lever of the nearer end",
        "collision/step_certificates",
        "square = max(_lever_square(g, joint, a), _lever_square(g, joint, b))",
        "square = min(_lever_square(g, joint, a), _lever_square(g, joint, b))",
        WAY,
    ),
    Bug(
        "lever does not grow",
        "collision/step_certificates",
        "(math.sqrt(square) + displacement)",
        "math.sqrt(square)",
        WAY,
    ),
    Bug(
        "displacement of sliding joints dropped",
        "collision/step_certificates",
        "displacement += abs(step[joint])\n",
        "displacement += 0.0\n",
        WAY,
    ),
    Bug("bend dropped", "collision/step_certificates", "bend = 0.25 * turning * displacement", "bend = 0.0", STEP),
    Bug(
        "velocity of the obstacle dropped from the plane",
        "collision/step_certificates",
        "return dt * (g[o, v] * normal[0]",
        "return 0.0 * (g[o, v] * normal[0]",
        STEP,
    ),
    Bug(
        "velocity of the obstacle dropped from the displacement",
        "collision/step_certificates",
        "distance + distance_end - displacement - other >=",
        "distance + distance_end - displacement >=",
        STEP,
    ),
    Bug(
        "displacement of the arm dropped",
        "collision/step_certificates",
        "distance + distance_end - displacement - other >=",
        "distance + distance_end - other >=",
        STEP,
    ),
    Bug(
        "margin dropped within a step",
        "collision/step_certificates",
        "other >= 2.0 * margin",
        "other >= 0.0 * margin",
        STEP,
    ),
    Bug(
        "plane moved to the wrong side",
        "collision/step_certificates",
        "min(distance, distance + forth -",
        "min(distance, distance - forth -",
        STEP,
    ),
    Bug(
        "speed of obstacles dropped from the reach",
        "collision/step_certificates",
        "displacement + dt * fastest)",
        "displacement)",
        STEP,
    ),
    Bug(
        "margin dropped from the reach",
        "collision/step_certificates",
        "return margin + max(2.0 * displacement",
        "return max(2.0 * displacement",
        GUARD,
    ),
    Bug(
        "joints of the first arm for both",
        "collision/clearance",
        "return int(g[ROW.arms, ARM_ENTRY.width * int(g[ROW.body + c, CAPSULE.arm]) + ARM_ENTRY.first_joint])",
        "return 0",
        ARMS,
    ),
    Bug(
        "sign of the bound",
        "safety/barrier",
        "NEAR_PAIR.point), normal, 1.0)",
        "NEAR_PAIR.point), normal, -1.0)",
        ROWS,
    ),
    Bug(
        "sign of the other capsule",
        "safety/barrier",
        "NEAR_PAIR.other_point), normal, -1.0)",
        "NEAR_PAIR.other_point), normal, 1.0)",
        ROWS,
    ),
    Bug(
        "joints in reversed order",
        "safety/barrier",
        "g[row, first + joint] += sign",
        "g[row, start + int(g[ROW.body + c, CAPSULE.frame]) - joint] += sign",
        ROWS,
    ),
    Bug(
        "closest point at the wrong end",
        "safety/barrier",
        "_on_core(g, c, g[k, t])",
        "_on_core(g, c, 1.0 - g[k, t])",
        ROWS,
    ),
    Bug(
        "obstacle velocity with the wrong sign",
        "safety/barrier",
        "need += normal[0] * g[o, v]",
        "need -= normal[0] * g[o, v]",
        ROWS,
    ),
    Bug(
        "margin dropped from the bound",
        "safety/barrier",
        "(g[k, NEAR_PAIR.distance] - g[k, NEAR_PAIR.margin] - buffer)",
        "(g[k, NEAR_PAIR.distance] - buffer)",
        CLOSED,
    ),
    Bug("sign of the rate", "safety/barrier", "need = -alpha *", "need = alpha *", CLOSED),
    Bug(
        "sliding joint taken for a turning one",
        "safety/barrier",
        "if g[ROW.sliding, joint] == 0.0:\n            u, v, w",
        "if g[ROW.sliding, joint] >= 0.0:\n            u, v, w",
        ROWS,
    ),
    Bug(
        "limits swapped",
        "safety/barrier",
        "low if sign > 0.0 else -high",
        "low if sign < 0.0 else -high",
        ("clearance", "last_bounds"),
    ),
    Bug(
        "approach to limits unbounded",
        "safety/barrier",
        "min(g[ROW.speed, i], max(0.0, gain * (g[ROW.upper, i] - q[i])))",
        "g[ROW.speed, i]",
        LIMITS,
    ),
    Bug(
        "multipliers of the wrong sign",
        "safety/qp",
        "x[i] += t * z",
        "x[i] -= t * z",
        ("qp", "closed_form or quadprog"),
    ),
    Bug("slack forgotten", "safety/qp", "s = rows[i, QP.softness] if i == j else 0.0", "s = 0.0", ("qp", "soft")),
    Bug(
        "guard does not look between the ends",
        "safety/safety_layer",
        "if gentle and (whole or step_stays_clear(g, q, step[:n], dt)):",
        "if gentle:",
        GUARD,
    ),
    Bug(
        "guard does not look at all",
        "safety/safety_layer",
        "if gentle and (whole or step_stays_clear(g, q, step[:n], dt)):",
        "if True:",
        GUARD,
    ),
    Bug(
        "guard takes every whole step for clear",
        "safety/safety_layer",
        "whole = k == 0 and",
        "whole = k == 0 or",
        GUARD,
    ),
    Bug(
        "guard takes shorter steps for the whole one",
        "safety/safety_layer",
        "whole = k == 0 and placed_step_stays_clear(g, step[:n], 0.0, dt)",
        "whole = k > 0 or placed_step_stays_clear(g, step[:n], 0.0, dt)",
        GUARD,
    ),
    Bug("all bounds are taken to hold", "safety/barrier", "if all_hold(rows, count, x, n):", "if True:", CLOSED),
    Bug(
        "guard sends what it has refused",
        "safety/safety_layer",
        "                x[i] *= scale\n            return FREE",
        "                x[i] *= 1.0\n            return FREE",
        GUARD,
    ),
    Bug(
        "guard does not look beyond the shell",
        "safety/safety_layer",
        "if reach > g[ROW.settings, SETTING.shell]:",
        "if reach < 0.0:",
        GUARD,
    ),
    Bug(
        "guard tries no step but the whole",
        "safety/safety_layer",
        "scale *= 0.5",
        "scale *= 1.0",
        ("safety_layer", "along_a_surface or jumped_over or margin_goes_before or closed_form or shrinks"),
    ),
    Bug(
        "not a number goes through",
        "safety/safety_layer",
        "qdot[i] if math.isfinite(qdot[i]) else 0.0",
        "qdot[i]",
        ("safety_layer", "absurd"),
    ),
    Bug(
        "blocked is hidden",
        "safety/safety_layer",
        "return BLOCKED if missed else status",
        "return min(status, HELD)",
        MOVING,
    ),
    Bug(
        "slack ahead is not used up",
        "escape/detour",
        "        left -= displacement\n",
        "        left -= 0.0 * displacement\n",
        ROOM,
    ),
    Bug(
        "slack ahead is used once too often",
        "escape/detour",
        "if left <= displacement and not",
        "if left <= -displacement and not",
        ROOM,
    ),
    Bug("slide goes on too far", "collision/edge_certificates", "s -= slack / slope", "s -= 3.0 * slack / slope", EDGE),
    Bug(
        "screw goes on too far",
        "collision/edge_certificates",
        "part = slack / speed",
        "part = 3.0 * slack / speed",
        EDGE,
    ),
    Bug(
        "turning dropped from a screw's speed",
        "collision/edge_certificates",
        "v[0] + u[0], v[1] + u[1], v[2] + u[2]",
        "v[0], v[1], v[2]",
        EDGE,
    ),
    Bug(
        "tangent plane left-handed",
        "escape/tangent_plane",
        "return screw.cross(v, normal), v",
        "return screw.cross(normal, v), v",
        ("proximity", "basis_of_a_plane"),
    ),
    Bug(
        "distance of hulls not proven",
        "geometry/convex_distance",
        "return proven, normal, blend",
        "return math.sqrt(dot(v, v)) + 1e-3, normal, blend",
        HULL,
    ),
    Bug(
        "rounding of a hull dropped",
        "collision/hull_distance",
        "less = rounding + g[o, OBSTACLE.rounding]",
        "less = g[o, OBSTACLE.rounding]",
        HULL,
    ),
    Bug(
        "touching hulls are clear",
        "collision/hull_distance",
        "(core - less if core > 0.0 else NONE), normal, point",
        "(core - less if core > 0.0 else 1.0), normal, point",
        HULL,
    ),
    Bug(
        "hulls move no farther than cores",
        "collision/step_certificates",
        "= turning * g[ROW.body + c, CAPSULE.radius]",
        "= -turning * g[ROW.body + c, CAPSULE.radius]",
        HULL_STEP,
    ),
]
