"""Scene files: what they mean, and that every mistake is one line that names file and key."""

from __future__ import annotations

import math

import numpy as np
import pytest

from onedemo.configs.errors import BadConfig
from onedemo.configs.plan_scene import load_scene, shipped_scene
from onedemo.configs.shipped_files import shipped_demonstration
from onedemo.planner.errors import UnknownName
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import Box, Capsule, Cylinder, Mesh, Sphere
from onedemo.planner.imitation.demonstration_files import read_demonstration

DEMO = "demonstration: [[0, 0, 1, 0, 1, 0, 0], [0, 0.1, 1, 0, 1, 0, 0]]\n"
GOAL = "goal: [0, 0.2, 1, 0, 1, 0, 0]\n"
GOOD = DEMO + GOAL
SPHERE = "obstacles: [{shape: sphere, radius: 0.1, position: [0, 0, 1]}]\n"


def obstacle(text: str) -> str:
    return GOOD + f"obstacles: [{{shape: sphere, radius: 0.1, position: [0, 0, 1]}}, {{{text}}}]\n"


BAD = {
    "unknown key": (GOOD + "gaol: 1\n", "gaol: unknown key; did you mean 'goal'\\? allowed: title, robot, demon"),
    "far key": (GOOD + "colour: red\n", "colour: unknown key; allowed: title, robot"),
    "no demonstration": (GOAL, "demonstration: is missing"),
    "no goal": (DEMO, "goal: is missing"),
    "demonstration a word": (GOAL + "demonstration: stack\n", "demonstration: must be a list of pose vectors, or a"),
    "no poses": (GOAL + "demonstration: []\n", "demonstration: list should have at least 1 item"),
    "short pose": (GOAL + "demonstration: [[0, 0, 1]]\n", r"demonstration\[0\]: list should have at least 7 items"),
    "text pose": (GOAL + "demonstration: [[0, 0, x, 0, 1, 0, 0]]\n", r"demonstration\[0\]\[2\]: .*number, got 'x'"),
    "pose not unit": (GOAL + "demonstration: [[0, 0, 1, 0, 2, 0, 0]]\n", "demonstration: poses: .*index 0 has norm 2"),
    "pose nan": (
        GOAL + "demonstration: [[0, .nan, 1, 0, 1, 0, 0]]\n",
        "demonstration: poses: is not finite at index 0",
    ),
    "poses far": (
        GOAL + "demonstration: [[0, 900, 1, 0, 1, 0, 0]]\n",
        "demonstration: pose: position: 900 m away: mill",
    ),
    "no such recording": (GOAL + "demonstration: {file: stak}\n", "demonstration: unknown demonstration 'stak'; known"),
    "no such file": (GOAL + "demonstration: {file: x.npz}\n", r"demonstration: .*x\.npz: file: does not exist"),
    "no such segment": (GOAL + "demonstration: {file: stack, segment: x}\n", "demonstration: unknown segment .* 'x'"),
    "recording key": (GOAL + "demonstration: {file: stack, part: x}\n", "demonstration.part: unknown key; allowed: fi"),
    "goal nan": (DEMO + "goal: [0, 0.2, .nan, 0, 1, 0, 0]\n", "goal: pose: is not finite"),
    "goal far": (DEMO + "goal: [0, 1000, 0, 0, 1, 0, 0]\n", "goal: .*1000 m away"),
    "goal short": (DEMO + "goal: [0, 0.2, 1]\n", "goal: list should have at least 7 items"),
    "goal without position": (DEMO + "goal: {yaw_degrees: 3}\n", "goal.position: is missing"),
    "goal with two attitudes": (
        DEMO + "goal: {position: [0, 0, 1], yaw_degrees: 3, quaternion: [1, 0, 0, 0]}\n",
        "goal.yaw_degrees: cannot stand beside 'quaternion'",
    ),
    "goal attitude nan": (DEMO + "goal: {position: [0, 0, 1], yaw_degrees: .nan}\n", "goal: .*not finite"),
    "goal attitude infinite": (DEMO + "goal: {position: [0, 0, 1], yaw_degrees: .inf}\n", "goal: .*not finite"),
    "goal quaternion": (DEMO + "goal: {position: [0, 0, 1], quaternion: [1, 1, 0, 0]}\n", "goal: pose: .*norm 1.414"),
    "start a word": (GOOD + "start: there\n", "start: .*'home'"),
    "start a number": (GOOD + "start: 3\n", "start: must be a list of joints, or home, got 3"),
    "robot a number": (GOOD + "robot: 7\n", "robot.*dictionary|robot: must be a robot's name"),
    "robot without tool": (GOOD + "robot: {urdf: x.urdf}\n", "robot.tool: is missing; it may also be tcp_frame"),
    "robot without file": (GOOD + "robot: {tool: y}\n", "robot.urdf: is missing; it may also be mjcf"),
    "robot with two files": (GOOD + "robot: {urdf: x, mjcf: y, tool: z}\n", "robot.mjcf: cannot stand beside 'urdf'"),
    "robot with two tools": (
        GOOD + "robot: {urdf: x, tool: y, tcp_frame: z}\n",
        "robot.tcp_frame: cannot stand beside",
    ),
    "robot key": (
        GOOD + "robot: {urdf: x, tcp_frame: y, tcp: z}\n",
        "robot.tcp: unknown key; .*allowed: urdf, mjcf, too",
    ),
    "robot without speeds": (
        GOOD + "robot: {mjcf: x, tool: y}\n",
        "robot.velocity_limits: is missing: MJCF has no speed",
    ),
    "speeds a word": (
        GOOD + "robot: {urdf: x, tool: y, velocity_limits: fast}\n",
        "robot.velocity_limits: must be a number, or a list of one per joint, got 'fast'",
    ),
    "packages of MJCF": (
        GOOD + "robot: {mjcf: x, tool: y, velocity_limits: [1], package_dirs: [a]}\n",
        "robot.package_dirs: is for a URDF",
    ),
    "base of MJCF": (
        GOOD + "robot: {mjcf: x, tool: y, velocity_limits: [1], base: {position: [0, 0, 0]}}\n",
        "robot.base: is for a URDF",
    ),
    "locked a list": (GOOD + "robot: {urdf: x, tool: y, locked: [a]}\n", "robot.locked: .*dictionary"),
    "locked a word": (GOOD + "robot: {urdf: x, tool: y, locked: {a: up}}\n", "robot.locked.a: .*number, got 'up'"),
    "packages a word": (GOOD + "robot: {urdf: x, tool: y, package_dirs: a}\n", "robot.package_dirs: .*list"),
    "visuals a number": (GOOD + "robot: {urdf: x, tool: y, visuals: 1}\n", "robot.visuals: .*boolean"),
    "seed": (GOOD + "seed: -1\n", "seed: .*greater than or equal to 0, got -1"),
    "seed text": (GOOD + "seed: '1'\n", "seed: .*integer, got '1'"),
    "settings": (GOOD + "settings: 3\n", "settings: .*dictionary"),
    "allowed": (GOOD + "allowed: [[hand]]\n", r"allowed\[0\]: list should have at least 2 items"),
    "obstacles": (GOOD + "obstacles: {a: 1}\n", "obstacles: .*list"),
    "obstacle a word": (GOOD + "obstacles: [ball]\n", r"obstacles\[0\]: .*dictionary"),
    "no shape": (obstacle("radius: 1, position: [0, 0, 0]"), r"obstacles\[1\].shape: is missing"),
    "odd shape": (obstacle("shape: cone, position: [0, 0, 0]"), r"obstacles\[1\].shape: .*'sphere'.*got 'cone'"),
    "no radius": (obstacle("shape: sphere, position: [0, 0, 0]"), r"\[1\].radius: is missing; a sphere has radius$"),
    "no length": (
        obstacle("shape: capsule, radius: 1, position: [0, 0, 0]"),
        r"obstacles\[1\].length: is missing; a capsule has radius and length",
    ),
    "size of another": (
        obstacle("shape: sphere, radius: 1, size: [1, 1, 1], position: [0, 0, 0]"),
        r"obstacles\[1\].size: a sphere has none; it has radius",
    ),
    "radius 0": (
        obstacle("shape: sphere, radius: 0, position: [0, 0, 0]"),
        r"obstacles\[1\]: sphere: radius: 0.0 is no",
    ),
    "radius nan": (
        obstacle("shape: sphere, radius: .nan, position: [0, 0, 0]"),
        r"obstacles\[1\]: sphere: radius: nan",
    ),
    "radius in mm": (
        obstacle("shape: sphere, radius: 300, position: [0, 0, 0]"),
        r"obstacles\[1\]: sphere: radius: 300",
    ),
    "size": (obstacle("shape: box, size: [1, -1, 1], position: [0, 0, 0]"), r"obstacles\[1\]: box: size\[1\]: -1"),
    "flat mesh": (
        obstacle("shape: mesh, vertices: [[0,0,0],[1,0,0],[0,1,0],[1,1,0]], position: [0, 0, 0]"),
        r"obstacles\[1\]: mesh: vertices: they enclose no volume",
    ),
    "hollow mesh": (
        obstacle(
            "shape: mesh, vertices: [[0,0,0],[1,0,0],[0,1,0],[0,0,1],[0.1,0.1,0.1]], position: [0, 0, 0]",
        ),
        r"obstacles\[1\]: mesh: vertices: vertex 4 is no corner of the hull",
    ),
    "place nan": (obstacle("shape: sphere, radius: 1, position: [0, .nan, 0]"), r"obstacles\[1\]: .*not finite"),
    "place far": (obstacle("shape: sphere, radius: 1, position: [0, 1e9, 0]"), r"obstacles\[1\]: .*m away"),
    "velocity nan": (
        obstacle("shape: sphere, radius: 1, position: [0, 0, 0], velocity: [0, 0, .nan]"),
        r"obstacles\[1\]: obstacle '': velocity holds a value that is not finite",
    ),
    "margin": (obstacle("shape: sphere, radius: 1, position: [0, 0, 0], margin: -1"), r"obstacles\[1\]: .*margin: -1"),
    "obstacle key": (
        obstacle("shape: sphere, radios: 1, position: [0, 0, 0]"),
        r"\[1\].radios: unknown key; did you me",
    ),
    "held": (GOOD + "held: {shape: sphere, radius: 0.1}\n", "held.tcp_from_object: is missing"),
    "held radius": (
        GOOD + "held: {shape: sphere, radius: -1, tcp_from_object: {position: [0, 0, 0]}}\n",
        "held: sphere: radius: -1",
    ),
    "doubled key": (GOOD + "seed: 1\nseed: 2\n", "duplicate key"),
    "anchor": (GOOD + "title: &x a\n", "line 3: anchors and aliases are not allowed"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_scene_is_refused_in_one_line_that_names_file_and_key(name, tmp_path):
    text, message = BAD[name]
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with pytest.raises(BadConfig, match=message) as caught:
        load_scene(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500


@pytest.mark.parametrize(
    "override, message",
    [
        ("gaol=1", "^command line: gaol: unknown key; did you mean 'goal'"),
        ("goal.yaw=1", "^command line: goal.yaw: unknown key; allowed: position, quaternion, rpy_degrees, yaw_deg"),
        (
            "obstacles=[{shape: sphere, radius: -1, position: [0, 0, 0]}]",
            r"^command line: obstacles\[0\]: sphere: radius",
        ),
        ("seed=x", "^command line: seed: .*got 'x'"),
    ],
)
def test_a_bad_override_is_blamed_on_the_command_line(override, message, tmp_path):
    (tmp_path / "good.yaml").write_text(DEMO + "goal: {position: [0, 0, 1]}\n")
    with pytest.raises(BadConfig, match=message):
        load_scene(tmp_path / "good.yaml", [override])


def test_a_scene_means_what_it_says(tmp_path):
    (tmp_path / "scene.yaml").write_text(
        DEMO
        + """
goal: {position: [0.1, 0.2, 0.3], rpy_degrees: [180, 0, 90]}
start: [1, 2, 3]
seed: 7
held: {name: cup, shape: cylinder, radius: 0.03, length: 0.1, tcp_from_object: {position: [0, 0, 0.05]}}
allowed: [[cup, table]]
settings: {repet: {step: 0.03}}
obstacles:
  - {shape: sphere, radius: 0.1, position: [1, 2, 3], velocity: [0, 0, 0.5], margin: 0.02, name: ball}
  - {shape: capsule, radius: 0.1, length: 0.2, position: [0, 0, 1], yaw_degrees: 90}
  - {shape: box, size: [0.1, 0.2, 0.3], position: [0, 0, 1], quaternion: [0, 0, 0, 1], name: table}
  - {shape: cylinder, radius: 0.1, length: 0.2, position: [0, 0, 1]}
  - {shape: mesh, vertices: [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], position: [0, 0, 1]}
"""
    )
    scene = load_scene(tmp_path / "scene.yaml", ["seed=8"])
    assert (scene.name, scene.config.seed, scene.config.start) == ("scene", 8, [1.0, 2.0, 3.0])
    # the tool points down, its x axis along the world's y
    assert scene.goal.rotation == pytest.approx(np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]), abs=1e-12)
    assert scene.goal.position == pytest.approx([0.1, 0.2, 0.3])
    assert [type(o.shape) for o in scene.obstacles] == [Sphere, Capsule, Box, Cylinder, Mesh]
    ball, capsule, table = scene.obstacles[:3]
    assert (ball.name, ball.margin, list(ball.velocity)) == ("ball", 0.02, [0.0, 0.0, 0.5])
    assert capsule.pose.distance_to(Pose.from_yaw([0, 0, 1], math.pi / 2)) == pytest.approx((0, 0), abs=1e-9)
    assert (table.shape.size, table.pose.yaw) == ((0.1, 0.2, 0.3), pytest.approx(math.pi))
    assert scene.held is not None
    assert (scene.held.name, scene.held.shape) == ("cup", Cylinder(0.03, 0.1))
    assert scene.held.tcp_from_object.position == pytest.approx([0, 0, 0.05])
    assert scene.allowed == (("cup", "table"),)
    assert scene.config.settings == {"repet": {"step": 0.03}}


def test_roll_pitch_and_yaw_turn_about_fixed_axes_in_this_order(tmp_path):
    from scipy.spatial.transform import Rotation

    (tmp_path / "s.yaml").write_text(DEMO + "goal: {position: [0, 0, 1], rpy_degrees: [30, 40, 50]}\n")
    wanted = Rotation.from_euler("xyz", [30, 40, 50], degrees=True).as_matrix()
    assert load_scene(tmp_path / "s.yaml").goal.rotation == pytest.approx(wanted, abs=1e-12)


def test_demonstrations_come_in_small_steps_and_keep_their_ends(tmp_path):
    (tmp_path / "s.yaml").write_text(GOOD)
    path = load_scene(tmp_path / "s.yaml").demonstrated
    assert np.diff(path.lengths()).max() <= 0.005 + 1e-9
    assert path.positions[[0, -1]] == pytest.approx(np.array([[0, 0, 1], [0, 0.1, 1]]))
    (tmp_path / "r.yaml").write_text(GOAL + "demonstration: {file: stack, segment: transfer}\n")
    shown = read_demonstration(shipped_demonstration("stack")).segment_path("transfer")
    recorded = load_scene(tmp_path / "r.yaml").demonstrated
    assert recorded[0].distance_to(shown[0]) == pytest.approx((0, 0), abs=1e-9)
    assert recorded[-1].distance_to(shown[-1]) == pytest.approx((0, 0), abs=1e-9)


def test_files_are_looked_for_beside_the_scene_first(tmp_path, monkeypatch):
    (tmp_path / "scenes").mkdir()
    (tmp_path / "scenes" / "s.yaml").write_text(GOAL + "demonstration: {file: mine.npz, segment: transfer}\n")
    (tmp_path / "scenes" / "mine.npz").write_bytes(shipped_demonstration("stack").read_bytes())
    monkeypatch.chdir(tmp_path)
    assert len(load_scene("scenes/s.yaml").demonstrated) > 10


def test_shipped_scenes_are_found_by_name():
    for name in ("free", "sphere", "wall_gap", "shelf", "clutter", "cage"):
        assert load_scene(shipped_scene(name)).name == name
    with pytest.raises(UnknownName, match="unknown scene 'spere'; known: cage, clutter, free, shelf, sphere, wall_gap"):
        shipped_scene("spere")


def test_the_clutter_has_every_shape():
    kinds = {type(o.shape) for o in load_scene(shipped_scene("clutter")).obstacles}
    assert kinds == {Sphere, Capsule, Box, Cylinder, Mesh}
