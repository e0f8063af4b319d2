"""Algorithm 1 as one step: measured joints and obstacles in, a safe command out, replanned when the world changes.

Static obstacles are planned round as soon as they are seen. What moves is foreseen with its velocity: to go on guarded,
to wait or to go round is decided by which of them arrives first. What stays in the way for long is planned round at its
present place. Not in the paper: foresight, waiting, the whole arm, giving up with a reason.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ..collision.clearance import near_pair_slack
from ..control.arm_arrays import PURSUIT, arm_arrays
from ..control.pursuit import ARRIVED, INDEX, WAITED, fresh_pursuit_state
from ..escape.repet import MAX_OBSTACLES
from ..geometry.pose import Pose, PosePath, nearest
from ..geometry.shapes import Obstacle, moves
from ..planning.joint_space_motion import MAX_DEVIATION, path_deviation
from ..planning.plan import NextMotion, Plan
from ..planning.planner import Planner
from ..planning.planning_scene import PlanningScene, SceneTemplate
from ..robot.arm import Arm
from ..robot.body import Body
from ..safety.guarded_pursuit import guarded_tick
from ..safety.safety_layer import BLOCKED as UNSAFE
from ..safety.safety_layer import FREE, safe_velocity
from .command import BLOCKED, DONE, ESCAPING, FAILED, FOLLOWING, WAITING, Command, ReactiveSettings
from .prediction import Predictor, is_preferable, same_scene, swept, windows

BLOCKING = ("start in collision", "goal in collision", "no escape found", "node limit reached")
"""Reasons of a plan that say: something is in the way."""
DECIDE = 0.2
"""Seconds for which a decision to go on, to wait or to go round holds."""
WAITS = (0.25, 0.5, 1.0)
"""How long to wait, in parts of the horizon, is what is compared."""
HELD_BACK = 0.1
"""Part of the wanted speed below which an arm that something moving is close to is waiting."""


class ReactivePlanner:
    """Follows one leg after the other with one arm: `see` what is around, `go` along a path, `step` every tick."""

    def __init__(self, arm: Arm, body: Body, settings: ReactiveSettings | None = None):
        self.arm, self.settings = arm, settings or ReactiveSettings()
        plan = self.settings.plan
        # what is followed is already imitated: it is joined as early as it can be
        self._leg_settings = replace(plan, motion=replace(plan.motion, guide=0.0, max_guide=0.3))
        motion = plan.motion
        self._work = arm_arrays(arm, motion.controller.packed(), motion.pursuit.packed())
        self._wish, self._out, self._still = np.empty(arm.dof), np.empty(arm.dof), np.zeros(arm.dof)
        self._obstacles: tuple[Obstacle, ...] = ()
        self._allowed: tuple[tuple[str, str], ...] = ()
        self._joints: np.ndarray | None = None
        self._nominal: PosePath | None = None
        self._path: PosePath | None = None
        self._pursuit_state, self._may_detour = np.zeros(4), True
        self._line: np.ndarray | None = None
        self._planner = Planner(arm, body, self._leg_settings)
        # no tick waits for a search while something moves
        self._quick = Planner(arm, body, replace(self._leg_settings, search=None, effort=0))
        pace = motion.pursuit.capture_radius * motion.controller.gain
        self._foresight = Predictor(self._work, motion.dt, self.settings.horizon, pace)
        self.hold(body)
        self.see(())
        self.stop()

    def hold(self, body: Body) -> None:
        """The body from now on: after something was grasped or released."""
        self.body = body
        self._planner.hold(body)
        self._quick.hold(body)
        plan = self.settings.plan
        self._template = SceneTemplate(self.arm, body, plan.safety, plan.motion.dt, guard=plan.guard)
        self._bind()

    def see(self, obstacles: Sequence[Obstacle], allowed: Sequence[tuple[str, str]] = ()) -> None:
        """What is around now, by measured place and velocity; and which contacts are wanted."""
        if obstacles is self._obstacles and allowed is self._allowed and not self._moving:
            return
        changed = tuple(allowed) != self._allowed or not same_scene(self._obstacles, obstacles)
        self._obstacles, self._allowed = tuple(obstacles), tuple(allowed)
        if changed:
            self._bind()
            self._plan_now = self._may_detour
        elif self._moving:
            self._scene.move(self._ahead())

    def go(
        self, path: PosePath, *, exact: bool = True, next_motion: NextMotion | None = None, detours: bool = True
    ) -> None:
        """Follow a path to its end, joined from wherever the arm is.

        Args:
            path: of the tcp.
            exact: False: done as soon as the tool is within reach of the end.
            next_motion: what comes next: where there is a choice, the path ends in a posture that suits it.
            detours: False: along the path or not at all, without detour or search; where the safety layer leads away
                from the path, the arm stands still, if it can.
        """
        self._nominal = self._path = path
        self._may_detour, self._line = detours, None
        self._next_motion, self._joints = next_motion, None
        pursuit = self.settings.plan.motion.pursuit
        if not exact:
            radius = pursuit.capture_radius
            pursuit = replace(pursuit, position_tolerance=radius, angle_tolerance=5.0 * radius)
        packed = replace(pursuit, patience=1e9).packed()
        self._work[PURSUIT, : len(packed)] = packed
        self._restart(path)
        self._done = self._reached = 0
        self._lost, self._tries, self.reason, self.detail, self._detour = 0.0, 0, "", "", False
        self._why_not = "", ""
        self._plan_now = bool(self._obstacles) and detours
        self.state = FOLLOWING

    def follow(self, plan: Plan, *, exact: bool = True) -> None:
        """Follow the path of a plan to its end; see `go`."""
        self.go(plan.path, exact=exact)

    def stop(self) -> None:
        """No leg: stand still, retreating from what comes too close."""
        self._nominal = self._path = None
        self._plan_now, self.state, self.reason, self.detail = False, DONE, "", ""

    @property
    def path(self) -> PosePath | None:
        """What is being followed: the leg's path, or a detour of it."""
        return self._path

    def step(self, q: ArrayLike) -> Command:
        """The command for joints q (dof,), as measured or as integrated from the commands."""
        joints = np.ascontiguousarray(q, dtype=np.float64)
        if self._path is None or self.state in (DONE, FAILED):
            return self._stand(joints, self.state)
        if self._plan_now:
            self._replan(joints, [o for o in self._obstacles if not moves(o)])
        if self._joints is not None:
            return self._step_joints(joints)
        path = self._path
        dt = self.settings.plan.motion.dt
        status, safety = guarded_tick(
            self._work, self._scene.robot, path.dqs, joints, dt, self._pursuit_state, self._wish, self._out
        )
        if status == ARRIVED:
            self.state = DONE
            return self._stand(joints, DONE)
        if not self._may_detour and self._goes_astray(joints, safety):
            return self._waited(joints, self._stand(joints, WAITING))
        if self._moving and self.settings.horizon > 0.0:
            self._decided -= dt
            if self._decided <= 0.0:
                self._decide(joints)
            if self._waiting:
                return self._waited(joints, self._stand(joints, WAITING))
        return self._waited(joints, self._command(self._following(), safety))

    def _decide(self, q: np.ndarray) -> None:
        """Go on, wait, or go round what moves: whatever is safe, and of that what arrives first."""
        assert self._path is not None
        self._waiting, self._decided = False, DECIDE
        horizon, robot = self.settings.horizon, self._scene.robot
        best = self._foresight.ahead(robot, self._path, self._pursuit_state, q)
        if best.conflict is None:
            return
        conflict, detour = best.conflict, None
        for part in WAITS:
            other = self._foresight.ahead(robot, self._path, self._pursuit_state, q, part * horizon)
            if is_preferable(other, best):
                best, self._waiting = other, True
        for plan in self._detours(q, conflict) if self._may_detour else ():
            other = self._foresight.ahead(robot, plan.path, fresh_pursuit_state(), q)
            if is_preferable(other, best):
                best, detour, self._waiting = other, plan, False
        if detour is not None:
            self._reached, self._detour = self._now_at(q), True
            self._restart(detour.path)
            self._decided = DECIDE

    def _detours(self, q: np.ndarray, conflict: float) -> Iterator[Plan]:
        """Ways round where what moves will be, past it before or behind."""
        assert self._nominal is not None
        rest = self._nominal[self._now_at(q) :]
        still = [obstacle for obstacle in self._obstacles if not moves(obstacle)]
        for start, end in windows(conflict, self.settings.horizon):
            # where it is about to leave the arm or the goal alone, the roll-out tells whether it does in time
            places = [place for place in swept(self._obstacles, start, end) if self._spares_ends(place, q, rest[-1])]
            around = still + places
            if len(around) <= MAX_OBSTACLES:
                allowed = self._known_allowed(around)
                plan = self._quick.plan(rest, q, rest[-1], around, allowed=allowed, seed=self._tries)
                if plan.how == "escape":
                    yield plan

    def _spares_ends(self, place: Obstacle, q: np.ndarray, goal: Pose) -> bool:
        settings = self.settings.plan
        alone = PlanningScene(self._template, [place], settings.repet.distance, self._known_allowed([place]))
        return min(alone.slack(q), alone.tool_slack(goal)) > settings.repet.distance - settings.safety.distance

    def _goes_astray(self, q: np.ndarray, safety: int) -> bool:
        """True if the safety layer leads the tool away from its path, or from the line to its beginning."""
        assert self._path is not None
        if self._line is None:
            self._line = np.vstack([self.arm.fk(q).dq, self._path.dqs])
        if safety == FREE:
            return False
        later = path_deviation(self.arm, (q + self.settings.plan.motion.dt * self._out)[None], self._line)
        return later > MAX_DEVIATION and later > path_deviation(self.arm, q[None], self._line)

    def _following(self) -> str:
        return ESCAPING if self._detour else FOLLOWING

    def _step_joints(self, q: np.ndarray) -> Command:
        """Along the joints that a search has found, as far as what moves allows."""
        assert self._joints is not None
        dt, trace = self.settings.plan.motion.dt, self._joints
        if np.abs(q - trace[self._done]).max() < 0.02:
            self._done += 1
            self._pursuit_state[WAITED] = 0.0
        if self._done >= len(trace):
            self.state = DONE
            return self._stand(q, DONE)
        self._pursuit_state[WAITED] += dt
        self._wish[:] = (trace[self._done] - q) / dt
        return self._waited(q, self._command(ESCAPING, safe_velocity(self._scene.robot, q, self._wish, dt, self._out)))

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

    def _stand(self, q: np.ndarray, state: str) -> Command:
        dt = self.settings.plan.motion.dt
        command = self._command(state, safe_velocity(self._scene.robot, q, self._still, dt, self._out))
        if state in (DONE, FAILED):
            return command._replace(state=state, reason=self.reason, detail=self.detail)
        return command._replace(state=state) if command.state != BLOCKED else command

    def _waited(self, q: np.ndarray, command: Command) -> Command:
        """The command, after looking at how long nothing has got on: plan anew, or give up."""
        waited = self._pursuit_state[WAITED]
        if waited > self.settings.patience:
            self._lost += waited
            # what stands still at the goal will not leave it; a strict leg is begun again from elsewhere
            hopeless = (not self._moving or not self._may_detour) and self._tries >= 3
            hopeless |= not self._moving and self._why_not[0] == "goal in collision"
            if hopeless or self._lost > self.settings.give_up:
                self.state, (self.reason, self.detail) = FAILED, self._why()
                return self._stand(q, FAILED)
            self._tries, self._pursuit_state[WAITED] = self._tries + 1, 0.0
            if self._may_detour:
                self._replan(q, self._obstacles)
        return command

    def _why(self) -> tuple[str, str]:
        """Why it does not get on, as a reason and what is in the way of what."""
        tight = self._scene.tightest_seen()
        if tight is not None and tight.distance - tight.margin < self.settings.plan.safety.distance:
            return "blocked", str(tight)
        reason, detail = self._why_not
        return ("blocked", detail) if reason in BLOCKING else ("ik_or_limit", "")

    def _replan(self, q: np.ndarray, obstacles: Sequence[Obstacle]) -> None:
        """Lead the rest of the leg round obstacles taken to stand still; where that fails the path stays."""
        self._plan_now = False
        assert self._nominal is not None
        self._reached = self._now_at(q)
        rest = self._nominal[self._reached :]
        allowed = self._known_allowed(obstacles)
        plan = self._planner.plan(
            rest, q, rest[-1], obstacles, allowed=allowed, next_motion=self._next_motion, seed=self._tries
        )
        self._joints, self._detour = None, plan.success and plan.how != "direct"
        if plan.success and plan.how == "joint search":
            self._joints, self._done, self._path = plan.joints, 0, plan.path
        elif plan.success and plan.how == "escape":
            self._path = plan.path
        else:
            # joined where the plan does: it may be that the arm cannot follow what comes before
            self._reached += plan.guide if plan.success else 0
            self._path = self._nominal[self._reached :]
        self._why_not = plan.reason, plan.detail
        self._restart(self._path)

    def _now_at(self, q: np.ndarray) -> int:
        """Index of the leg's pose that is followed now; on a detour the one, from the last such, next to the tool."""
        assert self._nominal is not None
        if self._detour:
            return self._reached + nearest(self._nominal[self._reached :], self.arm.fk(q))
        return self._reached + int(self._pursuit_state[INDEX])

    def _restart(self, path: PosePath) -> None:
        self._path, self._pursuit_state = path, fresh_pursuit_state()
        self._decided, self._waiting = 0.0, False

    def _ahead(self) -> list[Obstacle]:
        return [o.at(self.settings.lead) if moves(o) else o for o in self._obstacles]

    def _bind(self) -> None:
        self._moving = any(moves(o) for o in self._obstacles)
        distance = self.settings.plan.repet.distance
        self._scene = PlanningScene(self._template, self._ahead(), distance, self._known_allowed(self._obstacles))

    def _known_allowed(self, obstacles: Sequence[Obstacle]) -> list[tuple[str, str]]:
        """The wanted contacts of what is there now."""
        names = {obstacle.name for obstacle in obstacles}
        return [pair for pair in self._allowed if pair[0] in self.body.names and pair[1] in names]
