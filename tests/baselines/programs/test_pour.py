"""The planner pours: from the scripted demonstration, and from a person's recording where it is at hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.baselines.factory import make_policy
from onedemo.baselines.programs.arm_executor import ArmExecutor
from onedemo.baselines.recording.import_pour import pour_from_poses
from onedemo.baselines.recording.record_pour import record_pour
from onedemo.bench.episodes.episode import run_episode
from onedemo.bench.episodes.scenarios import Scenario
from onedemo.configs.grid import load_config
from onedemo.configs.shipped_files import shipped_config, shipped_demonstration
from onedemo.envs.pour.facts import SOURCE
from onedemo.envs.pour.geometry import GLASSES, level_hand, tcp_from_glass
from onedemo.planner import Planner, ReactivePlanner
from onedemo.planner.errors import BadDemonstration, PlanFailed
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import Cylinder
from onedemo.planner.imitation.demonstration_files import read_demonstration, save_demonstration
from onedemo.planner.recordings.import_recording import demonstration_of
from onedemo.planner.recordings.pose_columns import TableRequest
from onedemo.planner.recordings.pose_table import recording_from_table

RECORDING = Path(__file__).parents[4] / "shared" / "data" / "panda_kinesthetic_pouring.npy"
needs_recording = pytest.mark.skipif(not RECORDING.exists(), reason="the recording is not shipped")
CONFIG = load_config(shipped_config("pour"))
SHOWN = read_demonstration(shipped_demonstration("pour"))


@pytest.fixture(scope="module")
def env():
    made = gym.make("onedemo/Pour-v0")
    yield made
    made.close()


def episode(env, level="L1", seed=0, config=CONFIG, shown=SHOWN):
    policy = make_policy("screw", env.unwrapped.task, shown, config.settings)
    return run_episode(env, policy, Scenario(0, seed, level), config)[0]


def test_the_shipped_demonstration_is_what_the_script_records(env):
    anew = record_pour(env.unwrapped)
    np.testing.assert_allclose(anew.joint_positions, SHOWN.joint_positions, atol=1e-6)
    assert (SHOWN.source, SHOWN.task, SHOWN.robot) == ("scripted", "pour", "Panda")
    for made, shipped in zip(anew.segments, SHOWN.segments, strict=True):
        assert made.reference_pose.distance_to(shipped.reference_pose)[0] < 1e-6
        assert replace(made, reference_pose=shipped.reference_pose) == shipped


def test_a_script_that_does_not_pour_is_not_a_demonstration(env, monkeypatch):
    monkeypatch.setattr("onedemo.baselines.recording.record_pour.TILTED", np.deg2rad(70.0))
    with pytest.raises(BadDemonstration, match="script: no success: at the target, unfinished"):
        record_pour(env.unwrapped)


def test_the_demonstration_replays_to_success_at_the_nominal_places(env):
    inner = env.unwrapped
    inner.reset(seed=0, options={"level": "L0"})
    joints, limits = SHOWN.joint_positions, inner.arms[0].velocity_limits
    for k in range(len(joints) - 1):
        speeds = (joints[k + 1] - joints[k]) / inner.control_dt
        *_, over, _, info = inner.step(np.append(speeds / limits, SHOWN.gripper[k + 1]))
        if over:
            break
    assert info["success"] and info["safe"]


@pytest.mark.parametrize("level, seed", [("L0", 0), ("L1", 1), ("L2", 2)])
def test_the_planner_pours(env, level, seed):
    record = episode(env, level, seed)
    assert record.success and record.safe
    assert record.numbers["fraction_in_target"][0] >= 0.9 and record.numbers["beads_lost"] == [0.0]
    assert record.numbers["carry_tilt"][0] < np.deg2rad(10.0)


def test_the_planner_pours_what_it_holds_from_the_start():
    env = gym.make("onedemo/Pour-v0", pregrasped=True)
    assert episode(env).safe_success
    env.close()


@pytest.mark.parametrize(
    "robot", ["Baxter", "UR5e", *(pytest.param(r, marks=pytest.mark.slow) for r in ("Sawyer", "IIWA", "Kinova3"))]
)
def test_other_robots_pour_from_the_same_demonstration(robot):
    env = gym.make("onedemo/Pour-v0", robot=robot)
    assert episode(env, "L2", 1).safe_success
    env.close()


@pytest.mark.slow
@pytest.mark.parametrize("level", ["L1", "L2", "L3", "L4"])
def test_the_planner_pours_again_and_again(env, level):
    records = [episode(env, level, seed) for seed in range(100, 106)]
    assert sum(record.safe_success for record in records) >= 5
    assert not any(record.contacts for record in records)


@pytest.mark.parametrize("radii, heights", [((0.030, 0.043), (0.10, 0.10)), ((0.023, 0.060), (0.08, 0.14))])
def test_goals_keep_the_lip_over_the_rim_for_every_turn_every_hold_and_glasses_of_other_sizes(env, radii, heights):
    task = env.unwrapped.task
    glasses = [Cylinder(radius, height) for radius, height in zip(radii, heights, strict=True)]
    objects = (replace(each, shape=glass, parts=()) for each, glass in zip(task.objects, glasses, strict=True))
    observation, _ = env.reset(seed=0, options={"level": "L2"})
    program = make_policy("screw", replace(task, objects=tuple(objects)), SHOWN).begin(observation).program
    carry = next(phase for phase in program.skill.phases if phase.kind == "carry")
    # held lower, and turned about its own axis, which nobody sees
    shown = carry.object_from_tcp.inverse()
    held = Pose.from_position_quaternion([0.0, -0.01, 0.0]) @ shown @ Pose.from_yaw([0, 0, 0], 1.0)
    motion = program.motions.placing(carry, held)
    assert len(motion.goals) == 13
    for k in range(len(motion.goals)):
        cup = motion.then(k).goals[0] @ held
        rim = observation["object_pose"][1, :3] + np.array([0.0, 0.0, 0.5 * heights[1]])
        down = -cup.rotation[2, :2] / np.linalg.norm(cup.rotation[2, :2])
        lip = (cup @ Pose.from_position_quaternion([*(radii[0] * down), 0.5 * heights[0]])).position
        np.testing.assert_allclose(np.linalg.norm((lip - rim)[:2]), 0.028, atol=3e-3)
        assert lip[2] - rim[2] == pytest.approx(0.02, abs=3e-3)
        assert np.degrees(cup.tilt) == pytest.approx(115.0, abs=1.0)
    # a direction that proved blocked is not tried again, unless no other is left
    others = program.motions.placing(carry, held, failed=[0, 2])
    assert len(others.goals) == 11 and others.goals[0].distance_to(motion.goals[1])[0] < 1e-9
    assert program.motions.end_index(carry, 1, [0, 2]) == 3
    assert len(program.motions.placing(carry, held, failed=range(13)).goals) == 13


def test_a_glass_is_lifted_straight_up_where_no_lift_was_shown(env):
    without = replace(SHOWN, segments=tuple(each for each in SHOWN.segments if each.name != "lift"))
    observation, _ = env.reset(seed=0)
    program = make_policy("screw", env.unwrapped.task, without).begin(observation).program
    lift = next(phase for phase in program.skill.phases if phase.kind == "lift")
    here = program.executor.arm.fk(program.executor.q)
    path = program.motions.from_here(lift)
    np.testing.assert_allclose(path[-1].position - here.position, [0.0, 0.0, 0.08], atol=1e-9)
    assert path[-1].distance_to(here)[1] < 1e-9


def test_without_an_approach_the_glass_must_be_in_the_hand(env):
    without = replace(SHOWN, segments=tuple(each for each in SHOWN.segments if each.name != "approach"))
    observation, _ = env.reset(seed=0)
    with pytest.raises(PlanFailed, match="shows no approach"):
        make_policy("screw", env.unwrapped.task, without).begin(observation)


def test_a_recording_that_never_tilts_is_refused(tmp_path):
    file = tmp_path / "upright.npy"
    # franka's tcp is a quarter of a turn from the grip site
    quarter = Pose.from_yaw([0.0, 0.0, 0.0], -0.5 * np.pi)
    np.save(file, np.array([(level_hand(np.array([0.4, 0.1 * k, 0.3]), 0.0) @ quarter).vector for k in range(5)]))
    with pytest.raises(BadDemonstration, match="tilted by 0 deg at most; pouring begins at 92"):
        pour_from_poses(
            demonstration_of(recording_from_table(file, TableRequest(rate=10.0, quaternion="wxyz")), name="upright")
        )


@needs_recording
def test_the_motion_that_a_person_showed_a_real_panda_pours(tmp_path):
    recording = recording_from_table(RECORDING, TableRequest(rate=100.0, units="cm", quaternion="wxyz"))
    raw = demonstration_of(recording, name="real", licence="MIT")
    placed = pour_from_poses(raw)
    save_demonstration(placed.demonstration, tmp_path / "pour_real.npz")
    config = load_config(shipped_config("pour_real"), [f"demonstration={tmp_path / 'pour_real.npz'}"])
    np.testing.assert_allclose(placed.stands, config.env["stands"], atol=1e-3)
    held = tcp_from_glass(GLASSES[SOURCE])
    assert np.degrees((placed.demonstration.path[0] @ held).tilt) < 5.0
    env = gym.make("onedemo/Pour-v0", level="L0", **config.env)
    for level in ("L0", "L1"):
        record = episode(env, level, config=config, shown=placed.demonstration)
        assert record.safe_success, record.detail
    env.close()


def test_what_tilts_a_full_glass_and_nothing_else_must_keep_some_of_the_demonstration(env, monkeypatch):
    answering, go, allow, planned, followed = Planner.answering, ReactivePlanner.go, ArmExecutor.allow, set(), set()
    tilts, wanted = ("held", "target"), []

    def answered(self, request):
        planned.add((tilts in request.allowed, request.must_keep))
        return answering(self, request)

    def allowed(self, contacts):
        wanted[:] = contacts
        allow(self, contacts)

    def gone(self, path, **given):
        followed.add((tilts in wanted, given.get("must_keep", False)))
        go(self, path, **given)

    monkeypatch.setattr(Planner, "answering", answered)
    monkeypatch.setattr(ArmExecutor, "allow", allowed)
    monkeypatch.setattr(ReactivePlanner, "go", gone)
    assert episode(env, "L0", 0).success
    # plans of the return, which pours nothing, are asked for without
    assert (True, True) in planned and (False, False) in planned and (False, True) not in planned
    assert {(True, True), (False, False)} <= followed and (False, True) not in followed
