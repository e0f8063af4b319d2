"""The invariants of imitation: relative motions kept, both ends met, the same in every frame."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.strategies import assert_same_pose, for_all, random_dq, random_path
from hypothesis import assume
from hypothesis import strategies as st

from onedemo.planner.errors import BadOption
from onedemo.planner.geometry import dualquat as dq
from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.imitation.tsia import (
    departure,
    final_path,
    guide_index,
    imitated_path,
    screw_path,
    transfer_to,
    two_sided_path,
)

seeds = st.integers(0, 10**6)
LINE = screw_path(Pose.identity(), Pose.from_yaw([1, 0, 0], 0.0), 0.1)


def a_case(seed):
    """Random numbers, a demonstration of 2 to 29 poses, a start, a goal."""
    rng = np.random.default_rng(seed)
    path = random_path(rng, int(rng.integers(2, 30)))
    return rng, path, Pose(random_dq(rng)), Pose(random_dq(rng))


def relative(path: PosePath) -> np.ndarray:
    return dq.mul(dq.conj(path.dqs[:-1]), path.dqs[1:])


def is_half_turn(a: Pose, b: Pose) -> bool:
    return abs((a.inverse() @ b).dq[0]) < 1e-3


@for_all(seeds)
def test_imitation_ends_at_the_goal_and_keeps_every_relative_motion(seed):
    _, shown, _, goal = a_case(seed)
    imitated = imitated_path(shown, goal)
    assert_same_pose(imitated.dqs[-1], goal.dq, 0.0)
    assert_same_pose(relative(imitated), relative(shown), 1e-12)
    assert_same_pose(imitated.dqs, shown.moved(transfer_to(shown, goal)).dqs, 1e-14)


@for_all(seeds)
def test_imitating_towards_its_own_end_is_the_demonstration(seed):
    _, shown, _, _ = a_case(seed)
    assert_same_pose(imitated_path(shown, shown[-1]).dqs, shown.dqs, 1e-14)


@for_all(seeds)
def test_imitating_an_imitation_is_imitating_the_demonstration(seed):
    _, shown, middle, goal = a_case(seed)
    assert_same_pose(imitated_path(imitated_path(shown, middle), goal).dqs, imitated_path(shown, goal).dqs, 1e-12)


@for_all(seeds, st.floats(0, 1))
def test_the_final_path_meets_both_ends_and_its_tail_is_the_imitated_path(seed, fraction):
    _, shown, start, goal = a_case(seed)
    imitated = imitated_path(shown, goal)
    path = final_path(start, imitated, guide := guide_index(imitated, fraction))
    assert_same_pose(path.dqs[0], start.dq, 0.0)
    assert_same_pose(path.dqs[-1], goal.dq, 0.0)
    assert_same_pose(path.dqs[guide - len(imitated) :], imitated.dqs[guide:], 0.0)


@for_all(seeds, st.floats(0, 1))
def test_the_final_path_blends_along_the_shortest_screw_in_steps_of_the_demonstration(seed, fraction):
    _, shown, start, goal = a_case(seed)
    imitated = imitated_path(shown, goal)
    path = final_path(start, imitated, guide := guide_index(imitated, fraction))
    assume(not is_half_turn(start, imitated[guide]))
    blend = path[: len(path) - (len(imitated) - guide) + 1]
    twist = dq.twist_from_dq((start.inverse() @ imitated[guide]).dq)
    steps = dq.twist_from_dq(relative(blend))
    np.testing.assert_allclose(steps * len(steps), np.broadcast_to(twist, steps.shape), rtol=0, atol=1e-10)
    direct = PosePath(np.stack([start.dq, imitated[guide].dq])).lengths()[-1]
    count = direct / imitated.lengths()[-1] * (len(imitated) - 1)
    assert count - 1e-9 <= len(steps) <= count * np.pi / 2 + 1


@for_all(seeds)
def test_the_final_path_moves_with_the_world(seed):
    rng, shown, start, goal = a_case(seed)
    world = Pose(random_dq(rng))
    imitated, moved = imitated_path(shown, goal), imitated_path(shown.moved(world), world @ goal)
    guide = guide_index(imitated)
    assert guide_index(moved) == guide
    assume(not is_half_turn(start, imitated[guide]))
    expected = final_path(start, imitated, guide).moved(world)
    assert_same_pose(final_path(world @ start, moved, guide).dqs, expected.dqs, 1e-10)


@for_all(seeds)
def test_the_final_path_moves_with_the_tool(seed):
    rng, shown, start, goal = a_case(seed)
    tool = Pose(random_dq(rng))
    imitated, retooled = imitated_path(shown, goal), imitated_path(shown.with_tool(tool), goal @ tool)
    guide = guide_index(imitated, by="index")
    assert guide_index(retooled, by="index") == guide
    assume(not is_half_turn(start, imitated[guide]))
    path = final_path(start @ tool, retooled, guide)
    tail = len(imitated) - guide
    assert_same_pose(path.dqs[-tail:], imitated[guide:].with_tool(tool).dqs, 1e-10)
    # the number of poses along the blend depends on the origin, the screw does not
    tau = np.linspace(0, 1, len(path) - tail + 1)
    screw = PosePath(dq.sclerp(start.dq, imitated[guide].dq, tau)).with_tool(tool)
    assert_same_pose(path.dqs[: len(tau)], screw.dqs, 1e-10)


@for_all(seeds, st.floats(-3, 3), st.floats(-3, 3))
def test_an_upright_demonstration_stays_upright_under_a_turn_about_the_vertical(seed, yaw, start_yaw):
    rng = np.random.default_rng(seed)
    yaws = np.cumsum(rng.uniform(-0.2, 0.2, 15))
    places = np.cumsum(rng.uniform(-0.05, 0.05, (15, 3)), axis=0)
    shown = PosePath(np.array([Pose.from_yaw(p, a).dq for p, a in zip(places, yaws, strict=True)]))
    start, goal = Pose.from_yaw(rng.uniform(-1, 1, 3), start_yaw), Pose.from_yaw([0.4, 0.1, 0.2], yaw)
    assert transfer_to(shown, goal).tilt <= 1e-9
    for path in (final_path(start, imitated_path(shown, goal), 5), two_sided_path(shown, start, goal)):
        assert max(pose.tilt for pose in path) <= 1e-9


def test_a_tilted_goal_tilts_the_whole_imitated_path():
    goal = Pose.from_position_quaternion([0, 0, 0], [np.cos(0.2), np.sin(0.2), 0, 0])
    assert transfer_to(LINE, goal).tilt == pytest.approx(0.4)
    assert [pose.tilt for pose in imitated_path(LINE, goal)] == pytest.approx([0.4] * len(LINE))


def test_a_demonstrated_hinge_stays_a_hinge():
    axis = dq.ScrewParameters(np.array([0, 0.6, 0.8]), np.cross([0.2, 0.1, 0.5], [0, 0.6, 0.8]), 1.0, 0.0)
    turns = [dq.dq_from_screw_parameters(axis._replace(angle=angle)) for angle in np.linspace(0, 1.2, 20)]
    shown = PosePath(dq.mul(np.array(turns), Pose.from_yaw([0.5, 0, 0.3], 0.4).dq))
    moved = Pose(random_dq(np.random.default_rng(4)))
    imitated = imitated_path(shown, moved @ shown[-1])
    for pose in imitated[:-1]:
        screw = dq.screw_parameters((imitated[-1] @ pose.inverse()).dq)
        np.testing.assert_allclose(screw.axis, moved.rotation @ axis.axis, rtol=0, atol=1e-9)
        on_axis = moved.rotation @ axis.point + moved.position
        np.testing.assert_allclose(np.cross(on_axis - screw.point, screw.axis), 0, atol=1e-9)
        assert abs(screw.travel) < 1e-9


@pytest.mark.parametrize("fraction, index", [(0.0, 1), (0.05, 1), (0.15, 2), (0.35, 4), (0.95, 10), (1.0, 10)])
@pytest.mark.parametrize("by", ["length", "index"])
def test_the_guide_is_the_first_pose_behind_its_fraction(fraction, index, by):
    assert guide_index(LINE, fraction, by=by) == index


def test_the_guide_by_length_ignores_how_poses_are_spread():
    crowded = screw_path(LINE[0], LINE[4], 0.01).joined(LINE[4:])
    assert len(crowded) == 47
    assert guide_index(crowded, 0.55) == 42
    assert guide_index(crowded, 0.55, by="index") == 26


@pytest.mark.parametrize("arguments", [{"fraction": -0.1}, {"fraction": 1.1}, {"by": "time"}, {"fraction": np.nan}])
def test_a_bad_guide_is_refused_by_name(arguments):
    with pytest.raises(BadOption, match=next(iter(arguments))):
        guide_index(LINE, **arguments)


@pytest.mark.parametrize("rows", [[0], [0, 10], [0, 0, 0], [0, 3, 3, 3, 10], [0, 0, 10, 10]])
def test_short_still_and_repeating_demonstrations_are_imitated(rows):
    shown, start, goal = PosePath(LINE.dqs[rows]), Pose.from_yaw([0, 1, 0], 1.0), Pose.from_yaw([0, 0, 1], -1.0)
    imitated = imitated_path(shown, goal)
    guide = guide_index(imitated)
    assert guide == (1 if len(set(rows)) > 1 and rows[1] else 2 if len(rows) > 1 else 0)
    path = final_path(start, imitated, guide)
    assert_same_pose(path.dqs[[0, -1]], np.stack([start.dq, goal.dq]), 0.0)
    if len(rows) > 1:
        assert_same_pose(two_sided_path(shown, start, goal).dqs[[0, -1]], np.stack([start.dq, goal.dq]), 1e-12)


@for_all(seeds, st.integers(2, 40))
def test_a_demonstration_that_stands_still_off_the_origin_is_imitated(seed, count):
    """The distance of such a pose to itself is rounding, not zero: no measure of steps or lengths."""
    _, _, start, goal = a_case(seed)
    still = PosePath(np.repeat(Pose(random_dq(np.random.default_rng(seed + 1))).dq[None], count, axis=0))
    imitated = imitated_path(still, goal)
    assert guide_index(imitated) == count - 1
    path = final_path(start, imitated, guide_index(imitated))
    assert len(path) < 2000
    assert np.diff(path.lengths()).max() < 0.0051
    assert_same_pose(path.dqs[[0, -1]], np.stack([start.dq, goal.dq]), 0.0)
    steps = np.diff(two_sided_path(still, start, goal).lengths())
    assert steps.max() <= 1.6 * steps.sum() / (count - 1), "a smooth step over the index"


def test_a_demonstration_of_micrometres_does_not_make_a_blend_of_millions():
    tiny = PosePath(np.array([Pose.from_yaw([1e-8 * k, 0.3, 0.2], 0.0).dq for k in range(10)]))
    path = final_path(Pose.from_yaw([0, 1, 0], 1.0), tiny, guide_index(tiny))
    assert len(path) < 200_000


@for_all(seeds, st.floats(0.01, 2))
def test_a_screw_path_has_exact_ends_and_even_steps(seed, step):
    _, _, start, end = a_case(seed)
    path = screw_path(start, end, step)
    assert_same_pose(path.dqs[[0, -1]], np.stack([start.dq, end.dq]), 0.0)
    steps = np.diff(path.lengths())
    np.testing.assert_allclose(steps, steps[0], rtol=0, atol=1e-10)
    assert_same_pose(screw_path(start, start, step).dqs, np.stack([start.dq, start.dq]), 0.0)


@pytest.mark.parametrize("turn", [0.0, 3.0])
def test_a_screw_path_takes_no_step_above_the_limit(turn):
    end = Pose.from_yaw([0, 0, 0], turn) @ LINE[-1]
    assert np.diff(screw_path(LINE[-1], end, 0.1).lengths()).max(initial=0.0) <= 0.1 + 1e-9
    assert np.diff(screw_path(LINE[0], end, 0.3).lengths()).max() <= 0.3 + 1e-9


@for_all(seeds, st.floats(0, 1.2))
def test_the_departure_is_the_shown_beginning_from_the_new_start(seed, fraction):
    rng, shown, start, _ = a_case(seed)
    lengths = shown.lengths()
    leaving = departure(shown, start, fraction * lengths[-1])
    assert len(leaving) == np.count_nonzero(lengths <= fraction * lengths[-1])
    assert_same_pose(leaving.dqs[0], start.dq, 1e-13)
    assert_same_pose(leaving.dqs, dq.mul((start @ shown[0].inverse()).dq, shown.dqs[: len(leaving)]), 1e-12)
    world = Pose(random_dq(rng))
    moved = departure(shown.moved(world), world @ start, (fraction + 1e-9) * lengths[-1])
    assert_same_pose(moved.dqs[: len(leaving)], leaving.moved(world).dqs, 1e-10)
    back = departure(shown.reversed(), start, np.inf)
    assert_same_pose(relative(back), relative(shown.reversed()), 1e-12)


@for_all(seeds)
def test_two_sided_imitation_meets_both_ends_contains_the_demonstration_and_moves_with_the_world(seed):
    rng, shown, start, goal = a_case(seed)
    world = Pose(random_dq(rng))
    path = two_sided_path(shown, start, goal)
    assert len(path) == len(shown)
    assert_same_pose(path.dqs[[0, -1]], np.stack([start.dq, goal.dq]), 1e-12)
    fitting = two_sided_path(shown, world @ shown[0], world @ shown[-1])
    assert_same_pose(fitting.dqs, shown.moved(world).dqs, 1e-12)
    assume(not is_half_turn(start, imitated_path(shown, goal)[0]))
    assert_same_pose(two_sided_path(shown.moved(world), world @ start, world @ goal).dqs, path.moved(world).dqs, 1e-10)


@pytest.mark.parametrize("short_of_half_turn", [1e-6, -1e-6, 0.0])
def test_two_sided_imitation_does_not_jump_when_the_goal_is_turned_half_around(short_of_half_turn):
    leans = np.linspace(0.15, -0.1, 21)
    poses = [([0.01 * k, 0, 0.1], [np.cos(a / 2), 0, np.sin(a / 2), 0]) for k, a in enumerate(leans)]
    shown = PosePath(np.array([Pose.from_position_quaternion(*pose).dq for pose in poses]))
    goal = Pose.from_yaw([0.3, 0.2, 0], np.pi - short_of_half_turn) @ shown[-1]
    path = two_sided_path(shown, shown[0], goal)
    assert np.max(dq.pose_distance(path.dqs[:-1], path.dqs[1:])[1]) < 0.3
