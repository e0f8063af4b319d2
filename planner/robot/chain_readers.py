"""Readers of robot models: the serial chain from the world to a tool frame, from MuJoCo or URDF."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..errors import BadModel
from ..geometry.pose import Pose
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
    """

    joint_names: tuple[str, ...]
    chain: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray


class _ChainBuilder:
    """Collects fixed displacements and joints into the rows of a chain."""

    def __init__(self):
        self._rows: list[np.ndarray] = []
        self._pending = Pose.identity()

    def move(self, displacement: Pose) -> None:
        self._pending = self._pending @ displacement

    def add_joint(self, axis: ArrayLike, position: ArrayLike, kind: float, rest: float) -> None:
        """Append a joint along `axis` through `position`; at q = rest its displacement is zero."""
        turn = turn_z_to(np.asarray(axis, dtype=np.float64))
        body_from_joint = Pose.from_position_quaternion(position, turn)
        back = Pose.from_yaw([0, 0, 0], -rest)
        if kind == PRISMATIC:
            back = Pose.from_position_quaternion([0, 0, -rest])
        self._rows.append(self._row(self._pending @ body_from_joint, kind))
        self._pending = back @ body_from_joint.inverse()

    def chain(self) -> np.ndarray:
        return np.array([*self._rows, self._row(self._pending, REVOLUTE)])

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


def chain_from_mujoco(model: Any, joint_names: Sequence[str], site: str, source: str) -> ChainData:
    """Read the chain from the world to a site of a compiled model.

    Args:
        model: `mujoco.MjModel`, read by its named fields.
        joint_names: all moving joints between the world and the site, from the base on.
        site: name of the tool frame.
        source: name of the model for messages.

    Raises:
        BadModel: the joints are not exactly the moving joints between the world and the site, or the site is unknown.
    """
    site_id = mujoco_id(model, "site", site, source)
    wanted = [mujoco_id(model, "joint", joint, source) for joint in joint_names]
    builder, found = _ChainBuilder(), []
    for body in mujoco_bodies(model, int(model.site_bodyid[site_id])):
        builder.move(mujoco_pose(model.body_pos[body], model.body_quat[body]))
        first = int(model.body_jntadr[body])
        for joint in range(first, first + int(model.body_jntnum[body])):
            # mjJNT_SLIDE and mjJNT_HINGE
            kind = {2: PRISMATIC, 3: REVOLUTE}.get(int(model.jnt_type[joint]))
            if kind is None:
                raise BadModel(source, model.joint(joint).name, "is neither a hinge nor a slide")
            rest = float(model.qpos0[model.jnt_qposadr[joint]])
            builder.add_joint(model.jnt_axis[joint], model.jnt_pos[joint], kind, rest)
            found.append(joint)
    if found != wanted:
        known = ", ".join(model.joint(joint).name for joint in found)
        raise BadModel(source, "joint names", f"the joints from the world to {site!r} are: {known}")
    builder.move(mujoco_pose(model.site_pos[site_id], model.site_quat[site_id]))
    limited = model.jnt_limited[wanted].astype(bool)
    lower, upper = model.jnt_range[wanted].T
    return ChainData(
        tuple(joint_names),
        builder.chain(),
        np.where(limited, lower, -np.inf),
        np.where(limited, upper, np.inf),
        np.full(len(wanted), np.nan),
    )


def chain_from_urdf(path: str | Path, tcp_frame: str, world_from_base: Pose | None = None) -> ChainData:
    """Read the chain from the root link to a frame of a URDF file, with Pinocchio.

    Args:
        path: URDF file.
        tcp_frame: name of the tool frame.
        world_from_base: pose of the root link; default: the identity.

    Raises:
        BadModel: no such file or frame, or a joint that is neither revolute nor prismatic.
    """
    import pinocchio as pin

    source = Path(path)
    if not source.is_file():
        raise BadModel(source, "URDF", "no such file")
    try:
        model = pin.buildModelFromUrdf(str(source))
    except (ValueError, RuntimeError) as error:
        raise BadModel(source, "URDF", f"cannot be read: {str(error).splitlines()[0]}") from None
    if not model.existFrame(tcp_frame):
        frames = ", ".join(frame.name for frame in model.frames[1:])
        raise BadModel(source, f"frame {tcp_frame!r}", f"not in the model; frames: {frames}")
    frame = model.frames[model.getFrameId(tcp_frame)]
    joints = _pinocchio_joints(model, frame)
    for name, placement in [
        *((model.names[joint], model.jointPlacements[joint]) for joint in joints),
        (tcp_frame, frame.placement),
    ]:
        _check_placement(source, name, placement.homogeneous)
    builder = _ChainBuilder()
    builder.move(world_from_base or Pose.identity())
    for joint in joints:
        builder.move(Pose.from_matrix(model.jointPlacements[joint].homogeneous))
        builder.add_joint(*pinocchio_axis(model, joint, source), 0.0)
    builder.move(Pose.from_matrix(frame.placement.homogeneous))
    index_q = [model.joints[joint].idx_q for joint in joints]
    index_v = [model.joints[joint].idx_v for joint in joints]
    circular = np.array([model.joints[joint].nq == 2 for joint in joints], dtype=bool)
    return ChainData(
        tuple(model.names[joint] for joint in joints),
        builder.chain(),
        np.where(circular, -np.inf, model.lowerPositionLimit[index_q]),
        np.where(circular, np.inf, model.upperPositionLimit[index_q]),
        model.velocityLimit[index_v],
    )


def _check_placement(source: Path, name: str, matrix: np.ndarray) -> None:
    """Refuse numbers the loader accepts: not finite, farther than 100 m, not a rotation."""
    if not (np.isfinite(matrix).all() and np.abs(matrix[:3, 3]).max() <= FARTHEST):
        raise BadModel(source, name, f"its origin is not finite or farther than {FARTHEST:g} m")
    if np.abs(matrix[:3, :3] @ matrix[:3, :3].T - np.eye(3)).max() > 1e-6:
        raise BadModel(source, name, "its orientation is not a rotation")


def mujoco_pose(position: np.ndarray, wxyz: np.ndarray) -> Pose:
    """Return the pose of a position and a quaternion of a MuJoCo model.

    Args:
        position: (3,) [m].
        wxyz: (4,) quaternion, normalized here.
    """
    return Pose.from_position_quaternion(position, wxyz / np.linalg.norm(wxyz))


def mujoco_id(model: Any, kind: str, name: str, source: str) -> int:
    """Return the index of a named element of a compiled model.

    Args:
        model: `mujoco.MjModel`.
        kind: "joint", "site" …
        name: of the element.
        source: name of the model for messages.

    Raises:
        BadModel: the model lacks the element.
    """
    try:
        return int(getattr(model, kind)(name).id)
    except KeyError:
        raise BadModel(source, f"{kind} {name!r}", "not in the model") from None


def mujoco_bodies(model: Any, body: int) -> list[int]:
    """Return the bodies from the world (excluded) to a body (included).

    Args:
        model: `mujoco.MjModel`.
        body: index of the last body.
    """
    path = []
    while body != 0:
        path.append(body)
        body = int(model.body_parentid[body])
    return path[::-1]


def _pinocchio_joints(model: Any, frame: Any) -> list[int]:
    # `parent` was renamed in Pinocchio 3
    joint = int(frame.parentJoint if hasattr(frame, "parentJoint") else frame.parent)
    path = []
    while joint != 0:
        path.append(joint)
        joint = int(model.parents[joint])
    return path[::-1]


def pinocchio_axis(model: Any, joint: int, source: Path) -> tuple[np.ndarray, np.ndarray, float]:
    """Read a joint's axis from its own column of the Jacobian in its own frame.

    Args:
        model: `pinocchio.Model`.
        joint: index of the joint.
        source: the file, for messages.

    Returns:
        Axis (3,), position (3,) [m] and kind (REVOLUTE or PRISMATIC).

    Raises:
        BadModel: the joint is neither revolute nor prismatic.
    """
    import pinocchio as pin

    if model.joints[joint].nv != 1:
        raise BadModel(source, f"joint {model.names[joint]!r}", "neither turns nor slides")
    jacobian = pin.computeJointJacobian(model, model.createData(), pin.neutral(model), joint)
    # for a model of one joint Pinocchio returns a vector
    column = jacobian.reshape(6, -1)[:, model.joints[joint].idx_v]
    if not abs(np.linalg.norm(column) - 1.0) < 1e-6:
        raise BadModel(source, f"joint {model.names[joint]!r}", "its axis is not a direction")
    if np.linalg.norm(column[3:]) > 0.5:
        return column[3:], np.zeros(3), REVOLUTE
    return column[:3], np.zeros(3), PRISMATIC
