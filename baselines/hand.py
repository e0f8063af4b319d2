"""One arm with its gripper as a program moves it: generators that yield an action per tick."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..planner.arm import Arm
from ..planner.errors import PlanFailed
from ..planner.motions import MotionSettings, follow
from ..planner.pose import Pose, PosePath
from ..planner.pursuit import ARRIVED, STALLED
from .policy import Observation

OPEN, CLOSE = -1.0, 1.0
Actions = Iterator[np.ndarray]


class Hand:
    """Commanded joints and gripper of one arm, and the latest observation.

    The loop is closed on the joints that were commanded, not on those measured: the servos lag by 40 ms, and
    feedback of the lag oscillates at the gains wanted here.

    Attributes:
        q: (dof,) commanded joints.
        observation: the latest; the policy renews it before each tick.
    """

    def __init__(self, arm: Arm, settings: MotionSettings, observation: Observation, index: int = 0):
        self.arm, self.settings, self.index = arm, settings, index
        self.observation = observation
        self.q = np.array(observation["joint_positions"][index], dtype=np.float64)
        self._gripper = OPEN

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

    def follow(self, path: PosePath, *, loosely: bool = False) -> Actions:
        """Follow a path to its end.

        Raises:
            PlanFailed: "ik_or_limit", no progress for the settings' patience.
        """
        pursuit = follow(self.arm, path, self.settings, loosely=loosely)
        while True:
            status, speeds = pursuit.step(self.q)
            if status == ARRIVED:
                return
            if status == STALLED:
                raise PlanFailed("ik_or_limit", self._stall_detail(pursuit.index, len(path)))
            yield self._command(speeds)

    def wait(self, seconds: float) -> Actions:
        """Stand still with the gripper as it is."""
        for _ in range(round(seconds / self.settings.dt)):
            yield self.still()

    def grip(self, direction: float, seconds: float) -> Actions:
        """Open or close the gripper and keep doing so."""
        self._gripper = direction
        return self.wait(seconds)

    def still(self) -> np.ndarray:
        """The action of standing still."""
        return self._command(np.zeros(self.arm.dof))

    def _command(self, speeds: np.ndarray) -> np.ndarray:
        normalized = np.clip(speeds / self.arm.velocity_limits, -1.0, 1.0)
        self.q = self.q + self.settings.dt * normalized * self.arm.velocity_limits
        return np.append(normalized, self._gripper)

    def _stall_detail(self, index: int, count: int) -> str:
        margins = np.minimum(self.q - self.arm.lower, self.arm.upper - self.q)
        joint = int(np.argmin(margins))
        near = f"{self.arm.joint_names[joint]} is {margins[joint]:.3f} rad from its limit"
        return f"no progress at pose {index + 1} of {count}; {near}"
