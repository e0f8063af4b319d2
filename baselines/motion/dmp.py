"""Cartesian dynamic movement primitives (Ude et al. 2014) with an obstacle coupling term (Hoffmann et al. 2009).

By the library `movement_primitives`. The primitive learns the segment in the goal's frame or in the world frame; the
former is the fair variant: in the world frame a rotated goal keeps the direction of the demonstration. Time is the
path length of the demonstration with a smooth start and end, since segments carry no time.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from ...planner import Pose, PosePath
from ...planner.geometry import dualquat as dq
from ...planner.imitation.tsia import BLEND_STEP, STILL
from ...planner.ranges import check_ranges
from ..extras import needed
from .path_generators import GeneratedPath, PathGenerator, straight_path
from .tool_obstacles import ToolObstacles

LEAST_STEPS = 50
"""Steps of the shortest primitive; a longer primitive has as many as the segment has poses."""
CLOSE = 5e-4
"""Distance to the goal that counts as arrival: [m], and five times this in radians."""
MIN_CLEARANCE = 1e-3
"""Slack [m] to which closer obstacles are clamped, so that their direction stays defined."""
LONGER = 3.0
"""Duration at which the primitive stops, relative to the demonstration."""


@dataclass(frozen=True, slots=True)
class DmpSettings:
    """Settings of a movement primitive.

    Attributes:
        weights: number of weights of the forcing term, per dimension.
        regularization: regularization of their regression; without it, the remaining force at the end keeps the
            primitive some millimeters off its goal.
        gamma: gain of the coupling term; 0 ignores obstacles.
        beta: decay of the coupling term with the angle between motion and obstacle [1/rad].
        influence: distance [m] at which an obstacle begins to act. The original formula lacks this limit: it would turn
            away from obstacles far behind the goal.
    """

    weights: int = 60
    regularization: float = 1e-4
    gamma: float = 100.0
    beta: float = 1.0
    influence: float = 0.1

    def __post_init__(self):
        check_ranges(self, "[2, 1000]", "weights")
        check_ranges(self, "[0, 1000000]", "regularization", "gamma", "beta", "influence")


class Dmp(PathGenerator):
    """Paths of a movement primitive learned from the segment.

    Args:
        settings: see `DmpSettings`.
        in_goal_frame: True: learn and run in the goal's frame; False: in the world frame.

    Raises:
        MissingExtra: `movement_primitives` is not installed.
    """

    avoids = True

    def __init__(self, settings: DmpSettings, *, in_goal_frame: bool):
        self.settings, self._in_goal_frame = settings, in_goal_frame
        self._library = needed("movement_primitives.dmp", "dmp")

    def make(self, shown: PosePath, start: Pose, goal: Pose, guide: int, near: ToolObstacles) -> GeneratedPath:
        """See `PathGenerator`."""
        if len(shown) < 2 or shown.lengths()[-1] <= STILL:
            return GeneratedPath(straight_path(start, goal, BLEND_STEP))
        world = goal if self._in_goal_frame else Pose.from_position_quaternion([0.0, 0.0, 0.0])
        learned = shown.moved(shown[-1].inverse()) if self._in_goal_frame else shown
        primitive = self._learned(learned)
        state = _vector(world.inverse() @ start, learned.quaternions[0])
        ends = _vector(world.inverse() @ goal, state[3:])
        primitive.configure(start_y=state.copy(), goal_y=ends)
        return self._made([(primitive, world, 0, state, np.zeros(6))], near)

    def renewed(self, made: GeneratedPath, index: int, near: ToolObstacles) -> GeneratedPath:
        """See `PathGenerator`."""
        if not made.states:
            return made
        return self._made(list(made.states[: index + 1]), near)

    def _learned(self, shown: PosePath) -> Any:
        """Return a primitive that has learned a path (in its own frame), over one unit of time."""
        lengths = shown.lengths()
        count = max(LEAST_STEPS, len(shown))
        t = np.linspace(0.0, 1.0, count + 1)
        along = t**3 * (10.0 - 15.0 * t + 6.0 * t**2) * lengths[-1]
        poses = _interpolated(shown, lengths, along)
        primitive = self._library.CartesianDMP(
            execution_time=1.0, dt=1.0 / count, n_weights_per_dim=self.settings.weights, int_dt=1.0 / count
        )
        primitive.imitate(t, poses.vectors, regularization_coefficient=self.settings.regularization)
        return primitive

    def _made(self, states: list, near: ToolObstacles) -> GeneratedPath:
        """Continue from the last state: (primitive, its frame, step, position and quaternion, velocity)."""
        primitive, world, step, y, yd = states[-1]
        coupling = _Coupling(self._library, self.settings, world, near)
        goal = primitive.goal_y
        for count in range(step, round(LONGER / primitive.dt_)):
            # for small angles, half the angle is the difference of the quaternions
            if np.linalg.norm(y[:3] - goal[:3]) < CLOSE and 0.4 * np.linalg.norm(y[3:] - goal[3:]) < CLOSE:
                # the remaining approach to an attractor takes infinite time
                states.append((primitive, world, count, goal, yd))
                break
            coupling.turn, primitive.t = y[3:], count * primitive.dt_
            y, yd = primitive.step(y.copy(), yd.copy(), coupling_term=None if near.empty else coupling)
            y[3:] /= np.linalg.norm(y[3:])
            states.append((primitive, world, count + 1, y, yd))
        rows = np.array([each[3] for each in states])
        return GeneratedPath(PosePath.from_vectors(rows).moved(world), tuple(states))


class _Coupling:
    """Coupling term that turns the velocity away from the closest point of each obstacle; the library's is for a point.

    Called for the position and for the quaternion, which stays unchanged.
    """

    def __init__(self, library: ModuleType, settings: DmpSettings, world: Pose, near: ToolObstacles):
        self._term = library.obstacle_avoidance_acceleration_3d
        self._settings, self._near = settings, near
        self._position, self._quaternion, self._rotation = world.position, world.dq[:4], world.rotation
        self.turn = np.array([1.0, 0.0, 0.0, 0.0])

    def coupling(self, y: np.ndarray, yd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the changes of velocity (3,), which is zero, and of acceleration (3,) [m per unit of time squared]."""
        total = np.zeros(3)
        if len(y) != 3 or not self._settings.gamma or np.linalg.norm(yd) < 1e-9:
            return np.zeros(3), total
        y, yd, settings = np.array(y), np.array(yd), self._settings
        position = self._position + self._rotation @ y
        turn = dq.mul(_turning(self._quaternion), _turning(self.turn))[:4]
        for each in self._near.at(position, turn, settings.influence):
            towards = y - max(each.slack, MIN_CLEARANCE) * (each.normal @ self._rotation)
            share = 1.0 - max(each.slack, 0.0) / each.reach
            total += share * self._term(y, yd, towards, settings.gamma, settings.beta)
        return np.zeros(3), total


def _interpolated(path: PosePath, lengths: np.ndarray, along: np.ndarray) -> PosePath:
    """Return poses at given path lengths, on the screws between a path's poses."""
    index = np.clip(np.searchsorted(lengths, along, side="right") - 1, 0, len(path) - 2)
    steps = lengths[index + 1] - lengths[index]
    share = np.clip((along - lengths[index]) / np.where(steps > 0.0, steps, 1.0), 0.0, 1.0)
    rows = [dq.sclerp(path.dqs[i], path.dqs[i + 1], s) for i, s in zip(index, share, strict=True)]
    return PosePath(np.array(rows))


def _vector(pose: Pose, like: np.ndarray) -> np.ndarray:
    """Return position and quaternion (7,), with the sign nearer to another quaternion."""
    turn = pose.dq[:4] if pose.dq[:4] @ like >= 0.0 else -pose.dq[:4]
    return np.concatenate([pose.position, turn])


def _turning(quaternion: np.ndarray) -> np.ndarray:
    return np.concatenate([quaternion, np.zeros(4)])
