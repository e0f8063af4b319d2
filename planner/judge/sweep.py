"""Clearance of a moving body from moving obstacles, including between the samples of its motion.

Not in the paper. The distance of a capsule to an obstacle changes by no more than the displacement of the capsule's
core relative to the obstacle. So over an interval with distances D(a) and D(b) at its ends, in which no point of the
core is displaced farther than L, the distance never falls below (D(a) + D(b) - L) / 2; where that is too little, the
interval is halved.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..log.motion_log import MotionLog
from ..ranges import check_ranges
from ..robot.body import BODY
from ..robot.kinematics import CHAIN
from .geometry import CollisionWorld, Kinematics, Moment

BATCH = 2048
"""Number of intervals processed at once: bounds the memory."""


@dataclass(frozen=True)
class SweepSettings:
    """Accuracy and effort of a sweep.

    Attributes:
        resolution: an interval in which nothing moves farther [m] is not halved.
        slack: largest gap [m] between the bound and the smallest distance found, for every name.
        max_intervals: largest number of examined intervals before the sweep stops undecided.
    """

    resolution: float = 1e-6
    slack: float = 5e-4
    max_intervals: int = 200_000

    def __post_init__(self):
        check_ranges(self, "(0, inf)", "resolution", "slack", "max_intervals")


@dataclass
class Sweep:
    """Result of a sweep, for every capsule and obstacle (m, k).

    Attributes:
        sampled: smallest computed distances [m], or lower bounds of them where another pair is nearer; inf: never.
        certified: lower bounds of all distances during the motion [m].
        when: times of the smallest computed distances [s].
        intervals: number of examined pairs over an interval.
        complete: True if `max_intervals` sufficed.
    """

    sampled: np.ndarray
    certified: np.ndarray
    when: np.ndarray
    intervals: int = 0
    complete: bool = True


@dataclass
class _Batch:
    """Intervals between moments, the pairs (interval, capsule, obstacle) still open in them, and their distances.

    Attributes:
        a: starts.
        b: ends.
        cells: (c, 3) indices: interval, capsule, obstacle.
        distances: (c, 2) at the starts and the ends [m].
    """

    a: Moment
    b: Moment
    cells: np.ndarray
    distances: np.ndarray

    def part(self, which: slice | np.ndarray) -> _Batch:
        """Select pairs, with their intervals only."""
        cells = self.cells[which]
        used, n = np.unique(cells[:, 0], return_inverse=True)
        cells = np.column_stack([n.ravel(), cells[:, 1:]])
        return _Batch(self.a.at(used), self.b.at(used), cells, self.distances[which])


def travel(kinds: np.ndarray, frames: np.ndarray, a: Moment, b: Moment, shift: np.ndarray) -> np.ndarray:
    """Bound the displacement (c,) [m] of any point of a core relative to an obstacle, joints moving linearly.

    The smaller of two bounds. Rotations: every joint by its own angle, times the largest distance of the point to the
    joint's axis; the joints beyond alone change that distance, from either end of the interval. Speeds: the trapezoid
    of the speeds at the ends, plus a quarter of the largest acceleration, |x''| <= sum_ij |dq_i dq_j| r_max(i, j).

    Args:
        kinds: (dof,) 0 for a revolute joint, 1 for a prismatic one.
        frames: (c,) joint that each core moves with, -1 for the base.
        a: start of each core's interval; its `ends` (c, 2, 3) are of that core alone.
        b: end of each core's interval.
        shift: (c, 3) displacement of each obstacle [m].
    """
    dq = b.joints - a.joints
    active = np.arange(len(kinds)) <= frames[:, None]
    size = np.where(active, np.abs(dq), 0.0)
    speeds, far = [], []
    for moment in (a, b):
        arms = moment.ends[:, :, None] - moment.origins[:, None]
        levers = np.cross(moment.axes[:, None], arms)
        far.append(np.linalg.norm(levers, axis=-1))
        displacements = np.where((kinds == 0)[:, None], levers, moment.axes[:, None])
        velocity = np.einsum("cejx,cj->cex", displacements, np.where(active, dq, 0.0)) - shift[:, None]
        speeds.append(np.linalg.norm(velocity, axis=-1))
    reach = np.where(kinds == 0, np.maximum(*far), 1.0)
    beyond, bend = np.zeros(reach.shape[:2]), np.zeros(reach.shape[:2])
    for j in range(len(kinds))[::-1]:
        radius = reach[:, :, j] + (0.5 * beyond if kinds[j] == 0 else 0.0)
        before = size[:, None, :j].sum(axis=-1)
        bend += radius * size[:, None, j] * (size[:, None, j] + 2.0 * before)
        beyond = beyond + radius * size[:, None, j]
    turns = beyond + np.linalg.norm(shift, axis=-1)[:, None]
    return np.minimum(turns, 0.5 * (speeds[0] + speeds[1]) + 0.25 * bend).max(axis=1)


class Sweeper:
    """One sweep over a log."""

    def __init__(self, log: MotionLog, required: np.ndarray, aim: float, settings: SweepSettings):
        """Prepare.

        Args:
            log: the motion.
            required: (m, k) required distances [m], -inf for pairs that are not checked.
            aim: claimed smallest distance of all [m], -inf for none.
            settings: accuracy and effort.
        """
        body = log.body
        self._required, self._aim, self._settings = required, aim, settings
        self._kinds, self._frames = log.arm.chain[:-1, CHAIN.kind], body.rows[:, BODY.frame].astype(int)
        self._group = np.array([body.names.index(name) for name in body.names], dtype=int)
        self.kinematics, self._scene = Kinematics(log.arm, body), CollisionWorld(body, log.obstacles)
        self.moment = self.kinematics.moment(log.time, log.joints)
        shape = required.shape
        self.found = Sweep(np.full(shape, np.inf), np.full(shape, np.inf), np.full(shape, log.time[0]))

    def run(self) -> Sweep:
        """Examine the samples, then the intervals between them until everything is decided."""
        if not self._required.size:
            return self.found
        stack = self._between(*self._samples())
        while stack:
            batch = stack.pop()
            if len(batch.cells) > 2 * BATCH:
                stack += [batch.part(slice(None, BATCH)), batch.part(slice(BATCH, None))]
                continue
            self.found.intervals += len(batch.cells)
            self.found.complete &= self.found.intervals <= self._settings.max_intervals
            stack += self._halved(batch)
        return self.found

    def smallest(self, which: np.ndarray) -> np.ndarray:
        """Return the smallest distances (m, k) [m] at the samples, of pairs that a mask (m, k) selects; else inf."""
        out, pairs = np.full(which.shape, np.inf), np.argwhere(which)
        for n in range(len(self.moment.time)):
            cells = np.column_stack([np.full(len(pairs), n), pairs])
            out[which] = np.minimum(out[which], self._scene.distances(self.moment, cells))
        return out

    def _swing(self, k: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Bound the displacement (c,) [m] of points of the hulls of capsules k beyond that of their cores.

        No point of what a capsule covers is farther from its core than the radius.
        """
        turns = np.where(
            (np.arange(len(self._kinds)) <= self._frames[k, None]) & (self._kinds == 0), np.abs(b - a), 0.0
        )
        return np.where(np.array(self._scene.hulls)[k], self._scene.radii[k], 0.0) * turns.sum(axis=1)

    def _record(self, cells: np.ndarray, times: np.ndarray, distances: np.ndarray) -> None:
        (_, k, o), found = cells.T, self.found
        np.minimum.at(found.sampled, (k, o), distances)
        nearest = distances <= found.sampled[k, o]
        found.when[k[nearest], o[nearest]] = times[nearest]

    def _samples(self) -> tuple[np.ndarray, np.ndarray]:
        """Return distances (n, m, k) [m] at the samples, or lower bounds, and a mask of the exact ones.

        Every distance that may be the smallest is exact.
        """
        out = self._scene.at_least(self.moment)
        out[:, ~np.isfinite(self._required)] = np.inf
        exact = np.zeros(out.shape, dtype=bool)
        for group in np.unique(self._group):
            mine = self._group == group
            best, low = np.inf, np.where(mine[:, None], out, np.inf)
            order = np.argsort(low, axis=None)
            for part in np.array_split(order, max(1, order.size // 64)):
                near = low.ravel()[part] < max(best, self._required.max())
                if not near.any():
                    break
                cells = np.column_stack(np.unravel_index(part[near], out.shape))
                best = min(best, self._measure(out, exact, cells))
        np.minimum(self.found.sampled, out.min(axis=0), out=self.found.sampled)
        np.minimum(self.found.certified, out.min(axis=0), out=self.found.certified)
        return out, exact

    def _measure(self, out: np.ndarray, exact: np.ndarray, cells: np.ndarray) -> float:
        n, k, o = cells.T
        out[n, k, o], exact[n, k, o] = self._scene.distances(self.moment, cells), True
        self._record(cells, self.moment.time[n], out[n, k, o])
        return out[n, k, o].min()

    def _targets(self, cells: np.ndarray) -> np.ndarray:
        """Return bounds (c,) [m] to reach: those required and claimed if still true, and near the distance found."""
        _, k, o = cells.T
        sampled = self.found.sampled
        by_group = np.full(len(self._group), np.inf)
        np.minimum.at(by_group, self._group, sampled.min(axis=1))
        aim = self._aim if self._aim <= sampled.min() else -np.inf
        close = by_group[self._group][k] - self._settings.slack
        wanted = np.maximum(self._required[k, o], aim)
        return np.where(sampled[k, o] < self._required[k, o], close, np.maximum(wanted, close))

    def _between(self, distances: np.ndarray, exact: np.ndarray) -> list[_Batch]:
        """Return the intervals between the samples, with the pairs that a coarse bound leaves open."""
        a, b = self.moment.at(slice(None, -1)), self.moment.at(slice(1, None))
        displacements, still = np.empty((len(a.time), len(self._frames))), np.zeros((len(a.time), 3))
        for k, frame in enumerate(self._frames):
            starts, stops = (m._replace(ends=m.ends[:, k]) for m in (a, b))
            displacements[:, k] = travel(self._kinds, np.full(len(still), frame), starts, stops, still)
            displacements[:, k] += self._swing(np.full(len(still), k), a.joints, b.joints)
        drift = np.abs(b.time - a.time)[:, None] * np.linalg.norm(self._scene.velocities, axis=1)
        bound = 0.5 * (distances[:-1] + distances[1:] - displacements[:, :, None] - drift[:, None])
        every = np.column_stack(np.unravel_index(np.arange(bound.size), bound.shape)).reshape(-1, 3)
        opened = bound.ravel() < self._targets(every)
        for side in (0, 1):
            cells = every[opened] + np.array([side, 0, 0])
            cells = cells[~exact[tuple(cells.T)]]
            if len(cells):
                self._measure(distances, exact, cells)
        self._lower(every[~opened], bound.ravel()[~opened])
        n, k, o = every[opened].T
        both = np.column_stack([distances[n, k, o], distances[n + 1, k, o]])
        return [_Batch(a, b, every[opened], both).part(slice(None))]

    def _lower(self, cells: np.ndarray, bounds: np.ndarray) -> None:
        np.minimum.at(self.found.certified, tuple(cells[:, 1:].T), bounds)

    def _settle(self, batch: _Batch) -> np.ndarray:
        """Return which pairs of a batch are decided, and enter their bounds into the result."""
        n, k, o = batch.cells.T
        a, b, row = batch.a.at(n), batch.b.at(n), np.arange(len(n))
        shift = self._scene.velocities[o] * (b.time - a.time)[:, None]
        starts, stops = (m._replace(ends=m.ends[row, k]) for m in (a, b))
        displacement = travel(self._kinds, self._frames[k], starts, stops, shift) + self._swing(k, a.joints, b.joints)
        bound = 0.5 * (batch.distances.sum(axis=1) - displacement)
        done = (
            (bound >= self._targets(batch.cells))
            | (displacement <= self._settings.resolution)
            | (not self.found.complete)
        )
        self._lower(batch.cells[done], bound[done])
        return done

    def _halved(self, batch: _Batch) -> list[_Batch]:
        """Return the open pairs of a batch with their intervals halved."""
        left = ~self._settle(batch)
        if not left.any():
            return []
        open_ = batch.part(left)
        a, b, cells = open_.a, open_.b, open_.cells
        middle = self.kinematics.moment(0.5 * (a.time + b.time), 0.5 * (a.joints + b.joints))
        distances = self._scene.distances(middle, cells)
        self._record(cells, middle.time[cells[:, 0]], distances)
        first = np.column_stack([open_.distances[:, 0], distances])
        second = np.column_stack([distances, open_.distances[:, 1]])
        cells = np.concatenate([cells, cells + np.array([len(a.time), 0, 0])])
        return [_Batch(a.joined(middle), middle.joined(b), cells, np.concatenate([first, second]))]
