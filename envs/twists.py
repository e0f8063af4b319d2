"""Tcp twists as actions: joint speeds that the motors can follow, and commands that make the servos do so."""

from __future__ import annotations

import mujoco
import numpy as np

from ..planner.pose import Pose
from .arm_index import ArmIndex
from .servos import DAMPING, STIFFNESS
from .sim import Simulation

MAX_LINEAR, MAX_ANGULAR = 0.25, 1.2
"""Tcp speeds [m/s, rad/s] of a full `ee_twist` action."""
LEAST_SQUARES_DAMPING = 0.02
TORQUE_SHARE = 0.7
"""Of the motors' torque limits, what changes of speed may ask for; the rest is for what the servos correct."""


class TwistDrive:
    """Makes the servos' commands of tcp twists.

    Twists change at once, joints do not. If each motor went at its torque limit for as long as it needs, the hand would
    be thrown off by centimeters, and each command that is felt 0.1 s late makes a fast policy sway about its goal.
    Therefore all joints of an arm make the same share of a change that is too fast for one of them, and the commands
    make up for the servos' lag and the arm's inertia.

    Args:
        simulation: whose working arms are driven.
        dt: seconds between actions.
    """

    def __init__(self, simulation: Simulation, dt: float):
        self._sim, self._arms, self._dt = simulation, simulation.scene.arms, dt
        self._speeds = np.zeros((len(self._arms), self._arms[0].arm.dof))
        self._changes = np.zeros_like(self._speeds)
        self._inertia = np.zeros((simulation.model.nv, simulation.model.nv))

    def reset(self) -> None:
        """All joints are at rest."""
        self._speeds[:] = self._changes[:] = 0.0

    def commands(self, twists: np.ndarray) -> np.ndarray:
        """Rates (n_arms, dof) [rad/s] of the servos' set points until the next action.

        A servo's torque is stiffness (set point - q - lag q'), so that q' changes evenly from v to v + c within dt if
        the set point's rate is v + c / 2 + lag c / dt + M (c - c_before) / (stiffness dt^2), M the arm's inertia.

        Args:
            twists: (n_arms, 6) linear and angular parts in world axes, as shares of the largest ones.
        """
        model, data, dt, rates = self._sim.model, self._sim.data, self._dt, np.empty_like(self._speeds)
        mujoco.mj_fullM(model, self._inertia, data.qM)
        for k, (index, twist) in enumerate(zip(self._arms, twists, strict=True)):
            inertia = self._inertia[np.ix_(index.qvel, index.qvel)]
            torques = model.actuator_forcerange[index.ctrl, 1]
            change = _resolved(index, twist, data.qpos) - self._speeds[k]
            change /= max(1.0, float((np.abs(inertia @ change) / (TORQUE_SHARE * dt * torques)).max()))
            push = inertia @ (change - self._changes[k]) / (STIFFNESS * torques * dt**2)
            rates[k] = self._speeds[k] + (0.5 + DAMPING / dt) * change + push
            self._changes[k] = change
            self._speeds[k] += change
        return rates


def _resolved(index: ArmIndex, twist: np.ndarray, qpos: np.ndarray) -> np.ndarray:
    """Joint speeds (dof,) of a twist (6,), by damped least squares, within the arm's limits."""
    x, jacobian = index.arm.fk_jacobian(qpos[index.qpos])
    to_body = Pose(x).rotation.T
    wanted = np.concatenate([to_body @ (MAX_LINEAR * twist[:3]), to_body @ (MAX_ANGULAR * twist[3:6])])
    gram = jacobian @ jacobian.T + LEAST_SQUARES_DAMPING**2 * np.eye(6)
    speeds = jacobian.T @ np.linalg.solve(gram, wanted)
    return speeds / max(1.0, float((np.abs(speeds) / index.arm.velocity_limits).max()))
