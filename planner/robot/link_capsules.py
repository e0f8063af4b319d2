"""The parts of a robot as described by the model readers, and the capsules that contain them.

Parts attached by joints that are not the arm's, like a gripper's fingers, are covered over the whole range of those
joints.

Not in the paper: the paper moves a point.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ..errors import BadModel, UnfitShape, UnknownName
from ..geometry.capsule_cover import fitted_capsules, strips
from ..geometry.hulls import Cover, corner_points, sticks_out, union_volume
from ..geometry.pose import Pose
from ..geometry.shapes import Sphere, hull_corners
from .arm import Arm
from .body import Body
from .kinematics import CHAIN, PRISMATIC, REVOLUTE

Split = int | Mapping[str, int] | None
SMALLER, CLOSER = 0.85, 0.75
"""A link gets one more capsule if that reduces the volume, or the protrusion, to less than this fraction."""
FINGER_EXCESS = 0.006
"""Approximate largest protrusion [m] of finger capsules, small because fingers go close to objects."""
STEP = math.radians(15.0)
"""Largest step [rad] in which a revolute finger joint is swept."""
SAME = 1e-6
"""Tolerance [m, rad] within which joints of a model and of the arm coincide."""


class Joint(NamedTuple):
    """A joint that does not belong to the arm, in the frame of its part.

    Attributes:
        kind: REVOLUTE, PRISMATIC or NaN for any other.
        axis: (3,) unit.
        position: (3,) a point on the axis [m].
        low: lowest position relative to the reference [rad or m]; -inf without a limit.
        high: highest position relative to the reference [rad or m]; inf without a limit.
    """

    kind: float
    axis: np.ndarray
    position: np.ndarray
    low: float
    high: float


class Geometry(NamedTuple):
    """Geometry of a part, in its frame.

    Attributes:
        exact: capsules, and balls as capsules with coincident ends.
        points: (n, 3) [m]; their hull contains all other geometry.
    """

    exact: Cover
    points: np.ndarray


class BodyPart(NamedTuple):
    """A part of a robot: geometry that moves as one.

    Attributes:
        name: in the model, for messages.
        parent: index of the part this one is attached to, lower than its own; -1: the world.
        pose: `parent_from_part` with all joints at the reference.
        frame: index of the arm's joint that moves the part, -1 for the arm's base; None: not a link of the arm.
        joints: other joints that move the part, nearest to the parent first.
        geometry: of the part.
    """

    name: str
    parent: int
    pose: Pose
    frame: int | None
    joints: tuple[Joint, ...]
    geometry: Geometry


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


class _Piece(NamedTuple):
    """Geometry covered together.

    Attributes:
        name: of its capsules.
        frame: index of the frame the piece moves with; -1: the base's, which is the world.
        pose: `frame_from_piece`.
        geometry: in the piece's own frame, so that the fit does not depend on the arm's base pose.
    """

    name: str
    frame: int
    pose: Pose
    geometry: Geometry


def joint_frames(arm: Arm, q: np.ndarray) -> list[Pose]:
    """Return `world_from_frame` of every joint's frame after the joint has moved.

    Args:
        arm: the arm.
        q: (dof,) joint positions [rad or m].
    """
    poses, pose = [], Pose.identity()
    for row, value in zip(arm.chain[:-1], q, strict=True):
        turned = Pose.from_yaw([0.0, 0.0, 0.0], value)
        step = turned if row[CHAIN.kind] == REVOLUTE else Pose.from_position_quaternion([0.0, 0.0, value])
        fixed = Pose.from_position_quaternion(row[CHAIN.offset : CHAIN.kind], row[CHAIN.rotation : CHAIN.offset])
        pose = pose @ fixed @ step
        poses.append(pose)
    return poses


def moved(a_from_b: Pose, points: np.ndarray) -> np.ndarray:
    """Transform points from frame b to frame a.

    Args:
        a_from_b: pose of b in a.
        points: (..., 3) [m].
    """
    return points @ a_from_b.rotation.T + a_from_b.position


def joined(geometries: list[Geometry]) -> Geometry:
    """Merge several geometries of one frame."""
    exact = [capsule for geometry in geometries for capsule in geometry.exact]
    return Geometry(exact, np.vstack([np.zeros((0, 3)), *(geometry.points for geometry in geometries)]))


def body_of(robot: RobotModel, arm: Arm, split: Split) -> Body:
    """Cover a robot's parts with capsules, named and placed as `body_readers` describes.

    Args:
        robot: the model that was read.
        arm: the arm, read from the same model.
        split: number of capsules (1 to 3) of every piece, or of some pieces by name; None: as many as pay off.

    Raises:
        BadModel: another arm, no collision geometry, or geometry that encloses no volume.
        UnknownName: a piece in `split` that the arm lacks.
    """
    world = _world_from_parts(robot.parts)
    frames = [Pose.identity(), *joint_frames(arm, robot.reference)]
    for name, frame, (part, axis, position) in zip(arm.joint_names, frames[1:], robot.joints, strict=True):
        direction = frame.rotation[:, 2]
        off = np.cross(moved(world[part], position) - frame.position, direction)
        if np.abs(world[part].rotation @ axis - direction).max() > SAME or np.abs(off).max() > SAME:
            raise BadModel(robot.source, name, f"is not where the arm {arm.name!r} has it: they are not the same")
    pieces = _pieces(robot, world, frames)
    names = {piece.name for piece in pieces}
    if isinstance(split, Mapping) and set(split) - names:
        raise UnknownName("link to split", min(set(split) - names), sorted(names))
    rows, labels = [], []
    for piece in pieces:
        for a, b, radius in _cover(piece, split, robot.source):
            rows.append([piece.frame, *moved(piece.pose, a), *moved(piece.pose, b), radius])
            labels.append(piece.name)
    if not rows:
        raise BadModel(robot.source, "collision geometry", "the arm has none")
    return Body(np.array(rows), tuple(labels))


def _world_from_parts(parts: list[BodyPart]) -> list[Pose]:
    world: list[Pose] = []
    for part in parts:
        world.append(part.pose if part.parent < 0 else world[part.parent] @ part.pose)
    return world


def _pieces(robot: RobotModel, world: list[Pose], frames: list[Pose]) -> list[_Piece]:
    """Group every link by itself, the parts welded to the last link, and the parts that move on it; base first."""
    parts, last = robot.parts, len(frames) - 2
    owner: list[int | None] = []
    moving: list[bool] = []
    found: dict[tuple[int, str, int], list[Geometry]] = {}
    for k, part in enumerate(parts):
        above, under = (None, False) if part.parent < 0 else (owner[part.parent], moving[part.parent])
        frame = above if part.frame is None else part.frame
        owner.append(frame)
        moving.append(under or len(part.joints) > 0)
        beside = part.frame is None and frame == -1
        if frame is None or beside or under:
            continue
        to_frame = (world[k] if frame < 0 else frames[frame + 1]).inverse()
        if part.joints:
            points = _through(robot, part, _swept(robot, k))
            geometry = Geometry([], moved(to_frame @ world[part.parent], points))
        else:
            geometry = placed(to_frame @ world[k], part.geometry)
        name, key = f"link{frame + 1}", k
        if part.frame is None and frame == last:
            name, key = ("fingers", -1) if part.joints else ("hand", -1)
        found.setdefault((frame, name, key), []).append(geometry)
    order = sorted(found, key=lambda key: (key[0], ("hand", "fingers").index(key[1]) + 1 if key[2] < 0 else 0))
    pieces = []
    for frame, name, key in order:
        pose = world[key] if frame < 0 else Pose.identity()
        pieces.append(_Piece(name, frame, pose, joined(found[frame, name, key])))
    return [piece for piece in pieces if piece.geometry.exact or len(piece.geometry.points)]


def placed(a_from_b: Pose, geometry: Geometry) -> Geometry:
    """Transform geometry from frame b to frame a.

    Args:
        a_from_b: pose of b in a.
        geometry: in frame b.
    """
    exact = [(moved(a_from_b, a), moved(a_from_b, b), radius) for a, b, radius in geometry.exact]
    return Geometry(exact, moved(a_from_b, geometry.points))


def _swept(robot: RobotModel, k: int) -> np.ndarray:
    """Return points in a part's frame; their hull contains the part and its attachments at all joint positions."""
    part = robot.parts[k]
    clouds = [part.geometry.points]
    for a, b, radius in part.geometry.exact:
        ball = corner_points(Sphere(radius))
        clouds += [ball + a, ball + b]
    for child, other in enumerate(robot.parts):
        if other.parent == k:
            clouds.append(_through(robot, other, _swept(robot, child)))
    return _fewer(np.vstack(clouds))


def _through(robot: RobotModel, part: BodyPart, points: np.ndarray) -> np.ndarray:
    """Return the points of a part, swept by its joints, in the parent's frame."""
    for joint in reversed(part.joints):
        points = _fewer(sweep(joint, points, robot.source, part.name))
    return moved(part.pose, points)


def sweep(joint: Joint, points: np.ndarray, source: str, name: str) -> np.ndarray:
    """Sweep points by a joint over its whole range.

    Args:
        joint: revolute, or prismatic with limits.
        points: (n, 3) in the frame of the joint's part [m].
        source: name of the model for messages.
        name: of the part, for messages.

    Returns:
        Points (k, 3) [m] whose hull contains all the points at all joint positions.

    Raises:
        BadModel: any other joint.
    """
    span = joint.high - joint.low
    if joint.kind == PRISMATIC and math.isfinite(span):
        return np.vstack([points + joint.low * joint.axis, points + joint.high * joint.axis])
    if joint.kind != REVOLUTE:
        raise BadModel(source, name, "hangs on a joint that is neither a hinge nor a slide with limits")
    low = joint.low if span < 2.0 * math.pi else 0.0
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
    try:
        return points[hull_corners(points)] if len(points) > 8 else points
    except UnfitShape:
        return points


def _cover(piece: _Piece, split: Split, source: str) -> Cover:
    exact, points = piece.geometry
    if not len(points):
        return exact
    count = split.get(piece.name) if isinstance(split, Mapping) else split
    try:
        if count is not None:
            return exact + fitted_capsules(points, count)
        if piece.name == "fingers":
            return exact + strips(points, FINGER_EXCESS)
        fit, pays = fitted_capsules(points, 1), True
        while pays and len(fit) < 3:
            finer = fitted_capsules(points, len(fit) + 1)
            pays = union_volume(finer) < SMALLER * union_volume(fit)
            pays = pays or sticks_out(finer, points) < CLOSER * sticks_out(fit, points)
            fit = finer if pays else fit
    except UnfitShape as error:
        raise BadModel(source, piece.name, f"cannot be covered: {error.reason}") from None
    return exact + fit
