"""Readers of robot models: capsules that contain an arm's collision geometry, from MuJoCo or URDF.

Not in the paper: the paper moves a point.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import BadModel
from ..geometry.capsule_cover import covering_capsules
from ..geometry.hulls import corner_points
from ..geometry.pose import Pose
from ..geometry.shapes import Box, Capsule, Cylinder, Shape, Sphere
from .arm import Arm
from .body import BODY, Body
from .chain_readers import mujoco_bodies, mujoco_id, mujoco_pose, pinocchio_axis, turn_z_to
from .kinematics import PRISMATIC, REVOLUTE
from .link_capsules import BodyPart, Geometry, Joint, RobotModel, Split, body_of, joined, joint_frames, moved, placed

NOTHING = Geometry([], np.zeros((0, 3)))


def body_from_mujoco(model: Any, arm: Arm, joint_names: Sequence[str], *, split: Split = None) -> Body:
    """Cover the collision geometry of an arm, and of everything attached to the arm, in a compiled model.

    Static bodies between the world and the first joint count as the arm's base, in frame -1, whose coordinates are the
    world's. Bodies beside them, such as a pedestal, are obstacles.

    Args:
        model: `mujoco.MjModel`, read by its named fields; MuJoCo itself is not imported.
        arm: read from the same model.
        joint_names: of the arm in the model.
        split: number of capsules (1 to 3) of every piece, or of some pieces by name; default: as many as pay off.

    Returns:
        Capsules named "link0" (the base) to "link7" for seven joints, "hand" for everything welded to the last link and
        "fingers" for the parts that move on it, over their whole range.

    Raises:
        BadModel: unknown joints, another arm, or geometry that cannot be covered.
        UnknownName: a piece in `split` that the arm lacks.
    """
    source = arm.name
    wanted = [mujoco_id(model, "joint", name, source) for name in joint_names]
    path = mujoco_bodies(model, int(model.jnt_bodyid[wanted[-1]])) if wanted else []
    joints = [range(first, first + count) for first, count in zip(model.body_jntadr, model.body_jntnum, strict=True)]
    if [joint for body in path for joint in joints[body]] != wanted or len(wanted) != arm.dof:
        raise BadModel(source, "joint names", f"are not the {arm.dof} joints from the world to the last one")
    parts, frame = [], -1
    for body in range(1, model.nbody):
        own: int | None = None
        others: tuple[Joint, ...] = ()
        if body in path:
            frame += len(joints[body])
            own = frame if len(joints[body]) or frame < 0 else None
        else:
            others = tuple(_mujoco_joint(model, joint) for joint in joints[body])
        pose = mujoco_pose(model.body_pos[body], model.body_quat[body])
        geometry = joined([NOTHING, *(_mujoco_geometry(model, geom) for geom in _solid(model, body))])
        parts.append(BodyPart(model.body(body).name, int(model.body_parentid[body]) - 1, pose, own, others, geometry))
    chain = [(int(model.jnt_bodyid[joint]) - 1, model.jnt_axis[joint], model.jnt_pos[joint]) for joint in wanted]
    return body_of(RobotModel(source, parts, model.qpos0[model.jnt_qposadr[wanted]], chain), arm, split)


def body_from_urdf(
    path: str | Path, arm: Arm, *, package_dirs: Sequence[str | Path] | None = None, split: Split = None
) -> Body:
    """Cover the collision geometry of an arm, and of everything attached to the arm, in a URDF file.

    Args:
        path: URDF file.
        arm: read from the same file; its base pose is free.
        package_dirs: folders of the packages of `package://`; default: the folders above the file.
        split: see `body_from_mujoco`.

    Returns:
        As `body_from_mujoco`; everything fixed to the root link is "link0".

    Raises:
        BadModel: no such file, missing meshes, no collision geometry, or another arm.
        UnknownName: a piece in `split` that the arm lacks.
    """
    import pinocchio as pin

    source = Path(path)
    if not source.is_file():
        raise BadModel(source, "URDF", "no such file")
    folders = source.resolve().parents if package_dirs is None else package_dirs
    try:
        model = pin.buildModelFromUrdf(str(source))
        geometry = pin.buildGeomFromUrdf(
            model, str(source), pin.COLLISION, package_dirs=[str(folder) for folder in folders]
        )
    except (ValueError, RuntimeError) as error:
        reason = str(error).strip().splitlines()[0]
        raise BadModel(source, "collision geometry", f"cannot be read: {reason} (see package_dirs)") from None
    if not len(geometry.geometryObjects):
        raise BadModel(source, "collision geometry", "the file has none: no link has a <collision> element")
    chain = [model.getJointId(name) for name in arm.joint_names if model.existJointName(name)]
    if len(chain) != arm.dof or [int(model.parents[joint]) for joint in chain] != [0, *chain[:-1]]:
        raise BadModel(source, "joint names", f"have no unbroken chain {', '.join(arm.joint_names)}")
    axis, _, _ = pinocchio_axis(model, chain[0], source)
    joint_from_frame = Pose.from_position_quaternion(np.zeros(3), turn_z_to(axis))
    first = Pose.from_matrix(model.jointPlacements[chain[0]].homogeneous) @ joint_from_frame
    world_from_root = joint_frames(arm, np.zeros(arm.dof))[0] @ first.inverse()
    parts = _pinocchio_parts(model, geometry, chain, world_from_root, source)
    joints = [(joint, *pinocchio_axis(model, joint, source)[:2]) for joint in chain]
    return body_of(RobotModel(str(source), parts, np.zeros(arm.dof), joints), arm, split)


def resting_pairs(arm: Arm, body: Body, distance: float = 0.0) -> list[tuple[int, int]]:
    """Return the pairs (i, j), i < j, of an arm's own capsules that self-collision checks must skip.

    Such capsules are in the same or in neighboring frames, where they always touch, or they are close with every joint
    in the middle of its range (at zero if it has none): there the real links are apart, so only the capsules touch.

    Args:
        arm: the arm.
        body: its capsules.
        distance: largest distance [m] of two capsules that counts as close.
    """
    free = ~(np.isfinite(arm.lower) & np.isfinite(arm.upper))
    middle = np.where(free, 0.0, 0.5 * (np.where(free, 0.0, arm.lower) + np.where(free, 0.0, arm.upper)))
    poses = [Pose.identity(), *joint_frames(arm, middle)]
    placed = [(poses[int(row[BODY.frame]) + 1], row) for row in body.rows]
    ends = [[moved(pose, row[first : first + 3]) for first in (BODY.a, BODY.b)] for pose, row in placed]
    pairs = []
    for i in range(len(body)):
        for j in range(i + 1, len(body)):
            gap = segment_distance(*ends[i], *ends[j]) - body.rows[i, BODY.radius] - body.rows[j, BODY.radius]
            if abs(body.rows[i, BODY.frame] - body.rows[j, BODY.frame]) <= 1 or gap <= distance:
                pairs.append((i, j))
    return pairs


def segment_distance(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> float:
    """Return the distance [m] of two segments.

    Args:
        a: (3,) start of the first segment [m].
        b: (3,) its end.
        c: (3,) start of the second segment [m].
        d: (3,) its end.
    """

    def to_segment(point: np.ndarray, start: np.ndarray, end: np.ndarray) -> float:
        along = end - start
        share = np.clip((point - start) @ along / max(along @ along, 1e-300), 0.0, 1.0)
        return float(np.linalg.norm(start + share * along - point))

    u, v, w = b - a, d - c, a - c
    least = min(to_segment(a, c, d), to_segment(b, c, d), to_segment(c, a, b), to_segment(d, a, b))
    determinant = (u @ u) * (v @ v) - (u @ v) ** 2
    if determinant > 1e-12 * (u @ u) * (v @ v):
        s = ((u @ v) * (v @ w) - (v @ v) * (u @ w)) / determinant
        t = ((u @ u) * (v @ w) - (u @ v) * (u @ w)) / determinant
        if 0.0 < s < 1.0 and 0.0 < t < 1.0:
            least = min(least, float(np.linalg.norm(w + s * u - t * v)))
    return least


def _solid(model: Any, body: int) -> list[int]:
    """Return the geoms of a body that can collide."""
    first, count = int(model.body_geomadr[body]), int(model.body_geomnum[body])
    return [geom for geom in range(first, first + count) if model.geom_contype[geom] or model.geom_conaffinity[geom]]


def _mujoco_joint(model: Any, joint: int) -> Joint:
    # mjJNT_SLIDE and mjJNT_HINGE
    kind = {2: PRISMATIC, 3: REVOLUTE}.get(int(model.jnt_type[joint]), np.nan)
    low, high = model.jnt_range[joint] if model.jnt_limited[joint] else (-np.inf, np.inf)
    rest = float(model.qpos0[model.jnt_qposadr[joint]])
    return Joint(kind, model.jnt_axis[joint], model.jnt_pos[joint], float(low - rest), float(high - rest))


def _mujoco_geometry(model: Any, geom: int) -> Geometry:
    pose = mujoco_pose(model.geom_pos[geom], model.geom_quat[geom])
    kind, (x, y, z) = int(model.geom_type[geom]), (float(size) for size in model.geom_size[geom])
    # mjGEOM_SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH, SDF; planes and height fields are never links
    if kind in (7, 8):
        mesh = int(model.geom_dataid[geom])
        first = int(model.mesh_vertadr[mesh])
        points = model.mesh_vert[first : first + int(model.mesh_vertnum[mesh])].astype(np.float64)
        return placed(pose, Geometry([], points))
    if kind == 4:
        return placed(pose, Geometry([], corner_points(Sphere(1.0)) * [x, y, z]))
    if kind == 2:
        return placed(pose, _geometry_of(Sphere(x)))
    if kind == 3:
        return placed(pose, _geometry_of(Capsule(x, 2.0 * y)))
    if kind == 5:
        return placed(pose, _geometry_of(Cylinder(x, 2.0 * y)))
    return placed(pose, _geometry_of(Box((2.0 * x, 2.0 * y, 2.0 * z)))) if kind == 6 else NOTHING


def _geometry_of(shape: Shape) -> Geometry:
    if isinstance(shape, Sphere | Capsule):
        return Geometry(covering_capsules(shape), np.zeros((0, 3)))
    return Geometry([], corner_points(shape))


def _pinocchio_parts(
    model: Any, geometry: Any, chain: list[int], world_from_root: Pose, source: Path
) -> list[BodyPart]:
    """Return one part per joint (number 0: the root) with the link the joint moves, then one per link welded on."""
    joined_links: dict[tuple[int, int], list[Geometry]] = {}
    for item in geometry.geometryObjects:
        pose = Pose.from_matrix(item.placement.homogeneous)
        key = (int(item.parentJoint), int(item.parentFrame))
        joined_links.setdefault(key, []).append(placed(pose, _pinocchio_geometry(item, source)))
    links = {key: joined(geometries) for key, geometries in joined_links.items()}
    parts = []
    for joint in range(model.njoints):
        own = links.pop(min((key for key in links if key[0] == joint), default=(-1, -1)), NOTHING)
        if joint == 0:
            own = joined([own, *(links.pop(key) for key in [key for key in links if key[0] == 0])])
            parts.append(BodyPart("root", -1, world_from_root, -1, (), own))
            continue
        pose = Pose.from_matrix(model.jointPlacements[joint].homogeneous)
        frame = chain.index(joint) if joint in chain else None
        others = () if joint in chain else (_pinocchio_joint(model, joint, source),)
        parts.append(BodyPart(model.names[joint], int(model.parents[joint]), pose, frame, others, own))
    welded = [
        BodyPart(model.frames[link].name, joint, Pose.identity(), None, (), own) for (joint, link), own in links.items()
    ]
    return parts + welded


def _pinocchio_joint(model: Any, joint: int, source: Path) -> Joint:
    axis, position, kind = pinocchio_axis(model, joint, source)
    low, high = -np.inf, np.inf
    if model.joints[joint].nq == 1:
        index = model.joints[joint].idx_q
        low, high = float(model.lowerPositionLimit[index]), float(model.upperPositionLimit[index])
    return Joint(kind, axis, position, low, high)


def _pinocchio_geometry(item: Any, source: Path) -> Geometry:
    """Return the geometry of a collision element in its own frame; hpp-fcl and coal use the same class names."""
    form, name = item.geometry, type(item.geometry).__name__
    if name == "Sphere":
        return _geometry_of(Sphere(form.radius))
    if name == "Capsule":
        return _geometry_of(Capsule(form.radius, 2.0 * form.halfLength))
    if name == "Cylinder":
        return _geometry_of(Cylinder(form.radius, 2.0 * form.halfLength))
    if name == "Box":
        x, y, z = (2.0 * float(half) for half in form.halfSide)
        return _geometry_of(Box((x, y, z)))
    if hasattr(form, "vertices"):
        return Geometry([], np.array(form.vertices(), dtype=np.float64).reshape(-1, 3))
    raise BadModel(source, item.name, f"is a {name}; known are boxes, balls, capsules, cylinders and meshes")
