"""Turns after which a solid looks the same: of prisms by construction, of bodies without symmetry none."""

from __future__ import annotations

import math

import numpy as np
import pytest
from helpers.strategies import for_all, st

from onedemo.planner.geometry.hulls import corner_points
from onedemo.planner.geometry.shapes import Box, Cylinder, Sphere
from onedemo.planner.skills.symmetry import ROUND, is_round, turns_alike

Z = np.array([0.0, 0.0, 1.0])


def prism(sides: int, radius: float, height: float) -> np.ndarray:
    angles = 2.0 * math.pi * np.arange(sides) / sides
    ring = np.column_stack([radius * np.cos(angles), radius * np.sin(angles)])
    return np.vstack([np.column_stack([ring, np.full(sides, z)]) for z in (-0.5 * height, 0.5 * height)])


@pytest.mark.parametrize("sides", [3, 4, 5, 6])
@for_all(st.floats(0.01, 0.1), st.floats(0.01, 0.4), st.floats(0.0, 6.0), max_examples=10)
def test_a_prism_has_the_turns_of_its_base(sides, radius, height, yaw):
    turned = prism(sides, radius, height) @ np.array(
        [[math.cos(yaw), math.sin(yaw), 0], [-math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]]
    )
    assert len(turns_alike(turned, Z, np.zeros(3))) == sides


@for_all(st.floats(0.01, 0.1), st.floats(0.01, 0.4), max_examples=10)
def test_what_is_round_looks_the_same_from_everywhere(radius, height):
    for shape in (Cylinder(radius, height), Sphere(radius)):
        assert is_round(turns_alike(corner_points(shape), Z, np.zeros(3)))


@for_all(st.floats(0.3, 0.9), st.floats(0.02, 0.1), max_examples=20)
def test_a_flat_box_has_a_half_turn_and_a_square_bar_four_turns(share, width):
    flat = corner_points(Box((width, share * width, 0.2)))
    assert turns_alike(flat, Z, np.zeros(3)) == pytest.approx((0.0, math.pi)) or share > 0.88
    bar = corner_points(Box((width, width, 10 * width)))
    assert len(turns_alike(bar, Z, np.zeros(3))) == 4


def test_a_handle_takes_away_every_turn():
    handle = corner_points(Box((0.02, 0.02, 0.02))) + np.array([0.06, 0.0, 0.0])
    nut = np.vstack([corner_points(Box((0.08, 0.08, 0.02))), handle])
    assert turns_alike(nut, Z, np.zeros(3)) == (0.0,)


@for_all(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), max_examples=10)
def test_turns_are_about_the_axis_that_is_asked_for(x, y, z):
    about = np.array([x, y, z])
    points = corner_points(Box((0.04, 0.04, 0.1)))
    assert len(turns_alike(points + about, Z, about)) == 4
    assert len(turns_alike(points + about, np.array([1.0, 0.0, 0.0]), about)) == 2
    assert ROUND > 8
