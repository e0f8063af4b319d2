"""Other libraries doing the same work, for `onedemo perf`."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import numpy as np

READY = np.array([0.0, 0.2, 0.0, -2.6, 0.0, 2.9, 0.78])
"""Joints of the Panda at which kinematics are measured."""
Call = Callable[[], object]


def panda_urdf() -> Path:
    """Path of the Panda description that robosuite ships, found without importing it."""
    from importlib.util import find_spec

    spec = find_spec("robosuite")
    assert spec is not None and spec.origin is not None
    folder = Path(spec.origin).parent / "models/assets/bullet_data/panda_description/urdf"
    return folder / "panda_arm.urdf"


def pinocchio_kinematics(q: np.ndarray) -> Call:
    """Pinocchio's Jacobian of the Panda's flange in its own axes, and its pose."""
    import pinocchio as pin

    model = pin.buildModelFromUrdf(str(panda_urdf()))
    data, frame = model.createData(), model.getFrameId("panda_link8")

    def call() -> np.ndarray:
        jacobian = pin.computeFrameJacobian(model, data, q, frame, pin.ReferenceFrame.LOCAL)
        pin.updateFramePlacement(model, data, frame)
        return jacobian

    return call


def dq_robotics_tick(q: np.ndarray, target: np.ndarray) -> Call | None:
    """The corrected paper law with DQ_Robotics' own algebra, pseudo-inverse and null space; None without it."""
    try:
        peer = import_module("dqrobotics")
        robots, algebra = import_module("dqrobotics.robots"), import_module("dqrobotics.utils.DQ_LinearAlgebra")
    except ImportError:
        return None
    robot = robots.FrankaEmikaPandaRobot.kinematics()
    goal, one, c8, pull = peer.DQ(target), peer.DQ([1.0]), peer.C8(), -0.1 * q

    def call() -> np.ndarray:
        error = (one - peer.conj(robot.fkm(q)) * goal).vec8()
        n = peer.haminus8(goal) @ c8 @ robot.pose_jacobian(q)
        inverse = algebra.pinv(n)
        return inverse @ (15.0 * error) + pull - inverse @ (n @ pull)

    return call
