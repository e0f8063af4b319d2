"""Robots among obstacles for the tests of clearances."""

from __future__ import annotations

import numpy as np
from helpers.arms import random_arm
from soak import random_body, random_obstacles

from onedemo.planner.collision.robot_arrays import robot_arrays
from onedemo.planner.geometry.shapes import Obstacle, pack
from onedemo.planner.robot.arm import Arm
from onedemo.planner.robot.body import Body
from onedemo.planner.safety.safety_layer import SafetySettings

SAFETY = SafetySettings(distance=0.01, self_distance=0.015, shell=0.5)


def work_of(arm: Arm, body: Body, obstacles, pairs=(), masks=(), setting: SafetySettings = SAFETY) -> np.ndarray:
    return robot_arrays(
        [arm],
        [body],
        pack(obstacles),
        masks=masks,
        margin=setting.distance,
        pairs=pairs,
        settings=setting.packed(0.01),
    )


def robot(seed: int, moving: bool = False):
    """Work array, arm, joints of a random robot among random obstacles, with pairs of its own."""
    rng = np.random.default_rng(seed)
    arm = random_arm(seed, int(rng.integers(1, 8)), 0.3)
    body = random_body(arm, rng)
    obstacles = random_obstacles(rng)
    if moving:
        obstacles = [Obstacle(o.shape, o.pose, rng.normal(size=3) * rng.choice([0.0, 0.3, 2.0])) for o in obstacles]
    pairs = [(i, j) for i in range(len(body)) for j in range(i + 1, len(body)) if rng.uniform() < 0.4]
    return work_of(arm, body, obstacles, pairs), arm, body, rng


POINT = Body(np.array([[2, 0, 0, 0, 0, 0, 0, 0.02]]), ("ball",))
