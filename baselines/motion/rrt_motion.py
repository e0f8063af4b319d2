"""Motions by RRT-Connect, of one arm or two: planned when they begin, followed without replanning."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from ...planner import (
    Arm,
    Body,
    Command,
    NextMotion,
    Obstacle,
    PlanSettings,
    Pose,
    PosePath,
    ReactivePlanner,
    ReactiveSettings,
)
from ...planner.collision.clearance import slack_at
from ...planner.control.inverse_kinematics import inverse_kinematics
from ...planner.imitation.constraint import Constraint, Keeping
from ...planner.planning.joint_space_motion import SearchFailure
from ...planner.search.joint_space_rrt import sample_ranges
from ..extras import needed
from .motion_method import NO_PATH, SCREW, Follower, MotionMethod, MotionPlanner, Relative
from .rrt_connect import RrtSettings, joint_path, timed
from .rrt_planner import NO_POSTURE, RrtPlanner
from .settings import ProgramSettings


class RrtFollower(ReactivePlanner):
    """Follower of paths through joint space, planned from the present joints and never replanned.

    Args:
        arm: the arm.
        body: its capsules, held objects included.
        settings: see `ReactiveSettings`; detours, search and prediction are switched off.
        sampling: see `RrtSettings`.
    """

    def __init__(self, arm: Arm, body: Body, settings: ReactiveSettings, sampling: RrtSettings):
        self._sampling, self._goal = sampling, None
        plan = replace(settings.plan, trees=False, search=None)
        super().__init__(arm, body, replace(settings, plan=plan, horizon=0.0))

    def go(
        self,
        path: PosePath,
        *,
        exact: bool = True,
        next_motion: NextMotion | None = None,
        detours: bool = True,
        must_keep: bool = False,
        constraint: Constraint | None = None,
        keeping: Keeping | None = None,
    ) -> None:
        """See `ReactivePlanner`: only the end of the path matters."""
        super().go(path, exact=exact)
        self._goal = path[-1]

    def stop(self) -> None:
        """See `ReactivePlanner`."""
        super().stop()
        self._goal = None

    def step(self, q: ArrayLike) -> Command:
        """See `ReactivePlanner`."""
        motion = self.motion
        if motion is not None and self._goal is not None:
            planner = RrtPlanner(self.arm, self.body, self.settings.plan, self._sampling)
            joints = np.asarray(q, dtype=np.float64)
            still = [each for each in self._obstacles if not each.velocity.any()]
            found = planner.joints_or_failure(joints, self._goal, still, self._known_allowed(still))
            self._goal = None
            if isinstance(found, SearchFailure):
                reason = "blocked" if found.reason == NO_PATH else found.reason
                motion.fail(reason, f"no way through joint space was found: {found.detail}")
            else:
                motion.plan_now = False
                motion.track(found, motion.path)
        return super().step(q)

    def _replan(self, q: np.ndarray, obstacles: Sequence[Obstacle]) -> None:
        assert self.motion is not None
        self.motion.plan_now = False


class RrtMotion:
    """Motions by RRT-Connect.

    Args:
        sampling: see `RrtSettings`.

    Raises:
        MissingExtra: OMPL is not installed.
    """

    def __init__(self, sampling: RrtSettings):
        needed("ompl.base", "ompl")
        self._sampling = sampling

    def planner(self, arm: Arm, body: Body, settings: PlanSettings) -> MotionPlanner:
        """See `MotionMethod`."""
        return RrtPlanner(arm, body, settings, self._sampling)

    def follower(self, arm: Arm, body: Body, settings: ReactiveSettings) -> Follower:
        """See `MotionMethod`."""
        return RrtFollower(arm, body, settings, self._sampling)

    def skipped(self, done: int) -> int:
        """Return 0: only the end of a segment matters."""
        return 0

    def relative(self, shown: PosePath, start: Pose) -> Relative:
        """See `MotionMethod`; only the end of the path matters."""
        return SCREW.relative(shown, start)

    def dual_arm_path(
        self, arms: Sequence[Arm], q: np.ndarray, ends: Sequence[Pose], seen: Callable[[], np.ndarray], dt: float
    ) -> np.ndarray | str:
        """See `MotionMethod`."""
        sampling, rng, found, g = self._sampling, np.random.default_rng(0), [[], []], seen()
        low, high = (np.concatenate([getattr(arm, name) for arm in arms]) for name in ("lower", "upper"))
        for arm, now, end, postures in zip(arms, q, ends, found, strict=True):
            for k in range(sampling.seeds):
                guess = now if k == 0 else rng.uniform(*sample_ranges(arm.lower, arm.upper, now))
                solution = inverse_kinematics(arm, end, guess, iterations=150)
                if solution is not None and arm.margin(solution) >= sampling.margin:
                    postures.append(solution)
            postures.sort(key=lambda each: float(np.abs(each - now).max()))
        pairs = [np.concatenate(pair) for pair in product(*found)]
        pairs = [pair for pair in pairs if slack_at(g, pair, 0.0, 0.1) >= 0.0]
        if not pairs:
            return NO_POSTURE
        pairs.sort(key=lambda each: float(np.abs(each - q.ravel()).max()))
        points = joint_path(g, low, high, q.ravel(), pairs[: sampling.goals], sampling)
        if points is None:
            return NO_PATH
        limits = np.concatenate([arm.velocity_limits for arm in arms])
        return timed(points, sampling.speed * limits * dt).reshape(-1, *q.shape)


@dataclass(frozen=True, slots=True)
class RrtPolicySettings(ProgramSettings):
    """Settings of `rrt`.

    Attributes:
        sampling: see `RrtSettings`.
    """

    guard: bool = False
    sampling: RrtSettings = field(default_factory=RrtSettings)

    @property
    def motion_method(self) -> MotionMethod:
        """See `ProgramSettings`."""
        return RrtMotion(self.sampling)

    @property
    def plan(self) -> PlanSettings:
        """See `ProgramSettings`."""
        return PlanSettings(motion=self.motion, safety=self.safety, search=None, trees=False, guard=self.guard)
