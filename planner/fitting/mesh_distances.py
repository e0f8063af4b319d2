"""True distances of an arm's own parts, between the surfaces of its model's meshes, measured by fcl."""

from __future__ import annotations

from collections.abc import Sequence

import fcl
import numpy as np

from ..robot.arm import Arm
from ..robot.kinematics import FRAME, forward_into
from .link_pieces import Piece, surface


class MeshDistances:
    """Distances of the surfaces of an arm's parts.

    Args:
        arm: the arm.
        pieces: collision elements of its parts.
    """

    def __init__(self, arm: Arm, pieces: Sequence[Piece]):
        self._arm, self._frames, self._tcp = arm, np.empty((arm.dof, FRAME.width)), np.empty(8)
        self._parts: dict[str, list[tuple[int, fcl.CollisionObject]]] = {}
        self._round = {piece.name for piece in pieces if piece.geometry.exact}
        for piece in pieces:
            if len(piece.geometry.points):
                item = fcl.CollisionObject(_model(piece))
                self._parts.setdefault(piece.name, []).append((piece.frame, item))

    def knows(self, names: tuple[str, str]) -> bool:
        """Return whether two parts consist of meshes alone."""
        return all(name in self._parts and name not in self._round for name in names)

    def between(self, names: tuple[str, str], q: np.ndarray) -> float:
        """Return the distance [m] of two parts at some joints.

        Args:
            names: of the parts; see `knows`.
            q: (dof,) joints [rad or m].

        Returns:
            The distance of their surfaces; not above 0 if they cross.
        """
        forward_into(self._arm.chain, q, self._frames, self._tcp)
        least = np.inf
        for frame, one in self._parts[names[0]]:
            self._place(frame, one)
            for other_frame, other in self._parts[names[1]]:
                self._place(other_frame, other)
                least = min(least, fcl.distance(one, other, fcl.DistanceRequest(), fcl.DistanceResult()))
        return float(least)

    def _place(self, frame: int, item: fcl.CollisionObject) -> None:
        if frame >= 0:
            row = self._frames[frame]
            place = fcl.Transform(row[FRAME.rotation : FRAME.width], row[FRAME.origin : FRAME.rotation])
            item.setTransform(place)


def _model(piece: Piece) -> fcl.BVHModel:
    """Return the surface of a piece, in its frame."""
    triangles = surface(piece.geometry) @ piece.pose.rotation.T + piece.pose.position
    model = fcl.BVHModel()
    model.beginModel(len(triangles), 3 * len(triangles))
    model.addSubModel(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))
    model.endModel()
    return model
