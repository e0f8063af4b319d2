"""The shelving demonstration, and that it shelves elsewhere."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.baselines.factory import make_policy
from onedemo.baselines.programs.skill_program import PATIENCE, SkillProgram
from onedemo.baselines.recording.record_shelve import record_shelve
from onedemo.bench.episodes.episode import run_episode
from onedemo.bench.episodes.scenarios import Scenario
from onedemo.configs.grid import load_config
from onedemo.configs.shipped_files import shipped_config, shipped_demonstration
from onedemo.envs import TASKS
from onedemo.planner.errors import PlanFailed
from onedemo.planner.imitation.demonstration_files import read_demonstration

CONFIG = load_config(shipped_config("shelve"))
SHOWN = read_demonstration(shipped_demonstration("shelve"))


def shelved(seed, level, **arguments):
    env = gym.make("onedemo/Shelve-v0", **arguments)
    policy = make_policy("screw", env.unwrapped.task, SHOWN)
    record, _ = run_episode(env, policy, Scenario(0, seed, level), CONFIG)
    env.close()
    return record


def test_the_shipped_demonstration_replays_to_success_in_the_lower_shelf():
    env = gym.make("onedemo/Shelve-v0", **TASKS["shelve"].recorded_in).unwrapped
    env.reset(seed=0, options={"level": "L0"})
    steps = np.diff(SHOWN.joint_positions, axis=0) / env.control_dt / env.arms[0].velocity_limits
    succeeded = False
    for speeds, grip in zip(steps, SHOWN.gripper[1:], strict=True):
        *_, info = env.step(np.append(speeds, grip))
        succeeded |= info["success"]
    assert succeeded and info["safe"]
    assert info["position_error"].max() < 0.006


@pytest.mark.slow
def test_the_script_gives_the_shipped_demonstration():
    env = gym.make("onedemo/Shelve-v0", **TASKS["shelve"].recorded_in).unwrapped
    again = record_shelve(env)
    np.testing.assert_allclose(again.joint_positions, SHOWN.joint_positions, atol=1e-3)
    assert [each.name for each in again.segments] == [each.name for each in SHOWN.segments]


def test_one_book_from_the_lower_shelfs_demonstration_into_the_upper_one():
    record = shelved(1, "L1", n_books=1)
    assert (record.success, record.safe, record.failure_reason) == (True, True, "")


def test_a_book_that_hangs_in_the_hand_goes_in_along_a_level_way():
    # in Baxter's fingers, at this start, it would hit the shelf's board
    record = shelved(7, "L2", robot="Baxter", n_books=2)
    assert (record.success, record.safe, record.failure_reason) == (True, True, "")


def test_an_insertion_that_proves_blocked_is_tried_again(monkeypatch):
    insert, tries = SkillProgram._insert, []

    def blocked_at_first(self, carry):
        tries.append(carry.name)
        if len(tries) == 1:
            raise PlanFailed("blocked", "by a hand")
        yield from insert(self, carry)

    monkeypatch.setattr(SkillProgram, "_insert", blocked_at_first)
    assert shelved(1, "L1", n_books=1).success and tries == ["insert book0"] * 2


def test_a_book_is_awaited_above_the_stand_but_not_forever():
    env = gym.make("onedemo/Shelve-v0", n_books=1)
    observation, _ = env.reset(seed=1)
    observation["object_pose"][0, 2] = 0.0  # not yet on the stand
    program = make_policy("screw", env.unwrapped.task, SHOWN).begin(observation).program
    start, heights = program.executor.arm.fk(program.executor.q), []
    with pytest.raises(PlanFailed, match="book0 was not handed over"):
        for _ in program.actions():
            heights.append(program.executor.arm.fk(program.executor.q).position[2])
    lift = SHOWN.segment_path("lift")
    assert heights[-1] - start.position[2] == pytest.approx(lift[-1].position[2] - lift[0].position[2], abs=0.01)
    assert heights.count(heights[-1]) >= round(PATIENCE / env.unwrapped.control_dt)
    env.close()


def test_the_hand_opens_as_far_as_the_demonstrated_one():
    openings = {}
    for robot in ("Panda", "Sawyer"):
        env = gym.make("onedemo/Shelve-v0", n_books=1, robot=robot)
        program = make_policy("screw", env.unwrapped.task, SHOWN).begin(env.reset(seed=1)[0]).program
        insert = next(phase for phase in program.skill.phases if phase.kind == "carry")
        openings[robot] = -insert.opening * env.unwrapped.task.gripper_width[0]
        env.close()
    assert -1.0 < SHOWN.gripper[SHOWN.segment("insert").stop + 1] < 0.0
    assert openings["Sawyer"] == pytest.approx(openings["Panda"], rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["Baxter", "Sawyer", "IIWA", "UR5e"])
def test_other_robots_shelve_from_the_same_demonstration(robot):
    record = shelved(0, "L1", robot=robot)
    assert (record.success, record.safe, record.failure_reason) == (True, True, "")


@pytest.mark.slow
@pytest.mark.parametrize("level, seed", [("L1", 21), ("L2", 22)])
def test_one_demonstration_shelves_three_books(level, seed):
    record = shelved(seed, level)
    assert (record.success, record.safe, record.stage) == (True, True, "shelved 3 of 3")


@pytest.mark.slow
def test_obstacles_that_appear_are_gone_round():
    record = shelved(2, "L2", obstacles="paper")
    assert record.success and record.contacts == 0
