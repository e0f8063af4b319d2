"""A task as data: every mistake is one line that names it and says what to write instead."""

from __future__ import annotations

import sys

import gymnasium as gym
import numpy as np
import pytest

import onedemo.envs
from onedemo.bench.cli import main
from onedemo.envs import At, Fixture, Movable, Part, Range, Success, Task, Tolerance, register_task, task_at
from onedemo.envs.dotted_names import BadDottedName
from onedemo.envs.errors import BadTask
from onedemo.envs.tasks.describe import described
from onedemo.planner import Box, Cylinder, Mesh, Pose
from onedemo.planner.errors import BadOption, OneDemoError

CUBE, PAD = Movable("cube", Box((0.04, 0.04, 0.04))), Fixture("pad", Box((0.10, 0.10, 0.01)))
PLACES = {"cube": Range((0.0, -0.15)), "pad": Range((0.0, 0.12))}
MODULE = """
from onedemo.envs import At, Fixture, Movable, Range, Success, Task
from onedemo.planner import Box

CUBE = Task(
    name="cube_on_pad",
    summary="Put a cube on a pad.",
    objects=(Movable("cube", Box((0.04, 0.04, 0.04))),),
    fixtures=(Fixture("pad", Box((0.10, 0.10, 0.01))),),
    start={"cube": Range((0.0, -0.15)), "pad": Range((0.0, 0.12))},
    goals={"cube": At("pad")},
    success=Success(),
)
SHOWN = Task(
    name="cube_shown",
    summary="Put a cube on a pad.",
    objects=CUBE.objects,
    fixtures=CUBE.fixtures,
    start=CUBE.start,
    goals=CUBE.goals,
    success=Success(),
    demonstration="bare.npz",
)
NUMBER = 3
"""


def task(**changes) -> Task:
    """A cube that is put on a pad, with changes."""
    values = {
        "name": "cube_on_pad",
        "summary": "Put a cube on a pad.",
        "objects": (CUBE,),
        "fixtures": (PAD,),
        "start": PLACES,
        "goals": {"cube": At("pad")},
        "success": Success(),
    }
    return Task(**{**values, **changes})


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"name": "Cube On Pad"}, "name: is not of small letters"),
        ({"objects": ()}, "objects: are none"),
        ({"objects": CUBE}, r"objects: is no tuple of Movable: write \(Movable\(…\),\)"),
        ({"objects": (CUBE, CUBE)}, "'cube' is there twice"),
        ({"objects": (CUBE, Movable("pad", Box((0.1, 0.1, 0.1))))}, "'pad' is there twice"),
        ({"objects": (Movable("table", Box((0.1, 0.1, 0.1))),)}, "'table' is a name that the scene has already"),
        (
            {"objects": (CUBE, Movable("lid", Box((0.1, 0.1, 0.1))))},
            "start: does not say where 'lid' stands: write start=",
        ),
        ({"start": {**PLACES, "lid": Range((0, 0))}}, "start: 'lid' is not in the task, which has cube, pad"),
        ({"start": {**PLACES, "cube": (0, 0)}}, "start: of 'cube' is .*; expected a Range"),
        ({"start": {**PLACES, "cube": Range((0, 0, 1))}}, r"expected Range\(\(x, y\), shift=\(L1, L2\)"),
        ({"start": {**PLACES, "cube": Range((0.0, 0.5))}}, r"start: 'cube' at \(0, 0.5\) is off the table"),
        ({"goals": {"cube": At("hole")}}, "goals: 'cube' refers to 'hole', which is not in the task; it has cube, pad"),
        ({"goals": {"cube": At("cube")}}, "goals: 'cube' refers to itself"),
        ({"goals": {"pad": At("cube")}}, "goals: 'pad' is not in the task, which has cube"),
        ({"passes": {"lid": (At("pad"),)}}, "passes: 'lid' is not in the task, which has cube"),
        ({"passes": {"cube": At("pad")}}, r"passes: of 'cube' are At.*; expected \(At\(…\), …\)"),
        ({"passes": {"cube": (At("hole"),)}}, "passes: 'cube' refers to 'hole', which is not in the task"),
        ({"goals": {}}, "success: never comes: give goals, or a condition"),
        ({"success": Success({"lid": Tolerance()})}, "success.tolerances: 'lid' is not in the task"),
        ({"success": Success(undisturbed={"lid": (0.1, 0.1)})}, "success.undisturbed: 'lid' is not in the task"),
        (
            {"success": Success(undisturbed={"cube": 0.1})},
            r"undisturbed: of 'cube' is 0.1; expected \(distance",
        ),
        ({"success": None}, "success: is a NoneType, not a Success"),
        ({"seconds": 0}, "seconds: 0 is not a time"),
    ],
)
def test_a_mistake_is_one_line(changes, message):
    with pytest.raises(BadTask, match=message) as caught:
        task(**changes)
    assert "\n" not in str(caught.value) and str(caught.value).startswith("task ")


def test_goals_must_not_refer_to_each_other_in_a_circle():
    lid = Movable("lid", Box((0.04, 0.04, 0.01)))
    start = {**PLACES, "lid": Range((0.1, 0.0))}
    with pytest.raises(BadTask, match="circle: cube to lid to cube"):
        task(objects=(CUBE, lid), start=start, goals={"cube": At("lid"), "lid": At("cube")})


@pytest.mark.parametrize(
    "parts", ["box", 3, [], [3], Part(Box((1, 1, 1)), rotation=(1, 1, 0, 0)), Part(Box((1, 1, 1)), "ab")]
)
def test_parts_must_be_shapes(parts):
    with pytest.raises(BadOption, match="of 'cube'"):
        Movable("cube", parts)


def made(own: Task, **options):
    return gym.make(register_task(own), **options)


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"start": {**PLACES, "cube": Range((0.0, 0.11))}}, "start: 'cube' and 'pad' overlap by .* mm at L0: move one"),
        (
            {"start": {**PLACES, "cube": Range((-0.34, 0.0))}},
            "start: 'cube' at .* is 0.22 m from the first axis of the Panda",
        ),
        ({"start": {**PLACES, "cube": Range((0, 0), robots={"Robbie": (0, 0)})}}, "names an unknown robot 'Robbie'"),
    ],
)
def test_a_scene_that_cannot_be_is_refused_when_it_is_made(changes, message):
    with pytest.raises(BadTask, match=message) as caught:
        made(task(name="impossible", **changes))
    assert "\n" not in str(caught.value)


def test_ranges_in_which_nothing_fits_are_named(monkeypatch):
    env = made(task(name="crowded", apart=0.2))
    env.reset(seed=0, options={"level": "L2"})  # near each other in the nominal layout: that is meant
    monkeypatch.setattr("onedemo.envs.tasks.arrangement.MAX_DRAWS", 0)
    with pytest.raises(BadTask, match="start: none of 0 layouts drawn at L2 has that all is on the table, in reach of"):
        env.reset(seed=0, options={"level": "L2"})


def test_a_name_is_taken_once():
    with pytest.raises(BadTask, match="name: onedemo/Stack-v0 is registered already: choose another name"):
        register_task(task(name="stack"))
    first = task(name="twice")
    assert register_task(first) == register_task(first) == "onedemo/Twice-v0"
    register_task(task(name="twice"))  # from the same file: it has been changed
    code = "from onedemo.envs import register_task\ndef again(task): return register_task(task)"
    other: dict = {"__file__": "elsewhere.py"}
    exec(code, other)
    with pytest.raises(BadTask, match=r"onedemo/Twice-v0 is registered already by .*test_task.py"):
        other["again"](task(name="twice"))


@pytest.fixture
def module(tmp_path, monkeypatch):
    """A module with tasks in the current folder."""
    (tmp_path / "my_tasks.py").write_text(MODULE, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    yield "my_tasks"
    sys.modules.pop("my_tasks", None)


@pytest.mark.parametrize(
    "path, message",
    [
        ("my_tasks:", "is not of the form my_tasks:MY_TASK"),
        ("../my_tasks:CUBE", "is not of the form"),
        ("nowhere:CUBE", "importing nowhere: ModuleNotFoundError: No module named 'nowhere'"),
        ("my_tasks:PEG", "my_tasks has no 'PEG'; of this kind it has: CUBE"),
        ("my_tasks:NUMBER", "is a int, not a Task: write NUMBER = Task"),
    ],
)
def test_a_path_that_names_no_task_is_refused(module, path, message, monkeypatch, capsys):
    with pytest.raises(BadDottedName, match=message):
        task_at(path)
    monkeypatch.setattr(sys, "argv", ["onedemo", "run", path])
    with pytest.raises(SystemExit) as stopped:
        main()
    said = " ".join(capsys.readouterr().err.split())
    assert stopped.value.code == 2 and path in said


def said_by(monkeypatch, capsys, *arguments: str) -> str:
    """What a refused command says."""
    monkeypatch.setattr(sys, "argv", ["onedemo", *arguments])
    with pytest.raises(SystemExit) as stopped:
        main()
    assert stopped.value.code == 2
    return " ".join(capsys.readouterr().err.split())


def test_a_task_without_a_demonstration_says_how_to_get_one(module, monkeypatch, capsys):
    said = said_by(monkeypatch, capsys, "run", "my_tasks:CUBE")
    assert "demonstration: is not named; record one with 'onedemo demo record my_tasks:CUBE -o FILE.npz'" in said
    said = said_by(monkeypatch, capsys, "demo", "record", "my_tasks:CUBE", "-o", "cube.npz")
    assert "script: is not given" in said


def test_the_name_of_a_file_alone_is_told_how_to_name_a_task_in_it(module, monkeypatch, capsys):
    assert "a task in my_tasks.py is my_tasks:NAME" in said_by(monkeypatch, capsys, "run", "my_tasks")


def test_the_page_says_which_object_is_wider_than_a_hand():
    box, post = Movable("crate", Box((0.12, 0.10, 0.05))), Movable("post", Box((0.06, 0.20, 0.05)))
    start = {"crate": Range((0, -0.2)), "post": Range((0, 0)), "pad": PLACES["pad"]}
    page = described(task(objects=(box, post), start=start, goals={"post": At("pad")}))
    assert "crate is 100 mm wide where it is narrowest; a Panda's hand opens to 79 mm." in page
    assert "post is 6" not in page


def test_a_demonstration_that_shows_no_skill_says_what_is_missing(module, monkeypatch, capsys):
    from dataclasses import replace

    from onedemo.planner import save_demonstration

    shown = onedemo.load_demonstration("stack")
    save_demonstration(replace(shown, object_paths={}, other_joints={}), "bare.npz")
    said = said_by(monkeypatch, capsys, "run", "my_tasks:SHOWN", "episodes=1")
    assert "bare.npz: object_paths: none is recorded" in said
    said = said_by(monkeypatch, capsys, "run", "my_tasks:SHOWN", "demonstration=stack", "episodes=1", "executor=serial")
    assert "none of which the task has; it has cube, pad, table" in said


def test_what_a_predicate_gets_wrong_is_said_with_its_name():
    for also, message in (
        (lambda scene: scene.pose("lid"), "success: also: unknown thing 'lid'; known: cube, pad"),
        (lambda scene: 1 / 0, "success: also: ZeroDivisionError"),
    ):
        env = made(task(name="wrong", success=Success(also=also)))
        with pytest.raises(OneDemoError, match=message):
            env.reset(seed=0)


def test_things_of_many_parts_and_of_files(tmp_path):
    mjcf = '<mujoco><worldbody><body name="cup"><geom type="box" size=".02 .02 .01"/>'
    mjcf += '<geom type="cylinder" size=".005 .02" pos="0 0 .03"/></body></worldbody></mujoco>'
    (tmp_path / "cup.xml").write_text(mjcf, encoding="utf-8")
    parts = onedemo.envs.parts_of_mjcf(tmp_path / "cup.xml")
    assert [type(part.shape) for part in parts] == [Box, Cylinder] and parts[1].at == (0.0, 0.0, 0.03)
    obj = "v 0 0 0\nv 40 0 0\nv 0 40 0\nv 0 0 40\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
    (tmp_path / "wedge.obj").write_text(obj, encoding="utf-8")
    (wedge,) = onedemo.envs.parts_of_mesh(tmp_path / "wedge.obj", scale=0.001)
    assert isinstance(wedge.shape, Mesh)
    corners = Pose.from_position_quaternion(wedge.at, wedge.rotation).matrix @ np.c_[wedge.shape.vertices, np.ones(4)].T
    assert np.allclose(np.sort(corners[:3].T.sum(axis=1)), [0.0, 0.04, 0.04, 0.04], atol=1e-6)
    things = (Movable("cup", parts), Movable("wedge", wedge))
    start = {"cup": Range((0.0, -0.1)), "wedge": Range((0.0, 0.1)), "pad": Range((0.15, 0.0))}
    env = made(task(name="of_files", objects=things, start=start, goals={"cup": At("pad")}))
    observation, _ = env.reset(seed=0, options={"level": "L0"})
    for _ in range(25):
        after, *_ = env.step(np.zeros(8))
    moved = after["object_pose"][:, :3] - observation["object_pose"][:, :3]
    assert np.abs(moved).max() < 1e-3  # they stand
    for path, message in ((tmp_path / "cup.xml", "has no body 'mug'; it has: cup"), (tmp_path / "no.xml", "no.xml")):
        with pytest.raises(BadOption, match=message):
            onedemo.envs.parts_of_mjcf(path, "mug")
