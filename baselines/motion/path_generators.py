"""Path generators: from a demonstrated path, a start, a goal and nearby obstacles to a path.

This module has two: TSIA with decoupled interpolation of position and orientation, and replay of the demonstration.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Any, NamedTuple

import numpy as np

from ...planner import Pose, PosePath, imitated_path
from ...planner.geometry import dualquat as dq
from ...planner.geometry.pose import METERS_PER_RADIAN
from ...planner.imitation.tsia import BLEND_STEP, LEAST_STEP, STILL
from .tool_obstacles import ToolObstacles


class GeneratedPath(NamedTuple):
    """A generated path.

    Attributes:
        path: path from the start; ends before the goal where generation failed.
        states: data to continue generation from each pose; () if not needed.
    """

    path: PosePath
    states: tuple[Any, ...] = ()


class PathGenerator(ABC):
    """Generator of tcp paths.

    Attributes:
        guided: True: the blend ends at a guiding pose.
        avoids: True: obstacles are avoided, and the path is renewed when they have moved.
    """

    guided = False
    avoids = False

    @abstractmethod
    def make(self, shown: PosePath, start: Pose, goal: Pose, guide: int, near: ToolObstacles) -> GeneratedPath:
        """Generate a path.

        Args:
            shown: the demonstrated segment, in its original place.
            start: present pose of the tcp.
            goal: goal pose of the tcp.
            guide: index of the guiding pose in `shown`.
            near: obstacles around the tool.
        """

    def renewed(self, made: GeneratedPath, index: int, near: ToolObstacles) -> GeneratedPath:
        """Generate anew the part of a path after a pose; for generators that avoid obstacles.

        Args:
            made: the path.
            index: index of the pose.
            near: obstacles around the tool now.
        """
        return made


class Decoupled(PathGenerator):
    """TSIA with lerp and slerp in place of ScLERP: position and orientation of the blend are decoupled."""

    guided = True

    def make(self, shown: PosePath, start: Pose, goal: Pose, guide: int, near: ToolObstacles) -> GeneratedPath:
        """See `PathGenerator`."""
        imitated = imitated_path(shown, goal)
        length = imitated.lengths()[-1]
        step = max(length / (len(imitated) - 1), LEAST_STEP) if length > STILL else BLEND_STEP
        return GeneratedPath(straight_path(start, imitated[guide], step).joined(imitated[guide:]))


class Replay(PathGenerator):
    """The demonstration moved rigidly to the goal, after a straight path to its beginning.

    This is how MimicGen (Mandlekar et al. 2023) generates data of one segment.
    """

    def make(self, shown: PosePath, start: Pose, goal: Pose, guide: int, near: ToolObstacles) -> GeneratedPath:
        """See `PathGenerator`."""
        imitated = imitated_path(shown, goal)
        return GeneratedPath(straight_path(start, imitated[0], BLEND_STEP).joined(imitated))


def straight_path(start: Pose, end: Pose, step: float) -> PosePath:
    """Sample a straight line of positions with orientations by slerp, both ends included.

    Args:
        start: first pose.
        end: last pose.
        step: largest path length [m] between neighbors.
    """
    distance, angle = start.distance_to(end)
    tau = np.linspace(0.0, 1.0, max(1, math.ceil(math.hypot(distance, METERS_PER_RADIAN * angle) / step)) + 1)
    turned = dq.sclerp(_turn(start), _turn(end), tau)[:, :4]
    poses = dq.from_position_quaternion(start.position + tau[:, None] * (end.position - start.position), turned)
    poses[0], poses[-1] = start.dq, end.dq
    return PosePath(poses)


def _turn(pose: Pose) -> np.ndarray:
    return dq.from_position_quaternion(np.zeros(3), pose.dq[:4])


def parted(path: PosePath, distance: float) -> tuple[PosePath, PosePath | None]:
    """Return the part of a path that is near its beginning, and the rest, if there is one.

    Args:
        path: the path.
        distance: distance [m] from the beginning.
    """
    away = np.linalg.norm(path.positions - path.positions[0], axis=1) > distance
    free = int(np.argmax(away)) if away.any() else len(path) - 1
    return path[: free + 1], path[free:] if free < len(path) - 1 else None
