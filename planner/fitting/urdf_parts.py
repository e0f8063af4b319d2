"""The parts of a robot in a URDF file, for its body.

Not in the paper: the paper moves a point.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import BadModel, UnfitShape
from ..geometry.pose import Pose
from ..geometry.shapes import Box, Capsule, Cylinder, Sphere
from ..models.model_joints import check_independent, swept_range
from ..models.model_report import ONLY_SEEN, SHOWN, ModelReport, listed
from ..models.urdf_model import UrdfModel, read_urdf
from ..robot.arm import Arm
from ..robot.chain_readers import turn_z_to
from ..robot.joint_frames import joint_frames
from .robot_model import BodyPart, Geometry, RobotModel, placed, places_of
from .robot_parts import (
    PartsRequest,
    ReadRobot,
    geometry_of,
    held_with_arm,
    unused_of_parts,
)


def parts_from_urdf(
    path: str | Path, arm: Arm, package_dirs: Sequence[str | Path] | None, request: PartsRequest
) -> ReadRobot:
    """Read the parts of an arm, and of everything attached to it, from a URDF file.

    Args:
        path: URDF file.
        arm: read from the same file.
        package_dirs: folders of the packages of `package://`; default: the folders above the file.
        request: joints to hold, and whether visual geometry counts.

    Raises:
        BadModel: no such file, missing meshes, geometry that is unknown, no collision geometry, or another arm.
    """
    model = read_urdf(path)
    source, joints = str(model.source), model.joints
    held = held_with_arm(joints, model.file.couplings, arm, request, source)
    chain = _chain(model, arm, held)
    check_independent(arm.joint_names, model.file.couplings, held, source)
    first = model.placement(chain[0]) @ Pose.from_position_quaternion(
        np.zeros(3), turn_z_to(joints[arm.joint_names[0]].axis)
    )
    for joint in reversed(model.path(chain[0])[:-1]):  # held ones
        name = model.pinocchio.names[joint]
        first = model.placement(joint) @ joints[name].motion(held[name]) @ first
    world_from_root = joint_frames(arm, np.zeros(arm.dof))[0] @ first.inverse()
    skeleton, links = _skeleton(model, chain, held, world_from_root, request)
    pieces = [place.piece for place in places_of(skeleton, arm.dof)]
    covered = {name for names, piece in zip(links, pieces, strict=True) if piece for name in names}
    geometry = _geometry_of_links(model, package_dirs, covered, request)
    parts = [
        part._replace(geometry=tuple(each for name in names for each in geometry.get(name, ())))
        for part, names in zip(skeleton, links, strict=True)
    ]
    axes = [(chain[k], joints[name].axis, np.zeros(3)) for k, name in enumerate(arm.joint_names)]
    robot = RobotModel(source, parts, np.zeros(arm.dof), axes)
    swept = [part.name for part, piece in zip(skeleton, pieces, strict=True) if part.joints and piece]
    solid = tuple(tuple(name for name in names if name in geometry) for names in links)
    return ReadRobot(robot, solid, _report(model, held, covered, swept, request))


def _chain(model: UrdfModel, arm: Arm, held: Mapping[str, float]) -> list[int]:
    """Return the indices of the arm's joints, which must follow each other, with only held ones before and between."""
    known = model.pinocchio
    chain = [known.getJointId(name) for name in arm.joint_names if known.existJointName(name)]
    path = model.path(chain[-1]) if chain else []
    if len(chain) != arm.dof or [joint for joint in path if known.names[joint] not in held] != chain:
        raise BadModel(model.source, "joint names", f"have no unbroken chain {', '.join(arm.joint_names)}")
    return chain


def _skeleton(
    model: UrdfModel, chain: list[int], held: Mapping[str, float], world_from_root: Pose, request: PartsRequest
) -> tuple[list[BodyPart], list[tuple[str, ...]]]:
    """Return parts without geometry, and the links of each: one part per joint (0: the root), one per link welded on.

    A joint's part has the first link with geometry that moves with it. What is fixed to the root, by held joints too,
    moves with the base; links on a held joint are parts of their own.
    """
    names, joints = model.pinocchio.names, model.joints
    based, of_joint = {0}, {0: [name for name, joint in model.links() if joint == 0]}
    for name, joint in model.links():
        link = model.file.links[name]
        if joint not in of_joint and (link.collisions or (request.visuals and link.visuals)):
            of_joint[joint] = [name]
    welded = [(name, joint) for name, joint in model.links() if name not in of_joint.get(joint, ())]
    parts = [BodyPart("root", -1, world_from_root, -1, (), ())]
    for joint in range(1, len(names)):
        name, parent = names[joint], int(model.pinocchio.parents[joint])
        pose, frame, others = model.placement(joint), None, ()
        if name in held:
            pose = pose @ joints[name].motion(held[name])
            if parent in based:
                based.add(joint)
                frame = -1
        elif joint in chain:
            frame = chain.index(joint)
        else:
            others = (swept_range(joints[name], model.file.couplings, joints),)
        parts.append(BodyPart(name, parent, pose, frame, others, ()))
    for name, joint in welded:
        frame = -1 if joint in based else None
        parts.append(BodyPart(name, joint, Pose.identity(), frame, (), ()))
    of_parts = [tuple(of_joint.get(joint, ())) for joint in range(len(names))]
    return parts, [*of_parts, *((name,) for name, _ in welded)]


def _geometry_of_links(
    model: UrdfModel, package_dirs: Sequence[str | Path] | None, covered: set[str], request: PartsRequest
) -> dict[str, list[Geometry]]:
    """Return the geometry of the links that are to be covered, in the frame of the joint that they move with."""
    for name in covered:
        link = model.file.links[name]
        wanted = link.fault if link.collisions else link.visual_fault if request.visuals else ""
        if wanted:
            raise BadModel(model.source, f"link {name!r}", wanted)
    unseen = _unseen(model, covered)
    elements = [(item, False) for item in model.geometry(package_dirs)]
    if request.visuals and unseen:
        elements += [(item, True) for item in model.geometry(package_dirs, visual=True)]
    found: dict[str, list[Geometry]] = {}
    for item, visual in elements:
        name = model.pinocchio.frames[item.parentFrame].name
        if name in covered and visual == (name in unseen):
            pose = Pose.from_matrix(item.placement.homogeneous)
            found.setdefault(name, []).append(placed(pose, _geometry(item, name, model.source)))
    for name in covered:
        link = model.file.links[name]
        wanted = link.visuals if name in unseen and request.visuals else link.collisions
        if len(found.get(name, ())) != wanted:
            readable = f"{len(found.get(name, ()))} of its {wanted} elements of geometry can be read"
            reason = f"only {readable}; is its <inertial>, or a <visual> of it, broken?"
            raise BadModel(model.source, f"link {name!r}", reason)
    if not found:
        hint = "; visuals=True covers what is to be seen" if unseen else ""
        raise BadModel(model.source, "collision geometry", f"no link has a <collision> element{hint}")
    return found


def _unseen(model: UrdfModel, covered: set[str]) -> list[str]:
    """Return the links to be covered that have visual geometry only."""
    links = model.file.links.values()
    return [link.name for link in links if link.name in covered and link.visuals and not link.collisions]


def _report(
    model: UrdfModel, held: Mapping[str, float], covered: set[str], swept: list[str], request: PartsRequest
) -> ModelReport:
    links = model.file.links
    beside = [name for name, link in links.items() if name not in covered and (link.collisions or link.visuals)]
    unseen = [] if request.visuals else _unseen(model, covered)
    line = f"{ONLY_SEEN}, which visuals=True would cover: {listed(unseen, SHOWN)}"
    unused = (*unused_of_parts(beside, swept), *model.file.unused)
    return ModelReport(str(model.source), held, unused, (line,) if unseen else ())


def _geometry(item: Any, link: str, source: Path) -> Geometry:
    """Return the geometry of a link's element in its own frame."""
    try:
        return _geometry_of_form(item.geometry)
    except UnfitShape as error:
        raise BadModel(source, f"link {link!r}", str(error)) from None


def _geometry_of_form(form: Any) -> Geometry:
    """Return the geometry of an object of hpp-fcl or coal, which use the same class names."""
    name = type(form).__name__
    if name == "Sphere":
        return geometry_of(Sphere(form.radius))
    if name == "Capsule":
        return geometry_of(Capsule(form.radius, 2.0 * form.halfLength))
    if name == "Cylinder":
        return geometry_of(Cylinder(form.radius, 2.0 * form.halfLength))
    if name == "Box":
        x, y, z = (2.0 * float(half) for half in form.halfSide)
        return geometry_of(Box((x, y, z)))
    if hasattr(form, "vertices"):
        vertices = np.array(form.vertices(), dtype=np.float64).reshape(-1, 3)
        corners = [[form.tri_indices(k)[i] for i in range(3)] for k in range(form.num_tris)]
        return Geometry([], vertices, vertices[np.array(corners, dtype=int)])
    if name == "Convex":
        return Geometry([], np.array([form.point(k) for k in range(form.num_points)], dtype=np.float64))
    raise UnfitShape(name, "kind", "known are boxes, balls, capsules, cylinders and meshes")
