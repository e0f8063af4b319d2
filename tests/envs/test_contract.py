"""What every environment id promises."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import warnings
from functools import partial

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import onedemo.envs
from onedemo.envs.errors import BadAction, RenderingUnavailable
from onedemo.planner.errors import OneDemoError

ALL = sorted(onedemo.envs.IDS)
CASES = [(name, {}) for name in ALL] + [
    *[(f"onedemo/{task}-v0", {"robot": "Baxter"}) for task in ("Stack", "Pour", "Shelve")],
    ("onedemo/Stack-v0", {"level": "L4"}),
]
LABELS = [" ".join([name.split("/")[1], *options.values()]) for name, options in CASES]
each_id = pytest.mark.parametrize("name", ALL)
each_case = pytest.mark.parametrize("name, options", CASES, ids=LABELS)
MODES = ("joint_velocity", "ee_twist")


@pytest.fixture(scope="module", params=CASES, ids=LABELS)
def env(request):
    name, options = request.param
    made = gym.make(name, **options)
    yield made
    made.close()


def remade(env):
    """Another environment like this one."""
    return gym.make(env.spec.id, **env.spec.kwargs)


def episode_hash(env, seed, steps=100, **options):
    """Digest of everything that an episode says, to the bit."""
    digest = hashlib.sha256()
    rng = np.random.default_rng(seed)
    observation, info = env.reset(seed=seed, options=options)
    for _ in range(steps):
        for key in sorted(observation):
            digest.update(observation[key].tobytes())
        for key in sorted(info):
            value = info[key]
            digest.update(value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode())
        observation, reward, terminated, truncated, info = env.step(rng.uniform(-1, 1, env.action_space.shape))
        digest.update(repr((reward, terminated, truncated)).encode())
    return digest.hexdigest()


@each_case
@pytest.mark.parametrize("mode", MODES)
def test_gymnasiums_checker_has_nothing_to_say(name, options, mode):
    env = gym.make(name, control_mode=mode, **options)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=True)


def test_the_same_seed_gives_the_same_bits(env):
    first = episode_hash(env, 7)
    episode_hash(env, 8, level="L2")
    assert episode_hash(env, 7) == first
    assert episode_hash(remade(env), 7) == first
    assert episode_hash(env, 8) != first


@pytest.fixture(scope="module")
def hashes_elsewhere():
    """For each label the hash of its episode in another process, which makes the environments in another order."""
    code = (
        "import sys; sys.path.insert(0, sys.argv[1]); import gymnasium; from test_contract import *\n"
        "for label, (name, options) in reversed(list(zip(LABELS, CASES))):\n"
        "    print(label, episode_hash(gymnasium.make(name, **options), 7), sep='=')"
    )
    run = [sys.executable, "-c", code, __file__.rsplit("/", 1)[0]]
    done = subprocess.run(run, capture_output=True, text=True, check=True, env={**os.environ, "PYTHONHASHSEED": "5"})
    return dict(line.split("=") for line in done.stdout.splitlines())


def test_another_process_gives_the_same_bits(env, request, hashes_elsewhere):
    label = request.node.callspec.id
    assert hashes_elsewhere[label] == episode_hash(env, 7)


def test_observations_are_in_the_space_and_never_change_afterwards(env):
    rng = np.random.default_rng(0)
    observation, _ = env.reset(seed=0)
    for _ in range(200):
        kept = {key: value.copy() for key, value in observation.items()}
        following, reward, *_ = env.step(rng.uniform(-1, 1, env.action_space.shape))
        for key, value in observation.items():
            np.testing.assert_array_equal(value, kept[key])
            assert value.dtype == np.float64
        assert env.observation_space.contains(following)
        assert isinstance(reward, float)
        observation = following


def test_starts_differ_in_every_entry_that_a_start_may_change(env):
    starts = [env.reset(seed=seed)[0] for seed in range(3)]
    # robosuite's tasks start with the arm at home, and have no goal poses
    keys = (
        ("object_pose",) if "Robosuite" in env.spec.id else ("joint_positions", "tcp_pose", "object_pose", "goal_pose")
    )
    for key in keys:
        assert np.ptp([start[key] for start in starts], axis=0).max() > 1e-3, key


def test_an_observation_that_never_changes_is_said_to_be_constant(env):
    seen, rng = [], np.random.default_rng(0)
    for seed in range(4):
        seen.append(env.reset(seed=seed, options={"level": "L2"})[0])
        seen += [env.step(rng.uniform(-1, 1, env.action_space.shape))[0] for _ in range(30)]
    page = env.unwrapped.__doc__
    rows = {line.split("`")[1]: line for line in page.splitlines() if line.startswith("| `")}
    assert set(seen[0]) <= set(rows)
    for key in seen[0]:
        constant = not np.ptp([each[key] for each in seen], axis=0).any()
        # obstacles are none at this level; motions take longer than these steps
        if not key.startswith("obstacle_") and key not in ("motion_index", "bead_fraction"):
            assert not constant or "constant" in rows[key], key


@pytest.mark.parametrize("mode", MODES)
def test_actions_beyond_the_bounds_are_the_bounds(mode):
    env = gym.make("onedemo/Stack-v0", control_mode=mode).unwrapped
    outcomes = []
    for action in (np.full(env.action_space.shape, 7.0), np.ones(env.action_space.shape)):
        env.reset(seed=1)
        outcomes.append(env.step(action)[0]["joint_positions"])
    np.testing.assert_array_equal(*outcomes)


@pytest.mark.parametrize(
    "spoil, message",
    [
        (lambda a: a[:-1], r"action: has shape \(7,\); expected \(8,\)"),
        (lambda a: np.append(a, 0), r"action: has shape \(9,\)"),
        (lambda a: a[None], r"action: has shape \(1, 8\)"),
        (lambda a: np.where(np.arange(8) == 3, np.nan, a), "action: entry 3 is not finite"),
        (lambda a: np.where(np.arange(8) == 5, -np.inf, a), "action: entry 5 is not finite"),
        (lambda a: "x", "action: is not an array of real numbers"),
        (lambda a: {}, "action: is not an array of real numbers"),
        (lambda a: None, "action: is not an array of real numbers"),
        (lambda a: a.astype(str), "action: is not an array of real numbers"),
        (lambda a: a + 1j, "action: is not an array of real numbers, but of complex128"),
        (lambda a: [[0.0], [0.0, 0.0]], "action: is not an array of numbers"),
    ],
)
def test_bad_actions_are_refused_and_change_nothing(spoil, message):
    env = gym.make("onedemo/Stack-v0").unwrapped
    env.reset(seed=0)
    before, controls = env.sim.data.time, env.sim.data.ctrl.copy()
    with pytest.raises(BadAction, match=message) as caught:
        env.step(spoil(np.full(8, 0.5)))
    assert "\n" not in str(caught.value)
    assert env.sim.data.time == before
    np.testing.assert_array_equal(env.sim.data.ctrl, controls)


def test_a_twist_that_is_not_finite_is_refused():
    env = gym.make("onedemo/Stack-v0", control_mode="ee_twist").unwrapped
    env.reset(seed=0)
    with pytest.raises(BadAction, match="entry 2 is not finite"):
        env.step(np.array([0, 0, np.inf, 0, 0, 0, np.nan]))
    assert env.sim.data.time == 0.0


@pytest.mark.parametrize(
    "same",
    [
        lambda a: a.tolist(),
        lambda a: a.astype(np.float32),
        lambda a: np.repeat(a, 2)[::2],
        lambda a: np.frombuffer(a.tobytes()),
    ],
    ids=["list", "single precision", "strided", "read-only"],
)
def test_actions_of_every_array_type_act_alike_and_compile_nothing(same, env):
    from onedemo.envs.simulation.state import command

    env.reset(seed=1)
    env.step(np.zeros(env.action_space.shape))
    compiled = len(command.signatures)

    outcomes, action = [], np.linspace(-0.5, 0.5, env.action_space.shape[0])
    for given in (action.astype(np.float32).astype(float), same(action.astype(np.float32).astype(float))):
        env.reset(seed=1)
        outcomes.append(env.step(given)[0]["joint_positions"])
    np.testing.assert_array_equal(*outcomes)
    assert len(command.signatures) == compiled


@each_id
@pytest.mark.parametrize(
    "options, message",
    [
        ({"robot": "R2D2"}, "unknown robot 'R2D2'; known: Panda"),
        ({"level": "L9"}, r"unknown level 'L9'; known: L0 \(the demonstration's own layout\), L1 "),
        ({"level": 1}, "unknown level 1; known: L0"),
        ({"control_mode": "torque"}, "unknown control_mode 'torque'; known: joint_velocity, ee_twist"),
        ({"reward": "huge"}, "unknown reward 'huge'; known: sparse, dense"),
        ({"control_frequency": 60}, "control_frequency': 60 Hz does not divide 500 Hz; allowed: 10, 20, 25"),
        ({"control_frequency": 0}, "0 is not a positive whole number"),
        ({"control_frequency": 50.0}, "50.0 is not a positive whole number"),
    ],
)
def test_bad_options_are_named_with_what_is_allowed(name, options, message):
    with pytest.raises(OneDemoError, match=message):
        gym.make(name, **options)


def test_a_typing_error_in_the_id_is_gymnasiums_own_error():
    with pytest.raises(gym.error.NameNotFound, match="Stack"):
        gym.make("onedemo/Stac-v0")


def test_an_id_can_be_made_by_its_module():
    assert gym.make("onedemo.envs:onedemo/Stack-v0").spec.id == "onedemo/Stack-v0"


def test_importing_registers_without_a_simulator():
    code = "import sys, onedemo.envs; print({'mujoco', 'robosuite'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


def test_without_a_drawing_library_everything_but_pictures_works(monkeypatch):
    monkeypatch.setattr("onedemo.envs.simulation.opengl.backends", lambda: [])
    env = gym.make("onedemo/Stack-v0", render_mode="rgb_array")
    env.reset(seed=0)
    env.step(np.zeros(8))
    with pytest.raises(RenderingUnavailable, match=r"no OpenGL library found.*apt install libegl1") as caught:
        env.render()
    assert "\n" not in str(caught.value)


def test_pictures_show_something_and_leave_the_physics_alone():
    plain, drawn = (gym.make("onedemo/Stack-v0", render_mode=mode) for mode in (None, "rgb_array"))
    for each in (plain, drawn):
        each.reset(seed=3)
    for _ in range(3):
        try:
            picture = drawn.render()
        except RenderingUnavailable as error:
            pytest.skip(str(error))
        assert (picture.shape, picture.dtype) == ((480, 640, 3), np.uint8)
        assert picture.std() > 10
        one, other = (each.step(np.ones(8))[0] for each in (plain, drawn))
        np.testing.assert_array_equal(one["joint_positions"], other["joint_positions"])
    drawn.close()
    with pytest.raises(OneDemoError, match="unknown render_mode"):
        gym.make("onedemo/Stack-v0", render_mode="ascii")


def test_wrappers_of_gymnasium_work():
    flat = gym.wrappers.FlattenObservation(gym.make("onedemo/Stack-v0"))
    observation, _ = flat.reset(seed=0)
    assert flat.observation_space.contains(observation)
    short = gym.make("onedemo/Stack-v0", max_episode_steps=3)
    short.reset(seed=0)
    assert [short.step(np.zeros(8))[3] for _ in range(3)] == [False, False, True]


@pytest.mark.parametrize(
    "name, context",
    [
        ("onedemo/Stack-v0", "fork"),
        pytest.param("onedemo/Stack-v0", "spawn", marks=pytest.mark.slow),
        *[pytest.param(name, way, marks=pytest.mark.slow) for name in ALL[:-1] for way in ("fork", "spawn")],
    ],
)
def test_vector_environments_work_in_processes(name, context):
    make = [partial(gym.make, f"onedemo.envs:{name}")] * 2
    async_envs, sync_envs = gym.vector.AsyncVectorEnv(make, context=context), gym.vector.SyncVectorEnv(make)
    try:
        for envs in (async_envs, sync_envs):
            envs.reset(seed=4)
        action = np.full(sync_envs.action_space.shape, 0.3)
        one, other = (envs.step(action)[0] for envs in (async_envs, sync_envs))
        for key in one:
            np.testing.assert_array_equal(one[key], other[key])
    finally:
        async_envs.close()
        sync_envs.close()


@each_id
def test_every_task_can_be_drawn(name):
    env = gym.make(name, render_mode="rgb_array")
    env.reset(seed=0)
    try:
        picture = env.render()
    except RenderingUnavailable as error:
        pytest.skip(str(error))
    assert (picture.shape, picture.dtype) == ((480, 640, 3), np.uint8)
    assert picture.std() > 10
    env.close()


@pytest.mark.parametrize("resets", [200, pytest.param(1000, marks=pytest.mark.slow)])
def test_memory_stays_flat_over_resets(env, resets):
    def resident():
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * 4096 / 2**20

    # placing moving obstacles takes long
    resets //= 1 if env.unwrapped.level == "L1" else 10
    for _ in range(20):
        env.reset()
    before = resident()
    for _ in range(resets):
        env.reset()
        env.step(np.zeros(env.action_space.shape))
    assert resident() - before < 2.0
