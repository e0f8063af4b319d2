"""Actors of models of Stable-Baselines3 and torch act as these do."""

from __future__ import annotations

import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.baselines.errors import BadActor
from onedemo.baselines.factory import make_policy
from onedemo.baselines.learning.actor_files import load_actor, save_actor
from onedemo.baselines.learning.export_actor import actor_of, network_of
from onedemo.baselines.learning.feature_scaling import FlatFeatures, measured_normalization
from onedemo.baselines.learning.features import Features
from onedemo.configs.shipped_files import shipped_demonstration
from onedemo.planner.errors import BadOption
from onedemo.planner.imitation.demonstration_files import read_demonstration

library = pytest.importorskip("stable_baselines3", reason="needs the extra rl: stable-baselines3 and torch")
torch = pytest.importorskip("torch", reason="needs the extra rl: stable-baselines3 and torch")
SMALL = {"SAC": {"buffer_size": 100}, "PPO": {"n_steps": 8, "batch_size": 8}}
each_kind = pytest.mark.parametrize("kind", SMALL)


@pytest.fixture(scope="module")
def env():
    made = gym.make("onedemo/Reach-v0")
    yield made
    made.close()


@pytest.fixture(scope="module")
def flat(env):
    features = Features.of(env.observation_space)
    return FlatFeatures(env, features, measured_normalization(env, features, episodes=2, steps=40))


def model_of(kind, env, policy="MlpPolicy", activation=None, **more):
    torch.manual_seed(0)
    kwargs = {"net_arch": [32, 16], **({"activation_fn": activation} if activation else {})}
    made = getattr(library, kind)(policy, env, device="cpu", seed=0, policy_kwargs=kwargs, **SMALL[kind], **more)
    with torch.no_grad():  # PPO begins with a last layer that hardly does anything
        for parameter in made.policy.parameters():
            parameter.add_(0.2 * torch.randn_like(parameter))
    return made


@each_kind
@pytest.mark.parametrize("activation", ["ReLU", "Tanh"])
def test_it_acts_as_the_model_does(flat, kind, activation):
    model = model_of(kind, flat, activation=getattr(torch.nn, activation))
    actor = actor_of(
        model, flat.unwrapped.task, method=kind.lower(), features=flat.features, normalization=flat.normalization
    )
    features = 2.0 * np.random.default_rng(1).normal(size=(200, flat.features.size)).astype(np.float32)
    expected = model.predict(features, deterministic=True)[0]
    found = np.array([actor.network(row) for row in features])
    assert np.abs(found - expected).max() < 1e-5 < np.ptp(expected, axis=0).min()


@each_kind
def test_the_policy_acts_as_the_model_does_in_the_environment(env, flat, kind, tmp_path):
    model = model_of(kind, flat)
    model.learn(12)
    method, task = kind.lower(), env.unwrapped.task
    actor = actor_of(model, task, method=method, features=flat.features, normalization=flat.normalization)
    assert actor.training.algorithm == kind and actor.training.steps >= 12
    demonstration = read_demonstration(shipped_demonstration("stack"))
    policy = make_policy(method, task, demonstration, {"checkpoint": str(save_actor(actor, tmp_path / "trained"))})
    observation, _ = env.reset(seed=1)
    for _ in range(20):
        action, _ = policy.predict(observation)
        expected = model.predict(flat.observation(observation), deterministic=True)[0]
        np.testing.assert_allclose(action, expected, atol=1e-5)
        observation, *_ = env.step(action)


@each_kind
def test_a_model_of_the_dict_itself_sees_it_raw(env, kind):
    model = model_of(kind, env, "MultiInputPolicy")
    actor = actor_of(model, env.unwrapped.task, method=kind.lower())
    observation, _ = env.reset(seed=2)
    for _ in range(5):
        expected = model.predict(observation, deterministic=True)[0]
        np.testing.assert_allclose(actor(observation), expected, atol=1e-5)
        observation, *_ = env.step(expected)


def test_the_goal_form_of_an_environment_is_acted_in_too(tmp_path):
    goals = gym.make("onedemo/Reach-v0", goal_form=True)
    model = model_of("SAC", goals, "MultiInputPolicy", replay_buffer_class=library.HerReplayBuffer)
    actor = actor_of(model, goals.unwrapped.task, method="sac-her")
    policy = make_policy("sac-her", goals.unwrapped.task, None, {"checkpoint": str(save_actor(actor, tmp_path))})
    observation, _ = goals.reset(seed=0)
    expected = model.predict(observation, deterministic=True)[0]
    np.testing.assert_allclose(policy.predict(observation)[0], expected, atol=1e-5)
    batch = {key: np.stack([value, value]) for key, value in observation.items()}
    np.testing.assert_allclose(policy.predict(batch)[0], [expected, expected], atol=1e-5)


@pytest.mark.parametrize("squashed", [True, False])
def test_plain_layers_will_do(env, squashed, tmp_path):
    torch.manual_seed(0)
    features = Features.of(env.observation_space)
    nn = torch.nn
    layers = [nn.Linear(features.size, 16), nn.ReLU(), nn.Linear(16, 16, bias=False), nn.ReLU(), nn.Linear(16, 7)]
    model = nn.Sequential(*layers, *([nn.Tanh()] if squashed else []))
    actor = load_actor(save_actor(actor_of(model, env.unwrapped.task, method="bc", features=features), tmp_path))
    x = 3.0 * torch.randn(50, features.size)
    expected = model(x).detach().clamp(-1.0, 1.0).numpy()
    np.testing.assert_allclose([actor.network(row) for row in x.numpy()], expected, atol=1e-5)


@pytest.mark.parametrize("kind, method", [("SAC", "sac"), ("PPO", "ppo")])
def test_a_zip_is_read_only_by_who_says_so(env, flat, kind, method, tmp_path):
    path, task = tmp_path / "model.zip", env.unwrapped.task
    model = model_of(kind, env, "MultiInputPolicy")
    model.save(path)
    with pytest.raises(BadActor, match=r"model\.zip: file: is a zip archive, .* allow_pickle=true"):
        make_policy(method, task, None, {"checkpoint": str(path)})
    policy = make_policy(method, task, None, {"checkpoint": str(path), "allow_pickle": True})
    observation, _ = env.reset(seed=2)
    expected = model.predict(observation, deterministic=True)[0]
    np.testing.assert_allclose(policy.predict(observation)[0], expected, atol=1e-5)
    model_of(kind, flat).save(path)
    with pytest.raises(BadActor, match="observation_space: is a flat box, and the zip does not say of what"):
        make_policy(method, task, None, {"checkpoint": str(path), "allow_pickle": True})
    whole = path.read_bytes()
    for end in range(4, len(whole), len(whole) // 20):
        path.write_bytes(whole[:end])
        with pytest.raises(BadActor) as caught:
            make_policy(method, task, None, {"checkpoint": str(path), "allow_pickle": True})
        assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    "layers, message",
    [
        (lambda nn: [nn.Linear(5, 4), nn.GELU(), nn.Linear(4, 7)], "layer 1 is GELU among gelu; expected ReLU or Tanh"),
        (lambda nn: [nn.Linear(5, 4), nn.Linear(4, 7)], "layer 1 is Linear"),
        (lambda nn: [nn.Linear(5, 4), nn.ReLU()], "has 2 layers; expected linear ones"),
        (lambda nn: [nn.Linear(5, 5), nn.ReLU(), nn.Linear(5, 5), nn.Tanh(), nn.Linear(5, 7)], "among relu, tanh"),
        (lambda nn: [nn.Conv1d(1, 1, 1)], "layer 0 is Conv1d; expected Linear"),
        (lambda nn: [], "has 0 layers"),
    ],
)  # fmt: skip
def test_other_layers_are_refused(layers, message):
    with pytest.raises(BadOption, match=message):
        network_of(torch.nn.Sequential(*layers(torch.nn)))


def test_what_it_has_not_seen_or_is_not_is_refused(env, flat):
    model, task = model_of("PPO", flat), env.unwrapped.task
    with pytest.raises(BadOption, match=r"'features': has \d+ numbers; the model sees \d+"):
        actor_of(model, task, method="ppo", features=Features.of(env.observation_space, relative=False))
    with pytest.raises(BadOption, match="'features': is missing: the model sees a vector; give features and normal"):
        actor_of(model, task, method="ppo")
    with pytest.raises(BadOption, match="'residual_scale': is missing: give that of the environment"):
        actor_of(model, task, method="residual", features=flat.features)
    with pytest.raises(BadOption, match="is a int; an actor is made of SAC, TQC, PPO"):
        actor_of(3, task, method="ppo", features=flat.features)
    model.policy.mlp_extractor.policy_net.register_forward_hook(lambda module, given, made: 2.0 * made)
    with pytest.raises(BadOption, match="acts otherwise than its layers alone"):
        actor_of(model, task, method="ppo", features=flat.features)


def test_nothing_of_it_is_imported_before_it_is_needed():
    code = (
        "import sys, pkgutil, importlib, onedemo.baselines, onedemo.bench.cli\n"
        "for each in pkgutil.walk_packages(onedemo.baselines.__path__, 'onedemo.baselines.'): "
        "importlib.import_module(each.name)\n"
        "print(sorted({'torch', 'stable_baselines3'} & set(sys.modules)))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert run.stdout.strip() == "[]", run.stderr
