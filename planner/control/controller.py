"""The kinematic controller: from the measured joints and a target pose to joint velocities.

Two laws give a task matrix M (6, dof) and a task velocity b (6) with `M qdot = b`:

- `log` (default): `J_b qdot = gain * 2 log(x_m* x_d)`. The tcp moves exactly along the screw to the target
  and every component of the error decays as exp(-gain t).
- `paper`: `N qdot = gain * vec(1 - x_m* x_d)` with `N = H-(x_d) C8 J8`. The paper prints the opposite sign,
  with which the arm runs away. N is 8 x dof of rank 6: with `A = Q R`, `N = A J_b`, it is solved as
  `(R J_b) qdot = gain * Q^T vec e`, which is the same pseudo-inverse without the two zero singular values.

Both end in `qdot = z + M^T (M M^T + mu^2 I)^-1 (b - M z)`: damped least squares of the task, with joint speeds z
towards the middle of the joint ranges projected on the null space. Near a singularity, where damping would let the
projection leak, z fades out. Then the limits: a joint that would pass its position limit is held at the allowed speed
and the others take over, then all speeds are scaled together. (Not in the paper: a joint that is stopped alone bends
the path; see Flacco, De Luca and Khatib 2012.)
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import checked_kind, checked_settings
from ..columns import packed_row
from ..geometry import screw
from ..geometry.pose import Pose
from ..jit import kernel
from ..ranges import check_choice, check_ranges
from ..robot.arm import Arm
from .arm_arrays import ARM, CONTROL, arm_arrays, pose_and_jacobian
from .linear import backward_solve, cholesky, forward_solve, gram, smallest_singular_bound

LAWS = ("log", "paper")
SIGN_HYSTERESIS = 0.1
"""Scalar part of the error beyond which the controller changes the direction of rotation."""
LEAST_DAMPING = 1e-12
"""Squared damping that makes a rank-deficient task solvable."""


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
        null_gain: gain towards the middle of the joint ranges [1/s], in the null space of the task.
        limit_gain: largest approach to a joint limit per distance to the limit [1/s].
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
        check_choice("law", self.law, LAWS)
        check_ranges(self, "(0, inf)", "gain", "max_linear", "max_angular", "limit_gain")
        check_ranges(self, "[0, inf)", "damping_threshold", "max_damping", "null_gain")

    def packed(self) -> np.ndarray:
        """Return the settings as the kernels take them, see `arm_arrays.CONTROL`."""
        return packed_row(CONTROL, **{**asdict(self), "law": LAWS.index(self.law)})


@kernel
def _log_task(n, error, gain, work):
    """Write the task of the log law."""
    xi = screw.twist_along(error)
    for k in range(6):
        work[ARM.task_velocity, k] = gain * xi[k]
        for j in range(n):
            work[ARM.task + k, j] = work[ARM.jacobian + k, j]


@kernel
def _paper_task(n, error, gain, work):
    """Write the task of the corrected paper law, both sides times two so that M is near J_b for small errors.

    Under a body twist xi, `vec(d(1 - x_e)/dt) = vec(xi x_e) / 2`, so the columns of -2 A are `vec(xi_k x_e)`.
    """
    basis = work[ARM.basis : ARM.basis + 6]
    for k in range(6):
        v = (1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0)
        w = (1.0 if k == 3 else 0.0, 1.0 if k == 4 else 0.0, 1.0 if k == 5 else 0.0)
        column = screw.mul((0.0, w[0], w[1], w[2], 0.0, v[0], v[1], v[2]), error)
        for j in range(8):
            basis[k, j] = -column[j]
    gram(basis, 0, 8, work, ARM.gram)
    cholesky(work, ARM.gram, 0.0, work, ARM.factor)
    for k in range(6):
        need = 0.0
        for j in range(8):
            need += basis[k, j] * ((1.0 if j == 0 else 0.0) - error[j])
        work[ARM.task_velocity, k] = 2.0 * gain * need
        for j in range(n):
            s = 0.0
            for i in range(k, 6):
                s += work[ARM.factor + i, k] * work[ARM.jacobian + i, j]
            work[ARM.task + k, j] = s
    forward_solve(work, ARM.factor, work[ARM.task_velocity])


@kernel
def _cap_twist(law, max_linear, max_angular, work):
    """Scale the task velocity so that its twist stays within both bounds."""
    twist = work[ARM.scratch]
    for k in range(6):
        twist[k] = work[ARM.task_velocity, k]
    if law == 1.0:
        backward_solve(work, ARM.factor, twist)  # b = R xi; `_paper_task` left the factor R^T behind
    v = math.sqrt(twist[0] ** 2 + twist[1] ** 2 + twist[2] ** 2)
    w = math.sqrt(twist[3] ** 2 + twist[4] ** 2 + twist[5] ** 2)
    scale = min(1.0, max_linear / max(v, 1e-300), max_angular / max(w, 1e-300))
    for k in range(6):
        work[ARM.task_velocity, k] *= scale


@kernel
def _factor_task(n, threshold, largest, work):
    """Factor `M M^T + mu^2 I`; returns a lower bound of M's sixth singular value, 0 if M is rank-deficient."""
    gram(work, ARM.task, n, work, ARM.gram)
    sigma = 0.0
    if cholesky(work, ARM.gram, 0.0, work, ARM.factor):
        sigma = smallest_singular_bound(work, ARM.factor, work[ARM.scratch])
    if sigma < threshold:
        ratio = sigma / threshold
        cholesky(work, ARM.gram, (1.0 - ratio * ratio) * largest * largest + LEAST_DAMPING, work, ARM.factor)
    return sigma


@kernel
def _middle_pull(n, q, gain, work):
    """Write the speed of every joint towards the middle of its range, 0 for a continuous joint."""
    for i in range(n):
        low, high = work[ARM.lower, i], work[ARM.upper, i]
        span = high - low
        work[ARM.null, i] = -gain * (q[i] - 0.5 * (low + high)) / span**2 if span < 1e300 else 0.0


@kernel
def _least_squares(n, work, qdot):
    """Compute `z + M^T (M M^T + mu^2 I)^-1 (b - M z)` from z, M, b and the factor in the array."""
    b, z = work[ARM.solution], work[ARM.null]
    for k in range(6):
        s = work[ARM.task_velocity, k]
        for j in range(n):
            s -= work[ARM.task + k, j] * z[j]
        b[k] = s
    forward_solve(work, ARM.factor, b)
    backward_solve(work, ARM.factor, b)
    for j in range(n):
        s = z[j]
        for k in range(6):
            s += work[ARM.task + k, j] * b[k]
        qdot[j] = s


@kernel
def _allowed(q, i, gain, work):
    """Lowest and highest speed of joint i by its position limits."""
    return -gain * (q[i] - work[ARM.lower, i]), gain * (work[ARM.upper, i] - q[i])


@kernel
def _worst_joint(n, q, gain, work, qdot):
    """Joint that exceeds its position bound most, and its allowed speed; -1 if no joint does."""
    worst, excess, speed = -1, 1e-12, 0.0
    for i in range(n):
        low, high = _allowed(q, i, gain, work)
        if qdot[i] - high > excess:
            worst, excess, speed = i, qdot[i] - high, high
        if low - qdot[i] > excess:
            worst, excess, speed = i, low - qdot[i], low
    return worst, speed


@kernel
def _hold_joints(n, q, threshold, largest, gain, work, qdot):
    """Hold joints at their bounds, at most dof - 6 of them, and let the others take over the task."""
    held = work[ARM.null]
    for i in range(n):
        held[i] = 0.0
    for _ in range(n - 6):
        joint, speed = _worst_joint(n, q, gain, work, qdot)
        if joint < 0:
            return
        for k in range(6):
            work[ARM.task_velocity, k] -= work[ARM.task + k, joint] * speed
            work[ARM.task + k, joint] = 0.0
        # a joint without a column in M moves at its z
        held[joint] = speed
        _factor_task(n, threshold, largest, work)
        _least_squares(n, work, qdot)


@kernel
def _scale_to_limits(n, q, gain, work, qdot):
    """Scale all speeds together so that no joint exceeds its speed or its approach to a position limit."""
    scale = 1.0
    for i in range(n):
        low, high = _allowed(q, i, gain, work)
        speed = qdot[i]
        if abs(speed) > work[ARM.speed, i]:
            scale = min(scale, work[ARM.speed, i] / abs(speed))
        if speed > 0.0 and speed > high:
            scale = min(scale, max(high, 0.0) / speed)
        if speed < 0.0 and speed < low:
            scale = min(scale, min(low, 0.0) / speed)
    for i in range(n):
        qdot[i] *= scale


@kernel
def choose_sign(error, sign):
    """Choose the direction of rotation: the shorter one at first, then the same one until it is clearly longer.

    Args:
        error: unit dual quaternion from the measured to the target pose, a tuple of 8.
        sign: direction so far, 1 or -1; 0 if none was chosen yet.

    Returns:
        The sign of `error` to use, 1 or -1.
    """
    if sign == 0.0:
        return 1.0 if error[0] >= 0.0 else -1.0
    return -sign if error[0] * sign < -SIGN_HYSTERESIS else sign


@kernel
def joint_velocity(work, q, error, qdot):
    """Compute joint speeds towards a target.

    Args:
        work: array of the arm, see `arm_arrays`; its body Jacobian belongs to q.
        q: (dof,) joints that the error belongs to.
        error: x_m* x_d as a tuple of 8, its sign chosen.
        qdot: (dof,) joint speeds, the result.
    """
    settings = work[ARM.control]
    law, gain, limit_gain = settings[CONTROL.law], settings[CONTROL.gain], settings[CONTROL.limit_gain]
    threshold, largest = settings[CONTROL.damping_threshold], settings[CONTROL.max_damping]
    n = len(q)
    if law == 0.0:
        _log_task(n, error, gain, work)
    else:
        _paper_task(n, error, gain, work)
    _cap_twist(law, settings[CONTROL.max_linear], settings[CONTROL.max_angular], work)
    sigma = _factor_task(n, threshold, largest, work)
    fade = min(1.0, max(0.0, sigma - threshold) / max(threshold, 1e-9))
    _middle_pull(n, q, settings[CONTROL.null_gain] * fade if n > 6 else 0.0, work)
    _least_squares(n, work, qdot)
    _hold_joints(n, q, threshold, largest, limit_gain, work, qdot)
    _scale_to_limits(n, q, limit_gain, work, qdot)


@kernel
def tick(work, q, target, sign, qdot):
    """Do one control step: compute joint speeds from q towards a target.

    Args:
        work: array of the arm, see `arm_arrays`.
        q: (dof,) joints.
        target: (8,) pose of the tcp to approach.
        sign: direction of rotation so far, see `choose_sign`.
        qdot: (dof,) joint speeds, the result.

    Returns:
        The direction of rotation taken.
    """
    x = pose_and_jacobian(work, q)
    goal = (target[0], target[1], target[2], target[3], target[4], target[5], target[6], target[7])
    error = screw.mul(screw.conj(x), goal)
    sign = choose_sign(error, sign)
    joint_velocity(work, q, screw.neg(error) if sign < 0.0 else error, qdot)
    return sign


class Controller:
    """The control law bound to an arm: joint speeds from joint positions and a target pose.

    The law is local: it follows the screw to the target from where the arm is, and stops where a joint limit or a
    singularity stands in the way, though another posture might lead there. From random joints to random reachable
    targets it mostly does not arrive; `Planner` finds ways round.

    The controller remembers the direction of rotation (the double cover), with hysteresis; `reset` forgets it.

    Attributes:
        arm: the arm.
        settings: gains and bounds.
    """

    def __init__(self, arm: Arm, settings: ControllerSettings | None = None):
        self.arm = checked_kind("arm", arm, Arm)
        self.settings = checked_settings(ControllerSettings, settings)
        self._work = arm_arrays(arm, self.settings.packed())
        self._sign = 0.0

    def reset(self) -> None:
        """Forget the direction of rotation."""
        self._sign = 0.0

    def __call__(self, q: ArrayLike, target: Pose) -> np.ndarray:
        """Return joint speeds (dof,) [rad/s] towards a target.

        Args:
            q: (dof,) joints [rad or m].
            target: pose of the tcp to approach.

        Raises:
            WrongType, BadShape, NotFinite: the joints are not (dof,) finite numbers, or the target is no `Pose`.
        """
        joints, qdot = self.arm.checked(q), np.empty(self.arm.dof)
        self._sign = tick(self._work, joints, checked_kind("target", target, Pose).dq, self._sign, qdot)
        return qdot
