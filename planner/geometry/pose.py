"""Poses and paths of poses: immutable wrappers of dual quaternion arrays."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import FrozenArrays, checked_array, checked_kind, frozen, numbers
from ..errors import BadShape, NotUnit
from ..ranges import check_range
from . import dualquat as dq

METERS_PER_RADIAN = 0.2
"""Lever l [m/rad] of the weighted path length, which counts `sqrt(|dp|^2 + (l theta)^2)` [m] per step: a translation dp
and a rotation by theta [rad]. "Path length" means this everywhere in the project."""


@dataclass(frozen=True, slots=True, eq=False)
class Pose(FrozenArrays):
    """Pose of frame b in frame a, named `a_from_b`; composes as `world_from_tcp @ tcp_from_cup`.

    Attributes:
        dq: (8,) unit dual quaternion, read-only; its sign has no meaning.
    """

    dq: np.ndarray

    def __post_init__(self):
        value = dq.checked_unit(self.dq, "pose")
        if value.shape != (8,):
            raise BadShape("pose", value.shape, "(8,)")
        object.__setattr__(self, "dq", frozen(value))

    @staticmethod
    def identity() -> Pose:
        """Return the pose of no displacement."""
        return Pose(dq.identity())

    @staticmethod
    def from_position_quaternion(position: ArrayLike, wxyz: ArrayLike = (1.0, 0.0, 0.0, 0.0)) -> Pose:
        """Return the pose of a position and a quaternion.

        Args:
            position: (3,) [m].
            wxyz: (4,) unit quaternion.

        Raises:
            NotUnit: the norm of the quaternion deviates from 1 by more than 1e-6.
        """
        quaternion = numbers("quaternion", wxyz)
        norm = float(np.linalg.norm(quaternion))
        if abs(norm - 1.0) > dq.UNIT_TOLERANCE:
            raise NotUnit("quaternion", norm)
        return Pose(dq.from_position_quaternion(position, quaternion / norm))

    @staticmethod
    def from_vector(vector: ArrayLike) -> Pose:
        """Return the pose of a vector (7,): x y z [m], then quaternion wxyz."""
        array = checked_array("pose vector", vector, (7,))
        return Pose.from_position_quaternion(array[:3], array[3:])

    @staticmethod
    def from_matrix(matrix: ArrayLike) -> Pose:
        """Return the pose of a homogeneous matrix (4, 4).

        Raises:
            BadShape, NotFinite, NotUnit: wrong shape, numbers that are not finite, or no rotation.
        """
        from scipy.spatial.transform import Rotation

        array = checked_array("matrix", matrix, (4, 4))
        turn = array[:3, :3]
        if np.abs(turn @ turn.T - np.eye(3)).max() > dq.UNIT_TOLERANCE or np.linalg.det(turn) < 0:
            raise NotUnit("rotation part of the matrix", float(np.linalg.norm(turn, axis=1).max()))
        xyzw = Rotation.from_matrix(array[:3, :3]).as_quat()
        return Pose.from_position_quaternion(array[:3, 3], xyzw[[3, 0, 1, 2]])

    @staticmethod
    def from_yaw(position: ArrayLike, yaw: float) -> Pose:
        """Return an upright pose.

        Args:
            position: (3,) [m].
            yaw: rotation about z [rad].
        """
        check_range("yaw", yaw, "(-inf, inf)")
        return Pose.from_position_quaternion(position, [np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)])

    @property
    def position(self) -> np.ndarray:
        """Position (3,) [m]."""
        return dq.translation(self.dq)

    @property
    def quaternion(self) -> np.ndarray:
        """Quaternion (4,) wxyz with w >= 0."""
        return self.dq[:4] if self.dq[0] >= 0 else -self.dq[:4]

    @property
    def vector(self) -> np.ndarray:
        """Vector (7,): x y z [m], then quaternion wxyz."""
        return np.concatenate([self.position, self.quaternion])

    @property
    def rotation(self) -> np.ndarray:
        """Rotation matrix (3, 3)."""
        w, x, y, z = self.dq[:4]
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )

    @property
    def matrix(self) -> np.ndarray:
        """Homogeneous matrix (4, 4)."""
        out = np.eye(4)
        out[:3, :3], out[:3, 3] = self.rotation, self.position
        return out

    @property
    def yaw(self) -> float:
        """Rotation about z [rad] in (-pi, pi], by twist-swing decomposition: without the tilt."""
        w, _, _, z = self.dq[:4]
        return float(np.pi - (np.pi - 2.0 * np.arctan2(z, w)) % (2.0 * np.pi))

    @property
    def tilt(self) -> float:
        """Angle [rad] between the frame's z axis and the vertical."""
        w, x, y, z = self.dq[:4]
        return float(2.0 * np.arctan2(np.hypot(x, y), np.hypot(w, z)))

    def __repr__(self) -> str:
        """Show position and quaternion, rounded."""
        numbers = " ".join(f"{value:.4g}" for value in self.vector)
        return f"Pose([{numbers}])"

    def inverse(self) -> Pose:
        """Return `b_from_a` of `a_from_b`."""
        return Pose(dq.conj(self.dq))

    def __matmul__(self, other: Pose) -> Pose:
        """Compose two poses."""
        return Pose(dq.mul(self.dq, checked_kind("other", other, Pose).dq))

    def distance_to(self, other: Pose) -> tuple[float, float]:
        """Return the distance of the origins [m] and the rotation angle [rad] to another pose."""
        distance, angle = dq.pose_distance(self.dq, other.dq)
        return float(distance), float(angle)


@dataclass(frozen=True, slots=True, eq=False)
class PosePath(FrozenArrays):
    """A sequence of poses in one frame.

    Attributes:
        dqs: (n, 8) unit dual quaternions, n >= 1, read-only, signs continuous along the path.
    """

    dqs: np.ndarray

    def __post_init__(self):
        value = dq.checked_unit(self.dqs, "path")
        if value.ndim != 2 or len(value) == 0:
            raise BadShape("path", value.shape, "(n, 8) with n >= 1")
        object.__setattr__(self, "dqs", frozen(dq.continuous(value)))

    @staticmethod
    def from_vectors(vectors: ArrayLike) -> PosePath:
        """Return the path of pose vectors (n, 7): x y z [m], then unit quaternion wxyz."""
        array = numbers("pose vectors", vectors)
        if array.ndim != 2 or array.shape[1] != 7:
            raise BadShape("pose vectors", array.shape, "(n, 7)")
        return PosePath(dq.from_position_quaternion(array[:, :3], array[:, 3:]))

    @property
    def positions(self) -> np.ndarray:
        """Positions (n, 3) [m]."""
        return dq.translation(self.dqs)

    @property
    def quaternions(self) -> np.ndarray:
        """Quaternions (n, 4) wxyz with continuous signs."""
        return self.dqs[:, :4]

    @property
    def vectors(self) -> np.ndarray:
        """Vectors (n, 7): x y z [m], then quaternion wxyz."""
        return np.concatenate([self.positions, self.quaternions], axis=1)

    def __repr__(self) -> str:
        """Show the number of poses, the first and the last one."""
        return f"PosePath({len(self)} poses, {self[0]!r} to {self[-1]!r})"

    def __len__(self) -> int:
        """Number of poses."""
        return len(self.dqs)

    @overload
    def __getitem__(self, index: int) -> Pose: ...
    @overload
    def __getitem__(self, index: slice) -> PosePath: ...
    def __getitem__(self, index: int | slice) -> Pose | PosePath:
        """Return a pose by its index, or a part of the path by a slice."""
        if isinstance(index, slice):
            return PosePath(self.dqs[index])
        return Pose(self.dqs[index])

    def __iter__(self) -> Iterator[Pose]:
        """Iterate over the poses in order."""
        return (Pose(row) for row in self.dqs)

    def moved(self, a_from_b: Pose) -> PosePath:
        """Return the path displaced from the left (a change of world frame)."""
        return PosePath(dq.mul(a_from_b.dq, self.dqs))

    def with_tool(self, tcp_from_tool: Pose) -> PosePath:
        """Return the path of another frame fixed to the moving body (a change of body frame)."""
        return PosePath(dq.mul(self.dqs, tcp_from_tool.dq))

    def reversed(self) -> PosePath:
        """Return the path backwards."""
        return PosePath(self.dqs[::-1])

    def joined(self, other: PosePath) -> PosePath:
        """Return this path followed by another; a first pose equal to our last one is not repeated."""
        distance, angle = self[-1].distance_to(other[0])
        start = 1 if distance < 1e-9 and angle < 1e-9 else 0
        return PosePath(np.concatenate([self.dqs, other.dqs[start:]]))

    def lengths(self, meters_per_radian: float = METERS_PER_RADIAN) -> np.ndarray:
        """Return the path length (n,) [m] from the start to every pose: cumulated `sqrt(|dp|^2 + (l theta)^2)`.

        Paper: "length" without a metric; this one is left-invariant, and depends on the body origin.
        """
        distance, angle = dq.pose_distance(self.dqs[:-1], self.dqs[1:])
        return np.concatenate([[0.0], np.cumsum(np.hypot(distance, meters_per_radian * angle))])


def nearest(path: PosePath, pose: Pose) -> int:
    """Return the index of the pose of a path nearest to a pose, by weighted distance (`METERS_PER_RADIAN`).

    Args:
        path: n poses.
        pose: the pose, in the frame of the path.
    """
    distance, angle = dq.pose_distance(pose.dq[None], path.dqs)
    return int(np.argmin(np.hypot(distance, METERS_PER_RADIAN * angle)))
