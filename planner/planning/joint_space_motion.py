"""A motion found by a search in joint space: to a posture on the imitated path from which the rest can be followed."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..control.inverse_kinematics import inverse_kinematics
from ..control.pursuit import ARRIVED
from ..geometry.pose import Pose, PosePath
from ..imitation.tsia import guide_index, imitated_path
from ..ranges import ticks_of
from ..resumable import SOLVED, Resumable
from ..robot.arm import Arm
from ..safety.guarded_pursuit import roll_out
from ..search.joint_paths import JointPaths
from ..search.joint_space_rrt import sample_ranges
from .planning_scene import PlanningScene

if TYPE_CHECKING:
    from .settings import PlanSettings


ROUND_SHRINK, MIN_ITERATIONS = 4, 100
"""Factor by which each earlier round takes fewer samples, since most paths are found soon or not at all; and the least
number of samples."""
INFEASIBLE_COST = 100.0
"""Cost [rad] of a posture from which a required next motion is infeasible."""
SEED_SPREAD = 0.5
"""Standard deviation [rad] of the starts of the inverse kinematics around the nearest posture."""
MAX_DEVIATION, CHECK_EVERY = 0.004, 3
"""Largest deviation [m] of a motion without detours from its path; and ticks between checks of it."""
RAMP = 0.3
"""Seconds from rest to full speed."""


IK_OR_LIMIT, NO_CLEAR_POSTURE, NO_JOINT_PATH = "ik_or_limit", "no clear posture", "no path in joint space"
DEEP_CONTACT = "an allowed contact is deeper on the way"
"""Reasons of a failed search: no posture, or none from which the rest of the path can be followed; every posture is in
collision; no path leads to a posture."""


class JointSpaceMotion(NamedTuple):
    """The result of a search.

    Attributes:
        joints: (t, dof) joints at every tick.
        path: the part of the imitated path that is followed at the end.
        guide: index in the imitated path at which that part begins.
        margin: smallest joint margin [rad].
        next_feasible: the next motion is possible from its end.
    """

    joints: np.ndarray
    path: PosePath
    guide: int
    margin: float
    next_feasible: bool


class SearchFailure(NamedTuple):
    """A search without success.

    Attributes:
        reason: IK_OR_LIMIT, NO_CLEAR_POSTURE, NO_JOINT_PATH or DEEP_CONTACT.
        detail: the facts of this case; "" if there is no more to say.
    """

    reason: str
    detail: str


class NextMotionCheck(NamedTuple):
    """Check of the motion that follows.

    Attributes:
        scene: the arm among the obstacles, with the contacts that are wanted then.
        path: of the tcp.
        required: the motion must be possible from the end of the plan.
    """

    scene: PlanningScene
    path: PosePath
    required: bool

    def is_feasible(self, arm: Arm, work: np.ndarray, q: np.ndarray, settings: PlanSettings) -> Resumable[bool]:
        """Return whether the motion can be followed; a required one without leaving its path.

        Args:
            arm: the arm.
            work: the arm, its controller and pursuit, see `arm_arrays`.
            q: (dof,) joints at its start.
            settings: of the planner.
        """
        joints, _ = yield from _followed(self.scene, work, self.path, q, settings)
        return joints is not None and (not self.required or path_deviation(arm, joints, self.path.dqs) <= MAX_DEVIATION)


def path_deviation(arm: Arm, joints: np.ndarray, path: np.ndarray) -> float:
    """Return the largest distance [m] of the tool from a path.

    Args:
        arm: the arm.
        joints: (t, dof) of the motion.
        path: (n, 8) poses of the tool.
    """
    edges = PosePath(path).positions
    starts, ways = edges[:-1], np.diff(edges, axis=0)
    if len(ways) == 0:
        starts, ways = edges, np.zeros((1, 3))
    lengths = np.maximum((ways * ways).sum(axis=1), 1e-12)
    farthest = 0.0
    for q in joints[::CHECK_EVERY]:
        from_start = arm.fk(q).position - starts
        part = np.clip((from_start * ways).sum(axis=1) / lengths, 0.0, 1.0)
        farthest = max(farthest, float(np.linalg.norm(from_start - part[:, None] * ways, axis=1).min()))
    return farthest


class _Posture(NamedTuple):
    """A clear posture on the imitated path: at first with the least cost that it can have, without a tail."""

    cost: float
    order: int
    q: np.ndarray
    path: PosePath
    guide: int
    tail: np.ndarray | None = None
    next_feasible: bool = True


def plan_joint_space(
    arm: Arm,
    scene: PlanningScene,
    work: np.ndarray,
    demonstrated: PosePath,
    goal: Pose,
    q: np.ndarray,
    settings: PlanSettings,
    check: NextMotionCheck | None,
    seed: int,
    *,
    must_keep: bool = False,
) -> Resumable[JointSpaceMotion | SearchFailure]:
    """Search a path in joint space to the goal, imitating the end of the demonstration.

    Args:
        arm: the arm.
        scene: the arm among obstacles.
        work: the arm, its controller and pursuit, see `arm_arrays`.
        demonstrated: the path to imitate.
        goal: pose of the tcp at the end.
        q: (dof,) joints at the start.
        settings: see `PlanSettings`.
        check: check of the next motion; None: there is none.
        seed: of all random choices.
        must_keep: the imitated path is not joined at its last pose.

    Returns:
        The motion, or why the last round found none.
    """
    search = settings.search
    assert search is not None
    rng, paths = np.random.default_rng(abs(seed)), JointPaths(arm.dof, search.nodes, seed)
    failure = SearchFailure(IK_OR_LIMIT, "")
    for turn in range(search.rounds):
        later = search.rounds - 1 - turn
        iterations = max(search.iterations // ROUND_SHRINK**later, min(MIN_ITERATIONS, search.iterations))
        found, failure = yield from _postures(
            arm, scene, work, demonstrated, goal, q, settings, check, rng, search.seeds * 2**turn, must_keep
        )
        best, least = None, math.inf
        for posture in found:
            if posture.cost >= least:
                break  # no path is shorter than the straight line
            seen = scene.with_contacts_as_at(q, posture.q)
            points = yield from paths.connected(seen, q, posture.q, search.step, iterations, search.shortcuts)
            if points is not None:
                cost = posture.cost + _length(points) - float(np.abs(posture.q - q).max())
                if cost < least:
                    best, least = (points, posture), cost
        if best is not None and (least < INFEASIBLE_COST or later == 0):
            points, posture = best
            assert posture.tail is not None
            timed_joints = timed_on_lines(points, search.speed * arm.velocity_limits, settings.motion.dt)
            joints = np.vstack([timed_joints[:-1], posture.tail])
            if not scene.keeps_contacts(joints):
                failure = SearchFailure(DEEP_CONTACT, "on the way to the path")
                continue
            margin = min(arm.margin(row) for row in joints)
            return JointSpaceMotion(joints, posture.path, posture.guide, margin, posture.next_feasible)
    return failure


def _length(points: np.ndarray) -> float:
    """Length [rad] of a joint path (n, dof), by the joint that moves most on each line."""
    return float(np.abs(np.diff(points, axis=0)).max(axis=1).sum())


def _postures(
    arm, scene, work, demonstrated, goal, q, settings, check, rng, seeds, must_keep
) -> Resumable[tuple[list[_Posture], SearchFailure]]:
    """Return the best clear postures on the imitated path from which the rest of it can be followed, the best first.

    And the failure that it would be if no path led to any of them. The rest is followed only from postures that can
    still be among the best.
    """
    clear, collision = yield from _clear_postures(arm, scene, demonstrated, goal, q, settings, rng, seeds, must_keep)
    search, found, deep = settings.search, [], False
    for posture in sorted(clear):
        if len(found) == search.postures and posture.cost >= found[-1].cost:
            break
        tail, margin = yield from _followed(scene, work, posture.path, posture.q, settings)
        if tail is None:
            continue
        if not scene.keeps_contacts(np.vstack([q, tail])):
            deep = True
            continue
        cost = posture.cost + (10.0 if margin < search.margin else 0.0)
        next_feasible = check is None or (yield from check.is_feasible(arm, work, tail[-1], settings))
        if not next_feasible:
            assert check is not None
            cost += INFEASIBLE_COST if check.required else 5.0
        found = sorted([*found, posture._replace(cost=cost, tail=tail, next_feasible=next_feasible)])
        found = found[: search.postures]
    return found, _failure(scene, len(found), len(clear), collision, deep)


def _clear_postures(
    arm, scene, demonstrated, goal, q, settings, rng, seeds, must_keep
) -> Resumable[tuple[list[_Posture], np.ndarray | None]]:
    """Return the clear postures on the imitated path, each with its least cost; and the first in collision."""
    search, found, collision = settings.search, [], None
    imitated = imitated_path(demonstrated, goal)
    first, last = guide_index(imitated, settings.motion.guide), len(imitated) - 1
    home, (low, high) = np.clip(q, arm.lower, arm.upper), sample_ranges(arm.lower, arm.upper, q)
    indices = {round(i) for i in np.linspace(first, last, search.targets)}
    for index in sorted((indices - {last} or indices) if must_keep else indices):
        path = imitated[index:]
        near = inverse_kinematics(arm, path[0], home, iterations=150)
        late = search.late * (index - first) / max(last - first, 1)
        for k in range(seeds):
            guess = home if k == 0 and seeds == search.seeds else rng.uniform(low, high)
            if k % 2 and near is not None:  # around the nearest posture the same elbow is found turned
                guess = np.clip(near + rng.normal(0.0, SEED_SPREAD, arm.dof), low, high)
            solution = inverse_kinematics(arm, path[0], guess, iterations=150)
            yield SOLVED
            if solution is None:
                continue
            if scene.slack(solution) < 0.0:
                collision = solution if collision is None else collision
                continue
            cost = float(np.abs(solution - q).max()) + late
            found.append(_Posture(cost, len(found), solution, path, index))
    return found, collision


def _failure(scene: PlanningScene, found: int, clear: int, collision: np.ndarray | None, deep: bool) -> SearchFailure:
    """Return why no path leads to a goal that `found` postures were found for, of `clear` that are in no collision."""
    if found:
        return SearchFailure(NO_JOINT_PATH, f"none leads to any of {found} postures")
    if deep:
        return SearchFailure(DEEP_CONTACT, "the rest of the path leads through what it may touch at its ends")
    if clear:
        return SearchFailure(IK_OR_LIMIT, f"the rest of the path cannot be followed from any of {clear} postures")
    if collision is not None:
        return SearchFailure(NO_CLEAR_POSTURE, f"in the first of those found {scene.tightest(collision)}")
    return SearchFailure(IK_OR_LIMIT, "")


def _followed(scene, work, path, q, settings) -> Resumable[tuple[np.ndarray | None, float]]:
    """Joints of following a path from q among the obstacles, or None; and the smallest joint margin."""
    dt = settings.motion.dt
    trace = np.empty((ticks_of(settings.max_seconds, dt) + 1, len(q)))
    found = yield from roll_out(work, scene.robot, path.dqs, q, dt, trace)
    return (found.joints.copy() if found.status == ARRIVED else None), found.margin


def timed_on_lines(points: np.ndarray, speeds: np.ndarray, dt: float) -> np.ndarray:
    """Return joints at every tick on the straight lines between points, each line from rest to rest.

    A corner taken at speed would throw the held object about.

    Args:
        points: (n, dof) joints [rad or m].
        speeds: (dof,) largest joint speeds [rad/s or m/s].
        dt: seconds per tick.
    """
    rows = [points[:1]]
    for start, end in pairwise(points):
        least = max(float((np.abs(end - start) / speeds).max()), dt)  # seconds at full speed
        ramp = min(RAMP, math.sqrt(least * RAMP))
        total = max(least, ramp) + ramp
        t = np.linspace(0.0, total, math.ceil(total / dt) + 1)[1:]
        begun, left = t * t / (2.0 * least * RAMP), (total - t) ** 2 / (2.0 * least * RAMP)
        part = np.where(t <= ramp, begun, np.where(total - t <= ramp, 1.0 - left, (t - 0.5 * ramp) / least))
        rows.append(start + part[:, None] * (end - start))
    return np.vstack(rows)
