"""URDF files that Pinocchio drops parts of, or refuses without a word, are named; others are read as they are."""

from __future__ import annotations

import re

import numpy as np
import pinocchio as pin
import pytest
from helpers.models.urdf_text import joint, link, written

from onedemo.planner import Arm, body_from_urdf
from onedemo.planner.errors import BadModel
from onedemo.planner.models.urdf_file import read_urdf_file

A, B, TURN = link("a"), link("b", '<sphere radius="0.1"/>'), joint("j", "a", "b")
XACRO = '<xacro:macro name="m"><link name="x"/></xacro:macro>'
BAD = {
    "xacro element": ((A, B, TURN, XACRO), r"xacro \(<xacro:macro>\): is not expanded; .*xacro FILE"),
    "xacro inside": ((A, B, TURN.replace("<axis", "<xacro:axis/><axis")), r"xacro \(<xacro:axis>\)"),
    "xacro argument": ((A, link("b", '<mesh filename="$(find x)/a.stl"/>'), TURN), r"xacro \(<mesh>\): is not expan"),
    "xacro value": ((A, B, joint("j", "a", "b", xyz="0 0 ${h}")), r"xacro \(<origin>\): is not expanded"),
    "xacro name": ((link("${p}a"), B, joint("j", "${p}a", "b")), r"xacro \(<link>\): is not expanded"),
    "two links": ((A, A, B, TURN), "link 'a': there are 2 of this name"),
    "two joints": ((A, B, link("c"), TURN, joint("j", "b", "c")), "joint 'j': there are 2 of this name"),
    "no name": ((A, B, TURN, "<link/>"), "link: one has no name"),
    **{
        f"{name} {text}": (
            (A, B, TURN.replace("<origin", f'<origin {name}="{text}"')),
            f"joint 'j': the {name} '{text}' of the <origin> of",
        )
        for name, text in (("xyz", "0 0"), ("xyz", "0 0 nan"), ("rpy", "a b c"), ("rpy", "1,5 0 0"), ("xyz", "0 0 inf"))
    },
    "axis of two": (
        (A, B, joint("j", "a", "b", axis="0 1")),
        "joint 'j': the xyz '0 1' of the <axis> of a <joint> is not thr",
    ),
    "odd speed": (
        (A, B, TURN.replace('velocity="1"', 'velocity="fast"')),
        "joint 'j': the velocity 'fast' of its <limit>",
    ),
    "no limit": ((A, B, TURN.replace("<limit", "<no")), "joint 'j': is revolute and has no <limit>; .* continuous"),
    "no speed": ((A, B, TURN.replace("velocity", "v")), "joint 'j': its <limit> has no velocity"),
    "no effort": ((A, B, TURN.replace("effort", "e").replace("velocity", "v")), "has no effort and no velocity"),
    "odd type": ((A, B, joint("j", "a", "b", "screw")), "joint 'j': its type is 'screw'; known are revolute, cont"),
    "no such parent": ((A, B, joint("j", "x", "b")), "joint 'j': its parent 'x' is no link"),
    "no child": ((A, B, TURN.replace("<child", "<kid")), "joint 'j': its child '' is no link"),
    "two parents": ((A, B, link("c"), TURN, joint("k", "a", "c"), joint("l", "b", "c")), "'c': is the child of two"),
    "no links": (("<material name='m'/>",), "links: there are none; is it a xacro file that was not expanded"),
    "two roots": ((A, B, link("c"), TURN), "links: there must be one root, but there are 2: a, c"),
    "a circle": ((A, B, TURN, joint("k", "b", "a")), "there must be one root, but there are 0"),
    "follows itself": ((A, B, joint("j", "a", "b", more='<mimic joint="j"/>')), "joint 'j': mimics itself"),
    "follows in a circle": (
        (
            *(A, B, link("c"), joint("j", "a", "b", more='<mimic joint="k"/>')),
            joint("k", "b", "c", more='<mimic joint="j"/>'),
        ),
        "mimics itself",
    ),
    "odd multiplier": (
        (A, B, link("c"), joint("j", "a", "b", more='<mimic joint="k" multiplier="x"/>'), joint("k", "b", "c")),
        "<mimic> is not a num",
    ),
    "follows nobody": ((A, B, joint("j", "a", "b", more='<mimic joint="x"/>')), "joint 'j': mimics 'x', which is no j"),
    "a circle beside": (
        (A, B, TURN, link("c"), link("d"), joint("k", "c", "d"), joint("l", "d", "c")),
        "links: these hang in a circle, not on 'a': c, d",
    ),
    **{
        f"limits {low} {high}": (
            (A, B, TURN.replace('lower="-2" upper="2"', f'lower="{low}" upper="{high}"')),
            f"joint 'j': its limits are '{low}' and '{high}', not two numbers in order",
        )
        for low, high in (("2", "-2"), ("nan", "1"), ("-inf", "inf"), ("inf", "inf"), ("-1,5", "1,5"), ("", "1"))
    },
}


@pytest.mark.parametrize("name", BAD)
def test_what_cannot_be_used_is_named_in_one_line(name, tmp_path):
    parts, message = BAD[name]
    path = written(tmp_path, *parts)
    for read in (read_urdf_file, lambda path: Arm.from_urdf(path, tcp_frame="b")):
        with pytest.raises(BadModel, match=message) as caught:
            read(path)
        assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)


@pytest.mark.parametrize("encoding", ["gb2312", "shift_jis", "klingon"])
def test_an_encoding_that_cannot_be_read_is_one_line(encoding, tmp_path):
    path = written(tmp_path, A, B, TURN)
    path.write_text(f'<?xml version="1.0" encoding="{encoding}"?>{path.read_text()}')
    with pytest.raises(BadModel, match=r"robot\.urdf: URDF: cannot be read: ") as caught:
        read_urdf_file(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["<mujoco/>", "<sdf version='1.7'/>", "no XML", "", "<robot name='r'><link"])
def test_other_files_are_no_urdf(text, tmp_path):
    (tmp_path / "x.urdf").write_text(text)
    with pytest.raises(BadModel, match=r"x\.urdf: URDF: (is none: its root is <\w+>|cannot be read)"):
        read_urdf_file(tmp_path / "x.urdf")


@pytest.mark.parametrize(
    "more",
    [
        "<!-- <xacro:macro/> ${x} -->",
        '<gazebo><plugin filename="$(find x)/y"/></gazebo>',
        "<sensor:camera/>",
        '<transmission name="t"/>',
    ],
)
def test_what_does_not_describe_the_robot_does_no_harm(more, tmp_path):
    """Also prefixes that nobody declared: they are common."""
    plain = Arm.from_urdf(written(tmp_path, A, B, TURN), tcp_frame="b")
    arm = Arm.from_urdf(written(tmp_path, A, B, TURN, more), tcp_frame="b")
    np.testing.assert_array_equal(arm.chain, plain.chain)
    tag = re.match(r"<([\w:!]+)", more).group(1)
    assert any(f"1 <{tag}>" in line for line in arm.report.unused) or tag == "!"


FAULTY = {
    "unknown": ("<cone radius='1'/>", "its <cone> is unknown; known are box, cylinder, sphere, mesh"),
    "capsule": ("<capsule radius='1' length='1'/>", "its <capsule> is unknown"),
    "two shapes": ("<sphere radius='1'/><sphere radius='2'/>", "a <collision> has 2 shapes instead of one"),
    "no shape": (" ", "a <collision> has 0 shapes instead of one"),
    "two numbers": ("<box size='1 1'/>", "the size '1 1' of its <box> is not positive"),
    "negative": ("<box size='1 1 -1'/>", "the size '1 1 -1' of its <box> is not positive"),
    "no radius": ("<cylinder length='1'/>", "the radius '' of its <cylinder> is not positive"),
    "nan": ("<sphere radius='nan'/>", "the radius 'nan' of its <sphere> is not positive"),
    "no file": ("<mesh/>", "a mesh has no filename"),
    "scale": ("<mesh filename='x.stl' scale='1 0 1'/>", "the scale '1 0 1' of a mesh is not three numbers other than"),
    "scheme": (
        "<mesh filename='http://x/a.stl'/>",
        "the mesh 'http://x/a.stl' is not at a path, at package:// or at f",
    ),
    "too large": ("<box size='1 1 200'/>", r"box: size\[2\]: 200.0 is not a length"),
    "missing mesh": ("<mesh filename='package://p/none.stl'/>", r"none\.stl.*package_dirs"),
}


@pytest.mark.parametrize("name", FAULTY)
def test_collision_geometry_is_never_dropped(name, tmp_path):
    """Pinocchio would leave the link without geometry."""
    form, message = FAULTY[name]
    path = written(tmp_path, link("a", '<sphere radius="0.1"/>'), link("b", form), TURN)
    with pytest.raises(BadModel, match=message) as caught:
        body_from_urdf(path, Arm.from_urdf(path, tcp_frame="b"))
    assert "\n" not in str(caught.value) and ("link 'b'" in str(caught.value) or name == "missing mesh")


SPHERE = '<geometry><sphere radius="0.1"/></geometry>'
BROKEN = {
    "place of two numbers": (
        f'<collision><origin xyz="0 0"/>{SPHERE}</collision>',
        "xyz '0 0' of the <origin> of a <coll",
    ),
    "place nowhere": (
        f'<collision><origin xyz="nan 0 0"/>{SPHERE}</collision>',
        "xyz 'nan 0 0' of the <origin> of a <coll",
    ),
    "angles": (f'<collision><origin rpy="a b c"/>{SPHERE}</collision>', "rpy 'a b c' of the <origin> of a <collision>"),
    "one of two": (
        f'<collision>{SPHERE}</collision><collision><origin xyz="0 0 x"/>{SPHERE}</collision>',
        "xyz '0 0 x' of the <ori",
    ),
    "mass": (
        f'<inertial><mass value="x"/></inertial><collision>{SPHERE}</collision>',
        "only 0 of its 1 elements of geom",
    ),
    "visual": (
        f"<visual><origin xyz='0'/>{SPHERE}</visual><collision>{SPHERE}</collision>",
        "only 0 of its 1 elements",
    ),
    "far": (
        f'<collision><origin xyz="200 0 0"/>{SPHERE}</collision>',
        "geometry has a point that is not finite or farther",
    ),
}


@pytest.mark.parametrize("name", BROKEN)
def test_no_element_of_a_broken_link_is_lost_without_a_word(name, tmp_path):
    """Pinocchio's parser stops reading such a link, and goes on with the next one."""
    inside, message = BROKEN[name]
    path = written(tmp_path, link("a", '<sphere radius="0.1"/>'), f'<link name="b">{inside}</link>', TURN)
    arm = Arm.from_urdf(path, tcp_frame="b")
    with pytest.raises(BadModel, match=message) as caught:
        body_from_urdf(path, arm)
    assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)


def test_a_vertex_nowhere_is_refused_with_its_file(tmp_path):
    (tmp_path / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 nan 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n")
    path = written(tmp_path, A, link("b", '<mesh filename="m.obj"/>'), TURN)
    with pytest.raises(BadModel, match=r"robot\.urdf: "):
        body_from_urdf(path, Arm.from_urdf(path, tcp_frame="b"))


def test_a_name_that_parsers_read_differently_is_refused(tmp_path):
    path = written(tmp_path, A, *(part.replace('"b"', '"b\nc"') for part in (B, TURN)))
    with pytest.raises(BadModel, match=r"link 'b\\nc': its name holds a line break or a tab"):
        Arm.from_urdf(path, tcp_frame="a")


def test_a_robot_without_a_name_is_one_line(tmp_path):
    path = written(tmp_path, A, B, TURN)
    path.write_text(path.read_text().replace('<robot name="r">', "<robot>"))
    with pytest.raises(BadModel, match="robot: one has no name"):
        read_urdf_file(path)


def test_what_nobody_uses_is_reported(tmp_path):
    endless = joint("k", "b", "c", "continuous", more='<limit lower="-1" upper="1" effort="1" velocity="1"/>')
    soft = TURN.replace("</joint>", '<safety_controller k_velocity="1"/></joint>')
    heavy = '<link name="c"><inertial><mass value="1"/></inertial></link>'
    unused = read_urdf_file(written(tmp_path, A, B, heavy, soft, endless, "<gazebo/>", "<gazebo/>")).unused
    assert [line.partition(":")[2] or line for line in unused] == [
        " a, b",
        " k",
        "soft limits (<safety_controller>) of the joints j",
        " 2 <gazebo>",
    ]


def test_a_link_and_a_joint_of_one_name_are_told_apart(tmp_path):
    """The tool frame is the link; a joint of a name of its own is its frame."""
    parts = (A, B, link("tool"), TURN, joint("tool", "b", "tool", "fixed", xyz="0 0 0.3", rpy="0 1 0"))
    path = written(tmp_path, *parts)
    arm, model = Arm.from_urdf(path, tcp_frame="tool"), pin.buildModelFromUrdf(str(path))
    other = Arm.from_urdf(
        written(tmp_path, *(part.replace('joint name="tool"', 'joint name="x"') for part in parts)), tcp_frame="tool"
    )
    np.testing.assert_array_equal(arm.chain, other.chain)
    assert len({frame.name for frame in model.frames}) < len(model.frames)
    by_joint = Arm.from_urdf(written(tmp_path, *parts), tcp_frame="j")
    assert by_joint.fk([0.3]).position == pytest.approx([0, 0, 0])


def test_an_unknown_frame_lists_those_that_look_alike_first(tmp_path):
    path = written(
        tmp_path, *(link(f"l{k}") for k in range(50)), *(joint(f"j{k}", "l0", f"l{k}") for k in range(1, 50))
    )
    with pytest.raises(BadModel, match=r"frame 'l_49': not in the model; frames: l49, .* and \d+ more$"):
        Arm.from_urdf(path, tcp_frame="l_49")
