"""Pieces cut where the hull of a link that is not convex makes the arm seem to hit itself.

The truth is the surface of the model's meshes, measured by fcl. Not in the paper, which moves a point.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from ..collision.capsule_placement import place_capsules
from ..collision.hull_distance import CLOSE, pair_hull_distance
from ..collision.robot_arrays import ROW, robot_arrays
from ..geometry.convex_pieces import best_cut, to_triangles
from ..geometry.pose import Pose
from ..geometry.shapes import pack
from ..jit import kernel
from ..robot.arm import Arm
from ..robot.body import Body
from ..robot.joint_frames import joint_frames, moved
from .link_pieces import Piece
from .mesh_distances import MeshDistances
from .self_contacts import MOSTLY, NEAR, survey_of

TOO_CLOSE = 0.002
"""Distance [m] by which hulls may be closer than the surfaces."""
LOOKS, ROUNDS, POSTURES = 24, 8, 1000
"""Postures per pair of parts in which the truth is measured; rounds of cuts; random postures of a round."""
MOST_CUT = 40
"""Pieces beyond which nothing is cut any more: every query visits all of them."""


def refined(
    arm: Arm, pieces: list[Piece], truth: MeshDistances, cover: Callable[[list[Piece]], Body], most: int
) -> Body:
    """Cut pieces until the distances of the arm's own parts are nearly those of its meshes.

    Args:
        arm: the arm.
        pieces: hulls of whole collision elements.
        truth: distances of the meshes.
        cover: makes a body of pieces.
        most: largest number of pieces.
    """
    body = cover(pieces)
    for _ in range(ROUNDS):
        blamed = _blamed(arm, body, pieces, truth)
        parts: list[Piece] = []
        for k, piece in enumerate(pieces):
            room = len(parts) + len(pieces) - k < min(most, MOST_CUT)
            points = blamed.get(id(piece))
            cut = best_cut(piece.geometry.triangles, np.array(points)) if points and room else []
            parts += [piece.with_triangles(side) for side in cut] or [piece]
        if len(parts) == len(pieces):
            break
        pieces, body = parts, cover(parts)
    return body


def _blamed(arm: Arm, body: Body, pieces: Sequence[Piece], truth: MeshDistances) -> dict[int, list[np.ndarray]]:
    """Points (3,) on hulls, in the piece's frame, by which parts seem closer than they are; by the piece's identity."""
    survey, work = survey_of(arm, body, POSTURES), robot_arrays((arm,), (body,), pack(()))
    blamed: dict[int, list[np.ndarray]] = {}
    owners, points = _owners(body, pieces), np.empty((2, 3))
    for names, indices in survey.by_parts(body).items():
        near = survey.distances[:, indices].min(axis=1)
        if not truth.knows(names) or (near < NEAR).mean() >= MOSTLY:
            continue
        for k in _evenly(np.flatnonzero(near < CLOSE), LOOKS):
            worst = indices[int(survey.distances[k, indices].argmin())]
            true = truth.between(names, survey.postures[k])
            if true > 0.0 and max(near[k], 0.0) < min(true, CLOSE) - TOO_CLOSE:
                i, j = survey.pairs[worst]
                q = survey.postures[k]
                _closest_points(work, q, i, j, points)
                local = [_local(owners[c], point, arm, q) for c, point in zip((i, j), points, strict=True)]
                gaps = [_gap(owners[c], point) for c, point in zip((i, j), local, strict=True)]
                side = int(np.argmax(gaps))
                blamed.setdefault(id(owners[(i, j)[side]]), []).append(local[side])
    return blamed


@kernel
def _closest_points(g, q, i, j, out):
    """Write the closest points (2, 3) of the hulls of two capsules at joints q."""
    place_capsules(g, q, ROW.placed)
    _, _, p, other = pair_hull_distance(g, ROW.placed, i, j, math.inf)
    for k in range(3):
        out[0, k], out[1, k] = p[k], other[k]


def _local(piece: Piece, point: np.ndarray, arm: Arm, q: np.ndarray) -> np.ndarray:
    """A world point in a piece's frame."""
    frame = Pose.identity() if piece.frame < 0 else joint_frames(arm, q)[piece.frame]
    return moved((frame @ piece.pose).inverse(), point)


def _gap(piece: Piece, point: np.ndarray) -> float:
    """Distance [m] of a point on a piece's hull from the piece's surface; 0 if the hull is all there is."""
    triangles = piece.geometry.triangles
    return float(to_triangles(point[None], triangles)[0]) if len(triangles) else 0.0


def _evenly(indices: np.ndarray, most: int) -> np.ndarray:
    return indices[:: max(1, len(indices) // most)][:most]


def _owners(body: Body, pieces: Sequence[Piece]) -> list[Piece]:
    """The piece of every capsule: pieces are covered in order, those with one hull by the same piece."""
    owners, left, last = [], iter(pieces), None
    for hull in body.hulls:
        if hull is None or hull is not last or not owners:
            owners.append(next(left))
        else:
            owners.append(owners[-1])
        last = hull
    return owners
