"""Paths of carried objects whose constraints are known: a tray, a poured glass, a handle, a door, a book."""

from __future__ import annotations

import numpy as np

from onedemo.planner import Pose, PosePath


def turned(axis, angle: float) -> Pose:
    """A rotation about an axis through the origin."""
    axis = np.array(axis, dtype=float) / np.linalg.norm(axis)
    return Pose.from_position_quaternion(np.zeros(3), [np.cos(0.5 * angle), *(np.sin(0.5 * angle) * axis)])


def shifted(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Pose:
    """A translation."""
    return Pose.from_position_quaternion([x, y, z], [1.0, 0.0, 0.0, 0.0])


def path_of(poses) -> PosePath:
    """The path through poses."""
    return PosePath(np.array([pose.dq for pose in poses]))


GRIP = Pose.from_position_quaternion(
    [0.02, -0.01, 0.05], np.array([0.6, 0.2, -0.5, 0.3]) / np.linalg.norm([0.6, 0.2, -0.5, 0.3])
)
"""A hand on an object: no axis of the hand is one of the object's."""


def tray(count: int = 80, tremor: float = 0.0, seed: int = 0) -> PosePath:
    """A tray carried along an arc, turned about the vertical, with a hand that trembles by an angle [rad]."""
    rng, at = np.random.default_rng(seed), np.linspace(0.0, 1.0, count)
    tilts = tremor * np.clip(rng.normal(size=(count, 2)), -1.5, 1.5)
    return path_of(
        shifted(0.5 * s, 0.3 * s * s, 0.2 * s)
        @ turned((0, 0, 1), 1.2 * s)
        @ turned((1, 0, 0), a)
        @ turned((0, 1, 0), b)
        @ GRIP
        for s, (a, b) in zip(at, tilts, strict=True)
    )


def poured(count: int = 120, share: float = 0.5, angle: float = 1.9) -> PosePath:
    """A glass carried upright for a share of the poses, then tilted by an angle [rad] about its lip."""
    out, begun = [], int(share * count)
    for k in range(count):
        tilt = angle * max(0, k - begun) / (count - 1 - begun)
        along = 0.4 * min(k, begun) / begun
        out.append(shifted(along, 0.1 * along, 0.3) @ turned((1, 0.3, 0), tilt) @ shifted(0.0, 0.04, -0.1) @ GRIP)
    return path_of(out)


def hinged(axis, count: int = 60, angle: float = 0.9) -> PosePath:
    """A hand that turns a handle or a door about a fixed axis."""
    there = shifted(0.5, 0.2, 0.8)
    return path_of(there @ turned(axis, angle * k / (count - 1)) @ shifted(0.1, 0.0, 0.05) @ GRIP for k in range(count))


def book(count: int = 100) -> PosePath:
    """A book carried from lying to standing, turned about its long axis all the way."""
    at = np.linspace(0.0, 1.0, count)
    return path_of(shifted(0.4 * s, 0.1, 0.2 * s) @ turned((0, 1, 0), 0.5 * np.pi * s) @ GRIP for s in at)
