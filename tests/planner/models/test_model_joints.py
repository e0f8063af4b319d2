"""Held joints: an arm reduced by them is the whole arm with those joints at their places; followers follow."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from helpers.models.urdf_text import joint, link, written
from hypothesis import given, settings
from hypothesis import strategies as st

from onedemo.planner import Arm, Pose, body_from_mujoco
from onedemo.planner.errors import BadModel
from onedemo.planner.models.model_joints import TURNS, Coupling, ModelJoint, swept_range
from onedemo.planner.models.mujoco_model import mujoco_couplings

few = settings(max_examples=30, deadline=None)
NAMES = ("j0", "j1", "j2", "j3", "j4")
KINDS = ("revolute", "prismatic", "continuous", "revolute", "prismatic")


def numbers(rng, count: int = 3) -> str:
    return " ".join(f"{value:.6f}" for value in rng.uniform(-1, 1, count))


def random_urdf(seed: int, folder) -> object:
    rng = np.random.default_rng(seed)
    joints = [
        joint(name, f"l{k}", f"l{k + 1}", kind, numbers(rng), xyz=numbers(rng), rpy=numbers(rng))
        for k, (name, kind) in enumerate(zip(NAMES, KINDS, strict=True))
    ]
    end = joint("weld", "l5", "tool", "fixed", xyz=numbers(rng), rpy=numbers(rng))
    return written(folder, *(link(f"l{k}") for k in range(6)), link("tool"), *joints, end)


def random_mjcf(seed: int) -> mujoco.MjModel:
    """Two joints in one body too, with references."""
    rng = np.random.default_rng(seed)
    text = ""
    for count, names in ((1, NAMES[:1]), (2, NAMES[1:3]), (2, NAMES[3:])):
        kinds = {name: "hinge" if KINDS[NAMES.index(name)] != "prismatic" else "slide" for name in names}
        joints = "".join(
            f'<joint name="{name}" type="{kind}" axis="{numbers(rng)}" pos="{numbers(rng)}" ref="{rng.uniform():.4f}"/>'
            for name, kind in kinds.items()
        )
        text += (
            f'<body name="b{count}{names[0]}" pos="{numbers(rng)}" quat="{numbers(rng, 4)}">{joints}<geom size="1"/>'
        )
    text += f'<site name="tool" pos="{numbers(rng)}" quat="{numbers(rng, 4)}"/>'
    whole = f'<compiler angle="radian"/><worldbody>{text}{"</body>" * 3}</worldbody>'
    return mujoco.MjModel.from_xml_string(f"<mujoco>{whole}</mujoco>")


@few
@given(st.integers(0, 10**6), st.sets(st.sampled_from(NAMES), max_size=4))
def test_a_reduced_arm_is_the_whole_arm_with_joints_in_their_places(tmp_path_factory, seed, names):
    q = np.random.default_rng(seed).uniform(-1, 1, 5)
    locked = {name: q[NAMES.index(name)] for name in names}
    free = [k for k, name in enumerate(NAMES) if name not in names]
    path, model = random_urdf(seed, tmp_path_factory.mktemp("u")), random_mjcf(seed)
    for whole, part in (
        (Arm.from_urdf(path, tcp_frame="tool"), Arm.from_urdf(path, tcp_frame="tool", locked=locked)),
        (
            Arm.from_mujoco(model, NAMES, site="tool", velocity_limits=1.0),
            Arm.from_mujoco(model, site="tool", velocity_limits=1.0, locked=locked),
        ),
    ):
        assert part.joint_names == tuple(NAMES[k] for k in free) and dict(part.report.held) == pytest.approx(locked)
        np.testing.assert_allclose(part.fk(q[free]).matrix, whole.fk(q).matrix, atol=1e-12)
        np.testing.assert_allclose(part.jacobian(q[free]), whole.jacobian(q)[:, free], atol=1e-12)
        np.testing.assert_array_equal(part.limits, whole.limits[:, free])


@pytest.mark.parametrize(
    "locked, says",
    [
        ({"j9": 0}, "locked joint 'j9': not in the model; joints: j0, j1"),
        ({"x*": 0}, r"locked joint 'x\*': not in the model"),
        ({"j0": 2.1}, "locked joint 'j0': 2.1 is beyond its upper limit 2.0"),
        ({"j*": -2.1}, "locked joint 'j0': -2.1 is beyond its lower limit -2.0"),
        ({"j0": math.nan}, "locked joint 'j0': nan is not a position"),
        ({"j0": "up"}, "locked joint 'j0': 'up' is not a position"),
        ({"j0": None}, "locked joint 'j0': None is not a position"),
        ({"j*": 0}, "joints: has 0; allowed are 1 to 16"),
    ],
)
def test_joints_that_cannot_be_held_are_named(locked, says, tmp_path):
    with pytest.raises(BadModel, match=says):
        Arm.from_urdf(random_urdf(0, tmp_path), tcp_frame="tool", locked=locked)


def test_a_name_counts_more_than_a_pattern_and_the_joints_asked_for_are_never_held(tmp_path):
    arm = Arm.from_urdf(random_urdf(0, tmp_path), tcp_frame="tool", locked={"j[1-3]": 0.0, "j2": 1.0})
    assert arm.report.held == {"j1": 0.0, "j2": 1.0, "j3": 0.0}
    names = ("j0", "j3")
    arm = Arm.from_mujoco(random_mjcf(0), names, site="tool", velocity_limits=1.0, locked={"*": 0.5})
    assert arm.joint_names == names and dict.fromkeys(("j1", "j2", "j4"), 0.5) == arm.report.held
    with pytest.raises(BadModel, match="locked joint 'j0': is a joint of the arm"):
        Arm.from_mujoco(random_mjcf(0), names, site="tool", velocity_limits=1.0, locked={"*": 0.5, "j0": 0.1})
    with pytest.raises(BadModel, match=r"are: j0, j1, j2, j3, j4; base_link or locked holds those"):
        Arm.from_mujoco(random_mjcf(0), names, site="tool", velocity_limits=1.0)


def test_an_arm_begins_at_its_base_link(tmp_path):
    path, model = random_urdf(3, tmp_path), random_mjcf(3)
    arm = Arm.from_urdf(path, tcp_frame="tool", base_link="l2", locked={"j1": 0.5})
    assert arm.joint_names == NAMES[2:] and arm.report.held == {"j0": 0.0, "j1": 0.5}
    q = [0.1, 0.2, 0.3]
    whole = Arm.from_urdf(path, tcp_frame="tool")
    np.testing.assert_allclose(arm.fk(q).matrix, whole.fk([0.0, 0.5, *q]).matrix, atol=1e-12)
    arm = Arm.from_mujoco(model, site="tool", velocity_limits=1.0, base_link="b2j1")
    rest = model.qpos0[:3]
    np.testing.assert_array_equal(list(arm.report.held.values()), rest)
    whole = Arm.from_mujoco(model, NAMES, site="tool", velocity_limits=1.0)
    np.testing.assert_allclose(arm.fk(q[:2]).matrix, whole.fk([*rest, *q[:2]]).matrix, atol=1e-12)
    with pytest.raises(BadModel, match="base_link 'l9': is no link of the model"):
        Arm.from_urdf(path, tcp_frame="tool", base_link="l9")
    with pytest.raises(BadModel, match="base_link 'tool': is not between the root and 'l3'"):
        Arm.from_urdf(path, tcp_frame="l3", base_link="tool")


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_a_base_that_floats_is_held_or_refused_by_name(kind, tmp_path):
    parts = (link("world"), link("base"), link("arm"), joint("drive", "world", "base", kind, xyz="1 0 0.2"))
    path = written(tmp_path, *parts, joint("turn", "base", "arm"))
    with pytest.raises(BadModel, match="joint 'drive': is neither a hinge nor a slide; base_link or locked holds it"):
        Arm.from_urdf(path, tcp_frame="arm")
    for how in ({"base_link": "base"}, {"locked": {"drive": 0}}):
        arm = Arm.from_urdf(path, tcp_frame="arm", **how)
        assert arm.joint_names == ("turn",) and arm.fk([0.7]).position == pytest.approx([1, 0, 0.2])
    with pytest.raises(BadModel, match=r"locked joint 'drive': 0\.5: a free, planar or ball joint stays where"):
        Arm.from_urdf(path, tcp_frame="arm", locked={"drive": 0.5})


def test_a_free_base_without_a_name_is_held_in_mjcf_and_a_body_may_be_the_tool():
    text = """<mujoco><worldbody><body name="base" pos="0.1 0 1" quat="1 1 0 0"><freejoint/><geom size="1"/>
    <body name="arm" pos="0 0.5 0"><joint name="turn" axis="1 0 0"/><geom size="0.1"/>
    <body name="tip" pos="0.3 0.1 0" quat="1 0 1 0"/></body></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    with pytest.raises(
        BadModel, match=r"joint '\(joint 0, of base, without a name\)': is neither a hinge nor a slide; base"
    ):
        Arm.from_mujoco(model, body="tip", velocity_limits=1.0)
    arm = Arm.from_mujoco(model, body="tip", velocity_limits=1.0, base_link="base")
    data = mujoco.MjData(model)
    for value in (-1.0, 0.0, 2.5):
        data.joint("turn").qpos[0] = value
        mujoco.mj_kinematics(model, data)
        pose = Pose.from_position_quaternion(data.body("tip").xpos, data.body("tip").xquat)
        np.testing.assert_allclose(arm.fk([value]).matrix, pose.matrix, atol=1e-12)
    for wrong in ({}, {"site": "x", "body": "tip"}):
        with pytest.raises(BadModel, match="tool frame: give either a site or a body"):
            Arm.from_mujoco(model, velocity_limits=1.0, base_link="base", **wrong)


def mimicking(folder, follows: str, leader: str = "first"):
    """A chain of two whose second joint, or a finger on it, follows another one."""
    mimic = f'<mimic joint="{leader}" multiplier="-0.5" offset="0.2"/>'
    parts = [link(name) for name in ("a", "b", "c", "d", "e")]
    joints = [
        joint("first", "a", "b", xyz="0 0 0.1"),
        joint("second", "b", "c", axis="0 1 0", xyz="0.2 0 0", more=mimic if follows == "second" else ""),
        joint("third", "c", "d", axis="1 0 0", xyz="0 0.1 0", more=mimic if follows == "third" else ""),
        joint("stay", "d", "e", "fixed", xyz="0.1 0 0"),
    ]
    return written(folder, *parts, *joints)


@pytest.mark.parametrize("leader", ["first", "second"])
def test_a_joint_of_the_arm_that_follows_another_is_refused_by_name(leader, tmp_path):
    message = f"joint 'third': follows '{leader}', so it is no joint of its own; lock '{leader}' to hold both"
    with pytest.raises(BadModel, match=message):
        Arm.from_urdf(mimicking(tmp_path, "third", leader), tcp_frame="e")
    with pytest.raises(BadModel, match=f"locked joint 'third': follows '{leader}': lock that one"):
        Arm.from_urdf(mimicking(tmp_path, "third", leader), tcp_frame="e", locked={"third": 0.0})


def test_a_follower_of_a_held_joint_is_held_where_it_follows(tmp_path):
    path = mimicking(tmp_path, "third")
    arm = Arm.from_urdf(path, tcp_frame="e", locked={"first": 0.6})
    assert arm.joint_names == ("second",) and arm.report.held == pytest.approx({"first": 0.6, "third": -0.1})
    model = pin.buildModelFromUrdf(str(path))
    data = model.createData()
    pin.framesForwardKinematics(model, data, np.array([0.6, 0.9, -0.1]))
    np.testing.assert_allclose(arm.fk([0.9]).matrix, data.oMf[model.getFrameId("e")].homogeneous, atol=1e-12)


@pytest.mark.parametrize(
    "mimic", ['joint="stay" multiplier="3" offset="0.4"', 'joint="first" multiplier="0" offset="0.4"']
)
def test_a_joint_that_follows_what_stands_still_stands_still(mimic, tmp_path):
    text = mimicking(tmp_path, "third").read_text().replace('joint="first" multiplier="-0.5" offset="0.2"', mimic)
    (tmp_path / "x.urdf").write_text(text)
    arm = Arm.from_urdf(tmp_path / "x.urdf", tcp_frame="e")
    assert arm.joint_names == ("first", "second") and arm.report.held == {"third": 0.4}


EQUALITY = """<mujoco><compiler angle="radian"/><worldbody><body name="a"><joint name="x" axis="0 0 1" ref="0.3"/>
<geom size="0.1"/><body name="b" pos="0.2 0 0"><joint name="y" axis="0 1 0" ref="-0.2"/><geom size="0.1"/>
<body name="c" pos="0.1 0 0"><joint name="z" axis="1 0 0"/><geom size="0.1"/><body name="tip" pos="0 0 0.1"/></body>
</body></body></worldbody><equality>{}</equality></mujoco>"""


def equality(text: str) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(EQUALITY.format(text))


def test_joints_coupled_in_mjcf_are_refused_or_held():
    model = equality('<joint joint1="y" joint2="x" polycoef="0.1 -0.5 0.2 0 0.3"/>')
    with pytest.raises(BadModel, match="joint 'y': follows 'x', so it is no joint of its own"):
        Arm.from_mujoco(model, body="tip", velocity_limits=1.0)
    arm = Arm.from_mujoco(model, body="tip", velocity_limits=1.0, locked={"x": 0.9})
    moved = 0.9 - 0.3
    expected = -0.2 + 0.1 - 0.5 * moved + 0.2 * moved**2 + 0.3 * moved**4
    assert arm.joint_names == ("z",) and arm.report.held == pytest.approx({"x": 0.9, "y": expected})
    model = equality('<joint joint1="y" polycoef="0.1 7"/>')  # of one joint only: a constant
    arm = Arm.from_mujoco(model, body="tip", velocity_limits=1.0)
    assert arm.joint_names == ("x", "z") and arm.report.held == pytest.approx({"y": -0.1})
    model = equality('<joint joint1="y" joint2="x" active="false"/>')
    assert Arm.from_mujoco(model, body="tip", velocity_limits=1.0).dof == 3


def test_a_closed_loop_of_the_arms_links_is_refused_by_name():
    loop = '<connect body1="a" body2="c" anchor="0 0 0"/>'
    with pytest.raises(BadModel, match=r"<connect> of a and c: makes joints of the arm follow each other: y, z"):
        Arm.from_mujoco(equality(loop), body="tip", velocity_limits=1.0)
    arm = Arm.from_mujoco(equality(loop), body="tip", velocity_limits=1.0, locked={"y": 0, "z": 0})
    assert arm.joint_names == ("x",)


@few
@given(
    st.lists(st.floats(-2, 2), min_size=1, max_size=5),
    st.floats(-2, 0),
    st.floats(0.1, 2),
    st.booleans(),
)
def test_a_follower_is_swept_over_all_that_its_leader_may_ask_of_it(polynomial, low, high, limited):
    axis = np.array([0.0, 0.0, 1.0])
    leader = ModelJoint("leader", TURNS, axis, np.zeros(3), low, high, 0.0)
    own = (-0.1, 0.1) if limited else (-math.inf, math.inf)
    follower = ModelJoint("follower", TURNS, axis, np.zeros(3), *own, 0.0)
    coupling = Coupling("follower", "leader", tuple(polynomial))
    swept = swept_range(follower, [coupling], {"leader": leader})
    reached = [coupling.at(value) for value in np.linspace(low, high, 501)]
    assert swept.low <= min(reached) + 1e-9 and swept.high >= max(reached) - 1e-9
    if not limited:
        assert swept.low >= min(reached) - 1e-3 and swept.high <= max(reached) + 1e-3
    assert swept_range(leader, [coupling], {"leader": leader}) is leader


def test_polynomials_of_mjcf_are_about_the_references():
    model = equality('<joint joint1="y" joint2="x" polycoef="0 1 0 0 0"/>')
    (coupling,) = mujoco_couplings(model)
    assert (coupling.follower, coupling.leader) == ("y", "x") and coupling.at(0.3) == pytest.approx(-0.2)
    assert coupling.at(1.3) == pytest.approx(0.8)


def test_a_pattern_that_matches_followers_alone_says_so(tmp_path):
    path = mimicking(tmp_path, "third")
    with pytest.raises(
        BadModel, match=r"locked joint 'th\*': matches only joints of the arm, or joints that follow .*third"
    ):
        Arm.from_urdf(path, tcp_frame="e", locked={"th*": 0.0})
    with pytest.raises(BadModel, match=r"locked joint 'j\[0\]': matches only joints of the arm"):
        Arm.from_mujoco(random_mjcf(0), NAMES, site="tool", velocity_limits=1.0, locked={"j[0]": 0.0})


def test_a_joint_that_the_model_holds_is_not_locked_elsewhere():
    model = equality('<joint joint1="y" polycoef="0.1 0 0 0 0"/>')
    with pytest.raises(BadModel, match=r"locked joint 'y': stands still at -0\.1, where the model couples it"):
        Arm.from_mujoco(model, body="tip", velocity_limits=1.0, locked={"y": 0.4})


def test_of_two_couplings_each_is_asked_about_its_own_leader():
    model = equality(
        '<joint joint1="y" joint2="x" polycoef="0 2 0 0 0"/><joint joint1="y" joint2="z" polycoef="0 5 0 0 0"/>'
    )
    arm = Arm.from_mujoco(model, body="tip", velocity_limits=1.0, locked={"x": 0.4})
    assert arm.report.held == pytest.approx({"x": 0.4, "y": -0.2 + 2 * 0.1})


AXIS = np.array([0.0, 0.0, 1.0])


def turning(name: str, low: float, high: float) -> ModelJoint:
    return ModelJoint(name, TURNS, AXIS, np.zeros(3), low, high, 0.0)


def test_a_follower_of_a_follower_is_swept_as_far_as_the_first_leader_goes():
    """Files often give followers no range of their own."""
    joints = {joint.name: joint for joint in (turning("a", 0, 1), turning("b", 0, 0), turning("c", 0, 0))}
    couplings = [Coupling("c", "b", (0.0, 2.0)), Coupling("b", "a", (0.5, 1.0))]
    swept = swept_range(joints["c"], couplings, joints)
    assert (swept.low, swept.high) == (0.0, 3.0)
    joints["a"] = turning("a", -math.inf, math.inf)
    swept = swept_range(joints["c"], couplings, joints)
    assert (swept.low, swept.high) == (-math.inf, math.inf), "its leader turns without end"


def test_joints_that_follow_each_other_have_their_own_ranges():
    joints = {joint.name: joint for joint in (turning("a", 0, 1), turning("b", -1, 0))}
    couplings = [Coupling("a", "b", (0.0, 1.0)), Coupling("b", "a", (0.0, 1.0))]
    swept = swept_range(joints["a"], couplings, joints)
    assert (swept.low, swept.high) == (-1.0, 1.0)


NAMELESS = """<mujoco><compiler angle="radian"/><worldbody><body><geom size="0.1"/>
<body pos="0 0 0.3"><joint axis="0 1 0" range="-2 2"/><joint axis="1 0 0" range="-1 1"/><geom size="0.1"/>
<body pos="0 0.1 0.3"><joint axis="0 0 1" range="-2 2"/><geom size="0.1"/><site name="tip" pos="0.2 0 0"/></body>
</body></body></worldbody></mujoco>"""


def test_joints_and_bodies_without_names_are_told_apart():
    model = mujoco.MjModel.from_xml_string(NAMELESS)
    arm = Arm.from_mujoco(model, site="tip", velocity_limits=1.0)
    assert len(set(arm.joint_names)) == 3 and arm.upper.tolist() == [2.0, 1.0, 2.0]
    data = mujoco.MjData(model)
    for q in np.random.default_rng(0).uniform(-1, 1, (5, 3)):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        np.testing.assert_allclose(arm.fk(q).position, data.site("tip").xpos, atol=1e-12)
    body = body_from_mujoco(model, arm, exact=False)
    assert body.names == ("link0", "link2", "link3")
    held = Arm.from_mujoco(model, site="tip", velocity_limits=1.0, locked={arm.joint_names[1]: 0.3})
    assert held.joint_names == (arm.joint_names[0], arm.joint_names[2])
