"""Tcp twists as actions: joint speeds that the motors can follow, and servo commands that achieve them."""

from __future__ import annotations

import math

import numpy as np

from ...planner.control.linear import backward_solve, cholesky, forward_solve, gram
from ...planner.geometry.pose import Pose
from ...planner.jit import kernel
from ..mujoco_library import mujoco
from ..scene.servos import DAMPING, STIFFNESS
from .simulation import Simulation

MAX_LINEAR, MAX_ANGULAR = 0.25, 1.2
"""Tcp speeds [m/s, rad/s] of a full `ee_twist` action."""
LEAST_SQUARES_DAMPING = 0.02
TORQUE_SHARE = 0.7
"""Share of the motors' torque limits that speed changes may use; the rest is for the servos' corrections."""
FACTOR, SOLUTION = 6, 12
"""Workspace rows of the Cholesky factor and of the solution, after the six rows of the Gram matrix."""


class TwistDrive:
    """Conversion of tcp twists to servo commands.

    Twists change at once, joint speeds do not. If each motor accelerated at its torque limit for as long as necessary,
    the hand would deviate by centimeters, and commands that take effect 0.1 s late make a fast policy oscillate about
    its goal. Therefore all joints of an arm make the same share of a change that is too fast for one of them, and the
    commands compensate for the servos' lag and the arm's inertia.

    Args:
        simulation: simulation whose working arms are driven.
        dt: time between actions [s].
    """

    def __init__(self, simulation: Simulation, dt: float):
        self._sim, self._dt = simulation, dt
        arms = simulation.scene.arms
        self._speeds = np.zeros((len(arms), arms[0].arm.dof))
        self._changes = np.zeros_like(self._speeds)
        self._wanted = np.zeros(arms[0].arm.dof)
        self._inertia = np.zeros((simulation.model.nv, simulation.model.nv))
        self._torques = [simulation.model.actuator_forcerange[index.ctrl, 1].copy() for index in arms]
        self._work = np.zeros((SOLUTION + 1, 6))

    def reset(self) -> None:
        """Set all joint speeds to zero: the arms are at rest."""
        self._speeds[:] = self._changes[:] = 0.0

    def commands(self, twists: np.ndarray) -> np.ndarray:
        """Return rates (n_arms, dof) [rad/s] of the servos' set points until the next action; see `_followed`.

        Args:
            twists: (n_arms, 6) linear and angular parts in world axes, as fractions of the largest ones.
        """
        data, rates = self._sim.data, np.empty_like(self._speeds)
        mujoco.mj_fullM(self._sim.model, self._inertia, data.qM)
        for k, (index, twist) in enumerate(zip(self._sim.scene.arms, twists, strict=True)):
            x, jacobian = index.arm.fk_jacobian(data.qpos[index.qpos])
            _resolved(jacobian, Pose(x).rotation, twist, index.arm.velocity_limits, self._work, self._wanted)
            mine = self._inertia, index.qvel, self._torques[k]
            _followed(self._wanted, *mine, self._dt, self._speeds[k], self._changes[k], rates[k])
        return rates

    def step(self, action: np.ndarray, substeps: int) -> int:
        """Step the simulation with tcp twists in world axes; return the index of an entry that is not finite, or -1.

        Args:
            action: per arm a twist, as fractions of the largest one, and the gripper's entry.
            substeps: number of steps of the physics.
        """
        finite = np.isfinite(action)
        if not finite.all():
            return int(np.argmin(finite))
        rows = np.clip(action, -1.0, 1.0).reshape(len(self._speeds), -1)
        commands = np.column_stack([self.commands(rows), rows[:, -1]])
        return self._sim.step(commands.ravel(), np.ones_like(self._speeds), math.inf, substeps)


# compiled not only for speed: the last digit of NumPy's linear algebra depends on the number of threads


@kernel
def _resolved(jacobian, rotation, twist, limits, work, speeds):
    """Compute the joint speeds (dof,) of a twist (6,) by damped least squares on the body Jacobian, within limits."""
    n, b = len(speeds), work[SOLUTION]
    for i in range(3):
        linear, angular = 0.0, 0.0
        for k in range(3):
            linear += rotation[k, i] * twist[k]
            angular += rotation[k, i] * twist[3 + k]
        b[i], b[3 + i] = MAX_LINEAR * linear, MAX_ANGULAR * angular
    gram(jacobian, 0, n, work, 0)
    cholesky(work, 0, LEAST_SQUARES_DAMPING**2, work, FACTOR)
    forward_solve(work, FACTOR, b)
    backward_solve(work, FACTOR, b)
    worst = 1.0
    for j in range(n):
        s = 0.0
        for k in range(6):
            s += jacobian[k, j] * b[k]
        speeds[j] = s
        worst = max(worst, abs(s) / limits[j])
    for j in range(n):
        speeds[j] /= worst


@kernel
def _followed(wanted, inertia, dofs, torques, dt, speeds, changes, rates):
    """Bring the speeds (dof,) as near to the wanted ones as the motors can within dt; compute the set points' rates.

    A servo's torque is stiffness (set point - q - lag q'), so q' changes evenly from v to v + c within dt if the set
    point's rate is v + c / 2 + lag c / dt + M (c - c_before) / (stiffness dt^2), where M is the arm's inertia.
    """
    n, worst = len(speeds), 1.0
    for i in range(n):
        s = 0.0
        for j in range(n):
            s += inertia[dofs[i], dofs[j]] * (wanted[j] - speeds[j])
        worst = max(worst, abs(s) / (TORQUE_SHARE * dt * torques[i]))
    for i in range(n):
        s = 0.0
        for j in range(n):
            s += inertia[dofs[i], dofs[j]] * ((wanted[j] - speeds[j]) / worst - changes[j])
        rates[i] = s / (STIFFNESS * torques[i] * dt**2)
    for i in range(n):
        change = (wanted[i] - speeds[i]) / worst
        rates[i] += speeds[i] + (0.5 + DAMPING / dt) * change
        changes[i] = change
    for i in range(n):
        speeds[i] += changes[i]
