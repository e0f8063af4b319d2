"""Two arms, one demonstration: relative and absolute paths of two end effectors, and how to share them.

The relative pose `rho = x_L* x_R` is what the task is about; the absolute pose a says where it happens.
`x_L = a rho^-beta` and `x_R = a rho^(1 - beta)` give `x_L* x_R = rho` for every a and beta: beta is the part of the
relative motion that the left arm does. Imitation runs on rho as on any path: relative poses form the same group.

Not in the paper, which has two arms in its experiments and no formulas for them: cooperative task space (Adorno,
Fraisse and Druon 2010) on screws; method reference section 8.
"""

from __future__ import annotations

import math
import warnings

import numpy as np
from numpy.typing import ArrayLike

from ..errors import BadOption, BadShape
from ..geometry import dualquat as dq
from ..geometry.pose import Pose, PosePath

FULL_TURN_MARGIN = 0.5
"""Angle [rad] kept from the full turn, where a fractional power jumps; outside it a turn grows at most fourfold."""


class HalfTurnPassed(UserWarning):
    """The relative rotation passes a half turn: its fractional power goes on the long way, as it must."""


def relative_path(left: PosePath | Pose, right: PosePath) -> PosePath:
    """Relative path `rho = x_L* x_R` (n poses): the right end effector seen from the left one.

    Args:
        left: world_from_left, one pose or a path of n.
        right: world_from_right, n poses.
    """
    return PosePath(dq.mul(dq.conj(_rows(left, len(right), "left path")), right.dqs))


def absolute_path(left: PosePath | Pose, right: PosePath, beta: float) -> PosePath:
    """Absolute path `a = x_L rho^beta` (n poses), the inverse of `split`.

    Args:
        left: world_from_left, one pose or a path of n.
        right: world_from_right, n poses.
        beta: 0 for the left end effector itself, 1 for the right one, 1/2 for the middle of the screw between.
    """
    power = _continuous_power(relative_path(left, right), _checked_share("beta", beta))
    return PosePath(dq.mul(_rows(left, len(right), "left path"), power))


def split(relative: PosePath, absolute: Pose | PosePath, beta: float) -> tuple[PosePath, PosePath]:
    """Paths of the left and the right end effector, `a rho^-beta` and `a rho^(1 - beta)`.

    Gravity: beta = 0 with an upright a keeps what the left hand holds upright; any other beta tilts both.

    Args:
        relative: left_from_right, n poses.
        absolute: where the task happens in the world, one pose or n.
        beta: in [0, 1], the left arm's part of the relative motion.

    Raises:
        BadOption: beta outside [0, 1], or a relative rotation that comes near a full turn with 0 < beta < 1.
        BadShape: absolute has another number of poses.

    Warns:
        HalfTurnPassed: the relative rotation passes a half turn and 0 < beta < 1.
    """
    power = _continuous_power(relative, _checked_share("beta", beta))
    left = dq.mul(_rows(absolute, len(relative), "absolute path"), dq.conj(power))
    # the second factor is rho^-beta rho, so that the relative path holds to rounding whatever the power
    return PosePath(left), PosePath(dq.mul(left, relative.dqs))


def turns(relative: PosePath) -> np.ndarray:
    """Rotation angle (n,) [rad] in [0, 2 pi], continuous along the path: at most pi at its start."""
    rho = _signed(relative)
    return 2.0 * np.arctan2(np.linalg.norm(rho[:, 1:4], axis=1), rho[:, 0])


def task_relative_path(
    pourer: PosePath,
    receiver: Pose,
    *,
    tool_from_poured: Pose,
    left_from_receiver: Pose,
    right_from_poured: Pose,
) -> PosePath:
    """Relative path left_from_right of two hands that do what one hand was shown to do over a fixed object.

    `rho_j = G_L (w* d_j G_p) G_R*`: the bracket is the poured object seen from the receiving one.

    Args:
        pourer: world_from_tool of the demonstration, n poses.
        receiver: world_from_receiver of the demonstration, where the receiving object stood.
        tool_from_poured: how the object was held.
        left_from_receiver: how the left hand holds the receiving object.
        right_from_poured: how the right hand holds the poured object.
    """
    of_objects = pourer.moved(receiver.inverse()).with_tool(tool_from_poured)
    return of_objects.moved(left_from_receiver).with_tool(right_from_poured.inverse())


def shared_translation(relative: PosePath, absolute: Pose, share: float = 0.5) -> tuple[PosePath, PosePath]:
    """Both end effectors move, but only the right one turns: the left keeps its attitude, upright stays upright.

    `x_L = (R_a, p_a - share R_a (t_rho - t_rho(end)))`, `x_R = x_L rho`: the relative path is exact and its
    translation is shared. Not in the paper; with a true beta = 1/2 both glasses tilt.

    Args:
        relative: left_from_right, n poses. The translation is that of the right frame's origin.
        absolute: world_from_left at the end of the path; the same whatever the share.
        share: in [0, 1], the left arm's part of the translation; 0 leaves the left arm still.
    """
    share = _checked_share("share", share)
    away = relative.positions - relative.positions[-1]
    offset = -share * away @ absolute.rotation.T
    upright = np.array([1.0, 0.0, 0.0, 0.0])
    left = dq.mul(dq.from_position_quaternion(offset, upright), absolute.dq)
    return PosePath(left), PosePath(dq.mul(left, relative.dqs))


def relative_jacobian(x_left: ArrayLike, j_left: ArrayLike, x_right: ArrayLike, j_right: ArrayLike) -> np.ndarray:
    """Jacobian (8, nL + nR) of the relative pose: `vec rho_dot = J [qdot_L, qdot_R]`, rho = x_L* x_R.

    `[H-(x_R) C8 J8_L, H+(x_L*) J8_R]` with `J8 = H+(x) E J_b / 2`.

    Args:
        x_left: (8,) world_from_left.
        j_left: (6, nL) body Jacobian, rows (v, omega), as `Arm.fk_jacobian` gives it.
        x_right: (8,) world_from_right.
        j_right: (6, nR) body Jacobian.
    """
    left = dq.hamilton_minus(x_right) @ dq.CONJUGATE_8 @ _pose_jacobian(x_left, j_left, "left Jacobian")
    right = dq.hamilton_plus(dq.conj(x_left)) @ _pose_jacobian(x_right, j_right, "right Jacobian")
    return np.concatenate([left, right], axis=1)


def relative_twist_jacobian(x_left: ArrayLike, j_left: ArrayLike, x_right: ArrayLike, j_right: ArrayLike) -> np.ndarray:
    """Jacobian (6, nL + nR) of the relative pose's body twist (v, omega), in the frame of the right end effector.

    The body twist is `2 rho* rho_dot`; equal to `[-Ad(rho*) J_L, J_R]`. Arguments as in `relative_jacobian`.
    """
    jacobian = relative_jacobian(x_left, j_left, x_right, j_right)
    pure = 2.0 * dq.hamilton_plus(dq.mul(dq.conj(x_right), x_left)) @ jacobian
    return pure[[5, 6, 7, 1, 2, 3]]


def _pose_jacobian(x: ArrayLike, body: ArrayLike, name: str) -> np.ndarray:
    """Derivative (8, n) of vec x: x times half the body twist of each joint."""
    body = np.asarray(body, dtype=np.float64)
    if body.ndim != 2 or len(body) != 6:
        raise BadShape(name, body.shape, "(6, n)")
    pure = np.zeros((8, body.shape[1]))
    pure[1:4], pure[5:8] = body[3:], body[:3]
    return 0.5 * dq.hamilton_plus(x) @ pure


def _rows(poses: PosePath | Pose, count: int, name: str) -> np.ndarray:
    """Dual quaternions that broadcast against `count` rows."""
    if isinstance(poses, Pose):
        return poses.dq
    if len(poses) != count:
        raise BadShape(name, poses.dqs.shape, f"({count}, 8), as many poses as the other path")
    return poses.dqs


def _checked_share(name: str, value: float) -> float:
    if not 0.0 <= value <= 1.0:
        raise BadOption(name, f"{value} is not in [0, 1]")
    return float(value)


def _signed(relative: PosePath) -> np.ndarray:
    """Signs continuous along the path, the first with w >= 0, so that its power is the shortest one there."""
    return relative.dqs if relative.dqs[0, 0] >= 0.0 else -relative.dqs


def _continuous_power(relative: PosePath, beta: float) -> np.ndarray:
    """`rho^beta` (n, 8), continuous along the path; see `split` for what is refused and warned about."""
    if 0.0 < beta < 1.0:
        angle = float(turns(relative).max())
        if angle > 2.0 * math.pi - FULL_TURN_MARGIN:
            raise BadOption("beta", f"{beta}, but the relative rotation reaches {angle:.3g} rad; allowed are 0 and 1")
        if angle > math.pi:
            text = f"the relative rotation reaches {angle:.3g} rad, more than a half turn"
            warnings.warn(text, HalfTurnPassed, stacklevel=3)
    return dq.sclerp(dq.identity(), _signed(relative), beta, shortest=False)
