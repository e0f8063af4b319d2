"""The script that shows how a book is shelved: its waypoints, in the open. Recorded in the LOWER shelf."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..planner.demo import Demonstration
from ..planner.pose import Pose
from .scripted import ScriptedMotion, Waypoint, recorded

GRASP = Pose.from_position_quaternion([-0.055, 0.0, 0.0], (0.5, 0.5, 0.5, 0.5))
"""Hand (tcp) in the book's frame: 25 mm behind the spine, level, fingers on the covers."""
BEFORE, LIFT, WAY_IN = 0.13, 0.15, 0.22
"""Ways [m]: to the grasp, up from the stand, into the shelf and out of it again."""
ABOVE = 0.003
"""Height above the shelf's board at which the book goes in and is let go [m]."""
OPENING = 0.047
"""Gap between the finger pads that lets a book go [m]: a wider one would push its neighbors."""
SLOW = 0.12
"""Speed into and out of the shelf [m/s]."""


def shelve_demonstration(env: Any) -> Demonstration:
    """One book, shelved by a script in an environment of one book at level L0 with `shelf="lower"`."""
    observation, _ = env.reset(seed=0)
    motions = list(_motions(observation, env.task.gripper_width[0]))
    return recorded(env, observation, motions, name="shelve")


def _motions(observation: dict[str, np.ndarray], width: float) -> Iterator[ScriptedMotion]:
    grasp = Pose.from_vector(observation["object_pose"][0]) @ GRASP
    release = _up(ABOVE) @ Pose.from_vector(observation["goal_pose"][0]) @ GRASP
    lifted, before = _up(LIFT) @ grasp, release @ _along(-WAY_IN)
    yield ScriptedMotion("approach", (Waypoint(grasp @ _along(-BEFORE)),))
    yield ScriptedMotion("reach", (Waypoint(grasp, SLOW),), "book0", gripper=1.0)
    yield ScriptedMotion("lift", (Waypoint(lifted),), held="book0")
    yield ScriptedMotion("carry", (Waypoint(before),), held="book0")
    insert = (Waypoint(release, SLOW),)
    yield ScriptedMotion("insert", insert, "book0", "book0", -OPENING / width)
    yield ScriptedMotion("retreat", (Waypoint(before, SLOW),), "book0")


def _up(height: float) -> Pose:
    return Pose.from_position_quaternion([0.0, 0.0, height])


def _along(way: float) -> Pose:
    """A way along the direction that the hand points in, in the hand's frame."""
    return Pose.from_position_quaternion([0.0, 0.0, way])
