"""Recordings against the robot that they name: its reach, the limits of its joints, its forward kinematics."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...envs import ROBOTS
from ...planner import Arm, Demonstration, PosePath
from ...planner.recordings.kinematic_check import checked_against_joints, joints_path, limits_in_words, reach_in_words
from ...planner.recordings.recording import blame_of


def known_arm(robot: str) -> Arm | None:
    """Return the arm of a shipped robot at the table; None of another robot."""
    from ...envs.scene.robots import robot_named
    from ...envs.scene.scene import robot_arm

    return robot_arm(robot_named(robot)) if robot in ROBOTS else None


def robot_named_like(robot: str) -> str:
    """Return the name of the shipped robot that differs from a name in nothing but capitals; else the name."""
    return next((name for name in ROBOTS if name.lower() == robot.lower()), robot)


def about_robot(robot: str) -> str:
    """Return a note that a recording of an unknown robot is not compared with it; "" about a shipped one."""
    known = ", ".join(ROBOTS)
    return "" if robot in ROBOTS else f"robot {robot!r} is unknown here, so nothing is compared with it; known: {known}"


def joints_in_words(file: Path, joints: np.ndarray, time: np.ndarray, arm: Arm, poses: PosePath | None) -> str:
    """Return how joints fit a robot and the recorded poses, in words.

    Args:
        file: for messages.
        joints: (n, dof) [rad or m].
        time: (n,) [s].
        arm: the robot.
        poses: n recorded poses of the hand; None if they were computed from the joints.

    Raises:
        BadDemonstration: they are beyond the robot's limits, or contradict the poses.
    """
    words = limits_in_words(joints, time, arm, blame_of(file, "joints"))
    if poses is None:
        return words
    return f"{words}; the path {checked_against_joints(file, 'poses', poses, joints_path(arm, joints))}"


def robot_facts(file: Path, demonstration: Demonstration) -> list[tuple[str, str]]:
    """Return how far a demonstration's hand moves, and how its joints fit, each a word and what is to be said.

    Args:
        file: of the demonstration, for messages.
        demonstration: the demonstration.

    Raises:
        BadDemonstration: path or joints are none of the robot that it names, or contradict each other.
    """
    arm, joints = known_arm(demonstration.robot), demonstration.joint_positions
    reach = reach_in_words(demonstration.path, demonstration.time, arm, "m", blame_of(file, "poses"))
    if joints is None:
        return [("reach", reach), ("joints", "not recorded")]
    if arm is None or joints.shape[1] != arm.dof:
        words = f"not compared with the poses: {demonstration.robot} has no model here"
    else:
        words = joints_in_words(file, joints, demonstration.time, arm, demonstration.path)
    return [("reach", reach), ("joints", f"{joints.shape[1]} recorded, {words}")]
