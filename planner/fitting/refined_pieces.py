"""Pieces cut where the hull of a link that is not convex makes the arm seem to hit itself.

The truth is the surface of the model's meshes, measured by fcl. Not in the paper, which moves a point.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from ..collision.capsule_placement import place_capsules
from ..collision.hull_distance import CLOSE, pair_hull_distance
from ..collision.robot_arrays import ROW, robot_arrays
from ..geometry.convex_pieces import best_cut, rounded_hull, thinned
from ..geometry.hulls import directions
from ..geometry.shapes import pack
from ..geometry.triangle_surface import nearest_on_triangles
from ..jit import kernel
from ..robot.arm import Arm
from ..robot.body import Body
from ..robot.kinematics import FRAME, forward_into
from .link_pieces import Piece, owners_of, surface
from .mesh_distances import MeshDistances, rotation_of
from .self_contacts import distances_of_pairs, rest_on_each_other, survey_of

TOO_CLOSE = 0.002
"""Distance [m] by which hulls may be closer than the surfaces."""
LOOKS, ROUNDS = 300, 16
"""Postures per pair of parts in which the truth is measured at first; rounds of cuts."""
AROUND, COPIES, STRAY = 8, 5, 0.02
"""Postures with the largest errors about which more are looked at in a round; number of
postures about each; how far these lie from it, as a share of the joints' ranges."""
WORST, FEW = 0.7, 12
"""Share of the largest error from which a piece is cut in a round; number of points, about, that choose a plane."""
ROUGH, SOME = 0.002, 2000
"""Rounding [m] of a hull, and number of points on a surface, about, by which the deepest point is found."""
MOST_CUT = 56
"""Pieces beyond which nothing is cut any more: every query visits all of them."""

Names = tuple[str, str]
Blame = dict[int, list[tuple[float, np.ndarray]]]
"""By a piece's identity, how much [m] its hull makes other parts seem too close, and the point (3,) on or in it."""


class _Looks(NamedTuple):
    """Postures (n, dof) in which two parts seem close, and their true distances (n,) [m]."""

    postures: np.ndarray
    true: np.ndarray


def refined(
    arm: Arm, pieces: list[Piece], truth: MeshDistances, cover: Callable[[list[Piece]], Body], most: int
) -> list[Piece]:
    """Return pieces cut until the distances of the arm's own parts are nearly those of its meshes, the worst first.

    Hulls only recede, so that parts need to be looked at only where they seem close at first.

    Args:
        arm: the arm.
        pieces: hulls of whole collision elements.
        truth: distances of the meshes.
        cover: makes a body of pieces.
        most: largest number of pieces.
    """
    most, hopeless, rng = min(most, MOST_CUT), dict[int, Piece](), np.random.default_rng(2)
    body = cover(pieces)
    looks, solids = _first_looks(arm, body, pieces, truth, rng), _Solids()
    for _ in range(ROUNDS):
        blame = _blamed(arm, body, pieces, truth, looks, rng, solids)
        blame = {key: found for key, found in blame.items() if key not in hopeless}
        if not blame or len(pieces) >= most:
            break
        pieces = _cut(pieces, blame, hopeless, most)
        body = cover(pieces)
    return pieces


def _cut(pieces: list[Piece], blame: Blame, hopeless: dict[int, Piece], most: int) -> list[Piece]:
    """Return the pieces with the worst of them cut; those for which no cut is of use are noted as hopeless."""
    errors = {key: max(error for error, _ in found) for key, found in blame.items()}
    limit, cuts = WORST * max(errors.values()), {}
    by_key = {id(piece): piece for piece in pieces}
    for key in sorted(errors, key=lambda key: -errors[key]):
        if errors[key] < limit or len(pieces) + len(cuts) >= most:
            break
        found = sorted(blame[key], key=lambda each: -each[0])
        worst = np.array([point for error, point in found if error >= 0.5 * errors[key]])
        triangles = by_key[key].geometry.triangles
        # where no plane frees the points on average, as all around a hollow, one may free the worst
        sides = best_cut(triangles, worst[:: max(1, len(worst) // FEW)]) or best_cut(triangles, worst[:1])
        if sides:
            cuts[key] = [by_key[key].with_triangles(side) for side in sides]
        else:
            hopeless[key] = by_key[key]
    return [part for piece in pieces for part in cuts.get(id(piece), [piece])]


def _first_looks(
    arm: Arm, body: Body, pieces: Sequence[Piece], truth: MeshDistances, rng: np.random.Generator
) -> dict[Names, _Looks]:
    """Return postures in which two parts seem close, for every pair that is not always so: random, and about these."""
    survey, looks = survey_of(arm, body), {}
    for names, indices in survey.by_parts([piece.label for piece in owners_of(body, pieces)]).items():
        near = survey.distances[:, indices].min(axis=1)
        close = np.flatnonzero(near < CLOSE)
        if len(close) and not rest_on_each_other(survey, indices, truth, names):
            postures = survey.postures[_evenly(close, LOOKS)]
            if len(postures) < LOOKS:
                postures = np.vstack([postures, _about(arm, postures, LOOKS - len(postures), rng)])
            looks[names] = _Looks(postures, np.array([truth.between(names, q) for q in postures]))
    return looks


def _about(arm: Arm, postures: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Return a number of postures (count, dof) about some postures."""
    strays = STRAY * np.minimum(arm.upper - arm.lower, 2.0 * math.pi) * rng.normal(size=(count, arm.dof))
    return np.clip(np.resize(postures, (count, arm.dof)) + strays, arm.lower, arm.upper)


def _blamed(
    arm: Arm,
    body: Body,
    pieces: Sequence[Piece],
    truth: MeshDistances,
    looks: dict[Names, _Looks],
    rng: np.random.Generator,
    solids: _Solids,
) -> Blame:
    """Return which pieces make parts seem closer than they are, and where; more looks are taken about the worst."""
    work, owners, blame = robot_arrays((arm,), (body,), pack(())), owners_of(body, pieces), {}
    for names, pairs in _pairs_by_parts([piece.label for piece in owners]).items():
        if names not in looks:
            continue
        for more in (True, False):
            postures, true = looks[names]
            distances = distances_of_pairs(work, postures, pairs)
            near = np.maximum(distances.min(axis=1), 0.0)
            errors = np.where(true > 0.0, np.minimum(true, CLOSE) - near, -np.inf)
            if more and errors.max() > 0.5 * TOO_CLOSE:
                new = _about(arm, postures[np.argsort(-errors)[:AROUND]], AROUND * COPIES, rng)
                found = np.array([truth.between(names, q) for q in new])
                looks[names] = _Looks(np.vstack([postures, new]), np.concatenate([true, found]))
        worst = np.argsort(-errors)[:FEW]
        for k in worst[errors[worst] > TOO_CLOSE]:
            i, j = pairs[int(distances[k].argmin())]
            both, pair, touching = (owners[i], owners[j]), (int(i), int(j)), bool(near[k] <= 0.0)
            point = _point_to_blame(arm, work, both, pair, postures[k], solids, touching=touching)
            if point is not None:
                blame.setdefault(point[0], []).append((float(errors[k]), point[1]))
    return blame


def _pairs_by_parts(labels: Sequence[str]) -> dict[Names, np.ndarray]:
    """Return the pairs (n, 2) of capsules of every pair of parts; the labels are those of the capsules' parts."""
    found: dict[Names, list[tuple[int, int]]] = {}
    for i, j in combinations(range(len(labels)), 2):
        found.setdefault((labels[i], labels[j]), []).append((i, j))
    return {names: np.array(pairs) for names, pairs in found.items()}


def _point_to_blame(
    arm: Arm,
    work: np.ndarray,
    both: tuple[Piece, Piece],
    pair: tuple[int, int],
    q: np.ndarray,
    solids: _Solids,
    *,
    touching: bool,
) -> tuple[int, np.ndarray] | None:
    """Return the identity of the piece whose hull stands off its surface where two seem close, and the point there.

    Args:
        arm: the arm.
        work: array of the arm and its body.
        both: the two pieces.
        pair: capsules of the two.
        q: (dof,) joints.
        solids: what is known of pieces.
        touching: the hulls touch, so that they have no closest points.
    """
    frames = _frames_of(both, arm, q)
    if touching:
        world = [solids.points(each) @ turn.T + place for each, (turn, place) in zip(both, frames, strict=True)][::-1]
    else:
        closest = np.empty((2, 3))
        _closest_points(work, q, *pair, closest)
        world = list(closest)
    local = [(points - place) @ turn for points, (turn, place) in zip(world, frames, strict=True)]
    found = [solids.deepest(*each) for each in zip(both, local, strict=True)] if touching else local
    gaps = [solids.gap(piece, point) for piece, point in zip(both, found, strict=True)]
    side = int(np.argmax(gaps))
    point = found[side]
    return (id(both[side]), point) if gaps[side] > 0.0 and point is not None else None


@kernel
def _closest_points(g, q, i, j, out):
    """Write the closest points (2, 3) of the hulls of two capsules at joints q."""
    place_capsules(g, q, ROW.placed)
    _, _, p, other = pair_hull_distance(g, ROW.placed, i, j, math.inf)
    for k in range(3):
        out[0, k], out[1, k] = p[k], other[k]


def _frames_of(pieces: Sequence[Piece], arm: Arm, q: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return rotation (3, 3) and position (3,) [m] of pieces in the world."""
    frames, found = np.empty((arm.dof, FRAME.width)), []
    forward_into(arm.chain, q, frames, np.empty(8))
    for piece in pieces:
        rotation, position = piece.pose.rotation, piece.pose.position
        if piece.frame >= 0:
            row = frames[piece.frame]
            turn = rotation_of(row[FRAME.rotation : FRAME.width])
            rotation, position = turn @ rotation, turn @ position + row[FRAME.origin : FRAME.rotation]
        found.append((rotation, position))
    return found


class _Solids:
    """Planes, points and thinned surfaces of pieces, each found once."""

    def __init__(self) -> None:
        self._planes: dict[int, tuple[Piece, np.ndarray]] = {}
        self._points: dict[int, tuple[Piece, np.ndarray]] = {}
        self._thin: dict[int, tuple[Piece, np.ndarray]] = {}

    def deepest(self, piece: Piece, points: np.ndarray) -> np.ndarray | None:
        """Return the point (3,) of some (n, 3) that lies deepest in a piece's hull; None if none does."""
        from scipy.spatial import ConvexHull

        if not len(piece.geometry.triangles):
            return None
        if id(piece) not in self._planes:
            self._planes[id(piece)] = piece, ConvexHull(rounded_hull(piece.geometry.points, ROUGH)[0]).equations
        planes = self._planes[id(piece)][1]
        depth = -(points @ planes[:, :3].T + planes[:, 3]).max(axis=1)
        return points[int(depth.argmax())] if depth.max() > 0.0 else None

    def gap(self, piece: Piece, point: np.ndarray | None) -> float:
        """Return about the distance [m] of a point on a piece's hull from its surface; 0 without triangles."""
        if not len(piece.geometry.triangles) or point is None:
            return 0.0
        if id(piece) not in self._thin:
            self._thin[id(piece)] = piece, thinned(piece.geometry.triangles)
        return float(np.linalg.norm(point - nearest_on_triangles(point, self._thin[id(piece)][1])))

    def points(self, piece: Piece) -> np.ndarray:
        """Return points (n, 3) on a piece's surface: of the corners and the middles of its triangles, or all around."""
        if id(piece) not in self._points:
            around = [
                end + radius * directions() for a, b, radius in piece.geometry.exact for end in (a, 0.5 * (a + b), b)
            ]
            if len(piece.geometry.points):
                triangles = surface(piece.geometry)
                around += [np.unique(triangles.reshape(-1, 3), axis=0), triangles.mean(axis=1)]
            points = np.vstack(around)
            self._points[id(piece)] = piece, points[:: max(1, len(points) // SOME)]
        return self._points[id(piece)][1]


def _evenly(indices: np.ndarray, most: int) -> np.ndarray:
    return indices[:: max(1, len(indices) // most)][:most]
