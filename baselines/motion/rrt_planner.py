"""Plans by sampling in joint space: to an inverse-kinematics posture of the goal, by any clear path."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...planner import Arm, Body, Obstacle, Plan, PlanRequest, PlanSettings, Pose, PosePath, imitated_path
from ...planner.control.inverse_kinematics import inverse_kinematics
from ...planner.control.reachability import why_not_reached
from ...planner.imitation.tsia import screw_path
from ...planner.planning.joint_space_motion import SearchFailure
from ...planner.planning.plan import MotionPlanner, pose_goal
from ...planner.planning.planning_scene import PlanningScene, checked_obstacles, scene_template
from ...planner.planning.requests import checked_request
from ...planner.resumable import CALL, Resumable
from ...planner.robot.joint_limits import within_limits
from ...planner.search.joint_space_rrt import sample_ranges
from .motion_method import JOINTS, NO_PATH
from .rrt_connect import RrtSettings, joint_path, timed

NO_POSTURE = "ik_or_limit"
MORE = 3
"""Number of doublings of the starts of the inverse kinematics."""
APPROACH_STEP = 0.01
"""Path length [m] between two postures of a straight end."""


class Posture(NamedTuple):
    """A posture of a goal and its approach.

    Attributes:
        first: (dof,) goal of the search [rad].
        rest: (k, dof) postures from there to the goal [rad].
    """

    first: np.ndarray
    rest: np.ndarray


class RrtPlanner(MotionPlanner):
    """Planner of one arm's motions by RRT-Connect; see `planner.planning.plan.MotionPlanner`.

    Args:
        arm: the arm.
        body: its capsules, held objects included.
        settings: see `PlanSettings`.
        sampling: see `RrtSettings`.
    """

    def __init__(self, arm: Arm, body: Body, settings: PlanSettings, sampling: RrtSettings):
        self.arm, self.body, self.settings, self.sampling = arm, body, settings, sampling
        self._template = scene_template(arm, body, settings.safety, settings.motion.dt, True)
        self._low, self._high = arm.lower + sampling.margin, arm.upper - sampling.margin

    def answering(self, request: PlanRequest) -> Resumable[Plan]:
        """Plan a motion, without a pause; of the demonstrated path only the end matters."""
        yield CALL
        begun, request = time.perf_counter(), checked_request(request, self.arm)
        q, goal = np.asarray(request.start), pose_goal(request)
        joints, failure = q[None], SearchFailure("", "")
        for end in [goal] if request.leaving is None else [request.leaving[-1], goal]:
            found = self.joints_or_failure(joints[-1], end, request.obstacles, request.allowed, request.seed)
            if isinstance(found, SearchFailure):
                joints, failure = q[None], found
                break
            joints = np.vstack([joints, found[1:]])
        rows = [*joints[: -1 : max(1, len(joints) // 100)], joints[-1]]
        path = PosePath(np.array([self.arm.fk(row).dq for row in rows]))
        return Plan(
            joints=joints,
            dt=self.settings.motion.dt,
            reason=failure.reason,
            how=JOINTS,
            imitated_poses=imitated_path(request.demonstrated, goal).dqs,
            path_poses=path.dqs,
            tree_rows=np.empty((0, 8)),
            detours=0,
            margin=min(self.arm.margin(row) for row in joints) if not failure.reason else -np.inf,
            changed=0,
            tries=1,
            seconds=time.perf_counter() - begun,
            request=request,
            arm=self.arm,
            body=self.body,
            settings=self.settings,
            detail=failure.detail,
            imitated_share=0.0 if failure.reason else 1.0,
        )

    def joints_or_failure(
        self,
        q: np.ndarray,
        goal: Pose,
        obstacles: Sequence[Obstacle],
        allowed: Sequence[tuple[str, str]],
        seed: int = 0,
    ) -> np.ndarray | SearchFailure:
        """Plan joints from a configuration to a goal.

        Args:
            q: (dof,) present joints [rad].
            goal: goal pose of the tcp.
            obstacles: around the arm.
            allowed: allowed contacts, (body name, obstacle name).
            seed: seed of OMPL's random numbers.

        Returns:
            Joints (t, dof) [rad] at every tick, or why there are none.
        """
        distance, q = self.settings.safety.distance, within_limits(self.arm, q)
        scene = PlanningScene(self._template, checked_obstacles(obstacles), distance, allowed)
        strict = PlanningScene(self._template, checked_obstacles(obstacles), distance)
        postures = self._postures(q, goal, scene, strict)
        if not postures:
            return SearchFailure(NO_POSTURE, self._why_no_posture(q, goal, scene))
        # allowed contacts are used on the straight end only, if there is one
        free = strict if min(strict.slack(each) for each in (q, *(p.first for p in postures))) >= 0.0 else scene
        firsts = [each.first for each in postures]
        points = joint_path(free.seen, self.arm.lower, self.arm.upper, q, firsts, self.sampling, seed)
        if points is None:
            return SearchFailure(NO_PATH, f"none leads to any of {len(firsts)} postures")
        met = min(postures, key=lambda each: float(np.abs(each.first - points[-1]).max()))
        step = self.sampling.speed * self.arm.velocity_limits * self.settings.motion.dt
        return timed(np.vstack([points, met.rest]), step)

    def _postures(self, q: np.ndarray, goal: Pose, scene: PlanningScene, strict: PlanningScene) -> list[Posture]:
        """Return clear postures of the goal, nearest first; preferably those with contacts on a straight end only."""
        rng, found, seeds = np.random.default_rng(0), [], self.sampling.seeds
        low, high = sample_ranges(self._low, self._high, q)
        for k in range(seeds * 2**MORE):
            if found and k >= seeds:
                break
            guess = q if k == 0 else rng.uniform(low, high)
            solution = inverse_kinematics(self.arm, goal, guess, iterations=150)
            if solution is not None and self._is_clear(solution, scene):
                found.append(solution)
        found.sort(key=lambda each: float(np.abs(each - q).max()))
        ended = [self._ended(each, goal, scene, strict) for each in found]
        gentle = [each for each in ended if each is not None]
        nothing = np.empty((0, self.arm.dof))
        return (gentle or [Posture(each, nothing) for each in found])[: self.sampling.goals]

    def _why_no_posture(self, q: np.ndarray, goal: Pose, scene: PlanningScene) -> str:
        """Return why no posture of the goal was found: what the nearest touches, or why the goal is not reached."""
        solution = inverse_kinematics(self.arm, goal, q)
        if solution is not None and scene.slack(solution) < 0.0:
            return f"in the posture nearest to the start {scene.tightest(solution)}"
        return why_not_reached(self.arm, goal, q)

    def _ended(self, q: np.ndarray, goal: Pose, scene: PlanningScene, strict: PlanningScene) -> Posture | None:
        """Return a posture, with a straight end if in contact: along the fingers, or from above for a held object."""
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
