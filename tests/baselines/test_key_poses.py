"""Level S: a demonstration of a few key poses."""

from __future__ import annotations

import numpy as np
import pytest

from onedemo.baselines.factory import POLICIES, make_policy
from onedemo.baselines.key_poses import DENSE, filled, sparse
from onedemo.baselines.motion.path_generators import straight_path
from onedemo.bench.geometric.metrics import curve_gap
from onedemo.configs.shipped_files import shipped_demonstration
from onedemo.planner.errors import BadOption
from onedemo.planner.geometry.pose import PosePath
from onedemo.planner.imitation.demonstration_files import read_demonstration
from onedemo.planner.imitation.segmentation import key_poses, resampled
from onedemo.planner.imitation.tsia import screw_path

NAMES = ("stack", "pour", "shelve")
each_demonstration = pytest.mark.parametrize("name", NAMES)
each_join = pytest.mark.parametrize("join", [None, screw_path, straight_path], ids=["keys", "screws", "lines"])


def shown(name):
    return read_demonstration(shipped_demonstration(name))


@each_demonstration
@each_join
def test_a_sparse_demonstration_begins_ends_and_grips_where_the_whole_one_does(name, join):
    whole, few = shown(name), sparse(shown(name), 6, join)
    assert [each.name for each in few.segments] == [each.name for each in whole.segments]
    for one, other in zip(whole.segments, few.segments, strict=True):
        for key in ("start", "stop"):
            a, b = getattr(one, key), getattr(other, key)
            assert whole.path[a].distance_to(few.path[b])[0] < 1e-9 and whole.time[a] == few.time[b]
            np.testing.assert_allclose(few.joint_positions[b], whole.joint_positions[a], atol=1e-12)
            assert few.gripper[b] == whole.gripper[a]
        after = min(one.stop + 1, len(whole.path) - 1), min(other.stop + 1, len(few.path) - 1)
        assert few.gripper[after[1]] == whole.gripper[after[0]]
    assert few.duration == whole.duration and few.object_sizes.keys() == whole.object_sizes.keys()


@each_demonstration
def test_each_segment_is_so_many_key_poses_that_were_shown(name):
    whole, few = shown(name), sparse(shown(name), 6)
    for segment in few.segments:
        path = few.segment_path(segment.name)
        assert len(path) == 6
        assert curve_gap(path, whole.segment_path(segment.name)) < DENSE / 2  # corners of the recording are cut
        # equal steps of the way as it was walked: a chord is no longer
        steps = np.diff(path.lengths())
        assert steps.max() < 1.001 * resampled(whole.segment_path(segment.name), DENSE).lengths()[-1] / 5


@each_demonstration
@pytest.mark.parametrize("join", [screw_path, straight_path])
def test_the_way_between_key_poses_is_read_densely_and_meets_them(name, join):
    keys, few = sparse(shown(name), 4), sparse(shown(name), 4, join)
    for segment in keys.segments:
        points, path = keys.segment_path(segment.name), few.segment_path(segment.name)
        assert np.diff(path.lengths()).max() < DENSE + 1e-6
        assert max(min(pose.distance_to(other)[0] for other in path) for pose in points) < 1e-9


def test_screws_and_lines_read_a_turn_differently():
    turn = shown("shelve").segment_path("carry")
    keys = key_poses(turn, 4)
    assert curve_gap(filled(keys, screw_path), filled(keys, straight_path)) > 0.003


def test_many_key_poses_are_the_demonstration():
    whole, many = shown("pour"), sparse(shown("pour"), 600, screw_path)
    for segment in whole.segments:
        assert curve_gap(whole.segment_path(segment.name), many.segment_path(segment.name)) < DENSE / 2


def test_two_key_poses_are_the_least_and_what_stands_still_has_two():
    path = shown("pour").segment_path("carry")
    np.testing.assert_array_equal(key_poses(path, 2).dqs, path.dqs[[0, -1]])
    with pytest.raises(BadOption, match="1 is not a number of poses from 2 on"):
        key_poses(path, 1)
    still = PosePath(np.repeat(path.dqs[:1], 5, axis=0))
    assert len(key_poses(still, 4)) == 2


class Mine:
    """A policy of somebody's own: it says what it was given."""

    def __init__(self, task, demonstration, settings):
        self.shown = demonstration

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return np.zeros(8), state


def test_your_own_policy_is_shown_the_key_poses_alone(monkeypatch):
    monkeypatch.setattr("onedemo.baselines.own_policy.imported", lambda name, form, wanted: Mine)
    policy = make_policy("my.mod:Mine", None, shown("pour"), key_poses=5)
    assert {len(policy.shown.segment_path(each.name)) for each in policy.shown.segments} == {5}


def test_methods_read_the_way_as_they_move():
    straight = {name for name, kind in POLICIES.items() if kind.join is straight_path}
    assert straight == {"decoupled", "replay", "dmp-goal", "dmp-world"}
