"""Pieces cut where the hull of a link that is not convex makes the arm seem to hit itself.

The truth is the surface of the model's meshes, measured by fcl. Not in the paper, which moves a point.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import combinations

import numpy as np

from ..collision.capsule_placement import place_capsules
from ..collision.hull_distance import CLOSE, pair_hull_distance
from ..collision.robot_arrays import ROW, robot_arrays
from ..geometry.convex_pieces import best_parts
from ..geometry.shapes import pack
from ..jit import kernel
from ..robot.arm import Arm
from ..robot.body import Body
from ..robot.kinematics import FRAME, forward_into
from .link_pieces import Piece, PieceSurfaces, owners_of
from .merged_pieces import TOO_CLOSE, Looks, Merger, Names, errors_of, worst_of
from .mesh_distances import MeshDistances, rotation_of
from .self_contacts import distances_of_pairs, rest_on_each_other, survey_of

SURVEYED, LOOKS, ROUNDS = 16000, 350, 24
"""Random postures among which close ones are looked for; postures per pair of parts in which the truth is measured at
first; rounds of cuts."""
AROUND, COPIES, STRAY = 8, 4, 0.02
"""Postures with the largest errors about which more are looked at in a round; number of
postures about each; how far these lie from it, as a share of the joints' ranges."""
NEARLY = 0.6
"""Share of the error that is too large up to which postures, and parts, need no further look."""
DRAWN = 8
"""Postures that are drawn for each that is looked at: those in which hulls are not close show nothing."""
WORST, FEW = 0.5, 12
"""Share of the largest error from which a piece is cut in a round; number of points, about, that choose a plane."""
DONE = 0.0025
"""Error [m] at which cutting ends where there is no room for further pieces."""
ENOUGH, WORSE, SPARE = 0.0023, 0.0027, 4
"""Error [m] up to which pieces may be merged to make room for cuts against larger ones; and up to which they may if
that makes no room for so many cuts."""
MOST_CUT = 56
"""Pieces beyond which nothing is cut any more: every query visits all of them."""

Blame = dict[int, list[tuple[float, np.ndarray]]]
"""By a piece's identity, how much [m] its hull makes other parts seem too close, and the point (3,) on or in it."""


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
    body, merger, solids = cover(pieces), Merger(arm, cover), PieceSurfaces()
    looks, unseen = _first_looks(arm, body, pieces, truth, rng)
    least, best = math.inf, pieces
    for _ in range(ROUNDS):
        blame = _blamed(arm, body, pieces, truth, looks, rng, solids, hopeless)
        largest = max((error for found in blame.values() for error, _ in found), default=0.0)
        if unseen and largest <= DONE:  # good so far: are others good too?
            _look_at(unseen, looks, robot_arrays((arm,), (body,), pack(())), owners_of(body, pieces), truth)
            unseen, least = {}, math.inf
            continue
        if largest <= least:
            least, best = largest, pieces
        if not blame:
            break
        pieces, is_full = _cut(pieces, blame, hopeless, most)
        if is_full:
            count, pieces = len(pieces), _with_room(pieces, merger, looks, largest)
            if len(pieces) == count:
                break
        body = cover(pieces)
    return best


def _with_room(pieces: list[Piece], merger: Merger, looks: dict[Names, Looks], largest: float) -> list[Piece]:
    """Return pieces merged so that there is room for cuts against the largest error, if that is possible and needed."""
    fewer = merger.merged(pieces, looks, ENOUGH) if largest > DONE else pieces
    needed = largest > WORSE and len(pieces) - len(fewer) < SPARE
    return merger.merged(fewer, looks, WORSE) if needed else fewer


def _cut(pieces: list[Piece], blame: Blame, hopeless: dict[int, Piece], most: int) -> tuple[list[Piece], bool]:
    """Return the pieces with the worst of them cut, and whether there was no room for all cuts.

    Pieces for which no cut is of use are noted as hopeless.
    """
    errors = {key: max(error for error, _ in found) for key, found in blame.items()}
    limit, cuts, added, is_full = WORST * max(errors.values()), {}, 0, False
    by_key = {id(piece): piece for piece in pieces}
    for key in sorted(errors, key=lambda key: -errors[key]):
        is_full = is_full or len(pieces) + added >= most
        if errors[key] < limit or is_full:
            break
        found = sorted(blame[key], key=lambda each: -each[0])
        worst = np.array([point for error, point in found if error >= 0.5 * errors[key]])
        triangles = by_key[key].geometry.triangles
        # where no plane frees the points on average, as all around a hollow, one may free the worst
        some = worst[:: max(1, len(worst) // FEW)]
        sides = best_parts(triangles, some) or best_parts(triangles, worst[:1])
        if not sides:
            hopeless[key] = by_key[key]
        elif len(pieces) + added + len(sides) - 1 <= most:
            added += len(sides) - 1
            cuts[key] = [by_key[key].with_triangles(side) for side in sides]
        else:
            is_full = True
    return [part for piece in pieces for part in cuts.get(id(piece), [piece])], is_full


def _first_looks(
    arm: Arm, body: Body, pieces: Sequence[Piece], truth: MeshDistances, rng: np.random.Generator
) -> tuple[dict[Names, Looks], dict[Names, np.ndarray]]:
    """Return postures in which two parts seem close, for every pair that is not always so; and others, not looked at.

    They are random; where there are few, more are drawn about them.
    """
    survey, looks, unseen = survey_of(arm, body, SURVEYED), {}, {}
    work = robot_arrays((arm,), (body,), pack(()))
    for names, indices in survey.by_parts([piece.label for piece in owners_of(body, pieces)]).items():
        near = survey.distances[:, indices].min(axis=1)
        close = np.flatnonzero(near < CLOSE)
        if len(close) and not rest_on_each_other(survey, indices, truth, names):
            chosen = _evenly(close, LOOKS)
            postures, unseen[names] = survey.postures[chosen], survey.postures[np.setdiff1d(close, chosen)]
            if len(postures) < LOOKS:
                drawn = _about(arm, postures, DRAWN * (LOOKS - len(postures)), rng)
                close = _closest(work, drawn, survey.pairs[indices], LOOKS - len(postures))
                postures = np.vstack([postures, drawn[close]])
            looks[names] = _looks(work, names, survey.pairs[indices], postures, truth)
    return looks, unseen


def _looks(work: np.ndarray, names: Names, pairs: np.ndarray, postures: np.ndarray, truth: MeshDistances) -> Looks:
    """Return looks at two parts, of which the capsules are given, in postures (n, dof)."""
    true = np.array([truth.between(names, q) for q in postures])
    return Looks.of(postures, true, distances_of_pairs(work, postures, pairs).min(axis=1))


def _look_at(
    unseen: dict[Names, np.ndarray],
    looks: dict[Names, Looks],
    work: np.ndarray,
    owners: Sequence[Piece],
    truth: MeshDistances,
) -> None:
    """Add looks at those of some postures of two parts in which their hulls are close."""
    for names, pairs in _pairs_by_parts([piece.label for piece in owners]).items():
        postures = unseen.get(names)
        if postures is not None and len(postures):
            chosen = postures[_closest(work, postures, pairs, LOOKS)]
            looks[names] = looks[names].and_more(_looks(work, names, pairs, chosen, truth))


def _about(arm: Arm, postures: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Return a number of postures (count, dof) about some postures."""
    strays = STRAY * np.minimum(arm.upper - arm.lower, 2.0 * math.pi) * rng.normal(size=(count, arm.dof))
    return np.clip(np.resize(postures, (count, arm.dof)) + strays, arm.lower, arm.upper)


def _closest(work: np.ndarray, postures: np.ndarray, pairs: np.ndarray, most: int) -> np.ndarray:
    """Return the indices of some postures in which the hulls of two parts are close: in others nothing can be wrong.

    Args:
        work: array of the arm and its body.
        postures: (m, dof) to choose from [rad or m].
        pairs: (n, 2) capsules of the two parts.
        most: number of postures.
    """
    near = distances_of_pairs(work, postures, pairs).min(axis=1)
    order = np.argsort(near, kind="stable")
    return _evenly(order[near[order] < CLOSE - TOO_CLOSE], most)


def _blamed(
    arm: Arm,
    body: Body,
    pieces: Sequence[Piece],
    truth: MeshDistances,
    looks: dict[Names, Looks],
    rng: np.random.Generator,
    solids: PieceSurfaces,
    hopeless: dict[int, Piece],
) -> Blame:
    """Return which pieces make parts seem closer than they are, and where; more looks are taken about the worst."""
    work, owners, blame = robot_arrays((arm,), (body,), pack(())), owners_of(body, pieces), {}
    for names, pairs in _pairs_by_parts([piece.label for piece in owners]).items():
        if names not in looks:
            continue
        look = _more(arm, work, names, pairs, looks[names], truth, rng)
        seen = look.postures[look.is_open]
        distances = distances_of_pairs(work, seen, pairs)
        errors = errors_of(distances, look.true[look.is_open])
        look.is_open[look.is_open] = errors > NEARLY * TOO_CLOSE
        looks[names], worst = look, worst_of(errors, distances, FEW)
        for k in worst[errors[worst] > TOO_CLOSE]:
            i, j = pairs[int(distances[k].argmin())]
            both, pair, touching = (owners[i], owners[j]), (int(i), int(j)), bool(distances[k].min() <= 0.0)
            point = _point_to_blame(arm, work, both, pair, seen[k], solids, hopeless, touching=touching)
            if point is not None:
                blame.setdefault(point[0], []).append((float(errors[k]), point[1]))
    return blame


def _more(
    arm: Arm,
    work: np.ndarray,
    names: Names,
    pairs: np.ndarray,
    look: Looks,
    truth: MeshDistances,
    rng: np.random.Generator,
) -> Looks:
    """Return looks at two parts, and more about those where hulls are, or were, most in error."""
    some = look.postures[look.is_open]
    distances = distances_of_pairs(work, some, pairs)
    errors = errors_of(distances, look.true[look.is_open])
    hollow = np.flatnonzero(look.in_hollow)
    around = [some[worst_of(errors, distances, AROUND)]] if errors.max(initial=0.0) > NEARLY * TOO_CLOSE else []
    around += [look.postures[rng.choice(hollow, AROUND)]] if len(hollow) else []
    for postures in around:
        drawn = _about(arm, postures, DRAWN * COPIES * len(postures), rng)
        new = drawn[_closest(work, drawn, pairs, COPIES * len(postures))]
        look = look.and_more(_looks(work, names, pairs, new, truth))
    return look


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
    solids: PieceSurfaces,
    hopeless: dict[int, Piece],
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
        hopeless: pieces of which no cut is of use, by identity: the other one is to blame.
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
    gaps = [
        0.0 if id(piece) in hopeless else solids.gap(piece, point) for piece, point in zip(both, found, strict=True)
    ]
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


def _evenly(indices: np.ndarray, most: int) -> np.ndarray:
    return indices[:: max(1, len(indices) // most)][:most]
