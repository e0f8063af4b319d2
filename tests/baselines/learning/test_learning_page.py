"""The page on learned policies: its example trains, and what it writes acts; its tables are true."""

from __future__ import annotations

import json
import re
from pathlib import Path

import gymnasium as gym
import pytest
from helpers.actors import saved_actor
from helpers.policies import LEARNED

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.baselines.factory import make_policy
from onedemo.baselines.learning.actor_card import KEYS
from onedemo.configs.shipped_files import shipped_demonstration
from onedemo.planner.imitation.demonstration_files import read_demonstration

PAGE = (Path(__file__).parents[3] / "docs" / "learning.md").read_text(encoding="utf-8")
CODE = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
ID = "onedemo/PlaceOne-v0"


def test_the_example_trains_an_actor_that_acts(tmp_path, monkeypatch):
    pytest.importorskip("stable_baselines3", reason="needs the extra rl: stable-baselines3 and torch")
    if ID not in gym.registry:
        pytest.skip(f"{ID} is not registered")
    monkeypatch.chdir(tmp_path)
    (example,) = (code for code in CODE if "model.learn" in code)
    assert len([line for line in example.splitlines() if line]) <= 16
    code = example.replace("model.learn(300_000)", "model.learn(130)").replace("episodes=20", "episodes=1")
    code = code.replace("gamma=0.98", "gamma=0.98, buffer_size=200")
    assert code.count("130") == code.count("episodes=1)") == code.count("buffer_size") == 1
    exec(compile(code, "learning.md", "exec"), {})
    env = gym.make(ID)
    settings = {"checkpoint": str(tmp_path / "my_actor.json")}
    policy = make_policy("sac", env.unwrapped.task, read_demonstration(shipped_demonstration("stack")), settings)
    observation, _ = env.reset(seed=0)
    action, _ = policy.predict(observation)
    assert env.action_space.contains(action)
    assert json.loads((tmp_path / "my_actor.json").read_text(encoding="utf-8"))["training"]["steps"] == 130


@pytest.mark.parametrize(
    "code", [code for code in CODE if "model.learn" not in code], ids=["actor", "shown", "residual"]
)
def test_the_other_snippets_run(code):
    names = {}
    exec(compile(code, "learning.md", "exec"), names)
    if "shown" in names:
        for name in re.search(r"# (.*)", code).group(1).split(", "):
            assert hasattr(names["shown"], name), name
    elif "policy" in names:
        assert names["info"]["success"], "the page shows what works"
    else:
        assert names["env"].reset(seed=0)[0]["screw_action"].shape == names["env"].action_space.shape


def test_its_tables_name_every_method_and_every_key():
    page = PAGE.replace(PAGE[PAGE.index("## `onedemo train`") : PAGE.index("## What a learner sees")], "")
    rows = [line.split("|")[1] for line in page.splitlines() if line.startswith("| `")]
    named = [name for row in rows for name in re.findall(r"`([^`]+)`", row)]
    assert sorted(named) == sorted([*LEARNED, *KEYS])
    env = gym.make(ID)
    table = json.loads(Path(saved_actor(env, "sac")).read_text(encoding="utf-8"))
    for key in ("control", "action", "features", "network", "training", "weights"):
        row = next(line for line in PAGE.splitlines() if line.startswith(f"| `{key}`"))
        assert all(f"`{name}`" in row for name in table[key]), key
