"""`onedemo plan`: shipped scenes, honest failures, the judge's word, files that are what they say."""

from __future__ import annotations

import json
from functools import cache

import numpy as np
import pytest
from helpers.arms import panda_urdf
from helpers.models.urdf_text import joint, link, written

from onedemo.bench.drawing.convex_view import DrawingView, back_to_front, best_view, hull, solid_of, union
from onedemo.bench.drawing.solids import scale_ends
from onedemo.bench.plan import command as plan_command
from onedemo.bench.plan.command import NOT_FOUND, REFUSED, plan_in, run_plan, scene_path
from onedemo.configs.errors import BadConfig
from onedemo.configs.plan_scene import load_scene, shipped_scene
from onedemo.planner import Arm
from onedemo.planner.errors import UnknownName
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import Box, Capsule, Cylinder, Mesh, Obstacle, Sphere
from onedemo.planner.judge.certify import certify
from onedemo.planner.log.motion_log import digest_of, read_log
from onedemo.planner.planning import refine

DETOURS = ("sphere", "wall_gap", "shelf", "clutter")
FOUND = ("free", *DETOURS)
COLORS = {"demonstration": (31, 79, 216), "final": (216, 31, 180), "free": (0, 169, 199), "plane": (47, 158, 91)}


@cache
def planned(name):
    return plan_in(load_scene(shipped_scene(name)))


@pytest.fixture
def scene_file(tmp_path):
    def write(text):
        file = tmp_path / "mine.yaml"
        file.write_text(text)
        return str(file)

    return write


def pixels_near(image, color):
    return int((np.abs(image[..., :3] * 255.0 - np.array(color)).max(axis=2) < 12).sum())


@pytest.mark.parametrize("name", FOUND)
def test_shipped_scenes_are_solved_and_the_judge_agrees(name):
    result = planned(name)
    assert result.plan.reason == ""
    assert result.plan.seconds < 1.0
    certificate = certify(result.plan.log())
    assert certificate.reasons == ()
    assert certificate.clearance >= result.settings.safety.distance
    assert certificate.position_error < 0.005
    # a scene that shows a plan at a joint limit shows a bad plan
    assert certificate.joint_margin > 0.3


@pytest.mark.parametrize("name", DETOURS)
def test_the_obstacles_of_the_scenes_do_stand_in_the_way(name):
    assert planned(name).plan.how == "escape"
    assert planned(name).plan.detours >= 1
    straight = plan_in(load_scene(shipped_scene(name), ["settings.avoid=false"])).plan
    # the safety layer alone may slip past; then it is not the demonstrated way any more
    assert not straight.success or straight.changed > 0


def test_a_cage_is_an_honest_failure(capsys, tmp_path):
    code = run_plan("cage", [], tmp_path / "cage.png", tmp_path / "cage.json")
    said = capsys.readouterr()
    assert code == NOT_FOUND
    assert "not found   cage: no clear posture: in the first of those found link5 touches left; in" in said.out
    assert "judged" not in said.out
    assert "there is no plan" in said.err
    assert not (tmp_path / "cage.json").exists()
    assert (tmp_path / "cage.png").exists()


def test_the_lines_tell_what_was_found(capsys):
    assert run_plan("sphere", [], None, None) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["found", "clearance", "joints", "judged"]
    assert "1 detour by escape trees" in lines[0]
    assert "sound by other means" in lines[3]
    assert run_plan("sphere", [], None, None, judged=False) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "more than must be kept, at the ticks" in lines[1]
    spare = 1e3 * (certify(planned("sphere").plan.log()).clearance - planned("sphere").settings.safety.distance)
    # a sample may be a little farther than the closest moment between samples
    assert spare - 0.1 < float(lines[1].split()[1]) < spare + 1.0
    assert lines[3].startswith("not judged")


def test_a_reason_names_part_and_obstacle(capsys):
    assert run_plan("sphere", ["goal=[0.0, 0.0, 0.83, 0, 1, 0, 0]"], None, None) == NOT_FOUND
    out = capsys.readouterr().out
    assert "not found   sphere: goal in collision: hand touches ball; in" in out


@pytest.mark.parametrize("smooth, timed", [(True, False), (False, True), (True, True)])
def test_a_plan_is_refined_and_what_is_written_is_the_refined_one(smooth, timed, capsys, tmp_path):
    files = tmp_path / "plan.png", tmp_path / "plan.json"
    assert run_plan("sphere", [], *files, smooth=smooth, timed=timed) == 0
    lines = capsys.readouterr().out.splitlines()
    words = ["smooth"] * smooth + ["timed"] * timed
    assert f"by escape trees, {', '.join(words)}, in " in lines[0]
    assert ("of the speed limits and up to 5 rad/s^2" in lines[2]) == timed
    assert lines[3].startswith("judged      sound")
    plain, log = planned("sphere"), read_log(files[1])
    assert certify(log).ok and digest_of(log) != digest_of(plain.plan.log())
    result = refine.smoothed(plain.plan) if smooth else plain.plan
    result = refine.timed(result) if timed else result
    np.testing.assert_array_equal(log.joints, result.joints)
    assert f"takes {result.dt * (len(result.joints) - 1):.1f} s" in lines[0]
    assert files[0].exists()


def test_a_plan_that_does_not_stay_clear_is_none(monkeypatch, capsys, tmp_path):
    good = planned("sphere")
    wall = Obstacle(Box((0.01, 0.01, 0.01)), good.arm.fk(good.plan.joints[len(good.plan.joints) // 2]), name="nail")
    asked = good.plan.request._replace(obstacles=(wall,))
    monkeypatch.setattr(plan_command, "plan_in", lambda scene: good._replace(plan=good.plan._replace(request=asked)))
    assert run_plan("sphere", [], None, tmp_path / "plan.json", timed=True) == NOT_FOUND
    assert "sphere: plan_failed: the timed motion is not clear at" in capsys.readouterr().out
    assert not (tmp_path / "plan.json").exists()


@pytest.mark.parametrize("name", [*FOUND, "cage"])
def test_figures_show_what_the_legend_says(name, tmp_path):
    from matplotlib.image import imread

    from onedemo.bench.plan.figure import draw_plan

    file = tmp_path / f"{name}.png"
    draw_plan(planned(name), None, [file])
    image = imread(file)
    assert image.shape[1] == 1296
    seen = {label: pixels_near(image, color) for label, color in COLORS.items()}
    # a legend entry alone has below 200 pixels of a color
    assert seen["demonstration"] > 500
    assert seen["final"] > 500
    assert (seen["free"] > 1000) == (name != "cage")
    corners = image[[0, 0, -1, -1], [0, -1, 0, -1], :3]
    assert (corners == 1.0).all()


@pytest.mark.parametrize("name", [*FOUND, "cage"])
def test_nothing_that_matters_is_cut_off(name):
    from onedemo.bench.plan.figure import content_of, room_of, window_of

    content = content_of(planned(name))
    for azimuth in (-155, -35, 55, 145):
        view = DrawingView(float(azimuth), 26.0)
        low, high = window_of(content, view)
        scale = view.flat(scale_ends(view, *room_of(content)))
        for points in (scale, view.flat(content.executed), *[solid.outline(view) for solid in content.solids]):
            assert ((points > low) & (points < high)).all()
        # room for "z [m]" above the scale
        assert scale[1, 1] < high[1] - 0.05


def test_a_figure_in_pdf_is_small_and_has_no_pixels(tmp_path):
    from onedemo.bench.plan.figure import draw_plan

    draw_plan(planned("clutter"), None, [tmp_path / "a.pdf", tmp_path / "b.pdf", tmp_path / "a.svg"])
    data = (tmp_path / "a.pdf").read_bytes()
    assert data.startswith(b"%PDF")
    assert b"/Subtype /Image" not in data
    assert len(data) < 250_000
    assert data == (tmp_path / "b.pdf").read_bytes()
    assert "<svg" in (tmp_path / "a.svg").read_text(encoding="utf-8")


def test_a_seed_decides_everything(tmp_path):
    from onedemo.bench.plan.figure import draw_plan

    again = plan_in(load_scene(shipped_scene("clutter")))
    assert again.plan.joints.tobytes() == planned("clutter").plan.joints.tobytes()
    draw_plan(planned("clutter"), None, [tmp_path / "a.png"])
    draw_plan(again, None, [tmp_path / "b.png"])
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_the_written_plan_can_be_judged_by_others(tmp_path):
    assert run_plan("wall_gap", [], None, tmp_path / "plan.json") == 0
    log = read_log(tmp_path / "plan.json")
    assert digest_of(log) == digest_of(planned("wall_gap").plan.log())
    assert certify(log).ok
    table = json.loads((tmp_path / "plan.json").read_text())
    table["obstacles"][1]["pose"][5] += 0.01
    (tmp_path / "plan.json").write_text(json.dumps(table))
    with pytest.raises(ValueError, match="sha256"):
        read_log(tmp_path / "plan.json")


def test_a_plan_that_the_judge_refuses_is_no_success(monkeypatch, capsys):
    good = planned("sphere")
    between = np.linspace(good.plan.joints[0], good.plan.joints[-1], 200)  # straight through the ball
    bad = good._replace(plan=good.plan._replace(joints=between))
    monkeypatch.setattr(plan_command, "plan_in", lambda scene: bad)
    assert run_plan("sphere", [], None, None) == REFUSED
    assert "REFUSED: clearance: " in capsys.readouterr().out


def test_obstacles_that_move_are_judged_as_they_move(scene_file, capsys):
    text = shipped_scene("free").read_text()
    text += "  - {shape: sphere, radius: 0.05, position: [0.3, 0.2, 1.0], velocity: [-0.15, 0, 0]}\n"
    assert run_plan(scene_file(text), [], None, None) == REFUSED
    out = capsys.readouterr().out
    assert "moving obstacles: planned as if they stood still" in out
    assert "REFUSED: clearance" in out


def test_held_objects_allowed_contacts_and_urdf_robots(scene_file):
    text = f"""
robot: {{urdf: {panda_urdf()}, tcp_frame: panda_link8, base: {{position: [0, 0, 0.1]}}}}
demonstration: [[0.45, -0.1, 0.4, 0, 1, 0, 0], [0.45, 0.1, 0.4, 0, 1, 0, 0]]
goal: [0.45, 0.2, 0.4, 0, 1, 0, 0]
held: {{name: cup, shape: sphere, radius: 0.02, tcp_from_object: {{position: [0, 0, 0.1]}}}}
obstacles: [{{name: tray, shape: box, size: [0.3, 0.3, 0.02], position: [0.45, 0.2, 0.28]}}]
"""
    file = scene_file(text)
    apart = plan_in(load_scene(file))
    assert apart.body.held == ("cup",)
    assert apart.arm.fk(apart.start).position[2] > 0.1
    assert apart.plan.reason == "goal in collision"
    together = plan_in(load_scene(file, ["allowed=[[cup, tray]]"]))
    assert together.plan.reason == ""
    assert certify(together.plan.log()).ok


SMALL = """
demonstration: [[0, 0, 1, 0, 1, 0, 0]]
goal: [0, 0, 1, 0, 1, 0, 0]
robot: {ROBOT}
"""


def test_robots_come_from_urdf_and_mjcf_files_beside_the_scene(tmp_path, capsys):
    box = '<box size="0.06 0.1 0.2"/>'
    links = (link("root", box), link("base", box), link("arm", box), link("cover", "", box), link("hand", box))
    joints = (
        joint("drive", "root", "base", "planar"),
        joint("turn", "base", "arm", xyz="0 0 0.3"),
        joint("glue", "arm", "cover", "fixed", xyz="0 0.3 0"),
        joint("bend", "arm", "hand", axis="0 1 0", xyz="0.3 0 0"),
    )
    path = written(tmp_path, *links, *joints)
    (tmp_path / "r.srdf").write_text('<robot><disable_collisions link1="arm" link2="hand"/></robot>')

    def read(robot: str):
        (tmp_path / "s.yaml").write_text(SMALL.replace("ROBOT", robot))
        return plan_command._robot(load_scene(tmp_path / "s.yaml"))

    text = "urdf: robot.urdf, tool: hand, base_link: base, locked: {turn: 0.4}"
    arm, body, home = read(f"{text}, visuals: true, package_dirs: [.], srdf: r.srdf")
    assert arm.joint_names == ("bend",) and home == pytest.approx([0.0])
    assert arm.report.held == {"drive": 0.0, "turn": 0.4} and arm.report.warnings == ()
    plain = read(text)
    assert len(plain[1]) < len(body) and "visuals=True would cover: cover" in plain[0].report.warnings[0]
    known = Arm.from_urdf(path, tcp_frame="hand", base_link="base", locked={"turn": 0.4})
    np.testing.assert_array_equal(arm.chain, known.chain)
    (tmp_path / "r.xml").write_text(
        """<mujoco><worldbody><body name="a"><joint name="x"/><geom size="0.1"/><body name="b"><joint name="y"/>
        <geom size="0.1"/><site name="tip" pos="0.3 0 0"/></body></body></worldbody></mujoco>"""
    )
    for speeds in ("[1.5]", "1.5"):
        arm, body, _ = read(f"mjcf: r.xml, tool: tip, velocity_limits: {speeds}, locked: {{x: 0.1}}")
        assert (arm.joint_names, arm.velocity_limits.tolist()) == (("y",), [1.5])
        assert set(body.names) == {"link0", "link1"}
    for robot, says in (
        ("mjcf: robot.urdf, tool: tip, velocity_limits: [1]", "robot: .*robot.urdf: mjcf: has no <mujoco>"),
        ("urdf: r.xml, tool: b", "robot: .*r.xml: urdf: has no <robot>"),
        ('urdf: robot.urdf, tool: ""', "robot: .*frame '': not in the model"),
        ("urdf: robot.urdf, tool: hand, base: {position: [0, 0, 1000]}", r"s\.yaml: robot\.base: .*1000 m away"),
        (
            "urdf: robot.urdf, tool: hand, base: {position: [0, 0, 0], quaternion: [2, 0, 0, 0]}",
            r"s\.yaml: robot\.base: .*norm 2; expected 1",
        ),
        ("urdf: robot.urdf, tool: hand, base_link: base, srdf: none.srdf", "robot: none.srdf: SRDF: no such file"),
        ("urdf: robot.urdf, tool: hand", "robot: .*joint 'drive': is neither a hinge nor a slide"),
    ):
        with pytest.raises(BadConfig, match=says):
            read(robot)


@pytest.mark.parametrize(
    "scene, overrides, message",
    [
        ("spere", [], "unknown scene 'spere'; known: cage, clutter, free"),
        ("nothing.yaml", [], "unknown scene 'nothing'"),
        ("some/nothing.yaml", [], "some/nothing.yaml: no such file"),
        ("sphere", ["robot=R2D2"], "command line: robot: unknown robot 'R2D2'; known: Panda"),
        ("sphere", ["start=[0, 0]"], r"command line: start: Panda: q has shape \(2,\); expected \(7,\)"),
        ("sphere", ["start=[0, 0, 0, .nan, 0, 0, 0]"], "command line: start: Panda: q holds .* not finite at index 3"),
        ("sphere", ["allowed=[[hand, bal]]"], "command line: allowed: unknown obstacle 'bal'; known: table, ball"),
        ("sphere", ["allowed=[[paw, ball]]"], "command line: allowed: unknown part of the body 'paw'; known: link0"),
        (
            "sphere",
            ["settings.repet.stp=1"],
            r"sphere.yaml: settings: repet.stp: unknown key; did you mean 'step'. allowed: distance",
        ),
        ("sphere", ["settings.tight=2"], "sphere.yaml: settings: .*tight.*not in"),
        ("sphere", ["robot={urdf: x.urdf, tcp_frame: t}"], "command line: robot: x.urdf: .*no such file"),
        (
            "sphere",
            ["held={shape: sphere, radius: 0.1, name: link1, tcp_from_object: {position: [0, 0, 0]}}"],
            "command line: held: unknown free name .* 'link1'",
        ),
    ],
)
def test_a_mistake_is_one_line(scene, overrides, message):
    with pytest.raises((BadConfig, UnknownName), match=message) as caught:
        run_plan(scene, overrides, None, None)
    assert "\n" not in str(caught.value)


def test_odd_urdf_inputs_are_one_line(scene_file):
    text = f"robot: {{urdf: {panda_urdf()}, tcp_frame: FRAME, velocity_limits: [1, 2]}}\n"
    text += "demonstration: [[0, 0, 1, 0, 1, 0, 0]]\ngoal: [0, 0, 1, 0, 1, 0, 0]\n"
    with pytest.raises(BadConfig, match=r"robot: .*FRAME"):
        plan_in(load_scene(scene_file(text)))
    with pytest.raises(BadConfig, match=r"robot: .*velocity_limits has shape \(2,\); expected \(7,\) or a scalar"):
        plan_in(load_scene(scene_file(text.replace("FRAME", "panda_link8"))))


@pytest.mark.parametrize("option", ["--figure", "--output"])
def test_files_that_cannot_be_written_are_named(option, tmp_path):
    bad = tmp_path / "none" / "x.png"
    with pytest.raises(BadConfig, match=f"command line: {option}: .*x.png: No such file or directory"):
        run_plan("free", [], bad if option == "--figure" else None, bad if option == "--output" else None)
    with pytest.raises(BadConfig, match=r"--figure: x\.gif does not end in \.png, \.pdf, \.svg"):
        run_plan("free", [], tmp_path.__class__("x.gif"), None)


def test_a_scene_is_found_as_file_by_name_and_by_its_path_in_the_source(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert scene_path("sphere") == scene_path("configs/scenes/sphere.yaml") == shipped_scene("sphere")
    (tmp_path / "sphere").mkdir()
    assert scene_path("sphere") == shipped_scene("sphere")
    (tmp_path / "sphere.yaml").write_text("x: 1\n")
    assert str(scene_path("sphere.yaml")) == "sphere.yaml"


SHAPES = (
    Sphere(0.1),
    Capsule(0.05, 0.2),
    Box((0.1, 0.2, 0.3)),
    Cylinder(0.08, 0.2),
    Mesh.hull_of(np.random.default_rng(0).normal(size=(12, 3)) * 0.1),
)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_what_hides_what_agrees_with_walking_towards_the_viewer(shape):
    from scipy.spatial import Delaunay

    from onedemo.planner.geometry.hulls import corner_points

    rng = np.random.default_rng(1)
    pose = Pose.from_position_quaternion([0.1, -0.2, 0.3], np.array([0.5, 0.5, -0.5, 0.5]))
    solid, view = solid_of(shape, pose), DrawingView(35.0, 25.0)
    points = rng.uniform(-0.4, 0.4, (200, 3)) + pose.position
    inside = Delaunay(corner_points(shape) @ pose.rotation.T + pose.position)
    walk = points[:, None] + np.linspace(0.0, 1.2, 200)[:, None] * view.axes[2]
    truth = (inside.find_simplex(walk.reshape(-1, 3)) >= 0).reshape(len(points), -1).any(axis=1)
    # round shapes are 3 % larger as polyhedra, and steps are finite
    assert (solid.hides(points, view) != truth).mean() < 0.03
    assert truth.mean() > 0.02


def test_near_things_are_painted_after_far_ones():
    view = DrawingView(0.0, 20.0)  # the viewer is at +x
    boxes = [solid_of(Box((0.01, 1.0, 1.0)), Pose.from_position_quaternion([x, 0, 0])) for x in (0.3, -0.2, 0.1)]
    ball = solid_of(Sphere(0.04), Pose.from_position_quaternion([0.2, 0.0, -0.4]))
    assert back_to_front([*boxes, ball], view) == [1, 2, 3, 0]


def test_outlines_grow_by_the_shell_and_join_to_one_area():
    view = DrawingView(30.0, 20.0)
    ball = solid_of(Sphere(0.1), Pose.identity())
    far = np.linalg.norm(ball.outline(view, 0.05), axis=1)
    assert far == pytest.approx(0.15)
    square = hull(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]))
    border = union([square, square + np.array([0.5, 0.0])])
    assert len(border) == 1
    x, y = border[0].T
    area = 0.5 * abs(float(x[:-1] @ y[1:] - x[1:] @ y[:-1]))
    assert area == pytest.approx(1.5, rel=1e-3)
    assert len(union([square, square + np.array([3.0, 0.0])])) == 2


def test_the_view_is_from_the_side_that_shows_the_path():
    path = np.column_stack([np.zeros(30), np.linspace(-0.3, 0.3, 30), np.full(30, 0.5)])
    wall = solid_of(Box((0.02, 1.0, 1.2)), Pose.from_position_quaternion([0.1, 0.0, 0.5]))
    view = best_view(path, path + np.array([0.0, 0.0, 0.1]), [wall], [])
    assert not wall.hides(path, view).any()
    assert view.axes[2][0] < 0
