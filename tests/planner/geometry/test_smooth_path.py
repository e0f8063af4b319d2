"""The C1 curve: through its knots, no jump of the twist, the same in every frame; thinning within its bound."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from helpers.strategies import assert_same_pose, for_all, random_dq, random_path
from hypothesis import strategies as st

from onedemo.planner.errors import BadOption, BadShape
from onedemo.planner.geometry import dualquat as dq
from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.geometry.smooth_path import SmoothPath, knots_of, smooth, smooth_path, thinned
from onedemo.planner.imitation.tsia import screw_path

seeds = st.integers(0, 10**6)
ends = st.sampled_from(["one-sided", "zero"])
LEVER = 0.2
LINE = screw_path(Pose.identity(), Pose.from_yaw([1, 0, 0], 0.0), 0.1)
HELIX = screw_path(Pose.from_yaw([0.3, 0, 0], 0.0), Pose.from_yaw([0, 0.4, 0.5], 2.5), 0.04)


def a_curve(seed, ends="one-sided", size=0.15) -> tuple[np.random.Generator, SmoothPath]:
    """A random walk of 3 to 12 poses with uneven knots, and the curve through it."""
    rng = np.random.default_rng(seed)
    path = random_path(rng, int(rng.integers(3, 13)), size)
    return rng, smooth(path, knots=np.cumsum(rng.uniform(0.5, 2, len(path))), ends=ends)


def slopes(curve: SmoothPath, u: np.ndarray, side: float, h: float = 1e-3) -> np.ndarray:
    """One-sided body twists at u by a difference formula of sixth order on the exact logarithm."""
    weights = np.array([6, -15 / 2, 20 / 3, -15 / 4, 6 / 5, -1 / 6])
    here = curve.poses(u)
    logs = [dq.twist_from_dq(dq.mul(dq.conj(here), curve.poses(u + side * k * h))) for k in range(1, 7)]
    return side * sum(w * log for w, log in zip(weights, logs, strict=True)) / h


@for_all(seeds, ends, max_examples=40)
def test_the_curve_hits_its_knots_exactly(seed, ends):
    _, curve = a_curve(seed, ends)
    np.testing.assert_array_equal(curve.poses(curve.knots), curve.dqs)


@for_all(seeds, ends, st.integers(1, 9))
def test_every_given_pose_is_a_row_of_the_smooth_path(seed, ends, per_segment):
    path = random_path(np.random.default_rng(seed), 6)
    dense = smooth_path(path, per_segment=per_segment, ends=ends)
    assert len(dense) == 5 * per_segment + 1
    assert_same_pose(dense.dqs[::per_segment], path.dqs, 0.0)


@for_all(seeds, ends, max_examples=40)
def test_the_twist_does_not_jump_at_the_knots(seed, ends):
    _, curve = a_curve(seed, ends)
    inner = curve.knots[1:-1]
    before, after = slopes(curve, inner, -1.0), slopes(curve, inner, 1.0)
    np.testing.assert_allclose(before, after, rtol=0, atol=1e-8)
    np.testing.assert_allclose(after, curve.twists[1:-1], rtol=0, atol=1e-8)


@for_all(seeds, ends, max_examples=25)
def test_the_body_twist_is_the_derivative_of_the_pose(seed, ends):
    rng, curve = a_curve(seed, ends, size=0.5)
    # a tenth of a segment from its ends, so that the differences stay inside
    inside = curve.knots[:-1] + np.diff(curve.knots) * rng.uniform(0.1, 0.9, len(curve.knots) - 1)
    np.testing.assert_allclose(curve.body_twists(inside), slopes(curve, inside, 1.0), rtol=0, atol=1e-8)
    np.testing.assert_allclose(curve.body_twists(curve.knots), curve.twists, rtol=0, atol=1e-12)
    nearly = np.nextafter(curve.knots[1:], -np.inf)
    np.testing.assert_allclose(curve.body_twists(nearly), curve.twists[1:], rtol=0, atol=1e-12)


@for_all(seeds, max_examples=30)
def test_the_ends_are_at_rest_or_on_the_first_and_last_screw(seed):
    _, curve = a_curve(seed, "zero")
    np.testing.assert_allclose(curve.body_twists(curve.knots[[0, -1]]), 0.0, rtol=0, atol=1e-14)
    _, curve = a_curve(seed, "one-sided")
    steps = dq.twist_from_dq(dq.mul(dq.conj(curve.dqs[:-1]), curve.dqs[1:])) / np.diff(curve.knots)[:, None]
    np.testing.assert_allclose(curve.body_twists(curve.knots[[0, -1]]), steps[[0, -1]], rtol=0, atol=1e-12)


@for_all(seeds, ends, st.sampled_from(["index", "given"]))
def test_the_curve_moves_with_the_world_and_with_the_tool(seed, ends, kind):
    rng = np.random.default_rng(seed)
    path = random_path(rng, int(rng.integers(2, 12)), 0.3)
    world, tool = Pose(random_dq(rng)), Pose(random_dq(rng))
    knots = "index" if kind == "index" else np.cumsum(rng.uniform(0.5, 2, len(path)))
    dense = smooth_path(path, knots=knots, ends=ends)
    moved = smooth_path(path.moved(world).with_tool(tool), knots=knots, ends=ends)
    assert_same_pose(moved.dqs, dense.moved(world).with_tool(tool).dqs, 1e-10)


@for_all(seeds)
def test_with_knots_by_length_the_curve_moves_with_the_world(seed):
    rng = np.random.default_rng(seed)
    path, world = random_path(rng, 8), Pose(random_dq(rng))
    assert_same_pose(smooth_path(path.moved(world)).dqs, smooth_path(path).moved(world).dqs, 1e-10)


def test_the_length_depends_on_the_tool_and_the_index_does_not():
    path = PosePath(HELIX.dqs[[0, 2, 3, 9, 10, 20]])
    far = path.with_tool(Pose.from_position_quaternion([0.3, 0.5, 0]))
    spacing = [knots_of(p, "length") / knots_of(p, "length")[-1] for p in (path, far)]
    assert np.abs(spacing[0] - spacing[1]).max() > 1e-4
    np.testing.assert_array_equal(knots_of(path, "index"), knots_of(far, "index"))


@pytest.mark.parametrize("path", [LINE, HELIX])
@pytest.mark.parametrize("ends", ["one-sided", "zero"])
def test_a_screw_stays_that_screw(path, ends):
    rows = [0, 1, 4, 5, 8, 10]
    some = PosePath(path.dqs[rows])
    dense = smooth_path(some, knots=rows, ends=ends)
    whole = dq.twist_from_dq(dq.mul(dq.conj(some.dqs[0]), some.dqs[-1]))
    parts = dq.twist_from_dq(dq.mul(dq.conj(some.dqs[0]), dense.dqs))
    along = parts @ whole / (whole @ whole)
    np.testing.assert_allclose(parts, along[:, None] * whole, rtol=0, atol=1e-12)
    assert (np.diff(along) > 0).all()
    if ends == "one-sided":
        even = np.interp(np.arange(41) / 8, np.arange(6), rows) / 10
        np.testing.assert_allclose(along, even, rtol=0, atol=1e-12)


def test_the_curve_approaches_the_path_it_was_sampled_from_also_with_uneven_steps():
    def path(s):
        turns = dq.dq_from_twist(np.stack([s**2, np.sin(2 * s), s, s, 0 * s, 1.5 * np.sin(s)], axis=1))
        return dq.mul(turns, dq.dq_from_twist(np.stack([0 * s, s, s**3, 0 * s, np.cos(s), s], axis=1)))

    errors = []
    for count in (11, 21, 41):
        s = np.concatenate([[0.0], np.cumsum(np.resize([1.0, 3.0], count - 1))])
        s /= s[-1]
        inside = np.linspace(0.3, 0.7, 101)
        off = dq.pose_distance(smooth(PosePath(path(s)), knots=s).poses(inside), path(inside))
        errors.append(np.hypot(off[0], LEVER * off[1]).max())
    assert errors[0] < 2e-3 and errors[0] / errors[1] > 6 and errors[1] / errors[2] > 6


def test_wide_steps_through_the_half_turn_do_not_jump():
    turns = [Pose.from_yaw([0.1 * k, 0, 0], 2.6 * k) for k in range(6)]
    dense = smooth_path(PosePath(np.array([pose.dq for pose in turns])), per_segment=40)
    assert dq.pose_distance(dense.dqs[:-1], dense.dqs[1:])[1].max() < 0.1


def test_repeats_are_dropped_by_length_and_refused_as_knots():
    doubled = PosePath(np.repeat(HELIX.dqs, 2, axis=0))
    assert_same_pose(smooth_path(doubled).dqs, smooth_path(HELIX).dqs, 0.0)
    assert len(smooth(doubled).knots) == len(HELIX)
    with pytest.raises(BadOption, match="knots"):
        smooth(doubled, knots=np.repeat(np.arange(len(HELIX)), 2))


@pytest.mark.parametrize(
    "arguments, error, name",
    [
        ({"knots": "time"}, BadOption, "knots"),
        ({"knots": [0.0, 1.0]}, BadShape, "knots"),
        ({"knots": np.append(np.arange(10.0), np.nan)}, BadOption, "knots"),
        ({"ends": "free"}, BadOption, "ends"),
        ({"per_segment": 0}, BadOption, "per_segment"),
    ],
)
def test_bad_options_are_refused_by_name(arguments, error, name):
    with pytest.raises(error, match=name):
        smooth_path(LINE, **arguments)


def test_one_pose_bad_twists_and_a_parameter_outside_are_refused():
    with pytest.raises(BadShape, match="path"):
        smooth(PosePath(LINE.dqs[[3, 3, 3]]))
    with pytest.raises(BadShape, match="twists"):
        SmoothPath(np.arange(11.0), LINE.dqs, np.zeros((10, 6)))
    curve = smooth(LINE)
    for u in ([-0.01], [1.01], [np.nan]):
        with pytest.raises(BadOption, match="u"):
            curve.poses(u)
    with pytest.raises(BadShape, match="u"):
        curve.body_twists(0.5)


def rows_of(path: PosePath, kept: PosePath) -> np.ndarray:
    """Which rows of a path were kept."""
    return np.abs(path.dqs[:, None] - kept.dqs[None]).max(axis=2).argmin(axis=0)


def off_the_screws(path: PosePath, rows: np.ndarray) -> float:
    """Largest distance of a path to the screws between its kept rows, each pose at its part of the length."""
    lengths, worst = path.lengths(LEVER), 0.0
    for i, j in pairwise(rows):
        part = (lengths[i : j + 1] - lengths[i]) / (lengths[j] - lengths[i])
        distance, angle = dq.pose_distance(path.dqs[i : j + 1], dq.sclerp(path.dqs[i], path.dqs[j], part))
        worst = max(worst, float(np.hypot(distance, LEVER * angle).max()))
    return worst


@for_all(seeds, st.floats(1e-3, 0.3), max_examples=30)
def test_thinning_keeps_the_ends_and_every_pose_within_the_tolerance(seed, tolerance):
    path = smooth_path(random_path(np.random.default_rng(seed), 6))
    kept = thinned(path, tolerance)
    assert_same_pose(kept.dqs[[0, -1]], path.dqs[[0, -1]], 0.0)
    rows = rows_of(path, kept)
    assert_same_pose(path.dqs[rows], kept.dqs, 0.0)
    assert (np.diff(rows) > 0).all()
    assert off_the_screws(path, rows) <= tolerance + 1e-9
    assert len(thinned(path, 1e-5)) >= len(kept) >= len(thinned(path, 1.0))


def test_thinning_needs_the_poses_that_it_keeps():
    path = smooth_path(random_path(np.random.default_rng(3), 6, 0.3))
    kept = thinned(path, 0.02)
    assert 3 < len(kept) < len(path) / 2
    rows = rows_of(path, kept)
    for k in range(1, len(kept) - 1):
        assert off_the_screws(path, np.delete(rows, k)) > 0.01


def test_a_screw_needs_two_poses_and_a_corner_three():
    assert len(thinned(HELIX, 1e-9)) == len(thinned(LINE, 1e-9)) == 2
    corner = LINE.joined(screw_path(LINE[-1], Pose.from_yaw([1, 1, 0], 0.0), 0.1))
    assert_same_pose(thinned(corner, 1e-9).dqs, corner.dqs[[0, 10, 20]], 0.0)
    assert len(thinned(PosePath(LINE.dqs[:1]), 0.01)) == 1
    # a round trip ends where it began: the way out must not be lost
    there_and_back = LINE.joined(LINE.reversed())
    assert len(thinned(there_and_back, 1e-9)) == 3


@for_all(seeds, max_examples=30)
def test_thinning_moves_with_the_world(seed):
    rng = np.random.default_rng(seed)
    path, world = smooth_path(random_path(rng, 5)), Pose(random_dq(rng))
    assert_same_pose(thinned(path.moved(world), 0.05).dqs, thinned(path, 0.05).moved(world).dqs, 1e-12)


@pytest.mark.parametrize("tolerance", [-1.0, np.nan])
def test_a_bad_tolerance_is_refused(tolerance):
    with pytest.raises(BadOption, match="tolerance"):
        thinned(LINE, tolerance)
