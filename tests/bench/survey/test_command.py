"""`onedemo robot survey`: lists are checked, a small robot is measured and judged, what is missing is skipped."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers.models.urdf_text import joint, link, written

from onedemo.bench.cli import main
from onedemo.bench.robot.load_robot import RobotRequest, load_robot
from onedemo.bench.survey import command, measured_robot
from onedemo.bench.survey.page import is_bad, page
from onedemo.bench.survey.robot_list import read_robot_list
from onedemo.bench.survey.true_contacts import NEAR, self_contact, true_robot
from onedemo.configs.errors import BadConfig
from onedemo.configs.shipped_files import shipped_robots
from onedemo.planner.errors import BadModel

BOX = '<box size="0.06 0.06 0.3"/>'
PARTS = (
    link("base", '<box size="0.2 0.2 0.1"/>'),
    *(link(name, BOX) for name in ("one", "two", "three")),
    link("tip", '<cylinder radius="0.04" length="0.1"/>'),
    joint("j1", "base", "one", axis="0 0 1", xyz="0 0 0.25"),
    joint("j2", "one", "two", axis="0 1 0", xyz="0 0 0.2"),
    joint("j3", "two", "three", axis="0 1 0", xyz="0 0 0.2"),
    joint("j4", "three", "tip", "continuous", axis="0 1 0", xyz="0 0 0.25"),
)
LIST = """
packages:
  nowhere-at-all: {folder: models}
robots:
  - {name: small, file: robot.urdf, tool: tip, kind: four joints}
  - {name: absent, package: nowhere-at-all, file: a.urdf}
"""


@pytest.fixture
def listed(tmp_path) -> Path:
    written(tmp_path, *PARTS)
    path = tmp_path / "list.yaml"
    path.write_text(LIST)
    return path


def called(monkeypatch, capsys, *arguments) -> tuple[int, str, str]:
    monkeypatch.setattr(sys, "argv", ["onedemo", "robot", "survey", *map(str, arguments)])
    with pytest.raises(SystemExit) as stopped:
        main()
    said = capsys.readouterr()
    return stopped.value.code, said.out, said.err


def test_a_small_robot_is_measured_kept_and_written(listed, monkeypatch, capsys, tmp_path):
    output, written_page = tmp_path / "out", tmp_path / "page.md"
    arguments = (listed, "--postures", 40, "--problems", 3, "-o", output, "--write", written_page)
    code, out, err = called(monkeypatch, capsys, *arguments)
    assert code == 0, out + err
    assert "ok        small: 4 joints" in out and "skipped   absent: pip install --no-deps nowhere-at-all" in out
    row = json.loads((output / "small.json").read_text())
    assert row["format"] == "URDF" and row["dof"] == 4 and row["endless"] == 1 and row["parts"] == 5
    for plans in row["plans"].values():
        assert plans["problems"] == len(plans["cpu_ms"]) == 3 and plans["unsound"] == plans["contacts"] == []
        assert plans["solved"] == 3 - len(plans["failures"]) == sum(plans[kind] for kind in measured_robot.KINDS)
    assert row["plans"]["free"]["solved"] == 3
    assert not (output / "absent.json").exists()
    text = written_page.read_text()
    assert "1 robot, 0 failed, 1 skipped" in text and "| small | URDF four joints | 4, 1 endless |" in text
    assert "- absent: `pip install --no-deps nowhere-at-all`" in text

    def again(robot, counts):
        raise AssertionError("finished robots are not measured again")

    monkeypatch.setattr(command, "measured", again)
    assert called(monkeypatch, capsys, *arguments)[0] == 0
    assert written_page.read_text() == text


def test_other_counts_or_another_file_are_measured_anew(listed, monkeypatch, tmp_path):
    asked = []

    def measured(robot, counts):
        asked.append(counts.postures)
        raise BadModel(robot.folder / "robot.urdf", "link", "is wrong")

    monkeypatch.setattr(command, "measured", measured)
    monkeypatch.setattr(command, "warm_up", lambda: asked.append("warm-up"))
    robot, counts, output = read_robot_list(listed)[0], command.Counts(20, 1), tmp_path / "out"
    output.mkdir()
    kept = {"name": "small", "conditions": command.conditions_of(robot, counts), "failed": "once"}
    (output / "small.json").write_text(json.dumps(kept))
    assert command.run_survey(str(listed), counts, output, quiet=True) == 1
    assert asked == ["warm-up", 20], "a failed robot is tried again, after the kernels are compiled"
    row = json.loads((output / "small.json").read_text())
    assert row["failed"] == "robot.urdf: link: is wrong" and is_bad(row)
    del kept["failed"], asked[:]
    (output / "small.json").write_text(json.dumps({**kept, "plans": {}}))
    monkeypatch.setattr(command, "line_of", lambda row: row["name"])
    assert command.run_survey(str(listed), counts, output, quiet=True) == 0 and asked == []
    command.run_survey(str(listed), counts._replace(problems=2), output, quiet=True)
    assert asked == ["warm-up", 20]
    (output / "small.json").write_text(json.dumps({**kept, "plans": {}}))
    (tmp_path / "robot.urdf").write_text((tmp_path / "robot.urdf").read_text() + "\n")
    command.run_survey(str(listed), counts, output, quiet=True)
    assert asked == ["warm-up", 20] * 2


def test_a_raw_error_and_a_missing_file_are_findings(listed, monkeypatch, capsys, tmp_path):
    def measured(robot, counts):
        raise ZeroDivisionError("by zero")

    monkeypatch.setattr(command, "measured", measured)
    monkeypatch.setattr(command, "warm_up", lambda: None)
    code, out, _ = called(monkeypatch, capsys, listed, "-o", tmp_path / "out")
    assert code == 1 and "failed    small: ZeroDivisionError: by zero" in out
    (tmp_path / "robot.urdf").unlink()
    code, out, _ = called(monkeypatch, capsys, listed, "-o", tmp_path / "out")
    assert code == 1 and "failed    small: the list has no robot.urdf" in out


@pytest.mark.parametrize(
    "text, message",
    [
        ("robots: []", "robots: is no list of robots"),
        ("robot: 1", "robot: unknown key; allowed: packages, robots"),
        ("robots: [small]", r"robots\[0\]: does not hold `key: value` lines"),
        (
            "robots: [{name: a, file: b, tol: c}]",
            r"robots\[0\]: tol: unknown key; did you mean 'tool'. allowed: name, file, package, tool",
        ),
        ("robots: [{name: a/b, file: b}]", r"robots\[0\]\.name: 'a/b': allowed are a to z, 0 to 9, _ and -"),
        ("robots: [{name: a, file: b}, {name: a, file: c}]", r"robots\[1\]\.name: 'a' stands twice"),
        ("robots: [{name: a, file: b, package: c}]", r"robots\[0\]\.package: 'c' is not under packages"),
        ("robots: [{name: a, file: b, locked: {j: up}}]", r"robots\[0\]: locked\.j: .* got 'up'"),
        ("packages: {c: {path: x}}\nrobots: [{name: a, file: b}]", r"packages\.c: path: unknown key"),
    ],
)
def test_a_mistake_in_a_list_is_one_line(text, message, tmp_path):
    path = tmp_path / "list.yaml"
    path.write_text(text)
    with pytest.raises(BadConfig, match=message):
        read_robot_list(path)


def test_an_unknown_robot_is_refused(listed, monkeypatch, capsys):
    code, _, err = called(monkeypatch, capsys, listed, "--only", "smal")
    assert code == 2 and "unknown robot 'smal'; known: small, absent" in err


def test_the_shipped_list_names_files_of_installed_packages():
    robots = read_robot_list(shipped_robots("public"))
    assert len(robots) >= 30
    there = [robot for robot in robots if robot.folder is not None]
    assert {robot.entry.package for robot in there} >= {"robosuite"}
    assert all(robot.request.file.is_file() for robot in there)


# Self-contact by the truth


def test_self_contact_is_judged_by_the_true_boxes(tmp_path):
    request = RobotRequest(written(tmp_path, *PARTS), "tip")
    robot = load_robot(request)
    truth, rng = true_robot(robot, request), np.random.default_rng(0)
    # the base is welded to the world, and parts that share a joint are neighbors
    assert ("link0", "link2") in truth.pairs and ("link1", "link2") not in truth.pairs
    # half of them folded, so that the tip comes back to the first link
    folded = rng.uniform([-2.0, 1.4, 1.4, -2.0], 2.0, (150, 4))
    postures = np.vstack([rng.uniform(-2, 2, (150, 4)), folded])
    contact = self_contact(robot, truth, postures)
    assert contact.postures == 300 and 0.0 < contact.touching <= contact.refused < 1.0
    assert contact.clear <= 1.0 - contact.touching and contact.clear_refused is not None
    assert contact.compared > 0 and contact.most_over[0] < 1e-6 and contact.most_under[0] < 0.003


def test_parts_that_always_touch_rest(tmp_path):
    """A cover on the base that hugs the upper link by a ring: no posture is refused for it."""
    wide = link("base", '<cylinder radius="0.1" length="0.9"/>')
    request = RobotRequest(written(tmp_path, wide, *PARTS[1:]), "tip")
    robot = load_robot(request)
    truth = true_robot(robot, request)
    postures = np.random.default_rng(0).uniform(-2, 2, (50, 4))
    contact = self_contact(robot, truth, postures)
    assert ["link0", "link2"] in contact.resting
    assert truth.judge([("link0", "link2")]).first_contact(np.zeros((1, 4)), []) is None
    assert truth.judge([]).first_contact(np.zeros((1, 4)), []) is not None


def test_distances_are_those_of_the_boxes(tmp_path):
    request = RobotRequest(written(tmp_path, *PARTS), "tip")
    truth = true_robot(load_robot(request), request)
    # the upper links fold back until the third box stands beside the first
    for angle in np.linspace(0.0, 2.0, 9):
        found = truth.distances(np.array([0.0, angle, 0.0, 0.0]))
        assert all(value < NEAR for value in found.values())


def test_an_unsound_plan_makes_the_survey_fail():
    good = {"unsound": [], "contacts": []}
    assert not is_bad({"plans": {"free": good}})
    assert is_bad({"plans": {"free": {**good, "contacts": ["0: link1 touches link3"]}}})
    assert is_bad({"plans": {"free": {**good, "unsound": ["0: too fast"]}}})
    assert is_bad({"failed": "no such file"}) and not is_bad({"skipped": "pip install x"})
    assert "- a: no such file" in page([{"name": "a", "package": "", "failed": "no such file"}], "list.yaml")
