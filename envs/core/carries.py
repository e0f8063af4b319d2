"""Motions of the hand that obstacles may block, from the shapes of things: grasps from above, never a demonstration."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...planner import Pose, Shape, Sphere
from ...planner.geometry.hulls import corner_points
from .placement_context import PlacementMotion

DOWN = (0.0, 1.0, 0.0, 0.0)
"""Rotation (wxyz) of a hand that points down, fingers closing along world x."""
RAISED = 0.10
"""Height [m] of the hand above a grasp or a place at the ends of a carry."""
ABOVE = (0.0, 0.04, 0.08)
"""Heights [m] above grasps and places at which the hand must have clearance from obstacles."""
DEEPEST = 0.03
"""Largest depth [m] of a grasp below the top of an object."""
DIRECTIONS = np.arange(36) * np.pi / 36.0
"""Yaws [rad] tried for the narrowest side of an object."""
FINGERTIP = Sphere(0.005)


def corners_at(shape: Shape, pose: Pose) -> np.ndarray:
    """Return the corners (n, 3) [m] of a shape in the world.

    Args:
        shape: the shape.
        pose: its pose.
    """
    return corner_points(shape) @ pose.rotation.T + pose.position


def middle_of(corners: np.ndarray) -> np.ndarray:
    """Return the middle (3,) of the box around corners (n, 3) [m]."""
    return 0.5 * (corners.min(axis=0) + corners.max(axis=0))


def grasp_from_above(corners: np.ndarray) -> Pose:
    """Return the tcp pose of a grasp of corners (n, 3) [m], fingers closing across the narrowest side."""
    across = np.column_stack([np.cos(DIRECTIONS), np.sin(DIRECTIONS)])
    yaw = DIRECTIONS[np.ptp(corners[:, :2] @ across.T, axis=0).argmin()]
    point = middle_of(corners)
    point[2] = max(point[2], corners[:, 2].max() - DEEPEST)
    return Pose.from_yaw(point, float(yaw)) @ Pose.from_position_quaternion(np.zeros(3), DOWN)


def reach_motion(home: Pose, corners: np.ndarray) -> PlacementMotion:
    """Return the hand's way to a thing.

    Args:
        home: tcp pose at the start.
        corners: (n, 3) corners of the thing [m].
    """
    grasp = grasp_from_above(corners)
    return PlacementMotion(home, grasp, tuple(_keys(grasp)), FINGERTIP, Pose.identity(), motion=0)


def carry_motion(shape: Shape, pose: Pose, grasp: Pose, there: Pose, passing: Sequence[Pose] = ()) -> PlacementMotion:
    """Return the hand's way with an object from above a grasp to above its place, or to above the first one it passes.

    Args:
        shape: shape of the object.
        pose: its pose.
        grasp: tcp pose of the grasp.
        there: tcp pose at the place.
        passing: tcp poses that must be passed before that.
    """
    places = (*passing, there)
    return PlacementMotion(
        start=_above(grasp, RAISED),
        end=_above(places[0], RAISED),
        keys=(*_keys(grasp), *(key for place in places for key in _keys(place))),
        shape=shape,
        tcp_from_object=grasp.inverse() @ pose,
        motion=1,
    )


def _above(pose: Pose, height: float) -> Pose:
    return Pose.from_position_quaternion([0.0, 0.0, height]) @ pose


def _keys(grasp: Pose) -> list[tuple[Pose, ...]]:
    """Return the poses above a grasp that must stay reachable, each with that of a hand turned by half a turn."""
    half_turn = Pose.from_position_quaternion(np.zeros(3), (0.0, 0.0, 0.0, 1.0))
    return [(_above(grasp, up), _above(grasp, up) @ half_turn) for up in ABOVE]
