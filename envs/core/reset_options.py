"""Checks of the options given to environments and to `reset(options=...)`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ...planner import Arm
from ...planner.errors import BadOption, UnknownName
from ...planner.robot.joint_limits import beyond_limit, within_limits


def checked_choice(option: str, value: object, known: tuple[str, ...]) -> str:
    """Return the value if it is one of the known ones.

    Args:
        option: name of the option, for the message.
        value: value to check.
        known: allowed values.

    Raises:
        UnknownName: the value is not among them.
    """
    if not isinstance(value, str) or value not in known:
        raise UnknownName(option, value, known)
    return value


def check_known(options: Iterable[str], known: tuple[str, ...]) -> None:
    """Refuse reset options that a task does not have.

    Args:
        options: names of the given options.
        known: names of the task's options.

    Raises:
        UnknownName: a given option is not among the known ones.
    """
    for key in options:
        if key not in known:
            raise UnknownName("reset option", key, known)


def checked_array(option: str, value: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Return the value as a finite float64 array of the given shape.

    Args:
        option: name of the option, for the message.
        value: numbers in any array-like form.
        shape: required shape.

    Raises:
        BadOption: the value is not numeric, of another shape, or not finite.
    """
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise BadOption(option, f"is not an array of numbers of shape {shape}") from None
    if array.shape != shape:
        raise BadOption(option, f"has shape {array.shape}; expected {shape}")
    if not np.isfinite(array).all():
        index = tuple(int(k) for k in np.argwhere(~np.isfinite(array))[0])
        raise BadOption(option, f"holds a value that is not finite at index {index}")
    return array


def checked_poses(option: str, value: Any, count: int) -> np.ndarray:
    """Return poses (count, 7) with unit quaternions.

    Args:
        option: name of the option, for the message.
        value: poses (count, 7), x y z [m] and wxyz with a norm within 1e-3 of 1.
        count: number of poses.

    Raises:
        BadOption: the value is not such an array.
    """
    poses = checked_array(option, value, (count, 7))
    norms = np.linalg.norm(poses[:, 3:], axis=1)
    if (np.abs(norms - 1.0) > 1e-3).any():
        worst = int(np.abs(norms - 1.0).argmax())
        raise BadOption(option, f"quaternion {worst} has norm {norms[worst]:.6g}; expected 1")
    poses[:, 3:] /= norms[:, None]
    return poses


def checked_joints(value: Any, arms: tuple[Arm, ...]) -> np.ndarray:
    """Return joints (n_arms, dof) [rad] within the limits; those beyond one by rounding are at it.

    Args:
        value: joints (n_arms, dof) [rad]; for one arm also (dof,).
        arms: kinematics of the arms, with their limits.

    Raises:
        BadOption: the value has another shape, or a joint is outside its limits.
    """
    shape = (len(arms), arms[0].dof)
    flat = np.ndim(value) == 1 and len(arms) == 1
    joints = checked_array("joint_positions", [value] if flat else value, shape)
    joints = np.array([within_limits(arm, q) for arm, q in zip(arms, joints, strict=True)])
    for arm, q in zip(arms, joints, strict=True):
        if beyond := beyond_limit(arm, q):
            raise BadOption("joint_positions", beyond)
    return joints
