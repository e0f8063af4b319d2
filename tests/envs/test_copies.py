"""Copies of environments: twins to the bit, which disturb each other in nothing."""

from __future__ import annotations

import copy
import gc
import pickle
import subprocess
import sys
import weakref
from functools import partial

import cloudpickle
import gymnasium as gym
import numpy as np
import pytest

import onedemo.envs
from onedemo.envs.errors import RenderingUnavailable
from onedemo.envs.simulation.moving_obstacles import ScheduledObstacle
from onedemo.planner import Sphere

WAYS = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda env: pickle.loads(pickle.dumps(env)),
    "cloudpickle": lambda env: cloudpickle.loads(cloudpickle.dumps(env)),
}
each_way = pytest.mark.parametrize("way", WAYS)
SWINGING = ScheduledObstacle(Sphere(0.03), (0.0, 0.3, 1.0), long=(0.1, 0.0, 0.0), frequency=2.0)
APPEARING = ScheduledObstacle(Sphere(0.04), (-0.1, -0.3, 1.1), delay=0.5)
"""The delay counts from the start of motion 0, so this one is there from the start; `LATE` is not."""
LATE = ScheduledObstacle(Sphere(0.04), (0.1, -0.3, 1.1), motion=1, delay=0.1)
CASES = {name.split("/")[1]: (name, {}, {}) for name in sorted(onedemo.envs.IDS)} | {
    "moving obstacles": ("onedemo/Stack-v0", {"level": "L4"}, {}),
    "obstacles that appear": ("onedemo/PlaceOne-v0", {}, {"obstacles": [SWINGING, APPEARING, LATE]}),
    "twists": ("onedemo/Stack-v0", {"control_mode": "ee_twist", "reward": "dense"}, {}),
    "goal form": ("onedemo/Reach-v0", {"goal_form": True, "control_mode": "joint_velocity"}, {}),
}
SLOW = {
    f"{task} {robot} {level}": (f"onedemo/{task}-v0", {"robot": robot, "level": level}, {})
    for task in ("Stack", "Pour", "Shelve")
    for robot in ("Panda", "Baxter")
    for level in ("L2", "L3", "L4", "F")
}
each_case = pytest.mark.parametrize(
    "case",
    [
        *(pytest.param(case, id=label) for label, case in CASES.items()),
        *(pytest.param(case, id=label, marks=pytest.mark.slow) for label, case in SLOW.items()),
    ],
)


def started(case, steps=15):
    """Environment of a case in the middle of an episode, and what drew the actions."""
    name, options, start = case
    env, rng = gym.make(name, **options), np.random.default_rng(0)
    env.reset(seed=3, options=start)
    for _ in range(steps):
        env.step(rng.uniform(-1.0, 1.0, env.action_space.shape))
    return env, rng


def assert_same(one, other):
    """Compare what an environment returns, to the bit."""
    assert type(one) is type(other)
    if isinstance(one, dict):
        assert one.keys() == other.keys()
        for key in one:
            assert_same(one[key], other[key])
    elif isinstance(one, tuple):
        assert len(one) == len(other)
        for mine, theirs in zip(one, other, strict=True):
            assert_same(mine, theirs)
    elif isinstance(one, np.ndarray):
        assert (one.dtype, one.shape, one.tobytes()) == (other.dtype, other.shape, other.tobytes())
    else:
        assert repr(one) == repr(other)


def assert_twins(env, twins, rng, steps=10):
    """Step all with the same actions, one after the other, and compare every result."""
    for _ in range(steps):
        action = rng.uniform(-1.0, 1.0, env.action_space.shape)
        mine = env.step(action)
        for twin in twins:
            assert_same(mine, twin.step(action))
    inner = env.unwrapped
    for twin in twins:
        for name in ("qpos", "qvel", "act", "qacc_warmstart", "geom_xpos"):
            assert_same(getattr(inner.sim.data, name).copy(), getattr(twin.unwrapped.sim.data, name).copy())


@each_case
def test_copies_go_on_as_the_environment_does(case):
    env, rng = started(case)
    assert len(pickle.dumps(env)) < 600_000, "the state, and not the model"
    twins = [way(env) for way in WAYS.values()]
    twins.append(copy.deepcopy(twins[2]))
    assert_twins(env, twins, rng)

    twins = twins[1:3]
    for seed in (None, 5):
        mine = env.reset(seed=seed, options=case[2])
        for twin in twins:
            assert_same(mine, twin.reset(seed=seed, options=case[2]))
        assert_twins(env, twins, rng, steps=3)
    mine = env.action_space.sample()
    assert all(np.array_equal(mine, twin.action_space.sample()) for twin in twins)


@each_way
@pytest.mark.parametrize("inner", [False, True], ids=["as made", "unwrapped"])
def test_neither_disturbs_the_other(way, inner):
    env, rng = started(CASES["moving obstacles"], steps=5)
    env = env.unwrapped if inner else env
    alone = copy.deepcopy(env)
    twin = WAYS[way](env)
    assert twin.unwrapped is not env.unwrapped and type(twin) is type(env)
    for k in range(10):  # the twin moves otherwise, starts anew and is closed; the environment must not see it
        if k == 4:
            twin.reset(seed=9, options={"level": "L2"})
        twin.step(np.ones(twin.action_space.shape))
        action = rng.uniform(-1.0, 1.0, env.action_space.shape)
        assert_same(env.step(action), alone.step(action))
    twin.close()
    assert_twins(env, [alone], rng, steps=3)


@each_way
def test_a_copy_made_before_the_first_reset_starts_alike_without_a_seed(way):
    env = gym.make("onedemo/Reach-v0")
    twin = WAYS[way](env)
    assert_same(env.reset(), twin.reset())
    assert np.array_equal(env.action_space.sample(), twin.action_space.sample())
    with pytest.raises(gym.error.ResetNeeded):
        WAYS[way](gym.make("onedemo/Reach-v0")).step(env.action_space.sample())


@each_way
def test_a_time_limit_and_a_finished_episode_are_copied(way):
    env = gym.make("onedemo/Reach-v0", max_episode_steps=4)
    env.reset(seed=0)
    env.step(np.zeros(env.action_space.shape))
    twin = WAYS[way](env)
    assert [twin.step(np.zeros(env.action_space.shape))[3] for _ in range(3)] == [False, False, True]


@each_way
def test_an_object_in_the_hand_stays_there(way):
    env = gym.make("onedemo/PlaceOne-v0", level="L0")
    env.reset(seed=0)
    lift = np.array([0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0])
    for _ in range(5):
        env.step(lift)
    twin = WAYS[way](env)
    assert twin.unwrapped.sim.held().any()
    before = twin.step(lift)[0]["object_pose"][0, 2]
    for _ in range(10):
        after = twin.step(lift)[0]["object_pose"][0, 2]
    assert after > before + 0.05 and twin.unwrapped.sim.held().any()


def test_a_copy_has_the_contacts_and_frames_of_the_last_step():
    env, _ = started(CASES["Shelve-v0"])
    mine = env.unwrapped.sim
    assert mine.data.ncon > 0
    for way in WAYS.values():
        theirs = way(env).unwrapped.sim
        for name in ("geom", "dist", "pos", "frame"):
            np.testing.assert_array_equal(getattr(theirs.data.contact, name), getattr(mine.data.contact, name))
        for name in ("xpos", "xmat", "geom_xpos", "geom_xmat", "site_xpos", "qM", "cvel", "time"):
            np.testing.assert_array_equal(getattr(theirs.data, name), getattr(mine.data, name))
        assert_same(mine.read()._asdict(), theirs.read()._asdict())


def test_what_a_user_has_changed_of_the_model_is_copied():
    env, rng = started(CASES["Stack-v0"], steps=2)
    plain = copy.deepcopy(env)
    model = env.unwrapped.sim.model
    model.opt.gravity[2], model.opt.impratio = -3.0, 7.0
    model.geom_friction[:] *= 0.5
    model.vis.global_.fovy = 30.0
    twins = [way(env) for way in WAYS.values()]
    assert all(twin.unwrapped.sim.model.vis.global_.fovy == 30.0 for twin in twins)
    assert_twins(env, twins, rng)
    assert plain.unwrapped.sim.model.opt.gravity[2] == -9.81
    gravity = gym.make("onedemo/Stack-v0").unwrapped.sim.model.opt.gravity
    assert gravity[2] == -9.81, "the compiled scene is as it was"


def test_copies_share_what_never_changes_and_keep_it_read_only():
    env, _ = started(CASES["Pour-v0"], steps=1)
    inner, twin = env.unwrapped, copy.deepcopy(env.unwrapped)
    assert twin.sim.scene is inner.sim.scene and twin.arms[0] is inner.arms[0]
    loaded = pickle.loads(pickle.dumps(inner))
    assert loaded.sim.scene is inner.sim.scene
    for each in (twin, loaded):
        assert not each.arms[0].chain.flags.writeable and not each.task.bodies[0].rows.flags.writeable
        assert not any(array.flags.writeable for array in (each.task.fixtures[0].pose.dq, each.arms[0].lower))


def test_a_dropped_copy_is_gone():
    env, _ = started(CASES["Stack-v0"], steps=1)
    gone = weakref.ref(copy.deepcopy(env).unwrapped.sim)
    gc.collect()
    assert gone() is None


ELSEWHERE = """
import pickle, sys
import numpy as np
env, actions = pickle.load(sys.stdin.buffer)
results = [env.step(action) for action in actions] + [env.reset(), env.step(actions[0])]
sys.stdout.buffer.write(pickle.dumps(results))
"""


@pytest.mark.parametrize("case", ["obstacles that appear", pytest.param("twists", marks=pytest.mark.slow)])
def test_a_pickle_goes_on_in_another_process(case):
    env, rng = started(CASES[case])
    actions = rng.uniform(-1.0, 1.0, (10, *env.action_space.shape))
    sent = pickle.dumps((env, actions))
    done = subprocess.run([sys.executable, "-c", ELSEWHERE], input=sent, capture_output=True, check=True)
    mine = [env.step(action) for action in actions] + [env.reset(), env.step(actions[0])]
    for one, other in zip(mine, pickle.loads(done.stdout), strict=True):
        assert_same(one, other)


@pytest.mark.parametrize(
    "way", ["deepcopy", *(pytest.param(way, marks=pytest.mark.slow) for way in ("copy", "pickle", "cloudpickle"))]
)
def test_a_copy_draws_for_itself_and_is_closed_for_itself(way):
    env = gym.make("onedemo/Stack-v0", render_mode="rgb_array")
    env.reset(seed=0)
    try:
        picture = env.render()
    except RenderingUnavailable as error:
        pytest.skip(str(error))
    twin = WAYS[way](env)
    assert twin.unwrapped._renderer is None
    np.testing.assert_array_equal(twin.render(), picture)
    twin.close()
    np.testing.assert_array_equal(env.render(), picture)
    env.close()
    again = WAYS[way](env)
    np.testing.assert_array_equal(again.render(), picture)
    assert_same(env.step(np.ones(8)), again.step(np.ones(8)))
    again.close()


def test_wrapped_further_and_in_vectors_deep_copies_are_twins():
    flat = gym.wrappers.FlattenObservation(gym.make("onedemo/Stack-v0"))
    flat.reset(seed=1)
    twin = copy.deepcopy(flat)
    action = np.full(8, 0.5)
    assert_same(flat.step(action), twin.step(action))
    # the first Gymnasium's make_vec keeps a generator, which nothing copies
    envs = gym.vector.SyncVectorEnv([partial(gym.make, "onedemo/Reach-v0")] * 2)
    envs.reset(seed=1)
    twins = copy.deepcopy(envs)
    actions = np.full(envs.action_space.shape, 0.5)
    for _ in range(3):
        assert_same(envs.step(actions)[:4], twins.step(actions)[:4])


def test_a_spec_makes_the_environment_again():
    env = gym.make("onedemo/Stack-v0", n_blocks=2)
    again = gym.make(env.spec)
    assert again.spec == env.spec and type(again) is type(env)
    assert_same(env.reset(seed=2), again.reset(seed=2))
