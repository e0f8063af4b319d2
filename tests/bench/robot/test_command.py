"""`onedemo robot check`: what it prints is true, a mistake is one line, and the picture shows the robot."""

from __future__ import annotations

import sys

import mujoco
import numpy as np
import pytest
from helpers.models.urdf_text import joint, link, written
from hypothesis import given
from hypothesis import strategies as st

from onedemo.bench.cli import main
from onedemo.bench.robot.load_robot import RobotRequest, kind_of, load_robot
from onedemo.bench.robot.robot_summary import postures_of, reach_of, volumes_of
from onedemo.bench.robot.tool_choice import end_of_chain, tool_of_mujoco
from onedemo.planner import Arm
from onedemo.planner.errors import BadModel
from onedemo.planner.geometry.hulls import union_volume

BOX = '<box size="0.06 0.1 0.4"/>'
PARTS = (
    link("base", BOX),
    link("upper", BOX),
    link("fore", BOX, BOX),
    link("cover", "", BOX),
    link("palm", BOX),
    link("left", BOX),
    link("right", BOX),
    joint("turn", "base", "upper", axis="0 1 0", xyz="0 0 0.5"),
    joint("bend", "upper", "fore", axis="0 1 0", xyz="0 0 0.4"),
    joint("glue", "fore", "cover", "fixed"),
    joint("roll", "fore", "palm", "continuous", xyz="0 0 0.3"),
    joint(
        "open", "palm", "left", "prismatic", axis="0 1 0", more='<limit lower="0" upper="0.1" effort="1" velocity="1"/>'
    ),
    joint("follow", "palm", "right", "prismatic", axis="0 -1 0", more='<mimic joint="open"/>'),
)
MJCF = """<mujoco><compiler angle="radian"/><worldbody><body name="base"><geom type="box" size="0.1 0.1 0.1"/>
<body name="one" pos="0 0 0.3"><joint name="j1" axis="0 1 0" range="-2 2"/>
<geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.04"/>
<body name="two" pos="0 0 0.4"><joint name="j2" axis="0 1 0" range="-2 2"/>
<geom type="capsule" fromto="0 0 0 0 0 0.2" size="0.03"/>
<site name="tip" pos="0 0 0.25"/></body></body></body></worldbody></mujoco>"""
SRDF = "".join(
    f'<disable_collisions link1="{one}" link2="{other}"/>' for one, other in (("base", "fore"), ("upper", "palm"))
)


def called(monkeypatch, capsys, *arguments) -> tuple[int, str, str]:
    monkeypatch.setattr(sys, "argv", ["onedemo", "robot", "check", *map(str, arguments)])
    with pytest.raises(SystemExit) as stopped:
        main()
    said = capsys.readouterr()
    return stopped.value.code, said.out, said.err


def test_everything_is_printed_and_drawn(monkeypatch, capsys, tmp_path):
    path, picture = written(tmp_path, *PARTS), tmp_path / "robot.png"
    (tmp_path / "r.srdf").write_text(f"<robot>{SRDF}</robot>")
    arguments = (path, "--locked", "open=0.05", "--srdf", tmp_path / "r.srdf", "--picture", picture)
    code, out, err = called(monkeypatch, capsys, *arguments)
    assert code == 0, err
    for words in (
        "robot.urdf: 3 joints to palm (chosen; --tool names another)",
        "joint       turn    -2.000 to   2.000 rad   1 rad/s",
        "joint       roll  without limits            1 rad/s",
        "held        open at 0.05",
        "held        follow at 0.05",
        "reach       0.700 m from the first joint to palm",
        "srdf        pairs of parts that it exempts: link0 and link2",
        "part        link1  ",
        "its geometry 2.400 l, ratio",
        "not used    no or zero inertia",
        "warning     links with a <visual> and no <collision>, which visuals=True would cover: cover",
        "ok          with 1 warning\n",
        f"picture     {picture}",
    ):
        assert words in out, words
    assert picture.stat().st_size > 10_000
    code, out, _ = called(monkeypatch, capsys, path, "--visuals", "--tool", "palm")
    assert code == 0 and "warning" not in out and "chosen" not in out and "<visual>" not in out
    assert "fingers" in out and "its geometry is swept" in out


@pytest.mark.parametrize(
    "arguments, message",
    [
        (["none.urdf"], "none.urdf: robot: no such file"),
        (["{}", "--tool", "x"], "frame 'x': not in the model; frames: "),
        (["{}", "--tool", ""], "frame '': not in the model; frames: "),
        (["{}", "--locked", "turn"], "command line: --locked: 'turn' is not JOINT=VALUE"),
        (["{}", "--locked", "turn=up"], "command line: --locked: 'turn=up' is not JOINT=VALUE"),
        (["{}", "--locked", "x=1"], "locked joint 'x': not in the model; joints: turn, bend"),
        (["{}", "--locked", "follow=0.01"], "locked joint 'follow': follows 'open': lock that one"),
        (["{}", "--base-link", "x"], "base_link 'x': is no link of the model"),
        (["{}", "--srdf", "x.srdf"], "x.srdf: SRDF: no such file"),
        (["{}", "--picture", "x.txt"], "command line: --picture: x.txt does not end in .png, .pdf, .svg"),
        (["{}", "--picture", "no/x.png"], "command line: --picture: no/x.png cannot be written: there is no folder no"),
    ],
)
def test_a_mistake_is_one_line(arguments, message, monkeypatch, capsys, tmp_path):
    path = written(tmp_path, *PARTS)
    code, out, err = called(monkeypatch, capsys, *(text.format(path) for text in arguments))
    assert (code, out) == (2, "") and message in err and err.count("\n") == 1


def test_an_mjcf_file_is_read_as_it_compiles(monkeypatch, capsys, tmp_path):
    (tmp_path / "r.xml").write_text(MJCF)
    code, out, _ = called(monkeypatch, capsys, tmp_path / "r.xml", "--tool", "tip")
    assert code == 0 and "r.xml: 2 joints to tip" in out and "the file has no speeds" in out
    assert "reach       0.650 m" in out and "link2     1 capsule " in out
    (tmp_path / "r.xml").write_text(MJCF.replace("hinge", "").replace('axis="0 1 0"', 'axis="0 0 0"'))
    code, _, err = called(monkeypatch, capsys, tmp_path / "r.xml")
    assert code == 2 and "r.xml: MJCF: cannot be compiled: " in err and err.count("\n") == 1
    (tmp_path / "r.xml").write_text("<sdf/>")
    code, _, err = called(monkeypatch, capsys, tmp_path / "r.xml")
    assert code == 2 and "is neither URDF nor MJCF" in err


def test_a_last_body_without_a_name_is_no_tool(monkeypatch, capsys, tmp_path):
    (tmp_path / "r.xml").write_text(MJCF.replace('body name="two"', "body"))
    code, _, err = called(monkeypatch, capsys, tmp_path / "r.xml")
    assert code == 2 and "r.xml: tool: the body at the end of the longest chain has no name; name the tool" in err
    assert called(monkeypatch, capsys, tmp_path / "r.xml", "--tool", "tip")[0] == 0


def test_two_arms_of_equal_length_have_no_single_tool(monkeypatch, capsys, tmp_path):
    arms = (joint("left", "base", "one"), joint("right", "base", "two"))
    path = written(tmp_path, link("base", BOX), link("one", BOX), link("two", BOX), *arms)
    code, _, err = called(monkeypatch, capsys, path)
    assert code == 2 and "robot.urdf: tool: there is no single longest chain of joints; name the tool" in err
    side = '<body name="{0}"><joint name="{0}"/><geom size="0.1"/></body>'
    text = f'<mujoco><worldbody><body name="base">{side.format("l")}{side.format("r")}</body></worldbody></mujoco>'
    (tmp_path / "r.xml").write_text(text)
    code, _, err = called(monkeypatch, capsys, tmp_path / "r.xml")
    assert code == 2 and "r.xml: tool: there is no single longest chain" in err


def test_volumes_are_those_of_the_capsules_and_of_the_boxes(tmp_path):
    robot = load_robot(RobotRequest(written(tmp_path, *PARTS)))
    volumes = {piece.name: piece for piece in volumes_of(robot)}
    assert list(volumes) == list(dict.fromkeys(robot.body.names))
    for name, piece in volumes.items():
        rows = robot.body.rows[np.array(robot.body.names) == name]
        assert piece.volume == union_volume([(row[1:4], row[4:7], row[7]) for row in rows])
        if name == "fingers":
            assert np.isnan(piece.geometry)
        else:
            assert piece.geometry == pytest.approx(0.06 * 0.1 * 0.4) and piece.volume > piece.geometry


def test_no_posture_reaches_farther(tmp_path):
    arm = load_robot(RobotRequest(written(tmp_path, *PARTS))).arm
    reach, rng = reach_of(arm), np.random.default_rng(1)
    farthest = max(np.linalg.norm(arm.fk(rng.uniform(-2, 2, 3)).position - [0, 0, 0.5]) for _ in range(3000))
    assert farthest <= reach + 1e-9 and reach <= 0.7 + 1e-9


@pytest.mark.parametrize("low, high, reach", [(0.0, 6.0, 6.4), (-9.0, -5.0, 9.4), (0.0, 1.0, 1.4)])
def test_the_reach_along_a_rail_is_that_of_the_rail(low, high, reach, tmp_path):
    limit = f'<limit lower="{low}" upper="{high}" effort="1" velocity="1"/>'
    rail = joint("rail", "base", "car", "prismatic", axis="1 0 0", more=limit)
    path = written(
        tmp_path, link("base"), link("car"), link("tip"), rail, joint("turn", "car", "tip", "continuous", axis="0 1 0")
    )
    path.write_text(
        path.read_text().replace("</robot>", f"{link('end')}{joint('e', 'tip', 'end', 'fixed', xyz='0.4 0 0')}</robot>")
    )
    assert reach_of(Arm.from_urdf(path, tcp_frame="end")) == pytest.approx(reach, abs=1e-6)


def test_postures_lie_within_the_limits(tmp_path):
    limit = '<limit lower="3.5" upper="6" effort="1" velocity="1"/>'
    path = written(
        tmp_path,
        link("a"),
        link("b"),
        link("c"),
        joint("far", "a", "b", more=limit),
        joint("on", "b", "c", "continuous"),
    )
    low, high = postures_of(Arm.from_urdf(path, tcp_frame="c"))
    assert (low[0], high[0]) == (3.5, 6.0) and low[1] == -high[1] < 0


@pytest.mark.parametrize(
    "text, kind",
    [
        ('<!-- made from <robot name="x"> --><mujoco/>', "mujoco"),
        ("<?xml version='1.0'?><!-- <mujoco> --><robot/>", "robot"),
        ("<!-- --- arm --- --><mujoco/>", "mujoco"),
        (f"<!-- {'x' * 10**5} --><robot/>", "robot"),
        ("<!DOCTYPE robot>\n<robot>", "robot"),
    ],
)
def test_a_file_is_known_by_its_root_and_not_by_its_comments(text, kind, tmp_path):
    (tmp_path / "x").write_text(text)
    assert kind_of(tmp_path / "x") == kind


@pytest.mark.parametrize(
    "text, says",
    [
        ("<robots/>", "its root is <robots>"),
        ("<mujocoinclude/>", "its root is <mujocoinclude>"),
        ("", "it has no element"),
        ("<!-- <robot/> -->", "it has no element"),
    ],
)
def test_another_file_is_told_what_it_is(text, says, tmp_path):
    (tmp_path / "x").write_text(text)
    with pytest.raises(BadModel, match=f"is neither URDF nor MJCF: {says}"):
        kind_of(tmp_path / "x")


@given(st.lists(st.integers(0, 5), min_size=1, max_size=12), st.integers(1, 4))
def test_a_chain_ends_before_its_fingers(extra, fingers):
    """Nodes beside the chain, then two to five fingers of one joint each at its end."""
    parents, joints, end = [0], [0], 0
    for _ in extra:
        parents, joints, end = [*parents, end], [*joints, 1], len(parents)
    for finger in range(fingers + 1):
        parents, joints = [*parents, end], [*joints, 1 if finger < 2 else 0]
    assert end_of_chain(parents, joints) == (end if fingers > 0 else end + 1)


def test_the_tool_of_mjcf_is_the_last_body_with_a_joint():
    assert tool_of_mujoco(mujoco.MjModel.from_xml_string(MJCF)) == "two"
