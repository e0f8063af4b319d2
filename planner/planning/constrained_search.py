"""A motion that keeps what a demonstration keeps, found in joint space: carried to the guided stretch, then along it.

First a flood of postures along the guided stretch, backwards from its end: place, deviation within the bounds,
redundancy. What it reaches at the first place leads to the end. Then a search on the constraint leads from where the
arm is to any of these. Both are generators that yield how much they have done: a caller may stop at any time. Not in
the paper.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..constraints.constrained_rrt import connect_keeping, shorten_keeping
from ..constraints.guided_postures import APART, FLOOD, PARTS, edge_along, spread_back
from ..constraints.held_directions import KEPT, packed_constraint
from ..constraints.violation import violation_of
from ..control.arm_arrays import ARM, arm_arrays
from ..control.controller import ControllerSettings
from ..control.inverse_kinematics import inverse_kinematics
from ..control.pursuit import ARRIVED
from ..geometry.pose import Pose, PosePath
from ..imitation.constraint import Constraint
from ..imitation.segmentation import key_poses
from ..imitation.tsia import guide_index, imitated_path
from ..ranges import ticks_of
from ..resumable import TICK, Resumable
from ..robot.arm import Arm
from ..safety.guarded_pursuit import roll_out
from ..search.joint_space_rrt import sample_ranges
from .joint_space_motion import (
    IK_OR_LIMIT,
    NO_CLEAR_POSTURE,
    NO_JOINT_PATH,
    JointSpaceMotion,
    NextMotionCheck,
    SearchFailure,
    timed_on_lines,
)
from .planning_scene import PlanningScene
from .settings import PlanSettings

EVERY = 0.04
"""Path length [m] between two places along the guided stretch."""
MOST = 200
"""Largest number of postures of a place."""
PUSH = 0.3
"""Deviation [rad or m] of a joint by which a posture is pushed along its redundancy."""
USED = 0.85
"""Share of the bounds off the path that postures use: the rest is for the lines between them."""
MOST_ROUNDS, MORE = 2, 3
"""Largest number of rounds, and factor by which the next has more: seeds, postures of a place, tried from each."""
WORTH = 0.5
"""Share of the guided stretch that postures must lead along at first for a further round: others reach no farther."""
STEADY = 0.5
"""Share of the bound against gravity that shortcuts use: a shorter way is not worth a tilt near the bound."""
BRANCHES = 4
"""Postures that are tried from each of the place behind."""
SLICE, SAMPLES, SHORTCUTS = 2, 5, 2
"""Postures led back, samples of a search, and lines tried, between two yields: a few milliseconds."""
POSTURE, SAMPLE, LINE = 200 * TICK, 40 * TICK, 40 * TICK
"""Cost [us] of each."""
NO_GUIDED_WAY = "what the demonstration keeps cannot be kept along the path"
"""Reason: no posture at the beginning of the guided stretch leads along it."""
_SOLVE = ControllerSettings(
    gain=1.0, max_linear=0.15, max_angular=0.5, null_gain=0.0, limit_gain=1.0, damping_threshold=0.03
).packed()
"""Settings of a step of inverse kinematics that stays in its posture."""


class _Flood(NamedTuple):
    """Postures along a path: places (m, 8), joints (m, c, n), links (m, c), numbers (m,)."""

    places: np.ndarray
    nodes: np.ndarray
    links: np.ndarray
    counts: np.ndarray


class ConstrainedSearch:
    """Search of one motion that keeps a constraint.

    Args:
        arm: the arm.
        scene: the arm among obstacles.
        work: the arm, its controller and pursuit, see `arm_arrays`.
        demonstrated: the path to imitate.
        goal: pose of the tcp at the end.
        q: (dof,) joints at the start.
        constraint: of the demonstrated path.
        settings: see `PlanSettings`.
        check: check of the next motion; None: there is none.
        seed: of all random choices.
    """

    def __init__(
        self,
        arm: Arm,
        scene: PlanningScene,
        work: np.ndarray,
        demonstrated: PosePath,
        goal: Pose,
        q: np.ndarray,
        constraint: Constraint,
        settings: PlanSettings,
        check: NextMotionCheck | None,
        seed: int,
    ):
        self.arm, self.scene, self.work, self.q, self.constraint = arm, scene, work, q, constraint
        self.settings, self.check = settings, check
        self.imitated = imitated_path(demonstrated, goal)
        self._kept, self._rng = packed_constraint(constraint), np.random.default_rng(abs(seed))
        self._state = np.array([float(seed % 2147483646) + 1.0])
        self._solver = arm_arrays(arm, _SOLVE)
        self._solver[ARM.speed] = 0.5
        self._low, self._high = sample_ranges(arm.lower, arm.upper, q)
        self._share_led = 1.0
        self._rows, self._scratch = np.empty((PARTS, arm.dof)), np.empty(arm.dof)

    def run(self) -> Resumable[JointSpaceMotion | SearchFailure]:
        """Yield work as it is done; return the motion, or why there is none."""
        search = self.settings.search
        assert search is not None
        failure = SearchFailure(IK_OR_LIMIT, "")
        for turn in range(min(search.rounds, MOST_ROUNDS)):
            for first in self._entries():
                found = yield from self._from(first, search.seeds, search.iterations, MORE**turn)
                if not isinstance(found, SearchFailure):
                    return found
                failure = found
            if self._share_led < WORTH:
                break
        return failure

    def _entries(self) -> list[int]:
        """Indices of the imitated path at which it may be joined, the preferred one first."""
        if self.constraint.guided < self.constraint.count:
            return [self.constraint.last_carried]
        last = len(self.imitated) - 1
        return sorted({guide_index(self.imitated, self.settings.motion.max_guide), last})

    def _from(self, first: int, seeds: int, iterations: int, more: int) -> Resumable[JointSpaceMotion | SearchFailure]:
        """Search a motion that joins the imitated path at a pose, with more postures than at first."""
        flood = yield from self._flooded(self.imitated[first:], more * seeds, more)
        if isinstance(flood, SearchFailure):
            return flood
        count = int(flood.counts[0])
        if not count:
            k = int(np.argmax(flood.counts > 0)) - 1
            share = 1.0 - (k + 1) / max(len(flood.places) - 1, 1)
            self._share_led = share
            return SearchFailure(
                NO_GUIDED_WAY, f"postures lead along no more than the last {100.0 * share:.0f} % of it"
            )
        entries = flood.nodes[0, :count]
        order = np.argsort(np.abs(entries - self.q).max(axis=1), kind="stable")
        points = yield from self._way(entries[order], iterations)
        if points is None:
            return SearchFailure(NO_JOINT_PATH, f"none that keeps the constraint leads to any of {count} postures")
        entry = int(order[np.abs(entries[order] - points[-1]).max(axis=1).argmin()])
        return (yield from self._motion(points, flood, entry, first))

    def _flooded(self, path: PosePath, seeds: int, more: int) -> Resumable[_Flood | SearchFailure]:
        """Lead the postures of the end of a path back to its beginning."""
        length = float(path.lengths()[-1]) if len(path) > 1 else 0.0
        places = key_poses(path, max(2, int(np.ceil(length / EVERY)) + 1)).dqs if length > 0.0 else path.dqs[-1:]
        count = len(places)
        room = more * MOST
        flood = _Flood(places, np.zeros((count, room, self.arm.dof)), np.full((count, room), -1.0), np.zeros(count))
        failure = yield from self._ends(flood, seeds)
        if failure is not None:
            return failure
        options = np.empty(FLOOD.width)
        options[FLOOD.position] = USED * self.constraint.position_bound
        options[FLOOD.rotation] = USED * self.constraint.rotation_bound
        options[FLOOD.push], options[FLOOD.branches] = PUSH, more * BRANCHES
        for place in range(count - 1, 0, -1):
            for k in range(0, int(flood.counts[place]), SLICE):
                last = min(k + SLICE, int(flood.counts[place]))
                spread_back(
                    self.scene.seen, self._solver, places, place, place - 1, flood.nodes, flood.links, flood.counts,
                    k, last, options, self._state, self._rows,
                )  # fmt: skip
                yield POSTURE * (last - k)
            if not flood.counts[place - 1]:
                break
        return flood

    def _ends(self, flood: _Flood, seeds: int) -> Resumable[SearchFailure | None]:
        """Find postures at the last place."""
        nodes, goal, collision = flood.nodes[-1], Pose(flood.places[-1]), None
        fallback = []
        for k in range(seeds):
            guess = (
                np.clip(self.q, self.arm.lower, self.arm.upper) if k == 0 else self._rng.uniform(self._low, self._high)
            )
            q = inverse_kinematics(self.arm, goal, guess, iterations=150)
            yield POSTURE
            if q is None:
                continue
            if self.scene.slack(q) < 0.0:
                collision = q if collision is None else collision
                continue
            count = int(flood.counts[-1])
            if count == len(nodes) or (count and np.abs(nodes[:count] - q).max(axis=1).min() < APART):
                continue
            if not (yield from self._next_is_feasible(q)):
                fallback.append(q)
                continue
            nodes[count], flood.counts[-1] = q, count + 1
        if not flood.counts[-1] and fallback:
            flood.counts[-1] = min(len(fallback), len(nodes))
            nodes[: int(flood.counts[-1])] = fallback[: len(nodes)]
        if flood.counts[-1]:
            return None
        if collision is None:
            return SearchFailure(IK_OR_LIMIT, "")
        return SearchFailure(NO_CLEAR_POSTURE, f"in the first of those found {self.scene.tightest(collision)}")

    def _next_is_feasible(self, q: np.ndarray) -> Resumable[bool]:
        check = self.check
        return check is None or (yield from check.is_feasible(self.arm, self.work, q, self.settings))

    def _way(self, entries: np.ndarray, iterations: int) -> Resumable[np.ndarray | None]:
        """Search joints (n, dof) from the start to any of some postures, on the constraint."""
        search = self.settings.search
        assert search is not None
        room = search.nodes + len(entries)
        trees, parents = np.empty((2, room, self.arm.dof)), np.full((2, room), -1.0)
        counts, out = np.array([1.0, float(len(entries))]), np.empty((2 * room, self.arm.dof))
        trees[0, 0], trees[1, : len(entries)] = self.q, entries
        seen = self.scene.with_contacts_as_at(self.q, entries[0])
        found = 0
        for first in range(0, iterations, SAMPLES):
            found = connect_keeping(
                seen, self._solver, self._kept, self._low, self._high, trees, parents, counts, first, SAMPLES,
                search.step, self._state, out,
            )  # fmt: skip
            yield SAMPLE * SAMPLES
            if found:
                break
        if found <= 0:
            return None
        ends, steady = np.empty((2, self.arm.dof)), self._kept.copy()
        steady[0, KEPT.bound] *= STEADY
        for _ in range(0, search.shortcuts, SHORTCUTS):
            found = shorten_keeping(seen, self._solver, steady, out, found, SHORTCUTS, self._state, ends)
            yield LINE * SHORTCUTS
        return out[:found].copy()

    def _motion(
        self, points: np.ndarray, flood: _Flood, entry: int, first: int
    ) -> Resumable[JointSpaceMotion | SearchFailure]:
        """The motion along joints to a posture on the path, and on along it."""
        search, dt = self.settings.search, self.settings.motion.dt
        assert search is not None
        speeds = search.speed * self.arm.velocity_limits
        path = self.imitated[first:]
        tail = yield from self._followed(path, points[-1])
        if tail is None:
            tail = timed_through(self._rest(flood, entry), speeds, dt)
        joints = np.vstack([timed_on_lines(points, speeds, dt)[:-1], tail])
        if not self.scene.keeps_contacts(joints):
            return SearchFailure(NO_JOINT_PATH, "an allowed contact is deeper on the way")
        margin = min(self.arm.margin(row) for row in joints)
        return JointSpaceMotion(joints, path, first, margin, (yield from self._next_is_feasible(joints[-1])))

    def _rest(self, flood: _Flood, entry: int) -> np.ndarray:
        """Joints (n, dof) of the flood from a posture at its first place to the end."""
        rows, k = [flood.nodes[0, entry].copy()], entry
        for place in range(len(flood.places) - 1):
            behind = int(flood.links[place, k])
            end = flood.nodes[place + 1, behind]
            count = edge_along(self.scene.seen, self._solver, rows[-1], end, self._rows, self._scratch)
            rows += list(self._rows[:count].copy())
            k = behind
        return np.array(rows)

    def _followed(self, path: PosePath, q: np.ndarray) -> Resumable[np.ndarray | None]:
        """Joints of following a path from a posture, if it keeps the constraint; smoother than those of the flood."""
        dt = self.settings.motion.dt
        trace = np.empty((ticks_of(self.settings.max_seconds, dt) + 1, self.arm.dof))
        found = yield from roll_out(self.work, self.scene.robot, path.dqs, q, dt, trace)
        joints = found.joints
        if found.status != ARRIVED:
            return None
        poses = PosePath(np.array([self.arm.fk(row).dq for row in joints]))
        return joints.copy() if violation_of(self.constraint, self.imitated, poses).kept else None


def timed_through(points: np.ndarray, speeds: np.ndarray, dt: float) -> np.ndarray:
    """Return joints at every tick through near points without a rest at each, from rest to rest.

    Args:
        points: (n, dof) joints [rad or m], near enough that the corners between them are none.
        speeds: (dof,) largest joint speeds [rad/s or m/s].
        dt: seconds per tick.
    """
    seconds = np.concatenate([[0.0], np.cumsum((np.abs(np.diff(points, axis=0)) / speeds).max(axis=1))])
    if seconds[-1] <= 0.0:
        return points[:1].copy()
    # the same ramps as on one line: the time at full speed is the place on it
    place = timed_on_lines(np.array([[0.0], [seconds[-1]]]), np.ones(1), dt)[:, 0]
    return np.column_stack([np.interp(place, seconds, column) for column in points.T])
