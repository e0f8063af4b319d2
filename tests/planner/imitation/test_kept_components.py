"""Constraints found in paths: known cases, and that neither place nor tool frame of a recording matters."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.planner.carried_paths import GRIP, book, hinged, poured, shifted, tray, turned
from helpers.strategies import directions, for_all, gentle_dqs, positions, st

from onedemo.planner import Pose, PosePath
from onedemo.planner.errors import BadOption
from onedemo.planner.imitation.constraint import Constraint, ConstraintSettings, angles_to, seen_up
from onedemo.planner.imitation.kept_components import found_constraint, least_moving_point, smallest_cap

DEGREE = np.deg2rad(1.0)
KNOWN = {"tray": tray(), "poured": poured(), "handle": hinged((0, 1, 0.2)), "door": hinged((0, 0, 1)), "book": book()}


def test_a_tray_is_held_upright_all_the_way():
    found = found_constraint(tray())
    assert found.components == 2 and found.guided == found.count
    assert found.spread < 1e-6 and found.bound == pytest.approx(5.0 * DEGREE, abs=1e-6)
    np.testing.assert_allclose(found.directions[0], GRIP.rotation.T @ [0, 0, 1], atol=1e-6)


@for_all(st.floats(0.2, 2.5), st.integers(0, 10**6), max_examples=25)
def test_a_tremor_widens_the_bound_by_what_was_shown(degrees, seed):
    path = tray(tremor=degrees * DEGREE, seed=seed)
    found = found_constraint(path)
    assert found.components == 2 and found.guided == found.count
    assert found.deviations(path).max() <= found.spread + 0.3 * DEGREE
    assert found.spread <= 1.5 * 1.6 * degrees * DEGREE


@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
def test_a_glass_is_guided_from_where_it_is_tilted(share):
    path = poured(share=share)
    found = found_constraint(path)
    assert found.components == 2
    tilts = angles_to(seen_up(path), seen_up(path)[0])
    assert tilts[found.guided] <= 2.0 * DEGREE < tilts[min(found.guided + 3, len(path) - 1)]


@pytest.mark.parametrize("name", ["handle", "door"])
def test_what_turns_about_a_fixed_axis_is_guided_all_along(name):
    found = found_constraint(KNOWN[name])
    assert (found.components, found.guided) == (0, 0)


def test_a_book_turns_as_shown_and_no_other_way():
    path = book()
    found = found_constraint(path)
    assert found.components == 1 and found.guided == found.count
    assert found.deviations(path).max() < 0.1 * DEGREE
    aside = PosePath(path.dqs).with_tool(GRIP.inverse() @ turned((1, 0, 0), 10.0 * DEGREE) @ GRIP)
    assert found.deviations(aside).max() > 9.0 * DEGREE


@pytest.mark.parametrize("name", KNOWN)
@for_all(positions(), st.floats(-np.pi, np.pi), max_examples=10)
def test_the_place_of_the_recording_does_not_matter(name, position, yaw):
    moved = KNOWN[name].moved(Pose.from_yaw(position, yaw))
    same_as(found_constraint(KNOWN[name]), found_constraint(moved), moved)


@pytest.mark.parametrize("name", KNOWN)
@for_all(gentle_dqs(), max_examples=10)
def test_the_frame_of_the_tool_does_not_matter(name, frame):
    tool = Pose.from_position_quaternion(0.1 * Pose(frame).position, Pose(frame).dq[:4])
    path = KNOWN[name].with_tool(tool)
    same_as(found_constraint(KNOWN[name]).with_tool(tool), found_constraint(path), path)


def same_as(one: Constraint, other: Constraint, path: PosePath):
    """The same components, kept to the same place, with the same bounds; the place to two percent of the path."""
    assert (one.components, one.count) == (other.components, other.count)
    assert abs(one.guided - other.guided) <= 0.03 * one.count
    assert one.bound == pytest.approx(other.bound, abs=1.0 * DEGREE) or one.components == 0
    np.testing.assert_allclose(one.deviations(path), other.deviations(path), atol=1.0 * DEGREE)


@for_all(directions(), st.floats(0.0, 1.0), st.integers(1, 40), st.integers(0, 10**6), max_examples=40)
def test_the_smallest_cap_holds_all_and_is_no_larger_than_a_known_one(axis, radius, count, seed):
    rng = np.random.default_rng(seed)
    aside = np.cross(axis, rng.normal(size=(count, 3)))
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    angles = radius * rng.uniform(size=(count, 1))
    inside = np.cos(angles) * axis + np.sin(angles) * aside
    center, found = smallest_cap(inside)
    assert angles_to(inside, center).max() <= found + 1e-12
    assert found <= 1.02 * angles.max() + 1e-9


@for_all(positions(0.3), max_examples=20)
def test_the_least_moving_point_of_a_hinge_is_on_its_axis(point):
    path = hinged((0.2, 0.5, 0.7)).with_tool(shifted(*point))
    found, moves = least_moving_point(path)
    places = np.array([pose.rotation @ found + pose.position for pose in path])
    assert moves < 1e-9 and np.ptp(places, axis=0).max() < 1e-9


def test_paths_that_show_nothing_keep_nothing():
    still = PosePath(np.array([GRIP.dq] * 5))
    assert found_constraint(still).keeps_nothing and found_constraint(still[:1]).keeps_nothing


def test_a_part_of_a_path_keeps_its_part():
    found = found_constraint(poured())
    part = found.part(10, 100)
    assert (part.count, part.guided) == (90, found.guided - 10)
    assert found.part(0, 20).guided == 20 and found.part(100, 120).guided == 0


def test_other_poses_of_the_path_keep_the_same_place():
    path = poured()
    found, lengths = found_constraint(path), path.lengths()
    other = found.of_lengths(lengths, lengths[::3])
    assert abs(lengths[::3][other.guided] - lengths[found.guided]) <= lengths[-1] / 30


def test_settings_change_the_bounds():
    tight = found_constraint(poured(), ConstraintSettings(angle=DEGREE, position=0.001, rotation=2.0 * DEGREE))
    assert tight.bound <= 2.5 * DEGREE
    assert (tight.position_bound, tight.rotation_bound) == (0.001, 2.0 * DEGREE)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"directions": [[0, 0, 2.0]]}, "has length 2; must be 1"),
        ({"bound": 0.0}, "bound"),
        ({"guided": 12}, "guided"),
        ({"directions": np.tile([0, 0, 1.0], (101, 1))}, "at most 100"),
    ],
)
def test_bad_constraints_are_refused(fields, message):
    with pytest.raises(BadOption, match=message):
        Constraint(10, **{"directions": [[0, 0, 1.0]], **fields})
