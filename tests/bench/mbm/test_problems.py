"""Problems of the collection: read from its archives, packed, and shipped."""

from __future__ import annotations

import io
import math
import tarfile
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from helpers.strategies import for_all, random_dq, st

from onedemo.bench.mbm.moveit_files import read_archive
from onedemo.bench.mbm.problems import Problem, pack_problems, read_problems
from onedemo.configs.errors import BadConfig
from onedemo.planner.errors import OneDemoError
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import Box, Cylinder, Obstacle, Sphere

SCENE = """
world:
  collision_objects:
    - id: can
      primitives:
        - {type: cylinder, dimensions: [0.3, 0.05]}
      primitive_poses:
        - {position: [1, 2, 3], orientation: [0, 0, 0.7071067811865476, 0.7071067811865476]}
    - id: pair
      pose: {position: [0, 0, 1], orientation: [0, 0, 0, 1]}
      primitives:
        - {type: box, dimensions: [0.1, 0.2, 0.3]}
        - {type: sphere, dimensions: [0.04]}
      primitive_poses:
        - {position: [0, 0, 0], orientation: [0, 0, 0, 2]}
        - {position: [0, 0.5, 0], orientation: [0, 0, 0, 1]}
robot_state: {}
"""
REQUEST = """
start_state:
  joint_state: {name: [a, b, finger], position: [0, 1, 0.065]}
goal_constraints:
  - joint_constraints:
      - {joint_name: b, position: 2}
      - {position: -1.5, joint_name: a}
"""


def archive(path: Path, members: dict[str, str]) -> Path:
    with tarfile.open(path, "w:bz2") as out:
        for name, text in members.items():
            info, data = tarfile.TarInfo(name), text.encode()
            info.size = len(data)
            out.addfile(info, io.BytesIO(data))
    return path


def members(scene: str = SCENE, request: str = REQUEST) -> dict[str, str]:
    return {"problems/top_shelf_arm6/scene0007.yaml": scene, "problems/top_shelf_arm6/request0007.yaml": request}


def test_an_archive_is_read_as_moveit_means_it(tmp_path):
    (problem,) = read_archive(archive(tmp_path / "some.tar.bz2", {**members(), "problems/README": "hello"}))
    assert problem.key == ("top_shelf", 7)
    can, box, ball = problem.obstacles
    assert (can.shape, box.shape, ball.shape) == (Cylinder(0.05, 0.3), Box((0.1, 0.2, 0.3)), Sphere(0.04))
    assert [each.name for each in problem.obstacles] == ["can", "pair", "pair"]
    np.testing.assert_allclose(can.pose.position, [1, 2, 3])
    np.testing.assert_allclose(can.pose.rotation @ [1, 0, 0], [0, 1, 0], atol=1e-12)  # xyzw: a quarter about z
    np.testing.assert_allclose(ball.pose.position, [0, 0.5, 1])
    start, goal = problem.joints(("a", "b"))
    np.testing.assert_array_equal(start, [0, 1])
    np.testing.assert_array_equal(goal, [-1.5, 2])


@pytest.mark.parametrize(
    "broken, words",
    [
        ({"problems/top_shelf_arm6/scene0007.yaml": SCENE}, "none is named"),
        ({**members(), "problems/top_shelf_arm6/scene0008.yaml": SCENE}, "top_shelf 8: has a scene or a request"),
        (members(scene=SCENE.replace("sphere", "cone")), "pair: is a cone"),
        (members(scene=SCENE.replace("[0.04]", "[0.04, 0.1]")), "sphere of"),
        (members(scene=SCENE.replace("id: can", "id: can\n      meshes: [1]")), "can: has a mesh"),
        (members(scene="{"), "scene0007.yaml"),
        (members(scene="world: 3"), "is no scene and request"),
        (members(request=REQUEST.replace("0.065]", "]")), "is no scene and request"),
        (members(request="start_state: 3"), "is no scene and request"),
        (members(scene=SCENE.replace("robot_state: {}", "robot_state: {attached_collision_objects: [1]}")), "attached"),
        (members(scene=SCENE.replace("robot_state:", "  octomap: {octomap: {data: [1]}}\nrobot_state:")), "octomap"),
        (members(scene=SCENE.replace("[0, 0, 0, 2]", "[0, 0, 0, 0]")), r"top_shelf 7: .*orientation \[0, 0, 0, 0\]"),
        (
            members(scene=SCENE.replace("[0.3, 0.05]", "[0.3, 0]")),
            r"top_shelf 7: cylinder: radius: 0\.0 is not a length",
        ),
        (members(scene=SCENE.replace("world:", "world: [1]\nsome:")), "top_shelf 7: is no scene and request"),
        (members(request=REQUEST.replace("position: 2", "position: .nan")), "top_shelf 7: b stands at nan"),
    ],
)
def test_what_is_not_understood_is_refused_in_one_line(broken, words, tmp_path):
    with pytest.raises(OneDemoError, match=words) as caught:
        read_archive(archive(tmp_path / "some.tar.bz2", broken))
    assert "\n" not in str(caught.value)


def test_a_scene_without_a_state_of_the_robot_is_read(tmp_path):
    scene = SCENE.replace("robot_state: {}", "robot_state:")
    (problem,) = read_archive(archive(tmp_path / "some.tar.bz2", members(scene=scene)))
    assert len(problem.obstacles) == 3


@pytest.mark.parametrize("mode", ["gz", "bz2", "xz"])
@pytest.mark.parametrize("damage", ["cut", "spoilt"])
def test_a_damaged_archive_is_refused_in_one_line(mode, damage, tmp_path):
    rng, path = np.random.default_rng(0), tmp_path / f"some.tar.{mode}"
    noise = {f"noise{k}": rng.bytes(500).hex() for k in range(9)}
    with tarfile.open(path, f"w:{mode}") as out:
        for name, text in {**noise, **members()}.items():
            info, data = tarfile.TarInfo(name), text.encode()
            info.size = len(data)
            out.addfile(info, io.BytesIO(data))
    whole = path.read_bytes()
    third = len(whole) // 3
    path.write_bytes(whole[:third] if damage == "cut" else whole[:third] + bytes(64) + whole[third + 64 :])
    with pytest.raises(BadConfig, match=rf"some\.tar\.{mode}: ") as caught:
        read_archive(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["missing.tar.bz2", "text.tar.bz2"])
def test_what_is_no_archive_is_refused_in_one_line(name, tmp_path):
    (tmp_path / "text.tar.bz2").write_text("text")
    with pytest.raises(BadConfig, match=name):
        read_archive(tmp_path / name)
    with pytest.raises(BadConfig, match=name):
        read_problems(tmp_path / name)


@for_all(st.integers(0, 2**31), max_examples=30)
def test_packing_keeps_a_problem_to_a_micrometer(seed):
    rng = np.random.default_rng(seed)
    shapes = (Box(tuple(rng.uniform(0.01, 1, 3))), Cylinder(*rng.uniform(0.01, 1, 2)), Sphere(rng.uniform(0.01, 1)))
    poses = [Pose.from_position_quaternion(rng.uniform(-2, 2, 3), Pose(random_dq(rng)).quaternion) for _ in shapes]
    obstacles = tuple(Obstacle(*each, name=f"o{k}") for k, each in enumerate(zip(shapes, poses, strict=True)))
    joints = {f"j{k}": value for k, value in enumerate(rng.uniform(-3, 3, 4))}
    problem = Problem("some", 3, obstacles, joints, dict(list(joints.items())[:2]))
    path = Path(f"{seed}.json.xz")
    one = read_back(pack_problems([problem]))
    assert one.key == problem.key and one.goal.keys() == problem.goal.keys(), path
    for before, after in zip(problem.obstacles, one.obstacles, strict=True):
        assert before.name == after.name and type(before.shape) is type(after.shape)
        distance, angle = before.pose.distance_to(after.pose)
        assert distance < 1e-6 and angle < 4e-6
    for name, value in problem.start.items():
        assert abs(one.start[name] - value) <= 0.5e-6


def read_back(data: bytes) -> Problem:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "packed.json.xz"
        path.write_bytes(data)
        (problem,) = read_problems(path)
    return problem


def test_the_shipped_problems_are_the_seven_hundred():
    problems = read_problems()
    assert Counter(each.scene for each in problems) == dict.fromkeys(
        ("bookshelf_small", "bookshelf_tall", "bookshelf_thin", "box", "cage", "table_pick", "table_under_pick"), 100
    )
    assert {each.number for each in problems} == set(range(1, 101))
    counts = {each.scene: len(each.obstacles) for each in problems}
    assert sorted(counts.values()) == [7, 7, 8, 12, 12, 15, 21]
    for each in problems:
        assert len(each.goal) == 7 and set(each.start) > set(each.goal)
        assert max(map(abs, each.goal.values())) < 4.0 and each.start["panda_finger_joint1"] == 0.065
    assert sum(max(each.goal.values()) > math.pi for each in problems) == 86


def test_the_notice_lies_beside_the_problems():
    from onedemo.bench.mbm.problems import SHIPPED

    notice = (SHIPPED.parent / "LICENSE-motionbenchmaker.txt").read_text()
    assert "BSD 3-Clause" in notice and "Rice University" in notice


def test_a_problem_for_other_joints_is_refused():
    problem = Problem("some", 1, (), {"a": 0.0, "b": 0.0}, {"a": 1.0, "b": 1.0})
    with pytest.raises(BadConfig, match="c: the arm's joint has no start"):
        problem.joints(("a", "c"))
    with pytest.raises(BadConfig, match="b: has a goal, but is no joint of the arm"):
        problem.joints(("a",))
