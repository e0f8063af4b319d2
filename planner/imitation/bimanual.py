"""Two arms, one demonstration: relative and absolute paths of two end effectors, and ways to share the motion.

The relative pose `rho = x_L* x_R` defines the task; the absolute pose a defines its place in the world.
`x_L = a rho^-beta` and `x_R = a rho^(1 - beta)` give `x_L* x_R = rho` for every a and beta: beta is the left arm's
fraction of the relative motion. Imitation applies to rho as to any path: relative poses form the same group.

Not in the paper, which has two arms in its experiments and no formulas for them: cooperative task space (Adorno,
Fraisse and Druon 2010) on screws; method reference section 8.
"""

from __future__ import annotations

import math
import warnings

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import checked_array
from ..errors import BadOption, BadShape
from ..geometry import dualquat as dq
from ..geometry.pose import Pose, PosePath
from ..ranges import check_range

FULL_TURN_MARGIN = 0.5
"""Smallest angle [rad] to a full turn, where a fractional power jumps; up to there rotations grow at most fourfold."""


class HalfTurnPassed(UserWarning):
    """The relative rotation passes a half turn: its fractional power necessarily continues the longer way."""


def relative_path(left: PosePath | Pose, right: PosePath) -> PosePath:
    """Return the relative path `rho = x_L* x_R` (n poses): the right end effector in the frame of the left one.

    Args:
        left: world_from_left, one pose or a path of n.
        right: world_from_right, n poses.

    Raises:
        BadShape: the paths differ in their number of poses.
    """
    return PosePath(dq.mul(dq.conj(_rows(left, len(right), "left path")), right.dqs))


def absolute_path(left: PosePath | Pose, right: PosePath, beta: float) -> PosePath:
    """Return the absolute path `a = x_L rho^beta` (n poses), the inverse of `split`.

    Args:
        left: world_from_left, one pose or a path of n.
        right: world_from_right, n poses.
        beta: 0 for the left end effector itself, 1 for the right one, 1/2 for the middle of the screw between them.

    Raises:
        BadOption, BadShape: as `split`.

    Warns:
        HalfTurnPassed: as `split`.
    """
    power = _continuous_power(relative_path(left, right), _checked_share("beta", beta))
    return PosePath(dq.mul(_rows(left, len(right), "left path"), power))


def split(relative: PosePath, absolute: Pose | PosePath, beta: float) -> tuple[PosePath, PosePath]:
    """Split a relative path into paths of the left and the right end effector, `a rho^-beta` and `a rho^(1 - beta)`.

    Gravity: beta = 0 with an upright a keeps the object in the left hand upright; any other beta tilts both objects.

    Args:
        relative: left_from_right, n poses.
        absolute: place of the task in the world, one pose or n.
        beta: in [0, 1], the left arm's fraction of the relative motion.

    Raises:
        BadOption: beta outside [0, 1], or a relative rotation near a full turn with 0 < beta < 1.
        BadShape: absolute has another number of poses.

    Warns:
        HalfTurnPassed: the relative rotation passes a half turn and 0 < beta < 1.
    """
    power = _continuous_power(relative, _checked_share("beta", beta))
    left = dq.mul(_rows(absolute, len(relative), "absolute path"), dq.conj(power))
    # the second path is x_L rho, so that the relative path is exact to rounding for any power
    return PosePath(left), PosePath(dq.mul(left, relative.dqs))


def turns(relative: PosePath) -> np.ndarray:
    """Return the rotation angle (n,) [rad] in [0, 2 pi], continuous along the path and at most pi at its start."""
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
    """Return the path left_from_right by which two hands repeat one hand's demonstration over a fixed object.

    `rho_j = G_L (w* d_j G_p) G_R*`: the bracket is the poured object in the frame of the receiving one.

    Args:
        pourer: world_from_tool of the demonstration, n poses.
        receiver: world_from_receiver of the demonstration, the pose of the receiving object.
        tool_from_poured: grasp of the poured object in the demonstration.
        left_from_receiver: the left hand's grasp of the receiving object.
        right_from_poured: the right hand's grasp of the poured object.
    """
    of_objects = pourer.moved(receiver.inverse()).with_tool(tool_from_poured)
    return of_objects.moved(left_from_receiver).with_tool(right_from_poured.inverse())


def shared_translation(relative: PosePath, absolute: Pose, share: float = 0.5) -> tuple[PosePath, PosePath]:
    """Share only the translation of a relative path: the left end effector keeps its attitude.

    `x_L = (R_a, p_a - share R_a (t_rho - t_rho(end)))`, `x_R = x_L rho`: the relative path is exact and its
    translation is shared; an upright left glass stays upright. Not in the paper; with a true beta = 1/2 both glasses
    tilt.

    Args:
        relative: left_from_right, n poses. The translation is that of the right frame's origin.
        absolute: world_from_left at the end of the path, independent of the share.
        share: in [0, 1], the left arm's fraction of the translation; 0 leaves the left arm at rest.

    Returns:
        Paths of the left and the right end effector, n poses each.

    Raises:
        BadOption: a share outside [0, 1].
    """
    share = _checked_share("share", share)
    away = relative.positions - relative.positions[-1]
    offset = -share * away @ absolute.rotation.T
    upright = np.array([1.0, 0.0, 0.0, 0.0])
    left = dq.mul(dq.from_position_quaternion(offset, upright), absolute.dq)
    return PosePath(left), PosePath(dq.mul(left, relative.dqs))


def relative_jacobian(x_left: ArrayLike, j_left: ArrayLike, x_right: ArrayLike, j_right: ArrayLike) -> np.ndarray:
    """Return the Jacobian (8, nL + nR) of the relative pose: `vec rho_dot = J [qdot_L, qdot_R]`, rho = x_L* x_R.

    `[H-(x_R) C8 J8_L, H+(x_L*) J8_R]` with `J8 = H+(x) E J_b / 2`.

    Args:
        x_left: (8,) world_from_left.
        j_left: (6, nL) body Jacobian, rows (v, omega), as returned by `Arm.fk_jacobian`.
        x_right: (8,) world_from_right.
        j_right: (6, nR) body Jacobian.

    Raises:
        WrongType, BadShape, NotFinite: a pose that is not (8,), or a Jacobian that is not (6, n) finite numbers.
    """
    left = dq.hamilton_minus(x_right) @ dq.CONJUGATE_8 @ _pose_jacobian(x_left, j_left, "left Jacobian")
    right = dq.hamilton_plus(dq.conj(x_left)) @ _pose_jacobian(x_right, j_right, "right Jacobian")
    return np.concatenate([left, right], axis=1)


def relative_twist_jacobian(x_left: ArrayLike, j_left: ArrayLike, x_right: ArrayLike, j_right: ArrayLike) -> np.ndarray:
    """Return the Jacobian (6, nL + nR) of the relative pose's body twist (v, omega), in the right end effector's frame.

    The body twist is `2 rho* rho_dot`; equal to `[-Ad(rho*) J_L, J_R]`.

    Args:
        x_left: (8,) world_from_left.
        j_left: (6, nL) body Jacobian, rows (v, omega).
        x_right: (8,) world_from_right.
        j_right: (6, nR) body Jacobian.

    Raises:
        WrongType, BadShape, NotFinite: a pose that is not (8,), or a Jacobian that is not (6, n) finite numbers.
    """
    jacobian = relative_jacobian(x_left, j_left, x_right, j_right)
    pure = 2.0 * dq.hamilton_plus(dq.mul(dq.conj(x_right), x_left)) @ jacobian
    return pure[[5, 6, 7, 1, 2, 3]]


def _pose_jacobian(x: ArrayLike, body: ArrayLike, name: str) -> np.ndarray:
    """Return the derivative (8, n) of vec x: x times half the body twist of each joint."""
    body = checked_array(name, body, (6, None))
    pure = np.zeros((8, body.shape[1]))
    pure[1:4], pure[5:8] = body[3:], body[:3]
    return 0.5 * dq.hamilton_plus(x) @ pure


def _rows(poses: PosePath | Pose, count: int, name: str) -> np.ndarray:
    """Return dual quaternions that broadcast against `count` rows."""
    if isinstance(poses, Pose):
        return poses.dq
    if len(poses) != count:
        raise BadShape(name, poses.dqs.shape, f"({count}, 8), as many poses as the other path")
    return poses.dqs


def _checked_share(name: str, value: float) -> float:
    check_range(name, value, "[0, 1]")
    return float(value)


def _signed(relative: PosePath) -> np.ndarray:
    """Return signs continuous along the path, the first with w >= 0, so that its power is the shortest one there."""
    return relative.dqs if relative.dqs[0, 0] >= 0.0 else -relative.dqs


def _continuous_power(relative: PosePath, beta: float) -> np.ndarray:
    """Return `rho^beta` (n, 8), continuous along the path; `split` lists the errors and warnings."""
    if 0.0 < beta < 1.0:
        angle = float(turns(relative).max())
        if angle > 2.0 * math.pi - FULL_TURN_MARGIN:
            raise BadOption("beta", f"{beta}, but the relative rotation reaches {angle:.3g} rad; allowed are 0 and 1")
        if angle > math.pi:
            text = f"the relative rotation reaches {angle:.3g} rad, more than a half turn"
            warnings.warn(text, HalfTurnPassed, stacklevel=3)
    return dq.sclerp(dq.identity(), _signed(relative), beta, shortest=False)
