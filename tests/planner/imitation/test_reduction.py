"""Paths with a bounded number of poses: ends, spacing and deviation, against the path itself."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers.strategies import for_all, random_dq, st

from onedemo.planner.errors import BadOption
from onedemo.planner.geometry import dualquat as dq
from onedemo.planner.geometry.pose import METERS_PER_RADIAN, Pose, PosePath, nearest
from onedemo.planner.imitation.reduction import reduced


def wandering(seed: int, count: int, step: float = 0.01) -> PosePath:
    """A path of random small screws, with pauses."""
    rng = np.random.default_rng(seed)
    twists = rng.normal(0.0, step, (count, 6)) * (rng.uniform(size=(count, 1)) > 0.2)
    poses = [random_dq(rng)]
    for twist in twists[1:]:
        poses.append(dq.mul(poses[-1], dq.dq_from_twist(twist)))
    return PosePath(np.array(poses))


def test_a_short_path_is_the_path_itself():
    path = wandering(0, 50)
    assert reduced(path, 50) == (path, 0.0) and reduced(path, 50).path is path


@for_all(st.integers(0, 10**6), st.integers(2, 60), max_examples=60)
def test_ends_are_kept_and_no_pose_is_farther_than_said(seed, most):
    path = wandering(seed, 61)
    kept, deviation = reduced(path, most)
    assert len(kept) == most
    np.testing.assert_array_equal(
        kept.dqs[[0, -1], :], [path.dqs[0], np.copysign(1.0, kept.dqs[-1] @ path.dqs[-1]) * path.dqs[-1]]
    )
    # at equal path length, which is more than to the nearest place; and the spacing bounds it
    spacing = path.lengths()[-1] / (most - 1)
    assert 0.0 <= deviation <= 1.01 * spacing
    for pose in path:
        distance, angle = pose.distance_to(kept[nearest(kept, pose)])
        assert math.hypot(distance, METERS_PER_RADIAN * angle) <= deviation + 0.51 * spacing


def test_a_screw_is_kept_to_rounding():
    twist = np.array([0.3, 0.1, 0.0, 0.0, 0.0, 1.0])
    screw = PosePath(dq.dq_from_twist(np.linspace(0.0, 1.0, 5001)[:, None] * twist))
    kept, deviation = reduced(screw, 400)
    assert len(kept) == 400 and deviation < 1e-9


def test_a_path_that_stands_still_is_two_poses():
    still = PosePath(np.tile(Pose.identity().dq, (100, 1)))
    kept, deviation = reduced(still, 10)
    assert len(kept) == 2 and deviation == 0.0


def test_fewer_than_two_poses_are_refused():
    with pytest.raises(BadOption, match="most"):
        reduced(wandering(0, 5), 1)
