"""Inverse kinematics by the controller's own law."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import checked_kind
from ..geometry import screw
from ..geometry.pose import METERS_PER_RADIAN, Pose
from ..jit import kernel
from ..ranges import check_count
from ..robot.arm import Arm
from .arm_arrays import ARM, arm_arrays, pose_and_jacobian
from .controller import ControllerSettings, joint_velocity

POSITION_TOLERANCE, ANGLE_TOLERANCE = 1e-4, 1e-3
"""Distance [m] and angle [rad] within which a pose counts as reached."""
_STEP = ControllerSettings(
    gain=0.5, max_linear=0.15, max_angular=0.5, null_gain=0.3, limit_gain=1.0, damping_threshold=0.03
).packed()
"""Settings of one iteration: a control step of one second."""


@kernel
def _solve(work, target, q, iterations, qdot):
    """Move q to a solution; returns False if none is reached."""
    for _ in range(iterations):
        x = pose_and_jacobian(work, q)
        distance, angle = screw.pose_distance(x, target)
        if distance < POSITION_TOLERANCE and angle < ANGLE_TOLERANCE:
            return True
        joint_velocity(work, q, screw.shorter(screw.mul(screw.conj(x), target)), qdot)
        for i in range(len(q)):
            q[i] += qdot[i]
    return False


def inverse_kinematics(arm: Arm, target: Pose, seed: ArrayLike, *, iterations: int = 300) -> np.ndarray | None:
    """Return joints (dof,) that reach a pose within 0.1 mm and 1 mrad, or None.

    The search is local: another seed may lead to another posture, or succeed where this one fails. From one random
    seed to a random reachable pose it fails more often than not.

    Args:
        arm: the arm.
        target: pose of the tcp.
        seed: (dof,) joints at the start of the search.
        iterations: largest number of iterations.

    Raises:
        WrongType, BadShape, NotFinite: the seed is not (dof,) finite numbers, or another argument is of a wrong class.
        BadOption: the number of iterations is not a whole number from 1 to a million.
    """
    q, reached = _searched(arm, target, seed, iterations)
    return q if reached else None


class Reached(NamedTuple):
    """Where a search of inverse kinematics ends.

    Attributes:
        joints: (dof,) joints [rad or m].
        distance: of the tcp from the wanted position [m].
        angle: of the tcp from the wanted rotation [rad].
    """

    joints: np.ndarray
    distance: float
    angle: float

    @property
    def there(self) -> bool:
        """True within 0.1 mm and 1 mrad."""
        return self.distance < POSITION_TOLERANCE and self.angle < ANGLE_TOLERANCE


def nearest_reached(arm: Arm, target: Pose, seeds: Iterable[ArrayLike], *, iterations: int = 300) -> Reached:
    """Return the end of inverse kinematics that is nearest to a pose.

    Args:
        arm: the arm.
        target: pose of the tcp.
        seeds: (dof,) joints each, at the starts of the searches.
        iterations: largest number of iterations of each.

    Raises:
        WrongType, BadShape, NotFinite, BadOption: as `inverse_kinematics`.
    """
    ends = (_searched(arm, target, seed, iterations)[0] for seed in seeds)
    found = (Reached(q, *arm.fk(q).distance_to(target)) for q in ends)
    return min(found, key=lambda end: math.hypot(end.distance, METERS_PER_RADIAN * end.angle))


def _searched(arm: Arm, target: Pose, seed: ArrayLike, iterations: int) -> tuple[np.ndarray, bool]:
    """Return the joints (dof,) at the end of a search, and whether they reach the pose."""
    check_count("iterations", iterations, "[1, 1000000]")
    goal = tuple(float(value) for value in checked_kind("target", target, Pose).dq)
    q = checked_kind("arm", arm, Arm).checked(seed).copy()
    return q, _solve(_unhurried(arm), goal, q, iterations, np.empty(arm.dof))


def _unhurried(arm: Arm) -> np.ndarray:
    """Array of the arm with limits by which an iteration moves no joint by more than half a radian."""
    work = arm_arrays(arm, _STEP)
    work[ARM.speed] = 0.5
    return work
