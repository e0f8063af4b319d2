"""Two hands pour what one hand was shown to pour."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.baselines.factory import make_policy
from onedemo.baselines.programs import bimanual_pour as program
from onedemo.configs.shipped_files import shipped_demonstration
from onedemo.planner.collision.self_collision import pairs_of
from onedemo.planner.geometry import dualquat as dq
from onedemo.planner.geometry.pose import PosePath
from onedemo.planner.imitation.demonstration_files import read_demonstration
from onedemo.planner.imitation.tsia import GUIDE_START, guide_index
from onedemo.planner.resumable import finished


@pytest.fixture(scope="module")
def env():
    made = gym.make("onedemo/BimanualPour-v0")
    yield made
    made.close()


@pytest.fixture(scope="module")
def policy(env):
    return make_policy("screw", env.unwrapped.task, read_demonstration(shipped_demonstration("pour")))


def begun(env, policy, seed, level):
    observation, _ = env.reset(seed=seed, options={"level": level})
    memory = policy.begin(observation)
    held = [memory.executor.held(k, k) for k in range(2)]
    return memory, held


def test_the_glasses_move_to_each_other_as_shown_wherever_it_happens(env, policy):
    memory, held = begun(env, policy, 3, "L2")
    run = memory.program
    guide = guide_index(run._carry, GUIDE_START)
    relatives, ups = [], []
    for place, pour in ((program.PLACES[0], 2.0), (program.PLACES[1], 1.0)):
        choice = run._choice(held, np.array(place), pour, pour - 1.0, -0.5)
        right, left = choice.forth
        source, target = right.with_tool(held[0]), left.with_tool(held[1])
        ups += [pose.rotation[2, 2] for pose in target]
        tail = len(run._carry) - guide
        relative = PosePath(dq.mul(dq.conj(target.dqs), source.dqs))[len(target) - tail :]
        # what the turns of both round glasses leave: distance, height, tilt
        away = relative.positions
        relatives.append(
            np.column_stack([np.hypot(away[:, 0], away[:, 1]), away[:, 2], [p.rotation[2, 2] for p in relative]])
        )
    assert min(ups) > 0.999, "the target stays upright"
    np.testing.assert_allclose(relatives[0], relatives[1], atol=1e-4)
    shown = [pose.rotation[2, 2] for pose in run._carry[guide:]]
    np.testing.assert_allclose(relatives[0][:, 2], shown, atol=5e-3)


@pytest.mark.parametrize("seed, level", [(0, "L0"), (1, "L1"), (1, "L2")])
def test_it_pours(env, policy, seed, level):
    observation, info = env.reset(seed=seed, options={"level": level})
    state, over = None, False
    while not over:
        action, state = policy.predict(observation, state)
        observation, _, terminated, truncated, info = env.step(action)
        over = terminated or truncated or policy.report(state).done
    assert info["success"], policy.report(state)
    assert info["safe"]


def test_what_stands_in_the_way_stops_both_hands(env, policy):
    memory, held = begun(env, policy, 0, "L0")
    hands = memory.executor
    hands.hold(held)
    choice = memory.program._choice(held, np.array(program.PLACES[0]), *_first())
    assert finished(hands.roll_out(choice.forth, program.SLOW)).reason == ""
    middle = choice.forth[0].positions[len(choice.forth[0]) // 3]
    observation = {key: value.copy() for key, value in hands.observation.items()}
    observation["obstacle_active"][0], observation["obstacle_shape"][0] = 1.0, 1.0
    observation["obstacle_size"][0], observation["obstacle_pose"][0] = 0.03, [*middle, 1, 0, 0, 0]
    hands.observation = observation
    assert finished(hands.roll_out(choice.forth, program.SLOW)).reason == "blocked"


def _first():
    pour = program.POUR_YAWS[0]
    return pour, pour + program.SIDES[0], program.HOLDER_YAWS[0]


def test_all_capsules_of_one_arm_are_kept_from_all_of_the_other(env):
    task = env.unwrapped.task
    counts = [len(body) for body in task.bodies]
    pairs = pairs_of(task.arms, task.bodies, apart=3)
    across = {(i, j) for i, j in pairs if i < counts[0] <= j}
    assert len(across) == counts[0] * counts[1]
    assert all(i < j < sum(counts) for i, j in pairs)
