"""Common parts of the readers of bodies: their request, their result, held joints, geometry of shapes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..errors import BadModel
from ..geometry.capsule_cover import covering_capsules
from ..geometry.hulls import corner_points
from ..geometry.shapes import Capsule, Shape, Sphere
from ..models.model_joints import Coupling, ModelJoint, held_positions
from ..models.model_report import ModelReport, listed
from ..robot.arm import Arm
from .robot_model import Geometry, RobotModel, places_of


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


def pieces_of_links(read: ReadRobot, dof: int) -> dict[str, str]:
    """Return for each link, or body, that is covered and has geometry the name of its capsules.

    Args:
        read: the robot.
        dof: number of the arm's joints.
    """
    places = places_of(read.robot.parts, dof)
    return {link: place.piece for links, place in zip(read.links, places, strict=True) if place.piece for link in links}


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
        BadModel: see `held_positions`; or a joint that the arm holds elsewhere.
    """
    followers = {coupling.follower for coupling in couplings}
    of_arm = {name: position for name, position in arm.report.held.items() if name not in followers}
    for name in request.locked:
        if name in of_arm and request.locked[name] != of_arm[name]:
            raise BadModel(source, f"locked joint {name!r}", f"is held at {of_arm[name]:g} by the arm")
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
