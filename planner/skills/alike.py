"""Poses that look alike: turns of a reference, of what is moved, and of the hand."""

from __future__ import annotations

import math

import numpy as np

from ..geometry.pose import Pose
from .symmetry import turns_alike
from .thing import Thing

UP = np.array([0.0, 0.0, 1.0])
BESIDE = 0.01
"""Distance [m] of a reference's axis from what is placed on it up to which the axis counts as passing through."""
HALF_TURN = math.pi


def turned_about(axis: np.ndarray, point: np.ndarray, angle: float) -> Pose:
    """Return the rotation about a line.

    Args:
        axis: (3,) unit vector along the line.
        point: (3,) a point on it [m].
        angle: [rad].
    """
    quaternion = [math.cos(0.5 * angle), *(math.sin(0.5 * angle) * np.asarray(axis))]
    turn = Pose.from_position_quaternion([0.0, 0.0, 0.0], quaternion)
    return Pose.from_position_quaternion(point - turn.rotation @ point) @ turn


def own_turns(thing: Thing | None, pose: Pose) -> tuple[Pose, ...]:
    """Return the turns, in a thing's frame, about its upright axis after which it looks the same; the first is none.

    Args:
        thing: the thing; None if its shape is unknown.
        pose: in the world, which says where up is.
    """
    if thing is None:
        return (Pose.identity(),)
    axis = pose.rotation.T @ UP
    return tuple(turned_about(axis, thing.middle, angle) for angle in turns_alike(thing.points, axis, thing.middle))


def reference_turns(thing: Thing | None, pose: Pose, goal: Pose, body: Thing | None) -> tuple[Pose, ...]:
    """Return the turns, in the frame of a reference, of a goal that look alike; the first is none.

    A symmetry may turn a goal, not move it to another place: the reference's axis must pass through what is placed, as
    through a nut on its peg, not beside it, as through the middle of a bin.

    Args:
        thing: the reference; None if its shape is unknown.
        pose: its pose in the world.
        goal: `reference_from_body`.
        body: the thing that is placed; None if its shape is unknown.
    """
    if thing is None:
        return (Pose.identity(),)
    axis = pose.rotation.T @ UP
    placed = goal.position[None] if body is None else body.corners_at(goal)
    if not _pierces(axis, thing.middle, placed):
        return (Pose.identity(),)
    return tuple(turned_about(axis, thing.middle, angle) for angle in turns_alike(thing.points, axis, thing.middle))


def _pierces(axis: np.ndarray, point: np.ndarray, corners: np.ndarray) -> bool:
    """Return whether a line passes through the hull of corners (n, 3), or as near by as `BESIDE`."""
    from scipy.spatial import ConvexHull

    aside = (corners - point) @ _across(axis)
    if len(aside) < 4:
        return bool(np.linalg.norm(aside, axis=1).min() <= BESIDE)
    return bool(ConvexHull(aside).equations[:, 2].max() <= BESIDE)


def _across(axis: np.ndarray) -> np.ndarray:
    """Return two unit vectors, as columns (3, 2), across an axis."""
    x = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x)])


def hand_turns() -> tuple[Pose, ...]:
    """Return the turns of a hand with two fingers about its approach axis (z of the tcp) that look alike."""
    return (Pose.identity(), turned_about(UP, np.zeros(3), HALF_TURN))


def standing(pose: Pose) -> Pose:
    """Return the frame of a round thing that stands: its yaw means nothing."""
    return Pose.from_position_quaternion(pose.position)


def turned_like(held: Pose, shown: Pose) -> Pose:
    """Turn a round thing in the hand about its own axis, as near as can be to how it was held.

    Args:
        held: `tcp_from_object`.
        shown: `tcp_from_object` of the other grasp.
    """
    return held @ Pose.from_yaw([0.0, 0.0, 0.0], (held.inverse() @ shown).yaw)
