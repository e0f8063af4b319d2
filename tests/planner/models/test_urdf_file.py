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
    "odd multiplier": ((A, B, joint("j", "a", "b", more='<mimic joint="k" multiplier="x"/>')), "<mimic> is not a num"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_cannot_be_used_is_named_in_one_line(name, tmp_path):
    parts, message = BAD[name]
    path = written(tmp_path, *parts)
    for read in (read_urdf_file, lambda path: Arm.from_urdf(path, tcp_frame="b")):
        with pytest.raises(BadModel, match=message) as caught:
            read(path)
        assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)


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
