"""Kinematics against Pinocchio, MuJoCo and finite differences; bad models are refused."""

from __future__ import annotations

import re

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from helpers.arms import joints, panda, panda_urdf, random_arm
from helpers.strategies import random_dq
from hypothesis import given, settings
from hypothesis import strategies as st

from onedemo.planner.errors import BadModel, BadShape, NotFinite, OneDemoError
from onedemo.planner.geometry import dualquat as dq
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.robot.arm import Arm

few = settings(max_examples=50, deadline=None)
MJCF = """
<mujoco><compiler angle="radian" autolimits="true"/><worldbody>
  <body name="a" pos="0.1 0.2 0.3" quat="0.8 0.2 -0.4 0.4">
    <joint name="turn" axis="0.3 -0.5 0.8" pos="0.05 0 0.02" range="-2 2" ref="0.4"/>
    <joint name="second" axis="1 0 0" pos="0 0.03 0" range="-1 1"/>
    <geom size="0.05"/>
    <body name="b" pos="0 0.3 0.1" euler="0.3 0.2 0.1">
      <joint name="slide" type="slide" axis="0 0.6 0.8" range="-0.3 0.3" ref="0.1"/>
      <geom size="0.05"/>
      <body name="c" pos="0.2 0 0">
        <joint name="free_turn" axis="0 0 -1"/>
        <geom size="0.05"/><site name="tool" pos="0.1 -0.05 0.2" quat="0.5 0.5 0.5 0.5"/>
      </body></body></body></worldbody></mujoco>
"""
URDF = """<robot name="r"><link name="base"/><link name="one"/><link name="two"/><link name="three"/><link name="tool"/>
<joint name="lift" type="prismatic"><parent link="base"/><child link="one"/><origin xyz="0.1 0 0.3" rpy="0.1 0.2 0.3"/>
<axis xyz="0.6 0 0.8"/><limit lower="-0.2" upper="0.5" effort="1" velocity="0.7"/></joint>
<joint name="spin" type="continuous"><parent link="one"/><child link="two"/><origin xyz="0 0.2 0" rpy="0 1 0"/>
<axis xyz="0.48 0.6 0.64"/><limit effort="1" velocity="2"/></joint>
<joint name="bend" type="revolute"><parent link="two"/><child link="three"/><origin xyz="0.3 0 0"/>
<axis xyz="0 -1 0"/><limit lower="-1" upper="2" effort="1" velocity="1.5"/></joint>
<joint name="fix" type="fixed"><parent link="three"/><child link="tool"/><origin xyz="0.1 0.1 0" rpy="0 0 1"/></joint>
</robot>"""
NAMES = ("turn", "second", "slide", "free_turn")


def mujoco_arm(xml: str = MJCF, names=NAMES, site="tool") -> tuple[mujoco.MjModel, Arm]:
    model = mujoco.MjModel.from_xml_string(xml)
    return model, Arm.from_mujoco(model, names, site=site, velocity_limits=1.0)


@pytest.fixture
def urdf(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(URDF)
    return path


def pinocchio_says(path, frame_name, q):
    model = pin.buildModelFromUrdf(str(path))
    data, frame = model.createData(), model.getFrameId(frame_name)
    full = []
    for joint, value in zip(model.joints[1:], q, strict=True):
        full += [np.cos(value), np.sin(value)] if joint.nq == 2 else [value]
    full = np.array(full)
    jacobian = pin.computeFrameJacobian(model, data, full, frame, pin.ReferenceFrame.LOCAL)
    pin.framesForwardKinematics(model, data, full)
    return data.oMf[frame].homogeneous, jacobian


@few
@given(st.integers(0, 10**6))
def test_the_panda_agrees_with_pinocchio(seed):
    q = joints(panda(), np.random.default_rng(seed))
    matrix, jacobian = pinocchio_says(panda_urdf(), "panda_link8", q)
    x, ours = panda().fk_jacobian(q)
    np.testing.assert_allclose(Pose(x).matrix, matrix, atol=1e-12)
    np.testing.assert_allclose(ours, jacobian, atol=1e-12)
    np.testing.assert_array_equal(panda().fk(q).dq, Pose(x).dq)


def test_sliding_and_endless_joints_agree_with_pinocchio(urdf):
    arm = Arm.from_urdf(urdf, tcp_frame="tool")
    assert arm.joint_names == ("lift", "spin", "bend")
    np.testing.assert_allclose(arm.velocity_limits, [0.7, 2, 1.5])
    np.testing.assert_array_equal(arm.lower, [-0.2, -np.inf, -1])
    for seed in range(20):
        q = np.random.default_rng(seed).uniform(-1, 1, 3)
        matrix, jacobian = pinocchio_says(urdf, "tool", q)
        np.testing.assert_allclose(arm.fk(q).matrix, matrix, atol=1e-12)
        np.testing.assert_allclose(arm.jacobian(q), jacobian, atol=1e-12)


def test_the_base_can_stand_anywhere(urdf):
    base = Pose.from_yaw([1, 2, 3], 0.7)
    q = [0.1, 0.2, 0.3]
    moved = Arm.from_urdf(urdf, tcp_frame="tool", world_from_base=base).fk(q)
    np.testing.assert_allclose(moved.matrix, (base @ Arm.from_urdf(urdf, tcp_frame="tool").fk(q)).matrix, atol=1e-12)


def test_offsets_references_and_shared_bodies_agree_with_mujoco():
    model, arm = mujoco_arm()
    data = mujoco.MjData(model)
    for seed in range(30):
        q = np.random.default_rng(seed).uniform(-1, 1, 4)
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        jacobian = np.zeros((6, 4))
        mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], 0)
        pose, rotation = arm.fk(q), data.site_xmat[0].reshape(3, 3)
        np.testing.assert_allclose(pose.position, data.site_xpos[0], atol=1e-12)
        np.testing.assert_allclose(pose.rotation, rotation, atol=1e-12)
        np.testing.assert_allclose(arm.jacobian(q)[:3], rotation.T @ jacobian[:3], atol=1e-12)
        np.testing.assert_allclose(arm.jacobian(q)[3:], rotation.T @ jacobian[3:], atol=1e-12)
    np.testing.assert_array_equal(arm.upper, [2, 1, 0.3, np.inf])


@few
@given(st.integers(0, 10**6), st.integers(1, 9))
def test_the_jacobian_is_the_derivative_of_the_pose(seed, dof):
    arm, rng = random_arm(seed, dof), np.random.default_rng(seed)
    q, direction, h = joints(arm, rng), rng.normal(size=dof), 1e-6
    step = dq.mul(dq.conj(arm.fk(q - h * direction).dq), arm.fk(q + h * direction).dq)
    np.testing.assert_allclose(dq.twist_from_dq(step) / (2 * h), arm.jacobian(q) @ direction, atol=1e-7)


@few
@given(st.integers(0, 10**6), st.integers(3, 9))
def test_another_tool_is_the_same_arm_seen_from_elsewhere(seed, dof):
    rng = np.random.default_rng(seed)
    arm, tool = random_arm(seed, dof), Pose(random_dq(rng))
    q, other = joints(arm, rng), arm.with_tool(tool)
    distance, angle = other.fk(q).distance_to(arm.fk(q) @ tool)
    assert distance < 1e-12 and angle < 1e-7
    h, direction = 1e-6, rng.normal(size=dof)
    step = other.fk(q - h * direction).inverse() @ other.fk(q + h * direction)
    np.testing.assert_allclose(dq.twist_from_dq(step.dq) / (2 * h), other.jacobian(q) @ direction, atol=1e-6)
    np.testing.assert_array_equal(other.limits, arm.limits)
    back = other.with_tool(tool.inverse())
    np.testing.assert_allclose(back.fk(q).matrix, arm.fk(q).matrix, atol=1e-12)


def test_the_margin_is_the_nearest_limit():
    _, arm = mujoco_arm()
    assert arm.margin([1.9, 0, 0.1, 99]) == pytest.approx(0.1)
    assert arm.margin([2.5, 0, 0.1, 0]) == pytest.approx(-0.5)


@pytest.mark.parametrize(
    "change, message",
    [
        (dict(names=("turn", "slide")), "the joints from the world to 'tool' are: turn, second, slide, free_turn"),
        (dict(names=("turn", "nope")), "joint 'nope': not in the model"),
        (dict(site="nope"), "site 'nope': not in the model"),
        (
            dict(xml=MJCF.replace('name="free_turn" axis="0 0 -1"', 'name="free_turn" type="ball"')),
            "neither a hinge nor",
        ),
    ],
)
def test_a_wrong_mujoco_model_is_named(change, message):
    with pytest.raises(BadModel, match=message):
        mujoco_arm(**change)


def test_a_wrong_urdf_is_named(urdf, tmp_path):
    with pytest.raises(BadModel, match=r"nope.urdf: URDF: no such file"):
        Arm.from_urdf(tmp_path / "nope.urdf", tcp_frame="tool")
    with pytest.raises(BadModel, match=r"frame 'hand': not in the model; frames: .*tool"):
        Arm.from_urdf(urdf, tcp_frame="hand")
    urdf.write_text("<robot><link")
    with pytest.raises(BadModel, match="cannot be read"):
        Arm.from_urdf(urdf, tcp_frame="tool")


def test_limits_and_joints_are_checked():
    arm = panda()
    with pytest.raises(BadModel, match="lower limit 1 is not below upper limit 0"):
        Arm("x", ("j",), arm.chain[:2], [1.0], [0.0], [1.0])
    with pytest.raises(BadModel, match="velocity limit nan"):
        Arm("x", ("j",), arm.chain[:2], [0.0], [1.0], [np.nan])
    with pytest.raises(BadShape, match=r"x: lower has shape \(2,\); expected \(1,\)"):
        Arm("x", ("j",), arm.chain[:2], [0.0, 1.0], [1.0], [1.0])
    with pytest.raises(BadModel, match="allowed are 1 to 16"):
        Arm("x", (), arm.chain[:1], [], [], [])
    with pytest.raises(BadShape, match=r"q has shape \(6,\); expected \(7,\)"):
        arm.fk(np.zeros(6))
    with pytest.raises(NotFinite, match="index 2"):
        arm.fk([0, 0, np.nan, 0, 0, 0, 0])


NUMBERS = [match.span() for match in re.finditer(r"(?<=[\" ])-?\d+(\.\d+)?(?=[\" ])", URDF)]


@pytest.mark.parametrize("value", ["nan", "inf", "1e308", "-1e308"])
def test_absurd_numbers_never_become_an_arm(value, tmp_path):
    assert len(NUMBERS) > 30
    path = tmp_path / "bad.urdf"
    for start, stop in NUMBERS:
        path.write_text(URDF[:start] + value + URDF[stop:])
        try:
            arm = Arm.from_urdf(path, tcp_frame="tool")
        except OneDemoError as error:
            assert "\n" not in str(error)
            continue
        pose, jacobian = arm.fk_jacobian([0.1, 0.2, 0.3])
        assert np.isfinite(pose).all()
        assert np.isfinite(jacobian).all()
