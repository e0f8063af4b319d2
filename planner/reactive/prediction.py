"""Prediction: the outcome of going on, waiting or going round, if obstacles keep their velocities.

Each option is rolled out for a short time in the kinematic closed loop with the safety layer; the rest of the path
counts with the pace of the pursuit. Detours are planned round the places where an obstacle will be when the arm meets
it. Not in the paper, which plans at the present place.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..collision.robot_arrays import HEADER, ROW
from ..collision.step_certificates import near_pair_slack
from ..control.arm_arrays import PURSUIT_STATE, pose_at
from ..control.pursuit import ARRIVED
from ..geometry.pose import METERS_PER_RADIAN, Pose, PosePath
from ..geometry.shapes import OBSTACLE, Obstacle, moves
from ..jit import kernel
from ..resumable import CALL, TICK, Resumable
from ..safety.guarded_pursuit import SLICE, guarded_tick
from ..safety.safety_layer import FREE, safe_velocity

SAME_PLACE = 1e-3
"""Weighted distance [m] beyond which a displaced static obstacle counts as a change of the scene."""
SPACING, MOST_PLACES = 0.04, 10
"""Distance [m] between the places at which a moving obstacle is planned round, and their maximum number."""
BEFORE, BEHIND = 0.4, 0.8
"""Seconds before and after the first conflict whose places are planned round."""
GAIN = 0.3
"""Seconds by which waiting or a detour must arrive sooner than going on."""
CREEP_TOLERANCE = 1e-3
"""Slack [m] that a safe roll-out may lose beyond its start."""


class Prediction(NamedTuple):
    """The outcome of a roll-out.

    Attributes:
        arrival: seconds until the end of the path, estimated beyond the horizon.
        slack: smallest slack [m] on the motion.
        safe: no pair gets closer than its margin, or than it is at the start.
        conflict: seconds until the safety layer first changes a command; None: never.
    """

    arrival: float
    slack: float
    safe: bool
    conflict: float | None


@kernel
def roll_ahead(work, g, path, q, dt, pursuit_state, wait, first, last, wish, out):
    """Follow a path from q among moving obstacles, after standing still for some ticks, or go on after a pause.

    Args:
        work: arm, controller and pursuit, see `arm_arrays`.
        g: the arm among obstacles, see `robot_arrays`; its obstacles move along.
        path: (n, 8) poses of the tcp.
        q: (dof,) joints [rad or m]; they move along.
        dt: seconds per tick.
        pursuit_state: (4,) state of the pursuit.
        wait: ticks to stand still first, giving way.
        first: number of ticks so far.
        last: number of ticks after which to pause.
        wish: (dof,) scratch.
        out: (dof,) scratch.

    Returns:
        (True if the tool arrives, ticks used, smallest slack [m], first tick that the safety layer changed or -1),
        the latter two since the pause.
    """
    least, changed = math.inf, -1
    for k in range(first, last):
        if k < wait:
            wish[:] = 0.0
            safety = safe_velocity(g, q, wish, dt, out)
        else:
            status, safety = guarded_tick(work, g, path, q, dt, pursuit_state, wish, out)
            if status == ARRIVED:
                return True, k, least, changed
        least = min(least, near_pair_slack(g, -1, 0.0))
        if safety != FREE and changed < 0:
            changed = k
        for i in range(len(q)):
            q[i] += dt * out[i]
        for o in range(ROW.obstacles, ROW.obstacles + int(g[ROW.header, HEADER.obstacles])):
            for c in range(3):
                g[o, OBSTACLE.center + c] += dt * g[o, OBSTACLE.velocity + c]
    return False, last, least, changed


class Predictor:
    """Rolls out the options of an arm among moving obstacles.

    Args:
        work: the arm, its controller and pursuit, see `arm_arrays`.
        dt: seconds per tick.
        horizon: seconds to look ahead.
        pace: path length [m/s] of an undisturbed pursuit.
    """

    def __init__(self, work: np.ndarray, dt: float, horizon: float, pace: float):
        self._work, self._dt, self._horizon, self._pace = work, dt, horizon, pace

    def ahead(
        self, robot: np.ndarray, path: PosePath, pursuit_state: np.ndarray, q: np.ndarray, wait: float = 0.0
    ) -> Resumable[Prediction]:
        """Predict the outcome of following a path after a wait.

        Args:
            robot: the arm among the obstacles as they are now, see `robot_arrays`; left as it is.
            path: the path to follow.
            pursuit_state: (4,) state of its pursuit; left as it is.
            q: (dof,) joints now.
            wait: seconds to stand still first.
        """
        g, end, after, before = robot.copy(), q.copy(), pursuit_state.copy(), near_pair_slack(robot, -1, 0.0)
        ticks, scratch, waits = round(self._horizon / self._dt), np.empty((2, len(q))), round(wait / self._dt)
        arrived, used, slack, conflict = False, 0, math.inf, None
        while not arrived and used < ticks:
            begun = used
            arrived, used, least, changed = roll_ahead(
                self._work, g, path.dqs, end, self._dt, after, waits, begun, min(ticks, begun + SLICE), *scratch
            )
            slack = min(slack, least)
            if changed >= 0 and conflict is None:
                conflict = changed * self._dt
            yield CALL + TICK * (used - begun)
        arrival = used * self._dt
        if not arrived:
            arrival += self._left(path, int(after[PURSUIT_STATE.reference]), end) / self._pace
        return Prediction(arrival, slack, slack >= min(before, 0.0) - CREEP_TOLERANCE, conflict)

    def _left(self, path: PosePath, index: int, q: np.ndarray) -> float:
        """Path length [m] from the tool at joints q to a pose of the path and on to its end."""
        from_tool = self._tool(q).distance_to(path[index])
        lengths = path.lengths()
        return math.hypot(from_tool[0], METERS_PER_RADIAN * from_tool[1]) + float(lengths[-1] - lengths[index])

    def _tool(self, q: np.ndarray) -> Pose:
        return Pose(np.array(pose_at(self._work, q)))


def is_preferable(one: Prediction, other: Prediction) -> bool:
    """Return whether one outcome is preferable: safe, else sooner if both are safe, else with more slack.

    Args:
        one: an outcome.
        other: the outcome it is compared with.
    """
    if one.safe != other.safe:
        return one.safe
    return one.arrival + GAIN < other.arrival if one.safe else one.slack > other.slack + CREEP_TOLERANCE


def windows(conflict: float, horizon: float) -> Iterator[tuple[float, float]]:
    """Yield the time spans [s] whose places are planned round: the first conflict, then the whole horizon.

    Args:
        conflict: seconds until the first conflict.
        horizon: seconds that are predicted.
    """
    yield max(0.0, conflict - BEFORE), conflict + BEHIND
    yield 0.0, horizon


def swept(obstacles: Sequence[Obstacle], start: float, end: float) -> list[Obstacle]:
    """Return the places of moving obstacles during a time span, as static obstacles.

    Args:
        obstacles: all obstacles now.
        start: begin of the span [s from now].
        end: end of the span [s from now].
    """
    out = []
    for obstacle in obstacles:
        if moves(obstacle):
            displacement = float(np.linalg.norm(obstacle.velocity)) * (end - start)
            count = min(MOST_PLACES, max(1, math.ceil(displacement / SPACING)) + 1)
            out += [replace(obstacle.at(t), velocity=np.zeros(3)) for t in np.linspace(start, end, count)]
    return out


def same_scene(before: Sequence[Obstacle], now: Sequence[Obstacle]) -> bool:
    """Return whether the obstacles are the same, the static ones at the same places.

    Args:
        before: the obstacles before.
        now: the obstacles now.
    """
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
