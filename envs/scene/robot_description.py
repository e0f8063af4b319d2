"""What every policy may know of the robot: its bodies, and what it must keep clear of for ever."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...planner.geometry.pose import Pose
from ...planner.geometry.shapes import Capsule, Obstacle, pack
from ...planner.robot.arm import Arm
from ...planner.robot.body import RADIUS, Body
from ...planner.robot.chain_readers import turn_z_to
from .body_clearance import arm_clearance, capsule_ends
from .robot_bodies import robot_body
from .robots import robot_named
from .scene import CompiledScene

PARKED = "other arm"
"""Name of an arm that does nothing, among the fixtures."""


class RobotParts(NamedTuple):
    """What is known of a robot.

    Attributes:
        bodies: per arm that works its capsules.
        fixtures: what stands still for ever, an arm that does nothing included.
        touching: links and fixtures that are so near in every posture that nobody needs to look.
    """

    bodies: tuple[Body, ...]
    fixtures: tuple[Obstacle, ...]
    touching: tuple[tuple[str, str], ...]


def robot_parts(robot: str, scene: CompiledScene) -> RobotParts:
    """What is known of the robot of a scene."""
    order = list(robot_named(robot).ready)
    bodies = tuple(robot_body(robot, order.index(index.side)) for index in scene.arms)
    idle = [
        capsule
        for index, q in zip(scene.parked, scene.parked_joints, strict=True)
        for capsule in _capsules(index.arm, robot_body(robot, order.index(index.side)), q)
    ]
    fixtures = (*scene.fixtures, *idle)
    arms = [index.arm for index in scene.arms]
    return RobotParts(bodies, fixtures, _touching(arms, bodies, scene.home, scene.fixtures))


def _capsules(arm: Arm, body: Body, q: np.ndarray) -> list[Obstacle]:
    """The capsules of an arm at joints q (dof,) as obstacles."""
    found = []
    for (a, b), radius in zip(capsule_ends(arm, body, q, range(arm.dof)), body.rows[:, RADIUS], strict=True):
        pose = Pose.from_position_quaternion(0.5 * (a + b), turn_z_to(b - a))
        found.append(Obstacle(Capsule(float(radius), float(np.linalg.norm(b - a))), pose, name=PARKED))
    return found


def _touching(
    arms: list[Arm], bodies: tuple[Body, ...], home: np.ndarray, fixtures: tuple[Obstacle, ...]
) -> tuple[tuple[str, str], ...]:
    """Links whose capsules reach into a fixture where the arm starts: those next to what they hang on."""
    return tuple(
        dict.fromkeys(
            (f"link{joint + 1}", fixture.name)
            for arm, body, q in zip(arms, bodies, home, strict=True)
            for fixture in fixtures
            for joint in range(arm.dof - 1)
            if arm_clearance(arm, body, q, pack([fixture]), range(joint, joint + 1)) < 0.0
        )
    )
