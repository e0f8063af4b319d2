"""A leg by a search in joint space: to a posture on the demonstrated path from which the rest can be followed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .arm import Arm
from .errors import BadOption
from .guarded import guarded_roll_out
from .ik import inverse_kinematics
from .joint_search import connect, shortcut
from .pose import Pose, PosePath
from .pursuit import ARRIVED
from .scene_work import SceneWork
from .tsia import guide_index, imitated_path

if TYPE_CHECKING:
    from .plans import PlanSettings


@dataclass(frozen=True, slots=True)
class JointSearchSettings:
    """The search in joint space.

    Attributes:
        step: longest edge [rad].
        iterations: most samples of one search.
        nodes: most nodes of one of its two trees.
        seeds: starts of the inverse kinematics per pose.
        targets: poses of the demonstrated path's tail that are aimed at, from the guiding pose to the goal.
        postures: most postures that are searched for, the most promising first.
        rounds: how often, each time with twice as many seeds.
        margin: smallest joint margin [rad] that a posture should have, so that the next leg has somewhere to go.
        late: what coming back to the demonstrated path only at its end costs, in radians of way.
        shortcuts: tries to leave out points of what was found.
        speed: of the largest joint speed, on the way found.
    """

    step: float = 0.3
    iterations: int = 3000
    nodes: int = 3000
    seeds: int = 12
    targets: int = 3
    postures: int = 4
    rounds: int = 3
    margin: float = 0.15
    late: float = 3.0
    shortcuts: int = 60
    speed: float = 0.4

    def __post_init__(self):
        for name in ("step", "speed"):
            if not 0 < getattr(self, name) <= 10:
                raise BadOption(name, f"{getattr(self, name)} is not a positive number up to 10")
        if not 0.0 <= self.late <= 1000.0:
            raise BadOption("late", f"{self.late} is not from 0 to 1000")
        for name in ("iterations", "nodes", "seeds", "targets", "postures", "rounds"):
            if not 1 <= getattr(self, name) <= 10**6:
                raise BadOption(name, f"{getattr(self, name)} is not from 1 to a million")


class JointLeg(NamedTuple):
    """What a search found.

    Attributes:
        joints: (t, dof) joints at every tick.
        path: the part of the demonstrated path that is followed at the end.
        guide: index in the imitated path at which that part begins.
        margin: smallest joint margin [rad].
    """

    joints: np.ndarray
    path: PosePath
    guide: int
    margin: float


class _Posture(NamedTuple):
    cost: float
    order: int
    q: np.ndarray
    tail: np.ndarray
    path: PosePath
    guide: int


def joint_leg(
    arm: Arm,
    scene: SceneWork,
    work: np.ndarray,
    demonstrated: PosePath,
    goal: Pose,
    q: np.ndarray,
    settings: PlanSettings,
    onward: PosePath | None,
    seed: int,
) -> JointLeg | None:
    """Search a way from joints q (dof,) to the goal; None if none was found.

    Args:
        arm: the arm.
        scene: it among obstacles.
        work: its controller and pursuit, see `workspace`.
        demonstrated: the segment to imitate.
        goal: where the tcp must end.
        q: (dof,) joints at the start.
        settings: see `PlanSettings`.
        onward: the next leg's path, or None.
        seed: of all random choices.
    """
    search = settings.search
    assert search is not None
    rng = np.random.default_rng(seed)
    state = np.array([float(seed % 2147483646) + 1.0])
    trees, parents = np.empty((2, search.nodes, arm.dof)), np.empty((2, search.nodes))
    out = np.empty((2 * search.nodes, arm.dof))
    for turn in range(search.rounds):
        seeds = search.seeds * 2**turn
        found = _postures(arm, scene, work, demonstrated, goal, q, settings, onward, rng, seeds)
        for posture in sorted(found)[: search.postures]:
            count = connect(scene.seen, q, posture.q, trees, parents, search.step, search.iterations, state, out)
            if count:
                count = shortcut(scene.seen, out, count, search.shortcuts, state)
                way = _timed(out[:count], search.speed * arm.velocity_limits * settings.motion.dt)
                joints = np.vstack([way[:-1], posture.tail])
                return JointLeg(joints, posture.path, posture.guide, min(arm.margin(row) for row in joints))
    return None


def _postures(arm, scene, work, demonstrated, goal, q, settings, onward, rng, seeds) -> list[_Posture]:
    """Clear postures on the demonstrated path from which the rest of it can be followed, with what they cost."""
    search, found = settings.search, []
    imitated = imitated_path(demonstrated, goal)
    first, last = guide_index(imitated, settings.motion.guide), len(imitated) - 1
    home = np.clip(q, np.maximum(arm.lower, -math.pi), np.minimum(arm.upper, math.pi))
    for index in sorted({round(i) for i in np.linspace(first, last, search.targets)}):
        path = imitated[index:]
        for k in range(seeds):
            low, high = np.maximum(arm.lower, -math.pi), np.minimum(arm.upper, math.pi)
            guess = home if k == 0 and seeds == search.seeds else rng.uniform(low, high)
            solution = inverse_kinematics(arm, path[0], guess, iterations=150)
            if solution is None or scene.room(solution) < 0.0:
                continue
            tail, margin = _followed(scene, work, path, solution, settings)
            if tail is None:
                continue
            cost = float(np.abs(solution - q).max()) + (10.0 if margin < search.margin else 0.0)
            cost += search.late * (index - first) / max(last - first, 1)
            if onward is not None and _followed(scene, work, onward, tail[-1], settings)[0] is None:
                cost += 5.0
            found.append(_Posture(cost, len(found), solution, tail, path, index))
    return found


def _followed(scene, work, path, q, settings) -> tuple[np.ndarray | None, float]:
    """Joints of following a path from q among the obstacles, or None; and the smallest joint margin."""
    dof, dt = len(q), settings.motion.dt
    trace, memory = np.empty((round(settings.max_seconds / dt) + 1, dof)), np.array([0.0, 0.0, np.inf, 0.0])
    status, last, margin, _ = guarded_roll_out(
        work, scene.robot, path.dqs, q.copy(), dt, memory, np.empty(dof), np.empty(dof), trace, 0
    )
    return (trace[: last + 1].copy() if status == ARRIVED else None), margin


def _timed(points: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Points on the straight lines between joint points (n, dof), no joint moving more than its step (dof,)."""
    rows = [points[:1]]
    for start, end in pairwise(points):
        count = max(1, math.ceil((np.abs(end - start) / step).max()))
        rows.append(start + np.arange(1, count + 1)[:, None] / count * (end - start))
    return np.vstack(rows)
