"""One arm and its gripper as moved by a program: generators that yield an action per tick."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import count
from typing import NamedTuple

import numpy as np

from ...planner import (
    Arm,
    Body,
    Command,
    NextMotion,
    Obstacle,
    Plan,
    Planner,
    PlanRequest,
    Pose,
    PosePath,
    ReactiveSettings,
    Shape,
    final_path,
)
from ...planner.errors import PlanFailed
from ...planner.geometry.shapes import moves
from ...planner.reactive.command import DONE, ESCAPING, FAILED
from ...planner.resumable import Resumable
from ...planner.robot.joint_limits import near_limit
from ..motion.motion_method import ESCAPE, PATH, SCREW, MotionMethod
from ..motion.path_generators import parted
from ..policy import LabeledPath, Observation
from .goal_choice import ChosenMotion, MotionChoice, choose, departure_path
from .thought import T, Thought, thought
from .world_model import WorldModel

OPEN, CLOSE = -1.0, 1.0
LOST = 0.03
"""Displacement [m] of an object in the hand since the grasp beyond which the object counts as dropped."""
SLIP, TURN = 0.002, 0.02
"""Displacement [m] and angle [rad] an object must slip in the hand before its guarded pose is updated."""
OFF = 0.03
"""Height [m] above its support from which a lifted object may take a detour."""
GLANCE = 5
"""Ticks between checks of the held object."""
Actions = Iterator[np.ndarray]


class _Held(NamedTuple):
    """The held object: index, shape, `tcp_from_object` at the grasp, and `tcp_from_object` as guarded."""

    index: int
    shape: Shape | Sequence[Obstacle]
    grasped: Pose
    guarded: Pose


class ArmExecutor:
    """Commanded joints and gripper of one arm, its surroundings, and the latest observation.

    The loop is closed on the commanded joints, not the measured ones: the servos lag by 40 ms, and feedback of the lag
    oscillates at the gains wanted here.

    Args:
        arm: the arm.
        body: its capsules with an empty hand.
        settings: see `ReactiveSettings`.
        world_model: obstacles around the arm.
        observation: the first one.
        index: index of the arm in the observation.
        motion_method: method of executing motions.

    Attributes:
        q: (dof,) commanded joints [rad].
        before: (dof,) commanded joints [rad] before the last action.
        empty: the body with an empty hand.
        observation: the latest; updated by the policy before each tick.
        drawn: paths for display: each finished detour that was not demonstrated, as commanded, and the final paths that
            plans would have followed without the detour.
    """

    def __init__(
        self,
        arm: Arm,
        body: Body,
        settings: ReactiveSettings,
        world_model: WorldModel,
        observation: Observation,
        index: int = 0,
        *,
        motion_method: MotionMethod = SCREW,
    ):
        self.arm, self.settings, self.index = arm, settings.plan.motion, index
        self.observation, self.world_model = observation, world_model
        self.q = self.before = np.array(observation["joint_positions"][index], dtype=np.float64)
        self._gripper, self.empty, self._full, self._pace = OPEN, body, arm.velocity_limits, 1.0
        self._held: _Held | None = None
        self.drawn: list[LabeledPath] = []
        self._escape: list[np.ndarray] = []
        self.motion_method, self._planner = motion_method, motion_method.follower(arm, body, settings)

    @property
    def measured_tcp(self) -> Pose:
        """Pose of the tcp as observed."""
        return Pose.from_vector(self.observation["tcp_pose"][self.index])

    def object_pose(self, index: int) -> Pose:
        """Return the observed pose of an object."""
        return Pose.from_vector(self.observation["object_pose"][index])

    def goal_pose(self, index: int) -> Pose:
        """Return the goal pose of an object."""
        return Pose.from_vector(self.observation["goal_pose"][index])

    def slow_down(self, pace: float) -> None:
        """Limit the joints to a fraction of their speed limits from now on; only between motions."""
        if pace != self._pace:
            self._pace, self.arm = pace, replace(self.arm, velocity_limits=pace * self._full)
            self._planner = self.motion_method.follower(self.arm, self._planner.body, self._planner.settings)

    def hold(self, index: int, shape: Shape | Sequence[Obstacle], tcp_from_object: Pose) -> None:
        """Treat an object as part of the arm from now on, no longer as an obstacle.

        Args:
            index: index of the object.
            shape: shape of the object.
            tcp_from_object: its pose in the hand.
        """
        self._held = _Held(index, shape, tcp_from_object, tcp_from_object)
        self.world_model.exclude(index)
        self._planner.hold(self.body_with(shape, tcp_from_object))

    def tcp_from(self, index: int) -> Pose:
        """Return the observed pose of an object in the hand."""
        return self.measured_tcp.inverse() @ self.object_pose(index)

    def lifted(self) -> Pose:
        """Return the observed `tcp_from_object` of the object that was grasped and lifted.

        Raises:
            PlanFailed: "dropped", the object was left behind.
        """
        assert self._held is not None
        now = self.tcp_from(self._held.index)
        if now.distance_to(self._held.grasped)[0] > LOST:
            raise PlanFailed("dropped", f"{self.world_model.name(self._held.index)} is not in the hand after the lift")
        return now

    def body_with(self, shape: Shape | Sequence[Obstacle], tcp_from_object: Pose) -> Body:
        """Return the body with an object in the hand, named "held".

        Args:
            shape: shape of the object.
            tcp_from_object: its pose in the hand.
        """
        return self.empty.holding("held", shape, tcp_from_object, self.arm)

    def release(self) -> None:
        """Treat the hand as empty from now on."""
        self._held = None
        self.world_model.exclude(None)
        self._planner.hold(self.empty)

    def allow(self, contacts: Sequence[tuple[str, str]]) -> None:
        """Set the allowed contacts from now on: of "fingers" or "held" with a named object."""
        self.world_model.allow(contacts)

    def thought(self, work: Resumable[T]) -> Thought[T]:
        """Stand still during a computation; return its result."""
        return thought(work, self._planner.settings.budget, self.still)

    def choose(
        self, motion: MotionChoice, then: Callable[[int], MotionChoice] | None = None, *, search: bool = True
    ) -> Thought[ChosenMotion]:
        """Return the best goal of a motion from here; see `goal_choice.choose`. Meanwhile the arm stands still.

        Args:
            motion: the motion.
            then: returns the next motion by the index of the goal; None if there is none.
            search: whether joint space is searched where nothing else leads to a goal.

        Raises:
            PlanFailed: "blocked" or "ik_or_limit", no goal can be reached.
        """
        settings = self._planner.settings.plan if search else replace(self._planner.settings.plan, search=None)
        return self.thought(choose(self.arm, settings, self.q, motion, then, self.motion_method))

    def is_clear(self, motion: MotionChoice) -> Thought[bool]:
        """Return whether the arm touches nothing, where it is, that it must not touch in a motion."""
        here, still = self.arm.fk(self.q), tuple(each for each in motion.obstacles if not moves(each))
        planner = Planner(self.arm, motion.body, replace(self._planner.settings.plan, search=None, trees=False))
        path = PosePath(np.array([here.dq, here.dq]))
        found = yield from self.thought(planner.answering(PlanRequest(path, self.q, here, still, motion.allowed)))
        return found.reason != "start in collision"

    def departure_path(self, motion: MotionChoice) -> Thought[PosePath | None]:
        """Return the departure of a motion from here; see `goal_choice.departure_path`."""
        return self.thought(departure_path(self.arm, self._planner.settings.plan, self.q, motion))

    def go(self, choice: ChosenMotion) -> Actions:
        """Execute the chosen motion."""
        *before, (last, exact) = choice.parts
        for path, to_its_end in before:
            yield from self.follow(path, exact=to_its_end)
        keep = choice.motion is not None and choice.motion.must_keep
        yield from self.follow(last, exact=exact, next_motion=choice.next_motion, plan=choice.plan, must_keep=keep)

    def follow(
        self,
        path: PosePath,
        *,
        exact: bool = True,
        next_motion: NextMotion | None = None,
        detours: bool = True,
        must_keep: bool = False,
        plan: Plan | None = None,
    ) -> Actions:
        """Follow a path to its end, around obstacles.

        Args:
            path: path of the tcp.
            exact: False: finish as soon as the tool is within reach of the end.
            next_motion: the next motion: where there is a choice, the path ends in a posture that suits it.
            detours: False: along the path or not at all.
            must_keep: new plans must keep some of the path, see `PlanRequest.must_keep`.
            plan: the plan the path comes from; if its `how` is PATH, the follower gets the plan itself.

        Raises:
            PlanFailed: "blocked" or "ik_or_limit", no progress for the settings' patience; "dropped", the held object
                was lost.
        """
        if plan is not None and plan.how == PATH:
            self._planner.follow(plan, exact=exact)
        else:
            kept = plan.kept_along(path) if plan is not None else {}
            self._planner.go(path, exact=exact, next_motion=next_motion, detours=detours, must_keep=must_keep, **kept)
        led = plan if plan is not None and plan.how == ESCAPE else None
        if led:
            self.drawn.append(LabeledPath("final", "", final_path(self.arm.fk(self.q), led.imitated, led.guide)))
        for tick in count():
            if tick % GLANCE == 0:
                self._mind_held()
            command = self._planned()
            self._note_escape(command, led is not None)
            if command.state == DONE:
                return
            if command.state == FAILED:
                stalled = f"no progress; {near_limit(self.arm, self.q) or 'no joint is near its limit'}"
                raise PlanFailed(command.reason, command.detail or stalled)
            yield self._action(command.velocity)

    def leave(self, path: PosePath, distance: float) -> Actions:
        """Follow a path to within reach of its end, without detours near its beginning.

        A detour there would push objects over.

        Args:
            path: path of the tcp.
            distance: distance [m] from the beginning up to which there are no detours.

        Raises:
            PlanFailed: as `follow`.
        """
        near, rest = parted(path, distance)
        yield from self.follow(near, exact=False, detours=False)
        if rest is not None:
            yield from self.follow(rest, exact=False)

    def _note_escape(self, command: Command, led: bool) -> None:
        if command.state == ESCAPING or (led and command.state not in (DONE, FAILED)):
            self._escape.append(self.arm.fk(self.q).dq)
        elif self._escape:
            self.drawn.append(LabeledPath("escape", "", PosePath(np.array(self._escape))))
            self._escape = []

    def _mind_held(self) -> None:
        """Update the guarded pose of a held object that has slipped."""
        if self._held is None:
            return
        held, now = self._held, self.tcp_from(self._held.index)
        if held.grasped.distance_to(now)[0] > LOST:
            raise PlanFailed("dropped", f"{self.world_model.name(held.index)} is not in the hand any more")
        distance, angle = held.guarded.distance_to(now)
        if distance > SLIP or angle > TURN:
            self._held = held._replace(guarded=now)
            self._planner.hold(self.body_with(held.shape, now))

    def wait(self, seconds: float) -> Actions:
        """Stand still with the gripper unchanged."""
        self._planner.stop()
        for _ in range(round(seconds / self.settings.dt)):
            yield self.still()

    def grip(self, direction: float, seconds: float) -> Actions:
        """Open or close the gripper and keep the command.

        Args:
            direction: `OPEN` or `CLOSE`.
            seconds: time [s] to wait meanwhile.
        """
        self._gripper = direction
        return self.wait(seconds)

    def still(self) -> np.ndarray:
        """Return the action of standing still, or of retreating from approaching obstacles."""
        self._planner.stop()
        return self._action(self._planned().velocity)

    def hold_still(self) -> np.ndarray:
        """Return the action of standing still or retreating before the last action is taken; see `Policy`."""
        here = self.before
        self._see()
        action = self._action(self._planner.stand(here).velocity)
        self.before = here + self.q - self.before
        return action

    def _see(self) -> None:
        self._planner.see(self.world_model.obstacles(self.observation), self.world_model.allowed)

    def _planned(self) -> Command:
        self._see()
        return self._planner.step(self.q)

    def _action(self, speeds: np.ndarray) -> np.ndarray:
        normalized = np.clip(speeds / self._full, -1.0, 1.0)
        self.before, self.q = self.q, self.q + self.settings.dt * normalized * self._full
        return np.append(normalized, self._gripper)
