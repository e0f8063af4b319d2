"""Robot facts that every policy may know: its bodies, and the fixtures it must always avoid."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...planner import Arm, Body, Capsule, Obstacle, Pose
from ...planner.geometry.shapes import pack
from ...planner.robot.body import BODY
from ...planner.robot.chain_readers import turn_z_to
from .body_clearance import arm_clearance, capsule_ends
from .robot_bodies import robot_body
from .scene import CompiledScene

PARKED = "other arm"
"""Name of an idle arm among the fixtures."""


class RobotParts(NamedTuple):
    """Bodies and fixtures of a robot.

    Attributes:
        bodies: capsules of each working arm.
        fixtures: solids that never move, including an idle arm.
        touching: pairs (link, fixture) so close in every posture that they need no check.
    """

    bodies: tuple[Body, ...]
    fixtures: tuple[Obstacle, ...]
    touching: tuple[tuple[str, str], ...]


def robot_parts(scene: CompiledScene, moved: np.ndarray | None = None) -> RobotParts:
    """Return the bodies and fixtures of the robot in a scene.

    Args:
        scene: the scene.
        moved: (3,) displacement [m] of the robot's base from its place at OneDemo's table; None: it stands there.
    """
    robot, order = scene.robot, list(scene.robot.ready)
    bodies = tuple(robot_body(robot, order.index(index.side)) for index in scene.arms)
    if moved is not None:
        bodies = tuple(body.with_base_moved(moved) for body in bodies)
    idle = [
        capsule
        for index, q in zip(scene.parked, scene.parked_joints, strict=True)
        for capsule in _capsules(index.arm, robot_body(robot, order.index(index.side)), q)
    ]
    fixtures = (*scene.fixtures, *idle)
    arms = [index.arm for index in scene.arms]
    return RobotParts(bodies, fixtures, _touching(arms, bodies, scene.home, scene.fixtures))


def _capsules(arm: Arm, body: Body, q: np.ndarray) -> list[Obstacle]:
    """Return the capsules of an arm at joints q (dof,) as obstacles."""
    found = []
    for (a, b), radius in zip(capsule_ends(arm, body, q, range(arm.dof)), body.rows[:, BODY.radius], strict=True):
        pose = Pose.from_position_quaternion(0.5 * (a + b), turn_z_to(b - a))
        found.append(Obstacle(Capsule(float(radius), float(np.linalg.norm(b - a))), pose, name=PARKED))
    return found


def _touching(
    arms: list[Arm], bodies: tuple[Body, ...], home: np.ndarray, fixtures: tuple[Obstacle, ...]
) -> tuple[tuple[str, str], ...]:
    """Return pairs (link, fixture) that overlap at the start joints: links next to their mount."""
    return tuple(
        dict.fromkeys(
            (f"link{joint + 1}", fixture.name)
            for arm, body, q in zip(arms, bodies, home, strict=True)
            for fixture in fixtures
            for joint in range(arm.dof - 1)
            if arm_clearance(arm, body, q, pack([fixture]), range(joint, joint + 1)) < 0.0
        )
    )
