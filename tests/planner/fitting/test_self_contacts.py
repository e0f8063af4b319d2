"""Self-contact by the truth: the surfaces of the model's meshes, placed and measured by Pinocchio."""

from __future__ import annotations

import warnings
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from helpers.arms import panda, panda_urdf
from helpers.models.urdf_text import joint, link, written
from helpers.strategies import for_all
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from onedemo.planner import Arm, Body, Pose, SafetySettings, body_from_urdf
from onedemo.planner.collision.clearance import slack_at
from onedemo.planner.collision.hull_distance import CLOSE
from onedemo.planner.collision.robot_arrays import HEADER, PAIR, ROW, robot_arrays
from onedemo.planner.errors import ModelWarning
from onedemo.planner.fitting.link_pieces import convex_link_pieces
from onedemo.planner.fitting.mesh_distances import MeshDistances
from onedemo.planner.fitting.robot_model import world_from_parts
from onedemo.planner.fitting.robot_parts import PartsRequest
from onedemo.planner.fitting.self_contacts import survey_of
from onedemo.planner.fitting.urdf_parts import parts_from_urdf
from onedemo.planner.geometry.capsule_cover import rough_capsule
from onedemo.planner.geometry.convex_pieces import best_cut, rounded_hull
from onedemo.planner.geometry.shapes import MAX_VERTICES, pack
from onedemo.planner.geometry.triangle_surface import (
    cut_off,
    is_inside,
    nearest_on_triangles,
    shells_of,
    to_triangles,
)
from onedemo.planner.robot.body import BODY
from onedemo.planner.robot.joint_frames import joint_frames, moved

LESS = 0.003
"""Distance [m] by which the arm's own parts may seem closer than they are."""
MARGIN = 0.01


@cache
def panda_with_hulls() -> Body:
    return body_from_urdf(panda_urdf(), panda())


class Meshes:
    """The collision meshes of the Panda's links, by the name of the body's part."""

    def __init__(self):
        path = str(panda_urdf())
        folders = [str(folder) for folder in panda_urdf().resolve().parents]
        self.model = pin.buildModelFromUrdf(path)
        self.geometry = pin.buildGeomFromUrdf(self.model, path, pin.COLLISION, package_dirs=folders)
        self.data, self.placed = self.model.createData(), self.geometry.createData()
        self.names = [f"link{int(item.parentJoint)}" for item in self.geometry.geometryObjects]

    def watch(self, pairs: set[tuple[str, str]]) -> None:
        for i, one in enumerate(self.names):
            for j in range(i + 1, len(self.names)):
                if (one, self.names[j]) in pairs:
                    self.geometry.addCollisionPair(pin.CollisionPair(i, j))
        self.placed = self.geometry.createData()

    def distances(self, q: np.ndarray) -> dict[tuple[str, str], float]:
        pin.computeDistances(self.model, self.data, self.geometry, self.placed, q)
        out: dict[tuple[str, str], float] = {}
        for pair, result in zip(self.geometry.collisionPairs, self.placed.distanceResults, strict=True):
            names = self.names[pair.first], self.names[pair.second]
            out[names] = min(out.get(names, np.inf), result.min_distance)
        return out


def own_distances(body: Body, survey, k: int) -> dict[tuple[str, str], float]:
    """Distances of the parts whose contact is checked, in a posture of a survey."""
    kept, out = set(body.pairs), {}
    for (i, j), distance in zip(survey.pairs, survey.distances[k], strict=True):
        if (int(i), int(j)) in kept:
            names = body.names[i], body.names[j]
            out[names] = min(out.get(names, np.inf), distance)
    return out


def test_the_distance_is_never_more_than_the_truth_and_hardly_less():
    body, meshes = panda_with_hulls(), Meshes()
    survey = survey_of(panda(), body, 300)
    meshes.watch({(body.names[i], body.names[j]) for i, j in body.pairs})
    close = clear = refused = 0
    for k, q in enumerate(survey.postures):
        true, mine = meshes.distances(q), own_distances(body, survey, k)
        assert true.keys() == mine.keys()
        for names, distance in true.items():
            if 0.0 < distance < CLOSE:
                assert mine[names] <= distance + 1e-6, names
                # hulls that touch have no distance, so that of the capsules counts
                assert max(mine[names], 0.0) >= distance - LESS, names
                close += 1
            elif distance <= 0.0:
                assert mine[names] <= 0.0, names
        if min(true.values()) >= MARGIN:
            clear += 1
            refused += min(mine.values()) < MARGIN
    assert close > 20 and clear > 50 and refused <= 0.05 * clear


def test_parts_that_always_pass_close_by_each_other_do_not_forbid_ordinary_postures():
    arm, body = panda(), panda_with_hulls()
    middle, meshes = 0.5 * (arm.lower + arm.upper), Meshes()
    meshes.watch({(body.names[i], body.names[j]) for i, j in body.pairs})
    # links 5 and 7 are closer there than the usual margin, without touching
    assert 0.003 < meshes.distances(middle)["link5", "link7"] < MARGIN
    assert {(body.names[i], body.names[j]) for i, j in body.margins} == {("link5", "link7")}
    settings = SafetySettings(self_distance=MARGIN).packed(0.01)
    work = robot_arrays((arm,), (body,), pack(()), pairs=body.pairs, settings=settings)
    assert slack_at(work, middle, 0.0, 1.0) > 0.0
    pairs = work[int(work[ROW.header, HEADER.first_pair]) :][: len(body.pairs)]
    others = [row[PAIR.margin] for pair, row in zip(body.pairs, pairs, strict=True) if pair not in body.margins]
    assert set(others) == {MARGIN}


def test_few_parts_of_the_panda_can_hit_each_other():
    body = panda_with_hulls()
    names = {(body.names[i], body.names[j]) for i, j in body.pairs}
    assert {("link0", "link6"), ("link2", "link7"), ("link5", "link7")} <= names
    # the elbow keeps them apart
    assert not {("link1", "link3"), ("link2", "link4"), ("link4", "link6"), ("link0", "link2")} & names
    assert len(body.hulls) == len(body) and all(hull is not None for hull in body.hulls)


BOX = '<collision><origin xyz="0 0 {z}"/><geometry><box size="{size}"/></geometry></collision>'
BOOM = f"""<robot name="boom">
<link name="base">{BOX.format(z=0, size="0.1 0.1 0.1")}</link>
<link name="lower">{BOX.format(z=0.15, size="0.04 0.04 0.3")}</link>
<link name="upper">{BOX.format(z=0.15, size="0.04 0.04 0.3")}</link>
<link name="bracket">{BOX.format(z=-0.02, size="0.1 0.1 0.02")}</link>
<joint name="turn" type="revolute"><parent link="base"/><child link="lower"/><origin xyz="0 0 {{height}}"/>
<axis xyz="0 1 0"/><limit lower="-1.5" upper="1.5" effort="1" velocity="1"/></joint>
<joint name="fold" type="revolute"><parent link="lower"/><child link="upper"/><origin xyz="0 {{aside}} 0.3"/>
<axis xyz="0 1 0"/><limit lower="-{{fold}}" upper="{{fold}}" effort="1" velocity="1"/></joint>
<joint name="roll" type="revolute"><parent link="upper"/><child link="bracket"/><origin xyz="0 0 0.3"/>
<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint></robot>"""


@pytest.mark.parametrize(
    "changes, meet",
    [
        ({"fold": 3.1}, {("link0", "link2"), ("link0", "link3"), ("link1", "link3")}),
        # folded by a right angle at most, nothing reaches back
        ({"fold": 1.5}, set()),
        # beside the lower arm, the upper one passes it and the bracket still hits it
        ({"fold": 3.1, "aside": 0.06}, {("link0", "link2"), ("link0", "link3"), ("link1", "link3")}),
        ({"fold": 3.1, "aside": 0.2}, set()),
        # on a high post, the bracket alone reaches the base
        ({"fold": 3.1, "height": 0.35}, {("link1", "link3")}),
    ],
)
def test_parts_are_checked_if_they_can_meet(tmp_path, changes, meet):
    values = {"fold": 3.1, "aside": 0.0, "height": 0.1, **changes}
    path = tmp_path / "boom.urdf"
    path.write_text(BOOM.format(**values))
    arm = Arm.from_urdf(path, tcp_frame="bracket")
    body = body_from_urdf(path, arm)
    assert {(body.names[i], body.names[j]) for i, j in body.pairs} == meet


def tube(outer: float = 0.05, inner: float = 0.04, length: float = 0.3, wings: float = 0.2) -> np.ndarray:
    """Triangles of a thin rod with a wide plate at each end: its hull stands off the rod."""

    def box(x: float, y: float, low: float, high: float) -> np.ndarray:
        corners = np.array([[a, b, c] for a in (-x, x) for b in (-y, y) for c in (low, high)])
        return corners[ConvexHull(corners).simplices]

    plates = [box(wings, wings, 0.0, 0.02), box(wings, wings, length - 0.02, length)]
    return np.concatenate([box(inner, outer, 0.0, length), *plates])


def test_a_cut_takes_a_hull_back_from_a_hollow():
    triangles = tube()
    hollow = np.array([[0.2, 0.0, 0.15], [0.0, -0.2, 0.12]])
    sides = best_cut(triangles, hollow)
    assert len(sides) == 2
    for side in sides:
        assert to_triangles(side.reshape(-1, 3), triangles).max() < 1e-9
    again = [part for side in sides for part in (best_cut(side, hollow) or [side])]
    planes = [ConvexHull(part.reshape(-1, 3)).equations for part in again]
    beyond = [(hollow @ p[:, :3].T + p[:, 3]).max(axis=1) for p in planes]
    assert np.min(beyond, axis=0).min() > 0.05
    assert best_cut(triangles, np.array([[0.2, 0.2, 0.0]])) == []


def elbow(thick: float = 0.04, long: float = 0.3) -> np.ndarray:
    """Triangles of two boxes that make a right angle, turned so that no side is along an axis of its box."""
    corners = np.array([[x, y, z] for x in (0.0, long) for y in (0.0, thick) for z in (0.0, thick)])
    one = corners[ConvexHull(corners).simplices]
    turn = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    return np.concatenate([one, one @ turn.T + [0.0, 0.0, thick]])


def test_a_cut_at_the_bottom_of_a_hollow_frees_it():
    triangles = elbow()
    hollow = np.array([[0.1, 0.1, 0.02], [0.14, 0.08, 0.02]])
    sides = best_cut(triangles, hollow)
    planes = [ConvexHull(side.reshape(-1, 3)).equations for side in sides]
    beyond = np.min([(hollow @ p[:, :3].T + p[:, 3]).max(axis=1) for p in planes], axis=0)
    assert len(sides) == 2 and beyond.min() > 0.03


@for_all(st.integers(0, 10**6), max_examples=40)
def test_the_nearest_point_of_a_surface_is_as_near_as_no_other_of_its_triangles(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(20, 3))
    triangles = points[ConvexHull(points).simplices]
    point = 3.0 * rng.normal(size=3)
    foot = nearest_on_triangles(point, triangles)
    gap, least = np.linalg.norm(point - foot), to_triangles(point[None], triangles)[0]
    # on an edge it is not exact: a corner stands for it
    assert to_triangles(foot[None], triangles)[0] < 1e-9 and gap >= least - 1e-9
    corners = np.linalg.norm(triangles.reshape(-1, 3) - point, axis=1).min()
    assert gap <= corners + 1e-12


@for_all(st.integers(0, 10**6), max_examples=60)
def test_inside_is_where_all_facets_are_behind(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(12, 3))
    hull = ConvexHull(points)
    triangles = points[hull.simplices]
    for point in rng.normal(size=(20, 3)):
        heights = hull.equations[:, :3] @ point + hull.equations[:, 3]
        if abs(heights.max()) > 1e-6:
            assert is_inside(point, triangles) == (heights.max() < 0.0)


def test_shells_of_a_surface_are_what_shares_no_corner():
    """A hollow box, one that overlaps it, and one that stands apart."""
    box = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    box = box[ConvexHull(box).simplices]
    solids = [box, 0.5 * box, box + np.array([0.7, 0.0, 0.0]), box + np.array([5.0, 0.0, 0.0])]
    surface = np.random.default_rng(0).permutation(np.concatenate(solids))
    shells = shells_of(surface)
    assert sorted(len(shell) for shell in shells) == [12] * 4
    assert {tuple(shell.mean(axis=(0, 1)).round(9)) for shell in shells} == {(0, 0, 0), (0.7, 0, 0), (5, 0, 0)}
    for point, inside in (
        ([0.0] * 3, True),
        ([0.8, 0.0, 0.0], True),
        ([5.0, 0.5, 0.0], True),
        ([3.0, 0.0, 0.0], False),
    ):
        assert any(is_inside(np.array(point), shell) for shell in shells) == inside
    assert not is_inside(np.array([0.8, 0.0, 0.0]), surface)  # twice inside, which a ray cannot tell from outside


def test_a_part_inside_another_touches_it(tmp_path):
    """A knob in the middle of a shell, and beside it; no surface crosses another."""
    shell = f"""<robot name="nest"><link name="base">{BOX.format(z=0, size="0.3 0.3 0.3")}</link><link name="rod"/>
<link name="knob">{BOX.format(z=0, size="0.02 0.02 0.02")}</link>
<joint name="turn" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="out" type="prismatic"><parent link="rod"/><child link="knob"/><axis xyz="1 0 0"/>
<limit lower="0" upper="1" effort="1" velocity="1"/></joint></robot>"""
    path = tmp_path / "nest.urdf"
    path.write_text(shell)
    arm = Arm.from_urdf(path, tcp_frame="knob")
    frames = [Pose.identity(), *joint_frames(arm, np.zeros(2))]
    robot = parts_from_urdf(path, arm, None, PartsRequest({}, False)).robot
    pieces = convex_link_pieces(robot, world_from_parts(robot.parts), frames, 1.02)
    truth = MeshDistances(arm, pieces)
    assert truth.between(("link0", "link2"), np.array([0.0, 0.0])) <= 0.0
    assert truth.between(("link2", "link0"), np.array([0.0, 0.05])) <= 0.0
    assert truth.between(("link0", "link2"), np.array([0.5, 0.145])) <= 0.0
    assert truth.between(("link0", "link2"), np.array([0.0, 0.5])) == pytest.approx(0.34)


def test_a_capsule_found_at_once_contains_the_points():
    for seed in range(20):
        points = np.random.default_rng(seed).normal(size=(40, 3)) * [1.0, 0.3, 0.1]
        ((a, b, radius),) = rough_capsule(points)
        share = np.clip((points - a) @ (b - a) / max((b - a) @ (b - a), 1e-300), 0.0, 1.0)
        assert np.linalg.norm(points - a - share[:, None] * (b - a), axis=1).max() <= radius


@for_all(st.integers(0, 10**6), max_examples=40)
def test_both_sides_of_a_cut_are_the_whole(seed):
    rng = np.random.default_rng(seed)
    triangles = rng.normal(size=(12, 3, 3))
    normal = rng.normal(size=3)
    normal, height = normal / np.linalg.norm(normal), float(rng.normal())
    sides = [cut_off(triangles, sign * normal, sign * height) for sign in (1.0, -1.0)]

    def area(parts: np.ndarray) -> float:
        return 0.5 * float(np.linalg.norm(np.cross(parts[:, 1] - parts[:, 0], parts[:, 2] - parts[:, 0]), axis=1).sum())

    assert area(sides[0]) + area(sides[1]) == pytest.approx(area(triangles))
    assert (sides[0] @ normal).max(initial=-np.inf) <= height + 1e-9
    assert (sides[1] @ normal).min(initial=np.inf) >= height - 1e-9


def test_a_rounded_hull_contains_all_points_with_few_corners():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(4000, 3))
    points *= 0.1 / np.linalg.norm(points, axis=1)[:, None]
    assert len(rounded_hull(points, 1e-5)[0]) == MAX_VERTICES
    corners, rounding = rounded_hull(points, 0.003)
    assert len(corners) < MAX_VERTICES and 0.0 < rounding <= 0.003 + 2e-6
    planes = ConvexHull(corners).equations
    assert (points @ planes[:, :3].T + planes[:, 3]).max() <= rounding
    few, none = rounded_hull(points[:40], 0.001)
    assert len(few) == 40 and none == 0.0


def min_over(rows, points):
    """By how much (n,) points stand off the nearest of some capsules; not above 0 inside."""
    gaps = []
    for row in rows:
        along = np.clip((points - row[1:4]) @ (row[4:7] - row[1:4]) / ((row[4:7] - row[1:4]) ** 2).sum(), 0.0, 1.0)
        gaps.append(np.linalg.norm(points - row[1:4] - along[:, None] * (row[4:7] - row[1:4]), axis=1) - row[7])
    return np.min(gaps, axis=0)


def test_a_body_with_hulls_is_the_same_at_any_base():
    """To the last digit, but for its base: rounding decides where a capsule's optimum is flat."""
    base = Pose.from_position_quaternion([0.3, -0.2, 0.5], [0.5, 0.5, 0.5, 0.5])
    arm = Arm.from_urdf(panda_urdf(), tcp_frame="panda_link8", world_from_base=base)
    body, plain = body_from_urdf(panda_urdf(), arm), panda_with_hulls()
    assert body.names == plain.names and body.pairs == plain.pairs
    moves = plain.rows[:, BODY.frame] >= 0
    np.testing.assert_array_equal(body.rows[moves], plain.rows[moves])
    for row, hull, other in zip(body.rows, body.hulls, plain.hulls, strict=True):
        where = Pose.identity() if row[0] >= 0 else base
        np.testing.assert_allclose(hull.corners, moved(where, other.corners), rtol=0.0, atol=1e-12)
    for hull in {id(hull): hull for hull in body.hulls}.values():
        mine = [row for row, each in zip(body.rows, body.hulls, strict=True) if each is hull]
        assert min_over(mine, hull.corners).max() + hull.rounding <= 1e-12
    g, h = (robot_arrays((a,), (b,), pack(()), pairs=b.pairs) for a, b in ((arm, body), (panda(), plain)))
    for q in np.random.default_rng(0).uniform(arm.lower, arm.upper, (50, 7)):
        assert slack_at(g, q, 0.0, 1.0) == pytest.approx(slack_at(h, q, 0.0, 1.0), abs=1e-9)


@pytest.mark.parametrize("post", [3.0, 7.0])
def test_a_contact_at_the_far_end_of_a_rail_is_found(post, tmp_path):
    """A slide's range is a length: it has no turns."""
    box = '<box size="0.1 0.1 0.4"/>'
    place = f'<origin xyz="{post} 0.35 0.5"/>'
    base = f'<link name="base"><collision>{place}<geometry>{box}</geometry></collision></link>'
    limit = '<limit lower="0" upper="8" effort="1" velocity="1"/>'
    rail = joint("rail", "base", "car", "prismatic", axis="1 0 0", xyz="0 0 0.5", more=limit)
    arm_link = '<link name="arm"><collision><origin xyz="0.2 0 0"/><geometry><box size="0.4 0.05 0.05"/></geometry>'
    parts = (base, link("car", box), f"{arm_link}</collision></link>", rail, joint("turn", "car", "arm"))
    path = written(tmp_path, *parts)
    body = body_from_urdf(path, Arm.from_urdf(path, tcp_frame="arm"))
    assert {(body.names[i], body.names[j]) for i, j in body.pairs} == {("link0", "link2")}


def test_what_always_sweeps_through_another_part_is_said(tmp_path):
    """A second arm on the first joint, free to turn all around, and held."""
    parts = [link(name, '<box size="0.06 0.06 0.06"/>') for name in ("base", "one", "two", "three")]
    places = (("base", "one", "0 0 0.1"), ("one", "two", "0 0 0.2"), ("two", "three", "0 0 0.3"))
    parts += [joint(f"to_{b}", a, b, axis="0 1 0", xyz=place) for a, b, place in places]
    parts += [link("other", '<box size="1.6 0.05 1.6"/>'), joint("free", "one", "other", "continuous", xyz="0 0.5 0")]
    path = written(tmp_path, *parts)
    arm = Arm.from_urdf(path, tcp_frame="three")
    with pytest.warns(ModelWarning, match="link1: joints that are not the arm's sweep what hangs on it through"):
        body_from_urdf(path, arm)
    with warnings.catch_warnings():
        warnings.simplefilter("error", ModelWarning)
        body_from_urdf(path, arm, locked={"free": 0.0})
