"""Bodies of arms with held joints, followers, visual geometry and mirrored meshes contain what is placed there."""

from __future__ import annotations

import warnings

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from helpers.models.urdf_text import joint, link, written
from scipy.spatial import ConvexHull

from onedemo.planner import Arm, Body, Pose, body_from_mujoco, body_from_urdf
from onedemo.planner.errors import BadModel, ModelWarning
from onedemo.planner.robot.joint_frames import joint_frames

BLOCK = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
SMALL = np.array([0.06, 0.1, 0.2])
BOX = '<box size="0.06 0.1 0.2"/>'


def depth(arm: Arm, body: Body, name: str, points: np.ndarray, q) -> float:
    """How far world points lie inside the capsules of a piece at joints q, at the least; negative outside."""
    poses = [Pose.identity(), *joint_frames(arm, np.array(q, dtype=float))]
    best = np.full(len(points), -np.inf)
    for row, piece in zip(body.rows, body.names, strict=True):
        if piece == name:
            pose = poses[int(row[0]) + 1]
            a, b = (pose.rotation @ row[k : k + 3] + pose.position for k in (1, 4))
            along = b - a
            share = np.clip((points - a) @ along / max(along @ along, 1e-300), 0, 1)
            best = np.maximum(best, row[7] - np.linalg.norm(points - a - share[:, None] * along, axis=1))
    return float(best.min())


MOBILE = """<mujoco><compiler angle="radian"/><worldbody>
<body name="floor"><geom type="box" size="9 9 0.1" pos="0 0 -1"/></body>
<body name="base" pos="0.3 0 0.2"><freejoint/><geom type="box" size="0.2 0.2 0.1"/>
 <body name="wheel" pos="0 0.3 0"><joint name="roll" axis="0 1 0"/><geom type="cylinder" size="0.1 0.02"/></body>
 <body name="torso" pos="0 0 0.3"><joint name="lift" type="slide" axis="0 0 1" range="0 0.4" ref="0.1"/>
  <geom type="box" size="0.1 0.1 0.2"/>
  <body name="mast" pos="0 -0.3 0"><geom type="box" size="0.02 0.02 0.3"/></body>
  <body name="left" pos="0 0.2 0.1"><joint name="left_turn" axis="0.6 0 0.8" range="-2 2"/>
   <geom type="box" size="0.03 0.05 0.1"/>
   <body name="left_end" pos="0 0 0.2"><geom type="box" size="0.03 0.05 0.1"/></body></body>
  <body name="arm" pos="0.2 0 0.1"><joint name="turn" axis="0 0 1" range="-2 2"/><geom type="box" size="0.03 0.05 0.1"/>
   <body name="wrist" pos="0.3 0 0"><joint name="bend" axis="0 1 0" range="-2 2"/>
    <geom type="box" size="0.03 0.05 0.1"/>
    <body name="jaw" pos="0 0 0.2"><joint name="grip" type="slide" axis="0 1 0" range="0 0.05"/>
     <geom type="box" size="0.01 0.01 0.03"/></body></body></body></body></body></worldbody></mujoco>"""


def world_corners(model: mujoco.MjModel, data: mujoco.MjData, name: str) -> np.ndarray:
    geom = int(model.body_geomadr[model.body(name).id])
    return (2 * BLOCK * model.geom_size[geom]) @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]


def mobile(**locked: float) -> tuple[mujoco.MjModel, Arm]:
    model = mujoco.MjModel.from_xml_string(MOBILE)
    return model, Arm.from_mujoco(model, body="wrist", velocity_limits=1.0, base_link="torso", locked=locked)


@pytest.mark.parametrize("lift", [0.1, 0.35])
def test_what_hangs_on_held_joints_is_placed_and_not_swept(lift):
    model = mujoco.MjModel.from_xml_string(MOBILE)
    held = {"lift": lift}
    arm = Arm.from_mujoco(model, body="wrist", velocity_limits=1.0, base_link="torso", locked=held)
    body = body_from_mujoco(model, arm, locked={"left_*": 0.7, "grip": 0.02})
    assert set(body.names) == {"link0", "link1", "link2", "hand"}
    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    data.joint("lift").qpos[0], data.joint("left_turn").qpos[0], data.joint("grip").qpos[0] = lift, 0.7, 0.02
    pieces = dict(
        base="link0",
        torso="link0",
        mast="link0",
        left="link0",
        left_end="link0",
        arm="link1",
        wrist="link2",
        jaw="hand",
    )
    for _ in range(20):
        q = rng.uniform(-2, 2, 2)
        data.joint("turn").qpos[0], data.joint("bend").qpos[0] = q
        mujoco.mj_kinematics(model, data)
        for name, piece in pieces.items():
            assert depth(arm, body, piece, world_corners(model, data, name), q) > -1e-9, name
    radii = body.rows[np.array(body.names) == "hand", 7]
    assert radii.max() < 0.02, "a jaw that is held is not swept"
    assert depth(arm, body, "link0", np.array([[0.0, 0.0, -1.0]]), q) < 0, "the floor is no part of it"


def test_what_is_left_out_is_reported():
    from onedemo.planner.fitting.mujoco_parts import parts_from_mujoco
    from onedemo.planner.fitting.robot_parts import PartsRequest, pieces_of_links

    model, arm = mobile()
    read = parts_from_mujoco(model, arm, None, PartsRequest({}, False))
    beside = next(line for line in read.report.unused if line.startswith("links beside the arm"))
    assert beside.endswith(": wheel, left, left_end") and "make them obstacles" in beside
    assert "joints on the arm's links, covered over their range: jaw" in read.report.unused
    assert pieces_of_links(read, arm.dof) == {
        "base": "link0", "torso": "link0", "mast": "link0", "arm": "link1", "wrist": "link2", "jaw": "fingers",
    }  # fmt: skip


def test_what_stands_around_the_robot_is_reported():
    from onedemo.planner.fitting.mujoco_parts import parts_from_mujoco
    from onedemo.planner.fitting.robot_parts import PartsRequest

    def around(text: str) -> list[str]:
        model = mujoco.MjModel.from_xml_string(text)
        arm = Arm.from_mujoco(model, body="wrist", velocity_limits=1.0, base_link="torso")
        unused = parts_from_mujoco(model, arm, None, PartsRequest({}, False)).report.unused
        return [line.rpartition(": ")[2] for line in unused if line.startswith("bodies around the robot")]

    table = '<geom type="plane" size="1 1 1"/><body name="table"><geom size="0.1"/></body>'
    assert around(MOBILE) == ["floor"]
    assert around(MOBILE.replace("<worldbody>", f"<worldbody>{table}")) == ["the world, table, floor"]


def test_a_joint_that_the_arm_holds_is_not_held_elsewhere():
    model, arm = mobile(lift=0.2)
    with pytest.raises(BadModel, match=r"locked joint 'lift': is held at 0\.2 by the arm"):
        body_from_mujoco(model, arm, locked={"lift": 0.3}, exact=False)
    same = body_from_mujoco(model, arm, locked={"lift": 0.2}, exact=False)
    assert np.array_equal(same.rows, body_from_mujoco(model, arm, exact=False).rows)


URDF = (
    link("root"),
    link("base", BOX),
    link("torso", BOX),
    link("other", BOX),
    link("arm", BOX),
    link("wrist", BOX),
    link("palm", BOX),
    link("left_jaw", BOX),
    link("right_jaw", BOX),
    joint("drive", "root", "base", "planar"),
    joint("lift", "base", "torso", "prismatic", xyz="0 0 0.3"),
    joint("swing", "torso", "other", xyz="0 0.4 0", axis="1 0 0"),
    joint("turn", "torso", "arm", xyz="0.3 0 0"),
    joint("bend", "arm", "wrist", axis="0 1 0", xyz="0.3 0 0"),
    joint("weld", "wrist", "palm", "fixed", xyz="0.2 0 0", rpy="0.3 0 0"),
    joint("open", "palm", "left_jaw", "prismatic", axis="0 1 0", xyz="0.1 0 0"),
    joint("follow", "palm", "right_jaw", "prismatic", axis="0 -1 0", xyz="0.1 0 0", more='<mimic joint="open"/>'),
)


def frame_of(path, name: str, at: dict[str, float]) -> Pose:
    """Where Pinocchio has a link with joints at positions."""
    model = pin.buildModelFromUrdf(str(path))
    data, q = model.createData(), pin.neutral(model)
    for joint_name, value in at.items():
        found = model.joints[model.getJointId(joint_name)]
        if found.nq == 1:
            q[found.idx_q] = value
    pin.framesForwardKinematics(model, data, q)
    return Pose.from_matrix(data.oMf[model.getFrameId(name, pin.FrameType.BODY)].homogeneous)


def test_a_urdf_with_a_held_base_torso_and_jaws(tmp_path):
    """Against the whole arm's forward kinematics; jaws that mimic a held one are held."""
    path = written(tmp_path, *URDF)
    locked = {"lift": 0.5, "swing": -0.4, "open": 0.03}
    arm = Arm.from_urdf(path, tcp_frame="palm", base_link="torso", locked=locked)
    assert arm.joint_names == ("turn", "bend") and arm.report.held["follow"] == 0.03
    body = body_from_urdf(path, arm)
    assert set(body.names) == {"link0", "link1", "link2", "hand"}
    pieces = dict(base="link0", torso="link0", other="link0", arm="link1", wrist="link2", palm="hand")
    pieces |= dict(left_jaw="hand", right_jaw="hand")
    rng = np.random.default_rng(1)
    for _ in range(20):
        q = rng.uniform(-2, 2, 2)
        at = {**arm.report.held, "turn": q[0], "bend": q[1]}
        for name, piece in pieces.items():
            pose = frame_of(path, name, at)
            points = (BLOCK * SMALL) @ pose.rotation.T + pose.position
            assert depth(arm, body, piece, points, q) > -1e-9, name


def test_a_jaw_that_follows_is_swept_where_it_may_be_asked_to_go(tmp_path):
    """Its own limits say half of its leader's range."""
    short = URDF[-1].replace("</joint>", '<limit lower="0" upper="0.01" effort="1" velocity="1"/></joint>')
    path = written(tmp_path, *URDF[:-1], short.replace('<limit lower="-2" upper="2" effort="1" velocity="1"/>', "", 1))
    arm = Arm.from_urdf(path, tcp_frame="palm", base_link="torso")
    body = body_from_urdf(path, arm)
    for opened in (-2.0, 0.0, 1.5):
        pose = frame_of(path, "right_jaw", {"turn": 0.3, "bend": 0.2, "open": opened, "follow": opened})
        assert depth(arm, body, "fingers", (BLOCK * SMALL) @ pose.rotation.T + pose.position, [0.3, 0.2]) > -1e-9


def test_links_that_are_only_seen_are_named_and_covered_if_asked_for(tmp_path):
    parts = [joint("turn", "a", "b", xyz="0 0 0.3"), joint("bend", "b", "c", axis="0 1 0", xyz="0 0 0.3")]
    solid = written(tmp_path, link("a", BOX), link("b", BOX), link("c", BOX), *parts)
    arm = Arm.from_urdf(solid, tcp_frame="c")
    whole = body_from_urdf(solid, arm)
    seen = written(tmp_path, link("a", BOX), link("b", "", BOX), link("c", BOX, '<sphere radius="9"/>'), *parts)
    with pytest.warns(
        ModelWarning, match="links with a <visual> and no <collision>, which visuals=True would cover: b$"
    ):
        body = body_from_urdf(seen, arm)
    assert "link1" not in body.names
    assert "links with a <visual> and no <collision>: b" in Arm.from_urdf(seen, tcp_frame="c").report.unused
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        body = body_from_urdf(seen, arm, visuals=True)
    assert body.names == whole.names and np.array_equal(body.rows, whole.rows)
    nothing = written(tmp_path, link("a"), link("b", "", BOX), link("c"), *parts)
    with pytest.raises(BadModel, match="no link has a <collision> element; visuals=True covers what is to be seen"):
        body_from_urdf(nothing, arm)


def test_geoms_that_do_not_collide_are_named_and_covered_if_asked_for():
    text = """<mujoco><compiler angle="radian"/><worldbody><body name="base"><geom size="0.2"/>{1}
    <body name="a"><joint name="j" range="-1 1"/><geom size="0.1"/>
    <body name="b" pos="0.3 0 0"><geom type="box" size="0.1 0.1 0.1" contype="{0}" conaffinity="{0}"/></body></body>
    </body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text.format(1, ""))
    arm = Arm.from_mujoco(model, body="b", velocity_limits=1.0)
    whole = body_from_mujoco(model, arm)
    model = mujoco.MjModel.from_xml_string(text.format(0, '<geom type="plane" size="1 1 1"/>'))
    with pytest.warns(ModelWarning) as caught:
        assert "hand" not in body_from_mujoco(model, arm).names
    assert [str(each.message).partition(": ")[2] for each in caught] == [
        "bodies whose geoms do not collide, which visuals=True would cover: b",
        "planes and height fields on the arm, which its body does not contain: base",
    ]
    with pytest.warns(ModelWarning, match="planes") as caught:
        body = body_from_mujoco(model, arm, visuals=True)
    assert len(caught) == 1 and body.names == whole.names and np.array_equal(body.rows, whole.rows)


@pytest.mark.parametrize("scale", ["1 1 1", "-1 1 1", "0.5 -2 1.5", "-1 -1 -1", "0.001 0.001 -0.001"])
def test_scaled_and_mirrored_meshes_are_covered_where_they_are(scale, tmp_path):
    corners = np.array([[0, 0, 0], [0.3, 0.02, 0], [0.05, 0.2, 0], [0.02, 0.03, 0.4]])
    faces = ConvexHull(corners).simplices + 1
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {a} {b} {c}" for a, b, c in faces]
    (tmp_path / "wedge.obj").write_text("\n".join(lines) + "\n")
    mesh = f'<mesh filename="wedge.obj" scale="{scale}"/>'
    path = written(tmp_path, link("a"), link("b", mesh), joint("j", "a", "b"))
    arm = Arm.from_urdf(path, tcp_frame="b")
    body = body_from_urdf(path, arm, package_dirs=[tmp_path], split=1)
    points = corners * [float(word) for word in scale.split()]
    assert depth(arm, body, "link1", points, [0.0]) > -1e-9
    plain = body_from_urdf(
        written(tmp_path, link("a"), link("b", mesh.replace("-", "")), joint("j", "a", "b")), arm, split=1
    )
    assert body.rows[0, 7] == pytest.approx(plain.rows[0, 7], rel=0.02), "a mirrored mesh is as large as the mesh"


def test_a_flat_jaw_is_refused_in_one_line(tmp_path):
    """Swept, it has no mesh any more, and no hull either."""
    (tmp_path / "flat.obj").write_text("v 0 0 0\nv 0.1 0 0\nv 0 0 0.1\nv 0.1 0 0.1\nf 1 2 3\nf 2 4 3\n")
    jaw = link("jaw", '<mesh filename="flat.obj"/>')
    slide = joint("slide", "b", "jaw", "prismatic", axis="1 0 0")
    for beside in ((), ('<mesh filename="flat.obj"/>',)):
        path = written(tmp_path, link("a", BOX), link("b", *beside), jaw, joint("j", "a", "b"), slide)
        with pytest.raises(BadModel, match=r"robot\.urdf: \w+: the points of its geometry cannot be covered") as caught:
            body_from_urdf(path, Arm.from_urdf(path, tcp_frame="b"))
        assert "\n" not in str(caught.value)


def test_too_many_balls_are_refused_with_their_file(tmp_path):
    balls = "".join(f'<collision><geometry><sphere radius="0.0{k + 10}"/></geometry></collision>' for k in range(65))
    path = written(tmp_path, link("a"), f'<link name="b">{balls}</link>', joint("j", "a", "b"))
    with pytest.raises(BadModel, match=r"robot\.urdf: collision geometry: it takes 65 capsules; allowed are 64"):
        body_from_urdf(path, Arm.from_urdf(path, tcp_frame="b"))
