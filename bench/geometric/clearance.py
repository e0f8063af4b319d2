"""Check of the hand and the held object against obstacles along a path, by python-fcl, at the poses and between them.

Between two poses every path counts as a screw motion. Along it a point of a rigid body has constant speed, and the
fastest points of a capsule's core are its ends. If the clearances at both poses together exceed the displacement, there
is no contact in between; otherwise the stretch is halved.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...planner import Body, Obstacle, PosePath
from ...planner.geometry import dualquat as dq
from ...planner.judge.geometry import CollisionWorld, Moment
from ...planner.robot.body import TOOL_CAPSULE

FAR = 0.05
"""Clearance [m] above which clearances are not distinguished."""
SHORTEST = 2e-4
"""Displacement [m] of a capsule's points between two poses below which an undecided stretch counts as contact."""
HALVINGS = 24
"""Largest number of halvings of a stretch."""


class PathClearance(NamedTuple):
    """Verdict on a path.

    Attributes:
        clear: True if there is no contact, neither at the poses nor between them.
        least: smallest distance at the checked poses [m], at most `FAR`.
    """

    clear: bool
    least: float


class ToolJudge:
    """Judge of the paths of one tool among static obstacles.

    Args:
        tool: (m, 7) capsules in the tcp's frame, see `Body.tool`.
        obstacles: static obstacles.
    """

    def __init__(self, tool: np.ndarray, obstacles: Sequence[Obstacle]):
        rows = np.column_stack([np.zeros(len(tool)), tool])
        self._scene = CollisionWorld(Body(rows, tuple(f"capsule{k}" for k in range(len(tool)))), obstacles)
        self._ends, self._radii = tool[:, : TOOL_CAPSULE.radius].reshape(-1, 2, 3), tool[:, TOOL_CAPSULE.radius]
        self._turns = np.array([_turn_to(b - a) for a, b in self._ends])
        self._count = len(obstacles)

    def clearance_of(self, path: PosePath) -> PathClearance:
        """Return the verdict on a path."""
        if not self._count:
            return PathClearance(True, FAR)
        moment = self._moment(path.dqs)
        clearance = self._clearances(moment)
        least = min(FAR, float(clearance.min()))
        if least <= 0.0:
            return PathClearance(False, least)
        return self._between(path.dqs, clearance, least)

    def _between(self, poses: np.ndarray, clearance: np.ndarray, least: float) -> PathClearance:
        """Halve every stretch that its ends do not prove clear."""
        first, last, before, after = poses[:-1], poses[1:], clearance[:-1], clearance[1:]
        for _ in range(HALVINGS):
            displacement = self._displacements(first, last)
            # clearances above FAR are stored as FAR, which is a valid lower bound
            undecided = (before + after <= displacement[:, :, None]).any(axis=(1, 2))
            if not undecided.any():
                return PathClearance(True, least)
            if (displacement.max(axis=1)[undecided] < SHORTEST).any():
                return PathClearance(False, least)
            first, last, before, after = (each[undecided] for each in (first, last, before, after))
            middle = dq.sclerp(first, last, np.full(len(first), 0.5))
            found = self._clearances(self._moment(middle))
            least = min(least, float(found.min()))
            if least <= 0.0:
                return PathClearance(False, least)
            first, last = np.concatenate([first, middle]), np.concatenate([middle, last])
            before, after = np.concatenate([before, found]), np.concatenate([found, after])
        return PathClearance(False, least)

    def _clearances(self, moment: Moment) -> np.ndarray:
        """Return the distances (n, m, k) [m], at most `FAR`."""
        out = np.minimum(self._scene.at_least(moment), FAR)
        near = np.argwhere(out < FAR)
        if len(near):
            out[tuple(near.T)] = np.minimum(self._scene.distances(moment, near), FAR)
        return out

    def _moment(self, poses: np.ndarray) -> Moment:
        """Return the placed capsules at poses (n, 8)."""
        turn, place = _rotations(poses), dq.translation(poses)
        ends = np.einsum("nij,mej->nmei", turn, self._ends) + place[:, None, None]
        turns = turn[:, None] @ self._turns
        nothing = np.empty((len(poses), 0, 3))
        places = np.empty((len(poses), 0, 4, 4))
        return Moment(np.zeros(len(poses)), np.empty((len(poses), 0)), nothing, nothing, ends, turns, places, turn)

    def _displacements(self, first: np.ndarray, last: np.ndarray) -> np.ndarray:
        """Return bounds (n, m) on the displacement [m] of the points of each capsule along the screws."""
        twist = dq.twist_from_dq(dq.mul(dq.conj(first), last))
        v, w = twist[:, None, None, :3], twist[:, None, None, 3:]
        speed = np.linalg.norm(v + np.cross(w, self._ends[None]), axis=-1).max(axis=-1)
        return speed + np.linalg.norm(twist[:, None, 3:], axis=-1) * self._radii


def _rotations(poses: np.ndarray) -> np.ndarray:
    """Return the rotation matrices (n, 3, 3) of dual quaternions (n, 8)."""
    w, x, y, z = poses[:, :4].T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def _turn_to(direction: np.ndarray) -> np.ndarray:
    """Return a rotation matrix with its z axis along a vector; for a zero vector along z."""
    length = np.linalg.norm(direction)
    z = direction / length if length > 1e-12 else np.array([0.0, 0.0, 1.0])
    x = np.cross(z, np.eye(3)[int(np.abs(z).argmin())])
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])
