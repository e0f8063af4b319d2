"""Motions of the hand that obstacles may block in a robosuite task: from data, never from a demonstration."""

from __future__ import annotations

import numpy as np

from ...planner import Pose
from ..core.carries import carry_motion, corners_at, grasp_from_above, middle_of, reach_motion
from ..core.description import TaskObject
from ..core.placement_context import PlacementMotion
from .guest_scene import GuestScene
from .solids import hull_of
from .task_facts import PLACES, Place


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
        if not each.parts:
            continue
        things[each.name] = TaskObject(each.name, hull_of(each.parts), 2.0 * np.pi, each.parts)
        poses[each.name] = Pose.from_vector(row)
    places = PLACES.get(guest.task, {each.name: Place("reach") for each in guest.objects})
    motions = []
    for name, place in places.items():
        corners = corners_at(things[name].shape, poses[name])
        if place.kind == "reach":
            motions.append(reach_motion(home, corners))
        else:
            other = corners_at(things[place.thing].shape, poses[place.thing]) if place.thing else None
            grasp = grasp_from_above(corners)
            moved = _middle_at(place, name, guest, corners, other) - middle_of(corners)
            there = Pose.from_position_quaternion(moved) @ grasp
            motions.append(carry_motion(things[name].shape, poses[name], grasp, there))
    return motions


def _middle_at(place: Place, name: str, guest: GuestScene, corners: np.ndarray, other: np.ndarray | None) -> np.ndarray:
    """Return where the middle of an object (3,) [m] is brought."""
    half = 0.5 * float(np.ptp(corners[:, 2]))
    if place.kind == "bin":
        return guest.compartments[name] + np.array([0.0, 0.0, half])
    assert other is not None
    return np.append(middle_of(other)[:2], other[:, 2].max() + half)
