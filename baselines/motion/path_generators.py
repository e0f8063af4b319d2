"""Path makers: a demonstrated path, a start, a goal and what is near in, a path out.

Two of them here: TSIA with position and orientation interpolated apart, and the demonstration replayed.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Any, NamedTuple

import numpy as np

from ...planner.geometry import dualquat as dq
from ...planner.geometry.pose import METERS_PER_RADIAN, Pose, PosePath
from ...planner.imitation.tsia import BLEND_STEP, LEAST_STEP, STILL, imitated_path
from .tool_obstacles import ToolObstacles


class GeneratedPath(NamedTuple):
    """A path as made.

    Attributes:
        path: from the start; where its maker gave up, it ends before the goal.
        states: what the maker needs to go on from each pose; () where it needs nothing.
    """

    path: PosePath
    states: tuple[Any, ...] = ()


class PathGenerator(ABC):
    """Makes paths of the tcp.

    Attributes:
        guided: the blend ends at a guiding pose; False: there is none.
        avoids: it looks at obstacles, and goes on otherwise when they have moved.
    """

    guided = False
    avoids = False

    @abstractmethod
    def make(self, shown: PosePath, start: Pose, goal: Pose, guide: int, near: ToolObstacles) -> GeneratedPath:
        """A path.

        Args:
            shown: the demonstrated segment, where it was shown.
            start: of the tcp.
            goal: of the tcp.
            guide: index in `shown` of the guiding pose.
            near: what is around the tool.
        """

    def renewed(self, made: GeneratedPath, index: int, near: ToolObstacles) -> GeneratedPath:
        """The path with what follows pose `index` made anew; only of a maker that avoids."""
        return made


class Decoupled(PathGenerator):
    """TSIA with lerp and slerp in place of ScLERP: position and orientation of the blend move apart."""

    guided = True

    def make(self, shown: PosePath, start: Pose, goal: Pose, guide: int, near: ToolObstacles) -> GeneratedPath:
        """See `PathGenerator`."""
        imitated = imitated_path(shown, goal)
        length = imitated.lengths()[-1]
        step = max(length / (len(imitated) - 1), LEAST_STEP) if length > STILL else BLEND_STEP
        return GeneratedPath(straight_path(start, imitated[guide], step).joined(imitated[guide:]))


class Replay(PathGenerator):
    """The demonstration moved rigidly to the goal, and a straight way to its beginning.

    What MimicGen (Mandlekar et al. 2023) does to make data of one segment.
    """

    def make(self, shown: PosePath, start: Pose, goal: Pose, guide: int, near: ToolObstacles) -> GeneratedPath:
        """See `PathGenerator`."""
        imitated = imitated_path(shown, goal)
        return GeneratedPath(straight_path(start, imitated[0], BLEND_STEP).joined(imitated))


def straight_path(start: Pose, end: Pose, step: float) -> PosePath:
    """Positions on a straight line, orientations by slerp, at most `step` [m] of screw length apart."""
    distance, angle = start.distance_to(end)
    tau = np.linspace(0.0, 1.0, max(1, math.ceil(math.hypot(distance, METERS_PER_RADIAN * angle) / step)) + 1)
    turned = dq.sclerp(_turn(start), _turn(end), tau)[:, :4]
    poses = dq.from_position_quaternion(start.position + tau[:, None] * (end.position - start.position), turned)
    poses[0], poses[-1] = start.dq, end.dq
    return PosePath(poses)


def _turn(pose: Pose) -> np.ndarray:
    return dq.from_position_quaternion(np.zeros(3), pose.dq[:4])
