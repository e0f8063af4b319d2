"""Actors: evaluated to the bit, kept as files, and whatever else is in such a file is refused in one line."""

from __future__ import annotations

import copy
import hashlib
import io
import json
import os
import pickle
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from helpers.actors import random_actor, random_network
from safetensors.numpy import save

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.baselines.errors import BadActor
from onedemo.baselines.learning.actor import Actor
from onedemo.baselines.learning.actor_files import MAX_BYTES, load_actor, save_actor
from onedemo.baselines.learning.network import Network
from onedemo.planner.errors import BadOption, BadShape, NotFinite

ODD = [None, True, -1, 0, 1.5, 1e308, 2**70, "", "a\nb\x1b[31m", "x" * 5000, [], {}, [[]], [None], {"": {}}]
"""What a value in the .json is replaced by."""


@pytest.fixture(scope="module")
def env():
    made = gym.make("onedemo/Reach-v0")
    yield made
    made.close()


@pytest.fixture(scope="module")
def actor(env):
    return random_actor(env, hidden=(8,))


@pytest.fixture
def saved(actor, tmp_path):
    """The .json of the actor."""
    return save_actor(actor, tmp_path / "some.actor")


def weights_of(card: Path) -> Path:
    return card.with_suffix(".safetensors")


def rewritten(card: Path, data: bytes) -> None:
    """Other weights, announced as an attacker would."""
    weights_of(card).write_bytes(data)
    table = json.loads(card.read_text(encoding="utf-8"))
    table["weights"] = {"bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}
    card.write_text(json.dumps(table), encoding="utf-8")


def outcome(card: Path) -> Actor | BadActor:
    """The actor that is read, or the one line that is said; anything else fails the test."""
    try:
        return load_actor(card)
    except BadActor as error:
        said = str(error)
        assert said.isprintable() and len(said) < 1000, said
        assert card.stem in said
        return error


def refused(card: Path) -> str:
    error = outcome(card)
    assert isinstance(error, BadActor)
    return str(error)


def tensors(actor: Actor) -> dict[str, np.ndarray]:
    pairs = zip(actor.network.weights, actor.network.biases, strict=True)
    return {f"layers.{k}.{name}": part for k, pair in enumerate(pairs)
            for name, part in zip(("weight", "bias"), pair, strict=True)}  # fmt: skip


@pytest.mark.parametrize("activation", ["relu", "tanh"])
@pytest.mark.parametrize("output", ["tanh", "clip"])
def test_a_network_is_what_its_formula_says(activation, output):
    network, rng = random_network((5, 7, 3), 1, activation, output), np.random.default_rng(0)
    for _ in range(20):
        x = 3.0 * rng.normal(size=5).astype(np.float32)
        hidden = network.weights[0].astype(float) @ x + network.biases[0]
        hidden = np.maximum(hidden, 0.0) if activation == "relu" else np.tanh(hidden)
        last = network.weights[1].astype(float) @ hidden + network.biases[1]
        expected = np.tanh(last) if output == "tanh" else np.clip(last, -1.0, 1.0)
        found = network(x)
        assert found.dtype == np.float32
        np.testing.assert_allclose(found, expected, atol=1e-5)


def test_what_is_no_network_is_refused():
    with pytest.raises(BadShape, match=r"weights of layer 1 has shape \(2, 3\); expected \(out, 4\)"):
        Network((np.zeros((4, 5)), np.zeros((2, 3))), (np.zeros(4), np.zeros(2)))
    with pytest.raises(BadShape, match=r"biases of layer 0 has shape \(3,\)"):
        Network((np.zeros((4, 5)),), (np.zeros(3),))
    with pytest.raises(NotFinite, match=r"weights of layer 0 .* \(0, 0\)"):
        Network((np.full((1, 1), 1e300),), (np.zeros(1),))
    with pytest.raises(BadOption, match="'gelu' is not one of relu, tanh"):
        Network((np.zeros((1, 1)),), (np.zeros(1),), "gelu")
    with pytest.raises(BadOption, match="0 weights"):
        Network((), ())


@pytest.mark.parametrize("threads", ["1", "4"])
def test_another_process_gives_the_same_bits_whatever_its_threads(threads):
    code = (
        "import sys; sys.path.insert(0, sys.argv[1]); import hashlib, numpy as np\n"
        "from helpers.actors import random_network\n"
        "network = random_network((97, 256, 256, 7)); rng = np.random.default_rng(0); digest = hashlib.sha256()\n"
        "for _ in range(50): digest.update(network(rng.normal(size=97).astype(np.float32)).tobytes())\n"
        "print(digest.hexdigest())"
    )
    network, rng, digest = random_network((97, 256, 256, 7)), np.random.default_rng(0), hashlib.sha256()
    for _ in range(50):
        digest.update(network(rng.normal(size=97).astype(np.float32)).tobytes())
    environment = {**os.environ, "OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads, "PYTHONHASHSEED": "5"}
    folder = str(Path(__file__).parents[2])
    run = subprocess.run([sys.executable, "-c", code, folder], capture_output=True, text=True, env=environment)
    assert run.stdout.strip() == digest.hexdigest(), run.stderr


def test_a_file_gives_back_the_same_actor(env, actor, saved, tmp_path):
    for path in (saved, weights_of(saved), tmp_path / "some.actor"):
        read = load_actor(path)
        for name in ("method", "task", "robot", "control_mode", "frequency", "features", "residual_scale", "training"):
            assert getattr(read, name) == getattr(actor, name), name
        assert read.versions == actor.versions and "onedemo" in read.versions
        observation, _ = env.reset(seed=1)
        np.testing.assert_array_equal(read(observation), actor(observation))
    again = save_actor(load_actor(saved), tmp_path)
    assert again == tmp_path / "actor.json" and load_actor(tmp_path).features == actor.features
    assert again.read_bytes() == saved.read_bytes()
    assert weights_of(again).read_bytes() == weights_of(saved).read_bytes()


def test_parts_that_do_not_fit_are_refused(actor):
    with pytest.raises(BadOption, match=r"'network': is for 3 features; there are \d+"):
        replace(actor, network=random_network((3, 7)))
    with pytest.raises(BadOption, match="'residual_scale': has 2 entries; the action has 7"):
        replace(actor, residual_scale=(1.0, 1.0))


def test_a_file_that_is_cut_is_refused_wherever_it_is_cut(saved):
    whole, text = weights_of(saved).read_bytes(), saved.read_bytes()
    header = 8 + int.from_bytes(whole[:8], "little")
    for end in [*range(header + 1), *range(header + 1, len(whole), 101)]:
        weights_of(saved).write_bytes(whole[:end])
        assert "it is cut" in refused(saved)
        rewritten(saved, whole[:end])
        refused(saved)
        saved.write_bytes(text)
    weights_of(saved).write_bytes(whole)
    for end in range(0, len(text) - 2, 3):
        saved.write_bytes(text[:end])
        refused(saved)


def test_a_file_that_is_changed_is_refused_and_one_that_lies_is_an_actor_or_one_line(saved):
    whole, rng = weights_of(saved).read_bytes(), np.random.default_rng(0)
    header = 8 + int.from_bytes(whole[:8], "little")
    read = 0
    for trial in range(400):
        data = bytearray(whole)
        for _ in range(rng.integers(1, 4)):
            data[rng.integers(header if trial % 2 else len(data))] ^= int(rng.integers(1, 256))
        weights_of(saved).write_bytes(data)
        assert "SHA-256" in refused(saved) or bytes(data) == whole
        rewritten(saved, bytes(data))
        found = outcome(saved)
        read += isinstance(found, Actor)
        if isinstance(found, Actor):
            assert all(np.isfinite(each).all() for each in found.network.weights)
        rewritten(saved, whole)
    assert 20 < read < 380


def test_headers_that_lie_are_refused(actor, saved):
    whole, good = weights_of(saved).read_bytes(), tensors(actor)
    size = int.from_bytes(whole[:8], "little")
    table, data = json.loads(whole[8 : 8 + size]), whole[8 + size :]
    name = "layers.0.weight"

    def with_header(header: object, length: int | None = None, text: bytes | None = None) -> bytes:
        head = json.dumps(header).encode() if text is None else text
        head = head.ljust(size)
        return (len(head) if length is None else length).to_bytes(8, "little") + head + data

    lies = [
        with_header(table, 2**63),
        with_header(table, 0),
        with_header(table, size - 1),
        with_header({**table, name: {**table[name], "shape": [2**40, 2**40]}}),
        with_header({**table, name: {**table[name], "shape": [-1, 3]}}),
        with_header({**table, name: {**table[name], "dtype": "F64"}}),
        with_header({**table, name: {**table[name], "dtype": "BF16"}}),
        with_header({**table, name: {**table[name], "data_offsets": [0, 2**62]}}),
        with_header({**table, name: {**table[name], "data_offsets": [8, 4]}}),
        with_header([]),
        with_header(None, text=b"\xff" * size),
        with_header(None, text=b"[" * size),
        with_header(None, text=b"nothing"),
        save({key: part.astype(np.float64) for key, part in good.items()}),
        save({**good, "more": np.zeros(3, np.float32)}),
        save({key: part for key, part in good.items() if key != name}),
        save({**{key: part for key, part in good.items() if key != name}, "layers.7.weight": good[name]}),
        save({**good, name: good[name].T.copy()}),
        save({**good, name: np.full_like(good[name], np.nan)}),
        save({**good, "layers.1.bias": np.full_like(good["layers.1.bias"], np.inf)}),
    ]
    for lie in lies:
        rewritten(saved, lie)
        refused(saved)
    rewritten(saved, save({**good, name: np.full_like(good[name], np.nan)}))
    assert refused(saved).endswith("some.actor.safetensors: layers.0.weight: holds a value that is not finite")
    rewritten(saved, whole)
    assert isinstance(outcome(saved), Actor)


def leaves(value, path=()):
    """Paths to every value in nested tables and lists; of long lists, to the first two."""
    yield path
    if isinstance(value, dict):
        for key in value:
            yield from leaves(value[key], (*path, key))
    elif isinstance(value, list):
        for index in range(min(len(value), 2)):
            yield from leaves(value[index], (*path, index))


def replaced(table, path, value):
    table = copy.deepcopy(table)
    if not path:
        return value
    inner = table
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    return table


def test_every_value_of_the_json_may_be_anything(saved):
    table = json.loads(saved.read_text(encoding="utf-8"))
    places = list(leaves(table))
    assert len(places) > 60
    for path in places:
        for value in ODD:
            saved.write_text(json.dumps(replaced(table, path, value)), encoding="utf-8")
            found = outcome(saved)
            # a text for the reader, a number of the training, or what is equal to it all the same
            free = ("method", "task", "robot", "control", "config_hash", "versions", "training", "features")
            assert isinstance(found, BadActor) or path[0] in free or value in (replaced_at(table, path),), (path, value)
    for path in places:
        if path and isinstance(path[-1], str) and path[0] not in ("versions", "observation") and "settings" not in path:
            without = copy.deepcopy(table)
            inner = without
            for key in path[:-1]:
                inner = inner[key]
            del inner[path[-1]]
            saved.write_text(json.dumps(without), encoding="utf-8")
            assert "is missing" in refused(saved)


def replaced_at(table, path):
    for key in path:
        table = table[key]
    return table


def test_bytes_of_the_json_may_be_anything(saved):
    text, rng = saved.read_bytes(), np.random.default_rng(0)
    for _ in range(400):
        data = bytearray(text)
        for _ in range(rng.integers(1, 4)):
            data[rng.integers(len(data))] = int(rng.integers(256))
        saved.write_bytes(data)
        outcome(saved)


@pytest.mark.parametrize(
    "key, value, message",
    [
        ("format_version", 2, "format_version: is 2; this program reads 1"),
        ("colour", 1, "colour: is unknown; allowed: format_version, method"),
        ("observation", {"tcp_pose": [1, 7]}, "content: unknown feature"),
        ("action", {"shape": [8], "low": -1, "high": 1}, r"action.shape: is \[8\]; the network gives \[7\]"),
        ("action", {"shape": [7], "low": -2, "high": 1}, r"action.low: is -2; actions are in \[-1, 1\]"),
        ("residual_scale", [0.1], "residual_scale.*has 1 entries; the action has 7"),
        ("network", {"sizes": [5, 7], "activation": "relu", "output": "tanh"}, r"network.sizes\[0\]: is 5; there are"),
        ("weights", {"bytes": MAX_BYTES + 1, "sha256": ""}, f"weights.bytes: is {MAX_BYTES + 1}; at most {MAX_BYTES}"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named(saved, key, value, message):
    table = json.loads(saved.read_text(encoding="utf-8"))
    saved.write_text(json.dumps({**table, key: value}), encoding="utf-8")
    with pytest.raises(BadActor, match=message):
        load_actor(saved)


def test_features_that_this_program_would_order_otherwise_are_refused(saved):
    table = json.loads(saved.read_text(encoding="utf-8"))
    names = table["features"]["names"]
    names[0], names[1] = names[1], names[0]
    saved.write_text(json.dumps(table), encoding="utf-8")
    assert f"features.names[0]: is {names[0]!r}; this program sees {names[1]!r} there" in refused(saved)


def test_a_json_announces_nothing_that_is_made_before_it_is_known_to_be_there(saved):
    table = json.loads(saved.read_text(encoding="utf-8"))
    table["observation"]["tcp_pose"] = [2**40, 7]
    saved.write_text(json.dumps(table), encoding="utf-8")
    assert "features.names: has" in refused(saved)
    table = json.loads(saved.read_text(encoding="utf-8").replace(str(2**40), "1"))
    table["network"]["sizes"] = [table["network"]["sizes"][0], 2**40, 7]
    saved.write_text(json.dumps(table), encoding="utf-8")
    assert "weights.bytes: is" in refused(saved)


class Effect:
    """What leaves a file behind when it is read as a pickle."""

    def __init__(self, path: Path):
        self.path = path

    def __reduce__(self):
        return (Path.touch, (self.path,))


def test_pickles_are_refused_and_not_read(saved, tmp_path):
    mark = tmp_path / "ran"
    bad = pickle.dumps(Effect(mark))
    pickle.loads(bad)
    assert mark.exists()
    mark.unlink()
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as file:
        file.writestr("data", json.dumps({"clip_range": 1}))
        file.writestr("policy.pth", bad)
    for name in ("model.zip", "model.pkl", "model", "other.json", "other.safetensors"):
        for data, word in ((bad, "pickle"), (archive.getvalue(), "zip archive")):
            path = tmp_path / name
            path.write_bytes(data)
            with pytest.raises(BadActor) as caught:
                load_actor(path)
            assert word in str(caught.value) or path.suffix == ".safetensors"
            assert "\n" not in str(caught.value)
            path.unlink()
    for data in (bad, archive.getvalue()):
        rewritten(saved, data)
        refused(saved)
    assert not mark.exists()


def test_files_that_are_not_there_or_are_something_else_are_named(saved, tmp_path):
    with pytest.raises(BadActor, match=r"none\.json: file: does not exist"):
        load_actor(tmp_path / "none")
    (tmp_path / "notes.txt").write_text("hello", encoding="utf-8")
    with pytest.raises(BadActor, match=r"notes\.txt: file: is no actor, which is NAME\.json beside NAME\.safetensors"):
        load_actor(tmp_path / "notes.txt")
    weights_of(saved).unlink()
    assert "some.actor.safetensors: file: does not exist" in refused(saved)
    os.mkfifo(weights_of(saved))
    assert "some.actor.safetensors: file: does not exist" in refused(saved)
    with pytest.raises(BadActor, match="file: cannot be written"):
        save_actor(load_actor(save_actor(random_actor(gym.make("onedemo/Reach-v0")), tmp_path)), tmp_path / "no" / "a")


def test_what_is_too_large_is_not_read(saved):
    with weights_of(saved).open("r+b") as file:
        file.truncate(MAX_BYTES + 1)
    assert "it is cut, or another's" in refused(saved)
    with saved.open("r+b") as file:
        file.truncate(2**30)
    assert "at most 1048576 are read" in refused(saved)
