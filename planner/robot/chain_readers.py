"""Readers of robot models: the serial chain from the world to a tool frame, from MuJoCo or URDF."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import BadModel
from ..geometry.pose import Pose
from ..models.doubtful_limits import check_limits, doubtful_limits
from ..models.model_joints import OTHER, SLIDES, ModelJoint, check_independent, held_positions
from ..models.model_report import NOT_SOLID, ONLY_SEEN, SHOWN, ModelReport, listed
from ..models.mujoco_model import (
    geoms_of,
    mujoco_bodies,
    mujoco_body_names,
    mujoco_couplings,
    mujoco_id,
    mujoco_joint_id,
    mujoco_joint_names,
    mujoco_joints,
    mujoco_loops,
    mujoco_pose,
    solid_geoms,
    unused_of_mujoco,
)
from ..models.urdf_model import UrdfModel, read_urdf
from .kinematics import PRISMATIC, REVOLUTE

FARTHEST = 100.0
"""Largest plausible length of a link [m]."""


class ChainData(NamedTuple):
    """The serial chain of a robot model.

    Attributes:
        joint_names: (dof,).
        chain: (dof + 1, 8), see `kinematics`.
        lower: (dof,) [rad or m], -inf for a continuous joint.
        upper: (dof,) [rad or m].
        velocity: (dof,) [rad/s or m/s], NaN where the model lacks a limit.
        report: findings of the reader.
    """

    joint_names: tuple[str, ...]
    chain: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray
    report: ModelReport


class ChainRequest(NamedTuple):
    """Request for a chain of a model.

    Attributes:
        locked: position of each joint to hold [rad or m], by name or shell pattern.
        base_link: link, or body, before which all joints are held; None: the root.
        source: name of the model for messages.
    """

    locked: Mapping[str, float]
    base_link: str | None
    source: str


class _ChainBuilder:
    """Collects fixed displacements and joints into the rows of a chain."""

    def __init__(self):
        self._rows: list[np.ndarray] = []
        self._pending = Pose.identity()
        self.joints: list[ModelJoint] = []

    def move(self, displacement: Pose) -> None:
        self._pending = self._pending @ displacement

    def add_joint(self, joint: ModelJoint, source: str) -> None:
        """Append a joint; at rest its displacement is zero."""
        if joint.kind == OTHER:
            raise BadModel(
                source, f"joint {joint.name!r}", "is neither a hinge nor a slide; base_link or locked holds it"
            )
        if not np.isfinite(joint.axis).all():
            raise BadModel(source, f"joint {joint.name!r}", "its axis is not a direction")
        kind = PRISMATIC if joint.kind == SLIDES else REVOLUTE
        body_from_joint = Pose.from_position_quaternion(joint.position, turn_z_to(joint.axis))
        back = Pose.from_yaw([0, 0, 0], -joint.rest)
        if kind == PRISMATIC:
            back = Pose.from_position_quaternion([0, 0, -joint.rest])
        self._rows.append(self._row(self._pending @ body_from_joint, kind))
        self._pending = back @ body_from_joint.inverse()
        self.joints.append(joint)

    def data(self, velocity: np.ndarray, report: ModelReport) -> ChainData:
        check_limits(self.joints, report.source)
        rows = np.array([*self._rows, self._row(self._pending, REVOLUTE)])
        names = tuple(joint.name for joint in self.joints)
        low, high = (np.array([getattr(joint, end) for joint in self.joints]) for end in ("low", "high"))
        return ChainData(names, rows, low, high, velocity, report)

    @staticmethod
    def _row(pose: Pose, kind: float) -> np.ndarray:
        return np.concatenate([pose.quaternion, pose.position, [kind]])


def turn_z_to(axis: np.ndarray) -> np.ndarray:
    """Return the quaternion (4,) wxyz of the smallest rotation from z to a direction (3,)."""
    axis = axis / np.linalg.norm(axis)
    if axis[2] < -1.0 + 1e-12:
        return np.array([0.0, 1.0, 0.0, 0.0])
    r = np.array([1.0 + axis[2], -axis[1], axis[0], 0.0])
    return r / np.linalg.norm(r)


def chain_from_mujoco(
    model: Any, joint_names: Sequence[str] | None, tool: tuple[str, str], request: ChainRequest
) -> ChainData:
    """Read the chain from the world to a site or a body of a compiled model.

    Args:
        model: `mujoco.MjModel`, read by its named fields.
        joint_names: the joints between the world and the tool that are not held, from the base on; None: all of them.
        tool: kind, "site" or "body", and name of the tool frame.
        request: joints to hold.

    Raises:
        BadModel: the joints are not exactly the moving joints between the world and the tool, one of them follows
            another one, or a name is unknown.
    """
    source = request.source
    tool_id = mujoco_id(model, *tool, source)
    last = tool_id if tool[0] == "body" else int(model.site_bodyid[tool_id])
    path, joints, names = mujoco_bodies(model, last), mujoco_joints(model), mujoco_joint_names(model)
    for name in joint_names or ():
        mujoco_joint_id(names, name, source)
    before: list[str] = []
    if request.base_link is not None:
        base = mujoco_id(model, "body", request.base_link, source)
        _check_base(base == 0 or base in path, request, tool[1])
        before = [names[joint] for body in mujoco_bodies(model, base) for joint in _joints_of(model, body)]
    couplings = mujoco_couplings(model)
    held = held_positions(joints, couplings, request.locked, before, joint_names or (), source)
    check_independent([names[j] for body in path for j in _joints_of(model, body)], couplings, held, source)
    builder = _ChainBuilder()
    for body in path:
        builder.move(mujoco_pose(model.body_pos[body], model.body_quat[body]))
        for name in (names[joint] for joint in _joints_of(model, body)):
            if name in held:
                builder.move(joints[name].motion(held[name]))
            else:
                builder.add_joint(joints[name], source)
    found = [joint.name for joint in builder.joints]
    if joint_names is not None and found != list(joint_names):
        hint = "; base_link or locked holds those that are not the arm's" if set(joint_names) < set(found) else ""
        raise BadModel(source, "joint names", f"the joints from the world to {tool[1]!r} are: {', '.join(found)}{hint}")
    if tool[0] == "site":
        builder.move(mujoco_pose(model.site_pos[tool_id], model.site_quat[tool_id]))
    _check_loops(model, found, held, source)
    unused = [*_unsolid(model), *unused_of_mujoco(model)]
    speeds = np.full(len(found), np.nan)
    warnings = (*_ranges_without_force(model, found), *doubtful_limits(builder.joints, speeds))
    report = ModelReport(source, held, tuple(unused), warnings)
    return builder.data(speeds, report)


def chain_from_urdf(
    path: str | Path, tcp_frame: str, request: ChainRequest, world_from_base: Pose | None = None
) -> ChainData:
    """Read the chain from the root link to a frame of a URDF file, with Pinocchio.

    Args:
        path: URDF file.
        tcp_frame: name of the tool frame: a link, or else a joint.
        request: joints to hold.
        world_from_base: pose of the root link; default: the identity.

    Raises:
        BadModel: the file cannot be read, no such frame, or a joint of the arm that neither turns nor slides or that
            follows another one.
    """
    model = read_urdf(path)
    last, placement = model.frame(tcp_frame)
    path_joints, joints = model.path(last), model.joints
    before: list[str] = []
    if request.base_link is not None:
        if request.base_link not in model.file.links:
            raise BadModel(model.source, f"base_link {request.base_link!r}", "is no link of the model")
        base, _ = model.frame(request.base_link)
        _check_base(base == 0 or base in path_joints, request, tcp_frame)
        before = [model.pinocchio.names[joint] for joint in model.path(base)]
    couplings = model.file.couplings
    held = held_positions(joints, couplings, request.locked, before, (), str(model.source))
    names = [model.pinocchio.names[joint] for joint in path_joints]
    check_independent(names, couplings, held, str(model.source))
    builder = _ChainBuilder()
    builder.move(world_from_base or Pose.identity())
    for joint, name in zip(path_joints, names, strict=True):
        _check_placement(model, name, model.pinocchio.jointPlacements[joint].homogeneous)
        builder.move(model.placement(joint))
        if name in held:
            builder.move(joints[name].motion(held[name]))
        else:
            builder.add_joint(joints[name], str(model.source))
    _check_placement(model, tcp_frame, placement.homogeneous)
    builder.move(Pose.from_matrix(placement.homogeneous))
    moving = [joint for joint, name in zip(path_joints, names, strict=True) if name not in held]
    speeds = model.pinocchio.velocityLimit[[model.pinocchio.joints[joint].idx_v for joint in moving]]
    unseen = [link.name for link in model.file.links.values() if link.visuals and not link.collisions]
    unused = [f"{ONLY_SEEN}: {listed(unseen)}"] if unseen else []
    warnings = tuple(doubtful_limits(builder.joints, speeds))
    return builder.data(speeds, ModelReport(str(model.source), held, (*unused, *model.file.unused), warnings))


def _check_base(before_tool: bool, request: ChainRequest, tool: str) -> None:
    if not before_tool:
        raise BadModel(request.source, f"base_link {request.base_link!r}", f"is not between the root and {tool!r}")


def _check_placement(model: UrdfModel, name: str, matrix: np.ndarray) -> None:
    """Refuse numbers the loader accepts: not finite, farther than 100 m, not a rotation."""
    if not (np.isfinite(matrix).all() and np.abs(matrix[:3, 3]).max() <= FARTHEST):
        raise BadModel(model.source, name, f"its origin is not finite or farther than {FARTHEST:g} m")
    if np.abs(matrix[:3, :3] @ matrix[:3, :3].T - np.eye(3)).max() > 1e-6:
        raise BadModel(model.source, name, "its orientation is not a rotation")


def _joints_of(model: Any, body: int) -> range:
    first = int(model.body_jntadr[body])
    return range(first, first + int(model.body_jntnum[body]))


def _check_loops(model: Any, chain: Iterable[str], held: Mapping[str, float], source: str) -> None:
    """Refuse a constraint that ties two links of the arm together without a joint that gives way."""
    names, arm = mujoco_joint_names(model), set(chain)
    for loop in mujoco_loops(model):
        sides = [{names[j] for b in mujoco_bodies(model, body) for j in _joints_of(model, b)} for body in loop.bodies]
        between = sides[0] ^ sides[1]
        if not loop.mocap and between & arm and not between - arm - held.keys():
            raise BadModel(
                source, loop.name, f"makes joints of the arm follow each other: {listed(sorted(between & arm), SHOWN)}"
            )


def _ranges_without_force(model: Any, chain: Iterable[str]) -> list[str]:
    """Return a line on joints of the arm whose range is given and not in force."""
    every = enumerate(mujoco_joint_names(model))
    joints = [name for k, name in every if name in set(chain) and not model.jnt_limited[k] and model.jnt_range[k].any()]
    return [f"ranges that limited=false puts out of force: {listed(joints, SHOWN)}"] if joints else []


def _unsolid(model: Any) -> list[str]:
    """Return a line on the bodies of which no geom collides, though they have some."""
    names = [
        name for k, name in enumerate(mujoco_body_names(model)) if len(geoms_of(model, k)) and not solid_geoms(model, k)
    ]
    return [f"{NOT_SOLID}: {listed(names)}"] if names else []
