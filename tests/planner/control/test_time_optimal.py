"""Timing: limits kept at all times, the geometry as it was, nearly as fast as possible."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.strategies import for_all
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from onedemo.planner.control.time_optimal import time_optimal
from onedemo.planner.errors import BadOption, BadShape, NotFinite

seeds = st.integers(0, 10**6)
KINDS = ("anywhere", "walk", "curve", "line", "there and back")


def a_path(seed: int, kind: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Waypoints, speed and acceleration limits of 1 to 7 joints."""
    rng = np.random.default_rng(seed)
    count, dof = int(rng.integers(3, 25)), int(rng.integers(1, 8))
    s, way = np.linspace(0, 1, count)[:, None], rng.normal(size=dof)
    path = {
        "anywhere": rng.normal(size=(count, dof)),
        "walk": np.cumsum(0.05 * rng.normal(size=(count, dof)), axis=0),
        "curve": np.sin(3 * s + rng.uniform(0, 3, dof)) * way,
        "line": s**2 * way,
        "there and back": s * (1.3 + 0.01 * np.pi - s) * way,
    }[kind]
    return path, rng.uniform(0.5, 3, dof), rng.uniform(1, 20, dof)


def spline_of(path, speeds):
    """The curve that the timing promises to follow: independent of it, and its parameter at the end."""
    knots = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0) / speeds, axis=1))])
    return CubicSpline(knots, path, bc_type="natural"), knots


@for_all(seeds, st.sampled_from(KINDS), st.sampled_from([0.002, 0.02, 0.5]), max_examples=50)
def test_speeds_and_accelerations_stay_within_their_limits(seed, kind, dt):
    path, speeds, accelerations = a_path(seed, kind)
    run = time_optimal(path, speeds, accelerations, dt)
    assert (np.abs(run.velocities) <= speeds + 1e-6).all()
    # by the mean value theorem differences of samples obey the limits if the motion does at all times
    assert (np.abs(np.diff(run.joints, axis=0)) / dt <= speeds + 1e-6).all()
    assert (np.abs(np.diff(run.velocities, axis=0)) / dt <= accelerations + 1e-6).all()


@for_all(seeds, st.sampled_from(KINDS), max_examples=20)
def test_it_starts_and_ends_at_rest_at_the_ends_and_samples_evenly(seed, kind):
    path, speeds, accelerations = a_path(seed, kind)
    run = time_optimal(path, speeds, accelerations, 0.01)
    np.testing.assert_allclose(run.time, 0.01 * np.arange(len(run.time)), rtol=0, atol=1e-12)
    np.testing.assert_allclose(run.joints[[0, -1]], path[[0, -1]], rtol=0, atol=1e-12)
    np.testing.assert_allclose(run.velocities[[0, -1]], 0.0, rtol=0, atol=1e-12)
    assert run.duration == run.time[-1]
    assert run.joints.shape == run.velocities.shape == (len(run.time), path.shape[1])


@for_all(seeds, st.sampled_from(KINDS), max_examples=20)
def test_velocities_are_the_derivatives_of_the_joints(seed, kind):
    path, speeds, accelerations = a_path(seed, kind)
    run = time_optimal(path, speeds, accelerations, 0.002)
    middle = 0.5 * (run.velocities[1:] + run.velocities[:-1])
    # the trapezoid rule is off by at most what the acceleration can do in half a sample
    off = np.abs(np.diff(run.joints, axis=0) / 0.002 - middle)
    assert (off <= 0.5 * 0.002 * accelerations + 1e-9).all()
    assert np.median(off) < 1e-3


@for_all(seeds, st.sampled_from(KINDS), max_examples=20)
def test_the_samples_lie_on_the_spline_in_order_and_the_waypoints_are_passed(seed, kind):
    path, speeds, accelerations = a_path(seed, kind)
    run = time_optimal(path, speeds, accelerations, 0.001)
    spline, knots = spline_of(path, speeds)
    # each sample against a fine polyline of the spline, the chord error of which is known
    u = np.linspace(0, knots[-1], 2000)
    fine = spline(u)
    some = np.linspace(0, len(run.joints) - 1, 60).astype(int)
    distance = np.abs(run.joints[some, None] - fine[None]).max(axis=2)
    assert distance.min(axis=1).max() <= np.abs(np.diff(fine, axis=0)).max()
    for waypoint in path:
        assert np.abs(run.joints - waypoint).max(axis=1).min() <= 0.001 * speeds.max()


@for_all(seeds, st.sampled_from(KINDS), max_examples=20)
def test_the_deviation_is_the_largest_distance_to_the_lines(seed, kind):
    path, speeds, accelerations = a_path(seed, kind)
    run = time_optimal(path, speeds, accelerations, 0.01)
    spline, knots = spline_of(path, speeds)
    u = np.interp(np.linspace(0, len(knots) - 1, 3001), np.arange(len(knots)), knots)
    lines = np.stack([np.interp(u, knots, joint) for joint in path.T], axis=1)
    off = np.abs(spline(u) - lines).max()
    assert off <= run.deviation + 1e-12
    assert run.deviation <= 1.01 * off + 1e-12


def test_closer_waypoints_bring_the_spline_to_the_lines():
    corner = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    deviations = []
    for count in (3, 11, 41, 161):
        s = np.linspace(0, 2, count)
        path = np.stack([np.interp(s, [0, 1, 2], joint) for joint in corner.T], axis=1)
        deviations.append(time_optimal(path, 1.0, 4.0, 0.01).deviation)
    assert deviations[0] > 0.05 and deviations[-1] < 0.003
    assert (np.diff(deviations) < 0).all()
    assert time_optimal(corner[:2], 1.0, 4.0, 0.01).deviation == 0.0


@pytest.mark.parametrize("length", [0.05, 0.2, 1.0, 3.0])
@pytest.mark.parametrize("count", [2, 3, 20])
def test_a_straight_line_takes_the_time_of_a_trapezoid(length, count):
    way = np.array([1.0, -0.5, 0.2]) * length
    run = time_optimal(np.linspace(0, 1, count)[:, None] * way, [2.0, 0.8, 2.0], [4.0, 6.0, 1.5], 0.001)
    # the slowest joint decides, of the speed and of the acceleration
    speed = np.min(np.array([2.0, 0.8, 2.0]) / np.abs(way))
    acceleration = np.min(np.array([4.0, 6.0, 1.5]) / np.abs(way))
    best = 1 / speed + speed / acceleration if speed**2 < acceleration else 2 / np.sqrt(acceleration)
    assert best - 1e-6 <= run.duration <= 1.01 * best + 0.001


@for_all(seeds, st.sampled_from(["anywhere", "walk", "curve"]), max_examples=20)
def test_it_is_faster_than_one_trapezoid_for_the_worst_place_and_than_stopping(seed, kind):
    path, speeds, accelerations = a_path(seed, kind)
    run = time_optimal(path, speeds, accelerations, 0.001)
    spline, knots = spline_of(path, speeds)
    u = np.linspace(0, knots[-1], 5000)
    slope, bend = np.abs(spline(u, 1)).max(axis=0), np.abs(spline(u, 2)).max(axis=0)
    # half of the acceleration for the bends, half for speeding up
    pace = min(np.min(speeds / slope), np.min(np.sqrt(0.5 * accelerations / np.maximum(bend, 1e-9))))
    push = np.min(0.5 * accelerations / slope)
    whole = knots[-1]
    naive = whole / pace + pace / push if pace**2 < push * whole else 2 * np.sqrt(whole / push)
    assert run.duration <= 1.02 * naive + 0.001


def test_a_smooth_path_is_much_faster_than_stopping_at_each_waypoint():
    s = np.linspace(0, 1, 40)[:, None]
    path = np.concatenate([np.cos(2 * s), np.sin(2 * s), s], axis=1)
    stopping = sum(time_optimal(path[k : k + 2], 2.0, 5.0, 1e-3).duration for k in range(39))
    assert time_optimal(path, 2.0, 5.0, 1e-3).duration < 0.5 * stopping


def test_some_limit_is_reached_at_nearly_all_times():
    s = np.linspace(0, 1, 40)[:, None]
    path = np.concatenate([np.cos(2 * s), np.sin(2 * s), s], axis=1)
    run = time_optimal(path, 0.9, 2.0, 1e-3)
    pull = np.abs(np.diff(run.velocities, axis=0)).max(axis=1) / 1e-3
    speed = np.abs(run.velocities[1:]).max(axis=1)
    assert np.mean((pull > 0.95 * 2.0) | (speed > 0.95 * 0.9)) > 0.95


@for_all(seeds, st.sampled_from(KINDS), max_examples=20)
def test_larger_limits_never_take_longer_and_scale_as_they_should(seed, kind):
    path, speeds, accelerations = a_path(seed, kind)
    run = time_optimal(path, speeds, accelerations, 1e-3)
    # twice the speed and four times the acceleration: half the time
    half = time_optimal(path, 2 * speeds, 4 * accelerations, 1e-3)
    assert half.duration == pytest.approx(0.5 * run.duration, rel=1e-3, abs=2e-3)
    assert half.deviation == pytest.approx(run.deviation, rel=1e-9, abs=1e-12)


def test_repeated_waypoints_change_nothing_and_a_still_path_stays():
    path, speeds, accelerations = a_path(7, "curve")
    once, twice = (
        time_optimal(path, speeds, accelerations, 0.01),
        time_optimal(np.repeat(path, 3, axis=0), speeds, accelerations, 0.01),
    )
    np.testing.assert_array_equal(once.joints, twice.joints)
    for still in (path[:1], path[[2, 2, 2]]):
        run = time_optimal(still, speeds, accelerations, 0.01)
        assert run.duration == 0.0 and run.deviation == 0.0
        np.testing.assert_array_equal(run.joints, still[:1])
        np.testing.assert_array_equal(run.velocities, 0.0)


@for_all(seeds, st.floats(-8, 2), st.booleans(), max_examples=20)
def test_tiny_huge_and_very_uneven_paths_are_timed_within_their_limits(seed, exponent, doubled):
    path, speeds, accelerations = a_path(seed, "anywhere")
    if doubled:
        path = np.repeat(path, 2, axis=0) + 1e-7 * np.random.default_rng(seed).normal(size=(2 * len(path), 1))
    run = time_optimal(10**exponent * path, speeds, accelerations, dt := 10**exponent)
    assert (np.abs(np.diff(run.joints, axis=0)) / dt <= speeds + 1e-6).all()
    assert (np.abs(np.diff(run.velocities, axis=0)) / dt <= accelerations + 1e-6).all()
    np.testing.assert_array_equal(run.joints[-1], 10**exponent * path[-1])


def test_the_same_path_is_timed_to_the_same_bits_and_cannot_be_written_to():
    path, speeds, accelerations = a_path(11, "walk")
    first, second = time_optimal(path, speeds, accelerations, 0.01), time_optimal(path, speeds, accelerations, 0.01)
    np.testing.assert_array_equal(first.joints, second.joints)
    np.testing.assert_array_equal(first.velocities, second.velocities)
    with pytest.raises(ValueError, match="read-only"):
        first.joints[0] = 0.0


GOOD = np.array([[0.0, 0.0], [0.5, 1.0], [1.0, 1.0]])


@pytest.mark.parametrize(
    "change, error, name",
    [
        ({"joints": GOOD[0]}, BadShape, "joint path"),
        ({"joints": GOOD[:0]}, BadShape, "joint path"),
        ({"joints": np.where(GOOD == 0.5, np.nan, GOOD)}, NotFinite, r"\(1, 0\)"),
        ({"velocity_limits": [1.0, 0.0]}, BadOption, "velocity_limits"),
        ({"velocity_limits": [1.0, 1.0, 1.0]}, BadShape, "velocity_limits"),
        ({"acceleration_limits": -1.0}, BadOption, "acceleration_limits"),
        ({"acceleration_limits": [1.0, np.nan]}, BadOption, "acceleration_limits"),
        ({"acceleration_limits": np.inf}, BadOption, "acceleration_limits"),
        ({"dt": 0.0}, BadOption, "dt"),
        ({"dt": np.nan}, BadOption, "dt"),
        ({"dt": 1e-7}, BadOption, "dt.*samples"),
    ],
)
def test_bad_input_is_refused_by_name(change, error, name):
    arguments = {"joints": GOOD, "velocity_limits": 1.0, "acceleration_limits": [2.0, 3.0], "dt": 0.01, **change}
    with pytest.raises(error, match=name):
        time_optimal(**arguments)
