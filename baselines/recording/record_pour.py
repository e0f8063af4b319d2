"""Script of the demonstration `pour` with explicit waypoints. A script moved this arm, not a person."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...envs.pour.facts import SOURCE, TARGET
from ...envs.pour.geometry import BACK, GLASSES, TILTED, UP, grasp, pouring
from ...planner import Demonstration, Pose
from .scripted_recorder import ScriptedMotion, Waypoint, recorded

YAW = np.deg2rad(75.0)
"""Yaw [rad] of the hand's level approach: away from the arm and across, so that it can tilt forward over the target."""
SHORT = 0.13
"""Distance [m] before the source at which the hand is level with it."""
LIFT = 0.12
"""Height [m] of the lift."""
HALF = np.deg2rad(65.0)
"""Tilt [rad] with which the lip reaches the pour point: with a smaller one, the glass would collide with the target."""
CAREFUL, SLOW = 0.6, 0.1
"""Largest angular speed with beads at the lip [rad/s], and largest speed at the grasp [m/s]."""
DRAIN = 0.8
"""Time [s] for which the glass is held tilted."""


def pour_script(glasses: np.ndarray) -> Iterator[ScriptedMotion]:
    """Yield the motions for glasses at poses (2, 7)."""
    glass, center = GLASSES[SOURCE], glasses[SOURCE, :3]
    rim = glasses[TARGET, :3] + [0.0, 0.0, 0.5 * GLASSES[TARGET].height]
    hand = grasp(glass, center, YAW)
    before = hand @ Pose.from_position_quaternion([0.0, 0.0, -SHORT])
    yield ScriptedMotion("approach", (Waypoint(before), Waypoint(hand, SLOW)), "source", gripper=1.0)
    raised = Pose.from_position_quaternion([0.0, 0.0, LIFT]) @ hand
    yield ScriptedMotion("lift", (Waypoint(raised, SLOW),), held="source")
    ready = Waypoint(pouring(glass, rim, YAW, 0.0, BACK, UP))
    half = Waypoint(pouring(glass, rim, YAW, HALF), angular=CAREFUL)
    full = Waypoint(pouring(glass, rim, YAW, TILTED), angular=CAREFUL, hold=DRAIN)
    yield ScriptedMotion("carry", (ready, half, full), "target", held="source")
    yield ScriptedMotion("return", (half, ready), "target", held="source")


def record_pour(env: Any) -> Demonstration:
    """Record the demonstration in `onedemo/Pour-v0` (unwrapped) at level L0.

    Raises:
        PlanFailed: a waypoint cannot be reached.
        BadDemonstration: the simulator reported no success.
    """
    observation, _ = env.reset(seed=0, options={"level": "L0"})
    return recorded(env, observation, pour_script(observation["object_pose"]), name="pour")
