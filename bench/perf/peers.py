"""Other libraries that do the same work, for `onedemo perf`."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import numpy as np

READY = np.array([0.0, 0.2, 0.0, -2.6, 0.0, 2.9, 0.78])
"""Joints (7,) [rad] of the Panda at which kinematics are measured."""
Call = Callable[[], object]


def panda_urdf() -> Path:
    """Return the path of the Panda description that robosuite ships, without importing robosuite."""
    from importlib.util import find_spec

    spec = find_spec("robosuite")
    assert spec is not None and spec.origin is not None
    folder = Path(spec.origin).parent / "models/assets/bullet_data/panda_description/urdf"
    return folder / "panda_arm.urdf"


def pinocchio_kinematics(q: np.ndarray) -> Call:
    """Return a call that computes the Jacobian of the Panda's flange in its own axes, and its pose, with Pinocchio."""
    import pinocchio as pin

    model = pin.buildModelFromUrdf(str(panda_urdf()))
    data, frame = model.createData(), model.getFrameId("panda_link8")

    def call() -> np.ndarray:
        jacobian = pin.computeFrameJacobian(model, data, q, frame, pin.ReferenceFrame.LOCAL)
        pin.updateFramePlacement(model, data, frame)
        return jacobian

    return call


def dq_robotics_tick(q: np.ndarray, target: np.ndarray) -> Call | None:
    """Return a call of the corrected paper law in DQ_Robotics' own algebra, with pseudo-inverse and null space.

    Args:
        q: (7,) joints [rad].
        target: (8,) target pose of the flange.

    Returns:
        The call; None without DQ_Robotics.
    """
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
