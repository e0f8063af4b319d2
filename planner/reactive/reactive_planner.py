"""Algorithm 1 as one step: measured joints and obstacles in, a safe command out, replanned when the world changes.

Obstacles that stand still are planned round as soon as they are known. Moving obstacles are predicted from their
velocity; whether to go on guarded, to wait or to go round is decided by which of the three arrives first. An obstacle
that stays in the way for long is planned round at its present place. Not in the paper: prediction, waiting, the whole
arm, failing with a reason.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import checked_kind, checked_settings
from ..collision.step_certificates import near_pair_slack
from ..constraints.request_constraint import remembered_constraint
from ..control.arm_arrays import ARM, PURSUIT_STATE, arm_arrays
from ..control.pursuit import ARRIVED
from ..geometry.pose import PosePath, nearest
from ..geometry.shapes import Obstacle, moves
from ..imitation.constraint import Constraint, Keeping
from ..imitation.reduction import reduced
from ..planning.joint_space_motion import MAX_DEVIATION, path_deviation
from ..planning.plan import NextMotion, Plan, PlanRequest, check_success
from ..planning.planner import Planner
from ..planning.planning_scene import PlanningScene, checked_obstacles, scene_template
from ..resumable import Paced, Resumable
from ..robot.arm import Arm
from ..robot.body import Body
from ..safety.guarded_pursuit import guarded_tick
from ..safety.robot_checks import checked_contacts
from ..safety.safety_layer import BLOCKED as UNSAFE
from ..safety.safety_layer import FREE, safe_velocity
from .command import BLOCKED, DONE, ESCAPING, FAILED, FOLLOWING, PLANNING, WAITING, Command, ReactiveSettings
from .decision import Situation, decide
from .motion_state import DECIDE, HELD_BACK, Mode, MotionState, pursuit_of, why_stalled
from .prediction import Predictor, same_scene


class ReactivePlanner:
    """Follows one motion after the other: `see` the obstacles, `go` along a path, `step` every tick.

    Args:
        arm: the arm.
        body: its capsules, held object included.
        settings: see `ReactiveSettings`.

    Attributes:
        motion: the motion that is followed, or how it ended; None before `go` and after `stop`.

    Raises:
        WrongType, BadShape, NotFinite, BadOption, BadModel: any of its methods got something else than it takes.
    """

    def __init__(self, arm: Arm, body: Body, settings: ReactiveSettings | None = None):
        self.arm, self.settings = checked_kind("arm", arm, Arm), checked_settings(ReactiveSettings, settings)
        plan = self.settings.plan
        # a path to follow is already imitated: it is joined as early as possible
        early = replace(plan, motion=replace(plan.motion, guide=0.0, max_guide=0.3))
        motion = plan.motion
        self._work = arm_arrays(arm, motion.controller.packed(), motion.pursuit.packed())
        self._wish, self._out, self._still = np.empty(arm.dof), np.empty(arm.dof), np.zeros(arm.dof)
        self._obstacles: tuple[Obstacle, ...] = ()
        self._allowed: tuple[tuple[str, str], ...] = ()
        self.motion: MotionState | None = None
        self._planner = Planner(arm, body, early)
        # no tick waits for a search while something moves
        self._quick = Planner(arm, body, replace(early, search=None, effort=0))
        pace = motion.pursuit.capture_radius * motion.controller.gain
        self._foresight = Predictor(self._work, motion.dt, self.settings.horizon, pace)
        self.hold(body)
        self.see(())

    def hold(self, body: Body) -> None:
        """Use another body from now on: after an object was grasped or released."""
        self._planner.hold(body)
        self.body = body
        self._quick.hold(body)
        plan = self.settings.plan
        self._template = scene_template(self.arm, body, plan.safety, plan.motion.dt, plan.guard)
        self._bind()

    def see(self, obstacles: Sequence[Obstacle], allowed: Sequence[tuple[str, str]] = ()) -> None:
        """Take the obstacles as they are now.

        Args:
            obstacles: with measured places and velocities.
            allowed: pairs of names (part of the body or held object, obstacle) that may touch.
        """
        if obstacles is self._obstacles and allowed is self._allowed and not self._moving:
            return
        obstacles, allowed = checked_obstacles(obstacles), checked_contacts(allowed)
        changed = allowed != self._allowed or not same_scene(self._obstacles, obstacles)
        self._obstacles, self._allowed = obstacles, allowed
        if changed:
            self._bind()
            if self.motion is not None:
                self.motion.plan_now = self.motion.detours
        elif self._moving:
            self._scene.move(self._ahead())

    def go(
        self, path: PosePath, *, exact: bool = True, next_motion: NextMotion | None = None, detours: bool = True,
        must_keep: bool = False, constraint: Constraint | None = None, keeping: Keeping | None = None,
    ) -> None:  # fmt: skip
        """Follow a path to its end, joined from wherever the arm is.

        Args:
            path: of the tcp; of very long paths poses at even steps of their length, see `RepetSettings.longest`.
            exact: False: done as soon as the tool is within reach of the end.
            next_motion: the motion that follows: where there is a choice, the path ends in a posture that suits it.
            detours: False: along the path or not at all; where the safety layer leads off it, the arm stands still.
            must_keep: new plans must keep some of the path, see `PlanRequest.must_keep`.
            constraint: what the path keeps; None: what is found in it if the hand holds something.
            keeping: how it is kept, see `PlanRequest.keeping`.
        """
        checked_kind("path", path, PosePath)
        if next_motion is not None:
            checked_kind("next_motion", next_motion, NextMotion)
        given, path = path, reduced(path, max(self.settings.plan.repet.longest, 2)).path
        if constraint is not None or self.body.held:
            constraint = constraint or remembered_constraint(given, self.settings.plan.constraint)
            constraint = constraint.of_lengths(given.lengths(), path.lengths())
        pursuit = pursuit_of(self.settings.plan.motion.pursuit, exact=exact).packed()
        self._work[ARM.pursuit, : len(pursuit)] = pursuit
        now = bool(self._obstacles) and detours
        self.motion = MotionState(path, detours, next_motion, must_keep, constraint, keeping, plan_now=now)

    def follow(self, plan: Plan, *, exact: bool = True) -> None:
        """Follow the path of a plan to its end.

        Args:
            plan: a successful plan; a failed one has no path to follow and is refused by `PlanFailed`.
            exact: see `go`.
        """
        check_success(plan, "follow")
        self.go(plan.path, exact=exact)

    def stop(self) -> None:
        """Drop the motion: stand still, retreating from what comes too close."""
        self.motion = None

    @property
    def path(self) -> PosePath | None:
        """The path that is followed: the motion's, or a detour of it; None without a motion."""
        return None if self.motion is None else self.motion.path

    def step(self, q: ArrayLike) -> Command:
        """Return the command for joints q (dof,), as measured or as integrated from the commands."""
        joints = self.arm.checked(q)
        motion = self.motion
        if motion is None or motion.over:
            return self._stand_still(joints)
        if motion.plan_now and motion.planned is None:
            motion.plan_now = False
            motion.planned = Paced(self._replan(joints.copy(), [o for o in self._obstacles if not moves(o)]))
        if not self._is_planned(motion):
            command = self.stand(joints)
            return command if command.state == BLOCKED else command._replace(state=PLANNING)
        if motion.mode is Mode.TRACKING:
            return self._track(motion, joints)
        return self._pursue(motion, joints)

    def _is_planned(self, motion: MotionState) -> bool:
        """Go on with the plan in the making; returns True if there is none any more."""
        if motion.planned is not None and motion.planned.advance(self.settings.budget):
            motion.planned = None
        return motion.planned is None

    def _pursue(self, motion: MotionState, q: np.ndarray) -> Command:
        """One tick along a path."""
        dt = self.settings.plan.motion.dt
        status, safety = guarded_tick(
            self._work, self._scene.robot, motion.path.dqs, q, dt, motion.pursuit, self._wish, self._out
        )
        if status == ARRIVED:
            motion.mode = Mode.DONE
            return self._stand_still(q)
        if not motion.detours and self._goes_astray(motion, q, safety):
            return self._waited(motion, q, self.stand(q))
        if self._moving and self.settings.horizon > 0.0:
            motion.decision_left -= dt
            if motion.decision_left <= 0.0:
                self._decide(motion, q)
            if motion.waiting:
                return self._waited(motion, q, self.stand(q))
        state = ESCAPING if motion.mode is Mode.DETOURING else FOLLOWING
        return self._waited(motion, q, self._command(state, safety))

    def _track(self, motion: MotionState, q: np.ndarray) -> Command:
        """One tick along joints that a search has found, as far as moving obstacles allow."""
        dt, trace = self.settings.plan.motion.dt, motion.joints
        assert trace is not None
        if np.abs(q - trace[motion.tracked]).max() < 0.02:
            motion.tracked += 1
            motion.pursuit[PURSUIT_STATE.waited] = 0.0
        if motion.tracked >= len(trace):
            motion.mode = Mode.DONE
            return self._stand_still(q)
        motion.pursuit[PURSUIT_STATE.waited] += dt
        self._wish[:] = (trace[motion.tracked] - q) / dt
        safety = safe_velocity(self._scene.robot, q, self._wish, dt, self._out)
        return self._waited(motion, q, self._command(ESCAPING, safety))

    def _decide(self, motion: MotionState, q: np.ndarray) -> None:
        """Go on deciding what to do about moving obstacles; meanwhile the arm does as decided before."""
        if motion.decided is None:
            rest = motion.nominal[(at := self._now_at(motion, q)) :]
            now = Situation(
                q.copy(), self._scene.robot.copy(), motion.path, motion.pursuit.copy(), rest, self._obstacles,
                self._template, self._known_allowed, motion.detours, motion.tries, motion.kept_from(at),
            )  # fmt: skip
            motion.decided = Paced(decide(now, self._foresight, self._quick, self.settings.horizon))
        if not motion.decided.advance(self.settings.budget):
            return
        found, motion.decided = motion.decided.result, None
        motion.waiting, motion.decision_left = found.waiting, DECIDE
        if found.detour is not None:
            motion.reached = self._now_at(motion, q)
            motion.pursue(found.detour.path, detour=True)
            motion.decision_left = DECIDE

    def _goes_astray(self, motion: MotionState, q: np.ndarray, safety: int) -> bool:
        """True if the safety layer leads the tool away from its path, or from the line to its beginning."""
        if motion.line is None:
            motion.line = np.vstack([self.arm.fk(q).dq, motion.path.dqs])
        if safety == FREE:
            return False
        later = path_deviation(self.arm, (q + self.settings.plan.motion.dt * self._out)[None], motion.line)
        return later > MAX_DEVIATION and later > path_deviation(self.arm, q[None], motion.line)

    def _command(self, state: str, safety: int) -> Command:
        slack = float(near_pair_slack(self._scene.robot, -1, 0.0))
        if safety == UNSAFE:
            why = "an obstacle comes closer than the arm can keep away"
            return Command(self._out.copy(), BLOCKED, why, slack, str(self._scene.tightest_seen() or ""))
        if (
            self._moving
            and np.abs(self._out).max() < HELD_BACK * np.abs(self._wish).max()
            and self._scene.meets_mover()
        ):
            state = WAITING
        return Command(self._out.copy(), state, "", slack)

    def stand(self, q: ArrayLike) -> Command:
        """Return the command of standing still during a motion, or of retreating from what comes too close."""
        joints, dt = self.arm.checked(q), self.settings.plan.motion.dt
        command = self._command(WAITING, safe_velocity(self._scene.robot, joints, self._still, dt, self._out))
        return command._replace(state=WAITING) if command.state != BLOCKED else command

    def _stand_still(self, q: np.ndarray) -> Command:
        """The command of standing still without a motion, or after its end with the outcome."""
        motion, dt = self.motion, self.settings.plan.motion.dt
        command = self._command(DONE, safe_velocity(self._scene.robot, q, self._still, dt, self._out))
        if motion is None:
            return command._replace(state=DONE, reason="", detail="")
        state = FAILED if motion.mode is Mode.FAILED else DONE
        return command._replace(state=state, reason=motion.reason, detail=motion.detail)

    def _waited(self, motion: MotionState, q: np.ndarray, command: Command) -> Command:
        """The command, unless the motion has stalled: then plan anew, or fail."""
        waited = motion.pursuit[PURSUIT_STATE.waited]
        if waited > self.settings.patience:
            motion.stalled += waited
            # a still obstacle at the goal will not leave it; without detours a new plan changes nothing
            hopeless = (not self._moving or not motion.detours) and motion.tries >= 3
            hopeless |= not self._moving and motion.refusal[0] == "goal in collision"
            if hopeless or motion.stalled > self.settings.give_up:
                motion.fail(*why_stalled(motion, self._scene.tightest_seen(), self.settings.plan.safety.distance))
                return self._stand_still(q)
            motion.tries += 1
            motion.pursuit[PURSUIT_STATE.waited] = 0.0
            if motion.detours:
                motion.planned = Paced(self._replan(q.copy(), self._obstacles))
                self._is_planned(motion)
        return command

    def _replan(self, q: np.ndarray, obstacles: Sequence[Obstacle]) -> Resumable[None]:
        """Lead the rest of the motion round obstacles taken to stand still; where that fails, the path stays."""
        motion = self.motion
        assert motion is not None
        motion.reached = self._now_at(motion, q)
        rest = motion.nominal[motion.reached :]
        around, allowed = tuple(obstacles), tuple(self._known_allowed(obstacles))
        then, kept = motion.next_motion, motion.kept_from(motion.reached)
        request = PlanRequest(rest, q, rest[-1], around, allowed, None, then, motion.tries, **kept)
        plan = yield from self._planner.answering(request)
        motion.refusal = plan.reason, plan.detail
        if plan.success and plan.how == "joint search":
            motion.track(plan.joints, plan.path)
        elif plan.success and plan.how == "escape":
            motion.pursue(plan.path, detour=True)
        else:
            # joined where the plan joins it: the arm may not be able to follow what comes before
            motion.reached += plan.guide if plan.success else 0
            motion.pursue(motion.nominal[motion.reached :], detour=False)

    def _now_at(self, motion: MotionState, q: np.ndarray) -> int:
        """Index of the nominal pose that is followed now; on a detour the nearest one not yet passed."""
        if motion.mode in (Mode.DETOURING, Mode.TRACKING):
            return motion.reached + nearest(motion.nominal[motion.reached :], self.arm.fk(q))
        return motion.reached + int(motion.pursuit[PURSUIT_STATE.reference])

    def _ahead(self) -> list[Obstacle]:
        return [o.at(self.settings.lead) if moves(o) else o for o in self._obstacles]

    def _bind(self) -> None:
        self._moving = any(moves(o) for o in self._obstacles)
        distance = self.settings.plan.repet.distance
        self._scene = PlanningScene(self._template, self._ahead(), distance, self._known_allowed(self._obstacles))

    def _known_allowed(self, obstacles: Sequence[Obstacle]) -> list[tuple[str, str]]:
        """The allowed contacts whose part and obstacle exist now."""
        names = {obstacle.name for obstacle in obstacles}
        return [pair for pair in self._allowed if pair[0] in self.body.names and pair[1] in names]
