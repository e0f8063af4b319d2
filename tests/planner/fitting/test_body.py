"""Capsules contain what they stand for, hug it, and move with the arm; bad models and shapes are refused."""

from __future__ import annotations

import itertools
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import mujoco
import numpy as np
import pytest
from helpers.arms import panda, panda_urdf
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from onedemo.planner.errors import BadModel, BadShape, NotFinite, OneDemoError, UnfitShape, UnknownName
from onedemo.planner.fitting.body_readers import body_from_mujoco, body_from_urdf
from onedemo.planner.fitting.finger_sweeps import sweep
from onedemo.planner.geometry.capsule_cover import covering_capsules, fitted_capsules, strips
from onedemo.planner.geometry.hulls import capsule_volume, sticks_out, union_volume
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import Box, Capsule, Cylinder, Mesh, Sphere
from onedemo.planner.models.model_joints import SLIDES, TURNS, ModelJoint
from onedemo.planner.robot.arm import Arm
from onedemo.planner.robot.body import Body, last_from_tcp
from onedemo.planner.robot.joint_frames import joint_frames
from onedemo.planner.robot.resting_pairs import resting_pairs, segment_distance

BLOCK, BOOK = Box((0.06, 0.04, 0.05)), Box((0.16, 0.22, 0.035))
WEDGE = Mesh.hull_of(np.array([[0, 0, 0], [0.2, 0, 0], [0, 0.1, 0], [0, 0, 0.05], [0.2, 0.1, 0.02]]))
BLOB = Mesh.hull_of(np.random.default_rng(3).normal(size=(60, 3)) * [0.08, 0.03, 0.015])
SOLIDS = {
    "ball": Sphere(0.03),
    "capsule": Capsule(0.02, 0.1),
    "block": BLOCK,
    "book": BOOK,
    "rod": Box((0.02, 0.02, 0.4)),
    "can": Cylinder(0.033, 0.12),
    "plate": Cylinder(0.1, 0.02),
    "wedge": WEDGE,
    "blob": BLOB,
}
each_solid = pytest.mark.parametrize("solid", SOLIDS.values(), ids=list(SOLIDS))


def depth(cover, points: np.ndarray) -> np.ndarray:
    """(n,) how far points lie inside a union of capsules [m]; negative outside."""
    best = np.full(len(points), -np.inf)
    for a, b, radius in cover:
        along = b - a
        share = np.clip((points - a) @ along / max(along @ along, 1e-300), 0, 1)
        best = np.maximum(best, radius - np.linalg.norm(points - a - share[:, None] * along, axis=1))
    return best


def inside_hull(corners: np.ndarray, rng, count: int) -> np.ndarray:
    """Random points (n, 3) of a hull: sparse mixtures of corners, so that many lie on edges and facets."""
    picked = corners[rng.integers(len(corners), size=(count, 4))]
    weights = rng.dirichlet([0.4] * 4, size=count)
    return np.vstack([corners, np.einsum("nk,nkd->nd", weights, picked)])


def points_of(shape, rng, count: int = 4000) -> np.ndarray:
    """Random points (n, 3) of a shape, its surface included."""
    if isinstance(shape, Box):
        return inside_hull(0.5 * np.array(list(itertools.product((-1, 1), repeat=3))) * shape.size, rng, count)
    if isinstance(shape, Mesh):
        return inside_hull(shape.vertices, rng, count)
    turn = rng.normal(size=(count, 3))
    unit = turn / np.linalg.norm(turn, axis=1)[:, None] * rng.choice([1.0, 0.7], (count, 1))
    if isinstance(shape, Sphere):
        return shape.radius * unit
    heights = 0.5 * shape.length * rng.choice([-1.0, 1.0, 0.3, -0.8], count)[:, None] * [[0, 0, 1]]
    if isinstance(shape, Capsule):
        return heights + shape.radius * unit
    flat = turn[:, :2] / np.linalg.norm(turn[:, :2], axis=1)[:, None] * rng.choice([1.0, 0.6], (count, 1))
    return heights + shape.radius * np.column_stack([flat, np.zeros(count)])


@each_solid
def test_the_union_contains_the_shape(solid):
    assert depth(covering_capsules(solid), points_of(solid, np.random.default_rng(0))).min() >= -1e-12


@each_solid
def test_a_smaller_union_would_not(solid):
    """The sampling can see a hole of a tenth of a radius."""
    cover = [(a, b, 0.9 * radius) for a, b, radius in covering_capsules(solid)]
    assert depth(cover, points_of(solid, np.random.default_rng(0))).min() < 0


def test_balls_and_capsules_are_covered_by_themselves():
    ((a, b, radius),) = covering_capsules(Sphere(0.03))
    assert radius == 0.03 and not a.any() and not b.any()
    ((a, b, radius),) = covering_capsules(Capsule(0.02, 0.1))
    assert radius == 0.02 and np.allclose(b - a, [0, 0, 0.1], rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    "solid, most, out",
    [
        (BLOCK, 3, 0.015),
        (Box((0.04, 0.04, 0.04)), 2, 0.015),
        (BOOK, 6, 0.015),
        (SOLIDS["rod"], 1, 0.015),
        (SOLIDS["can"], 1, 0.015),
    ],
)
def test_few_capsules_stick_out_little(solid, most, out):
    cover = covering_capsules(solid, 0.01)
    points = points_of(solid, np.random.default_rng(1))
    assert len(cover) <= most and sticks_out(cover, points) < out + 2e-4


def test_a_tighter_cover_takes_more_capsules():
    loose, tight = covering_capsules(BOOK, 0.02), covering_capsules(BOOK, 0.008)
    corners = points_of(BOOK, np.random.default_rng(0))
    assert len(loose) < len(tight) <= 8 and sticks_out(tight, corners) < sticks_out(loose, corners)


def test_a_book_is_covered_by_parallel_strips():
    directions = [(b - a) / np.linalg.norm(b - a) for a, b, _ in covering_capsules(BOOK)]
    assert all(np.allclose(np.abs(direction), [0, 1, 0], atol=1e-9) for direction in directions)


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("solid", [WEDGE, BLOB])
def test_fitted_capsules_contain_the_hull(solid, count):
    """The pieces' cross-sections too: a union that holds only the corners would leave holes at the cuts."""
    cover = fitted_capsules(solid.vertices, count)
    assert len(cover) == count
    assert depth(cover, points_of(solid, np.random.default_rng(2), 20000)).min() >= -1e-12


def test_a_long_hull_is_fitted_tightly_and_the_fit_moves_with_it():
    rng = np.random.default_rng(4)
    unit = rng.normal(size=(400, 3))
    unit /= np.linalg.norm(unit, axis=1)[:, None]
    points = 0.05 * unit + np.outer(rng.choice([-0.1, 0.1], 400), [0, 0, 1])
    turn = Pose.from_position_quaternion([1, 2, 3], np.array([0.5, 0.1, -0.7, 0.5]))
    moved = points @ turn.rotation.T + turn.position
    for cloud in (points, moved):
        ((a, b, radius),) = fitted_capsules(cloud, 1)
        assert 0.0495 < radius < 0.0505 and 0.19 < np.linalg.norm(b - a) < 0.201


def test_volumes_and_overhang_are_measured():
    ball = [(np.zeros(3), np.zeros(3), 0.1)]
    pill = (np.zeros(3), np.array([0, 0, 0.2]), 0.1)
    exact = np.pi * 0.01 * (0.2 + 0.4 / 3)
    assert capsule_volume(pill) == pytest.approx(exact) and union_volume([pill]) == pytest.approx(exact, rel=0.02)
    assert union_volume([pill, *ball]) == pytest.approx(exact, rel=0.02)
    assert sticks_out(ball, 0.05 * points_of(Box((2, 2, 2)), np.random.default_rng(0))) == pytest.approx(0.05, rel=0.02)


def test_points_that_make_no_hull_are_refused():
    with pytest.raises(UnfitShape, match="no volume"):
        fitted_capsules(np.zeros((5, 3)), 1)
    with pytest.raises(BadShape):
        fitted_capsules(np.zeros((5, 2)), 1)
    with pytest.raises(NotFinite):
        strips(np.full((5, 3), np.nan), 0.01)
    with pytest.raises(UnfitShape, match="count"):
        fitted_capsules(WEDGE.vertices, 4)
    for excess in (0.0, -0.01, np.nan):
        with pytest.raises(UnfitShape, match="excess"):
            covering_capsules(BLOCK, excess)


@cache
def robot() -> tuple[mujoco.MjModel, Arm, Body]:
    pytest.importorskip("robosuite")
    from onedemo.envs import ROBOTS
    from onedemo.envs.scene.scene import compiled_scene

    scene = compiled_scene(ROBOTS["Panda"])
    arm = scene.arms[0].arm
    return scene.model, arm, body_from_mujoco(scene.model, arm, arm.joint_names)


def placed_cover(arm: Arm, body: Body, q: np.ndarray, frames) -> list:
    """Capsules of some frames in the world, each (a, b, radius), at joint positions q."""
    poses = [Pose.identity(), *joint_frames(arm, q)]
    cover = []
    for row in body.rows[np.isin(body.rows[:, 0], list(frames))]:
        pose = poses[int(row[0]) + 1]
        cover.append((pose.rotation @ row[1:4] + pose.position, pose.rotation @ row[4:7] + pose.position, row[7]))
    return cover


def collision_points(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> np.ndarray:
    """World points (n, 3) of a body's collision meshes and boxes, where MuJoCo's kinematics put them."""
    found = [np.zeros((0, 3))]
    for geom in np.flatnonzero((model.geom_bodyid == body) & ((model.geom_contype | model.geom_conaffinity) > 0)):
        if model.geom_type[geom] == int(mujoco.mjtGeom.mjGEOM_MESH):
            first, mesh = model.mesh_vertadr[model.geom_dataid[geom]], model.geom_dataid[geom]
            local = model.mesh_vert[first : first + model.mesh_vertnum[mesh]].astype(float)
        else:
            assert model.geom_type[geom] == int(mujoco.mjtGeom.mjGEOM_BOX)
            local = np.array(list(itertools.product((-1, 1), repeat=3))) * model.geom_size[geom]
        found.append(local @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])
    return np.vstack(found)


def test_every_vertex_of_the_panda_lies_in_a_capsule_of_its_link():
    model, arm, body = robot()
    data, rng = mujoco.MjData(model), np.random.default_rng(5)
    joints = [model.joint(name).id for name in arm.joint_names]
    fingers = [joint for joint in range(model.njnt) if "finger" in model.joint(joint).name]
    carried = {k: k - 6 for k in range(5, 13)} | {k: 6 for k in range(13, 20)}
    assert model.body(5).name == "robot0_link0" and model.body(12).name == "robot0_link7" and len(fingers) == 2
    low, high = model.jnt_range[fingers].T
    for k in range(200):
        q = rng.uniform(arm.lower, arm.upper)
        data.qpos[model.jnt_qposadr[joints]] = q
        reach = rng.uniform(size=2) if k > 3 else np.array([k % 2, k // 2])
        data.qpos[model.jnt_qposadr[fingers]] = low + reach * (high - low)
        mujoco.mj_kinematics(model, data)
        for frame in range(-1, 7):
            cover = placed_cover(arm, body, q, [frame]) if k % 10 == 0 or frame >= 5 else []
            for index in (index for index, carrier in carried.items() if carrier == frame and cover):
                # 6260 vertices are many
                points = collision_points(model, data, index)[:: 50 if index == 6 and k else 1]
                if len(points):
                    assert depth(cover, points).min() > -1e-6, model.body(index).name
    # the fingers have capsules of their own, and need them
    hand = [row for row, name in zip(body.rows, body.names, strict=True) if name == "hand"]
    tip = np.array([0, 0, 0.2])
    assert depth([(row[1:4], row[4:7], row[7]) for row in hand], tip[None])[0] < 0


def test_the_pandas_capsules_hug_it():
    _, _, body = robot()
    assert 12 <= len(body) <= 16 and set(body.names) == {*(f"link{k}" for k in range(8)), "hand", "fingers"}
    assert body.rows[:, 7].max() < 0.11 and body.rows[body.rows[:, 0] > 0, 7].max() < 0.08
    fingers = body.rows[np.array(body.names) == "fingers"]
    assert fingers[:, 7].max() < 0.022 and 2 <= len(fingers) <= 4
    volumes = [capsule_volume((row[1:4], row[4:7], row[7])) for row in body.rows]
    # the sum of the links' hulls, the hand and the swept fingers: 20 litres
    assert sum(volumes) < 1.9 * hull_volume()


def hull_volume() -> float:
    model, _, _ = robot()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    clouds = [collision_points(model, data, body) for body in range(5, 20)]
    return sum(ConvexHull(cloud).volume for cloud in clouds if len(cloud))


def test_urdf_and_mujoco_agree_on_the_panda():
    """Both describe the same meshes (link 1's has more vertices in MuJoCo); frames agree up to the base."""
    _, _, ours = robot()
    folder = Path(find_spec("robosuite").origin).parent / "models/assets/bullet_data/panda_description/urdf"
    urdf = folder / "panda_arm.urdf"
    body = body_from_urdf(urdf, Arm.from_urdf(urdf, tcp_frame="panda_link8"))
    links = [k for k, name in enumerate(ours.names) if name.startswith("link") and name not in ("link0", "link1")]
    theirs = [k for k, name in enumerate(body.names) if name not in ("link0", "link1")]
    assert [ours.names[k] for k in links] == [body.names[k] for k in theirs]
    assert np.allclose(ours.rows[links, 7], body.rows[theirs, 7], atol=1e-3)
    ends = [np.sort(rows[:, [1, 4]], axis=1) for rows in (ours.rows[links], body.rows[theirs])]
    assert np.allclose(*ends, atol=3e-3)


def test_a_urdf_arm_may_stand_anywhere():
    base = Pose.from_position_quaternion([1.0, -2.0, 0.5], [0.5, 0.5, -0.5, 0.5])
    arm = Arm.from_urdf(panda_urdf(), tcp_frame="panda_link8", world_from_base=base)
    body, plain = body_from_urdf(panda_urdf(), arm, split=1), body_from_urdf(panda_urdf(), panda(), split=1)
    # a cylinder has many capsules of nearly the same volume, between which rounding decides
    assert np.allclose(body.rows[1:], plain.rows[1:], atol=2e-4)
    for first in (1, 4):
        end = plain.rows[0, first : first + 3]
        assert np.allclose(body.rows[0, first : first + 3], base.rotation @ end + base.position, atol=2e-4)


MJCF = """<mujoco><compiler angle="radian" autolimits="true"/><worldbody>
  <body name="base"><geom type="sphere" size="0.05"/><body name="pedestal"><geom type="box" size="1 1 1"/></body>
  <body name="one" pos="0 0 0.1"><joint name="turn" axis="0.6 0 0.8" range="-2 2" ref="0.4"/>
    <geom type="capsule" size="0.04" fromto="0 0 0 0.2 0 0.1"/>
    <body name="two" pos="0.3 0 0" euler="0.3 0 0">
      <joint name="slide" type="slide" axis="0 1 0" range="-0.1 0.2" ref="0.1"/>
      <geom type="cylinder" size="0.03 0.06"/><site name="tool" pos="0 0 0.1"/>
      <geom type="ellipsoid" size="0.02 0.03 0.08" pos="0.05 0 0" euler="0.4 0 0"/>
      <body name="palm" pos="0 0 0.1"><geom type="box" size="0.02 0.04 0.01"/>
        <body name="finger" pos="0 0.03 0"><joint name="curl" axis="1 0 0" range="-0.5 1.2" ref="0.3"/>
          <geom type="box" size="0.01 0.01 0.03" pos="0 0 0.04"/>
          <body name="tip" pos="0 0 0.07"><joint name="stretch" type="slide" axis="0 0 1" range="0 0.05" ref="0.02"/>
            <geom type="sphere" size="0.012"/></body></body></body></body></body></body>
  <body name="elsewhere"><freejoint/><geom size="0.3"/></body>
</worldbody></mujoco>"""


def small_arm(xml: str = MJCF, names=("turn", "slide")) -> tuple[mujoco.MjModel, Arm]:
    model = mujoco.MjModel.from_xml_string(xml)
    return model, Arm.from_mujoco(model, names, site="tool", velocity_limits=1.0, name="small")


def surface(model, data, geom: int, rng) -> np.ndarray:
    """Random world points of a geom."""
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    local = {
        int(mujoco.mjtGeom.mjGEOM_SPHERE): lambda: points_of(Sphere(size[0]), rng, 200),
        int(mujoco.mjtGeom.mjGEOM_CAPSULE): lambda: points_of(Capsule(size[0], 2 * size[1]), rng, 200),
        int(mujoco.mjtGeom.mjGEOM_CYLINDER): lambda: points_of(Cylinder(size[0], 2 * size[1]), rng, 200),
        int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): lambda: points_of(Sphere(1.0), rng, 200) * size,
        int(mujoco.mjtGeom.mjGEOM_BOX): lambda: points_of(Box(tuple(2 * size)), rng, 200),
    }[kind]()
    return local @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]


def test_every_kind_of_geom_and_joint_is_covered():
    """Joints with a reference, turning and sliding fingers that hang on one another, and no stray bodies."""
    model, arm = small_arm()
    body = body_from_mujoco(model, arm, ("turn", "slide"))
    assert set(body.names) == {"link0", "link1", "link2", "hand", "fingers"}
    assert np.allclose(body.rows[1, 7], 0.04) and len(body) < 16
    data, rng = mujoco.MjData(model), np.random.default_rng(6)
    frames = {"base": -1, "one": 0, "two": 1, "palm": 1, "finger": 1, "tip": 1}
    for _ in range(100):
        q = rng.uniform(model.jnt_range[:4, 0], model.jnt_range[:4, 1])
        data.qpos[:4] = q
        mujoco.mj_kinematics(model, data)
        for geom in range(model.ngeom):
            name = model.body(model.geom_bodyid[geom]).name
            if name in frames:
                cover = placed_cover(arm, body, q[:2], [frames[name]])
                assert depth(cover, surface(model, data, geom, rng)).min() > -1e-9, name


def test_the_split_can_be_chosen():
    model, arm = small_arm()
    body = body_from_mujoco(model, arm, arm.joint_names, split=1, exact=False)
    assert body.names == ("link0", "link1", "link2", "hand", "fingers")
    body = body_from_mujoco(model, arm, arm.joint_names, split={"link2": 3, "hand": 1, "fingers": 2}, exact=False)
    assert body.names == ("link0", "link1", *["link2"] * 3, "hand", *["fingers"] * 2)
    with pytest.raises(UnknownName, match=r"link9.*link2"):
        body_from_mujoco(model, arm, arm.joint_names, split={"link9": 2})


@pytest.mark.parametrize(
    "kind, low, high", [(TURNS, -0.4, 1.9), (TURNS, -np.inf, np.inf), (TURNS, 1.0, 1.1), (SLIDES, -0.1, 0.3)]
)
@pytest.mark.parametrize("rest", [0.0, 0.2])
def test_a_sweep_contains_every_position_and_no_more(kind, low, high, rest):
    rng = np.random.default_rng(10)
    axis, foot, points = np.array([0.48, 0.6, 0.64]), np.array([0.1, -0.2, 0.3]), rng.normal(size=(6, 3))
    finger = ModelJoint("finger", kind, axis, foot, low + rest, high + rest, rest)
    hull = ConvexHull(sweep(finger, points, "robot", "finger"))
    first, last = max(low, -np.pi), min(high, np.pi)
    reached = []
    for value in np.linspace(first, last, 2001):
        turn = Rotation.from_rotvec(value * axis).as_matrix()
        reached.append(foot + (points - foot) @ turn.T if kind == TURNS else points + value * axis)
    reached = np.vstack(reached)
    assert (reached @ hull.equations[:, :3].T + hull.equations[:, 3]).max() < 1e-9
    # a polygon of steps of 15 degrees is at most 0.9 % wider than its arc
    assert hull.volume < 1.02 * ConvexHull(reached).volume


@pytest.mark.parametrize(
    "old, new, says",
    [
        ('name="curl" axis="1 0 0" range="-0.5 1.2" ref="0.3"', 'name="curl" type="ball"', "finger.*neither"),
        ('type="slide" axis="0 0 1" range="0 0.05" ref="0.02"', 'type="slide" axis="0 0 1" ref="0.02"', "tip.*limits"),
    ],
)
def test_fingers_that_cannot_be_swept_are_refused(old, new, says):
    model, arm = small_arm(MJCF.replace(old, new))
    with pytest.raises(BadModel, match=says):
        body_from_mujoco(model, arm, ("turn", "slide"))


def test_another_arm_is_refused():
    model, arm = small_arm()
    other, _ = small_arm(MJCF.replace('pos="0.3 0 0"', 'pos="0.3 0.01 0"').replace('axis="0 1 0"', 'axis="0 0.9 0.1"'))
    with pytest.raises(BadModel, match=r"slide.*not the same"):
        body_from_mujoco(other, arm, ("turn", "slide"))
    for names in (("turn",), ("slide", "turn"), ("turn", "no such"), ()):
        with pytest.raises(BadModel):
            body_from_mujoco(model, arm, names)


def urdf_file(tmp_path, collisions: dict[str, str]):
    def link(name: str) -> str:
        form = collisions.get(name)
        inside = f'<collision><origin xyz="0.01 0 0.02" rpy="0.3 0 0"/><geometry>{form}</geometry></collision>'
        return f'<link name="{name}">{inside if form else ""}</link>'

    text = f"""<robot name="r">{"".join(map(link, ("base", "one", "two", "palm", "finger")))}
    <joint name="spin" type="revolute"><parent link="base"/><child link="one"/><origin xyz="0 0 0.1" rpy="0 1 0"/>
    <axis xyz="0.6 0 -0.8"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
    <joint name="lift" type="prismatic"><parent link="one"/><child link="two"/><origin xyz="0.2 0 0"/>
    <axis xyz="0 1 0"/><limit lower="0" upper="0.3" effort="1" velocity="1"/></joint>
    <joint name="weld" type="fixed"><parent link="two"/><child link="palm"/>
    <origin xyz="0 0 0.1" rpy="0 0 0.4"/></joint>
    <joint name="grip" type="prismatic"><parent link="palm"/><child link="finger"/><origin xyz="0 0 0.05"/>
    <axis xyz="1 0 0"/><limit lower="-0.02" upper="0.06" effort="1" velocity="1"/></joint></robot>"""
    path = tmp_path / "r.urdf"
    path.write_text(text)
    return path, Arm.from_urdf(path, tcp_frame="palm")


def test_a_urdf_of_primitives_is_covered(tmp_path):
    forms = {
        "base": '<cylinder radius="0.05" length="0.1"/>',
        "one": '<box size="0.2 0.05 0.04"/>',
        "two": '<sphere radius="0.04"/>',
        "palm": '<box size="0.03 0.08 0.04"/>',
        "finger": '<box size="0.01 0.02 0.05"/>',
    }
    path, arm = urdf_file(tmp_path, forms)
    body = body_from_urdf(path, arm, split=1)
    assert body.names == ("link0", "link1", "link2", "hand", "fingers") and list(body.rows[:, 0]) == [-1, 0, 1, 1, 1]
    assert body.rows[2, 7] == 0.04 and np.allclose(body.rows[2, 1:4], body.rows[2, 4:7])
    tilt = Pose.from_position_quaternion([0.01, 0, 0.02], [np.cos(0.15), np.sin(0.15), 0, 0])
    world_from_palm = arm.fk([0.4, 0.2])
    rng = np.random.default_rng(7)
    finger = points_of(Box((0.01, 0.02, 0.05)), rng) @ tilt.rotation.T + tilt.position
    for shift in (-0.02, 0.03, 0.06):
        points = (finger + np.array([shift, 0, 0.05])) @ world_from_palm.rotation.T + world_from_palm.position
        assert depth(placed_cover(arm, body, np.array([0.4, 0.2]), [1])[-1:], points).min() > -1e-9


def test_a_urdf_without_geometry_says_so(tmp_path):
    path, arm = urdf_file(tmp_path, {})
    with pytest.raises(BadModel, match="no link has a <collision>"):
        body_from_urdf(path, arm)
    path, arm = urdf_file(tmp_path, {"one": '<mesh filename="package://nowhere/no.stl"/>'})
    with pytest.raises(BadModel, match=r"no\.stl") as caught:
        body_from_urdf(path, arm)
    assert "\n" not in str(caught.value)
    with pytest.raises(BadModel, match="no such file"):
        body_from_urdf(tmp_path / "none.urdf", arm)
    with pytest.raises(BadModel, match="chain"):
        body_from_urdf(urdf_file(tmp_path, {"one": '<box size="1 1 1"/>'})[0], panda())


def test_resting_pairs_are_neighbors_and_what_overlaps():
    _, arm, body = robot()
    pairs = resting_pairs(arm, body)
    checked = set(itertools.combinations(range(len(body)), 2)) - set(pairs)
    names = {(body.names[i], body.names[j]) for i, j in checked}
    assert len(set(pairs)) == len(pairs) and all(i < j for i, j in pairs)
    assert ("link0", "hand") in names and ("link1", "link4") in names and ("link5", "link6") not in names
    # three balls on one arm, of which the outer two overlap only if they are large
    small = Body(np.array([[-1, 0, 0, 0, 0, 0, 0, 0.01], [6, 0, 0, 0, 0, 0, 0, 0.01]]), ("a", "b"))
    large = Body(np.array([[-1, 0, 0, 0, 0, 0, 0, 5.0], [6, 0, 0, 0, 0, 0, 0, 0.01]]), ("a", "b"))
    assert resting_pairs(arm, small) == [] and resting_pairs(arm, large) == [(0, 1)]


def test_segment_distances_against_sampling():
    rng = np.random.default_rng(8)
    s = np.linspace(0, 1, 201)[:, None]
    for k in range(100):
        a, b, c, d = rng.normal(size=(4, 3))
        if k % 4 == 0:
            d = c + (b - a)  # parallel
        if k % 7 == 0:
            d = c  # a point
        gaps = np.linalg.norm((a + s * (b - a))[:, None] - (c + s * (d - c))[None], axis=2)
        assert gaps.min() - 0.03 < segment_distance(a, b, c, d) <= gaps.min() + 1e-12


def test_a_held_object_moves_with_the_hand():
    _, arm, body = robot()
    tcp_from_block = Pose.from_position_quaternion([0.0, 0.01, 0.02], [0.8, 0.0, 0.6, 0.0])
    full = body.holding("block", BLOCK, tcp_from_block, arm)
    assert full.held == ("block",) and full.names[: len(body)] == body.names
    rows = full.rows[len(body) :]
    q = np.random.default_rng(9).uniform(arm.lower, arm.upper)
    world_from_block = arm.fk(q) @ tcp_from_block
    points = points_of(BLOCK, np.random.default_rng(0)) @ world_from_block.rotation.T + world_from_block.position
    assert depth(placed_cover(arm, Body(rows, ("x",) * len(rows)), q, [6]), points).min() > -1e-9
    empty = full.released()
    assert np.array_equal(empty.rows, body.rows) and empty.names == body.names and empty.held == ()
    with pytest.raises(UnknownName):
        full.holding("block", BLOCK, tcp_from_block, arm)


def test_the_tool_is_what_moves_with_the_tcp():
    _, arm, body = robot()
    tool = body.tool(arm)
    last = body.rows[body.rows[:, 0] == arm.dof - 1]
    assert tool.shape == (len(last), 7) and np.array_equal(tool[:, 6], last[:, 7])
    back = last_from_tcp(arm)
    assert np.allclose(tool[:, :3] @ back.rotation.T + back.position, last[:, 1:4], atol=1e-12)
    assert np.allclose(tool[:, 3:6] @ back.rotation.T + back.position, last[:, 4:7], atol=1e-12)


GOOD = np.array([[0, 0, 0, 0, 0, 0, 0.1, 0.05]])


@pytest.mark.parametrize(
    "column, value", [(7, -0.1), (7, 0.0), (7, np.nan), (3, np.nan), (4, np.inf), (1, 1e3), (0, -2.0), (0, 0.5)]
)
def test_absurd_capsules_are_refused(column, value):
    assert len(Body(GOOD, ("a",))) == 1
    rows = GOOD.copy()
    rows[0, column] = value
    with pytest.raises(OneDemoError) as caught:
        Body(rows, ("a",))
    assert isinstance(caught.value, BadModel | NotFinite) and "\n" not in str(caught.value)


def test_rows_of_the_wrong_shape_are_refused():
    for rows, names in ((GOOD[:, :7], ("a",)), (GOOD, ("a", "b")), (GOOD[0], ("a",))):
        with pytest.raises(BadShape):
            Body(rows, names)
    with pytest.raises(BadModel, match="65"):
        Body(np.repeat(GOOD, 65, axis=0), ("a",) * 65)
    with pytest.raises(ValueError, match="read-only"):
        Body(GOOD, ("a",)).rows[0, 0] = 1
