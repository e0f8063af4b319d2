"""A user's own policy: the example of the page runs, and every mistake is one line."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import gymnasium as gym
import pytest

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.baselines.factory import make_policy
from onedemo.bench.cli import main
from onedemo.configs.errors import BadConfig
from onedemo.configs.shipped_files import shipped_demonstration
from onedemo.planner.errors import BadOption
from onedemo.planner.imitation.demonstration_files import read_demonstration

PAGE = Path(__file__).parents[2] / "docs" / "own_policy.md"
BROKEN = """
number = 3

def wrong(task):
    return None

def nothing(task, demonstration, settings):
    return None

def greedy(task, demonstration, settings):
    settings.pop("gain")
    settings["list"].append(1)
    return type("Policy", (), {"predict": lambda *_: None})()

def choosy(task, demonstration, settings):
    from onedemo.planner.errors import BadOption
    raise BadOption("height", "is not a height")
"""


@pytest.fixture(scope="module")
def env():
    made = gym.make("onedemo/Stack-v0")
    yield made
    made.close()


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """The current folder, with the page's file in it and one that is broken in many ways."""
    code = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert len(code) == 1
    (tmp_path / "my_policies.py").write_text(code[0], encoding="utf-8")
    (tmp_path / "broken.py").write_text(BROKEN, encoding="utf-8")
    (tmp_path / "unreadable.py").write_text("def (", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    yield
    for name in ("my_policies", "broken", "unreadable"):
        sys.modules.pop(name, None)


def made(env, name, settings=None):
    demonstration = read_demonstration(shipped_demonstration("stack"))
    return make_policy(name, env.unwrapped.task, demonstration, settings)


def test_the_example_brings_the_hand_above_the_first_block(env):
    policy, state = made(env, "my_policies:Above", {"height": 0.2}), None
    observation, _ = env.reset(seed=1000)
    for _ in range(200):
        action, state = policy.predict(observation, state)
        assert env.action_space.contains(action)
        observation, *_ = env.step(action)
    above = observation["tcp_pose"][0, :3] - observation["object_pose"][0, :3]
    assert above == pytest.approx([0.0, 0.0, 0.2], abs=0.01)


def test_the_command_takes_it(monkeypatch, capsys):
    arguments = ["run", "stack", "method=my_policies:Above", "episodes=1", "video=false", "max_seconds=1"]
    monkeypatch.setattr(sys, "argv", ["onedemo", *arguments])
    with pytest.raises(SystemExit) as stopped:
        main()
    said = capsys.readouterr()
    assert stopped.value.code == 0, said.err
    assert "0 of 1 succeeded" in said.out
    monkeypatch.setattr(sys, "argv", ["onedemo", "run", "stack", "method=my_policies:Below", "episodes=1"])
    with pytest.raises(SystemExit) as stopped:
        main()
    assert stopped.value.code == 2
    assert "my_policies has no 'Below'; of this kind it has: " in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize("change", ["level=T", "tool=[0, 0, 0.1, 0]"])
def test_it_has_no_legs_to_be_moved_in_another_frame(change, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["onedemo", "run", "stack", "method=my_policies:Above", change])
    with pytest.raises(SystemExit) as stopped:
        main()
    assert stopped.value.code == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "tool: my_policies:Above moves the hand itself: only shipped policies can plan" in said


@pytest.mark.parametrize(
    "name, message",
    [
        ("my_policies:", "is not of the form my_package.my_module:MyPolicy"),
        (":Above", "is not of the form"),
        ("my policies:Above", "is not of the form"),
        ("../my_policies:Above", "is not of the form"),
        ("nowhere.at_all:Above", "importing nowhere.at_all: ModuleNotFoundError: No module named 'nowhere'"),
        ("unreadable:Above", "importing unreadable: SyntaxError"),
        ("broken:number", "is a int, not a class or function"),
        ("broken:wrong", r"called with task, demonstration and settings: TypeError: wrong\(\) takes 1"),
        ("broken:nothing", "gives a NoneType without a method predict"),
    ],
)
def test_a_mistake_is_one_line(env, name, message):
    with pytest.raises(BadConfig, match=message) as caught:
        made(env, name)
    assert "\n" not in str(caught.value) and str(caught.value).startswith(f"method: {name}: ")


def test_its_own_complaint_is_left_as_it_is(env):
    with pytest.raises(BadOption, match="option 'height': is not a height"):
        made(env, "broken:choosy")


def test_settings_that_it_changes_stay_as_they_are_in_the_config(env):
    settings = {"gain": 2.0, "list": []}
    made(env, "broken:greedy", settings)
    assert settings == {"gain": 2.0, "list": []}


def test_the_search_path_is_left_as_it_was(env):
    before = list(sys.path)
    made(env, "my_policies:Above")
    assert sys.path == before
