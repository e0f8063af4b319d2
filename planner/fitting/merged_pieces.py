"""Pieces that were cut apart and that one hull covers just as well, merged again.

A cut is chosen before those that follow it are known, and some turn out to be in vain. Not in the paper, which moves a
point.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from ..collision.hull_distance import CLOSE
from ..collision.robot_arrays import robot_arrays
from ..geometry.shapes import pack
from ..robot.arm import Arm
from ..robot.body import Body
from .link_pieces import Piece, owners_of, volume
from .self_contacts import distances_of_pairs

TOO_CLOSE = 0.002
"""Distance [m] by which hulls may be closer than the surfaces."""
DEEP = 0.004
"""Distance [m] of parts whose hulls touch from which on one counts as in a hollow of the other."""
BULGE = 1.5
"""Largest volume of the hull of two pieces, as a multiple of theirs, at which it is looked whether it does for both."""
SOME = 200
"""Number of corners of a piece, about, that stand for its volume."""
FEW = 8
"""One in so many postures is looked at first: most pairs that cannot be merged are found out there."""
APART = 1e-3
"""Distance [m] of the boxes about two pieces from which on they are no neighbors."""

Names = tuple[str, str]


class Looks(NamedTuple):
    """Postures in which two parts seem close, and the truth about them.

    Attributes:
        postures: (n, dof) [rad or m].
        true: (n,) distances of the parts' meshes [m].
        is_open: (n,) whether hulls seemed too close when last looked at: since they recede, the others need no further
            look, but by whoever merges pieces.
        in_hollow: (n,) whether hulls seemed to touch at first that are far apart: the hollow goes on around.
    """

    postures: np.ndarray
    true: np.ndarray
    is_open: np.ndarray
    in_hollow: np.ndarray

    @classmethod
    def of(cls, postures: np.ndarray, true: np.ndarray, near: np.ndarray) -> Looks:
        """Return first looks.

        Args:
            postures: (n, dof) [rad or m].
            true: (n,) distances of the parts' meshes [m].
            near: (n,) distances of their hulls [m].
        """
        return cls(postures, true, np.ones(len(true), dtype=bool), (near <= 0.0) & (true > DEEP))

    def and_more(self, more: Looks) -> Looks:
        """Return the same and more."""
        return Looks(*(np.concatenate(both) for both in zip(self, more, strict=True)))


def errors_of(distances: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Return by how much (n,) [m] two parts seem closer than they are.

    Args:
        distances: (n, k) of their capsules in n postures, by the hulls [m].
        true: (n,) distances [m]; where they are not above 0, nothing can seem too close.
    """
    near = np.maximum(distances.min(axis=1), 0.0)
    return np.where(true > 0.0, np.minimum(true, CLOSE) - near, -np.inf)


def worst_of(errors: np.ndarray, distances: np.ndarray, count: int) -> np.ndarray:
    """Return the indices of the largest errors: first of every pair of capsules the largest, then any.

    The worst of all often lie in one hollow, and hide others.

    Args:
        errors: (n,) of postures [m].
        distances: (n, k) of the capsules in them [m].
        count: number of indices.
    """
    order = np.argsort(-errors)
    first = np.sort(np.unique(distances[order].argmin(axis=1), return_index=True)[1])
    return order[np.concatenate([first, np.setdiff1d(np.arange(len(order)), first)])[:count]]


class Merger:
    """Merges pieces; what a pair was refused for once holds on, since looks only become more.

    Args:
        arm: the arm.
        cover: makes a body of pieces.
    """

    def __init__(self, arm: Arm, cover: Callable[[list[Piece]], Body]):
        self._arm, self._cover = arm, cover
        self._refused: dict[tuple[int, int], tuple[Piece, Piece, float]] = {}
        self._boxes: dict[int, tuple[Piece, tuple[np.ndarray, np.ndarray]]] = {}
        self._volumes: dict[tuple[int, ...], tuple[tuple[Piece, ...], float]] = {}

    def merged(self, pieces: Sequence[Piece], looks: Mapping[Names, Looks], tolerated: float) -> list[Piece]:
        """Return pieces of which those are merged whose common hull seems nowhere too close, the best pair first.

        Args:
            pieces: to be merged.
            looks: by pair of parts, where the truth is known.
            tolerated: distance [m] by which a hull may seem too close.
        """
        left = list(pieces)
        while True:
            some = [pair for pair in _of_one_part(left) if self._may_merge(*pair, tolerated)]
            pairs = [(self._bulge(*pair), *pair) for pair in some]
            ratio, one, other = min(pairs, key=lambda each: each[0], default=(np.inf, None, None))
            if one is None or other is None or ratio > BULGE:
                return left
            both = one.with_triangles(np.concatenate([one.geometry.triangles, other.geometry.triangles]))
            error = self._error(both, left, looks, tolerated)
            if error <= tolerated:
                left = [both if piece is one else piece for piece in left if piece is not other]
            else:
                self._refused[id(one), id(other)] = one, other, error

    def _may_merge(self, one: Piece, other: Piece, tolerated: float) -> bool:
        """Return whether two pieces of a part are neighbors on one surface that were not refused."""
        if self._refused.get((id(one), id(other)), (one, other, 0.0))[2] > tolerated or one.pose is not other.pose:
            return False
        (low, high), (other_low, other_high) = self._box(one), self._box(other)
        return bool(np.maximum(low - other_high, other_low - high).max() < APART)

    def _box(self, piece: Piece) -> tuple[np.ndarray, np.ndarray]:
        if id(piece) not in self._boxes:
            points = piece.geometry.points
            self._boxes[id(piece)] = piece, (points.min(axis=0), points.max(axis=0))
        return self._boxes[id(piece)][1]

    def _bulge(self, one: Piece, other: Piece) -> float:
        """Volume of the hull of two pieces, as a multiple of theirs, about."""
        return self._volume(one, other) / max(self._volume(one) + self._volume(other), 1e-12)

    def _volume(self, *pieces: Piece) -> float:
        key = tuple(map(id, pieces))
        if key not in self._volumes:
            points = [each.geometry.points[:: 1 + len(each.geometry.points) // SOME] for each in pieces]
            self._volumes[key] = pieces, volume(np.vstack(points))
        return self._volumes[key][1]

    def _error(self, both: Piece, pieces: Sequence[Piece], looks: Mapping[Names, Looks], tolerated: float) -> float:
        """Return by how much [m] a merged piece seems too close to others, or any error above the tolerated one."""
        body_pieces = [both, *(piece for piece in pieces if piece.label != both.label)]
        body = self._cover(body_pieces)
        labels = [piece.label for piece in owners_of(body, body_pieces)]
        work, most = robot_arrays((self._arm,), (body,), pack(())), 0.0
        mine = [k for k, label in enumerate(labels) if label == both.label]
        for names, look in looks.items():
            if both.label not in names:
                continue
            part = names[1] if names[0] == both.label else names[0]
            pairs = np.array([(i, j) for i in mine for j, label in enumerate(labels) if label == part])
            some = np.flatnonzero(look.true > tolerated)  # nothing can seem closer by more than it is
            for few in (some[::FEW], some):
                if most <= tolerated and len(few):
                    distances = distances_of_pairs(work, look.postures[few], pairs)
                    most = max(most, float(errors_of(distances, look.true[few]).max()))
        return most


def _of_one_part(pieces: Sequence[Piece]) -> Iterator[tuple[Piece, Piece]]:
    """Yield the pairs of pieces with a surface that belong to one part."""
    parts: dict[str, list[Piece]] = {}
    for piece in pieces:
        if len(piece.geometry.triangles):
            parts.setdefault(piece.label, []).append(piece)
    for mine in parts.values():
        yield from combinations(mine, 2)
