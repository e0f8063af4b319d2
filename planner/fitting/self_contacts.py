"""Pairs of an arm's own parts that can hit each other at all, over the whole range of the joints between them.

Parts that always touch (a link and what is bolted to it), or that never can, need no check; for the others the hulls
decide. Not in the paper, which moves a point.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from ..collision.capsule_placement import place_capsules
from ..collision.clearance import capsule_distance
from ..collision.hull_distance import CLOSE, asks_hulls, pair_hull_distance
from ..collision.robot_arrays import PAIR, ROW, robot_arrays
from ..geometry.shapes import pack
from ..jit import inner, kernel
from ..robot.arm import Arm
from ..robot.body import BODY, Body
from ..robot.kinematics import CHAIN, REVOLUTE
from .link_pieces import SWEPT, Piece, owners_of
from .mesh_distances import MeshDistances

POSTURES, TRIES, STARTS = 4000, 300, 5
"""Random postures that are looked at; steps of a descent to the least distance of a pair, and number of descents."""
TOUCH = 0.002
"""Distance [m] that two parts never fall below if they count as unable to touch: for a model's own inaccuracy."""
NEAR, MOSTLY, RESTING = 0.01, 0.95, 400
"""Distance [m] below which two parts, in this share of all postures, count as resting against each other; and number
of postures in which their meshes are asked about it."""
SHARE = 0.5
"""Share of the distance of two parts in the median posture that they are asked to keep at most."""


class Survey(NamedTuple):
    """Distances of an arm's own capsules in random postures.

    Attributes:
        postures: (m, dof) [rad or m].
        pairs: (n, 2) capsules of the pairs; pairs of neighboring links are left out.
        distances: (m, n) [m], by the hulls where they are below `hull_distance.CLOSE`.
    """

    postures: np.ndarray
    pairs: np.ndarray
    distances: np.ndarray

    def by_parts(self, labels: Sequence[str]) -> dict[tuple[str, str], np.ndarray]:
        """Return the pairs' indices for every pair of parts.

        Args:
            labels: (m,) of the part that each capsule covers, see `Piece.label`.
        """
        found = defaultdict(list)
        for k, (i, j) in enumerate(self.pairs):
            found[labels[i], labels[j]].append(k)
        return {names: np.array(indices) for names, indices in found.items()}


@inner
def _distance(g, i, j):
    """Distance of two capsules' contents, by their hulls if they are close."""
    distance = capsule_distance(g, ROW.placed, i, j)
    if asks_hulls(g, i, j, distance):
        distance = max(distance, pair_hull_distance(g, ROW.placed, i, j, math.inf)[0])
    return distance


@kernel
def _measure(g, postures, pairs, out):
    """Write the distances (m, n) of pairs (n, 2) in postures (m, dof)."""
    for k in range(len(postures)):
        place_capsules(g, postures[k], ROW.placed)
        for p in range(len(pairs)):
            out[k, p] = _distance(g, int(pairs[p, PAIR.first]), int(pairs[p, PAIR.second]))


@kernel
def _descend(g, q, i, j, lower, upper, steps, trial):
    """Return the least distance of a pair that random steps (n, dof) from joints q find; q ends there."""
    place_capsules(g, q, ROW.placed)
    least = _distance(g, i, j)
    for k in range(len(steps)):
        for d in range(len(q)):
            trial[d] = min(max(q[d] + steps[k, d], lower[d]), upper[d])
        place_capsules(g, trial, ROW.placed)
        distance = _distance(g, i, j)
        if distance < least:
            least = distance
            for d in range(len(q)):
                q[d] = trial[d]
    return least


def _ranges(arm: Arm) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper end of the joints' ranges, of a joint that turns one turn at most."""
    turn = math.pi
    lower = np.where(np.isfinite(arm.lower), arm.lower, -turn)
    upper = np.where(np.isfinite(arm.upper), arm.upper, turn)
    wide = (upper - lower > 2.0 * turn) & (arm.chain[:-1, CHAIN.kind] == REVOLUTE)
    return np.where(wide, -turn, lower), np.where(wide, turn, upper)


def survey_of(arm: Arm, body: Body, count: int = POSTURES) -> Survey:
    """Measure the distances of an arm's own capsules in random postures.

    Args:
        arm: the arm.
        body: its capsules and hulls.
        count: number of postures.
    """
    frames = body.rows[:, BODY.frame]
    some = [(i, j) for i, j in combinations(range(len(body)), 2) if abs(frames[i] - frames[j]) > 1]
    pairs = np.array(some, dtype=int).reshape(-1, 2)
    rng = np.random.default_rng(0)
    postures = rng.uniform(*_ranges(arm), (count, arm.dof))
    work = robot_arrays((arm,), (body,), pack(()))
    return Survey(postures, pairs, distances_of_pairs(work, postures, pairs))


def distances_of_pairs(work: np.ndarray, postures: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return the distances (m, n) [m] of an arm's own capsules, by the hulls where they are below `CLOSE`.

    Args:
        work: array of the arm and its body, see `robot_arrays`.
        postures: (m, dof) [rad or m].
        pairs: (n, 2) capsules.
    """
    distances = np.empty((len(postures), len(pairs)))
    _measure(work, postures, pairs.astype(np.float64), distances)
    return distances


def rest_on_each_other(survey: Survey, indices: np.ndarray, truth: MeshDistances, names: tuple[str, str]) -> bool:
    """Return whether two parts are near each other in nearly all postures: by their hulls, and by their meshes.

    Args:
        survey: of the body.
        indices: of the pairs of their capsules.
        truth: distances of the meshes.
        names: of the parts.
    """
    if (survey.distances[:, indices] < NEAR).any(axis=1).mean() < MOSTLY:
        return False
    return bool(np.mean([truth.between(names, q) < NEAR for q in survey.postures[:RESTING]]) >= MOSTLY)


def possible_contacts(
    arm: Arm, body: Body, pieces: Sequence[Piece], truth: MeshDistances
) -> tuple[Body, tuple[str, ...]]:
    """Return a body with the pairs of its capsules that can hit each other, and what is doubtful about them.

    Neighboring links are left out: the joint between them keeps them apart. Parts that pass close by each other in
    ordinary postures get a margin of their own, which those postures keep.

    Args:
        arm: the arm.
        body: its capsules and hulls.
        pieces: what these cover.
        truth: distances of the meshes, which decide where hulls touch.
    """
    survey = survey_of(arm, body)
    least = survey.distances.min(axis=0)
    rng, work = np.random.default_rng(1), robot_arrays((arm,), (body,), pack(()))
    kept: list[tuple[int, int]] = []
    resting: list[tuple[str, str]] = []
    margins: dict[tuple[int, int], float] = {}
    for names, indices in survey.by_parts([piece.label for piece in owners_of(body, pieces)]).items():
        if rest_on_each_other(survey, indices, truth, names):
            resting.append(names)
            continue
        for k in indices:
            least[k] = _least(arm, survey, work, k, rng)
        touch = least[indices].min() <= TOUCH
        if touch:
            near = survey.distances[:, indices].min(axis=1)
            touch = _least_truth(arm, truth, names, survey.postures[np.argsort(near)[:STARTS]], rng) <= TOUCH
        if touch:
            # the others of these parts count too where they come close, so that the distance of the parts is right
            pairs = [(int(i), int(j)) for i, j in survey.pairs[indices[least[indices] <= CLOSE]]]
            kept += pairs
            usual = SHARE * float(np.median(survey.distances[:, indices].min(axis=1)))
            if usual < CLOSE:
                margins |= dict.fromkeys(pairs, max(usual, 0.0))
    return replace(body, pairs=tuple(sorted(kept)), margins=margins), _swept_through(resting)


def _swept_through(resting: Sequence[tuple[str, str]]) -> tuple[str, ...]:
    """Return a line for each part that sweeps through others in nearly all postures, so that it is not checked."""
    through: dict[str, set[str]] = defaultdict(set)
    for names in resting:
        for mine, other in (names, names[::-1]):
            if mine.endswith(SWEPT):
                through[mine.removesuffix(SWEPT)].add(other.removesuffix(SWEPT))
    return tuple(
        f"{mine}: joints that are not the arm's sweep what hangs on it through {', '.join(sorted(others))} in nearly "
        "all postures, so that these are not checked against it; hold the joints with `locked`"
        for mine, others in through.items()
    )


def _least(arm: Arm, survey: Survey, work: np.ndarray, k: int, rng: np.random.Generator) -> float:
    """Least distance [m] of a pair over all postures, as descents find it."""
    least, (i, j), (lower, upper) = float(survey.distances[:, k].min()), survey.pairs[k], _ranges(arm)
    for start in survey.postures[np.argsort(survey.distances[:, k])[:STARTS]]:
        if least > TOUCH:
            steps = _steps(arm, rng)
            least = min(least, _descend(work, start.copy(), i, j, lower, upper, steps, np.empty(arm.dof)))
    return least


def _steps(arm: Arm, rng: np.random.Generator) -> np.ndarray:
    """Random steps (n, dof) of a descent, from large to small."""
    lower, upper = _ranges(arm)
    return np.geomspace(0.3, 0.003, TRIES)[:, None] * (upper - lower) * rng.normal(size=(TRIES, arm.dof))


def _least_truth(
    arm: Arm, truth: MeshDistances, names: tuple[str, str], starts: np.ndarray, rng: np.random.Generator
) -> float:
    """Least distance [m] of two parts' meshes over all postures, as descents find it; any below `TOUCH` ends it."""
    (lower, upper), least = _ranges(arm), math.inf
    for start in starts:
        q, here = start, truth.between(names, start)
        for step in _steps(arm, rng):
            least = min(least, here)
            if least <= TOUCH:
                return least
            trial = np.clip(q + step, lower, upper)
            there = truth.between(names, trial)
            if there < here:
                q, here = trial, there
    return least
