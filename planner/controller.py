"""The kinematic controller: from the measured joints and a target pose to joint velocities.

Two laws give a task matrix M (6, dof) and a task velocity b (6) with `M qdot = b`:

- `log` (default): `J_b qdot = gain * 2 log(x_m* x_d)`. The tcp moves exactly along the screw to the target
  and every component of the error decays as exp(-gain t).
- `paper`: `N qdot = gain * vec(1 - x_m* x_d)` with `N = H-(x_d) C8 J8`. The paper prints the opposite sign,
  with which the arm runs away. N is 8 x dof of rank 6: with `A = Q R`, `N = A J_b`, it is solved as
  `(R J_b) qdot = gain * Q^T vec e`, which is the same pseudo-inverse without the two zero singular values.

Both end in `qdot = M^T (M M^T + mu^2 I)^-1 b + (I - J_b^+ J_b) z`, then the limits: a joint that would pass
its position limit is held at the allowed speed and the others take over, then all speeds are scaled together.
(Not in the paper: a joint that is stopped alone bends the path; see Flacco, De Luca and Khatib 2012.)
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import ArrayLike

from . import screw
from .arm import Arm
from .chain import body_jacobian, forward
from .errors import BadOption
from .jit import kernel
from .linear import backward_solve, cholesky, forward_solve, gram, smallest_singular_bound
from .pose import Pose

LAWS = ("log", "paper")
NULL_CUT_OFF = 1e-3
"""Singular value of the Jacobian below which the null-space task rests: it has no projector there."""
SIGN_HYSTERESIS = 0.1
"""Scalar part of the error beyond which the controller changes to the other way round."""

# Rows of the workspace (ROWS, 16) that the kernels share, so that a tick allocates nothing.
JACOBIAN, TASK, GRAM, FACTOR, FRAMES, BASIS = 0, 6, 12, 18, 24, 40
NEED, SOLUTION, NULL, SCRATCH = 46, 47, 48, 49
ROWS = 50


@dataclass(frozen=True, slots=True)
class ControllerSettings:
    """Gains and bounds of the controller.

    Attributes:
        law: "log" or "paper".
        gain: lambda [1/s]; gain * dt must stay below 1.
        max_linear: largest speed of the tcp [m/s]; the whole twist is scaled.
        max_angular: largest turning speed of the tcp [rad/s].
        damping_threshold: singular value of the Jacobian below which damping sets in.
        max_damping: damping mu at a singularity.
        null_gain: pull to the middle of the joint ranges [1/s], in the null space of the task.
        limit_gain: approach to a joint limit is at most this times the distance to it [1/s].
    """

    law: str = "log"
    gain: float = 15.0
    max_linear: float = 0.25
    max_angular: float = 1.2
    damping_threshold: float = 0.03
    max_damping: float = 0.05
    null_gain: float = 0.5
    limit_gain: float = 20.0

    def __post_init__(self):
        if self.law not in LAWS:
            raise BadOption("law", f"{self.law!r} is not one of {', '.join(LAWS)}")
        for name in ("gain", "max_linear", "max_angular", "limit_gain"):
            if not 0 < getattr(self, name) < math.inf:
                raise BadOption(name, f"{getattr(self, name)} is not a positive number")
        for name in ("damping_threshold", "max_damping", "null_gain"):
            if not 0 <= getattr(self, name) < math.inf:
                raise BadOption(name, f"{getattr(self, name)} is not a number >= 0")

    def packed(self) -> tuple[float, ...]:
        """The settings as the kernels take them: the law as a number, then the others in order."""
        return (float(LAWS.index(self.law)), *(float(value) for value in astuple(self)[1:]))


def workspace() -> np.ndarray:
    """A workspace (ROWS, 16) for the kernels; one per thread."""
    return np.zeros((ROWS, 16))


@kernel
def _log_task(n, error, gain, work):
    """Task of the log law."""
    xi = screw.twist_along(error)
    for k in range(6):
        work[NEED, k] = gain * xi[k]
        for j in range(n):
            work[TASK + k, j] = work[JACOBIAN + k, j]


@kernel
def _paper_task(n, error, gain, work):
    """Task of the corrected paper law: under a body twist xi, vec(de/dt) = 1/2 vec(xi x_e), so A = -that."""
    basis = work[BASIS : BASIS + 6]
    for k in range(6):
        v = (1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0)
        w = (1.0 if k == 3 else 0.0, 1.0 if k == 4 else 0.0, 1.0 if k == 5 else 0.0)
        column = screw.mul((0.0, w[0], w[1], w[2], 0.0, v[0], v[1], v[2]), error)
        for j in range(8):
            basis[k, j] = -0.5 * column[j]
    gram(basis, 0, 8, work, GRAM)
    cholesky(work, GRAM, 0.0, work, FACTOR)
    for k in range(6):
        need = 0.0
        for j in range(8):
            need += basis[k, j] * ((1.0 if j == 0 else 0.0) - error[j])
        work[NEED, k] = gain * need
        for j in range(n):
            s = 0.0
            for i in range(k, 6):
                s += work[FACTOR + i, k] * work[JACOBIAN + i, j]
            work[TASK + k, j] = s
    forward_solve(work, FACTOR, work[NEED])


@kernel
def _cap_twist(law, max_linear, max_angular, work):
    """Scale the task velocity so that the twist it asks for stays within both bounds."""
    twist = work[SCRATCH]
    for k in range(6):
        twist[k] = work[NEED, k]
    if law == 1.0:
        backward_solve(work, FACTOR, twist)  # b = R xi; `_paper_task` left the factor R^T behind
    v = math.sqrt(twist[0] ** 2 + twist[1] ** 2 + twist[2] ** 2)
    w = math.sqrt(twist[3] ** 2 + twist[4] ** 2 + twist[5] ** 2)
    scale = min(1.0, max_linear / max(v, 1e-300), max_angular / max(w, 1e-300))
    for k in range(6):
        work[NEED, k] *= scale


@kernel
def _factor(row, n, work):
    """Factor `M M^T` of the six rows from `row` on; bound of M's sixth singular value, 0 if there is none."""
    gram(work, row, n, work, GRAM)
    if not cholesky(work, GRAM, 0.0, work, FACTOR):
        return 0.0
    return smallest_singular_bound(work, FACTOR, work[SCRATCH])


@kernel
def _null_motion(n, limits, q, gain, work):
    """Pull to the middle of the joint ranges, projected on the null space of J_b, whose factor is ready."""
    z, b = work[NULL], work[SCRATCH]
    for i in range(n):
        span = limits[1, i] - limits[0, i]
        z[i] = -gain * (q[i] - 0.5 * (limits[0, i] + limits[1, i])) / span**2 if span < 1e300 else 0.0
    for _ in range(2):  # the second pass removes the rounding of the first
        for k in range(6):
            b[k] = 0.0
            for j in range(n):
                b[k] += work[JACOBIAN + k, j] * z[j]
        forward_solve(work, FACTOR, b)
        backward_solve(work, FACTOR, b)
        for j in range(n):
            for k in range(6):
                z[j] -= work[JACOBIAN + k, j] * b[k]


@kernel
def _least_squares(n, threshold, largest, work, qdot):
    """`M^T (M M^T + mu^2 I)^-1 b` for the task left in the workspace."""
    sigma = _factor(TASK, n, work)
    if sigma < threshold:
        ratio = sigma / threshold
        cholesky(work, GRAM, (1.0 - ratio * ratio) * largest * largest + 1e-12, work, FACTOR)
    b = work[SOLUTION]
    for k in range(6):
        b[k] = work[NEED, k]
    forward_solve(work, FACTOR, b)
    backward_solve(work, FACTOR, b)
    for j in range(n):
        qdot[j] = 0.0
        for k in range(6):
            qdot[j] += work[TASK + k, j] * b[k]


@kernel
def _worst_joint(n, limits, q, gain, qdot):
    """The joint that exceeds its position bound most, and the speed it is allowed; -1 if there is none."""
    worst, excess, allowed = -1, 1e-12, 0.0
    for i in range(n):
        low, high = -gain * (q[i] - limits[0, i]), gain * (limits[1, i] - q[i])
        if qdot[i] - high > excess:
            worst, excess, allowed = i, qdot[i] - high, high
        if low - qdot[i] > excess:
            worst, excess, allowed = i, low - qdot[i], low
    return worst, allowed


@kernel
def _scale_to_limits(n, limits, q, gain, qdot):
    """Scale all speeds together so that no joint exceeds its speed or its approach to a position limit."""
    scale = 1.0
    for i in range(n):
        low, high = -gain * (q[i] - limits[0, i]), gain * (limits[1, i] - q[i])
        if abs(qdot[i]) > limits[2, i]:
            scale = min(scale, limits[2, i] / abs(qdot[i]))
        if qdot[i] > 0.0 and qdot[i] > high:
            scale = min(scale, max(high, 0.0) / qdot[i])
        if qdot[i] < 0.0 and qdot[i] < low:
            scale = min(scale, min(low, 0.0) / qdot[i])
    for i in range(n):
        qdot[i] *= scale


@kernel
def choose_sign(error, sign):
    """The way round: the shorter one at first (sign 0), then kept until it is clearly the longer one."""
    c = error[0] * (sign if sign != 0.0 else 1.0)
    if sign == 0.0:
        return 1.0 if c >= 0.0 else -1.0
    return -sign if c < -SIGN_HYSTERESIS else sign


@kernel
def joint_velocity(limits, q, error, settings, work, qdot):
    """Joint speeds towards the target; the body Jacobian at q is ready in the workspace.

    Args:
        limits: (3, dof), see `Arm.limits`.
        q: (dof,) joints that the error belongs to.
        error: x_m* x_d as a tuple, its sign chosen.
        settings: `ControllerSettings.packed()`.
        work: see `workspace`.
        qdot: (dof,) result.
    """
    law, gain, max_linear, max_angular, threshold, largest, null_gain, limit_gain = settings
    n = len(q)
    rested = True
    if n > 6 and null_gain > 0.0 and _factor(JACOBIAN, n, work) > NULL_CUT_OFF:
        _null_motion(n, limits, q, null_gain, work)
        rested = False
    if law == 0.0:
        _log_task(n, error, gain, work)
    else:
        _paper_task(n, error, gain, work)
    _cap_twist(law, max_linear, max_angular, work)
    _least_squares(n, threshold, largest, work, qdot)
    if not rested:
        for i in range(n):
            qdot[i] += work[NULL, i]
    # at most dof - 6 joints can be held with the task kept
    held = work[NULL]
    for i in range(n):
        held[i] = np.inf
    for _ in range(n - 6):
        joint, speed = _worst_joint(n, limits, q, limit_gain, qdot)
        if joint < 0:
            break
        held[joint] = speed
        for k in range(6):
            work[NEED, k] -= work[TASK + k, joint] * speed
            work[TASK + k, joint] = 0.0
        _least_squares(n, threshold, largest, work, qdot)
        for i in range(n):
            if held[i] < np.inf:
                qdot[i] = held[i]
    _scale_to_limits(n, limits, q, limit_gain, qdot)


@kernel
def tick(chain, limits, q, target, sign, settings, work, qdot):
    """One control step: joint speeds from q towards the target (8,); returns the way round taken."""
    x = forward(chain, q, work[FRAMES : FRAMES + 16])
    body_jacobian(chain, x, work[FRAMES : FRAMES + 16], work)
    goal = (target[0], target[1], target[2], target[3], target[4], target[5], target[6], target[7])
    error = screw.mul(screw.conj(x), goal)
    sign = choose_sign(error, sign)
    joint_velocity(limits, q, screw.neg(error) if sign < 0.0 else error, settings, work, qdot)
    return sign


class Controller:
    """The control law bound to an arm: joint speeds from joint positions and a target pose.

    It remembers which way round it turns (the double cover), with hysteresis; `reset` forgets it.
    """

    def __init__(self, arm: Arm, settings: ControllerSettings | None = None):
        self.arm = arm
        self.settings = settings or ControllerSettings()
        self._packed = self.settings.packed()
        self._limits = arm.limits
        self._work = workspace()
        self._sign = 0.0

    def reset(self) -> None:
        """Forget which way round was taken."""
        self._sign = 0.0

    def __call__(self, q: ArrayLike, target: Pose) -> np.ndarray:
        """Joint speeds (dof,) [rad/s] at joints q (dof,) towards the target pose of the tcp."""
        qdot = np.empty(self.arm.dof)
        q = np.asarray(q, dtype=np.float64)
        args = (self.arm.chain, self._limits, q, target.dq, self._sign, self._packed, self._work, qdot)
        self._sign = tick(*args)
        return qdot
