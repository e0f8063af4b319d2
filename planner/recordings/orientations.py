"""Quaternions from Euler angles, rotation vectors and matrices, in whatever order these were written."""

from __future__ import annotations

import re

import numpy as np

from .recording import Blame

RPY = "xyz"
"""Roll, pitch, yaw as in ROS: about the fixed axes x, then y, then z."""
SEQUENCE = re.compile(r"(?!.?(.)\1)(?:[xyz]{3}|[XYZ]{3})")
ROTATIONS = "rotvec, rpy, or three axes, fixed like xyz or moving like ZYX"
"""Allowed words of the option --rotation."""
MATRIX_ORDERS = ("rows", "columns")
UNIT = 1e-3
"""Largest deviation of an entry of R Rᵀ, or of a matrix's constant entries, that counts as rounding."""


def is_rotation_word(word: str) -> bool:
    """Return whether a word says how three numbers are an orientation, see `ROTATIONS`."""
    return word in ("rotvec", "rpy") or SEQUENCE.fullmatch(word) is not None


def from_three(numbers: np.ndarray, word: str) -> np.ndarray:
    """Return quaternions (n, 4) wxyz of rotation vectors or Euler angles.

    Args:
        numbers: (n, 3) [rad]; Euler angles in the order in which they are applied.
        word: one of `ROTATIONS`; lower-case axes stand still, upper-case axes turn with the hand.
    """
    from scipy.spatial.transform import Rotation

    turns = (
        Rotation.from_rotvec(numbers)
        if word == "rotvec"
        else Rotation.from_euler(RPY if word == "rpy" else word, numbers)
    )
    return turns.as_quat()[:, [3, 0, 1, 2]]


def from_rotations(matrices: np.ndarray, blame: Blame) -> np.ndarray:
    """Return quaternions (n, 4) wxyz of rotation matrices.

    Args:
        matrices: (n, 3, 3), orthonormal up to rounding.
        blame: makes an error from a reason.

    Raises:
        BadDemonstration: one is no rotation; the error names its index.
    """
    from scipy.spatial.transform import Rotation

    off = _deviations(matrices)
    k = int(off.argmax())
    if off[k] > UNIT:
        raise blame(f"the rotation matrix at index {k} is off from orthonormal by {off[k]:.3g}")
    mirrored = np.linalg.det(matrices) < 0.0
    if mirrored.any():
        raise blame(f"the matrix at index {int(mirrored.argmax())} mirrors (determinant -1), which no rotation does")
    return Rotation.from_matrix(matrices).as_quat()[:, [3, 0, 1, 2]]


def _deviations(matrices: np.ndarray) -> np.ndarray:
    """Return by how much each matrix (n, 3, 3) is off from orthonormal."""
    return np.abs(matrices @ matrices.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))


def matrix_order(numbers: np.ndarray, said: str, blame: Blame) -> str:
    """Return whether matrices were written by "rows" or by "columns".

    Of homogeneous matrices the constant entries tell it, of their upper three rows that rotations are orthonormal; of
    rotations alone nothing does.

    Args:
        numbers: (n, 9), (n, 12) or (n, 16), as recorded.
        said: what the user says; "" if nothing.
        blame: makes an error from a reason.

    Raises:
        BadDemonstration: the numbers contradict the user, fit neither order, or fit both and nothing is said.
    """
    width = numbers.shape[1]
    fitting = [order for order in MATRIX_ORDERS if _misfit(numbers, order).max() <= UNIT]
    if not fitting:
        if width == 16:
            raise blame("are no homogeneous matrices: neither the last row nor the last column is 0 0 0 1")
        raise blame("are no rotation and position, neither by rows nor by columns")
    if said and said not in fitting:
        raise blame(f"are matrices written by {fitting[0]}; --matrix {said} contradicts it")
    if not said and len(fitting) > 1:
        raise blame("are matrices written by rows or by columns: say which by --matrix")
    return said or fitting[0]


def _misfit(numbers: np.ndarray, order: str) -> np.ndarray:
    """Return by how much each row of numbers is off from a matrix written in an order."""
    if numbers.shape[1] == 9:
        return np.zeros(len(numbers))
    if numbers.shape[1] == 12:
        return _deviations(matrices_of(numbers, order)[:, :, :3])
    return np.abs(matrices_of(numbers, order)[:, 3] - [0.0, 0.0, 0.0, 1.0]).max(axis=1)


def matrices_of(numbers: np.ndarray, order: str) -> np.ndarray:
    """Return matrices (n, 3, 3), (n, 3, 4) or (n, 4, 4).

    Args:
        numbers: (n, 9), (n, 12) or (n, 16), as recorded.
        order: "rows" or "columns".
    """
    columns = 3 if numbers.shape[1] == 9 else 4
    rows = numbers.shape[1] // columns
    if order == "rows":
        return numbers.reshape(-1, rows, columns)
    return numbers.reshape(-1, columns, rows).transpose(0, 2, 1)
