"""Limits in another unit are refused, or named in a warning; plausible ones pass without a word."""

from __future__ import annotations

import math
import warnings

import mujoco
import numpy as np
import pytest
from helpers.models.urdf_text import joint, link, written
from hypothesis import given
from hypothesis import strategies as st

from onedemo.planner import Arm
from onedemo.planner.errors import BadModel, ModelWarning
from onedemo.planner.models.doubtful_limits import check_limits, doubtful_limits
from onedemo.planner.models.model_joints import SLIDES, TURNS, ModelJoint


def limited(low: float, high: float, kind: str = TURNS) -> ModelJoint:
    return ModelJoint("j", kind, np.array([0.0, 0.0, 1.0]), np.zeros(3), low, high, 0.0)


def said_of(*joints: ModelJoint, speed: float = 1.0) -> list[str]:
    check_limits(joints, "x")
    return list(doubtful_limits(joints, np.full(len(joints), speed)))


@given(st.floats(-2 * math.pi, 2 * math.pi), st.floats(0.2, 2 * math.pi))
def test_limits_in_radians_pass_and_the_same_in_degrees_do_not(low, span):
    high = min(low + span, 2 * math.pi)
    assert said_of(limited(low, high)) == []
    degrees = limited(math.degrees(low), math.degrees(high))
    if max(abs(degrees.low), abs(degrees.high)) > 8 * math.pi:
        with pytest.raises(BadModel, match=r"x: joint 'j': its limits are .* rad; are they in degrees\?"):
            said_of(degrees)


@pytest.mark.parametrize(
    "joints, speed, says",
    [
        ([limited(-20, 20)], 1, "limits of more than two turns: j"),
        ([limited(-1e16, 1e16)], 1, "limits of more than two turns: j"),
        ([limited(-math.inf, math.inf, SLIDES)], 1, "sliding joints without limits: j"),
        ([limited(0, 350, SLIDES)], 1, "limits of more than 10 m, in millimetres?: j"),
        ([limited(-1, 1)], 120, "speeds of more than 25 rad/s, in degrees?: j"),
        ([limited(-0.05, 0.05), limited(-0.03, 0.1)], 1, "limits of less than 7 degrees in all joints: is"),
        ([limited(*np.radians([-6.28319, 6.28319]))] * 2, 1, "limits of less than 7 degrees in all joints: is"),
    ],
)
def test_doubtful_numbers_are_warned_of(joints, speed, says):
    (line,) = said_of(*joints, speed=speed)
    assert line.startswith(says)


def test_endless_joints_and_unknown_speeds_are_not_doubtful():
    assert said_of(limited(-math.inf, math.inf), limited(0, 0.4, SLIDES), speed=math.nan) == []


def test_a_file_in_degrees_is_refused_and_a_held_joint_is_not_asked(tmp_path):
    wild = joint("j", "a", "b", more='<limit lower="-170" upper="170" effort="1" velocity="1"/>')
    path = written(tmp_path, link("a"), link("b"), link("c"), wild, joint("k", "b", "c"))
    with pytest.raises(BadModel, match=r"robot\.urdf: joint 'j': its limits are -170 to 170 rad; are they in degrees"):
        Arm.from_urdf(path, tcp_frame="c")
    assert Arm.from_urdf(path, tcp_frame="c", locked={"j": 0.5}).joint_names == ("k",)


def test_warnings_are_issued_once_and_kept_in_the_report(tmp_path):
    fast = joint("j", "a", "b", more='<limit lower="-1" upper="1" effort="1" velocity="120"/>')
    path = written(tmp_path, link("a"), link("b"), fast)
    with pytest.warns(ModelWarning, match=r"robot\.urdf: speeds of more than 25 rad/s") as caught:
        arm = Arm.from_urdf(path, tcp_frame="b")
    assert len(caught) == len(arm.report.warnings) == 1 and caught[0].filename == __file__


def test_radians_taken_for_degrees_are_noticed_in_mjcf():
    text = """<mujoco><compiler{}/><worldbody><body name="a"><joint name="j" range="-2 2"/><geom size="0.1"/>
    <body name="b"><joint name="k" range="-1 1"/><geom size="0.1"/></body></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text.format(""))
    with pytest.warns(ModelWarning, match='is <compiler angle="radian"/> missing'):
        Arm.from_mujoco(model, body="b", velocity_limits=1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = mujoco.MjModel.from_xml_string(text.format(' angle="radian"'))
        assert Arm.from_mujoco(model, body="b", velocity_limits=1.0).upper == pytest.approx([2, 1])


def test_a_range_that_is_not_in_force_is_named():
    text = """<mujoco><compiler angle="radian"/><worldbody><body name="a">
    <joint name="j" range="-2 2" limited="false"/><geom size="0.1"/>
    <body name="b"><joint name="k" range="-1 1" limited="true"/><geom size="0.1"/></body></body>
    </worldbody></mujoco>"""
    with pytest.warns(ModelWarning, match="ranges that limited=false puts out of force: j$"):
        arm = Arm.from_mujoco(mujoco.MjModel.from_xml_string(text), body="b", velocity_limits=1.0)
    assert arm.upper.tolist() == [math.inf, 1.0]
