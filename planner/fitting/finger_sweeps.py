"""Sweeps of parts over the whole range of the joints that are not the arm's, like those of fingers."""

from __future__ import annotations

import math

import numpy as np

from ..errors import BadModel, UnfitShape
from ..geometry.convex_pieces import rounded_hull
from ..geometry.hulls import corner_points
from ..geometry.shapes import Sphere, hull_corners
from ..models.model_joints import SLIDES, TURNS, ModelJoint
from ..robot.joint_frames import moved
from .robot_model import BodyPart, RobotModel, joined

MANY = 5000
"""Number of corners above which a sweep is simplified."""
ROUNDING = 5e-4
"""Distance [m] by which a simplified sweep is larger, unless it is too round for that."""
GOLDEN = 0.5 + math.sqrt(1.25)
"""The golden ratio."""
ICOSAHEDRON = np.array(
    [np.roll([0.0, y, z * GOLDEN], turn) for turn in range(3) for y in (-1.0, 1.0) for z in (-1.0, 1.0)]
) * (math.sqrt(3.0) / GOLDEN**2)
"""Corners (12, 3) of the solid around a ball of radius 1."""
STEP = math.radians(15.0)
"""Largest step [rad] in which a revolute finger joint is swept."""


def swept(robot: RobotModel, k: int) -> np.ndarray:
    """Return points whose hull contains a part and its attachments at all joint positions.

    Args:
        robot: the model.
        k: index of the part.

    Returns:
        (n, 3) in the part's frame [m].
    """
    part = robot.parts[k]
    whole = joined(part.geometry)
    clouds = [whole.points]
    for a, b, radius in whole.exact:
        ball = corner_points(Sphere(radius))
        clouds += [ball + a, ball + b]
    for child, other in enumerate(robot.parts):
        if other.parent == k:
            clouds.append(through(robot, other, swept(robot, child)))
    return _fewer(np.vstack(clouds))


def through(robot: RobotModel, part: BodyPart, points: np.ndarray) -> np.ndarray:
    """Sweep points of a part by its joints.

    Args:
        robot: the model.
        part: the part.
        points: (n, 3) in its frame [m].

    Returns:
        (k, 3) in the parent's frame [m].
    """
    for joint in reversed(part.joints):
        points = _fewer(sweep(joint, points, robot.source, part.name))
    return moved(part.pose, points)


def sweep(joint: ModelJoint, points: np.ndarray, source: str, name: str) -> np.ndarray:
    """Sweep points by a joint over its whole range.

    Args:
        joint: one that turns, or slides within limits.
        points: (n, 3) in the frame of the joint's part [m].
        source: name of the model for messages.
        name: of the part, for messages.

    Returns:
        Points (k, 3) [m] whose hull contains all the points at all joint positions.

    Raises:
        BadModel: any other joint.
    """
    low, high = joint.low - joint.rest, joint.high - joint.rest
    span = high - low
    if not np.isfinite(joint.axis).all():
        raise BadModel(source, f"joint {joint.name!r}", "its axis is not a direction")
    if joint.kind == SLIDES and math.isfinite(span):
        return np.vstack([points + low * joint.axis, points + high * joint.axis])
    if joint.kind != TURNS:
        reason = f"hangs on {joint.name!r}, which is neither a hinge nor a slide with limits; locked holds it"
        raise BadModel(source, name, reason)
    low = low if span < 2.0 * math.pi else 0.0
    span = min(span, 2.0 * math.pi)
    count = max(1, math.ceil(span / STEP))
    half = 0.5 * span / count
    arms = points - joint.position
    axial = np.outer(arms @ joint.axis, joint.axis)
    radial = arms - axial
    side = np.cross(joint.axis, radial)
    # the corners of a polygon circumscribed about the arc, whose ends lie on the arc
    turns = [(low, 1.0), *((low + (2 * k + 1) * half, 1.0 / math.cos(half)) for k in range(count)), (low + span, 1.0)]
    arcs = [axial + scale * (math.cos(angle) * radial + math.sin(angle) * side) for angle, scale in turns]
    return joint.position + np.vstack(arcs)


def _fewer(points: np.ndarray) -> np.ndarray:
    """Return points whose hull contains some points: the corners of their hull, or few around it."""
    try:
        corners = points[hull_corners(points)] if len(points) > 8 else points
    except UnfitShape:
        return points
    if len(corners) <= MANY:
        return corners
    # sweeps of sweeps would have some hundred thousand corners: balls about few of them, each in a solid of 12 corners
    few, radius = rounded_hull(corners, ROUNDING)
    around = (few[:, None] + radius * ICOSAHEDRON).reshape(-1, 3)
    return around[hull_corners(around)]
