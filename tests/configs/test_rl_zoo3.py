"""The hyper-parameter files for rl_zoo3: read strictly, for ids that there are, of arguments that there are."""

from __future__ import annotations

import inspect
from importlib import import_module
from pathlib import Path

import pytest

import onedemo.configs
from onedemo.configs.strict_yaml import load_mapping
from onedemo.envs import IDS

FOLDER = Path(onedemo.configs.__file__).parent / "rl_zoo3"
LIBRARIES = {"sac": "stable_baselines3", "ppo": "stable_baselines3", "tqc": "sb3_contrib"}
TASKS = ["onedemo/Reach-v0", "onedemo/PlaceOne-v0", "onedemo/TiltPour-v0", "onedemo/InsertOne-v0"]
OF_THE_ZOO = {"n_timesteps", "n_envs"}
"""What is not given to the algorithm."""
each_file = pytest.mark.parametrize("name", LIBRARIES)


def values(table):
    for value in table.values():
        if isinstance(value, dict):
            yield from values(value)
        else:
            yield value


@each_file
def test_a_file_is_plain_and_for_the_small_tasks(name):
    table = load_mapping(FOLDER / f"{name}.yaml")
    assert list(table) == TASKS and set(TASKS) <= set(IDS)
    for settings in table.values():
        assert settings["policy"] == "MultiInputPolicy"
        assert isinstance(settings["n_timesteps"], int)
        # rl_zoo3 evaluates texts as Python, and YAML 1.1, which it reads, takes 3e-4 for one
        texts = [value for value in values(settings) if isinstance(value, str)]
        assert set(texts) <= {"MultiInputPolicy", "auto"}
        numbers = [value for value in values(settings) if isinstance(value, float)]
        assert all("e" not in repr(value) or "." in repr(value) for value in numbers)


@each_file
def test_yaml_as_rl_zoo3_reads_it_says_the_same(name):
    yaml = pytest.importorskip("yaml", reason="needs PyYAML")
    path = FOLDER / f"{name}.yaml"
    assert yaml.safe_load(path.read_text(encoding="utf-8")) == load_mapping(path)


@each_file
def test_every_argument_is_one_of_the_algorithm(name):
    library = pytest.importorskip(LIBRARIES[name], reason=f"needs {LIBRARIES[name]}")
    known = set(inspect.signature(getattr(library, name.upper())).parameters)
    policies = import_module(f"{LIBRARIES[name]}.{name}.policies")
    for settings in load_mapping(FOLDER / f"{name}.yaml").values():
        assert set(settings) - OF_THE_ZOO <= known
        policy = inspect.signature(getattr(policies, settings["policy"])).parameters
        assert set(settings["policy_kwargs"]) <= set(policy)


def test_no_file_is_left_out():
    assert {path.stem for path in FOLDER.glob("*")} == set(LIBRARIES)
