"""Shapes refuse what they cannot be, and are laid out as the kernels read them."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from helpers.solids import KINDS, random_pose, random_shape
from helpers.strategies import for_all
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from onedemo.planner.errors import BadShape, NotFinite, UnfitShape
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import (
    OBSTACLE,
    Box,
    Capsule,
    Cylinder,
    Mesh,
    Obstacle,
    Sphere,
    core_of,
    hull_corners,
    pack,
)

BAD_LENGTHS = (np.nan, np.inf, -np.inf, 0.0, -0.1, -1e-300, 1e-300, 9.9e-7, 100.001, 1e300)
CUBE = np.array(list(itertools.product((-0.1, 0.1), repeat=3)))


@pytest.mark.parametrize("bad", BAD_LENGTHS)
@pytest.mark.parametrize(
    "make, name",
    [
        (lambda x: Sphere(x), "sphere: radius"),
        (lambda x: Capsule(x, 0.1), "capsule: radius"),
        (lambda x: Capsule(0.1, x), "capsule: length"),
        (lambda x: Cylinder(x, 0.1), "cylinder: radius"),
        (lambda x: Cylinder(0.1, x), "cylinder: length"),
        (lambda x: Box((x, 0.1, 0.1)), r"box: size\[0\]"),
        (lambda x: Box((0.1, 0.1, x)), r"box: size\[2\]"),
    ],
)
def test_a_length_must_be_positive_finite_and_in_metres(make, name, bad):
    with pytest.raises(UnfitShape, match=f"{name}.*is not a length from 1e-06 to 100 m") as caught:
        make(bad)
    assert "\n" not in str(caught.value) and repr(bad) in str(caught.value)


def test_the_largest_and_the_smallest_lengths_are_taken():
    assert Sphere(100).radius == 100.0 and isinstance(Sphere(100).radius, float)
    assert Sphere(1e-6).radius == 1e-6


@pytest.mark.parametrize("size", [(), (0.1, 0.1), (0.1,) * 4])
def test_a_box_has_three_extents(size):
    with pytest.raises(BadShape, match="box: size"):
        Box(size)


@pytest.mark.parametrize(
    "vertices, error, message",
    [
        (np.zeros((0, 3)), UnfitShape, "there are 0; allowed are 4 to 256"),
        (CUBE[:3], UnfitShape, "there are 3"),
        (np.random.default_rng(0).normal(size=(257, 3)), UnfitShape, "there are 257"),
        (CUBE.ravel(), BadShape, r"\(n, 3\)"),
        (CUBE[:, :2], BadShape, r"\(n, 3\)"),
        (np.where(np.arange(24).reshape(8, 3) == 13, np.nan, CUBE), NotFinite, r"\(4, 1\)"),
        (np.where(np.arange(24).reshape(8, 3) == 2, np.inf, CUBE), NotFinite, r"\(0, 2\)"),
        (2000 * CUBE, UnfitShape, "more than 100 m away: millimetres"),
        (np.vstack([CUBE, np.zeros(3)]), UnfitShape, "vertex 8 is no corner.*not convex.*hull_of"),
        (np.vstack([np.zeros(3), CUBE]), UnfitShape, "vertex 0 is no corner"),
        (np.vstack([CUBE, CUBE[:1]]), UnfitShape, "is no corner"),
        (CUBE * [1, 1, 0], UnfitShape, "no volume"),
        (CUBE * [1, 1, 1e-11], UnfitShape, "no volume"),
        (CUBE * [1, 0, 0], UnfitShape, "no volume"),
        (CUBE * 0, UnfitShape, "no volume"),
    ],
)
def test_a_mesh_must_be_convex_finite_and_have_a_volume(vertices, error, message):
    with pytest.raises(error, match=message) as caught:
        Mesh(vertices)
    assert "\n" not in str(caught.value)


def test_a_dented_mesh_is_refused_and_its_hull_is_taken():
    dented = np.vstack([CUBE, [[0.0, 0.0, 0.09]]])
    with pytest.raises(UnfitShape, match="vertex 8"):
        Mesh(dented)
    np.testing.assert_array_equal(Mesh.hull_of(dented).vertices, CUBE)


@for_all(st.integers(0, 10**6), max_examples=20)
def test_corners_of_a_hull_are_all_and_only_its_corners(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(int(rng.integers(5, 60)), 3))
    corners = hull_corners(points)
    assert (np.diff(corners) > 0).all()
    whole = ConvexHull(points).volume
    assert ConvexHull(points[corners]).volume == pytest.approx(whole, rel=1e-12)
    for k in corners:
        assert ConvexHull(np.delete(points, k, axis=0)).volume < whole


def test_a_mesh_keeps_its_own_read_only_copy():
    vertices = CUBE.copy()
    mesh = Mesh(vertices)
    vertices[0] = 9.0
    np.testing.assert_array_equal(mesh.vertices, CUBE)
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[0] = 0.0


@pytest.mark.parametrize("velocity", [(0.0, 0.0), np.zeros((1, 3)), 0.0])
def test_a_velocity_has_three_components(velocity):
    with pytest.raises(BadShape, match="obstacle 'cup': velocity"):
        Obstacle(Sphere(0.1), velocity=velocity, name="cup")


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_velocity_is_finite(bad):
    with pytest.raises(NotFinite, match=r"obstacle 'cup': velocity.*1"):
        Obstacle(Sphere(0.1), velocity=(0.0, bad, 0.0), name="cup")


@pytest.mark.parametrize("bad", [np.nan, -1e-9, np.inf, 101.0])
def test_a_margin_is_a_length_or_none(bad):
    with pytest.raises(UnfitShape, match=r"obstacle 'cup': margin.*from 0 to 100 m"):
        Obstacle(Sphere(0.1), name="cup", margin=bad)
    assert Obstacle(Sphere(0.1), margin=0.0).margin == 0.0


def test_later_an_obstacle_has_moved_straight_on_and_is_otherwise_the_same():
    rng = np.random.default_rng(1)
    here = Obstacle(Box((0.1, 0.2, 0.3)), random_pose(rng, (1.0, 2.0, 3.0)), (0.1, -0.2, 0.3), "cup", 0.02)
    later = here.at(2.0)
    np.testing.assert_allclose(later.pose.position, [1.2, 1.6, 3.6], rtol=0, atol=1e-14)
    np.testing.assert_allclose(later.pose.rotation, here.pose.rotation, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(later.velocity, here.velocity)
    assert (later.shape, later.name, later.margin) == (here.shape, "cup", 0.02)
    back = later.at(-2.0)
    np.testing.assert_allclose(back.pose.position, here.pose.position, rtol=0, atol=1e-14)


def test_rows_hold_what_the_table_says():
    turn = random_pose(np.random.default_rng(2), (0.1, 0.2, 0.3))
    wedge = Mesh(CUBE[[0, 1, 2, 4]] + 0.1)
    obstacles = [
        Obstacle(Sphere(0.3), turn, (1.0, 2.0, 3.0)),
        Obstacle(Capsule(0.1, 0.6), turn, margin=0.0),
        Obstacle(Mesh(CUBE), turn),
        Obstacle(Box((0.2, 0.4, 0.6)), turn, margin=0.07),
        Obstacle(Cylinder(0.3, 0.8), turn),
        Obstacle(wedge, turn),
    ]
    rows, vertices = pack(obstacles)
    assert rows.shape == (6, OBSTACLE.packed) and OBSTACLE.packed == 24
    np.testing.assert_array_equal(rows[:, 0], [1, 3, 5, 2, 4, 5])
    np.testing.assert_array_equal(rows[:, 1], [0.3, 0.1, 0, 0, 0, 0])
    np.testing.assert_array_equal(rows[:, 2:5], np.tile(turn.position, (6, 1)))
    np.testing.assert_array_equal(rows[3, 5:14].reshape(3, 3), turn.rotation)
    np.testing.assert_allclose(rows[:2, 14:17], [[0, 0, 0], [0, 0, 0.3]], rtol=0, atol=1e-15)
    np.testing.assert_allclose(rows[3:5, 14:17], [[0.1, 0.2, 0.3], [0.3, 0.3, 0.4]], rtol=0, atol=1e-15)
    np.testing.assert_array_equal(rows[0, 17:20], [1, 2, 3])
    np.testing.assert_allclose(rows[:2, 20], [0.3, 0.4], rtol=0, atol=1e-15)
    np.testing.assert_array_equal(rows[:, 21:23], [[0, 0], [0, 0], [0, 8], [0, 0], [0, 0], [8, 4]])
    np.testing.assert_array_equal(rows[:, 23], [-1, 0, -1, 0.07, -1, -1])
    np.testing.assert_array_equal(vertices, np.vstack([CUBE, wedge.vertices]))
    assert pack([]).rows.shape == (0, OBSTACLE.packed) and pack([]).vertices.shape == (1, 3)


@for_all(st.integers(0, 10**6), st.sampled_from(KINDS), max_examples=40)
def test_the_ball_of_a_shape_holds_it_tightly(seed, kind):
    rng = np.random.default_rng(seed)
    shape = random_shape(rng, kind)
    _, radius, half, ball = core_of(shape)
    corners = shape.vertices if kind == "mesh" else np.array(list(itertools.product((-1, 1), repeat=3))) * half
    if kind == "cylinder":
        corners = np.array([[half[0], 0.0, half[2]]])
    assert ball == pytest.approx(np.linalg.norm(corners, axis=1).max() + radius, abs=1e-12)


def test_an_obstacle_stands_at_the_origin_by_default():
    obstacle = Obstacle(Sphere(0.1))
    np.testing.assert_array_equal(obstacle.pose.dq, Pose.identity().dq)
    assert not obstacle.velocity.any() and obstacle.margin is None
