"""A point on a gantry, guarded."""

from __future__ import annotations

import math

import numpy as np

from onedemo.planner.robot.arm import Arm
from onedemo.planner.robot.body import Body
from onedemo.planner.safety.safety_layer import (
    SafetyLayer,
)

DT = 0.01


def gantry(reach: float = 5.0, speed: float = 100.0) -> Arm:
    """Three sliding joints along x, y and z."""
    chain = np.zeros((4, 8))
    half = math.sqrt(0.5)
    # each joint slides along its own z: turn z to x, then to y, then to z of the world
    chain[:, :4] = [[half, 0, half, 0], [0.5, -0.5, -0.5, -0.5], [half, half, 0, 0], [1, 0, 0, 0]]
    chain[:3, 7] = 1.0
    arm = Arm("gantry", ("x", "y", "z"), chain, np.full(3, -reach), np.full(3, reach), np.full(3, speed))
    np.testing.assert_allclose(arm.fk([1.0, 2.0, 3.0]).position, [1, 2, 3], rtol=0, atol=1e-12)
    return arm


BALL = Body(np.array([[2, 0, 0, 0, 0, 0, 0, 0.02]]), ("ball",))


def point_among(obstacles, dt=DT, speed=100.0, **options) -> SafetyLayer:
    return SafetyLayer([gantry(speed=speed)], [BALL], obstacles, dt, **options)
