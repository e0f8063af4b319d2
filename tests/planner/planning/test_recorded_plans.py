"""Recordings of people's hands, planned to other goals among obstacles, and judged.

The kinesthetic ones are poses of the end effector in the robot's base frame, in centimeters; the arm is the Panda as
it stands at the table, so they are moved by the pose of its base. The teleoperation was recorded as joints, which
give the hand's path in the world. A goal is the last pose of the motion, moved by up to 10 cm and turned about the
vertical by up to half a radian, that some clear posture reaches; the start is the recorded one's posture.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from helpers.random_scenes import SETTINGS, any_shape, anyhow, at, base_gap, clear_posture, log_of, panda

from onedemo.planner.control.inverse_kinematics import inverse_kinematics
from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.geometry.shapes import Obstacle
from onedemo.planner.imitation.demonstration import Demonstration
from onedemo.planner.imitation.segmentation import resampled, trimmed
from onedemo.planner.judge.certify import certify
from onedemo.planner.planning.planner import Planner
from onedemo.planner.planning.planning_scene import PlanningScene
from onedemo.planner.recordings.import_recording import demonstration_of
from onedemo.planner.recordings.pose_columns import TableRequest
from onedemo.planner.recordings.pose_table import recording_from_table
from onedemo.planner.recordings.teleoperation import recording_from_teleoperation
from onedemo.planner.robot.arm import Arm

DATA = Path(__file__).parents[4] / "shared" / "data"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the raw recordings are not here")
TABLES = ("pouring", "bottle2shelf")
MOTIONS = (*TABLES, "approach", "transfer")


@cache
def world_from_base() -> Pose:
    """Where the Panda stands: its first joint is 333 mm above the base."""
    row = panda()[0].chain[0]
    return Pose.from_position_quaternion(row[4:7], row[:4]) @ at([0.0, 0.0, -0.333])


def table(name: str) -> Path:
    return DATA / f"panda_kinesthetic_{name}.npy"


@cache
def from_table(file: Path, name: str) -> Demonstration:
    """The demonstration of a recording in centimeters."""
    return demonstration_of(
        recording_from_table(file, TableRequest(rate=50.0, units="cm", quaternion="wxyz")), name=name
    )


def motion(name: str) -> PosePath:
    """A recorded motion of the tcp in the world, in steps of 5 mm."""
    if name in TABLES:
        demo = from_table(table(name), name)
        return resampled(demo.segment_path(demo.segments[0].name).moved(world_from_base()), 0.005)
    recording = recording_from_teleoperation(DATA / "panda_teleop_stack.npz", panda()[0])
    demo = demonstration_of(recording, name="stack", names=("approach", "transfer"))
    return resampled(trimmed(demo.segment_path(name), 0.02), 0.005)


def posture(arm: Arm, pose: Pose, rng: np.random.Generator) -> np.ndarray:
    """Joints at a pose, as near to the middle of their limits as some seeds give."""
    found = [inverse_kinematics(arm, pose, panda()[2])]
    found += [inverse_kinematics(arm, pose, rng.uniform(arm.lower, arm.upper)) for _ in range(8)]
    return max((q for q in found if q is not None), key=arm.margin)


def problem_of(name: str, seed: int):
    """Start, goal and up to two obstacles near the way; ends and some goal posture are clear."""
    arm, body, _ = panda()
    path, rng = motion(name), np.random.default_rng([MOTIONS.index(name), seed])
    start = posture(arm, path[0], np.random.default_rng(0))
    while True:
        turn = Pose.from_yaw([0, 0, 0], rng.uniform(-0.5, 0.5)) @ at([0, 0, 0], path[-1].quaternion)
        goal = at(path[-1].position + rng.uniform(-0.1, 0.1, 3), turn.quaternion)
        obstacles = []
        for _ in range(rng.integers(3)):
            between = path[0].position + rng.uniform(0.3, 0.7) * (goal.position - path[0].position)
            obstacles.append(Obstacle(any_shape(rng, 0.15), anyhow(rng, between + rng.normal(size=3) * 0.08)))
        scene = PlanningScene.of(arm, body, obstacles, SETTINGS)
        if scene.slack(start) < 0.015 or scene.tool_slack(goal) < 0.005 or base_gap(body, obstacles) < 0.01:
            continue
        if clear_posture(arm, scene, goal, start, rng) is not None:
            return start, goal, tuple(obstacles)


def solved_of(name: str, seeds: range) -> int:
    """How many motions are solved; every one of them is judged."""
    arm, body, _ = panda()
    planner, solved = Planner(arm, body), 0
    for seed in seeds:
        start, goal, obstacles = problem_of(name, seed)
        found = planner.plan(motion(name), start, goal, obstacles, seed=seed)
        if found.success:
            certificate = certify(log_of(found, arm, body, goal, obstacles))
            assert certificate.ok, f"{name} {seed}: {certificate.reasons}"
            np.testing.assert_array_equal(found.joints[0], start)
            solved += 1
        else:
            assert found.reason
    return solved


@pytest.mark.parametrize("name", MOTIONS)
def test_recorded_motions_are_planned_to_other_goals(name):
    assert solved_of(name, range(10)) >= 9


@pytest.mark.slow
@pytest.mark.parametrize("name", MOTIONS)
def test_recorded_motions_are_planned_to_a_hundred_goals(name):
    assert solved_of(name, range(100, 200)) >= 95


@pytest.mark.parametrize("name", TABLES)
def test_centimeters_become_meters(name):
    raw = np.load(table(name), allow_pickle=False)
    demo = from_table(table(name), name)
    np.testing.assert_allclose(demo.path.positions, raw[:, :3] / 100.0, atol=1e-6)
    reach = np.linalg.norm(motion(name).positions - world_from_base().position, axis=1)
    assert reach.min() > 0.2 and reach.max() < 0.86, "within the Panda's reach"
    np.testing.assert_allclose(world_from_base().vector, [-0.56, 0.0, 0.912, 1.0, 0.0, 0.0, 0.0], atol=1e-9)


@pytest.mark.parametrize("name", TABLES)
def test_signs_repeats_and_a_trembling_hand_change_little(name, tmp_path):
    """Flipped signs change no bit of the path but the sign; repeated and shaken samples hardly anything."""
    raw, rng = np.load(table(name), allow_pickle=False), np.random.default_rng(0)
    spoilt = raw.copy()
    spoilt[:, 3:] *= rng.choice([-1.0, 1.0], (len(raw), 1))
    spoilt = np.repeat(spoilt, rng.integers(1, 4, len(raw)), axis=0)
    spoilt[:, :3] += rng.normal(size=(len(spoilt), 3)) * 0.002
    np.save(tmp_path / "spoilt.npy", spoilt)
    demo = from_table(tmp_path / "spoilt.npy", name)
    path = resampled(demo.path.moved(world_from_base()), 0.005)
    arm, body, _ = panda()
    start, goal, obstacles = problem_of(name, 0)
    found = Planner(arm, body).plan(path, start, goal, obstacles)
    assert found.success
    assert certify(log_of(found, arm, body, goal, obstacles)).ok


@pytest.mark.parametrize("name", TABLES)
def test_a_recording_is_planned_as_it_is_too(name):
    """All of its samples, not resampled."""
    demo = from_table(table(name), name)
    arm, body, _ = panda()
    start, goal, _ = problem_of(name, 0)
    found = Planner(arm, body).plan(demo.path.moved(world_from_base()), start, goal)
    assert found.success
    assert certify(log_of(found, arm, body, goal, ())).ok
