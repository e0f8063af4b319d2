"""Closest points against other libraries and exhaustive search; what clearance relies on: bounds, normals, planes."""

from __future__ import annotations

import itertools

import fcl
import mujoco
import numpy as np
import pytest
from helpers.solids import KINDS, fcl_capsule, fcl_distance, fcl_obstacle, random_pose, random_shape, true_distance
from helpers.strategies import directions, for_all
from hypothesis import strategies as st

from onedemo.planner.collision.proximity import between_segments, closest, distance, is_beyond
from onedemo.planner.escape.tangent_plane import plane_basis
from onedemo.planner.geometry.gjk import segment_polytope
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import Box, Capsule, Cylinder, Mesh, Obstacle, Sphere, pack
from onedemo.planner.robot.resting_pairs import segment_distance

seeds, kinds = st.integers(0, 10**6), st.sampled_from(KINDS)
CUBE = Mesh(np.array(list(itertools.product((-0.1, 0.1), repeat=3))))
SLIM = Mesh.hull_of(np.random.default_rng(4).normal(size=(200, 3)) * [0.1, 0.1, 0.002])


def ends(*points):
    return tuple(tuple(map(float, point)) for point in points)


def look(obstacle: Obstacle, a, b):
    """Distance, closest point of the segment, normal."""
    rows, vertices = pack([obstacle])
    gap, t, normal = closest(rows, 0, vertices, *ends(a, b))
    return gap, np.asarray(a) + t * (np.asarray(b) - a), np.array(normal)


def scene(seed: int, kind: str, size: float = 0.2, near: float = 0.3):
    """An obstacle and a segment that is mostly beside it, sometimes a point."""
    rng = np.random.default_rng(seed)
    center = rng.uniform(-1, 1, 3) * size * 5
    obstacle = Obstacle(random_shape(rng, kind, size), random_pose(rng, center))
    a = center + rng.normal(size=3) * near * size / 0.2
    b = a + rng.choice([0.0, 0.1, 1.0, 5.0]) * size * rng.normal(size=3)
    return obstacle, a, b, rng


def surface_points(obstacle: Obstacle, rng, count: int = 3000) -> np.ndarray:
    """Points (n, 3) of the obstacle in the world: corners and random ones on its edge."""
    shape, unit = obstacle.shape, rng.normal(size=(count, 3))
    unit /= np.linalg.norm(unit, axis=1)[:, None]
    if isinstance(shape, Sphere):
        points = shape.radius * unit
    elif isinstance(shape, Capsule):
        points = shape.radius * unit + np.sign(unit[:, 2:]) * [0, 0, 0.5 * shape.length]
    elif isinstance(shape, Cylinder):
        turn = unit[:, :2] / np.linalg.norm(unit[:, :2], axis=1)[:, None]
        points = np.column_stack([shape.radius * turn, 0.5 * shape.length * np.sign(unit[:, 2])])
    elif isinstance(shape, Box):
        points = 0.5 * np.array(list(itertools.product((-1, 1), repeat=3))) * shape.size
    else:
        points = shape.vertices
    return points @ obstacle.pose.rotation.T + obstacle.pose.position


@for_all(seeds, kinds, max_examples=150)
def test_distances_are_those_of_exhaustive_search(seed, kind):
    obstacle, a, b, _ = scene(seed, kind)
    assert look(obstacle, a, b)[0] == pytest.approx(true_distance(obstacle, a, b), rel=0, abs=1e-8)


@for_all(seeds, kinds, max_examples=150)
def test_distances_are_those_of_fcl(seed, kind):
    obstacle, a, b, _ = scene(seed, kind)
    gap, _, _ = look(obstacle, a, b)
    other = fcl_distance(fcl_capsule(a, b, 1e-3), fcl_obstacle(obstacle))
    if other > 1e-6:
        # its own convex solver stops early
        assert gap - 1e-3 == pytest.approx(other, rel=1e-6, abs=2e-5)
    else:
        assert gap - 1e-3 < 1e-5


def mujoco_distance(obstacle: Obstacle, a, b, radius: float) -> float:
    """By MuJoCo, of a capsule."""
    shape, axis = obstacle.shape, b - a
    spec = mujoco.MjSpec()
    kinds = {Sphere: "SPHERE", Capsule: "CAPSULE", Box: "BOX", Cylinder: "CYLINDER", Mesh: "MESH"}
    geom = {"type": getattr(mujoco.mjtGeom, f"mjGEOM_{kinds[type(shape)]}")}
    if isinstance(shape, Mesh):
        # hung on its center of mass and main axes: where it went is read back
        spec.add_mesh(name="mesh", uservert=shape.vertices.ravel())
        geom["meshname"] = "mesh"
    elif isinstance(shape, Box):
        geom["size"] = 0.5 * np.array(shape.size)
    else:
        geom["size"] = [shape.radius, 0.5 * getattr(shape, "length", 0.0), 0.0]
    spec.worldbody.add_geom(pos=obstacle.pose.position, quat=obstacle.pose.quaternion, **geom)
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[radius, 0, 0], fromto=np.concatenate([a, a + axis])
    )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return mujoco.mj_geomDistance(model, data, 0, 1, 10.0, None)


@pytest.mark.parametrize("kind", KINDS)
def test_distances_are_those_of_mujoco(kind):
    for seed in range(25):
        obstacle, a, b, _ = scene(seed, kind)
        if np.linalg.norm(b - a) < 1e-3:
            continue
        gap = look(obstacle, a, b)[0] - 0.002
        other = mujoco_distance(obstacle, a, b, 0.002)
        if gap > 1e-4:  # its own convex solver stops at 1e-6
            assert gap == pytest.approx(other, rel=1e-5, abs=5e-6)
        else:
            assert other < 2e-4


@for_all(seeds, kinds, st.floats(-4, 1), max_examples=60)
def test_distances_scale_with_the_scene(seed, kind, exponent):
    """From a tenth of a millimetre to tens of metres."""
    size = 10**exponent
    obstacle, a, b, _ = scene(seed, kind, size)
    assert look(obstacle, a, b)[0] == pytest.approx(true_distance(obstacle, a, b), rel=0, abs=1e-8 * max(1.0, size))


@for_all(seeds, kinds, max_examples=150)
def test_the_normal_is_that_of_a_separating_plane(seed, kind):
    """Property 24: all of the obstacle lies behind the plane, all of the segment before it, at the distance."""
    obstacle, a, b, rng = scene(seed, kind)
    gap, point, normal = look(obstacle, a, b)
    assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-14)
    if gap > 1e-9:
        support = (surface_points(obstacle, rng) @ normal).max()
        assert min(a @ normal, b @ normal) - support >= gap - 1e-7
        if kind != "mesh":
            assert min(a @ normal, b @ normal) == pytest.approx(point @ normal, rel=0, abs=1e-7)


@for_all(seeds, kinds, max_examples=100)
def test_no_way_in_the_tangent_plane_or_beyond_loses_clearance(seed, kind):
    obstacle, a, b, rng = scene(seed, kind)
    gap, _, normal = look(obstacle, a, b)
    if gap > 1e-9:
        for _ in range(10):
            way = rng.normal(size=3) * rng.choice([1e-3, 0.1, 1.0])
            way -= min(0.0, way @ normal) * normal
            assert look(obstacle, a + way, b + way)[0] >= gap - 1e-7


@for_all(seeds, kinds, max_examples=100)
def test_distance_grows_with_a_way_at_least_as_its_first_order(seed, kind):
    """Convexity: what the velocity bound and the certified slide rest on; also Lipschitz with constant 1."""
    obstacle, a, b, rng = scene(seed, kind)
    way = rng.normal(size=3) * rng.choice([1e-6, 1e-2, 0.3])
    gaps = [look(obstacle, a + s * way, b + s * way) for s in (0.0, 0.5, 1.0)]
    if gaps[0][0] > 1e-9:
        assert gaps[2][0] >= gaps[0][0] + gaps[0][2] @ way - 1e-8
    assert gaps[1][0] <= 0.5 * (gaps[0][0] + gaps[2][0]) + 1e-8
    assert abs(gaps[2][0] - gaps[0][0]) <= np.linalg.norm(way) + 1e-8


@for_all(seeds, kinds, max_examples=60)
def test_distance_is_lipschitz_in_each_end(seed, kind):
    obstacle, a, b, rng = scene(seed, kind)
    da, db = rng.normal(size=(2, 3)) * rng.choice([1e-6, 1e-2])
    most = max(np.linalg.norm(da), np.linalg.norm(db))
    assert abs(look(obstacle, a + da, b + db)[0] - look(obstacle, a, b)[0]) <= most + 1e-8


@for_all(seeds, kinds, max_examples=100)
def test_both_ends_are_alike_and_the_frame_does_not_matter(seed, kind):
    obstacle, a, b, rng = scene(seed, kind)
    gap, _, normal = look(obstacle, a, b)
    back, _, other = look(obstacle, b, a)
    assert back == pytest.approx(gap, rel=0, abs=1e-9)
    moved = random_pose(rng, rng.normal(size=3))
    turned = Obstacle(obstacle.shape, moved @ obstacle.pose)
    a, b = (moved.rotation @ end + moved.position for end in (a, b))
    there, _, normal_there = look(turned, a, b)
    assert there == pytest.approx(gap, rel=0, abs=1e-9)
    if gap > 1e-4 and kind != "mesh":  # the normal is sharp to about rounding / gap
        np.testing.assert_allclose(other, normal, rtol=0, atol=1e-6)
        np.testing.assert_allclose(normal_there, moved.rotation @ normal, rtol=0, atol=1e-6)


@for_all(seeds, kinds, st.floats(-0.1, 0.6), max_examples=150)
def test_the_quick_query_says_the_same_and_what_is_beyond_is_beyond(seed, kind, reach):
    obstacle, a, b, rng = scene(seed, kind)
    rows, vertices = pack([obstacle])
    assert distance(rows, 0, vertices, *ends(a, b)) == look(obstacle, a, b)[0]
    for point in (a, b, obstacle.pose.position, obstacle.pose.position + 0.3 * rng.normal(size=3)):
        if is_beyond(rows, 0, *ends(point), reach):
            assert look(obstacle, point, point)[0] > reach
    assert not is_beyond(rows, 0, *ends(a), look(obstacle, a, a)[0] + 1e-9)
    assert is_beyond(rows, 0, *ends(a), np.linalg.norm(a - obstacle.pose.position) - rows[0, 20] - 1e-9)


def test_the_row_is_the_one_that_was_asked_for():
    obstacles = [scene(seed, kind)[0] for seed, kind in enumerate(KINDS)] + [Obstacle(CUBE)]
    rows, vertices = pack(obstacles)
    a, b = ends((0.7, 0.6, 0.5), (0.6, 0.9, 0.2))
    for k, obstacle in enumerate(obstacles):
        assert closest(rows, k, vertices, a, b)[0] == look(obstacle, a, b)[0]


@for_all(seeds, max_examples=150)
def test_the_polytope_distance_is_proven_from_below(seed):
    """Of random hulls, slim and round, and of segments far, near and within."""
    rng = np.random.default_rng(seed)
    mesh = Mesh.hull_of(rng.normal(size=(int(rng.integers(4, 200)), 3)) * rng.choice([1e-3, 0.1, 1.0], 3))
    a = rng.normal(size=3) * rng.choice([0.02, 0.5, 5.0])
    b = a + rng.normal(size=3) * rng.choice([0.0, 1e-9, 0.1, 3.0])
    proven, t, v = segment_polytope(*ends(a, b), mesh.vertices, 0, len(mesh.vertices))
    truth = true_distance(Obstacle(mesh), a, b)
    assert truth - 1e-7 <= proven <= truth + 1e-12
    assert -1e-12 <= t <= 1.0 + 1e-12
    if proven > 0:
        unit = np.array(v) / np.linalg.norm(v)
        assert min(a @ unit, b @ unit) - (mesh.vertices @ unit).max() >= proven - 1e-12


# ------------------------------------------------------------------ degenerate

SOLIDS = {
    "sphere": Sphere(0.1),
    "capsule": Capsule(0.1, 0.2),
    "box": Box((0.2, 0.2, 0.2)),
    "cylinder": Cylinder(0.1, 0.2),
    "mesh": CUBE,
}
each_solid = pytest.mark.parametrize("solid", SOLIDS.values(), ids=list(SOLIDS))


@each_solid
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_points_and_parallel_segments_before_every_side(solid, axis, sign):
    n = sign * np.eye(3)[axis]
    reach = 0.2 if isinstance(solid, Capsule) and axis == 2 else 0.1
    side = np.eye(3)[(axis + 1) % 3]
    for half in (0.0, 1e-12, 0.05, 0.1, 3.0):
        gap, point, normal = look(Obstacle(solid), (reach + 0.05) * n - half * side, (reach + 0.05) * n + half * side)
        assert gap == pytest.approx(0.05, abs=1e-10)
        np.testing.assert_allclose(normal, n, rtol=0, atol=1e-6)
        assert point @ n == pytest.approx(reach + 0.05, abs=1e-12)


@each_solid
@pytest.mark.parametrize("half", [0.0, 0.02, 1.0])
@pytest.mark.parametrize("turn", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)])
def test_a_core_through_the_middle_is_in_contact_and_has_a_unit_normal(solid, half, turn):
    way = half * np.array(turn, dtype=float)
    gap, point, normal = look(Obstacle(solid), -way, way)
    assert gap == pytest.approx(-0.1 if isinstance(solid, Sphere | Capsule) else 0.0, abs=1e-12)
    assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-12) and np.isfinite(point).all()


@each_solid
def test_touching_is_distance_zero(solid):
    gap, _, normal = look(Obstacle(solid), (0.1, 0.0, -0.05), (0.1, 0.0, 0.05))
    assert abs(gap) <= 1e-12 and normal @ [1, 0, 0] > 0.8


@each_solid
def test_a_hair_outside_is_told_from_a_hair_inside(solid):
    assert look(Obstacle(solid), (0.1 + 1e-7, 0, 0), (0.1 + 1e-7, 0, 0.01))[0] == pytest.approx(1e-7, abs=1e-9)
    assert look(Obstacle(solid), (0.1 - 1e-7, 0, 0), (0.1 - 1e-7, 0, 0.01))[0] <= 0.0


@pytest.mark.parametrize("solid", [Sphere(0.1), Capsule(0.1, 0.2)])
def test_within_the_rounding_radius_the_distance_is_exact_and_negative(solid):
    gap, _, normal = look(Obstacle(solid), (0.03, 0.0, 0.0), (0.03, 0.5, 0.0))
    assert gap == pytest.approx(-0.07, abs=1e-12)
    np.testing.assert_allclose(normal, [1, 0, 0], rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "depth, way", [((0.09, 0, 0), (1, 0, 0)), ((0, -0.08, 0.02), (0, -1, 0)), ((0, 0, -0.05), (0, 0, -1))]
)
def test_out_of_a_box_the_shortest_way_is_named(depth, way):
    np.testing.assert_array_equal(look(Obstacle(Box((0.2, 0.2, 0.2))), depth, depth)[2], way)


def test_slim_meshes_and_long_segments_keep_their_digits():
    """A plate of 4 mm, and segments of ten metres close to it."""
    rng = np.random.default_rng(5)
    for _ in range(100):
        a = rng.normal(size=3) * [0.1, 0.1, 0.01]
        b = a + rng.normal(size=3) * rng.choice([0.01, 10.0])
        truth = true_distance(Obstacle(SLIM), a, b)
        assert truth - 1e-7 <= look(Obstacle(SLIM), a, b)[0] <= truth + 1e-12


@pytest.mark.parametrize("shape", [Sphere(1e-6), Capsule(1e-6, 1e-6), Box((1e-6,) * 3), Cylinder(1e-6, 1e-6)])
def test_the_smallest_shapes_are_nearly_points(shape):
    for point in [(0.3, 0.4, 0.0), (0.0, 0.0, 0.5)]:
        gap, _, normal = look(Obstacle(shape), point, point)
        assert gap == pytest.approx(0.5, abs=2e-6)
        np.testing.assert_allclose(normal, 2 * np.array(point), rtol=0, atol=1e-5)
        gap, _, _ = look(Obstacle(shape), point, np.array(point) + 1.0)
        assert gap == pytest.approx(0.5, abs=2e-6)


# ------------------------------------------------------------------ two segments


@for_all(seeds, st.floats(-6, 1), st.sampled_from([0.0, 1e-9, 1e-7, 1e-4, 1.0]), max_examples=200)
def test_two_segments_against_the_boundary_and_the_inside(seed, exponent, slant):
    """Also nearly parallel ones, points and copies."""
    rng = np.random.default_rng(seed)
    size = 10**exponent
    a, c = rng.normal(size=(2, 3)) * size * rng.choice([0.0, 0.3, 1.0])
    u = rng.normal(size=3) * size * rng.choice([0.0, 1.0])
    v = u * rng.uniform(-2, 2) + rng.normal(size=3) * size * slant
    gap, t, s, normal = between_segments(*ends(a, a + u, c, c + v))
    truth = segment_distance(a, a + u, c, c + v)
    assert gap == pytest.approx(truth, rel=1e-9, abs=1e-7 * size)
    assert 0 <= t <= 1 and 0 <= s <= 1
    assert gap == pytest.approx(np.linalg.norm(a + t * u - c - s * v), rel=0, abs=1e-12 * max(1.0, size))
    other, *_ = between_segments(*ends(c, c + v, a, a + u))
    assert other == pytest.approx(gap, rel=1e-9, abs=1e-7 * size)
    if gap > 1e-3 * size:
        corners = np.array([a, a + u]) @ normal, np.array([c, c + v]) @ normal
        assert corners[0].min() - corners[1].max() >= gap - 1e-6 * size


def test_crossing_segments_touch_and_still_name_a_unit_normal():
    gap, t, s, normal = between_segments((-1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 3.0, 0.0))
    assert (gap, t, s) == (0.0, 0.5, 0.25) and np.linalg.norm(normal) == 1.0


@for_all(seeds, max_examples=60)
def test_two_capsules_are_as_far_apart_as_fcl_says(seed):
    rng = np.random.default_rng(seed)
    a, b, c, d = rng.normal(size=(4, 3))
    gap = between_segments(*ends(a, b, c, d))[0] - 0.01
    other = fcl.distance(fcl_capsule(a, b, 0.004), fcl_capsule(c, d, 0.006))
    assert gap == pytest.approx(other, rel=0, abs=1e-6) if other > 0 else gap < 1e-6


# ------------------------------------------------------------------ tangent planes


def normals():
    rng = np.random.default_rng(0)
    some = rng.normal(size=(10_000, 3))
    some[:3000] *= rng.choice([0.0, 1e-9, 1.0], size=(3000, 3))
    some = some[np.linalg.norm(some, axis=1) > 0]
    return np.vstack([np.eye(3), -np.eye(3), some / np.linalg.norm(some, axis=1)[:, None]])


def assert_right_handed(n, towards, world_basis):
    u, v = (np.array(w) for w in plane_basis(tuple(n), tuple(towards), world_basis))
    basis = np.column_stack([n, u, v])
    assert np.abs(basis.T @ basis - np.eye(3)).max() <= 1e-14
    assert np.linalg.det(basis) == pytest.approx(1.0, abs=1e-13)


def test_the_basis_of_a_plane_is_orthonormal_and_right_handed():
    """Property 23: by the world's axes, and along a way that goes straight on, or straight into the plane."""
    for n in normals():
        side = plane_basis(tuple(n), tuple(n), 1.0)[0]
        for towards, world_basis in [(n, 1.0), (-3.0 * n, 0.0), (np.array(side) - 0.5 * n, 0.0)]:
            assert_right_handed(n, towards, world_basis)


def test_nearly_head_on_the_basis_is_as_sharp():
    for n in normals()[::20]:
        side = np.array(plane_basis(tuple(n), tuple(n), 1.0)[0])
        assert_right_handed(n, 1e-5 * side - n, 0.0)


@for_all(directions(), directions(), st.floats(0.1, 3.0), max_examples=60)
def test_the_first_direction_of_a_plane_points_onwards(n, towards, length):
    if np.linalg.norm(np.cross(n, towards)) > 1e-2:
        _, v = plane_basis(tuple(n), tuple(length * towards), 0.0)
        assert np.array(v) @ towards > 0 and abs(np.array(v) @ np.cross(n, towards)) < 1e-12


def test_the_world_basis_does_not_look_where_the_path_goes():
    n = (0.6, 0.0, 0.8)
    assert plane_basis(n, (1.0, 0.0, 0.0), 1.0) == plane_basis(n, (0.0, 1.0, 0.0), 1.0)
    assert plane_basis(n, (1.0, 0.0, 0.0), 0.0) != plane_basis(n, (0.0, 1.0, 0.0), 0.0)


def test_a_pose_at_identity_is_no_special_case():
    assert look(Obstacle(Sphere(0.1), Pose.identity()), (0, 0, 0.5), (0, 0, 0.7))[0] == pytest.approx(0.4, abs=1e-15)
