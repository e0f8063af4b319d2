"""The invariants of imitation: relative motions kept, both ends met, the same in every frame."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import assert_same_pose, random_dq, random_path

from onedemo.planner import dualquat as dq
from onedemo.planner.errors import BadOption, PlanFailed
from onedemo.planner.pose import Pose, PosePath
from onedemo.planner.tsia import (
    departure,
    final_path,
    guide_index,
    imitated_path,
    reachable_guide,
    screw_path,
    transfer_to,
    two_sided_path,
)

few = settings(max_examples=50, deadline=None)
seeds = st.integers(0, 10**6)


def a_case(seed):
    rng = np.random.default_rng(seed)
    path = random_path(rng, int(rng.integers(2, 30)))
    return rng, path, Pose(random_dq(rng)), Pose(random_dq(rng))


def relative(path: PosePath) -> np.ndarray:
    return dq.mul(dq.conj(path.dqs[:-1]), path.dqs[1:])


@few
@given(seeds)
def test_imitation_ends_at_the_goal_and_keeps_every_relative_motion(seed):
    _, shown, _, goal = a_case(seed)
    imitated = imitated_path(shown, goal)
    assert_same_pose(imitated.dqs[-1], goal.dq, 1e-14)
    assert_same_pose(relative(imitated), relative(shown), 1e-12)
    assert_same_pose((transfer_to(shown, goal) @ shown[-1]).dq, goal.dq, 1e-12)


@few
@given(seeds)
def test_imitating_towards_its_own_end_is_the_demonstration(seed):
    _, shown, _, _ = a_case(seed)
    assert_same_pose(imitated_path(shown, shown[-1]).dqs, shown.dqs, 1e-14)


@few
@given(seeds)
def test_imitating_an_imitation_is_imitating_the_demonstration(seed):
    _, shown, middle, goal = a_case(seed)
    assert_same_pose(imitated_path(imitated_path(shown, middle), goal).dqs, imitated_path(shown, goal).dqs, 1e-12)


@few
@given(seeds, st.floats(0, 1))
def test_the_final_path_meets_both_ends_and_its_tail_is_the_imitated_path(seed, fraction):
    _, shown, start, goal = a_case(seed)
    imitated = imitated_path(shown, goal)
    guide = guide_index(imitated, fraction)
    path = final_path(start, imitated, guide)
    assert_same_pose(path.dqs[0], start.dq, 1e-15)
    assert_same_pose(path.dqs[-1], goal.dq, 1e-14)
    tail = len(imitated) - guide
    np.testing.assert_array_equal(np.abs(path.dqs[-tail:]), np.abs(imitated.dqs[guide:]))
    blend = PosePath(path.dqs[: len(path) - tail + 1])
    twists = dq.twist_from_dq(relative(blend))
    np.testing.assert_allclose(twists, np.broadcast_to(twists[0], twists.shape), atol=1e-9)


@few
@given(seeds)
def test_the_final_path_moves_with_the_world_and_with_the_tool(seed):
    rng, shown, start, goal = a_case(seed)
    world, tool = Pose(random_dq(rng)), Pose(random_dq(rng))
    if abs((start.inverse() @ goal).dq[0]) < 1e-3:
        return

    def final(shown, start, goal, count):
        imitated = imitated_path(shown, goal)
        guide = imitated[guide_index(imitated, 0.3, by="index")]
        tau = np.linspace(0, 1, count)
        return np.concatenate([dq.sclerp(start.dq, guide.dq, tau), imitated.dqs])

    imitated = imitated_path(shown, goal)
    if abs((start.inverse() @ imitated[guide_index(imitated, 0.3, by="index")]).dq[0]) < 1e-3:
        return
    plain = final(shown, start, goal, 10)
    moved = final(shown.moved(world), world @ start, world @ goal, 10)
    assert_same_pose(moved, dq.mul(world.dq, plain), 1e-10)
    retooled = final(shown.with_tool(tool), start @ tool, goal @ tool, 10)
    assert_same_pose(retooled, dq.mul(plain, tool.dq), 1e-10)


@few
@given(seeds)
def test_the_whole_final_path_moves_with_the_world(seed):
    rng, shown, start, goal = a_case(seed)
    world = Pose(random_dq(rng))
    path = final_path(start, imitated_path(shown, goal), 1)
    moved = final_path(world @ start, imitated_path(shown.moved(world), world @ goal), 1)
    if abs((start.inverse() @ imitated_path(shown, goal)[1]).dq[0]) > 1e-3 and len(moved) == len(path):
        assert_same_pose(moved.dqs, path.moved(world).dqs, 1e-10)


@few
@given(seeds, st.floats(-3, 3), st.floats(-3, 3))
def test_an_upright_demonstration_stays_upright_under_a_turn_about_the_vertical(seed, yaw, start_yaw):
    rng = np.random.default_rng(seed)
    yaws = np.cumsum(rng.uniform(-0.2, 0.2, 15))
    places = np.cumsum(rng.uniform(-0.05, 0.05, (15, 3)), axis=0)
    shown = PosePath(np.array([Pose.from_yaw(p, a).dq for p, a in zip(places, yaws, strict=True)]))
    start = Pose.from_yaw(rng.uniform(-1, 1, 3), start_yaw)
    path = final_path(start, imitated_path(shown, Pose.from_yaw([0.4, 0.1, 0.2], yaw)), 5)
    assert max(pose.tilt for pose in path) <= 1e-9


def test_a_demonstrated_hinge_stays_a_hinge():
    axis = dq.ScrewParameters(np.array([0, 0.6, 0.8]), np.cross([0.2, 0.1, 0.5], [0, 0.6, 0.8]), 1.0, 0.0)
    turns = [dq.dq_from_screw_parameters(axis._replace(angle=angle)) for angle in np.linspace(0, 1.2, 20)]
    shown = PosePath(dq.mul(np.array(turns), Pose.from_yaw([0.5, 0, 0.3], 0.4).dq))
    moved = Pose(random_dq(np.random.default_rng(4)))
    imitated = imitated_path(shown, moved @ shown[-1])
    for pose in imitated[:-1]:
        screw = dq.screw_parameters((imitated[-1] @ pose.inverse()).dq)
        np.testing.assert_allclose(screw.axis, moved.rotation @ axis.axis, atol=1e-9)
        on_axis = moved.rotation @ axis.point + moved.position
        np.testing.assert_allclose(np.cross(on_axis - screw.point, screw.axis), 0, atol=1e-9)
        assert abs(screw.travel) < 1e-9


@pytest.mark.parametrize("by", ["length", "index"])
def test_the_guide_lies_at_its_fraction(by):
    path = screw_path(Pose.identity(), Pose.from_yaw([1, 0, 0], 0.0), 0.01)
    assert guide_index(path, 0.2, by=by) == pytest.approx(20, abs=1)
    assert guide_index(path, 0.0, by=by) == 1
    assert guide_index(path, 1.0, by=by) == len(path) - 1


def test_a_demonstration_that_stands_still_is_guided_to_its_end():
    still = PosePath(np.repeat(Pose.identity().dq[None], 5, axis=0))
    assert guide_index(still, 0.2) == 4
    goal = Pose.from_yaw([0.1, 0, 0], 0.3)
    path = final_path(Pose.identity(), imitated_path(still, goal), 4)
    assert_same_pose(path.dqs[-1], goal.dq, 1e-14)


@pytest.mark.parametrize("arguments", [{"fraction": -0.1}, {"fraction": 1.1}, {"by": "time"}, {"fraction": np.nan}])
def test_a_bad_guide_is_refused(arguments):
    with pytest.raises(BadOption):
        guide_index(random_path(np.random.default_rng(0), 5), **arguments)


@few
@given(seeds)
def test_the_departure_is_the_shown_beginning_from_the_new_start(seed):
    _, shown, start, _ = a_case(seed)
    leaving = departure(shown, start, 0.5 * shown.lengths()[-1])
    assert_same_pose(leaving.dqs[0], start.dq, 1e-13)
    if len(leaving) > 1:
        assert_same_pose(relative(leaving), relative(shown)[: len(leaving) - 1], 1e-12)
    assert leaving.lengths()[-1] <= 0.5 * shown.lengths()[-1] + 1e-9


@few
@given(seeds)
def test_two_sided_imitation_meets_both_ends_and_contains_the_demonstration(seed):
    rng = np.random.default_rng(seed)
    shown = random_path(rng, 20, step=0.03)
    start, goal = Pose(random_dq(rng)), Pose(random_dq(rng))
    path = two_sided_path(shown, start, goal)
    assert_same_pose(path.dqs[0], start.dq, 1e-12)
    assert_same_pose(path.dqs[-1], goal.dq, 1e-12)
    world = Pose(random_dq(rng))
    fitting = two_sided_path(shown, world @ shown[0], world @ shown[-1])
    assert_same_pose(fitting.dqs, shown.moved(world).dqs, 1e-12)


def test_the_guide_moves_behind_the_last_pose_that_cannot_be_reached():
    path = screw_path(Pose.identity(), Pose.from_yaw([1, 0, 0], 0.0), 0.1)

    def margins_with(bad):
        return lambda part: np.where(np.isin(np.arange(len(path))[-len(part) :], bad), -np.inf, 1.0)

    assert reachable_guide(path, 2, 8, margins_with([]), 0.1) == 2
    assert reachable_guide(path, 2, 8, margins_with([0, 4]), 0.1) == 5
    with pytest.raises(PlanFailed, match="ik_or_limit"):
        reachable_guide(path, 2, 8, margins_with([9]), 0.1)
