"""Legs by sampling in joint space: to an inverse-kinematics posture of the goal, by any clear way."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..planner.arm import Arm
from ..planner.body import Body
from ..planner.clearance import room_at
from ..planner.command import FAILED, Command, ReactiveSettings
from ..planner.ik import inverse_kinematics
from ..planner.plans import Asked, Plan, PlanSettings
from ..planner.pose import Pose, PosePath
from ..planner.reactive import ReactivePlanner
from ..planner.scene_work import Layout, SceneWork, checked_obstacles
from ..planner.shapes import Obstacle
from ..planner.tsia import imitated_path, screw_path
from .extras import needed
from .mover import JOINTS, SCREW, LegPlanner, Mover, Relative
from .program_settings import ProgramSettings
from .sampling import SamplingSettings, joint_way, timed

NO_WAY, NO_POSTURE = "no way found", "ik_or_limit"
MORE = 3
"""How often the starts of the inverse kinematics are doubled."""
APPROACH_STEP = 0.01
"""Way [m] between two postures of a straight end."""


class Posture(NamedTuple):
    """A posture of a goal and how it is come to.

    Attributes:
        first: (dof,) where the search has to lead.
        rest: (k, dof) postures from there to the goal.
    """

    first: np.ndarray
    rest: np.ndarray


class SamplingPlanner:
    """Plans legs of one arm by RRT-Connect; see `mover.LegPlanner`."""

    def __init__(self, arm: Arm, body: Body, settings: PlanSettings, sampling: SamplingSettings):
        self.arm, self.body, self.settings, self.sampling = arm, body, settings, sampling
        self._layout = Layout(arm, body, settings.safety, settings.motion.dt)
        self._low = np.maximum(arm.lower, -np.pi) + sampling.margin
        self._high = np.minimum(arm.upper, np.pi) - sampling.margin

    def plan(
        self,
        demonstrated: PosePath,
        start: ArrayLike,
        goal: Pose,
        obstacles: Sequence[Obstacle] = (),
        *,
        allowed: Sequence[tuple[str, str]] = (),
        leaving: PosePath | None = None,
        onward: PosePath | None = None,
        seed: int = 0,
    ) -> Plan:
        """Plan a leg; see `Planner.plan`. Of what was demonstrated only its end is looked at."""
        begun, q = time.perf_counter(), self.arm.checked(start)
        asked = Asked(self.arm, self.body, goal, tuple(obstacles), tuple(allowed), self.settings, demonstrated)
        joints, reason = q[None], ""
        for end in [goal] if leaving is None else [leaving[-1], goal]:
            way = self.way(joints[-1], end, obstacles, allowed, seed)
            if isinstance(way, str):
                joints, reason = q[None], way
                break
            joints = np.vstack([joints, way[1:]])
        rows = [*joints[: -1 : max(1, len(joints) // 100)], joints[-1]]
        path = PosePath(np.array([self.arm.fk(row).dq for row in rows]))
        margin = min(self.arm.margin(row) for row in joints) if not reason else -np.inf
        return Plan(
            joints, self.settings.motion.dt, reason, JOINTS, imitated_path(demonstrated, goal).dqs, path.dqs,
            np.empty((0, 8)), 0, margin, 0, 1, time.perf_counter() - begun, asked, kept=0.0 if reason else 1.0,
        )  # fmt: skip

    def way(
        self,
        q: np.ndarray,
        goal: Pose,
        obstacles: Sequence[Obstacle],
        allowed: Sequence[tuple[str, str]],
        seed: int = 0,
    ) -> np.ndarray | str:
        """Joints (t, dof) at every tick from q to the goal, or why there are none."""
        distance = self.settings.safety.distance
        scene = SceneWork(self._layout, checked_obstacles(obstacles), distance, allowed)
        strict = SceneWork(self._layout, checked_obstacles(obstacles), distance)
        postures = self._postures(q, goal, scene, strict)
        if not postures:
            return NO_POSTURE
        # what is touched on purpose is touched on the straight end only, if there is one
        free = strict if min(strict.room(each) for each in (q, *(p.first for p in postures))) >= 0.0 else scene
        firsts = [each.first for each in postures]
        points = joint_way(free.seen, self.arm.lower, self.arm.upper, q, firsts, self.sampling, seed)
        if points is None:
            return NO_WAY
        met = min(postures, key=lambda each: float(np.abs(each.first - points[-1]).max()))
        step = self.sampling.speed * self.arm.velocity_limits * self.settings.motion.dt
        return timed(np.vstack([points, met.rest]), step)

    def _postures(self, q: np.ndarray, goal: Pose, scene: SceneWork, strict: SceneWork) -> list[Posture]:
        """Clear postures of the goal, the nearest first; if there are any, those that touch on a straight end only."""
        rng, found, seeds = np.random.default_rng(0), [], self.sampling.seeds
        for k in range(seeds * 2**MORE):
            if found and k >= seeds:
                break
            guess = q if k == 0 else rng.uniform(self._low, self._high)
            solution = inverse_kinematics(self.arm, goal, guess, iterations=150)
            if solution is not None and self._is_clear(solution, scene):
                found.append(solution)
        found.sort(key=lambda each: float(np.abs(each - q).max()))
        ended = [self._ended(each, goal, scene, strict) for each in found]
        gentle = [each for each in ended if each is not None]
        nothing = np.empty((0, self.arm.dof))
        return (gentle or [Posture(each, nothing) for each in found])[: self.sampling.goals]

    def _ended(self, q: np.ndarray, goal: Pose, scene: SceneWork, strict: SceneWork) -> Posture | None:
        """A posture with a straight end, if it touches something: along the fingers, or from above what is held."""
        length = self.sampling.approach
        if strict.room(q) >= 0.0:
            return Posture(q, np.empty((0, self.arm.dof)))
        if length <= 0.0:
            return None
        back = Pose.from_position_quaternion([0.0, 0.0, length if self.body.held else -length])
        before = back @ goal if self.body.held else goal @ back
        rows = [q]
        for pose in list(screw_path(goal, before, APPROACH_STEP))[1:]:
            row = inverse_kinematics(self.arm, pose, rows[-1], iterations=50)
            if row is None or not self._is_clear(row, scene) or np.abs(row - rows[-1]).max() > 0.5:
                return None
            rows.append(row)
        return Posture(rows[-1], np.array(rows[-2::-1])) if strict.room(rows[-1]) >= 0.0 else None

    def _is_clear(self, q: np.ndarray, scene: SceneWork) -> bool:
        return bool((q >= self._low).all() and (q <= self._high).all()) and scene.room(q) >= 0.0


class SamplingFollower(ReactivePlanner):
    """Follows ways through joint space, made from where the arm is; nothing is planned anew."""

    def __init__(self, arm: Arm, body: Body, settings: ReactiveSettings, sampling: SamplingSettings):
        self._sampling, self._goal = sampling, None
        plan = replace(settings.plan, avoid=False, search=None)
        super().__init__(arm, body, replace(settings, plan=plan, horizon=0.0))

    def go(self, path: PosePath, *, loosely: bool = False, onward: PosePath | None = None) -> None:
        """A leg to the end of a path."""
        super().go(path, loosely=loosely)
        self._goal = path[-1]

    def stop(self) -> None:
        """See `ReactivePlanner`."""
        super().stop()
        self._goal = None

    def step(self, q: ArrayLike) -> Command:
        """See `ReactivePlanner`."""
        if self._goal is not None and self._joints is None:
            planner = SamplingPlanner(self.arm, self.body, self.settings.plan, self._sampling)
            joints = np.asarray(q, dtype=np.float64)
            still = [each for each in self._obstacles if not each.velocity.any()]
            way = planner.way(joints, self._goal, still, self._known_allowed(still))
            self._goal = None
            if isinstance(way, str):
                self.state, self.reason = FAILED, "blocked" if way == NO_WAY else way
                self.detail = "no way through joint space was found"
            else:
                self._joints, self._done, self._plan_now = way, 0, False
        return super().step(q)

    def _replan(self, q: np.ndarray, obstacles: Sequence[Obstacle]) -> None:
        self._plan_now = False


class SamplingMover:
    """Legs by RRT-Connect."""

    def __init__(self, sampling: SamplingSettings):
        needed("ompl.base", "ompl")
        self._sampling = sampling

    def planner(self, arm: Arm, body: Body, settings: PlanSettings) -> LegPlanner:
        """See `Mover`."""
        return SamplingPlanner(arm, body, settings, self._sampling)

    def follower(self, arm: Arm, body: Body, settings: ReactiveSettings) -> ReactivePlanner:
        """See `Mover`."""
        return SamplingFollower(arm, body, settings, self._sampling)

    def skipped(self, done: int) -> int:
        """None: it looks at the end only."""
        return 0

    def relative(self, shown: PosePath, start: Pose) -> Relative:
        """See `Mover`; only its end says something."""
        return SCREW.relative(shown, start)

    def way_of_two(
        self, arms: Sequence[Arm], q: np.ndarray, ends: Sequence[Pose], g: np.ndarray, dt: float
    ) -> np.ndarray | str:
        """See `Mover`."""
        sampling, rng, found = self._sampling, np.random.default_rng(0), [[], []]
        low, high = (np.concatenate([getattr(arm, name) for arm in arms]) for name in ("lower", "upper"))
        for arm, now, end, postures in zip(arms, q, ends, found, strict=True):
            for k in range(sampling.seeds):
                guess = now if k == 0 else rng.uniform(np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi))
                solution = inverse_kinematics(arm, end, guess, iterations=150)
                if solution is not None and arm.margin(solution) >= sampling.margin:
                    postures.append(solution)
            postures.sort(key=lambda each: float(np.abs(each - now).max()))
        pairs = [np.concatenate(pair) for pair in product(*found)]
        pairs = [pair for pair in pairs if room_at(g, pair, 0.0, 0.1) >= 0.0]
        if not pairs:
            return NO_POSTURE
        pairs.sort(key=lambda each: float(np.abs(each - q.ravel()).max()))
        points = joint_way(g, low, high, q.ravel(), pairs[: sampling.goals], sampling)
        if points is None:
            return NO_WAY
        limits = np.concatenate([arm.velocity_limits for arm in arms])
        return timed(points, sampling.speed * limits * dt).reshape(-1, *q.shape)


@dataclass(frozen=True, slots=True)
class SamplingPolicySettings(ProgramSettings):
    """Of `rrt`.

    Attributes:
        sampling: see `SamplingSettings`.
    """

    guard: bool = False
    sampling: SamplingSettings = field(default_factory=SamplingSettings)

    @property
    def mover(self) -> Mover:
        """See `ProgramSettings`."""
        return SamplingMover(self.sampling)

    @property
    def plan(self) -> PlanSettings:
        """See `ProgramSettings`."""
        return PlanSettings(motion=self.motion, safety=self.safety, search=None, avoid=False, guard=self.guard)
