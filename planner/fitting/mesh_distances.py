"""True distances of an arm's own parts, between the surfaces of its model's meshes, measured by fcl."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import fcl
import numpy as np

from ..geometry.triangle_surface import is_inside, shells_of
from ..robot.arm import Arm
from ..robot.joint_frames import moved
from ..robot.kinematics import FRAME, forward_into
from .link_pieces import Piece, surface

SOME = 32
"""Number of corners, about, that must lie in the box about an element of which another one lies inside."""


class MeshDistances:
    """Distances of the surfaces of an arm's parts.

    Args:
        arm: the arm.
        pieces: collision elements of its parts.
    """

    def __init__(self, arm: Arm, pieces: Sequence[Piece]):
        self._arm, self._frames, self._tcp = arm, np.empty((arm.dof, FRAME.width)), np.empty(8)
        self._parts: dict[str, list[_Item]] = {}
        for piece in pieces:
            self._parts.setdefault(piece.label, []).extend(_items(piece))

    def between(self, names: tuple[str, str], q: np.ndarray) -> float:
        """Return the distance [m] of two parts at some joints.

        Args:
            names: labels of the parts' pieces.
            q: (dof,) joints [rad or m].

        Returns:
            The distance of their surfaces; not above 0 if they cross, or one lies inside the other.
        """
        forward_into(self._arm.chain, q, self._frames, self._tcp)
        ones, others = ([self._placed(item) for item in self._parts[name]] for name in names)
        gaps = sorted(
            (float(np.linalg.norm(one.center - other.center)) - one.ball - other.ball, i, j)
            for i, one in enumerate(ones)
            for j, other in enumerate(others)
        )
        least = np.inf
        for gap, i, j in gaps:
            if gap >= least or least <= 0.0:
                break
            one, other = ones[i], others[j]
            found = float(fcl.distance(one.solid, other.solid, fcl.DistanceRequest(), fcl.DistanceResult()))
            found -= one.radius + other.radius
            least = min(least, 0.0 if found > 0.0 and (one.holds(other) or other.holds(one)) else found)
        return least

    def _placed(self, item: _Item) -> _Item:
        if item.frame < 0:
            return item
        row = self._frames[item.frame]
        turn, place = rotation_of(row[FRAME.rotation : FRAME.width]), row[FRAME.origin : FRAME.rotation].copy()
        item.solid.setTransform(fcl.Transform(turn, place))
        return item._replace(turn=turn, place=place)


def rotation_of(wxyz: np.ndarray) -> np.ndarray:
    """Return the rotation (3, 3) of a unit quaternion (4,) wxyz."""
    w, x, y, z = wxyz.tolist()
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


class _Item(NamedTuple):
    """A collision element.

    Attributes:
        frame: index of the frame it moves with; -1: the world.
        solid: its surface, where it is.
        triangles: (n, 3, 3) of it in the frame [m].
        shells: the same, those that share no corner apart: what is in a closed cavity has no way out.
        low: (3,) lower corner of the box about it [m].
        high: (3,) upper corner.
        ball: radius of the ball about the box's center that contains it [m].
        radius: of the balls about all points of the surface that belong to it [m]: a capsule's surface is its core.
        turn: (3, 3) rotation of its frame in the world.
        place: (3,) origin of its frame [m].
    """

    frame: int
    solid: fcl.CollisionObject
    triangles: np.ndarray
    shells: list[np.ndarray]
    low: np.ndarray
    high: np.ndarray
    ball: float
    radius: float
    turn: np.ndarray
    place: np.ndarray

    @property
    def center(self) -> np.ndarray:
        """Center (3,) of the ball, in the world [m]."""
        return self.turn @ (0.5 * (self.low + self.high)) + self.place

    def holds(self, other: _Item) -> bool:
        """Return whether another element, whose surface does not cross this one, lies inside."""
        if other.ball > self.ball:
            return False
        some = other.triangles[:: max(1, len(other.triangles) // SOME), 0]
        corners = (some @ other.turn.T + other.place - self.place) @ self.turn
        inside_box = bool(((self.low <= corners) & (corners <= self.high)).all())
        return inside_box and any(is_inside(corners[0], shell) for shell in self.shells)


def _items(piece: Piece) -> Iterator[_Item]:
    """Yield the elements of a piece: its capsules by their cores, and its surface."""
    solids = [(np.array([[a, b, b]], dtype=np.float64), float(radius)) for a, b, radius in piece.geometry.exact]
    if len(piece.geometry.points):
        solids.append((surface(piece.geometry), 0.0))
    for local, radius in solids:
        triangles = moved(piece.pose, local)
        low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
        ball = float(np.linalg.norm(triangles - 0.5 * (low + high), axis=2).max()) + radius
        solid = fcl.CollisionObject(_model(triangles))
        yield _Item(
            piece.frame, solid, triangles, shells_of(triangles), low, high, ball, radius, np.eye(3), np.zeros(3)
        )


def _model(triangles: np.ndarray) -> fcl.BVHModel:
    model = fcl.BVHModel()
    model.beginModel(len(triangles), 3 * len(triangles))
    model.addSubModel(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))
    model.endModel()
    return model
