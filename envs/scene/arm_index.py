"""Addresses of an arm and its gripper in MuJoCo's arrays, and the controls of the open and closed gripper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...planner import Arm
from ..mujoco_library import mujoco


@dataclass(frozen=True)
class ArmIndex:
    """Addresses of one arm and its gripper in MuJoCo's arrays.

    Attributes:
        side: robosuite's name of the arm: "right" or "left".
        arm: kinematics of the arm.
        qpos: (dof,) addresses of the joint positions.
        qvel: (dof,) addresses of the joint velocities.
        ctrl: (dof,) actuators of the joints.
        act: (dof,) addresses of the actuators' integrator states.
        site: site of the tcp.
        pads: geoms of the left and right finger pad.
        bodies: bodies that move with the arm, fingers excluded.
        fingers: bodies of the fingers.
        grip: actuators of the fingers.
        opened: controls of these actuators when open.
        closed: controls of these actuators when closed.
        finger_qpos: addresses of the finger joints' positions.
        finger_open: positions of the finger joints when open.
        finger_inwards: closing direction of each finger joint, 1 or -1; 0 for joints of a linkage.
    """

    side: str
    arm: Arm
    qpos: np.ndarray
    qvel: np.ndarray
    ctrl: np.ndarray
    act: np.ndarray
    site: int
    pads: tuple[int, int]
    bodies: frozenset[int]
    fingers: frozenset[int]
    grip: np.ndarray
    opened: np.ndarray
    closed: np.ndarray
    finger_qpos: np.ndarray
    finger_open: np.ndarray
    finger_inwards: np.ndarray


def arm_index(model: mujoco.MjModel, rob: Any, side: str, speeds: tuple[float, ...], name: str) -> ArmIndex:
    """Return the index of a robosuite robot's arm.

    Args:
        model: compiled model that contains the robot.
        rob: robosuite's robot.
        side: robosuite's name of the arm.
        speeds: (dof,) largest joint speeds [rad/s].
        name: name of the robot, for messages.
    """
    gripper = rob.gripper[side]
    count = len(rob.robot_joints) // len(rob.arms)
    first = rob.arms.index(side) * count
    names = rob.robot_joints[first : first + count]
    site = gripper.important_sites["grip_site"]
    joints = np.array([model.joint(each).id for each in names])
    ctrl = np.array([int(np.flatnonzero(model.actuator_trnid[:, 0] == joint)[0]) for joint in joints])
    grip = np.array([model.actuator(each).id for each in gripper.actuators])
    opened, closed = _gripper_controls(model, gripper, grip)
    finger_joints = [model.joint(each).id for each in gripper.joints]
    fingers = _moved_by(model, finger_joints)
    pads = (gripper.important_geoms["left_fingerpad"], gripper.important_geoms["right_fingerpad"])
    return ArmIndex(
        side=side,
        arm=Arm.from_mujoco(model, names, site=site, velocity_limits=speeds, name=name),
        qpos=model.jnt_qposadr[joints],
        qvel=model.jnt_dofadr[joints],
        ctrl=ctrl,
        act=model.actuator_actadr[ctrl],
        site=model.site(site).id,
        pads=(model.geom(pads[0][0]).id, model.geom(pads[1][0]).id),
        bodies=_moved_by(model, joints) - fingers,
        fingers=fingers,
        grip=grip,
        opened=opened,
        closed=closed,
        finger_qpos=model.jnt_qposadr[finger_joints],
        finger_open=_fingers_at(model, grip, opened, finger_joints),
        finger_inwards=np.sign(_fingers_at(model, grip, closed - opened, finger_joints)),
    )


def _moved_by(model: mujoco.MjModel, joints: Any) -> frozenset[int]:
    """Return the bodies moved by the given joints."""
    moved = {int(model.jnt_bodyid[joint]) for joint in joints}
    for body in range(1, model.nbody):
        if int(model.body_parentid[body]) in moved:
            moved.add(body)
    return frozenset(moved)


def _gripper_controls(model: mujoco.MjModel, gripper: Any, grip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the fingers' controls when open and when closed, as robosuite drives the gripper."""
    low, high = model.actuator_ctrlrange[grip].T
    ends = []
    for direction in (-1.0, 1.0):
        for _ in range(100):  # robosuite's grippers move their command by a small step per call
            normalized = gripper.format_action(np.array([direction]))
        ends.append(low + 0.5 * (np.asarray(normalized) + 1.0) * (high - low))
    return ends[0], ends[1]


def _fingers_at(model: mujoco.MjModel, grip: np.ndarray, control: np.ndarray, joints: list[int]) -> np.ndarray:
    """Return the positions of finger joints under a control; 0 for the dependent joints of a linkage."""
    driven = {int(model.actuator_trnid[k, 0]): value for k, value in zip(grip, control, strict=True)}
    return np.array([driven.get(joint, 0.0) for joint in joints])
