"""Script of the demonstration `shelve`, in the LOWER shelf, with explicit waypoints. A script moved this arm."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...planner import Demonstration, Pose
from .scripted_recorder import ScriptedMotion, Waypoint, recorded

GRASP = Pose.from_position_quaternion([-0.055, 0.0, 0.0], (0.5, 0.5, 0.5, 0.5))
"""Pose of the hand (tcp) in the book's frame: 25 mm behind the spine, level, fingers on the covers."""
BEFORE, LIFT, INSERTION_DEPTH = 0.13, 0.15, 0.22
"""Distances [m]: approach to the grasp, lift off the stand, motions into and out of the shelf."""
ABOVE = 0.003
"""Height [m] above the shelf board at which the book is inserted and released."""
OPENING = 0.047
"""Gap [m] between the finger pads that releases a book: a wider one would push its neighbors."""
SLOW = 0.12
"""Speed into and out of the shelf [m/s]."""


def shelve_script(observation: dict[str, np.ndarray], width: float) -> Iterator[ScriptedMotion]:
    """Yield the motions for an observed scene.

    Args:
        observation: observation with `object_pose` and `goal_pose`, (n, 7) each.
        width: largest opening of the gripper [m].
    """
    grasp = Pose.from_vector(observation["object_pose"][0]) @ GRASP
    release = _up(ABOVE) @ Pose.from_vector(observation["goal_pose"][0]) @ GRASP
    lifted, before = _up(LIFT) @ grasp, release @ _along(-INSERTION_DEPTH)
    yield ScriptedMotion("approach", (Waypoint(grasp @ _along(-BEFORE)),))
    yield ScriptedMotion("reach", (Waypoint(grasp, SLOW),), "book0", gripper=1.0)
    yield ScriptedMotion("lift", (Waypoint(lifted),), held="book0")
    yield ScriptedMotion("carry", (Waypoint(before),), held="book0")
    insert = (Waypoint(release, SLOW),)
    yield ScriptedMotion("insert", insert, "book0", "book0", -OPENING / width)
    yield ScriptedMotion("retreat", (Waypoint(before, SLOW),), "book0")


def _up(height: float) -> Pose:
    return Pose.from_position_quaternion([0.0, 0.0, height])


def _along(height: float) -> Pose:
    """Return a displacement [m] along the hand's approach direction, in the hand's frame."""
    return Pose.from_position_quaternion([0.0, 0.0, height])


def record_shelve(env: Any) -> Demonstration:
    """Record the demonstration in `onedemo/Shelve-v0` (unwrapped), with one book in the lower shelf, at level L0.

    Raises:
        PlanFailed: a waypoint cannot be reached.
        BadDemonstration: the simulator reported no success.
    """
    observation, _ = env.reset(seed=0, options={"level": "L0"})
    return recorded(env, observation, shelve_script(observation, env.task.gripper_width[0]), name="shelve")
