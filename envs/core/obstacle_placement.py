"""Where obstacles are put: in the way of the task, whatever method does it, and never where the task cannot be done.

An obstacle overlaps what the hand and the held object sweep on the straight line between the raised ends of a
motion; it leaves room at all ends of all motions, above them and at the start; and at each of these a posture of the
arm exists that is clear of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...planner.control.inverse_kinematics import inverse_kinematics
from ...planner.geometry.dualquat import sclerp
from ...planner.geometry.pose import Pose
from ...planner.geometry.shapes import Box, Capsule, Obstacle, Packed, Shape, Sphere, pack
from ...planner.robot.arm import Arm
from ...planner.robot.body import Body
from ..scene.body_clearance import arm_clearance, capsule_ends, point_clearance, tool_clearance
from ..simulation.moving_obstacles import ScheduledObstacle

START_CLEARANCE, KEY_CLEARANCE, SWING_CLEARANCE, POSTURE_CLEARANCE, SOLID_CLEARANCE, FLOOR_CLEARANCE = (
    0.05,
    0.03,
    0.02,
    0.02,
    0.02,
    0.03,
)
"""Least room [m]: of the arm at the start; of the hand at key poses, beside a swinging one; of the arm's posture there;
of objects and furniture; above the table."""
SEEDS = 24
"""Postures that are tried at each key pose."""
NEAR = 1.0
"""Change of a joint [rad] from key to key of a straight motion up to which it is the same posture."""
TRIES = 60
"""Places that are tried for each obstacle."""
SWEEP = 21
"""Poses along a motion at which it is seen what the hand sweeps."""
LARGEST = 0.10
SMALLEST = 0.03
SLOWEST, FASTEST = 0.05, 0.3
"""Of an obstacle's extents [m] and of its peak speed [m/s]."""
SWING = (0.08, 0.15)
"""Half the length of a swing [m]."""
PHASES = np.arange(5) * 2.0 * np.pi / 5.0


@dataclass(frozen=True)
class PlacementMotion:
    """A motion of the hand that obstacles are put in the way of.

    Attributes:
        start: tcp at its raised beginning.
        end: tcp at its raised end.
        keys: tcp poses that must stay possible, each as its symmetric alternatives.
        shape: of what is held.
        tcp_from_object: how it is held.
        motion: the task's motion index while the hand is on it.
        aside: how far [m] to the side of the hand's straight way an obstacle's center may be.
        above: how far [m] above or below it: more for what sweeps more.
        straight: so many of the last keys are one straight motion, which an arm does without changing its posture.
    """

    start: Pose
    end: Pose
    keys: tuple[tuple[Pose, ...], ...]
    shape: Shape
    tcp_from_object: Pose
    motion: int
    aside: float = 0.02
    above: float = 0.03
    straight: int = 1

    @cached_property
    def sweep(self) -> np.ndarray:
        """(SWEEP, 8) poses along it."""
        return sclerp(self.start.dq, self.end.dq, np.linspace(0.0, 1.0, SWEEP))


class ObstacleRequest(NamedTuple):
    """An obstacle that is wanted.

    Attributes:
        kind: "static", "appear", "moving" or "forearm".
        leg: index of the motion that it is in the way of.
        size: of a still one [m], peak speed of a moving one [m/s]; None: drawn.
    """

    kind: str
    leg: int
    size: float | None = None


class PlacementContext:
    """What obstacles are placed into.

    Args:
        legs: all motions.
        arm: whose hand moves.
        body: of it, with an empty hand.
        joints: (dof,) at the start.
        solids: what else stands there.
        things: those of them that are no part of the robot's place.
        floor: z of the table top [m].
    """

    def __init__(
        self,
        legs: list[PlacementMotion],
        arm: Arm,
        body: Body,
        joints: np.ndarray,
        solids: list[Obstacle],
        things: list[Obstacle],
        floor: float,
    ):
        self.legs, self.arm, self.body, self.joints, self.floor = legs, arm, body, joints, floor
        self.tools = [body.holding("held", leg.shape, leg.tcp_from_object, arm).tool(arm) for leg in legs]
        self._solids, self._things = pack(solids), pack(things)
        self._keys = [key for leg in legs for key in _alternatives(leg)]
        self._key_poses = [np.array([pose.dq for key in leg.keys for pose in key]) for leg in legs]
        self._postures: dict[int, list[list[np.ndarray]]] = {}

    def has_room(self, places: Packed, clearance: float) -> bool:
        """Whether the start, the key poses, the solids and the table keep their distance to an obstacle's places."""
        for row in places.rows:
            center, ball = row[2:5], row[20]
            if (
                center[2] - ball < self.floor + FLOOR_CLEARANCE
                or point_clearance(center, self._solids) - ball < SOLID_CLEARANCE
            ):
                return False
        if arm_clearance(self.arm, self.body, self.joints, places) < START_CLEARANCE:
            return False
        return all(
            tool_clearance(tool, poses, places) >= clearance
            for tool, poses in zip(self.tools, self._key_poses, strict=True)
        )

    def has_postures(self, places: Packed) -> bool:
        """Whether at each key pose, and along what is straight, the arm has a posture clear of all these obstacles."""
        return all(
            any(
                all(arm_clearance(self.arm, self.body, q, places) >= POSTURE_CLEARANCE for q in postures)
                for postures in self._postures_at(index)
            )
            for index in range(len(self._keys))
        )

    def nominal(self, leg: PlacementMotion) -> list[np.ndarray]:
        """Postures (dof,) of the arm along a leg, each near the one before; none where it cannot follow."""
        q, found = self.joints, []
        for row in leg.sweep[::2]:
            reached = inverse_kinematics(self.arm, Pose(row), q)
            if reached is None:
                return []
            q = reached
            found.append(q)
        return found

    def _postures_at(self, index: int) -> list[list[np.ndarray]]:
        """The postures at a key pose and on from there, remembered; the same for every start alike."""
        if index not in self._postures:
            rng = np.random.default_rng(index)
            seeds = [self.joints, *rng.uniform(self.arm.lower, self.arm.upper, (SEEDS - 1, self.arm.dof))]
            tried = [self._along(line, q) for q in seeds for line in self._keys[index]]
            self._postures[index] = [postures for postures in tried if postures]
        return self._postures[index]

    def _along(self, line: tuple[Pose, ...], seed: np.ndarray) -> list[np.ndarray]:
        """Postures at the poses of a line, each near the one before, off what stands there; none if there is none."""
        found: list[np.ndarray] = []
        for pose in line:
            q = inverse_kinematics(self.arm, pose, found[-1] if found else seed)
            if q is None or (found and np.abs(q - found[-1]).max() > NEAR):
                return []
            # what moves with the last joint may be near what it takes and where it puts it
            if arm_clearance(self.arm, self.body, q, self._things, range(0, self.arm.dof - 1)) < 0.0:
                return []
            found.append(q)
        return found


def _alternatives(leg: PlacementMotion) -> Iterator[tuple[tuple[Pose, ...], ...]]:
    """Key by key the lines to follow, one for each of its symmetric alternatives; what is straight is one line."""
    single = len(leg.keys) - leg.straight
    for key in leg.keys[:single]:
        yield tuple((pose,) for pose in key)
    yield tuple(zip(*leg.keys[single:], strict=True))


def placed(
    rng: np.random.Generator, kind: str, stage: PlacementContext, wanted: list[ObstacleRequest] | None = None
) -> tuple[ScheduledObstacle, ...] | None:
    """Obstacles of a kind for a stage, or None where there is no room for them.

    Args:
        rng: source of randomness.
        kind: "static" (1 to 3), "appear", "moving", "unforeseen" (one of the two before), "forearm" or "paper".
        stage: where.
        wanted: what "paper" stands for.
    """
    if kind == "unforeseen":
        kind = ("moving", "appear")[rng.integers(2)]
    count = int(rng.integers(1, 4)) if kind == "static" else 1
    orders = wanted or [ObstacleRequest(kind, int(leg)) for leg in rng.permutation(len(stage.legs))[:count]]
    found: list[ScheduledObstacle] = []
    for order in orders:
        one = _placed_one(rng, order, stage, found)
        if one is None:
            return None
        found.append(one)
    return tuple(found)


def _placed_one(
    rng: np.random.Generator, order: ObstacleRequest, stage: PlacementContext, others: list[ScheduledObstacle]
) -> ScheduledObstacle | None:
    make = {"static": _still, "appear": _appearing, "moving": _swinging, "forearm": _at_forearm}[order.kind]
    for _ in range(TRIES):
        one = make(rng, stage, order.leg, order.size)
        if one is not None and _apart(one, others) and _fits(stage, one, order.kind, others):
            return one
    return None


def _fits(stage: PlacementContext, one: ScheduledObstacle, kind: str, others: list[ScheduledObstacle]) -> bool:
    times = (PHASES - one.phase) / one.frequency if one.frequency else np.zeros(1)
    places = pack([Obstacle(one.shape, one.pose(time)) for time in times])
    leg, tool = stage.legs[one.leg], stage.tools[one.leg]
    near = tool_clearance(tool, leg.sweep, places)
    if (near < KEY_CLEARANCE) if kind == "forearm" else (near >= 0.0):
        return False
    # what appears is not there at the start; that it has room then is seen to when it does
    clearance = SWING_CLEARANCE if one.frequency else KEY_CLEARANCE
    if not stage.has_room(places, clearance):
        return False
    # postures must be clear of all that stand still together
    still = [Obstacle(each.shape, each.pose(0.0)) for each in (*others, one) if not each.frequency]
    return bool(one.frequency) or stage.has_postures(pack(still))


def _apart(one: ScheduledObstacle, others: list[ScheduledObstacle]) -> bool:
    return all(np.linalg.norm(np.subtract(one.center, each.center)) > LARGEST + SOLID_CLEARANCE for each in others)


def _shape(rng: np.random.Generator, size: float | None) -> tuple[Shape, tuple[float, ...]]:
    """A shape, its extents drawn or given, and how it is turned (wxyz)."""
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


def _center(rng: np.random.Generator, leg: PlacementMotion, low: float, high: float) -> np.ndarray:
    """A point (3,) near the straight way of the hand."""
    a, b = leg.start.position, leg.end.position
    direction = (b - a) / max(float(np.linalg.norm(b - a)), 1e-9)
    side = np.array([-direction[1], direction[0], 0.0])
    middle = a + rng.uniform(low, high) * (b - a)
    return middle + rng.uniform(-leg.aside, leg.aside) * side + np.array([0, 0, rng.uniform(-leg.above, leg.above)])


def _still(rng: np.random.Generator, stage: PlacementContext, leg: int, size: float | None) -> ScheduledObstacle:
    shape, rotation = _shape(rng, size)
    return ScheduledObstacle(shape, _tuple(_center(rng, stage.legs[leg], 0.3, 0.7)), rotation, leg=leg)


def _appearing(rng: np.random.Generator, stage: PlacementContext, leg: int, size: float | None) -> ScheduledObstacle:
    shape, rotation = _shape(rng, size)
    center = _tuple(_center(rng, stage.legs[leg], 0.4, 0.7))
    delay = float(rng.uniform(0.5, 2.0))
    return ScheduledObstacle(shape, center, rotation, motion=stage.legs[leg].motion, delay=delay, leg=leg)


def _swinging(rng: np.random.Generator, stage: PlacementContext, leg: int, speed: float | None) -> ScheduledObstacle:
    shape, rotation = _shape(rng, None)
    direction = stage.legs[leg].end.position - stage.legs[leg].start.position
    heading = np.arctan2(direction[1], direction[0]) + 0.5 * np.pi + rng.uniform(-0.5, 0.5)
    amplitude = rng.uniform(*SWING)
    long = amplitude * np.array([np.cos(heading), np.sin(heading), rng.uniform(-0.3, 0.3)])
    short = rng.uniform(0.0, 0.3) * amplitude * np.array([-np.sin(heading), np.cos(heading), 0.0])
    peak = rng.uniform(SLOWEST, FASTEST) if speed is None else speed
    center = _tuple(_center(rng, stage.legs[leg], 0.35, 0.65))
    frequency, phase = peak / float(np.linalg.norm(long)), float(rng.uniform(0.0, 2.0 * np.pi))
    return ScheduledObstacle(shape, center, rotation, _tuple(long), _tuple(short), frequency, phase, leg=leg)


def _at_forearm(
    rng: np.random.Generator, stage: PlacementContext, leg: int, size: float | None
) -> ScheduledObstacle | None:
    """A still body where a link between elbow and wrist passes."""
    postures = stage.nominal(stage.legs[leg])
    links = range(stage.arm.dof - 4, stage.arm.dof - 2)
    if not postures:
        return None
    shape, rotation = _shape(rng, size)
    ends = capsule_ends(stage.arm, stage.body, postures[int(rng.integers(len(postures)))], links)
    a, b = ends[int(rng.integers(len(ends)))]
    point = a + rng.uniform() * (b - a) + rng.uniform(-0.03, 0.03, 3)
    place = pack([Obstacle(shape, Pose.from_position_quaternion(point, rotation))])
    hit = min(arm_clearance(stage.arm, stage.body, q, place, links) for q in postures)
    return ScheduledObstacle(shape, _tuple(point), rotation, leg=leg) if hit < 0.0 else None


def _tuple(vector: np.ndarray) -> tuple[float, float, float]:
    return float(vector[0]), float(vector[1]), float(vector[2])
