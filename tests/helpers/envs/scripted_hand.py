"""A hand that is sent through poses in one of robosuite's tasks, recorded in the layout of a person's teleoperation.

The recording has the names of an older robosuite, and the world of its task, in which the robot's base may stand
elsewhere than at this project's table.
"""

from __future__ import annotations

from pathlib import Path

import gymnasium as gym
import numpy as np
from helpers.arms import table_panda
from scipy.spatial.transform import Rotation

import onedemo.envs  # noqa: F401  registers the ids
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.imitation.demonstration import Demonstration
from onedemo.planner.recordings.import_recording import demonstration_of
from onedemo.planner.recordings.teleoperation import recording_from_teleoperation

RATE = 2
"""Steps of the environment per sample."""


class ScriptedHand:
    """The hand of one episode."""

    def __init__(self, task: str, seed: int):
        self.env = gym.make("onedemo/Robosuite-v0", task=task, control_mode="ee_twist").unwrapped
        self.seen, self.info = self.env.reset(seed=seed)
        self._gripper, self._steps = -1.0, 0
        self._rows: dict[str, list] = {key: [] for key in ("q", "ee", "objects", "actions")}

    @property
    def tcp(self) -> Pose:
        return Pose.from_vector(self.seen["tcp_pose"][0])

    def towards(self, target: Pose) -> None:
        """Step once."""
        away, turn = target.position - self.tcp.position, (target @ self.tcp.inverse()).rotation
        turn = Rotation.from_matrix(turn).as_rotvec()
        if self._steps % RATE == 0:
            self._note(away, turn)
        speeds = np.concatenate([np.clip(5.0 * away, -0.2, 0.2) / 0.25, np.clip(4.0 * turn, -0.8, 0.8) / 1.2])
        self.seen, _, _, _, self.info = self.env.step(np.append(speeds, self._gripper))
        self._steps += 1

    def go(self, target: Pose, near: float = 0.008) -> None:
        """Move until the target is near, for six seconds at most."""
        for _ in range(300):
            self.towards(target)
            gap, angle = self.tcp.distance_to(target)
            if gap < near and angle < 0.08:
                return

    def grip(self, command: float) -> None:
        """Close (1) or open (-1)."""
        self._gripper, here = command, self.tcp
        for _ in range(30):
            self.towards(here)

    def _note(self, away: np.ndarray, turn: np.ndarray) -> None:
        half = 0.5 * float(self.seen["gripper_opening"][0])
        joints = self.seen.get("scene_joint_positions", np.zeros(0))
        self._rows["q"].append(np.concatenate([self.seen["joint_positions"][0], [half, -half], joints]))
        self._rows["ee"].append(self.seen["tcp_pose"][0].copy())
        self._rows["objects"].append(self.seen["object_pose"].copy())
        command = np.clip(np.concatenate([away / 0.05, turn / 0.5]), -1.0, 1.0)
        self._rows["actions"].append(np.append(command, self._gripper))

    def demonstration(self, fixtures: dict[str, Pose], folder: Path) -> Demonstration:
        """What `onedemo demo import` makes of the recording."""
        task, rows = self.env.task, {key: np.array(value) for key, value in self._rows.items()}
        names = [f"robot0_joint{k}" for k in range(1, 8)] + ["gripper0_finger_joint1", "gripper0_finger_joint2"]
        np.savez(
            folder / "recorded.npz",
            t=np.arange(len(rows["q"])) * RATE * self.env.control_dt,
            q=rows["q"],
            joint_names=np.array([*names, *task.scene_joints]),
            ee_gripper0_grip_site=rows["ee"],
            actions=rows["actions"],
            **{f"obj_{each.name}0_jnt0": rows["objects"][:, k] for k, each in enumerate(task.objects)},
            **{f"fix_{name}": pose.vector for name, pose in fixtures.items()},
        )
        recording = recording_from_teleoperation(folder / "recorded.npz", table_panda()[0])
        return demonstration_of(recording, name="recorded")
