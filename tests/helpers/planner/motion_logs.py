"""A true log of a motion, and ways to change it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from helpers.arms import READY, panda

from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.geometry.shapes import Box, Capsule, Cylinder, Mesh, Obstacle, Sphere
from onedemo.planner.judge.certify import certify
from onedemo.planner.log.motion_log import MotionLog
from onedemo.planner.robot.body import Body

LINKS = [
    (-1, 0, 0, 0, 0, 0, 0.15, 0.09),
    (0, 0, 0, -0.1, 0, 0, 0, 0.08),
    (1, 0, 0, 0, 0, -0.15, 0, 0.08),
    (2, 0, 0, -0.1, 0, 0, 0.05, 0.08),
    (2, 0.08, 0, 0, 0.08, 0.02, 0, 0.07),
    (3, 0, 0, 0, -0.08, 0.08, 0, 0.07),
    (4, 0, 0, -0.25, 0, 0.05, -0.1, 0.06),
    (4, 0, 0.05, -0.1, 0, 0.05, 0, 0.06),
    (5, 0, 0, 0, 0.08, 0, 0, 0.06),
    (6, 0, 0, 0.05, 0, 0, 0.107, 0.05),
    (6, 0, -0.09, 0.13, 0, 0.09, 0.13, 0.03),
    (6, 0, 0.05, 0.17, 0, 0.05, 0.2, 0.02),
    (6, 0, -0.05, 0.17, 0, -0.05, 0.2, 0.02),
    (6, 0, 0, 0.2, 0, 0, 0.25, 0.03),
]
NAMES = ("base", "l1", "l2", "l3", "l3", "l4", "l5", "l5", "l6", "l7", "hand", "finger", "finger", "cup")
STEPS = 80
SECONDS = 4.0


def at(*position: float) -> Pose:
    return Pose.from_position_quaternion(position)


def rock() -> Mesh:
    return Mesh.hull_of(np.random.default_rng(0).normal(size=(40, 3)) * 0.05)


def motion() -> tuple[np.ndarray, np.ndarray]:
    s = np.linspace(0, 1, STEPS)
    s = (3 * s**2 - 2 * s**3)[:, None]
    end = np.array([0.8, 0.5, -0.3, -1.8, 0.2, 2.1, 1.28])
    return np.linspace(0, SECONDS, STEPS), READY + s * (end - READY)


@cache
def good() -> MotionLog:
    arm, (time, joints) = panda(), motion()
    body = Body(np.array(LINKS), NAMES, ("cup",))
    poses = [arm.fk(q) for q in joints]
    under = poses[-1].position + poses[-1].rotation @ [0, 0, 0.143]
    obstacles = (
        Obstacle(Box((2.0, 2.0, 0.1)), at(0, 0, -0.16), name="table", margin=0.0),
        Obstacle(Sphere(0.08), at(0.47, 0.11, 0.66), name="ball"),
        Obstacle(Cylinder(0.05, 0.4), at(0.2, 0.62, 0.3), name="post"),
        Obstacle(rock(), at(0.72, 0.02, 0.09), name="rock"),
        Obstacle(Capsule(0.03, 0.3), at(0.8, -0.5, 0.5), np.array([-0.05, 0.1, 0.0]), name="flying"),
        Obstacle(Box((0.06, 0.06, 0.06)), at(*under), name="coaster", margin=0.0),
    )
    # What was wanted lies 1 mm and 2 mrad beside what was done.
    aside = Pose.from_yaw([0, 0, 0.001], 0.002)
    tail = PosePath(np.array([pose.dq for pose in [*poses[40:-1:4], poses[-1]]])).with_tool(aside)
    allowed = (("cup", "coaster"), ("finger", "coaster"), ("hand", "coaster"), ("l7", "coaster"), ("base", "table"))
    log = MotionLog(arm, body, obstacles, time, joints, 0.01, poses[-1] @ aside, tail, allowed)
    truth = certify(log)
    claims = {
        "clearance": truth.clearance,
        "position_error": 0.001,
        "angle_error": 0.002,
        "joint_margin": truth.joint_margin,
        "deviation": float(np.hypot(0.001, 0.2 * 0.002)),
    }
    return replace(log, claims=claims)
