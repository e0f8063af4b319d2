"""Metrics against closed forms, published numbers and the simulator's own word."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.bench.episodes.episode import episode_record, play, run_episode
from onedemo.bench.episodes.scenarios import Scenario
from onedemo.bench.metrics.carry_segments import carries, carrying_tilt, tilts
from onedemo.bench.metrics.clearance import Solids
from onedemo.bench.metrics.demonstration_distance import (
    FUMBLING,
    deviation,
    length_of,
    shown,
    turning_of,
    way_ratio,
)
from onedemo.bench.metrics.metric_table import METRICS
from onedemo.bench.metrics.metrics import first_motion, metrics_of
from onedemo.bench.metrics.smoothness import log_dimensionless_jerk, sparc
from onedemo.bench.metrics.trace import Trace, TraceRecorder
from onedemo.configs.grid import RunConfig
from onedemo.configs.shipped_files import shipped_demonstration
from onedemo.envs import TASKS
from onedemo.envs.simulation.moving_obstacles import ScheduledObstacle
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import Box, Capsule, Sphere
from onedemo.planner.imitation.demonstration_files import read_demonstration
from onedemo.planner.imitation.segmentation import trimmed

PHYSICS_DT = 0.002
STACK = read_demonstration(shipped_demonstration("stack"))


def made(n=100, objects=1, z=None, held=None, tilt=None):
    """A trace of one arm at 50 Hz whose tcp and objects go 1 m along x in two seconds."""
    time = 0.02 * np.arange(n)
    tcp = np.tile([0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0], (n, 1, 1))
    tcp[:, 0, 0] = 0.5 * time
    poses = np.tile([0.0, 0.0, 0.9, 1.0, 0.0, 0.0, 0.0], (n, objects, 1))
    if z is not None:
        poses[:, 0, 2] = z
    if tilt is not None:
        poses[:, 0, 3], poses[:, 0, 4] = np.cos(0.5 * tilt), np.sin(0.5 * tilt)
    grasp = np.zeros((n, 1, objects), dtype=bool)
    if held is not None:
        grasp[:, 0, 0] = held
    none = np.zeros((n, 3, 7))
    nobody = (none[:, :, 0] > 0, none, np.zeros(3), np.zeros((3, 3)))
    return Trace(time, np.zeros((n, 7)), np.arange(7)[None], tcp, poses, grasp, *nobody)


def test_smoothness_is_what_was_published():
    """The numbers in the documentation of the authors' own implementation, for the same signal."""
    signal = np.exp(-5.0 * np.arange(-1.0, 1.0, 0.01) ** 2)
    assert sparc(signal, 100.0) == pytest.approx(-1.41403, abs=1e-5)
    assert log_dimensionless_jerk(signal, 100.0) == pytest.approx(-5.81636, abs=1e-5)


def test_the_jerk_of_the_smoothest_reach_is_known_in_closed_form():
    """Minimum-jerk speed 30 s^2 (1 - s)^2: peak 1.875, integral of the squared jerk 720, so -ln(720 / 1.875^2)."""
    s = np.linspace(0.0, 1.0, 4001)
    speed = 30.0 * s**2 * (1.0 - s) ** 2
    expected = -math.log(720.0 / 1.875**2)
    assert log_dimensionless_jerk(speed, 4000.0) == pytest.approx(expected, abs=2e-3)


@pytest.mark.parametrize("measure", [log_dimensionless_jerk, sparc])
def test_smoothness_knows_no_units_and_prefers_one_move_to_two(measure):
    s = np.linspace(0.0, 1.0, 501)
    one = 30.0 * s**2 * (1.0 - s) ** 2
    assert measure(7.0 * one, 100.0) == pytest.approx(measure(one, 100.0))
    assert measure(np.concatenate([one, one]), 100.0) < measure(one, 100.0) - 0.1
    assert measure(one + 0.3 * np.sin(200.0 * s), 100.0) < measure(one, 100.0)


@pytest.mark.parametrize("measure", [log_dimensionless_jerk, sparc])
def test_what_does_not_move_is_not_judged(measure):
    assert measure(np.zeros(100), 50.0) is None
    assert measure(np.zeros(0), 50.0) is None
    assert measure(np.ones(3), 50.0) is None


def test_spectral_arc_length_is_that_of_time_scaled_too():
    s = np.linspace(0.0, 1.0, 1001)
    speed = 30.0 * s**2 * (1.0 - s) ** 2
    assert sparc(speed, 500.0) == pytest.approx(sparc(speed[::2], 250.0), abs=0.02)


def test_lengths_of_a_circle_and_of_a_turn():
    angle = np.linspace(0.0, 2.0 * np.pi, 2001)
    assert length_of(np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])) == pytest.approx(2.0 * np.pi, rel=1e-5)
    half = 0.5 * angle
    quaternions = np.column_stack([np.cos(half), 0 * half, 0 * half, np.sin(half)])
    quaternions[::3] *= -1.0
    assert turning_of(quaternions) == pytest.approx(2.0 * np.pi, abs=1e-9)


def test_a_carry_is_what_is_held_and_lifted_and_a_flicker_does_not_cut_it():
    z, held = np.full(100, 0.9), np.zeros(100, dtype=bool)
    held[10:80], z[20:70] = True, 1.0
    held[40:45] = False
    (carry,) = carries(made(z=z, held=held))
    assert (carry.first, carry.last) == (10, 79)
    assert np.array_equal(np.flatnonzero(carry.aloft) + 10, np.arange(20, 70))
    assert carries(made(held=held)) == []
    assert carries(made(z=z)) == []
    held[40:55] = False
    assert len(carries(made(z=z, held=held))) == 1, "what is grasped in the air has not been lifted again"


def test_tilt_counts_while_carried_only():
    z, held, tilt = np.full(100, 0.9), np.ones(100, dtype=bool), np.zeros(100)
    held[:5], z[20:70] = False, 1.0
    tilt[30:40], tilt[80:90] = 0.2, 1.0
    trace = made(z=z, held=held, tilt=tilt)
    most, integral = carrying_tilt(trace, carries(trace))
    assert most == pytest.approx(0.2)
    assert integral == pytest.approx(0.2 * 10 * 0.02)
    assert carrying_tilt(trace, []) == (None, None)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.3, np.pi / 2, np.pi - 1e-6])
def test_tilt_is_the_angle_to_the_vertical_whatever_the_yaw(angle):
    leaning = Pose.from_position_quaternion([0, 0, 0], [np.cos(angle / 2), np.sin(angle / 2), 0, 0])
    poses = [(Pose.from_yaw([0, 0, 0], yaw) @ leaning).vector for yaw in (0.0, 1.0, -2.5)]
    assert tilts(np.array(poses)) == pytest.approx(angle, abs=1e-8)


def test_pouring_ends_the_carry():
    """The source comes nearer to the target along x and is there from x = 0.5 - 0.15 on."""
    trace = made(objects=2, held=np.ones(100, dtype=bool), tilt=np.zeros(100))
    trace.objects[:, 0, 0], trace.objects[:, 1, 0] = 0.5 * trace.time, 0.5
    (carry,) = carries(trace, poured_into=1)
    assert trace.time[carry.aloft][-1] == pytest.approx(0.7, abs=0.03)


def test_the_demonstration_itself_has_no_deviation_and_a_shaken_one_has_as_much_as_it_was_shaken():
    wanted = shown(STACK, "stack")
    assert wanted is not None
    segment = STACK.segment("transfer")
    path = trimmed(STACK.path[segment.start : segment.stop + 1], FUMBLING)
    moved = path.moved(Pose.from_yaw([0.3, -0.2, 0.1], 1.1))
    z, n = np.full(len(moved), 1.0), len(moved)
    z[0] = 0.9
    trace = replace(made(n, z=z, held=np.ones(n, dtype=bool)), tcp=np.array(moved.vectors)[:, None])
    (carry,) = carries(trace)
    assert deviation(trace, carry, n - 1, wanted) < 0.004
    assert way_ratio(trace, carry, n - 1, wanted) == pytest.approx(1.0, abs=0.15)
    shaken = trace.tcp.copy()
    shaken[n // 3 : -1, 0, 2] += 0.1
    far = deviation(replace(trace, tcp=shaken), carry, n - 1, wanted)
    assert 0.08 < far < 0.13


def test_first_motion_is_when_the_first_joint_moves():
    trace = made()
    assert first_motion(trace) is None
    trace.joints[30:, 3] = 0.01
    assert first_motion(trace) == pytest.approx(0.6)


SHAPES = [Sphere(0.05), Box((0.06, 0.1, 0.08)), Capsule(0.04, 0.1)]


def recorded(env, seed, steps, obstacles):
    """A trace of an arm that sways, and the simulator's smallest distance."""
    recorder = TraceRecorder(env)
    _, info = env.reset(seed=seed, options={"obstacles": obstacles})
    recorder(env, None)
    rng = np.random.default_rng(seed)
    sway = rng.uniform(-0.6, 0.6, env.action_space.shape)
    for k in range(steps):
        *_, info = env.step(sway * np.sin(0.06 * k + np.arange(len(sway))))
        recorder(env, None)
    return recorder.trace(), info


@pytest.fixture(scope="module")
def stack():
    env = gym.make("onedemo/Stack-v0")
    yield env, Solids(env.unwrapped.sim)
    env.close()


@pytest.mark.parametrize("seed", range(12))
def test_fcl_and_the_simulator_agree_on_a_state(stack, seed):
    """At rest both see the same state: MuJoCo's distance and fcl's are of the same hulls and primitives."""
    env, solids = stack
    rng = np.random.default_rng(seed)
    place = tuple(rng.uniform([0.0, -0.35, 1.0], [0.3, 0.35, 1.4]))
    turn = rng.normal(size=4)
    obstacle = ScheduledObstacle(SHAPES[seed % 3], place, tuple(turn / np.linalg.norm(turn)))
    trace, info = recorded(env, seed, 0, [obstacle])
    found = solids.clearance(trace)
    assert found.smallest == pytest.approx(max(info["min_obstacle_distance"], 0.0), abs=1e-5)


@pytest.mark.parametrize("seed", range(4))
def test_fcl_and_the_simulator_agree_on_an_episode(stack, seed):
    """Up to how far a link goes in one physics step, by which MuJoCo's poses are older than its joints."""
    env, solids = stack
    swinging = ScheduledObstacle(SHAPES[seed % 3], (0.25, 0.0, 1.25), long=(0.0, 0.1, 0.0), frequency=2.0)
    still = ScheduledObstacle(SHAPES[(seed + 1) % 3], (0.05, -0.35, 1.2))
    trace, info = recorded(env, seed, 120, [swinging, still])
    found = solids.clearance(trace)
    speed = np.abs(np.diff(trace.tcp[:, 0, :3], axis=0)).max() / trace.dt
    assert found.smallest == pytest.approx(max(info["min_obstacle_distance"], 0.0), abs=(speed + 0.5) * PHYSICS_DT)


def test_what_moves_is_met_where_it_is_at_that_tick(stack):
    """An obstacle that comes nearer to an arm at rest: the smallest distance is that of the last tick alone."""
    env, solids = stack
    recorder = TraceRecorder(env)
    coming = ScheduledObstacle(Sphere(0.05), (0.3, 0.0, 1.2), long=(0.0, 0.3, 0.0), frequency=1.0, phase=-1.2)
    env.reset(seed=0, options={"obstacles": [coming]})
    recorder(env, None)
    for _ in range(25):
        *_, info = env.step(np.zeros(8))
        recorder(env, None)
    found = solids.clearance(recorder.trace())
    assert found.second == pytest.approx(0.5)
    assert found.smallest == pytest.approx(info["min_obstacle_distance"], abs=1e-4)


def test_clearance_without_culling_is_the_same(stack, monkeypatch):
    env, solids = stack
    trace, _ = recorded(env, 3, 20, [ScheduledObstacle(Sphere(0.05), (0.2, 0.1, 1.2))])
    found = solids.clearance(trace)
    monkeypatch.setattr(
        Solids, "_at_least", lambda self, trace, ticks, *_: np.full((len(ticks), len(self.geoms)), -1.0)
    )
    assert solids.clearance(trace) == found
    assert found.second is not None


def test_a_touch_is_a_clearance_of_zero(stack):
    env, solids = stack
    env.reset(seed=0)
    x, y, z = env.unwrapped.sim.read().tcp_pose[0, :3]
    trace, info = recorded(env, 0, 0, [ScheduledObstacle(Sphere(0.03), (x, y, z + 0.1))])
    assert info["n_contacts"] == 1
    assert solids.clearance(trace).smallest == 0.0


def test_what_is_not_there_is_no_obstacle(stack):
    env, solids = stack
    trace, _ = recorded(env, 0, 3, [])
    assert solids.clearance(trace) == (None, None, None)
    later = ScheduledObstacle(Sphere(0.03), (0.2, 0.0, 1.2), motion=5)
    assert solids.clearance(recorded(env, 0, 3, [later])[0]) == (None, None, None)


def test_a_trace_is_kept_in_a_file_to_single_precision(stack, tmp_path):
    env, solids = stack
    trace, _ = recorded(env, 1, 30, [ScheduledObstacle(Box((0.06, 0.1, 0.08)), (0.25, 0.0, 1.2))])
    trace.save(tmp_path / "deep" / "x.npz")
    again = Trace.load(tmp_path / "deep" / "x.npz")
    assert again.held.dtype == bool
    assert np.abs(again.joints - trace.joints).max() < 1e-6
    assert again.shape(0).size == pytest.approx((0.06, 0.1, 0.08))
    assert solids.clearance(again).smallest == pytest.approx(solids.clearance(trace).smallest, abs=1e-6)


class Idle:
    """A policy that does nothing, then raises the arm a little."""

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        action = np.zeros(8)
        action[3] = 0.2 if (state or 0) >= 5 else 0.0
        return action, (state or 0) + 1


def test_an_episode_is_recorded_with_its_metrics_and_trace(stack, tmp_path):
    env = gym.make("onedemo/Stack-v0", level="L3", max_episode_steps=20)
    config = RunConfig(name="x", task="stack", method="idle", demonstration="stack", level="L3")
    scenario = Scenario(4, 9, "L3")
    record = episode_record(env, play(env, Idle(), scenario), scenario, config, tmp_path)
    again, _ = run_episode(env, Idle(), Scenario(4, 9, "L3"), config)
    assert record.cell == config.digest()
    assert record.metrics == again.metrics
    assert record.metrics["clearance"] == pytest.approx(record.clearance, abs=1e-3)
    assert record.metrics["time_to_goal"] is None
    assert record.metrics["first_motion"] == pytest.approx(0.14, abs=0.03)
    assert len(record.tick_us) == 4
    trace = Trace.load(tmp_path / f"{config.digest()}-4.npz")
    assert len(trace.time) == 21


def test_every_metric_is_explained():
    traced = made(z=np.linspace(0.9, 1.1, 100), held=np.ones(100, dtype=bool), objects=2)
    env = gym.make("onedemo/Pour-v0")
    numbers = dict.fromkeys(key for facts in TASKS.values() for key in facts.task_metrics.values())
    known = set()
    for task in TASKS:
        found = metrics_of(
            traced, Solids(env.unwrapped.sim), task, {key: [0.1] for key in numbers}, STACK, success=True
        )
        known |= set(found)
        assert all(value is None or math.isfinite(value) for value in found.values())
    assert known == set(METRICS)
    env.close()


def test_the_documentation_explains_every_metric():
    text = (Path(__file__).parents[3] / "docs" / "report.md").read_text(encoding="utf-8")
    for metric in METRICS.values():
        assert f"| {metric.title} | {metric.meaning} | {metric.better or '–'} |" in text
