"""Common parts of the readers of bodies: their request, their result, names of pieces, geometry of shapes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..geometry.capsule_cover import covering_capsules
from ..geometry.hulls import corner_points
from ..geometry.shapes import Capsule, Shape, Sphere
from ..models.model_joints import SLIDES, TURNS, Coupling, ModelJoint, held_positions
from ..models.model_report import ModelReport, listed
from ..robot.arm import Arm
from ..robot.kinematics import PRISMATIC, REVOLUTE
from .robot_model import Geometry, Joint, RobotModel


class PartsRequest(NamedTuple):
    """Request for the parts of a body.

    Attributes:
        locked: position of each joint to hold [rad or m], by name or shell pattern, besides those that the arm holds.
        visuals: cover links without collision geometry by their visual geometry.
    """

    locked: Mapping[str, float]
    visuals: bool


class ReadRobot(NamedTuple):
    """A robot model that was read for its body.

    Attributes:
        robot: its parts.
        links: names of the links, or bodies, of each part that have geometry.
        report: findings of the reader.
    """

    robot: RobotModel
    links: tuple[tuple[str, ...], ...]
    report: ModelReport


def geometry_of(shape: Shape) -> Geometry:
    """Return a shape as geometry of a part."""
    if isinstance(shape, Sphere | Capsule):
        return Geometry(covering_capsules(shape), np.zeros((0, 3)))
    return Geometry([], corner_points(shape))


def swept_joint(joint: ModelJoint) -> Joint:
    """Return a joint that is not the arm's, with its range relative to rest."""
    kind = {TURNS: REVOLUTE, SLIDES: PRISMATIC}.get(joint.kind, np.nan)
    return Joint(kind, joint.axis, joint.position, joint.low - joint.rest, joint.high - joint.rest)


def names_of_pieces(robot: RobotModel, dof: int) -> list[str]:
    """Return for each part the name of its capsules, as `body_from_mujoco` describes; "" if it is not covered.

    Args:
        robot: the parts.
        dof: number of the arm's joints.
    """
    owner: list[int | None] = []
    moving: list[bool] = []
    names = []
    for part in robot.parts:
        above, under = (None, False) if part.parent < 0 else (owner[part.parent], moving[part.parent])
        owner.append(above if part.frame is None else part.frame)
        moving.append(under or len(part.joints) > 0)
        frame = owner[-1]
        if frame is None or (part.frame is None and frame == -1):
            names.append("")
        elif part.frame is None and frame == dof - 1:
            names.append("fingers" if moving[-1] else "hand")
        else:
            names.append(f"link{frame + 1}")
    return names


def pieces_of_links(read: ReadRobot, dof: int) -> dict[str, str]:
    """Return for each link, or body, that is covered and has geometry the name of its capsules.

    Args:
        read: the robot.
        dof: number of the arm's joints.
    """
    pieces = names_of_pieces(read.robot, dof)
    return {link: piece for links, piece in zip(read.links, pieces, strict=True) if piece for link in links}


def held_with_arm(
    joints: Mapping[str, ModelJoint], couplings: Sequence[Coupling], arm: Arm, request: PartsRequest, source: str
) -> dict[str, float]:
    """Return the positions of all joints that are held: by the arm, by the request, and those that follow them.

    Args:
        joints: all joints of the model, by name.
        couplings: joints that follow others.
        arm: the arm.
        request: joints to hold besides.
        source: name of the model for messages.

    Raises:
        BadModel: see `held_positions`.
    """
    followers = {coupling.follower for coupling in couplings}
    of_arm = {name: position for name, position in arm.report.held.items() if name not in followers}
    return held_positions(joints, couplings, {**of_arm, **request.locked}, (), arm.joint_names, source)


def unused_of_parts(beside: Sequence[str], swept: Sequence[str]) -> list[str]:
    """Return lines on what a body does not contain, and on what it contains in every position.

    Args:
        beside: links beside the arm.
        swept: joints, or what they move, on the arm's links.
    """
    hint = "make them obstacles, or hold their joints (locked)"
    lines = [f"links beside the arm, which its body does not contain; {hint}: {listed(beside)}"] if beside else []
    return [*lines, *([f"joints on the arm's links, covered over their range: {listed(swept)}"] if swept else [])]
