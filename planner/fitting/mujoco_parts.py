"""The parts of a robot in a compiled MuJoCo model, for its body.

Not in the paper: the paper moves a point.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..errors import BadModel, UnfitShape
from ..geometry.hulls import corner_points
from ..geometry.pose import Pose
from ..geometry.shapes import Box, Capsule, Cylinder, Sphere
from ..models.model_joints import ModelJoint, check_independent, swept_range
from ..models.model_report import NOT_SOLID, SHOWN, ModelReport, listed
from ..models.mujoco_model import (
    geoms_of,
    mujoco_bodies,
    mujoco_body_names,
    mujoco_couplings,
    mujoco_joint_id,
    mujoco_joint_names,
    mujoco_joints,
    mujoco_pose,
    solid_geoms,
    unused_of_mujoco,
)
from ..robot.arm import Arm
from .robot_model import BodyPart, Geometry, RobotModel, placed, places_of
from .robot_parts import (
    PartsRequest,
    ReadRobot,
    geometry_of,
    held_with_arm,
    unused_of_parts,
)


def parts_from_mujoco(model: Any, arm: Arm, joint_names: Sequence[str] | None, request: PartsRequest) -> ReadRobot:
    """Read the parts of an arm, and of everything attached to it, from a compiled model.

    Args:
        model: `mujoco.MjModel`, read by its named fields.
        arm: read from the same model.
        joint_names: of the arm in the model; default: those of the arm.
        request: joints to hold, and whether geoms that do not collide count.

    Raises:
        BadModel: unknown joints, or another arm.
    """
    source, names, joints = arm.name, mujoco_joint_names(model), mujoco_joints(model)
    wanted = list(arm.joint_names if joint_names is None else joint_names)
    indices = [mujoco_joint_id(names, name, source) for name in wanted]
    couplings = mujoco_couplings(model)
    held = held_with_arm(joints, couplings, arm, request, source)
    path = mujoco_bodies(model, int(model.jnt_bodyid[indices[-1]])) if indices else []
    own = [[joints[names[k]] for k in range(first, first + count)] for first, count in _joint_ranges(model)]
    found = [joint.name for body in path for joint in own[body] if joint.name not in held]
    if found != wanted or len(wanted) != arm.dof:
        raise BadModel(source, "joint names", f"are not the {arm.dof} joints from the world to the last one")
    check_independent(wanted, couplings, held, source)
    ranged = [[swept_range(joint, couplings, joints) for joint in of_body] for of_body in own]
    parts, axes = _skeleton(model, path, ranged, held)
    pieces = [place.piece for place in places_of(parts, arm.dof)]
    parts = [
        part._replace(geometry=_geometry_of_body(model, k, part.name, source, request))
        for k, part in enumerate(parts, start=1)
    ]
    reference = np.array([joints[name].rest for name in wanted])
    robot = RobotModel(source, parts, reference, [axes[name] for name in wanted])
    links = tuple((part.name,) if part.geometry else () for part in parts)
    return ReadRobot(robot, links, _report(model, source, held, parts, pieces, request))


def _joint_ranges(model: Any) -> list[tuple[int, int]]:
    return [(int(first), int(count)) for first, count in zip(model.body_jntadr, model.body_jntnum, strict=True)]


def _skeleton(
    model: Any, path: list[int], own: list[list[ModelJoint]], held: Mapping[str, float]
) -> tuple[list[BodyPart], dict[str, tuple[int, np.ndarray, np.ndarray]]]:
    """Return parts without geometry, one per body, and for each joint of the arm its part, axis and a point on it.

    A body beside the path moves with the base if it hangs there by held joints, or below a held joint; other bodies
    without joints that hang on the base are obstacles.
    """
    parts, axes, frame, names = [], {}, -1, mujoco_body_names(model)
    below, based = {0: False}, set()
    for body in range(1, model.nbody):
        parent = int(model.body_parentid[body])
        loose = [joint for joint in own[body] if joint.name not in held]
        below[body] = below[parent] or len(loose) < len(own[body])
        pose, after = mujoco_pose(model.body_pos[body], model.body_quat[body]), Pose.identity()
        index: int | None = None
        others = []
        for joint in reversed(own[body]):  # a joint's axis is in the frame that the joints after it leave
            if joint.name in held:
                after = joint.motion(held[joint.name]) @ after
                continue
            joint = _seen_from(after, joint)
            axes[joint.name] = (body - 1, joint.axis, joint.position)
            others.insert(0, joint)
        pose = pose @ after
        if body in path:
            frame += len(loose)
            index, others = (frame if loose or frame < 0 else None), []
        elif parent in based and not loose and below[body]:
            index = -1
        if index == -1:
            based.add(body)
        parts.append(BodyPart(names[body], parent - 1, pose, index, tuple(others), ()))
    return parts, axes


def _seen_from(after: Pose, joint: ModelJoint) -> ModelJoint:
    """Return a joint in the frame that held joints after it leave: unchanged where there are none."""
    if np.array_equal(after.dq, Pose.identity().dq):
        return joint
    turned = after.rotation.T
    return joint._replace(axis=turned @ joint.axis, position=turned @ (joint.position - after.position))


def _wanted(model: Any, body: int, request: PartsRequest) -> Sequence[int]:
    """Return the geoms of a body that count."""
    solid = solid_geoms(model, body)
    return geoms_of(model, body) if request.visuals and not solid else solid


def _report(
    model: Any, source: str, held: Mapping[str, float], parts: list[BodyPart], pieces: list[str], request: PartsRequest
) -> ModelReport:
    roots = {_root(parts, k) for k, piece in enumerate(pieces) if piece}
    beside, unseen, flat = [], [], []
    around = ["the world"] if _wanted(model, 0, request) else []
    for k, (part, piece) in enumerate(zip(parts, pieces, strict=True)):
        geoms = _wanted(model, k + 1, request)
        if not piece and geoms:
            (beside if _root(parts, k) in roots else around).append(part.name)
        elif piece and not geoms and len(geoms_of(model, k + 1)):
            unseen.append(part.name)
        if piece and any(_is_flat(model, geom) for geom in geoms):
            flat.append(part.name)
    swept = [part.name for part, piece in zip(parts, pieces, strict=True) if part.joints and piece]
    lines = []
    if unseen:
        lines.append(f"{NOT_SOLID}, which visuals=True would cover: {listed(unseen, SHOWN)}")
    if flat:
        lines.append(f"planes and height fields on the arm, which its body does not contain: {listed(flat, SHOWN)}")
    unused = [*unused_of_parts(beside, swept), *unused_of_mujoco(model)]
    if around:
        unused.append(
            f"bodies around the robot, which its body does not contain; make them obstacles: {listed(around)}"
        )
    return ModelReport(source, held, tuple(unused), tuple(lines))


def _is_flat(model: Any, geom: int) -> bool:
    # mjGEOM_PLANE and mjGEOM_HFIELD
    return int(model.geom_type[geom]) in (0, 1)


def _root(parts: list[BodyPart], k: int) -> int:
    while parts[k].parent >= 0:
        k = parts[k].parent
    return k


def _geometry_of_body(model: Any, body: int, name: str, source: str, request: PartsRequest) -> tuple[Geometry, ...]:
    try:
        return tuple(_geometry(model, geom) for geom in _wanted(model, body, request) if not _is_flat(model, geom))
    except UnfitShape as error:
        raise BadModel(source, f"body {name!r}", str(error)) from None


def _geometry(model: Any, geom: int) -> Geometry:
    pose = mujoco_pose(model.geom_pos[geom], model.geom_quat[geom])
    kind, (x, y, z) = int(model.geom_type[geom]), (float(size) for size in model.geom_size[geom])
    # mjGEOM_SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH, SDF
    if kind in (7, 8):
        mesh = int(model.geom_dataid[geom])
        first = int(model.mesh_vertadr[mesh])
        points = model.mesh_vert[first : first + int(model.mesh_vertnum[mesh])].astype(np.float64)
        return placed(pose, Geometry([], points))
    if kind == 4:
        return placed(pose, Geometry([], corner_points(Sphere(1.0)) * [x, y, z]))
    if kind == 2:
        return placed(pose, geometry_of(Sphere(x)))
    if kind == 3:
        return placed(pose, geometry_of(Capsule(x, 2.0 * y)))
    if kind == 5:
        return placed(pose, geometry_of(Cylinder(x, 2.0 * y)))
    return placed(pose, geometry_of(Box((2.0 * x, 2.0 * y, 2.0 * z))))
