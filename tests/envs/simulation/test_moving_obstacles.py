"""Obstacles: where they are put, how they move, that they are solid, and what is told of them."""

from __future__ import annotations

from functools import cache
from itertools import product

import fcl
import gymnasium as gym
import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.baselines.programs.world_model import obstacles_in
from onedemo.envs import ROBOTS
from onedemo.envs.core.obstacle_placement import FASTEST, LARGEST, SMALLEST
from onedemo.envs.core.placement_context import NEAR, START_CLEARANCE, PlacementContext, PlacementMotion
from onedemo.envs.scene.body_clearance import capsule_ends
from onedemo.envs.scene.robot_bodies import robot_body
from onedemo.envs.scene.scene import ARM, FINGERS, compiled_scene
from onedemo.envs.simulation.moving_obstacles import CLEARANCE, ScheduledObstacle
from onedemo.planner.errors import OneDemoError
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import Box, Capsule, Obstacle, Sphere, pack

SHAPES = [Sphere(0.04), Box((0.05, 0.08, 0.1)), Capsule(0.03, 0.05)]
IDLE = np.zeros(8)
each_shape = pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)


@pytest.fixture(scope="module")
def env():
    made = gym.make("onedemo/Stack-v0").unwrapped
    yield made
    made.close()


def started(env, *intruders, **options):
    return env.reset(seed=0, options={"level": "L0", "obstacles": list(intruders), **options})


def brute_distance(env):
    """Smallest distance of all solid geoms of the robot to the obstacles that are there [m]."""
    sim = env.sim
    model = sim.model
    solid = ((model.geom_contype != 0) | (model.geom_conaffinity != 0)) & np.isin(sim.scene.owner, (ARM, FINGERS))
    slots = np.flatnonzero(sim.obstacles.active)
    pairs = [(int(geom), int(sim.scene.obstacles[slot, 1])) for geom in np.flatnonzero(solid) for slot in slots]
    return min(fcl_distance(sim, *pair) for pair in pairs)


def fcl_distance(sim, *geoms):
    """Distance of two geoms by python-fcl [m]; meshes by their hulls, as MuJoCo takes them."""
    bodies = []
    for geom in geoms:
        x, y, z = sim.model.geom_size[geom]
        made = {
            mujoco.mjtGeom.mjGEOM_MESH: lambda geom=geom: fcl_hull(sim, geom),
            mujoco.mjtGeom.mjGEOM_BOX: lambda x=x, y=y, z=z: fcl.Box(2 * x, 2 * y, 2 * z),
            mujoco.mjtGeom.mjGEOM_SPHERE: lambda x=x: fcl.Sphere(x),
            mujoco.mjtGeom.mjGEOM_CAPSULE: lambda x=x, y=y: fcl.Capsule(x, 2 * y),
        }[sim.model.geom_type[geom]]()
        rotation = sim.data.geom_xmat[geom].reshape(3, 3)
        bodies.append(fcl.CollisionObject(made, fcl.Transform(rotation, sim.data.geom_xpos[geom])))
    return fcl.distance(*bodies, fcl.DistanceRequest(), fcl.DistanceResult())


@cache
def fcl_hull(sim, geom):
    model = sim.model
    mesh = model.geom_dataid[geom]
    points = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]].astype(float)
    hull = ConvexHull(points)
    rows = np.searchsorted(hull.vertices, hull.simplices)
    solid = fcl.BVHModel()
    solid.beginModel(len(hull.vertices), len(rows))
    solid.addSubModel(points[hull.vertices], rows)
    solid.endModel()
    return solid


def core_points(shape):
    """Corners (n, 3) of what is left of a shape without its rounding [m]."""
    if isinstance(shape, Box):
        return 0.5 * np.array(list(product((-1, 1), repeat=3))) * shape.size
    half = 0.5 * getattr(shape, "length", 0.0)
    return np.array([[0, 0, -half], [0, 0, half]])


@given(st.integers(0, 2**31))
@settings(max_examples=50, deadline=None)
def test_the_velocity_is_the_derivative_of_the_place_and_never_faster_than_its_peak(seed):
    rng = np.random.default_rng(seed)
    long, short = rng.normal(size=3), np.zeros(3)
    short = 0.2 * np.cross(long, rng.normal(size=3))
    each = ScheduledObstacle(
        Sphere(0.1), (0, 0, 1), long=tuple(long), short=tuple(short), frequency=rng.uniform(0.1, 3)
    )
    peak = each.frequency * max(np.linalg.norm(long), np.linalg.norm(short))
    for time in rng.uniform(0, 20, 10):
        slope = (each.position(time + 1e-5) - each.position(time - 1e-5)) / 2e-5
        np.testing.assert_allclose(each.velocity(time), slope, atol=1e-7 * (1 + peak))
        assert np.linalg.norm(each.velocity(time)) <= peak * (1 + 1e-12)


@each_shape
def test_an_obstacle_is_as_large_in_the_physics_as_it_is_said_to_be(env, shape):
    """MuJoCo's contacts begin where the surface of the shape is: its bounds were changed at run time too."""
    turned = Pose.from_position_quaternion([0, 0, 0], [0.8, 0.2, -0.4, 0.4])
    for gap, touches in ((0.001, False), (-0.001, True)):
        lowest = (core_points(shape) @ turned.rotation.T)[:, 2].min() - getattr(shape, "radius", 0.0)
        # its lowest point is put above or below the top of a block
        block = np.array(env.reset(seed=0, options={"level": "L0", "obstacles": "none"})[0]["object_pose"][0])
        center = (block[0], block[1], block[2] + 0.025 + gap - lowest)
        started(env, ScheduledObstacle(shape, center, tuple(turned.quaternion)))
        *_, info = env.step(IDLE)
        assert (info["n_contacts"] > 0) == touches


def test_an_arm_does_not_get_through_and_it_counts_as_a_contact(env):
    observation, _ = started(env)
    tcp = observation["tcp_pose"][0]
    wall = ScheduledObstacle(Box((0.02, 0.6, 0.5)), (tcp[0] + 0.15, tcp[1], tcp[2]))
    driven = gym.make("onedemo/Stack-v0", control_mode="ee_twist").unwrapped
    reached = {}
    for there, options in ((False, []), (True, [wall])):
        driven.reset(seed=0, options={"level": "L0", "obstacles": options})
        for _ in range(60):
            observation, *_, info = driven.step(np.array([1.0, 0, 0, 0, 0, 0, 0]))
        reached[there] = observation["tcp_pose"][0, 0], info
    assert reached[False][0] - tcp[0] > 0.2
    assert reached[True][0] - tcp[0] < 0.17
    info = reached[True][1]
    assert info["n_contacts"] > 5 and not info["safe"] and "obstacle0" in info["collision"]
    assert info["min_obstacle_distance"] < 0.0
    assert reached[False][1]["n_contacts"] == 0 and np.isinf(reached[False][1]["min_obstacle_distance"])


@each_shape
def test_the_distance_told_is_the_smallest_of_all_pairs_so_far(env, shape):
    rng = np.random.default_rng(1)
    started(env, ScheduledObstacle(shape, (-0.05, 0.2, 1.1), long=(0.0, 0.1, 0.0), frequency=2.0))
    smallest = brute_distance(env)
    for _ in range(40):
        *_, info = env.step(rng.uniform(-0.5, 0.5, 8))
        smallest = min(smallest, brute_distance(env))
        assert info["min_obstacle_distance"] == pytest.approx(smallest, abs=2e-5)


def test_distances_are_those_of_another_library_also_where_mujoco_says_zero(env):
    rng, zeros = np.random.default_rng(0), 0
    for seed in range(150):
        turn = rng.normal(size=4)
        shape = Box(tuple(rng.uniform(0.03, 0.1, 3)))
        place = rng.uniform([-0.4, -0.4, 0.9], [0.2, 0.4, 1.5])
        each = ScheduledObstacle(shape, tuple(place), tuple(turn / np.linalg.norm(turn)))
        *_, info = env.reset(seed=seed, options={"level": "L2", "obstacles": [each]})
        expected = brute_distance(env)
        if expected > 0.0:
            assert info["min_obstacle_distance"] == pytest.approx(expected, abs=2e-5), seed
        zeros += raw_zeros(env)
    assert zeros > 0, "MuJoCo is mended: the nudges in nearness can go"


def raw_zeros(env):
    """How many pairs of robot and obstacle MuJoCo says touch that do not."""
    sim, own = env.sim, int(env.sim.scene.obstacles[0, 1])
    model = sim.model
    solid = ((model.geom_contype != 0) | (model.geom_conaffinity != 0)) & np.isin(sim.scene.owner, (ARM, FINGERS))
    pairs = [(int(geom), own) for geom in np.flatnonzero(solid)]
    said = [mujoco.mj_geomDistance(sim.model, sim.data, *pair, 2.0, None) == 0.0 for pair in pairs]
    return sum(zero and fcl_distance(sim, *pair) > 1e-3 for zero, pair in zip(said, pairs, strict=True))


def test_what_is_not_there_is_zeros_and_what_is_there_is_told_in_full(env):
    observation, _ = started(env)
    for key in ("active", "shape", "size", "pose", "velocity"):
        assert not observation[f"obstacle_{key}"].any()
    still = ScheduledObstacle(Box((0.04, 0.05, 0.06)), (0.1, 0.3, 1.2), (0.8, 0.6, 0.0, 0.0))
    swing = ScheduledObstacle(Sphere(0.03), (0.0, -0.3, 1.2), long=(0.1, 0.0, 0.0), frequency=2.0)
    started(env, still, swing)
    for step in range(1, 30):
        observation, *_ = env.step(IDLE)
        time = step * env.control_dt
        seen = obstacles_in(observation)
        assert observation["obstacle_active"].tolist() == [1, 1, 0]
        assert seen[0].shape == still.shape and seen[1].shape == swing.shape
        np.testing.assert_allclose(observation["obstacle_pose"][0], still.pose(0).vector, atol=1e-12)
        np.testing.assert_allclose(observation["obstacle_pose"][1, :3], swing.position(time), atol=1e-12)
        np.testing.assert_allclose(observation["obstacle_velocity"][1], swing.velocity(time), atol=1e-12)
        mocap = env.sim.model.body_mocapid[env.sim.scene.obstacles[1, 0]]
        np.testing.assert_allclose(env.sim.data.mocap_pos[mocap], swing.position(time), atol=1e-12)


def test_one_that_appears_waits_for_its_motion_its_delay_and_for_room(env, monkeypatch):
    observation, _ = started(env)
    tcp = tuple(observation["tcp_pose"][0, :3])
    later = ScheduledObstacle(Sphere(0.04), (0.1, 0.3, 1.3), motion=1, delay=0.5)
    never = ScheduledObstacle(Sphere(0.04), (0.1, -0.3, 1.3), motion=3)
    blocked = ScheduledObstacle(Sphere(0.04), tcp, motion=1)
    started(env, later, never, blocked)
    index = property(lambda _: 1.0 if env._steps >= 10 else 0.0)
    monkeypatch.setattr(type(env.episode.progress), "motion_index", index)
    shown = [env.step(IDLE)[0]["obstacle_active"].tolist() for _ in range(60)]
    assert shown.index([1, 0, 0]) == pytest.approx(10 + 0.5 / env.control_dt, abs=2)
    assert shown[-1] == [1, 0, 0]


@pytest.mark.parametrize("level, kinds", [("L3", "still"), ("L4", "other"), ("F", "still")])
def test_levels_put_seeded_obstacles_that_leave_room_at_the_start(env, level, kinds):
    for seed in range(3):
        first, info = env.reset(seed=seed, options={"level": level})
        intruders = env.sim.obstacles.scheduled_obstacles
        assert 1 <= len(intruders) <= (3 if level == "L3" else 1)
        assert all((not each.frequency and not each.motion) == (kinds == "still") for each in intruders)
        for each in intruders:
            assert np.linalg.norm(each.velocity(-each.phase / each.frequency if each.frequency else 0)) <= FASTEST
            extents = np.array(each.shape.size if isinstance(each.shape, Box) else [2 * each.shape.radius])
            assert (extents <= LARGEST + 1e-9).all() and (extents >= 0.4 * SMALLEST).all()
        if env.sim.obstacles.active.any():
            # the rule keeps capsules this far, and they contain the collision geometry
            assert info["min_obstacle_distance"] >= START_CLEARANCE - 1e-6
        again, _ = env.reset(seed=seed, options={"level": level})
        for key, value in first.items():
            np.testing.assert_array_equal(value, again[key])


def test_still_obstacles_overlap_what_hand_and_block_sweep_and_no_object(env):
    for seed in range(4):
        observation, _ = env.reset(seed=seed, options={"level": "L3"})
        for each in env.sim.obstacles.scheduled_obstacles:
            block = Pose.from_vector(observation["object_pose"][each.blocked_motion]).position
            goal = Pose.from_vector(observation["goal_pose"][each.blocked_motion]).position
            middle = np.array(each.center)
            along = np.dot(middle[:2] - block[:2], goal[:2] - block[:2]) / np.linalg.norm(goal[:2] - block[:2]) ** 2
            aside = np.linalg.norm(middle[:2] - block[:2] - along * (goal[:2] - block[:2]))
            assert 0.25 <= along <= 0.75 and aside <= 0.021
            assert min(np.linalg.norm(middle - pose[:3]) for pose in observation["object_pose"]) > 0.05


NARROW = [[0.1, y, 0.825, 1, 0, 0, 0] for y in (-0.13, 0.0, 0.13)]


@pytest.mark.parametrize(
    "options, message",
    [
        ({"obstacles": "wall"}, "unknown obstacles 'wall'; known: none, static"),
        ({"obstacles": [1]}, "neither one of none, static"),
        ({"obstacles": [ScheduledObstacle(Sphere(0.1), (0, 0, 1))] * 4}, "there are 4; at most 3"),
        ({"level": "L3", "object_poses": NARROW, "base_pose": [-0.08, 0, 0.825, 1, 0, 0, 0]}, "no room for 'static'"),
    ],
)
def test_obstacles_that_cannot_be_are_refused_in_one_line(env, options, message):
    with pytest.raises(OneDemoError, match=message) as caught:
        env.reset(seed=0, options=options)
    assert "\n" not in str(caught.value)


def test_nothing_appears_nearer_than_promised(monkeypatch):
    env = gym.make("onedemo/Stack-v0").unwrapped
    observation, _ = started(env)
    x, y, z = observation["tcp_pose"][0, :3]
    for offset, room in ((CLEARANCE + 0.02, True), (CLEARANCE - 0.03, False)):
        started(env, ScheduledObstacle(Sphere(0.02), (x, y, z - 0.02 - offset), motion=1))
        monkeypatch.setattr(type(env.episode.progress), "motion_index", property(lambda _: 1.0))
        env.step(IDLE)
        assert env.sim.obstacles.active[0] == room
    env.close()


def a_stage(straight=1):
    """A Panda that must reach one place from one side, in three poses on a line."""
    arm, body = compiled_scene(ROBOTS["Panda"]).arms[0].arm, robot_body(ROBOTS["Panda"])
    joints = np.array([0.0, 0.4, 0.0, -2.2, 0.0, 2.6, 0.78])
    tcp = arm.fk(joints)
    keys = [Pose.from_position_quaternion([0.05 * k, 0.0, 0.0]) @ tcp for k in range(3)]
    motion = PlacementMotion(
        tcp, keys[-1], tuple((key,) for key in keys), Sphere(0.01), Pose.identity(), 0, straight=straight
    )
    return PlacementContext([motion], arm, body, joints, [], [], 0.0), keys


def test_obstacles_that_each_leave_a_posture_but_together_none_are_seen():
    """A ball at an elbow takes some postures away; balls at all elbows take all."""
    stage, _ = a_stage()
    elbows = {
        tuple(capsule_ends(stage.arm, stage.body, postures[0], range(2, 4))[0][1].round(2))
        for postures in stage._postures_at(0)
    }
    assert len(elbows) > 1
    balls = [Obstacle(Sphere(0.04), Pose.from_position_quaternion(elbow)) for elbow in sorted(elbows)]
    alone = [ball for ball in balls if stage.has_postures(pack([ball]))]
    assert alone, "at least one ball alone leaves a posture"
    assert not stage.has_postures(pack(balls))


def test_what_is_straight_is_reached_in_one_posture():
    stage, keys = a_stage(straight=3)
    lines = stage._postures_at(0)
    assert lines
    for line in lines:
        assert len(line) == 3 and np.abs(np.diff(line, axis=0)).max() <= NEAR
        for q, key in zip(line, keys, strict=True):
            assert max(stage.arm.fk(q).distance_to(key)) < 1e-3
    apart, _ = a_stage()
    assert [len(line) for k in range(3) for line in apart._postures_at(k)[:1]] == [1, 1, 1]
