"""Serial arms: compiled forward kinematics, body Jacobian and limits; read from MuJoCo models or URDF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import FrozenArrays, checked_array, checked_items, checked_kind, frozen, is_fit, numbers
from ..errors import BadModel, BadShape
from ..geometry.pose import Pose
from ..models.model_report import ModelReport
from .chain_readers import ChainData, ChainRequest, chain_from_mujoco, chain_from_urdf
from .kinematics import CHAIN, FRAME, forward_into, forward_jacobian_into

MAX_DOF = 16


@dataclass(frozen=True, slots=True, eq=False)
class Arm(FrozenArrays):
    """A serial chain from the world to a tool frame.

    Attributes:
        name: for messages.
        joint_names: (dof,) in order from the base.
        chain: (dof + 1, 8), see the module `kinematics`.
        lower: (dof,) lower joint limits [rad or m]; -inf for a continuous joint.
        upper: (dof,) upper joint limits [rad or m].
        velocity_limits: (dof,) largest joint speeds [rad/s or m/s].
        report: findings of the reader of its model: which joints are held, and what was not used.

    Raises:
        BadModel: no joints, too many, limits out of order, or numbers that are not finite.
        BadShape: an array that does not match the number of joints.
    """

    name: str
    joint_names: tuple[str, ...]
    chain: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    velocity_limits: np.ndarray
    report: ModelReport = field(default_factory=ModelReport)

    def __post_init__(self):
        object.__setattr__(self, "joint_names", checked_items(f"{self.name}: joint_names", self.joint_names, str))
        dof = len(self.joint_names)
        if not 1 <= dof <= MAX_DOF:
            raise BadModel(self.name, "joints", f"has {dof}; allowed are 1 to {MAX_DOF}")
        shapes = {"chain": (dof + 1, CHAIN.width), "lower": (dof,), "upper": (dof,), "velocity_limits": (dof,)}
        for key, shape in shapes.items():
            value = frozen(numbers(f"{self.name}: {key}", getattr(self, key)))
            if value.shape != shape:
                raise BadShape(f"{self.name}: {key}", value.shape, str(shape))
            object.__setattr__(self, key, value)
        if not np.isfinite(self.chain).all() or np.abs(self.chain).max() > 100.0:
            raise BadModel(self.name, "chain", "holds a number that is not finite or above 100 m")
        for name, low, high, speed in zip(self.joint_names, self.lower, self.upper, self.velocity_limits, strict=True):
            if not low < high:
                raise BadModel(self.name, name, f"lower limit {low:g} is not below upper limit {high:g}")
            if not 0 < speed < np.inf:
                reason = f"velocity limit {speed:g} is not a positive number; velocity_limits takes others"
                raise BadModel(self.name, name, reason)

    @property
    def dof(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    @property
    def limits(self) -> np.ndarray:
        """Lower and upper limits and largest speeds (3, dof), in the form the kernels take."""
        return np.stack([self.lower, self.upper, self.velocity_limits])

    def fk(self, q: ArrayLike) -> Pose:
        """Return the pose of the tcp in the world at joint positions q (dof,) [rad or m]."""
        out = np.empty(8)
        forward_into(self.chain, self.checked(q), np.empty((self.dof, FRAME.width)), out)
        return Pose(out)

    def jacobian(self, q: ArrayLike) -> np.ndarray:
        """Return the Jacobian (6, dof) of the tcp's body twist, rows (v, omega); Pinocchio's LOCAL frame."""
        return self.fk_jacobian(q)[1]

    def fk_jacobian(self, q: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Return the dual quaternion (8,) of the tcp and the body Jacobian (6, dof) in one pass."""
        x, jacobian = np.empty(8), np.empty((6, self.dof))
        forward_jacobian_into(self.chain, self.checked(q), np.empty((self.dof, FRAME.width)), jacobian, x)
        return x, jacobian

    def with_tool(self, tcp_from_tool: Pose) -> Arm:
        """Return the arm with another frame of the hand as its tcp."""
        checked_kind("tcp_from_tool", tcp_from_tool, Pose)
        row = self.chain[-1]
        tcp = Pose.from_position_quaternion(row[CHAIN.offset : CHAIN.kind], row[CHAIN.rotation : CHAIN.offset])
        tool = tcp @ tcp_from_tool
        chain = np.vstack([self.chain[:-1], [*tool.quaternion, *tool.position, row[CHAIN.kind]]])
        return replace(self, chain=chain)

    def margin(self, q: ArrayLike) -> float:
        """Return the smallest distance [rad or m] of q (dof,) to a joint limit; negative outside."""
        q = self.checked(q)
        return float(np.minimum(q - self.lower, self.upper - q).min())

    def checked(self, q: ArrayLike) -> np.ndarray:
        """Return joint positions (dof,) as the kernels take them.

        Raises:
            WrongType, BadShape, NotFinite: no numbers, another shape, or a number that is not finite.
        """
        shape = self.lower.shape
        return q if is_fit(q, shape) else checked_array(f"{self.name}: q", q, shape)

    @staticmethod
    def from_mujoco(
        model: Any,
        joint_names: Sequence[str] | None = None,
        *,
        site: str | None = None,
        body: str | None = None,
        velocity_limits: ArrayLike,
        locked: Mapping[str, float] | None = None,
        base_link: str | None = None,
        name: str = "mujoco arm",
    ) -> Arm:
        """Read the chain from the world to a site or a body of a compiled MuJoCo model.

        Args:
            model: `mujoco.MjModel`; MuJoCo itself is not imported.
            joint_names: all joints between the world and the tool that are not held, from the base on; default: those
                of the model.
            site: name of the tool frame, if it is a site.
            body: name of the tool frame, if it is that of a body.
            velocity_limits: (dof,) or scalar [rad/s or m/s]: MJCF does not contain velocity limits.
            locked: position [rad or m] of each joint to hold, by name or shell pattern like "head_*"; 0 for a free or
                ball joint, which stays where the model has it.
            base_link: body where the arm begins: joints before it are held at their reference, or as `locked` says.
            name: for messages.

        Raises:
            BadModel: unknown joints, site or body, or a model that is no such chain.
        """
        given = [(kind, value) for kind, value in (("site", site), ("body", body)) if value is not None]
        if len(given) != 1:
            raise BadModel(name, "tool frame", "give either a site or a body")
        request = ChainRequest(locked or {}, base_link, name)
        return Arm._from_data(name, chain_from_mujoco(model, joint_names, given[0], request), velocity_limits)

    @staticmethod
    def from_urdf(
        path: str | Path,
        *,
        tcp_frame: str,
        world_from_base: Pose | None = None,
        velocity_limits: ArrayLike | None = None,
        locked: Mapping[str, float] | None = None,
        base_link: str | None = None,
        name: str | None = None,
    ) -> Arm:
        """Read the chain from the base to a frame of a URDF file, with Pinocchio.

        Args:
            path: URDF file; meshes are not read.
            tcp_frame: name of the tool frame: a link, or else a joint.
            world_from_base: pose of the root link; default: the identity.
            velocity_limits: (dof,) or scalar [rad/s or m/s]; default: those of the file.
            locked: position [rad or m] of each joint to hold, by name or shell pattern like "head_*"; 0 for a floating
                or planar joint, which stays where the file has it.
            base_link: link where the arm begins: joints before it are held at 0, or as `locked` says.
            name: for messages; default: the file name.

        Raises:
            BadModel: no such file or frame, or a model that is no such chain.
        """
        data = chain_from_urdf(path, tcp_frame, ChainRequest(locked or {}, base_link, str(path)), world_from_base)
        return Arm._from_data(name or Path(path).name, data, velocity_limits)

    @staticmethod
    def _from_data(name: str, data: ChainData, velocity_limits: ArrayLike | None) -> Arm:
        count, speeds = len(data.joint_names), data.velocity
        if velocity_limits is not None:
            speeds = numbers(f"{name}: velocity_limits", velocity_limits)
        if speeds.shape not in ((), (1,), (count,)):
            raise BadShape(f"{name}: velocity_limits", speeds.shape, f"({count},) or a scalar")
        data.report.warn(stacklevel=3)
        speeds = np.broadcast_to(speeds, count)
        return Arm(name, data.joint_names, data.chain, data.lower, data.upper, speeds, data.report)
