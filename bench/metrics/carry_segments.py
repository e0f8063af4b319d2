"""Carries of an episode and the tilt of the carried object, from the simulator's contacts and poses alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...envs.pour.geometry import GLASSES
from ...envs.pour.rules import ARRIVED
from .trace import Trace

LIFTED = 0.02
"""Height [m] above its pose at the grasp from which an object counts as carried."""
FLICKER = 0.2
"""Longest loss of contact [s] that does not end a grasp."""


@dataclass(frozen=True, slots=True, eq=False)
class Carry:
    """One object in one hand, from grasp to release.

    Attributes:
        arm: index of the hand.
        object: index of the object.
        first: tick of the grasp.
        last: tick of the release, or the last tick.
        aloft: (last - first + 1,) True at ticks in which the object is carried: lifted, and not yet at the pouring
            place.
    """

    arm: int
    object: int
    first: int
    last: int
    aloft: np.ndarray


def carries(trace: Trace, poured_into: int | None = None) -> list[Carry]:
    """Return all carries of an episode, in order of their grasps; grasps without a lift are skipped.

    Args:
        trace: the episode.
        poured_into: index of the target glass: carrying ends near it; None if nothing is poured.
    """
    found = []
    for arm in range(trace.held.shape[1]):
        for k in range(trace.held.shape[2]):
            if k != poured_into:
                found += [_carry(trace, arm, k, *run, poured_into) for run in _runs(trace.held[:, arm, k], trace.dt)]
    return sorted((carry for carry in found if carry.aloft.any()), key=lambda carry: carry.first)


def _runs(held: np.ndarray, dt: float) -> list[tuple[int, int]]:
    """Return first and last tick of every run of True, with short gaps closed."""
    ticks = np.flatnonzero(held)
    if not len(ticks):
        return []
    breaks = np.flatnonzero(np.diff(ticks) * dt > FLICKER)
    return list(zip(ticks[np.r_[0, breaks + 1]].tolist(), ticks[np.r_[breaks, len(ticks) - 1]].tolist(), strict=True))


def _carry(trace: Trace, arm: int, k: int, first: int, last: int, poured_into: int | None) -> Carry:
    poses = trace.objects[first : last + 1, k]
    # an object held from the start has no support to be lifted from
    aloft = np.ones(len(poses), dtype=bool) if first == 0 else poses[:, 2] > poses[0, 2] + LIFTED
    if poured_into is not None:
        rim = poses[:, :2] + 0.5 * GLASSES[k].height * axes(poses)[:, :2]
        away = np.linalg.norm(rim - trace.objects[first : last + 1, poured_into, :2], axis=1)
        aloft = aloft & (np.cumsum(away < ARRIVED) == 0)
    return Carry(arm, k, first, last, aloft)


def axes(poses: np.ndarray) -> np.ndarray:
    """Return the z axes (n, 3) of poses (n, 7)."""
    _, _, _, w, x, y, z = poses.T
    return np.column_stack([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)])


def tilts(poses: np.ndarray) -> np.ndarray:
    """Return the angles (n,) between the z axes of poses (n, 7) and the vertical [rad]."""
    up = axes(poses)
    return np.arctan2(np.hypot(up[:, 0], up[:, 1]), up[:, 2])


def carrying_tilt(trace: Trace, found: list[Carry]) -> tuple[float | None, float | None]:
    """Return the tilt of the carried objects.

    Args:
        trace: the episode.
        found: its carries.

    Returns:
        Largest tilt [rad] and integral of the tilt over the carrying time [rad s]; None without a carry.
    """
    if not found:
        return None, None
    parts = [tilts(trace.objects[c.first : c.last + 1, c.object])[c.aloft] for c in found]
    return max(float(part.max()) for part in parts), float(sum(part.sum() for part in parts) * trace.dt)
