"""Plans of legs by sampling in joint space: to an inverse-kinematics posture of the goal, by any clear way."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...planner.control.inverse_kinematics import inverse_kinematics
from ...planner.geometry.pose import Pose, PosePath
from ...planner.geometry.shapes import Obstacle
from ...planner.imitation.tsia import imitated_path, screw_path
from ...planner.planning.plan import NextMotion, Plan, PlanRequest
from ...planner.planning.planning_scene import PlanningScene, SceneTemplate, checked_obstacles
from ...planner.planning.settings import PlanSettings
from ...planner.robot.arm import Arm
from ...planner.robot.body import Body
from .motion_method import JOINTS
from .rrt_connect import RrtSettings, joint_path, timed

NO_PATH, NO_POSTURE = "no way found", "ik_or_limit"
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


class RrtPlanner:
    """Plans legs of one arm by RRT-Connect; see `motion_method.MotionPlanner`."""

    def __init__(self, arm: Arm, body: Body, settings: PlanSettings, sampling: RrtSettings):
        self.arm, self.body, self.settings, self.sampling = arm, body, settings, sampling
        self._layout = SceneTemplate(arm, body, settings.safety, settings.motion.dt)
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
        next_motion: NextMotion | None = None,
        seed: int = 0,
    ) -> Plan:
        """Plan a leg; see `Planner.plan`. Of what was demonstrated only its end is looked at."""
        begun, q = time.perf_counter(), self.arm.checked(start)
        asked = PlanRequest(self.arm, self.body, goal, tuple(obstacles), tuple(allowed), self.settings, demonstrated)
        joints, reason = q[None], ""
        for end in [goal] if leaving is None else [leaving[-1], goal]:
            joints_or_reason = self.joints_or_reason(joints[-1], end, obstacles, allowed, seed)
            if isinstance(joints_or_reason, str):
                joints, reason = q[None], joints_or_reason
                break
            joints = np.vstack([joints, joints_or_reason[1:]])
        rows = [*joints[: -1 : max(1, len(joints) // 100)], joints[-1]]
        path = PosePath(np.array([self.arm.fk(row).dq for row in rows]))
        margin = min(self.arm.margin(row) for row in joints) if not reason else -np.inf
        return Plan(
            joints, self.settings.motion.dt, reason, JOINTS, imitated_path(demonstrated, goal).dqs, path.dqs,
            np.empty((0, 8)), 0, margin, 0, 1, time.perf_counter() - begun, asked,
            imitated_share=0.0 if reason else 1.0,
        )  # fmt: skip

    def joints_or_reason(
        self,
        q: np.ndarray,
        goal: Pose,
        obstacles: Sequence[Obstacle],
        allowed: Sequence[tuple[str, str]],
        seed: int = 0,
    ) -> np.ndarray | str:
        """Joints (t, dof) at every tick from q to the goal, or why there are none."""
        distance = self.settings.safety.distance
        scene = PlanningScene(self._layout, checked_obstacles(obstacles), distance, allowed)
        strict = PlanningScene(self._layout, checked_obstacles(obstacles), distance)
        postures = self._postures(q, goal, scene, strict)
        if not postures:
            return NO_POSTURE
        # what is touched on purpose is touched on the straight end only, if there is one
        free = strict if min(strict.slack(each) for each in (q, *(p.first for p in postures))) >= 0.0 else scene
        firsts = [each.first for each in postures]
        points = joint_path(free.seen, self.arm.lower, self.arm.upper, q, firsts, self.sampling, seed)
        if points is None:
            return NO_PATH
        met = min(postures, key=lambda each: float(np.abs(each.first - points[-1]).max()))
        step = self.sampling.speed * self.arm.velocity_limits * self.settings.motion.dt
        return timed(np.vstack([points, met.rest]), step)

    def _postures(self, q: np.ndarray, goal: Pose, scene: PlanningScene, strict: PlanningScene) -> list[Posture]:
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

    def _ended(self, q: np.ndarray, goal: Pose, scene: PlanningScene, strict: PlanningScene) -> Posture | None:
        """A posture with a straight end, if it touches something: along the fingers, or from above what is held."""
        length = self.sampling.approach
        if strict.slack(q) >= 0.0:
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
        return Posture(rows[-1], np.array(rows[-2::-1])) if strict.slack(rows[-1]) >= 0.0 else None

    def _is_clear(self, q: np.ndarray, scene: PlanningScene) -> bool:
        return bool((q >= self._low).all() and (q <= self._high).all()) and scene.slack(q) >= 0.0
