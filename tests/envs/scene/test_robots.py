"""Every supported robot: it moves, its kinematics are true, its capsules hold it, its other arm is in the way."""

from __future__ import annotations

import gymnasium as gym
import mujoco
import numpy as np
import pytest
from helpers.envs.contacts import wanted
from helpers.reach import PourReach, ShelfReach

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.envs.pour.places import POUR_PLACES
from onedemo.envs.scene.baxter_trunk import slices
from onedemo.envs.scene.body_clearance import arm_clearance
from onedemo.envs.scene.robot_bodies import robot_body
from onedemo.envs.scene.robot_description import PARKED
from onedemo.envs.scene.robots import ROBOTS, places_of, robot_named
from onedemo.envs.scene.scene import ARM, FINGERS, OTHER_ARM, OTHER_FINGERS, WORLD, compiled_scene
from onedemo.envs.scene.scene_objects import NOTHING, TABLE_HEIGHT
from onedemo.envs.shelve.places import SHELF_PLACES
from onedemo.envs.simulation.simulation import Simulation, Start
from onedemo.envs.stack.grasps import DOWN
from onedemo.envs.stack.layout import BASE_PLACE, RANGES
from onedemo.envs.stack.rules import BLOCK_SIZE, stack_rules
from onedemo.planner.collision.capsule_placement import place_capsules
from onedemo.planner.collision.robot_arrays import ROW, robot_arrays
from onedemo.planner.control.inverse_kinematics import inverse_kinematics
from onedemo.planner.errors import BadOption, UnknownName
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import pack

GRASPED, LIFTED = TABLE_HEIGHT + 0.5 * BLOCK_SIZE[2], 0.10
THIRD = GRASPED + 2.0 * BLOCK_SIZE[2] + 0.025
"""Heights [m] of the hand: at a block on the table, by how much it is lifted, and at the third block of a stack."""
ARMS = [(robot, side) for robot, kind in ROBOTS.items() for side in kind.ready]
each_robot = pytest.mark.parametrize("robot", sorted(ROBOTS))
PLACED = [("Pour", robot) for robot, places in POUR_PLACES.items() if not isinstance(places, str)]
PLACED += [("Shelve", robot) for robot, places in SHELF_PLACES.items() if not isinstance(places, str)]
each_placed = pytest.mark.parametrize("task, robot", PLACED, ids=["-".join(each) for each in PLACED])
each_arm = pytest.mark.parametrize("robot, side", ARMS, ids=["-".join(each) for each in ARMS])


@each_robot
def test_it_stacks_blocks_in_principle(robot):
    env = gym.make("onedemo/Stack-v0", robot=robot)
    rng = np.random.default_rng(0)
    observation, info = env.reset(seed=0, options={"level": "L2"})
    assert observation["joint_positions"].shape == (1, len(ROBOTS[robot].speeds))
    assert info["safe"]
    for _ in range(100):
        assert env.observation_space.contains(observation)
        observation, *_ = env.step(rng.uniform(-1, 1, env.action_space.shape))


@each_robot
def test_it_goes_where_it_is_told_and_stands_still(robot):
    env = gym.make("onedemo/Stack-v0", robot=robot).unwrapped
    before = env.reset(seed=0, options={"level": "L0"})[0]["joint_positions"][0]
    speeds = 0.1 * np.resize([1.0, -1.0], len(before))
    for part in (1.0, 0.0):
        for _ in range(25):
            observation, *_ = env.step(np.append(part * speeds, 0.0))
    # what oscillates has a speed although it stays where it is
    assert np.abs(observation["joint_velocities"]).max() < 0.02
    expected = before + 0.5 * speeds * env.arms[0].velocity_limits
    np.testing.assert_allclose(observation["joint_positions"][0], expected, atol=5e-3)


@each_robot
def test_at_the_start_nothing_touches_and_the_hand_points_down(robot):
    scene = compiled_scene(ROBOTS[robot])
    sim = Simulation(ROBOTS[robot], NOTHING)
    sim.reset(Start(scene.home, np.zeros((0, 7))))
    assert sim.data.ncon == 0
    assert scene.arms[0].arm.margin(scene.home[0]) > 0.3
    assert scene.arms[0].arm.fk(scene.home[0]).rotation[2, 2] < -0.95


@each_robot
def test_its_hand_can_point_down_wherever_its_reach_says(robot):
    index, home = compiled_scene(ROBOTS[robot]).arms[0], compiled_scene(ROBOTS[robot]).home[0]
    reach, axis, rng = ROBOTS[robot].reach, index.arm.chain[0, 4:6], np.random.default_rng(0)
    # a stack is never farther than this, see `RANGES` of stacking
    highest = min(reach.stack, np.hypot(*(np.add(BASE_PLACE, RANGES["L2"].base) - axis)))
    places = [(r, z) for r in reach[:2] for z in (GRASPED, GRASPED + LIFTED)] + [(highest, THIRD)]
    for distance, height in places:
        for direction in np.deg2rad([-30.0, 0.0, 30.0]):
            at = np.array([*axis, height]) + distance * np.array([np.cos(direction), np.sin(direction), 0.0])
            for yaw in np.deg2rad([0.0, 45.0, 90.0, 135.0]):
                assert best_margin(index.arm, home, at, yaw, rng) >= 0.1, (distance, height, direction, yaw)


def best_margin(arm, home, at, yaw, rng):
    """Largest distance [rad] to the joints' limits that was found for a hand that points down, fingers along a yaw."""
    best = -np.inf
    for k in range(12):
        q = np.clip(home + (rng.normal(0.0, 0.8, arm.dof) if k else 0.0), arm.lower, arm.upper)
        for turn in (yaw, yaw + np.pi):
            down = Pose.from_yaw([*at], turn) @ Pose.from_position_quaternion([0.0, 0.0, 0.0], DOWN)
            found = inverse_kinematics(arm, down, q)
            best = best if found is None else max(best, arm.margin(found))
        if best >= 0.1:
            break
    return best


@each_arm
def test_kinematics_are_mujocos(robot, side):
    scene = compiled_scene(ROBOTS[robot], NOTHING, (side,))
    index, data, rng = scene.arms[0], mujoco.MjData(scene.model), np.random.default_rng(1)
    for _ in range(50):
        q = rng.uniform(index.arm.lower, index.arm.upper)
        data.qpos[index.qpos] = q
        mujoco.mj_kinematics(scene.model, data)
        pose = index.arm.fk(q)
        np.testing.assert_allclose(pose.position, data.site_xpos[index.site], atol=1e-12)
        np.testing.assert_allclose(pose.rotation, data.site_xmat[index.site].reshape(3, 3), atol=1e-12)


@each_arm
def test_the_capsules_hold_the_collision_geometry(robot, side):
    scene = compiled_scene(ROBOTS[robot], NOTHING, (side,))
    index, data, rng = scene.arms[0], mujoco.MjData(scene.model), np.random.default_rng(2)
    body = robot_body(ROBOTS[robot], list(ROBOTS[robot].ready).index(side))
    g = robot_arrays((index.arm,), (body,), pack(()))
    joints = [int(scene.model.joint(name).bodyid[0]) for name in index.arm.joint_names]
    for _ in range(5):
        q = rng.uniform(index.arm.lower, index.arm.upper)
        data.qpos[index.qpos] = q
        data.qpos[index.finger_qpos] = index.finger_open
        mujoco.mj_kinematics(scene.model, data)
        place_capsules(g, q, ROW.placed)
        for part in sorted(index.bodies | index.fingers):
            frame = max(joints.index(above) for above in ancestors(scene.model, part) if above in joints)
            points = surface(scene.model, data, part)
            if len(points):
                rows = ROW.placed + np.flatnonzero(body.rows[:, 0] == frame)
                radii = body.rows[body.rows[:, 0] == frame, 7]
                assert outside(points, g[rows, :6], radii).max() < 1e-4, scene.model.body(part).name


def ancestors(model, body):
    found = []
    while body:
        found.append(body)
        body = int(model.body_parentid[body])
    return found


def surface(model, data, body):
    """Extreme points of the solid geoms of a body, in the world."""
    turns = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    clouds = [np.zeros((0, 3))]
    for geom in range(model.body_geomadr[body], model.body_geomadr[body] + model.body_geomnum[body]):
        if not (model.geom_contype[geom] or model.geom_conaffinity[geom]):
            continue
        kind, (x, y, z) = int(model.geom_type[geom]), model.geom_size[geom]
        if kind == mujoco.mjtGeom.mjGEOM_MESH:
            first = model.mesh_vertadr[model.geom_dataid[geom]]
            own = model.mesh_vert[first : first + model.mesh_vertnum[model.geom_dataid[geom]]]
        elif kind == mujoco.mjtGeom.mjGEOM_BOX:
            own = np.array(np.meshgrid((-x, x), (-y, y), (-z, z))).reshape(3, -1).T
        elif kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
            own = np.array([(x * np.cos(a), x * np.sin(a), h) for a in turns for h in (-y, y)])
        else:
            own = x * np.vstack([np.eye(3), -np.eye(3)])
        clouds.append(own @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])
    return np.vstack(clouds)


def outside(points, ends, radii):
    """How far (n,) [m] points are outside of all of some capsules."""
    best = np.full(len(points), np.inf)
    for (*a, x, y, z), radius in zip(ends, radii, strict=True):
        a, b = np.array(a), np.array([x, y, z])
        t = np.clip((points - a) @ (b - a) / max((b - a) @ (b - a), 1e-18), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(points - a - t[:, None] * (b - a), axis=1) - radius)
    return best


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_other_arm_is_parked_and_known(side):
    env = gym.make("onedemo/Stack-v0", robot="Baxter", arm=side).unwrapped
    env.reset(seed=0)
    scene, task = env.sim.scene, env.task
    assert [index.side for index in scene.arms] == [side]
    assert {ARM, FINGERS, OTHER_ARM, OTHER_FINGERS} <= set(scene.owner)
    names = [fixture.name for fixture in task.fixtures]
    assert {"table", "torso", PARKED} <= set(names)
    before = env.sim.data.qpos[scene.parked[0].qpos].copy()
    for _ in range(50):
        env.step(np.ones(8))
    np.testing.assert_allclose(env.sim.data.qpos[scene.parked[0].qpos], before, atol=1e-3)
    # the arm that works stands with its shoulder on the table's middle line
    assert abs(env.arms[0].chain[0, 5]) < 1e-3
    # and starts well clear of all that it must not touch
    solids = [f for f in task.fixtures if f.name != "torso"]
    assert arm_clearance(env.arms[0], task.bodies[0], scene.home[0], pack(solids)) > 0.05


def test_an_arm_may_not_touch_trunk_nor_other_arm():
    for pair in ((ARM, OTHER_ARM), (FINGERS, OTHER_ARM), (WORLD, ARM), (WORLD, OTHER_ARM), (ARM, OTHER_FINGERS)):
        assert not wanted(stack_rules(1).allowed, *pair, 0), pair
    assert wanted(stack_rules(1).allowed, OTHER_ARM, OTHER_FINGERS, 0)
    scene = compiled_scene(ROBOTS["Baxter"])
    torso = [geom for geom, label in enumerate(scene.labels) if label == "torso"]
    assert len(torso) > 6
    assert set(scene.owner[torso]) == {WORLD}


def test_the_slices_of_the_trunk_leave_the_shoulder_its_room():
    scene = compiled_scene(ROBOTS["Baxter"])
    torso = pack([fixture for fixture in scene.fixtures if fixture.name == "torso"])
    arm, body = scene.arms[0].arm, robot_body(ROBOTS["Baxter"])
    upper = range(2, 3)
    inwards = [arm_clearance(arm, body, np.array([s0, -0.6, 0, 1, 0, 0, 0]), torso, upper) for s0 in (-1.2, 0.0, 1.2)]
    assert min(inwards) > 0.05
    assert arm_clearance(arm, body, np.array([1.7, 1.04, 0, 2.4, 0, 0, 0]), torso, upper) < 0.0, (
        "a real collision stays one"
    )


def test_slices_hold_all_of_the_surface():
    rng = np.random.default_rng(0)
    faces = rng.normal(size=(50, 3, 3))
    parts = slices(faces, 4)
    assert len(parts) == 4
    heights = np.sort(faces[..., 2].ravel())[[0, -1]]
    for k, part in enumerate(parts):
        low, high = np.linspace(*heights, 5)[[k, k + 1]]
        assert part[:, 2].min() >= low - 1e-9
        assert part[:, 2].max() <= high + 1e-9


def test_what_cannot_be_is_refused_in_a_line():
    with pytest.raises(BadOption, match="Panda has no arm 'left'; it has: right"):
        gym.make("onedemo/Stack-v0", arm="left")
    with pytest.raises(BadOption, match="Baxter cannot hold a book, 80 mm wide: its gripper holds 16 to 56 mm"):
        ROBOTS["Baxter"].check_grip(0.08, "a book")
    with pytest.raises(UnknownName, match="unknown robot 'R2D2'; known: Panda, Baxter"):
        gym.make("onedemo/Stack-v0", robot="R2D2")
    with pytest.raises(BadOption, match="Panda has one arm"):
        gym.make("onedemo/BimanualPour-v0", robot="Panda")


def test_a_robot_without_places_is_refused_in_one_line_with_the_reason():
    with pytest.raises(BadOption, match="'robot': UR5e cannot pour: its arm is too short") as caught:
        places_of({"UR5e": "its arm is too short"}, ROBOTS["UR5e"], "pour")
    assert "\n" not in str(caught.value)
    with pytest.raises(BadOption, match="'robot': Kinova3 cannot shelve: its wrist"):
        gym.make("onedemo/Shelve-v0", robot="Kinova3")
    with pytest.raises(BadOption, match="Sawyer cannot pour: no places were made for it"):
        places_of({}, ROBOTS["Sawyer"], "pour")
    with pytest.raises(UnknownName, match="unknown robot 'R2D2'; known: Panda, Baxter"):
        robot_named("R2D2")


@each_robot
def test_every_robot_has_places_or_a_reason(robot):
    assert robot in POUR_PLACES and robot in SHELF_PLACES


@each_placed
def test_it_starts_clear_of_everything_and_moves_in_the_task(task, robot):
    env = gym.make(f"onedemo/{task}-v0", robot=robot)
    rng, inner = np.random.default_rng(0), env.unwrapped
    fixtures = [f for f in inner.task.fixtures if not {("link1", f.name), ("link2", f.name)} & set(inner.task.touching)]
    for level in ("L0", "L1", "L2"):
        for seed in range(3):
            observation, info = env.reset(seed=seed, options={"level": level})
            assert env.observation_space.contains(observation)
            assert info["safe"]
            assert np.abs(inner.sim.data.contact.dist).max(initial=0.0) < 1e-3, "nothing is inside anything"
            q = observation["joint_positions"][0]
            assert arm_clearance(inner.arms[0], inner.task.bodies[0], q, pack(fixtures), range(2, len(q))) > 0.02
    for _ in range(50):
        observation, *_ = env.step(rng.uniform(-1, 1, env.action_space.shape))
        assert env.observation_space.contains(observation)
    env.close()


@each_placed
def test_most_starts_are_within_reach_of_the_demonstration(task, robot):
    # the planner reaches more: it also goes round and through joint space
    if task == "Pour":
        reached, as_shown = PourReach(robot).share(POUR_PLACES[robot], "L1", 10)
        assert reached >= 0.9 and as_shown >= 0.6
    else:
        assert ShelfReach(robot).share(SHELF_PLACES[robot], "L1", 16) > 0.5


@each_robot
def test_a_gripper_opens_as_far_as_its_facts_say(robot):
    assert Simulation(ROBOTS[robot], NOTHING).widest_opening(0) == pytest.approx(ROBOTS[robot].opening, abs=1e-6)
