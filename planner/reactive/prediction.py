"""What comes of it if the arm goes on, waits or goes round, while obstacles go on as they do now.

Each is rolled out in the kinematic closed loop with the safety layer, obstacles moving with their velocities, for a
short time; what is left of the path then counts with the pace of the pursuit. Detours are planned round places where
an obstacle will be about when the arm meets it. Not in the paper, which plans at the present place.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..collision.clearance import near_pair_slack
from ..collision.robot_arrays import HEADER, N_OBSTACLES, OBSTACLES
from ..control.arm_arrays import pose_at
from ..control.pursuit import ARRIVED, INDEX
from ..geometry.pose import METERS_PER_RADIAN, Pose, PosePath
from ..geometry.shapes import Obstacle, moves
from ..jit import kernel
from ..safety.guarded_pursuit import guarded_tick
from ..safety.safety_layer import FREE, safe_velocity

SAME_PLACE = 1e-3
"""Way [m], or turn in screw length, of a standing obstacle that is a change of the scene."""
SPACING, MOST_PLACES = 0.04, 10
"""Way [m] between the places at which a moving obstacle is planned round, and how many of them at most."""
BEFORE, BEHIND = 0.4, 0.8
"""Seconds about the moment of the first conflict in which an obstacle's places are planned round."""
GAIN = 0.3
"""Seconds by which waiting or a detour must arrive sooner than going on."""
CREEP_TOLERANCE = 1e-3
"""Room [m] by which a roll-out may come closer than it is or must keep, and still count as safe."""


class Prediction(NamedTuple):
    """What a roll-out has foreseen.

    Attributes:
        arrival: seconds until the end of the path, estimated behind the horizon.
        slack: smallest room on the way [m].
        safe: nothing comes closer than it must keep, or than it is.
        conflict: seconds until the safety layer first has to change a command; None if never.
    """

    arrival: float
    slack: float
    safe: bool
    conflict: float | None


@kernel
def roll_ahead(work, g, path, q, dt, pursuit_state, wait, ticks, wish, out):
    """Follow a path from q among obstacles that move, after standing still for some ticks.

    Args:
        work: see `guarded.guarded_tick`.
        g: same; the obstacles in it are moved along.
        path: same.
        q: (dof,) joints, moved along.
        dt: seconds per tick.
        pursuit_state: (4,) of the pursuit.
        wait: ticks to stand still first, giving way.
        ticks: to look ahead.
        wish: (dof,) scratch.
        out: (dof,) scratch.

    Returns:
        (True if it arrives, ticks used, smallest room [m], first tick that the safety layer changes or -1).
    """
    least, first = math.inf, -1
    for k in range(ticks):
        if k < wait:
            wish[:] = 0.0
            safety = safe_velocity(g, q, wish, dt, out)
        else:
            status, safety = guarded_tick(work, g, path, q, dt, pursuit_state, wish, out)
            if status == ARRIVED:
                return True, k, least, first
        least = min(least, near_pair_slack(g, -1, 0.0))
        if safety != FREE and first < 0:
            first = k
        for i in range(len(q)):
            q[i] += dt * out[i]
        for o in range(OBSTACLES, OBSTACLES + int(g[HEADER, N_OBSTACLES])):
            for c in range(3):
                g[o, 2 + c] += dt * g[o, 17 + c]
    return False, ticks, least, first


class Predictor:
    """Rolls out what an arm may do among obstacles that move.

    Args:
        work: its controller and pursuit, see `workspace`.
        dt: seconds per tick.
        horizon: seconds to look ahead.
        pace: screw length [m] that a free pursuit makes in a second.
    """

    def __init__(self, work: np.ndarray, dt: float, horizon: float, pace: float):
        self._work, self._dt, self._horizon, self._pace = work, dt, horizon, pace

    def ahead(
        self, robot: np.ndarray, path: PosePath, pursuit_state: np.ndarray, q: np.ndarray, wait: float = 0.0
    ) -> Prediction:
        """What comes of following a path after a wait.

        Args:
            robot: the arm among the obstacles as they are now, see `robot_arrays`; left as it is.
            path: to follow.
            pursuit_state: (4,) of its pursuit; left as it is.
            q: (dof,) joints now.
            wait: seconds to stand still first.
        """
        g, end, after, before = robot.copy(), q.copy(), pursuit_state.copy(), near_pair_slack(robot, -1, 0.0)
        ticks, scratch = round(self._horizon / self._dt), np.empty((2, len(q)))
        arrived, used, least, first = roll_ahead(
            self._work, g, path.dqs, end, self._dt, after, round(wait / self._dt), ticks, scratch[0], scratch[1]
        )
        arrival = used * self._dt
        if not arrived:
            arrival += self._left(path, int(after[INDEX]), end) / self._pace
        conflict = None if first < 0 else first * self._dt
        return Prediction(arrival, least, least >= min(before, 0.0) - CREEP_TOLERANCE, conflict)

    def _left(self, path: PosePath, index: int, q: np.ndarray) -> float:
        """Screw length [m] from the tool at joints q to a pose of the path and on to its end."""
        from_tool = self._tool(q).distance_to(path[index])
        lengths = path.lengths()
        return math.hypot(from_tool[0], METERS_PER_RADIAN * from_tool[1]) + float(lengths[-1] - lengths[index])

    def _tool(self, q: np.ndarray) -> Pose:
        return Pose(np.array(pose_at(self._work, q)))


def is_preferable(one: Prediction, other: Prediction) -> bool:
    """True if one is safe and the other is not; arrives sooner, if both are; has more room, if none is."""
    if one.safe != other.safe:
        return one.safe
    return one.arrival + GAIN < other.arrival if one.safe else one.slack > other.slack + CREEP_TOLERANCE


def windows(conflict: float, horizon: float) -> Iterator[tuple[float, float]]:
    """Spans of time whose places are planned round: about the first conflict, then all that is foreseen."""
    yield max(0.0, conflict - BEFORE), conflict + BEHIND
    yield 0.0, horizon


def swept(obstacles: Sequence[Obstacle], start: float, end: float) -> list[Obstacle]:
    """The places of the obstacles that move in a span of time, as obstacles that stand still."""
    out = []
    for obstacle in obstacles:
        if moves(obstacle):
            displacement = float(np.linalg.norm(obstacle.velocity)) * (end - start)
            count = min(MOST_PLACES, max(1, math.ceil(displacement / SPACING)) + 1)
            out += [replace(obstacle.at(t), velocity=np.zeros(3)) for t in np.linspace(start, end, count)]
    return out


def same_scene(before: Sequence[Obstacle], now: Sequence[Obstacle]) -> bool:
    """True if the same obstacles are there, those that stand still in the same places."""
    if len(before) != len(now):
        return False
    for old, new in zip(before, now, strict=True):
        if old.name != new.name or old.shape != new.shape or old.margin != new.margin or moves(old) != moves(new):
            return False
        if not moves(new):
            distance, angle = old.pose.distance_to(new.pose)
            if math.hypot(distance, METERS_PER_RADIAN * angle) > SAME_PLACE:
                return False
    return True
