"""A robot model as its readers describe it: parts, the joints between them, and their geometry."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..geometry.hulls import Cover
from ..geometry.pose import Pose
from ..models.model_joints import ModelJoint
from ..robot.joint_frames import moved


class Geometry(NamedTuple):
    """Geometry of a part, in its frame.

    Attributes:
        exact: capsules, and balls as capsules with coincident ends.
        points: (n, 3) [m]; their hull contains all other geometry.
        triangles: (k, 3, 3) of its surface [m], if it is a mesh that need not be convex; else none.
    """

    exact: Cover
    points: np.ndarray
    triangles: np.ndarray = np.zeros((0, 3, 3))


class BodyPart(NamedTuple):
    """A part of a robot: geometry that moves as one.

    Attributes:
        name: in the model, for messages.
        parent: index of the part this one is attached to, lower than its own; -1: the world.
        pose: `parent_from_part` with all joints at the reference.
        frame: index of the arm's joint that moves the part, -1 for the arm's base; None: not a link of the arm.
        joints: other joints that move the part, nearest to the parent first.
        geometry: of the part, one entry per collision element.
    """

    name: str
    parent: int
    pose: Pose
    frame: int | None
    joints: tuple[ModelJoint, ...]
    geometry: tuple[Geometry, ...]


class RobotModel(NamedTuple):
    """A robot model as read from a file or a compiled model.

    Attributes:
        source: for messages.
        parts: parents first.
        reference: (dof,) positions of the arm's joints at which the parts' poses hold [rad or m].
        joints: per joint of the arm: index of its part, axis (3,) and a point on the axis (3,) in the part's frame [m].
    """

    source: str
    parts: list[BodyPart]
    reference: np.ndarray
    joints: list[tuple[int, np.ndarray, np.ndarray]]


class PartPlace(NamedTuple):
    """Place of a part in the body.

    Attributes:
        frame: index of the arm's joint whose frame the part moves with, -1 for the base's; None: not on the robot.
        piece: name of its capsules, see `body_from_mujoco`; "" if it is not covered.
        below: whether it hangs on another part that moves by joints that are not the arm's, and is swept with that one.
        moving: whether it moves by such joints.
    """

    frame: int | None
    piece: str
    below: bool
    moving: bool


def places_of(parts: Sequence[BodyPart], dof: int) -> list[PartPlace]:
    """Return the place of every part in the body.

    Args:
        parts: parents first.
        dof: number of the arm's joints.
    """
    places: list[PartPlace] = []
    for part in parts:
        above = PartPlace(None, "", False, False) if part.parent < 0 else places[part.parent]
        frame = above.frame if part.frame is None else part.frame
        moving = above.moving or len(part.joints) > 0
        if frame is None or (part.frame is None and frame == -1):
            piece = ""
        elif part.frame is None and frame == dof - 1:
            piece = "fingers" if moving else "hand"
        else:
            piece = f"link{frame + 1}"
        places.append(PartPlace(frame, piece, above.moving, moving))
    return places


def joined(geometries: Sequence[Geometry]) -> Geometry:
    """Merge several geometries of one frame."""
    exact = [capsule for geometry in geometries for capsule in geometry.exact]
    return Geometry(exact, np.vstack([np.zeros((0, 3)), *(geometry.points for geometry in geometries)]))


def placed(a_from_b: Pose, geometry: Geometry) -> Geometry:
    """Transform geometry from frame b to frame a.

    Args:
        a_from_b: pose of b in a.
        geometry: in frame b.
    """
    exact = [(moved(a_from_b, a), moved(a_from_b, b), radius) for a, b, radius in geometry.exact]
    return Geometry(exact, moved(a_from_b, geometry.points), moved(a_from_b, geometry.triangles))


def world_from_parts(parts: Sequence[BodyPart]) -> list[Pose]:
    """Return the poses of all parts in the world, with all joints at the reference."""
    world: list[Pose] = []
    for part in parts:
        world.append(part.pose if part.parent < 0 else world[part.parent] @ part.pose)
    return world
