"""A simulated arm moved along waypoints under physics, and recorded from its joint encoders as a demonstration.

Between waypoints the tcp goes along one screw, starting and stopping smoothly. The recording holds what the encoders
measured, lag and sag included, not what the script wanted.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from ...planner.control.inverse_kinematics import inverse_kinematics
from ...planner.errors import BadDemonstration, PlanFailed
from ...planner.geometry import dualquat as dq
from ...planner.geometry.pose import Pose, PosePath
from ...planner.imitation.demonstration import Demonstration, Segment
from ...planner.robot.arm import Arm

LINEAR, ANGULAR = 0.25, 1.2
"""Peak speeds of the tcp [m/s, rad/s] where a waypoint does not say others."""
JOINT_SPEED = 0.6
"""Largest share of a joint's speed limit: more is done more slowly."""
PEAK = 1.5
"""Of the smooth step's speed, in means."""
CATCH_UP = 0.4
"""Seconds of standing still at the end of a motion, in which the servos catch up."""
JUDGED = 1.0
"""Seconds of standing still at the end of the script, in which the simulator judges."""


class Waypoint(NamedTuple):
    """Where the tcp goes next.

    Attributes:
        tcp: pose in the world.
        linear: peak speed [m/s].
        angular: peak speed [rad/s].
        hold: seconds of standing still there.
    """

    tcp: Pose
    linear: float = LINEAR
    angular: float = ANGULAR
    hold: float = 0.0


class ScriptedMotion(NamedTuple):
    """What becomes one segment of the demonstration.

    Attributes:
        name: of the segment.
        waypoints: in order.
        reference: name of the object that the end is relative to; its pose is taken there as observed. "": the world.
        held: name of the object in the hand, "" if it is empty.
        gripper: action at the end: 1 closes, below 0 opens to that part of the width, 0 leaves it.
        pause: seconds given to the gripper.
    """

    name: str
    waypoints: tuple[Waypoint, ...]
    reference: str = ""
    held: str = ""
    gripper: float = 0.0
    pause: float = 0.6


class _Recorder:
    """Steps an environment and keeps what the encoders say."""

    def __init__(self, env: Any, observation: dict[str, np.ndarray], gripper: float):
        self.env, self.arm = env, env.task.arms[0]
        self.observation, self.gripper, self.succeeded = observation, gripper, False
        self.q = observation["joint_positions"][0].copy()
        self.joints, self.commands = [self.q.copy()], [gripper]
        self.info: dict[str, Any] = {}
        self._free = 0

    def step(self, speeds: np.ndarray) -> None:
        """One control step with joint speeds (dof,) [rad/s]."""
        action = np.append(speeds / self.arm.velocity_limits, self.gripper)
        self.observation, *_, self.info = self.env.step(action)
        self.succeeded |= bool(self.info["success"])
        self.joints.append(self.observation["joint_positions"][0].copy())
        self.commands.append(self.gripper)

    def go(self, waypoint: Waypoint) -> None:
        """Go to a waypoint and wait there."""
        dt = self.env.control_dt
        for q in _joints_to(self.arm, self.q, waypoint, dt):
            self.step((q - self.q) / dt)
            self.q = q
        self.wait(waypoint.hold)

    def wait(self, seconds: float) -> None:
        """Stand still."""
        for _ in range(round(seconds / self.env.control_dt)):
            self.step(np.zeros(self.arm.dof))

    def motion(self, motion: ScriptedMotion) -> Segment:
        """Do a motion; the segment that it became."""
        start, names = max(self._free, len(self.joints) - 1), [each.name for each in self.env.task.objects]
        for waypoint in motion.waypoints:
            self.go(waypoint)
        self.wait(CATCH_UP)
        reference = Pose.identity()
        if motion.reference:
            reference = Pose.from_vector(self.observation["object_pose"][names.index(motion.reference)])
        stop = len(self.joints) - 1
        self._free = stop + 1
        action = "close" if motion.gripper > 0 else "open" if motion.gripper < 0 else "none"
        if motion.gripper:
            self.gripper = motion.gripper
            self.wait(motion.pause)
        return Segment(motion.name, start, stop, motion.reference, reference, motion.held, action)


def recorded(
    env: Any,
    observation: dict[str, np.ndarray],
    motions: Iterable[ScriptedMotion],
    *,
    name: str,
    licence: str = "MIT",
    gripper: float = -1.0,
) -> Demonstration:
    """The demonstration that a scripted arm gives in an environment that has just been reset.

    Args:
        env: an environment of this project (unwrapped), one arm, in the mode `joint_velocity`.
        observation: what its reset returned.
        motions: the script; asked for one by one, so that it may look at the environment in between.
        name: of the demonstration.
        licence: of the recording.
        gripper: action at the start.

    Raises:
        PlanFailed: "ik_or_limit", a waypoint cannot be reached.
        BadDemonstration: the simulator saw no success: what fails is not shown.
    """
    recorder = _Recorder(env, observation, gripper)
    segments = tuple(recorder.motion(motion) for motion in motions)
    recorder.wait(JUDGED)
    if not recorder.succeeded:
        info = recorder.info
        raise BadDemonstration(name, "script", f"no success: {info['stage']}, {info['failure_reason'] or 'unfinished'}")
    joints, arm, task = np.array(recorder.joints), recorder.arm, env.task
    return Demonstration(
        name=name,
        task=task.name,
        robot=task.robot,
        tcp_frame="grip_site",
        source="scripted",
        licence=licence,
        time=env.control_dt * np.arange(len(joints)),
        path=PosePath(np.array([arm.fk(q).dq for q in joints])),
        joint_positions=joints,
        gripper=np.array(recorder.commands),
        segments=segments,
        object_sizes={each.name: each.size for each in task.objects},
    )


def _joints_to(arm: Arm, q: np.ndarray, waypoint: Waypoint, dt: float) -> np.ndarray:
    """Joints (n, dof) at every tick of the way to a waypoint; slower where a joint would be too fast."""
    start = arm.fk(q)
    distance, angle = start.distance_to(waypoint.tcp)
    seconds = PEAK * max(distance / waypoint.linear, angle / waypoint.angular, dt)
    joints = _followed(arm, q, start, waypoint.tcp, seconds, dt)
    speed = np.abs(np.diff(joints, axis=0, prepend=q[None])).max(axis=0) / dt / arm.velocity_limits
    slower = float(speed.max()) / JOINT_SPEED
    return joints if slower <= 1.0 else _followed(arm, q, start, waypoint.tcp, slower * seconds, dt)


def _followed(arm: Arm, q: np.ndarray, start: Pose, end: Pose, seconds: float, dt: float) -> np.ndarray:
    """Joints at every tick of a screw from start to end, each near those before."""
    s = np.linspace(0.0, 1.0, max(2, round(seconds / dt)) + 1)[1:]
    joints = []
    for row in dq.sclerp(start.dq, end.dq, s * s * (3.0 - 2.0 * s)):
        reached = inverse_kinematics(arm, Pose(row), q)
        if reached is None:
            raise PlanFailed("ik_or_limit", f"the script leaves the reach of the {arm.name} on the way to {end}")
        joints.append(reached)
        q = reached
    return np.array(joints)
