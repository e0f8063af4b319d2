"""Poses against joints: agreement in any frames, contradiction wherever something is wrong."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.arms import table_panda
from helpers.strategies import for_all, random_dq, st

from onedemo.planner.errors import BadDemonstration
from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.recordings.kinematic_check import DOUBTFUL, base_in, checked_against_joints, joints_path


def motion(rng: np.random.Generator) -> PosePath:
    """The tcp's path while the joints move from here to there by way of a third posture."""
    arm, _, home = table_panda()
    knots = np.clip(home + rng.normal(size=(3, 7)) * 0.4, arm.lower, arm.upper)
    joints = np.concatenate([np.linspace(knots[k], knots[k + 1], 30) for k in range(2)])
    return joints_path(arm, joints)


def frame(rng: np.random.Generator, far: float) -> Pose:
    return Pose.from_position_quaternion(rng.uniform(-far, far, 3), Pose(random_dq(rng)).quaternion)


@for_all(st.integers(0, 10**6), max_examples=40)
def test_poses_in_any_frames_agree_and_the_words_say_which(seed):
    rng = np.random.default_rng(seed)
    path = motion(rng)
    assert checked_against_joints("x", "poses", path, path).startswith("agrees with the joints to 0.0 mm")
    base, tool = frame(rng, 2.0), frame(rng, 0.15)
    assert checked_against_joints("x", "poses", path.moved(base), path).endswith("up to another base")
    assert checked_against_joints("x", "poses", path.with_tool(tool), path).endswith("up to another tool frame")
    assert checked_against_joints("x", "poses", path.moved(base).with_tool(tool), path).endswith(DOUBTFUL)


@for_all(st.integers(0, 10**6), max_examples=40)
def test_the_recorded_base_is_found_where_it_alone_explains_the_poses(seed):
    rng = np.random.default_rng(seed)
    path, base, tool = motion(rng), frame(rng, 2.0), frame(rng, 0.15)
    distance, angle = base_in(path.moved(base), path).distance_to(base)
    assert distance < 1e-6 and angle < 1e-6
    for poses in (path, path.with_tool(tool), path.with_tool(Pose.from_position_quaternion([0, 0, 0.001]))):
        assert base_in(poses, path).distance_to(Pose.identity()) == (0.0, 0.0)


def mixed(path: PosePath) -> PosePath:
    return PosePath.from_vectors(path.vectors[:, [0, 1, 2, 4, 5, 6, 3]])


@for_all(st.integers(0, 10**6), max_examples=40)
@pytest.mark.parametrize(
    "spoil",
    [
        mixed,
        lambda path: PosePath.from_vectors(path.vectors * [10, 10, 10, 1, 1, 1, 1]),
        lambda path: PosePath.from_vectors(path.vectors * [1, -1, 1, 1, 1, 1, 1]),
        lambda path: path.reversed(),
        lambda path: PosePath(path.dqs[np.maximum(np.arange(len(path)) - 12, 0)]),
    ],
    ids=["xyzw", "another unit", "mirrored", "backwards", "late"],
)
def test_what_is_wrong_contradicts_the_joints_or_is_doubtful(spoil, seed):
    path = motion(np.random.default_rng(seed))
    try:
        assert checked_against_joints("x.npz", "poses", spoil(path), path).endswith(DOUBTFUL)
    except BadDemonstration as error:
        assert str(error).startswith("x.npz: poses: contradicts the joints: from sample ")
        assert "\n" not in str(error)


def test_joints_of_another_robot_contradict():
    rng = np.random.default_rng(0)
    arm, _, home = table_panda()
    joints = np.linspace(home, home + rng.normal(size=7) * 0.3, 40)
    with pytest.raises(BadDemonstration, match="contradicts the joints"):
        checked_against_joints("x", "poses", joints_path(arm, np.roll(joints, 1, axis=1)), joints_path(arm, joints))
