"""Placement of obstacles: they block the task for any method, but never make it impossible.

An obstacle overlaps the volume swept by hand and held object on the straight line between the raised ends of a motion.
It leaves clearance at both ends of all motions, above them and at the start; and at each of these poses the arm has a
posture clear of it.
"""

from __future__ import annotations

import numpy as np

from ...planner import Box, Capsule, Obstacle, Pose, Shape, Sphere
from ...planner.geometry.shapes import pack
from ..scene.body_clearance import arm_clearance, capsule_ends, tool_clearance
from ..simulation.moving_obstacles import ScheduledObstacle
from .placement_context import SOLID_CLEARANCE, ObstacleRequest, PlacementContext, PlacementMotion

KEY_CLEARANCE, SWING_CLEARANCE = 0.03, 0.02
"""Least clearances [m] of the hand at key poses, and there beside a swinging obstacle."""
TRIES = 60
"""Positions tried for each obstacle."""
LARGEST = 0.10
SMALLEST = 0.03
SLOWEST, FASTEST = 0.05, 0.3
"""Bounds of an obstacle's extents [m] and of its peak speed [m/s]."""
SWING = (0.08, 0.15)
"""Range of a swing's amplitude [m]."""
PHASES = np.arange(5) * 2.0 * np.pi / 5.0


def placed(
    rng: np.random.Generator, kind: str, context: PlacementContext, wanted: list[ObstacleRequest] | None = None
) -> tuple[ScheduledObstacle, ...] | None:
    """Place obstacles of a kind; return None where they do not fit.

    Args:
        rng: source of randomness.
        kind: "static" (1 to 3), "appear", "moving", "unforeseen" ("appear" or "moving"), "forearm" or "paper".
        context: scene into which they are placed.
        wanted: obstacles of the kind "paper".
    """
    if kind == "unforeseen":
        kind = ("moving", "appear")[rng.integers(2)]
    count = int(rng.integers(1, 4)) if kind == "static" else 1
    orders = wanted or [ObstacleRequest(kind, int(motion)) for motion in rng.permutation(len(context.motions))[:count]]
    found: list[ScheduledObstacle] = []
    for order in orders:
        one = _placed_one(rng, order, context, found)
        if one is None:
            return None
        found.append(one)
    return tuple(found)


def _placed_one(
    rng: np.random.Generator, order: ObstacleRequest, context: PlacementContext, others: list[ScheduledObstacle]
) -> ScheduledObstacle | None:
    make = {"static": _still, "appear": _appearing, "moving": _swinging, "forearm": _at_forearm}[order.kind]
    for _ in range(TRIES):
        one = make(rng, context, order.motion, order.size)
        if one is not None and _apart(one, others) and _fits(context, one, order.kind, others):
            return one
    return None


def _fits(context: PlacementContext, one: ScheduledObstacle, kind: str, others: list[ScheduledObstacle]) -> bool:
    times = (PHASES - one.phase) / one.frequency if one.frequency else np.zeros(1)
    places = pack([Obstacle(one.shape, one.pose(time)) for time in times])
    motion, tool = context.motions[one.blocked_motion], context.tools[one.blocked_motion]
    near = tool_clearance(tool, motion.sweep, places)
    if (near < KEY_CLEARANCE) if kind == "forearm" else (near >= 0.0):
        return False
    # an obstacle that appears is absent at the start; `ObstacleDistance.has_room` checks it again when it appears
    clearance = SWING_CLEARANCE if one.frequency else KEY_CLEARANCE
    if not context.has_room(places, clearance):
        return False
    # postures must be clear of all static obstacles at once
    still = [Obstacle(each.shape, each.pose(0.0)) for each in (*others, one) if not each.frequency]
    return bool(one.frequency) or context.has_postures(pack(still))


def _apart(one: ScheduledObstacle, others: list[ScheduledObstacle]) -> bool:
    return all(np.linalg.norm(np.subtract(one.center, each.center)) > LARGEST + SOLID_CLEARANCE for each in others)


def _shape(rng: np.random.Generator, size: float | None) -> tuple[Shape, tuple[float, ...]]:
    """Return a shape, its extents drawn or given, and its rotation (wxyz)."""
    x, y, z = (float(v) for v in rng.uniform(SMALLEST, LARGEST, 3)) if size is None else (size, size, size)
    turn = rng.normal(size=4)
    kind = rng.integers(3)
    if kind == 0:
        return Sphere(0.5 * x), (1.0, 0.0, 0.0, 0.0)
    rotation = tuple(float(v) for v in turn / np.linalg.norm(turn))
    if kind == 1:
        return Box((x, y, z)), rotation
    radius = 0.25 * x + 0.005
    return Capsule(radius, max(z - 2.0 * radius, 0.01)), rotation


def _center(rng: np.random.Generator, motion: PlacementMotion, low: float, high: float) -> np.ndarray:
    """Draw a point (3,) near the hand's straight path."""
    a, b = motion.start.position, motion.end.position
    direction = (b - a) / max(float(np.linalg.norm(b - a)), 1e-9)
    side = np.array([-direction[1], direction[0], 0.0])
    middle = a + rng.uniform(low, high) * (b - a)
    return (
        middle
        + rng.uniform(-motion.aside, motion.aside) * side
        + np.array([0, 0, rng.uniform(-motion.above, motion.above)])
    )


def _still(rng: np.random.Generator, context: PlacementContext, motion: int, size: float | None) -> ScheduledObstacle:
    shape, rotation = _shape(rng, size)
    return ScheduledObstacle(
        shape, _tuple(_center(rng, context.motions[motion], 0.3, 0.7)), rotation, blocked_motion=motion
    )


def _appearing(
    rng: np.random.Generator, context: PlacementContext, motion: int, size: float | None
) -> ScheduledObstacle:
    shape, rotation = _shape(rng, size)
    center = _tuple(_center(rng, context.motions[motion], 0.4, 0.7))
    delay = float(rng.uniform(0.5, 2.0))
    return ScheduledObstacle(
        shape, center, rotation, motion=context.motions[motion].motion, delay=delay, blocked_motion=motion
    )


def _swinging(
    rng: np.random.Generator, context: PlacementContext, motion: int, speed: float | None
) -> ScheduledObstacle:
    shape, rotation = _shape(rng, None)
    direction = context.motions[motion].end.position - context.motions[motion].start.position
    heading = np.arctan2(direction[1], direction[0]) + 0.5 * np.pi + rng.uniform(-0.5, 0.5)
    amplitude = rng.uniform(*SWING)
    long = amplitude * np.array([np.cos(heading), np.sin(heading), rng.uniform(-0.3, 0.3)])
    short = rng.uniform(0.0, 0.3) * amplitude * np.array([-np.sin(heading), np.cos(heading), 0.0])
    peak = rng.uniform(SLOWEST, FASTEST) if speed is None else speed
    center = _tuple(_center(rng, context.motions[motion], 0.35, 0.65))
    frequency, phase = peak / float(np.linalg.norm(long)), float(rng.uniform(0.0, 2.0 * np.pi))
    return ScheduledObstacle(
        shape, center, rotation, _tuple(long), _tuple(short), frequency, phase, blocked_motion=motion
    )


def _at_forearm(
    rng: np.random.Generator, context: PlacementContext, motion: int, size: float | None
) -> ScheduledObstacle | None:
    """Return a static obstacle in the path of a link between elbow and wrist, or None."""
    postures = context.nominal(context.motions[motion])
    links = range(context.arm.dof - 4, context.arm.dof - 2)
    if not postures:
        return None
    shape, rotation = _shape(rng, size)
    ends = capsule_ends(context.arm, context.body, postures[int(rng.integers(len(postures)))], links)
    a, b = ends[int(rng.integers(len(ends)))]
    point = a + rng.uniform() * (b - a) + rng.uniform(-0.03, 0.03, 3)
    place = pack([Obstacle(shape, Pose.from_position_quaternion(point, rotation))])
    hit = min(arm_clearance(context.arm, context.body, q, place, links) for q in postures)
    return ScheduledObstacle(shape, _tuple(point), rotation, blocked_motion=motion) if hit < 0.0 else None


def _tuple(vector: np.ndarray) -> tuple[float, float, float]:
    return float(vector[0]), float(vector[1]), float(vector[2])
