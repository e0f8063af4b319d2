"""One arm with its gripper as a program moves it: generators that yield an action per tick."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..planner.arm import Arm
from ..planner.body import Body
from ..planner.command import DONE, FAILED, ReactiveSettings
from ..planner.errors import PlanFailed
from ..planner.plans import Plan
from ..planner.pose import Pose, PosePath
from ..planner.shapes import Shape
from .choice import Choice, Leg, choose, way_out
from .made_follower import MadeFollower
from .mover import MADE, SCREW, Mover
from .policy import Observation
from .surroundings import Surroundings

OPEN, CLOSE = -1.0, 1.0
Actions = Iterator[np.ndarray]


class Hand:
    """Commanded joints and gripper of one arm, what is around it, and the latest observation.

    The loop is closed on the joints that were commanded, not on those measured: the servos lag by 40 ms, and
    feedback of the lag oscillates at the gains wanted here.

    Attributes:
        q: (dof,) commanded joints.
        empty: the body with nothing in the hand.
        observation: the latest; the policy renews it before each tick.
    """

    def __init__(
        self,
        arm: Arm,
        body: Body,
        settings: ReactiveSettings,
        surroundings: Surroundings,
        observation: Observation,
        index: int = 0,
        *,
        mover: Mover = SCREW,
    ):
        self.arm, self.settings, self.index = arm, settings.plan.motion, index
        self.observation, self.surroundings = observation, surroundings
        self.q = np.array(observation["joint_positions"][index], dtype=np.float64)
        self._gripper, self.empty, self._full = OPEN, body, arm.velocity_limits
        self.mover, self._planner = mover, mover.follower(arm, body, settings)

    @property
    def measured_tcp(self) -> Pose:
        """Pose of the tcp as observed."""
        return Pose.from_vector(self.observation["tcp_pose"][self.index])

    def object_pose(self, index: int) -> Pose:
        """Pose of an object as observed."""
        return Pose.from_vector(self.observation["object_pose"][index])

    def goal_pose(self, index: int) -> Pose:
        """Where an object must end."""
        return Pose.from_vector(self.observation["goal_pose"][index])

    def slow_down(self, pace: float) -> None:
        """From now on use a share of the joints' speed limits; the hand must be empty, and on no path."""
        self.arm = replace(self.arm, velocity_limits=pace * self._full)
        self._planner = self.mover.follower(self.arm, self.empty, self._planner.settings)

    def hold(self, index: int, shape: Shape, tcp_from_object: Pose) -> None:
        """From now on object `index` is part of the arm, and no longer around it."""
        self.surroundings.without(index)
        self._planner.hold(self.body_with(shape, tcp_from_object))

    def body_with(self, shape: Shape, tcp_from_object: Pose) -> Body:
        """The body with an object in the hand, as "held"."""
        return self.empty.holding("held", shape, tcp_from_object, self.arm)

    def release(self) -> None:
        """From now on the hand is empty."""
        self.surroundings.without(None)
        self._planner.hold(self.empty)

    def allow(self, contacts: Sequence[tuple[str, str]]) -> None:
        """The contacts that are wanted from now on: of "fingers" or "held" with a named thing."""
        self.surroundings.allow(contacts)

    def choose(self, leg: Leg, then: Callable[[int], Leg] | None = None) -> Choice:
        """The best goal of a leg from here; see `choice.choose`."""
        return choose(self.arm, self._planner.settings.plan, self.q, leg, then, self.mover)

    def way_out(self, leg: Leg) -> PosePath | None:
        """How a leg leaves from here; see `choice.way_out`."""
        return way_out(self.arm, self._planner.settings.plan, self.q, leg)

    def go(self, choice: Choice) -> Actions:
        """Do what was chosen."""
        for path, loosely in choice.parts:
            plan = None if loosely else choice.plan
            yield from self.follow(path, loosely=loosely, onward=choice.onward, plan=plan)

    def follow(
        self,
        path: PosePath,
        *,
        loosely: bool = False,
        onward: PosePath | None = None,
        plan: Plan | None = None,
    ) -> Actions:
        """Follow a path to its end, round what is in the way.

        Args:
            path: of the tcp.
            loosely: until it is within reach of the end.
            onward: the path that comes next: where there is a choice, it ends in a posture that suits it.
            plan: what the path comes from; a hand that moves as it has planned follows that.

        Raises:
            PlanFailed: "blocked" or "ik_or_limit", no progress for the settings' patience.
        """
        if plan is not None and plan.how in MADE and isinstance(self._planner, MadeFollower):
            self._planner.follow(plan, loosely=loosely)
        else:
            self._planner.go(path, loosely=loosely, onward=onward)
        while True:
            command = self._planned()
            if command.state == DONE:
                return
            if command.state == FAILED:
                raise PlanFailed(command.reason, command.detail or self._stall_detail())
            yield self._action(command.velocity)

    def wait(self, seconds: float) -> Actions:
        """Stand still with the gripper as it is."""
        self._planner.stop()
        for _ in range(round(seconds / self.settings.dt)):
            yield self.still()

    def grip(self, direction: float, seconds: float) -> Actions:
        """Open or close the gripper and keep doing so."""
        self._gripper = direction
        return self.wait(seconds)

    def still(self) -> np.ndarray:
        """The action of standing still, or of retreating from what comes too close."""
        self._planner.stop()
        return self._action(self._planned().velocity)

    def _planned(self):
        self._planner.see(self.surroundings.seen(self.observation), self.surroundings.allowed)
        return self._planner.step(self.q)

    def _action(self, speeds: np.ndarray) -> np.ndarray:
        normalized = np.clip(speeds / self._full, -1.0, 1.0)
        self.q = self.q + self.settings.dt * normalized * self._full
        return np.append(normalized, self._gripper)

    def _stall_detail(self) -> str:
        margins = np.minimum(self.q - self.arm.lower, self.arm.upper - self.q)
        joint = int(np.argmin(margins))
        near = f"{self.arm.joint_names[joint]} is {margins[joint]:.3f} rad from its limit"
        return f"no progress; {near}"
