"""What was tried with the opponents: each file runs, spares the reported seeds, and has the default in its grid."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import pytest
from helpers.policies import PROGRAMS, installed
from tune_opponents import RESERVED, nested

from onedemo.baselines.factory import settings_of
from onedemo.configs.strict_yaml import load_mapping

FOLDER = Path(__file__).parents[2] / "configs" / "tuning"
OPPONENTS = [name for name in PROGRAMS if name != "tsia" and not name.startswith("screw")]


def test_every_opponent_was_tuned():
    assert sorted(path.stem for path in FOLDER.glob("*.yaml")) == OPPONENTS


@pytest.mark.parametrize("name", installed(*OPPONENTS))
def test_a_grid_has_the_default_in_it_and_spares_the_reported_seeds(name):
    config = load_mapping(FOLDER / f"{name}.yaml")
    assert config["method"] == name
    assert not set(range(config["seed"], config["seed"] + config["scenarios"])) & set(RESERVED)
    keys = list(config["grid"])
    tried = [settings_of(name, nested(keys, values)) for values in product(*config["grid"].values())]
    assert settings_of(name) in tried
    assert len(set(map(repr, tried))) == len(tried) > 1
