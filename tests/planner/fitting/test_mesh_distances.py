"""True distances of parts of meshes, balls and capsules; and sweeps that would have too many corners."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.arms import panda
from helpers.strategies import for_all
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from onedemo.planner import Pose
from onedemo.planner.fitting.finger_sweeps import MANY, _fewer
from onedemo.planner.fitting.link_pieces import Piece
from onedemo.planner.fitting.mesh_distances import MeshDistances
from onedemo.planner.fitting.robot_model import Geometry
from onedemo.planner.geometry.triangle_surface import is_inside, to_triangles

HOME = np.zeros(7)


def at_rest(name: str, geometry: Geometry) -> Piece:
    return Piece(name, -1, Pose.identity(), geometry)


def of_capsule(a: np.ndarray, b: np.ndarray, radius: float) -> Geometry:
    return Geometry([(a, b, radius)], np.zeros((0, 3)))


@for_all(st.integers(0, 10**6), st.booleans(), max_examples=60)
def test_the_distance_of_a_capsule_from_a_mesh_is_that_of_its_core_less_its_radius(seed, ball):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(12, 3))
    hull = ConvexHull(points)
    triangles = points[hull.simplices]
    a, b = 2.0 * rng.normal(size=(2, 3))
    b, radius = a if ball else b, 0.1
    pieces = [at_rest("mesh", Geometry([], points, triangles)), at_rest("round", of_capsule(a, b, radius))]
    found = MeshDistances(panda(), pieces).between(("round", "mesh"), HOME)
    core = a + np.linspace(0.0, 1.0, 801)[:, None] * (b - a)
    depth = (core @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1)
    if depth.min() < 0.0:  # inside, or through
        assert found <= 0.0
    else:
        step = np.linalg.norm(b - a) / 800
        true = to_triangles(core, triangles).min() - radius
        assert true - step - 1e-9 <= found <= true + 1e-9


@for_all(st.integers(0, 10**6), max_examples=40)
def test_the_distance_of_two_balls_is_that_of_their_centers_less_their_radii(seed):
    rng = np.random.default_rng(seed)
    one, other, (small, large) = *rng.normal(size=(2, 3)), rng.uniform(0.01, 0.5, 2)
    pieces = [at_rest("one", of_capsule(one, one, small)), at_rest("other", of_capsule(other, other, large))]
    found = MeshDistances(panda(), pieces).between(("one", "other"), HOME)
    assert found == pytest.approx(np.linalg.norm(one - other) - small - large, abs=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_a_sweep_of_many_corners_is_enclosed_by_few(seed):
    points = np.random.default_rng(seed).normal(size=(3 * MANY, 3))
    points *= np.array([0.3, 0.2, 0.25]) / np.linalg.norm(points, axis=1)[:, None]
    corners = _fewer(points)
    planes = ConvexHull(corners).equations
    assert len(corners) < 0.5 * MANY
    assert (points @ planes[:, :3].T + planes[:, 3]).max() < 1e-9
    outside = ConvexHull(points).equations
    assert (corners @ outside[:, :3].T + outside[:, 3]).max() < 0.006


def test_a_sweep_of_few_corners_keeps_all():
    box = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    inside = np.random.default_rng(0).uniform(0.1, 0.9, (50, 3))
    assert sorted(map(tuple, _fewer(np.vstack([inside, box])))) == sorted(map(tuple, box))
    assert all(is_inside(point, box[ConvexHull(box).simplices]) for point in inside)
