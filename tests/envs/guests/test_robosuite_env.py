"""robosuite's tasks as environments: every one-armed task, its judge, its ranges, its solids, its robots."""

from __future__ import annotations

import copy
import os
import pickle
import subprocess
import sys
import time

import gymnasium as gym
import mujoco
import numpy as np
import pytest

import onedemo.envs  # noqa: F401
from onedemo.envs.guests.guest_scene import guest_scene
from onedemo.envs.guests.rules import unwanted_contacts
from onedemo.envs.guests.task_facts import PLACES, WIDE
from onedemo.envs.scene.body_clearance import point_clearance
from onedemo.envs.scene.scene import ARM, FINGERS, FIRST_OBJECT, FURNITURE, OBSTACLE, OTHER_ARM, WORLD
from onedemo.planner.errors import OneDemoError
from onedemo.planner.geometry.hulls import corner_points
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import pack

NAME = "onedemo/Robosuite-v0"
OBJECTS = {
    "Lift": ["cube"],
    "Stack": ["cubeA", "cubeB"],
    "NutAssembly": ["SquareNut", "RoundNut"],
    "NutAssemblySingle": ["SquareNut", "RoundNut"],
    "NutAssemblySquare": ["SquareNut"],
    "NutAssemblyRound": ["RoundNut"],
    "PickPlace": ["Milk", "Bread", "Cereal", "Can"],
    "PickPlaceSingle": ["Milk", "Bread", "Cereal", "Can"],
    "PickPlaceMilk": ["Milk"],
    "PickPlaceBread": ["Bread"],
    "PickPlaceCereal": ["Cereal"],
    "PickPlaceCan": ["Can"],
    "Door": [],
    "ToolHang": ["stand", "frame", "tool"],
}
"""Objects of every task for one arm that robosuite has, Wipe aside."""
FURNITURE_OF = {
    "Lift": [],
    "NutAssemblySquare": ["peg1", "peg2"],
    "PickPlaceCan": ["bin1", "bin2"],
    "Door": ["Door", "Door_frame", "Door_door", "Door_latch"],
    "ToolHang": [],
}


def made(task, **options):
    return gym.make(NAME, task=task, **options).unwrapped


def rollout(env, seed, steps=5):
    """All that an episode of random actions says, as bytes."""
    said, rng = [], np.random.default_rng(seed)
    observation, info = env.reset(seed=seed)
    for _ in range(steps):
        said.append(b"".join(observation[key].tobytes() for key in sorted(observation)) + repr(info).encode())
        assert env.observation_space.contains(observation)
        observation, _, terminated, _, info = env.step(rng.uniform(-1, 1, env.action_space.shape))
        assert not terminated and not info["failure_reason"]
    return said


@pytest.mark.parametrize("task", OBJECTS)
def test_every_task_for_one_arm_starts_steps_and_repeats_to_the_bit(task):
    env = made(task)
    first = rollout(env, 3)
    rollout(env, 4)
    assert rollout(made(task), 3) == first != rollout(env, 5)
    facts = env.task
    assert [each.name for each in facts.objects] == OBJECTS[task]
    assert [each.name for each in facts.furniture] == FURNITURE_OF.get(task, [each.name for each in facts.furniture])
    assert [each.name for each in facts.fixtures].count("table") == (not task.startswith("PickPlace"))
    assert facts.scene_joints == (("Door_hinge", "Door_latch_joint") if task == "Door" else ())
    assert set(PLACES.get(task, {})) <= {each.name for each in (*facts.objects, *facts.furniture)}


def test_all_tasks_of_robosuite_are_tested():
    with pytest.raises(OneDemoError, match="unknown robosuite task for one arm 'Lfit'; known: ") as caught:
        made("Lfit")
    assert str(caught.value).split("known: ")[1].split(", ") == list(OBJECTS)


@pytest.mark.parametrize(
    "options, message",
    [
        ({"task": "TwoArmLift"}, "unknown robosuite task for one arm 'TwoArmLift'; known: Lift, Stack"),
        ({"task": 3}, "unknown robosuite task for one arm '3'; known: Lift"),
        ({"task": "Wipe"}, "Wipe cannot be made: its tool replaces the gripper.*; those that can: Lift, Stack"),
        ({"robot": "Baxter"}, "Baxter has two arms; robosuite's tasks are for one: Panda, Sawyer, IIWA"),
        ({"gripper": "WipingGripper"}, "unknown gripper of Panda 'WipingGripper'; known: PandaGripper"),
        ({"robot": "Sawyer", "gripper": "x"}, "unknown gripper of Sawyer 'x'; known: RethinkGripper, PandaGripper"),
        ({"range": "D2"}, "unknown range 'D2'; known: D0, D1"),
        ({"range": "D1"}, "Lift has no wider placement D1; those that have one: Stack, NutAssemblySquare"),
        ({"task": "ToolHang", "reward": "dense"}, "no shaped reward in ToolHang; only sparse is possible"),
    ],
)
def test_unusable_arguments_are_refused_in_one_line(options, message):
    with pytest.raises(OneDemoError, match=message) as caught:
        made(**{"task": "Lift", **options})
    assert "\n" not in str(caught.value)


def test_unusable_reset_options_are_refused():
    env = made("Lift")
    for options, message in [
        ({"nut": 1}, "unknown reset option 'nut'; known: level, obstacles, object_poses, joint_positions"),
        ({"object_poses": np.zeros((2, 7))}, r"object_poses': has shape \(2, 7\); expected \(1, 7\)"),
        ({"obstacles": "paper"}, "the paper shows no obstacle in Lift"),
    ]:
        with pytest.raises(OneDemoError, match=message):
            env.reset(seed=0, options=options)


# ---- success and reward --------------------------------------------------------------------------------------------


def on_peg(env, seed=0):
    """Pose of the square nut around its peg, as it lies there."""
    assert env.task.furniture[0].name == "peg1"
    peg = env.reset(seed=seed)[0]["furniture_pose"][0]
    return np.array([peg[0], peg[1], env.task.table_height + 0.0101, 1.0, 0.0, 0.0, 0.0])


def moved(pose, x=0.0, z=0.0):
    return np.add(pose, [x, 0.0, z, 0.0, 0.0, 0.0, 0.0])


def steps_to_success(env, most=60):
    for step in range(1, most + 1):
        _, reward, terminated, _, info = env.step(np.zeros(env.action_space.shape))
        if terminated:
            assert info["success"] and info["is_success"] and reward == 1.0 and info["stage"] == "success"
            return step
        assert reward == 0.0 and not info["success"]
    return None


def test_a_nut_on_its_peg_is_a_success_after_half_a_second():
    env = made("NutAssemblySquare")
    _, info = env.reset(seed=0, options={"object_poses": [on_peg(env)]})
    assert info["robosuite_success"] and not info["success"]
    assert 20 <= steps_to_success(env) <= 25
    beside = moved(on_peg(env), x=0.05)
    assert not env.reset(seed=0, options={"object_poses": [beside]})[1]["robosuite_success"]


def test_a_moved_peg_is_where_it_is_observed_and_where_robosuite_looks():
    env = made("NutAssemblySquare", range="D1")
    _, info = env.reset(seed=5, options={"object_poses": [on_peg(env, seed=5)]})
    assert info["robosuite_success"]
    # another environment of the same scene has its own pegs
    other = made("NutAssemblySquare")
    assert not other.reset(seed=5, options={"object_poses": [on_peg(env, seed=5)]})[1]["robosuite_success"]
    assert env.reset(seed=5, options={"object_poses": [on_peg(env, seed=5)]})[1]["robosuite_success"]


def test_a_lifted_cube_is_a_success_while_it_is_lifted():
    env = made("Lift", reward="dense")
    observation, info = env.reset(seed=0)
    assert not info["robosuite_success"]
    lying = observation["object_pose"][0]
    for height in (0.0, 0.015, 0.025, 0.3):  # robosuite's limit is 4 cm above the table, half a cube more than this
        env.sim.put(0, moved(lying, z=height))
        sight = env.declared.guest.judge.look(env.sim, shaped=True)
        assert sight.success == (height > 0.02) == (sight.shaped == 1.0)
        assert 0.0 <= sight.shaped <= 1.0
    env.reset(seed=0)
    assert 0.0 < env.step(np.zeros(8))[1] < 0.5


def test_an_opened_door_is_a_success_and_its_panel_is_seen_to_turn():
    env = made("Door")
    observation, info = env.reset(seed=0)
    assert not info["robosuite_success"] and abs(observation["scene_joint_positions"][0]) < 0.01
    env.sim.data.qpos[env.sim.model.joint("Door_hinge").qposadr[0]] = 0.4
    turned, _, _, _, info = env.step(np.zeros(8))
    assert info["robosuite_success"] and turned["scene_joint_positions"][0] > 0.3
    whole, frame, panel, latch = turned["furniture_pose"] - observation["furniture_pose"]
    assert np.abs([whole, frame]).max() < 1e-9 and np.abs(panel).max() > 0.1 and np.abs(latch).max() > 0.1


def test_stacked_cubes_are_a_success():
    env = made("Stack", reward="dense")
    b = env.reset(seed=0)[0]["object_pose"][1]
    _, info = env.reset(seed=0, options={"object_poses": [moved(b, z=0.0449), b]})
    assert info["robosuite_success"] and env.declared.guest.judge.look(env.sim, shaped=True).shaped == 1.0


def test_an_object_off_the_table_ends_the_episode():
    env = made("Lift")
    env.reset(seed=0)
    env.sim.put(0, np.array([0.0, 1.0, 0.1, 1.0, 0.0, 0.0, 0.0]))
    _, _, terminated, _, info = env.step(np.zeros(8))
    assert terminated and info["failure_reason"] == "off_table"


def test_links_may_touch_neither_fixtures_nor_obstacles_and_the_hand_only_fixtures():
    def judged(*pairs):
        touching = np.zeros((FIRST_OBJECT + 2, FIRST_OBJECT + 2))
        for pair in pairs:
            touching[pair] = 1.0
        return unwanted_contacts(touching)

    wanted = [(WORLD, FINGERS), (WORLD, OTHER_ARM), (FINGERS, FURNITURE), (OTHER_ARM, FURNITURE), (ARM, OTHER_ARM)]
    wanted += [(FINGERS, FIRST_OBJECT), (WORLD, FIRST_OBJECT), (FURNITURE, FIRST_OBJECT), (ARM, FIRST_OBJECT)]
    assert judged(*wanted) == []
    for pair in [(WORLD, ARM), (ARM, FURNITURE), (ARM, OBSTACLE), (FINGERS, OBSTACLE), (OTHER_ARM, OBSTACLE)]:
        assert judged(pair, *wanted) == [pair]
    assert judged((OBSTACLE, FIRST_OBJECT + 1)) == [(OBSTACLE, FIRST_OBJECT + 1)]


# ---- starts --------------------------------------------------------------------------------------------------------


def test_wide_stacks_are_drawn_within_20_cm():
    guest = guest_scene("Stack", "Panda", "PandaGripper")
    model, places = guest.env.sim.model._model, []
    for seed in range(200):
        qpos = guest.env.drawn(seed, WIDE["Stack"]).qpos
        places.append([qpos[model.joint(f"{name}_joint0").qposadr[0] :][:2] for name in ("cubeA", "cubeB")])
    assert np.abs(places).max() <= 0.20
    assert (np.max(places, axis=0) > 0.18).all() and (np.min(places, axis=0) < -0.18).all()
    narrow = [guest.env.drawn(seed, None).qpos[model.joint("cubeA_joint0").qposadr[0] :][:2] for seed in range(50)]
    assert np.abs(narrow).max() <= 0.08


def test_wide_nuts_and_pegs_are_drawn_in_their_ranges_and_apart():
    guest, found = guest_scene("NutAssemblySquare", "Panda", "PandaGripper"), []
    model = guest.env.sim.model._model
    address = model.joint("SquareNut_joint0").qposadr[0]
    for seed in range(200):
        drawn = guest.env.drawn(seed, WIDE["NutAssemblySquare"])
        nut = drawn.qpos[address : address + 7]
        yaw = 2.0 * np.arctan2(nut[6], nut[3]) % (2.0 * np.pi)
        pegs = drawn.body_pos[[model.body("peg1").id, model.body("peg2").id]]
        np.testing.assert_allclose(pegs[1], [0.23, -0.1, 0.85])
        assert pegs[0, 2] == 0.85
        gaps = [
            np.hypot(*(nut[:2] - pegs[0, :2])),
            np.hypot(*(nut[:2] - pegs[1, :2])),
            np.hypot(*(pegs[0] - pegs[1])[:2]),
        ]
        assert min(gaps) >= 0.14
        found.append([*nut[:2], yaw, *pegs[0, :2]])
    low, high = np.min(found, axis=0), np.max(found, axis=0)
    assert (low >= [-0.115, -0.255, 0.0, -0.1, -0.2]).all() and (low < [-0.10, -0.23, 0.2, -0.08, -0.18]).all()
    assert (high <= [0.115, 0.255, 6.2832, 0.3, 0.2]).all() and (high > [0.10, 0.23, 6.1, 0.28, 0.18]).all()
    assert guest.env.drawn(7, None).body_pos[model.body("peg1").id].tolist() == [0.23, 0.1, 0.85]


@pytest.mark.parametrize("task", ["NutAssemblySingle", "PickPlaceSingle"])
def test_each_episode_draws_one_object_and_the_others_stand_aside(task):
    env, seen = made(task), set()
    for seed in range(12):
        places = env.reset(seed=seed)[0]["object_pose"]
        near = np.abs(places[:, :2]).max(axis=1) < 1.0
        assert near.sum() == 1 and (places[~near, 2] < 0.2).all()
        seen.add(int(np.flatnonzero(near)[0]))
    assert len(seen) > 1


def test_what_is_drawn_does_not_depend_on_the_process():
    code = (
        "import sys; sys.path.insert(0, sys.argv[1]); from test_robosuite_env import *\n"
        "for task in ('NutAssemblySingle', 'PickPlaceSingle'):\n"
        "    print([made(task).reset(seed=seed)[0]['object_pose'].tobytes().hex() for seed in range(4)])"
    )
    run = [sys.executable, "-c", code, __file__.rsplit("/", 1)[0]]
    done = subprocess.run(run, capture_output=True, text=True, check=True, env={**os.environ, "PYTHONHASHSEED": "11"})
    for task, line in zip(("NutAssemblySingle", "PickPlaceSingle"), done.stdout.splitlines(), strict=True):
        assert line == repr([made(task).reset(seed=seed)[0]["object_pose"].tobytes().hex() for seed in range(4)])


def test_objects_have_come_to_rest():
    for task in ("NutAssembly", "PickPlaceCan", "ToolHang"):
        env = made(task)
        before = env.reset(seed=1)[0]["object_pose"]
        for _ in range(10):
            after = env.step(np.zeros(8))[0]["object_pose"]
        assert np.abs(after - before)[:, :3].max() < 0.004, task


def test_a_reset_compiles_nothing_and_is_quick(monkeypatch):
    env = made("NutAssemblySquare")
    env.reset(seed=0)

    def refused(*_):
        raise AssertionError("compiled anew")

    monkeypatch.setattr("robosuite.utils.binding_utils.MjSim.from_xml_string", refused)
    times = []
    for seed in range(5):
        before = time.process_time()
        env.reset(seed=seed)
        times.append(time.process_time() - before)
    assert min(times) < 0.2
    assert made("NutAssemblySquare", range="D1", control_mode="ee_twist").sim.scene is env.sim.scene


# ---- solids --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "task, tolerance", [("NutAssembly", 1e-4), ("PickPlace", 2e-3), ("ToolHang", 2e-3), ("Door", 1e-4)]
)
def test_solids_are_the_collision_geoms(task, tolerance):
    """Distances of points to the solids are those of MuJoCo to its geoms, and hulls contain their parts."""
    env, rng = made(task), np.random.default_rng(0)
    observation, _ = env.reset(seed=0)
    sim, probe = env.sim, int(env.sim.scene.obstacles[0, 1])
    mujoco.mj_forward(sim.model, sim.data)
    things = list(zip(env.task.objects, observation["object_pose"], strict=True))
    things += list(zip(env.task.furniture, observation.get("furniture_pose", ()), strict=True))
    assert [thing.name for thing, _ in things if not thing.parts] == (["Door"] if task == "Door" else [])
    for thing, row in things:
        if not thing.parts:
            continue
        pose = Pose.from_vector(row)
        solids, radius = pack(thing.at(pose)), float(sim.model.geom_size[probe, 0])
        labels = np.array(sim.scene.labels)
        body = sim.model.body(
            next(n for n in (f"{thing.name}_main", f"{thing.name}_root", thing.name) if n in names(sim))
        )
        tree = sim.model.body_rootid if thing in env.task.objects else np.arange(sim.model.nbody)
        mine = np.flatnonzero((tree[sim.model.geom_bodyid] == body.id) & (sim.model.geom_contype != 0))
        assert len(mine), (thing.name, labels)
        for _ in range(20):
            point = pose.position + rng.uniform(-0.15, 0.15, 3)
            sim.data.geom_xpos[probe] = point
            true = radius + min(mujoco.mj_geomDistance(sim.model, sim.data, int(g), probe, 5.0, None) for g in mine)
            if true > radius + 1e-3:
                assert point_clearance(point, solids) == pytest.approx(true, abs=tolerance), thing.name
                # solids contain the geoms: nothing is nearer than they are
                assert point_clearance(point, solids) <= true + 1e-5, thing.name


def names(sim):
    return {sim.model.body(k).name for k in range(sim.model.nbody)}


def test_an_objects_hull_contains_its_parts():
    for each in made("ToolHang").task.objects:
        whole = pack([type(each.parts[0])(each.shape)])
        for part in each.parts:
            for corner in corner_points(part.shape) @ part.pose.rotation.T + part.pose.position:
                assert point_clearance(corner, whole) < 1e-6


# ---- robots, obstacles, copies -------------------------------------------------------------------------------------


@pytest.mark.parametrize("task", ["Lift", "Stack"])
@pytest.mark.parametrize("robot", ["Sawyer", "IIWA", "UR5e"])
def test_other_robots_start_free_of_themselves_and_turn_their_first_joint(robot, task):
    env = made(task, robot=robot)
    observation, info = env.reset(seed=0)
    pairs = env.sim.scene.owner[env.sim.data.contact.geom]
    assert not (np.isin(pairs, (ARM, FINGERS, OTHER_ARM)).any(axis=1)).any() and info["safe"]
    assert env.task.gripper_width[0] == pytest.approx(0.079, abs=1e-3)
    action = np.zeros(env.action_space.shape)
    action[0] = 0.5
    for _ in range(25):
        after, *_, info = env.step(action)
    turned = after["joint_positions"][0, 0] - observation["joint_positions"][0, 0]
    assert turned == pytest.approx(0.25 * env.arms[0].velocity_limits[0], rel=0.15) and info["safe"]


def test_a_sawyer_may_keep_its_own_gripper():
    assert made("Lift", robot="Sawyer", gripper="RethinkGripper").task.gripper_width[0] == pytest.approx(0.06, abs=1e-3)


def test_the_capsules_of_a_robot_beside_the_bins_stand_where_it_does():
    table, bins = made("Lift"), made("PickPlaceCan")
    by = bins.arms[0].fk(np.zeros(7)).position - table.arms[0].fk(np.zeros(7)).position
    np.testing.assert_allclose(by, [0.06, -0.1, 0.0], atol=1e-9)
    one, other = table.task.bodies[0].rows, bins.task.bodies[0].rows
    base = one[:, 0] < 0
    np.testing.assert_allclose(other[base, 1:4] - one[base, 1:4], np.broadcast_to(by, (base.sum(), 3)), atol=1e-9)
    np.testing.assert_array_equal(other[~base], one[~base])


@pytest.mark.parametrize(
    "task, options", [("NutAssemblySquare", {"range": "D1"}), ("Door", {}), ("PickPlaceSingle", {})]
)
def test_copies_and_pickles_are_twins(task, options):
    env = made(task, **options)
    env.reset(seed=2)
    rng = np.random.default_rng(0)
    for _ in range(3):
        env.step(rng.uniform(-1, 1, env.action_space.shape))
    sent = pickle.dumps(env)
    assert len(sent) < 600_000
    for twin in (copy.deepcopy(env), pickle.loads(sent)):
        ours = copy.deepcopy(env)
        action = rng.uniform(-1, 1, env.action_space.shape)
        for mine, theirs in ((ours.step(action)[0], twin.step(action)[0]), (ours.reset()[0], twin.reset()[0])):
            for key in mine:
                assert mine[key].tobytes() == theirs[key].tobytes(), key


@pytest.mark.parametrize("task, options", [("NutAssemblySquare", {}), ("Stack", {"range": "D1"})])
def test_still_obstacles_stand_in_the_way_and_leave_room_at_the_start(task, options):
    observation, info = made(task, level="L3", **options).reset(seed=1)
    assert observation["obstacle_active"].any() and info["safe"] and info["min_obstacle_distance"] > 0.03
