"""Random poses for property tests, the hard cases among them, and what equality of poses means."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onedemo.planner.geometry import dualquat as dq
from onedemo.planner.geometry.pose import PosePath

ANGLES = (0.0, 1e-15, 1e-12, 1e-9, 1e-7, 1e-5, 1e-3, 0.009, 0.011, 0.5, 1.5, 3.0, 3.14159, np.pi - 1e-9, np.pi)
"""Rotations at which closed forms lose digits or change branch."""

ANY_ANGLE = st.one_of(st.sampled_from(ANGLES), st.floats(0, np.pi))


def for_all(*args, max_examples: int = 80, **kwargs):
    """Run a test for drawn values."""
    return lambda test: settings(max_examples=max_examples, deadline=None)(given(*args, **kwargs)(test))


def known_defect(reason: str):
    """A true claim that the code does not meet yet: fails once it does, so that the mark goes."""
    return pytest.mark.xfail(strict=True, reason=reason)


@st.composite
def directions(draw):
    vector = np.array([draw(st.floats(-1, 1)) for _ in range(3)])
    norm = np.linalg.norm(vector)
    return vector / norm if norm > 1e-3 else np.array([0.0, 0.0, 1.0])


def positions(reach: float = 1.5):
    return st.tuples(*[st.floats(-reach, reach)] * 3).map(np.array)


@st.composite
def dqs(draw, angles=ANY_ANGLE, signed=True):
    """Unit dual quaternions (8,) with either sign."""
    angle, axis = draw(angles), draw(directions())
    quaternion = np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * axis])
    sign = draw(st.sampled_from([1.0, -1.0])) if signed else 1.0
    return sign * dq.from_position_quaternion(draw(positions()), quaternion / np.linalg.norm(quaternion))


def gentle_dqs():
    """Away from the half turn, where the shortest way is ambiguous."""
    return dqs(angles=st.floats(0, np.pi - 1e-2))


def random_dq(rng: np.random.Generator, *shape: int) -> np.ndarray:
    quaternion = rng.normal(size=(*shape, 4))
    quaternion /= np.linalg.norm(quaternion, axis=-1, keepdims=True)
    return dq.from_position_quaternion(rng.uniform(-1, 1, (*shape, 3)), quaternion)


def random_path(rng: np.random.Generator, count: int, step: float = 0.1) -> PosePath:
    """A smooth-ish walk of screw motions."""
    twists = rng.normal(size=(count - 1, 6)) * step
    poses = [random_dq(rng)]
    for twist in twists:
        poses.append(dq.normalized(dq.mul(poses[-1], dq.dq_from_twist(twist))))
    return PosePath(np.array(poses))


def assert_same_pose(a, b, tolerance: float) -> None:
    """Equal as poses: x and -x are the same; NaN is never equal."""
    a, b = np.asarray(a), np.asarray(b)
    assert a.shape == b.shape
    difference = np.minimum(np.abs(a - b).max(axis=-1), np.abs(a + b).max(axis=-1))
    assert np.isfinite(difference).all()
    assert difference.max() <= tolerance, f"differ by {difference.max():.3g}"
