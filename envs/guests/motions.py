"""Motions of the hand that obstacles may block in a robosuite task: from data, never from a demonstration."""

from __future__ import annotations

import numpy as np

from ...planner import Pose, Sphere
from ...planner.geometry.hulls import corner_points
from ..core.description import TaskObject
from ..core.placement_context import PlacementMotion
from .guest_scene import GuestScene
from .solids import hull_of
from .task_facts import PLACES, Place

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


def placement_motions(
    guest: GuestScene, home: Pose, objects: np.ndarray, furniture: np.ndarray
) -> list[PlacementMotion]:
    """Return the carries of the task, or the hand's ways to what it moves.

    Args:
        guest: scene of the task.
        home: tcp pose at the start.
        objects: (n, 7) poses of the objects, x y z [m] and wxyz.
        furniture: (n, 7) poses of the fixtures.
    """
    things = {each.name: each for each in guest.objects}
    poses = {each.name: Pose.from_vector(row) for each, row in zip(guest.objects, objects, strict=True)}
    for each, row in zip(guest.furniture, furniture, strict=True):
        things[each.name] = TaskObject(each.name, hull_of(each.parts), 2.0 * np.pi, each.parts)
        poses[each.name] = Pose.from_vector(row)
    places = PLACES.get(guest.task, {each.name: Place("reach") for each in guest.objects})
    motions = []
    for name, place in places.items():
        corners = _corners(things[name], poses[name])
        if place.kind == "reach":
            motions.append(_reach(home, corners))
        else:
            other = _corners(things[place.thing], poses[place.thing]) if place.thing else None
            middle = _middle_at(place, name, guest, corners, other)
            motions.append(_carry(things[name], poses[name], corners, middle))
    return motions


def _corners(thing: TaskObject, pose: Pose) -> np.ndarray:
    return corner_points(thing.shape) @ pose.rotation.T + pose.position


def _middle(corners: np.ndarray) -> np.ndarray:
    return 0.5 * (corners.min(axis=0) + corners.max(axis=0))


def _middle_at(place: Place, name: str, guest: GuestScene, corners: np.ndarray, other: np.ndarray | None) -> np.ndarray:
    """Return where the middle of an object (3,) [m] is brought."""
    half = 0.5 * float(np.ptp(corners[:, 2]))
    if place.kind == "bin":
        return guest.compartments[name] + np.array([0.0, 0.0, half])
    assert other is not None
    return np.append(_middle(other)[:2], other[:, 2].max() + half)


def _grasp(corners: np.ndarray) -> Pose:
    """Return the tcp pose of a grasp from above, fingers closing across the narrowest side."""
    across = np.column_stack([np.cos(DIRECTIONS), np.sin(DIRECTIONS)])
    yaw = DIRECTIONS[np.ptp(corners[:, :2] @ across.T, axis=0).argmin()]
    point = _middle(corners)
    point[2] = max(point[2], corners[:, 2].max() - DEEPEST)
    return Pose.from_yaw(point, float(yaw)) @ Pose.from_position_quaternion(np.zeros(3), DOWN)


def _above(pose: Pose, height: float) -> Pose:
    return Pose.from_position_quaternion([0.0, 0.0, height]) @ pose


def _keys(grasp: Pose) -> list[tuple[Pose, ...]]:
    """Return the poses above a grasp that must stay reachable, each with that of a hand turned by half a turn."""
    half_turn = Pose.from_position_quaternion(np.zeros(3), (0.0, 0.0, 0.0, 1.0))
    return [(_above(grasp, up), _above(grasp, up) @ half_turn) for up in ABOVE]


def _reach(home: Pose, corners: np.ndarray) -> PlacementMotion:
    grasp = _grasp(corners)
    return PlacementMotion(home, grasp, tuple(_keys(grasp)), FINGERTIP, Pose.identity(), motion=0)


def _carry(thing: TaskObject, pose: Pose, corners: np.ndarray, middle: np.ndarray) -> PlacementMotion:
    grasp = _grasp(corners)
    there = Pose.from_position_quaternion(middle - _middle(corners)) @ grasp
    return PlacementMotion(
        start=_above(grasp, RAISED),
        end=_above(there, RAISED),
        keys=(*_keys(grasp), *_keys(there)),
        shape=thing.shape,
        tcp_from_object=grasp.inverse() @ pose,
        motion=1,
    )
