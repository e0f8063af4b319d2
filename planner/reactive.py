"""Algorithm 1 as one step: measured joints and obstacles in, a safe command out, replanned when the world changes.

Static obstacles are planned round as soon as they are seen. Moving ones are left to the safety layer and to waiting
at first, since most of them go away by themselves; only what stays in the way is planned round, at its present place.
Not in the paper: waiting, the whole arm, giving up with a reason.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from . import dualquat as dq
from .arm import Arm
from .body import Body
from .clearance import room_at, room_of_near
from .errors import BadOption
from .guarded import guarded_tick
from .planning import Planner
from .plans import PlanSettings
from .pose import METERS_PER_RADIAN, Pose, PosePath
from .pursuit import ARRIVED, INDEX, WAITED
from .safety import BLOCKED as UNSAFE
from .safety import safe_velocity
from .scene_work import Layout, SceneWork
from .shapes import Obstacle, Sphere
from .workspace import PURSUIT, bound

FOLLOWING, ESCAPING, WAITING, BLOCKED, DONE, FAILED = (
    "following", "escaping", "waiting", "blocked", "done", "failed",
)  # fmt: skip
STATES = (FOLLOWING, ESCAPING, WAITING, BLOCKED, DONE, FAILED)
STILL = 1e-4
"""Speed [m/s] up to which an obstacle stands still."""
SAME_PLACE = 1e-3
"""Way [m], or turn in screw length, of a standing obstacle that is a change of the scene."""


@dataclass(frozen=True, slots=True)
class ReactiveSettings:
    """How a leg is followed among obstacles that come and go.

    Attributes:
        plan: how it is planned; `plan.motion.dt` is the time step.
        horizon: seconds for which obstacles are foreseen with their velocity; 0: not at all.
        patience: seconds without progress after which it is planned anew, with what moves as if it stood still.
        give_up: seconds without progress in all after which the leg has failed.
        lead: seconds that the safety layer looks at moving obstacles ahead of time, for an arm that lags.
    """

    plan: PlanSettings = field(default_factory=PlanSettings)
    horizon: float = 0.6
    patience: float = 1.5
    give_up: float = 40.0
    lead: float = 0.05

    def __post_init__(self):
        for name in ("horizon", "lead"):
            if not 0 <= getattr(self, name) < 60:
                raise BadOption(name, f"{getattr(self, name)} is not from 0 to 60 s")
        if not 0 < self.patience <= self.give_up < math.inf:
            raise BadOption("patience", f"need 0 < patience <= give_up, got {self.patience} and {self.give_up}")


class Command(NamedTuple):
    """What to do now.

    Attributes:
        velocity: (dof,) joint speeds [rad/s or m/s].
        state: one of `STATES`.
        reason: why, where the state is "blocked" or "failed".
        room: smallest distance of a close pair less what it must keep [m]; inf if nothing is close.
    """

    velocity: np.ndarray
    state: str
    reason: str
    room: float


class ReactivePlanner:
    """Follows one leg after the other with one arm: `see` what is around, `go` along a path, `step` every tick."""

    def __init__(self, arm: Arm, body: Body, settings: ReactiveSettings | None = None):
        self.arm, self.settings = arm, settings or ReactiveSettings()
        plan = self.settings.plan
        # what is followed is already imitated: it is joined as early as it can be
        self._leg_settings = replace(plan, motion=replace(plan.motion, guide=0.0, max_guide=0.3))
        motion = plan.motion
        self._work = bound(arm, motion.controller.packed(), motion.pursuit.packed())
        self._wish, self._out, self._still = np.empty(arm.dof), np.empty(arm.dof), np.zeros(arm.dof)
        self._obstacles: tuple[Obstacle, ...] = ()
        self._allowed: tuple[tuple[str, str], ...] = ()
        self._joints: np.ndarray | None = None
        self._nominal: PosePath | None = None
        self._path: PosePath | None = None
        self._memory = np.zeros(4)
        self._planner = Planner(arm, body, self._leg_settings)
        self.hold(body)
        self.see(())
        self.stop()

    def hold(self, body: Body) -> None:
        """The body from now on: after something was grasped or released."""
        self.body = body
        self._planner.hold(body)
        self._layout = Layout(self.arm, body, self.settings.plan.safety, self.settings.plan.motion.dt)
        self._bind()

    def see(self, obstacles: Sequence[Obstacle], allowed: Sequence[tuple[str, str]] = ()) -> None:
        """What is around now, by measured place and velocity; and which contacts are wanted."""
        if obstacles is self._obstacles and allowed is self._allowed and not self._moving:
            return
        changed = tuple(allowed) != self._allowed or not _same_scene(self._obstacles, obstacles)
        self._obstacles, self._allowed = tuple(obstacles), tuple(allowed)
        if changed:
            self._bind()
            self._plan_now = True
        elif self._moving:
            self._scene.move(self._ahead())

    def go(self, path: PosePath, *, loosely: bool = False, onward: PosePath | None = None) -> None:
        """Follow a path to its end, joined from wherever the arm is; loosely: until it is within reach of the end."""
        self._nominal = self._path = path
        self._onward, self._joints = onward, None
        pursuit = self.settings.plan.motion.pursuit
        if loosely:
            radius = pursuit.capture_radius
            pursuit = replace(pursuit, position_tolerance=radius, angle_tolerance=5.0 * radius)
        packed = replace(pursuit, patience=1e9).packed()
        self._work[PURSUIT, : len(packed)] = packed
        self._restart(path)
        self._done = self._reached = 0
        self._lost, self._tries, self.reason, self._detour = 0.0, 0, "", False
        self._plan_now = bool(self._obstacles)
        self.state = FOLLOWING

    def stop(self) -> None:
        """No leg: stand still, retreating from what comes too close."""
        self._nominal = self._path = None
        self._plan_now, self.state, self.reason = False, DONE, ""

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
            self._replan(joints, [o for o in self._obstacles if not _moves(o)])
        if self._joints is not None:
            return self._step_joints(joints)
        path = self._path
        dt = self.settings.plan.motion.dt
        status, safety = guarded_tick(
            self._work, self._scene.robot, path.dqs, joints, dt, self._memory, self._wish, self._out
        )
        if status == ARRIVED:
            self.state = DONE
            return self._stand(joints, DONE)
        if self._moving and self._better_waits(joints):
            return self._waited(joints, self._stand(joints, WAITING))
        return self._waited(joints, self._command(self._following(), safety))

    def _following(self) -> str:
        return ESCAPING if self._detour else FOLLOWING

    def _step_joints(self, q: np.ndarray) -> Command:
        """Along the joints that a search has found, as far as what moves allows."""
        assert self._joints is not None
        dt, trace = self.settings.plan.motion.dt, self._joints
        if np.abs(q - trace[self._done]).max() < 0.02:
            self._done += 1
            self._memory[WAITED] = 0.0
        if self._done >= len(trace):
            self.state = DONE
            return self._stand(q, DONE)
        self._memory[WAITED] += dt
        self._wish[:] = (trace[self._done] - q) / dt
        return self._waited(q, self._command(ESCAPING, safe_velocity(self._scene.robot, q, self._wish, dt, self._out)))

    def _command(self, state: str, safety: int) -> Command:
        room = float(room_of_near(self._scene.robot, -1, 0.0))
        if safety == UNSAFE:
            return Command(self._out.copy(), BLOCKED, "an obstacle comes closer than the arm can keep away", room)
        return Command(self._out.copy(), state, "", room)

    def _stand(self, q: np.ndarray, state: str) -> Command:
        dt = self.settings.plan.motion.dt
        command = self._command(state, safe_velocity(self._scene.robot, q, self._still, dt, self._out))
        return command._replace(state=state, reason=self.reason) if state in (DONE, FAILED) else command

    def _waited(self, q: np.ndarray, command: Command) -> Command:
        """The command, after looking at how long nothing has got on: plan anew, or give up."""
        if command.state == WAITING:
            self._memory[WAITED] += self.settings.plan.motion.dt
        waited = self._memory[WAITED]
        if waited > self.settings.patience:
            self._lost += waited
            if self._lost > self.settings.give_up or (not self._moving and self._tries >= 3):
                self.state, self.reason = FAILED, self._why(q)
                return self._stand(q, FAILED)
            self._tries += 1
            self._replan(q, self._obstacles)
            self._memory[WAITED] = 0.0
        return command

    def _why(self, q: np.ndarray) -> str:
        if room_of_near(self._scene.robot, -1, 0.0) < self.settings.plan.safety.distance:
            return "blocked"
        return "ik_or_limit"

    def _better_waits(self, q: np.ndarray) -> bool:
        """True if going on would come too close within the horizon, but standing still would not."""
        robot, seconds = self._scene.robot, self.settings.horizon
        going = staying = math.inf
        for part in (0.25, 0.5, 0.75, 1.0):
            going = min(going, room_at(robot, q + part * seconds * self._wish, part * seconds, 0.1))
            staying = min(staying, room_at(robot, q, part * seconds, 0.1))
        return going < 0.0 <= staying

    def _replan(self, q: np.ndarray, obstacles: Sequence[Obstacle]) -> None:
        """Lead the rest of the leg round obstacles taken to stand still; where that fails the path stays."""
        self._plan_now = False
        assert self._nominal is not None
        self._reached = self._nearest(q) if self._detour else self._reached + int(self._memory[INDEX])
        rest = self._nominal[self._reached :]
        allowed = self._known_allowed(obstacles)
        plan = self._planner.plan(rest, q, rest[-1], obstacles, allowed=allowed, onward=self._onward, seed=self._tries)
        self._joints, self._detour = None, plan.success and plan.how != "direct"
        if plan.success and plan.how == "joint search":
            self._joints, self._done, self._path = plan.joints, 0, plan.path
        elif plan.success and plan.how == "escape":
            self._path = plan.path
        else:
            self._path = rest if self._reached else self._nominal
            self.reason = plan.reason
        self._restart(self._path)

    def _nearest(self, q: np.ndarray) -> int:
        """Index of the leg's pose, from the last such one on, that is nearest to the tool."""
        assert self._nominal is not None
        path = self._nominal.dqs[self._reached :]
        distance, angle = dq.gap(self.arm.fk(q).dq[None], path)
        return self._reached + int(np.argmin(np.hypot(distance, METERS_PER_RADIAN * angle)))

    def _restart(self, path: PosePath) -> None:
        self._path, self._memory = path, np.array([0.0, 0.0, np.inf, 0.0])

    def _ahead(self) -> list[Obstacle]:
        return [o.at(self.settings.lead) if _moves(o) else o for o in self._obstacles]

    def _bind(self) -> None:
        self._moving = any(_moves(o) for o in self._obstacles)
        distance = self.settings.plan.repet.distance
        self._scene = SceneWork(self._layout, self._ahead(), distance, self._known_allowed(self._obstacles))

    def _known_allowed(self, obstacles: Sequence[Obstacle]) -> list[tuple[str, str]]:
        """The wanted contacts of what is there now."""
        names = {obstacle.name for obstacle in obstacles}
        return [pair for pair in self._allowed if pair[0] in self.body.names and pair[1] in names]


def _moves(obstacle: Obstacle) -> bool:
    return float(np.abs(obstacle.velocity).max()) > STILL


def _same_scene(before: Sequence[Obstacle], now: Sequence[Obstacle]) -> bool:
    """True if the same obstacles are there, those that stand still in the same places."""
    if len(before) != len(now):
        return False
    for old, new in zip(before, now, strict=True):
        if old.name != new.name or old.shape != new.shape or old.margin != new.margin or _moves(old) != _moves(new):
            return False
        if not _moves(new):
            distance, angle = old.pose.gap(new.pose)
            if math.hypot(distance, METERS_PER_RADIAN * angle) > SAME_PLACE:
                return False
    return True


def warm_up(arm: Arm, body: Body) -> None:
    """Compile, or load from the cache, what following among obstacles may need, so that no tick has to wait for it."""
    low, high = np.maximum(arm.lower, -1.0), np.minimum(arm.upper, 1.0)
    q = 0.5 * (low + high)
    path = PosePath(arm.fk(q).dq[None])
    things = (Obstacle(Sphere(0.01), Pose.from_position_quaternion([0.0, 0.0, 50.0]), np.array([0.0, 0.0, 1e-3])),)
    planner = ReactivePlanner(arm, body)
    for seen in (things, (replace(things[0], velocity=np.zeros(3)),)):
        planner.see(seen)
        planner.go(path)
        planner.step(q)
        planner.see(tuple(obstacle.at(0.02) for obstacle in seen))
        planner.step(q)
