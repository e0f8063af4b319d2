"""Recording of a demonstration: a simulated arm follows scripted waypoints under physics.

Between waypoints the tcp follows one screw, with a smooth start and stop. The demonstration contains the measured joint
positions, lag and sag included, not the commanded ones.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from ...planner import Arm, Demonstration, Pose, PosePath, Segment
from ...planner.control.inverse_kinematics import inverse_kinematics
from ...planner.errors import BadDemonstration, PlanFailed
from ...planner.geometry import dualquat as dq

LINEAR, ANGULAR = 0.25, 1.2
"""Default peak speeds of the tcp [m/s, rad/s]."""
JOINT_SPEED = 0.6
"""Largest share of a joint's speed limit; faster motions are slowed down."""
PEAK = 1.5
"""Ratio of peak to mean speed of the smooth step."""
CATCH_UP = 0.4
"""Time [s] of standing still at the end of a motion, in which the servos catch up."""
JUDGED = 1.0
"""Time [s] of standing still at the end of the script, in which the simulator judges success."""


class Waypoint(NamedTuple):
    """Next pose of the tcp.

    Attributes:
        tcp: pose in the world.
        linear: peak speed [m/s].
        angular: peak speed [rad/s].
        hold: time [s] of standing still at the pose.
    """

    tcp: Pose
    linear: float = LINEAR
    angular: float = ANGULAR
    hold: float = 0.0


class ScriptedMotion(NamedTuple):
    """Motion that becomes one segment of the demonstration.

    Attributes:
        name: name of the segment.
        waypoints: waypoints in order.
        reference: name of the object or furniture that the end is relative to, with its pose observed at the end; "":
            the world.
        held: name of the object in the hand; "" if the hand is empty.
        gripper: gripper action at the end: 1 closes, a negative value opens to that share of the width, 0 does nothing.
        pause: time [s] for the gripper action.
    """

    name: str
    waypoints: tuple[Waypoint, ...]
    reference: str = ""
    held: str = ""
    gripper: float = 0.0
    pause: float = 0.6


class _Recorder:
    """Stepper of an environment that records the encoders."""

    def __init__(self, env: Any, observation: dict[str, np.ndarray], gripper: float):
        self.env, self.arm = env, env.task.arms[0]
        self.observation, self.gripper, self.succeeded = observation, gripper, False
        self.q = observation["joint_positions"][0].copy()
        self.joints, self.commands = [self.q.copy()], [gripper]
        self.sent, self.objects = [self.q.copy()], [observation["object_pose"].copy()]
        self.info: dict[str, Any] = {}
        self._free = 0

    def step(self, speeds: np.ndarray) -> None:
        """Take one control step with joint speeds (dof,) [rad/s]."""
        action = np.append(speeds / self.arm.velocity_limits, self.gripper)
        self.observation, *_, self.info = self.env.step(action)
        self.succeeded |= bool(self.info["success"])
        self.joints.append(self.observation["joint_positions"][0].copy())
        self.commands.append(self.gripper)
        self.objects.append(self.observation["object_pose"].copy())

    def go(self, waypoint: Waypoint) -> None:
        """Move to a waypoint and wait there."""
        dt = self.env.control_dt
        for q in _joints_to(self.arm, self.q, waypoint, dt):
            self.step((q - self.q) / dt)
            self.q = q
            self.sent.append(q)
        self.wait(waypoint.hold)

    def wait(self, seconds: float) -> None:
        """Stand still."""
        for _ in range(round(seconds / self.env.control_dt)):
            self.step(np.zeros(self.arm.dof))
            self.sent.append(self.q)

    def fixtures(self) -> dict[str, Pose]:
        """Return the poses of the furniture by name."""
        names = [each.name for each in self.env.task.furniture]
        return {
            name: Pose.from_vector(row) for name, row in zip(names, self.observation["furniture_pose"], strict=True)
        }

    def motion(self, motion: ScriptedMotion) -> Segment:
        """Execute a motion and return its segment."""
        start, names = max(self._free, len(self.joints) - 1), [each.name for each in self.env.task.objects]
        fixed = [each.name for each in self.env.task.furniture]
        for number, waypoint in enumerate(motion.waypoints):
            try:
                self.go(waypoint)
            except PlanFailed as failed:
                down = -waypoint.tcp.rotation[2, 2]
                turned = "; there the tool points up: quaternions are wxyz, 0 1 0 0 points down" if down < 0.0 else ""
                where = f"waypoint {number} of {motion.name!r}: {failed.detail}{turned}"
                raise PlanFailed(failed.reason, where) from None
        self.wait(CATCH_UP)
        reference = Pose.identity()
        if motion.reference in fixed:
            reference = self.fixtures()[motion.reference]
        elif motion.reference:
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
    """Record the demonstration of a scripted arm in an environment that has just been reset.

    Args:
        env: environment of this project (unwrapped) with one arm, in the control mode `joint_velocity`.
        observation: observation of the reset.
        motions: motions of the script, requested one by one, so that the script may look at the environment in between.
        name: name of the demonstration.
        licence: license of the recording.
        gripper: gripper action at the start.

    Raises:
        PlanFailed: "ik_or_limit", a waypoint cannot be reached.
        BadDemonstration: the simulator reported no success: failures are not recorded.
    """
    recorder = _Recorder(env, observation, gripper)
    segments = tuple(recorder.motion(motion) for motion in motions)
    recorder.wait(JUDGED)
    if not recorder.succeeded:
        info = recorder.info
        last = f"at the end the hand is {'closed' if recorder.gripper > 0 else 'open'}{_still_missing(info)}"
        reason = f"no success: {info['stage']}, {info['failure_reason'] or 'unfinished'}; {last}"
        raise BadDemonstration(name, "script", reason)
    joints, arm, task = np.array(recorder.joints), recorder.arm, env.task
    paths = np.swapaxes(np.array(recorder.objects), 0, 1)
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
        object_paths={each.name: PosePath.from_vectors(rows) for each, rows in zip(task.objects, paths, strict=True)},
        fixtures=recorder.fixtures() if task.furniture else {},
        commanded=PosePath(np.array([arm.fk(q).dq for q in recorder.sent])),
    )


def _still_missing(info: dict[str, Any]) -> str:
    """Return how far objects are from their goals, in words; "" if the task does not say."""
    errors = np.atleast_1d(info.get("position_error", ()))
    return (
        f", objects are {', '.join(f'{1e3 * error:.1f}' for error in errors)} mm from their goals"
        if len(errors)
        else ""
    )


def _joints_to(arm: Arm, q: np.ndarray, waypoint: Waypoint, dt: float) -> np.ndarray:
    """Return the joints (n, dof) at every tick of the motion to a waypoint; slower where a joint would be too fast."""
    start = arm.fk(q)
    distance, angle = start.distance_to(waypoint.tcp)
    seconds = PEAK * max(distance / waypoint.linear, angle / waypoint.angular, dt)
    joints = _followed(arm, q, start, waypoint.tcp, seconds, dt)
    speed = np.abs(np.diff(joints, axis=0, prepend=q[None])).max(axis=0) / dt / arm.velocity_limits
    slower = float(speed.max()) / JOINT_SPEED
    return joints if slower <= 1.0 else _followed(arm, q, start, waypoint.tcp, slower * seconds, dt)


def _followed(arm: Arm, q: np.ndarray, start: Pose, end: Pose, seconds: float, dt: float) -> np.ndarray:
    """Return the joints (n, dof) at every tick of a screw from start to end, each near the previous ones."""
    s = np.linspace(0.0, 1.0, max(2, round(seconds / dt)) + 1)[1:]
    joints = []
    for row in dq.sclerp(start.dq, end.dq, s * s * (3.0 - 2.0 * s)):
        reached = inverse_kinematics(arm, Pose(row), q)
        if reached is None:
            raise PlanFailed("ik_or_limit", f"the script leaves the reach of the {arm.name} on the way to {end}")
        joints.append(reached)
        q = reached
    return np.array(joints)
