"""The track on a small arm among boxes: solved, judged by its true shapes, kept, and summed up."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from helpers.strategies import for_all, st

from onedemo.bench.mbm import command
from onedemo.bench.mbm.command import Track, chosen, prepared, run_mbm
from onedemo.bench.mbm.problems import Problem, read_problems
from onedemo.bench.mbm.robot import RobotFiles, pose_numbers, robot_files, widened
from onedemo.bench.mbm.solvers import OURS, Answer
from onedemo.bench.mbm.table import is_unsound, page, row_of, summaries
from onedemo.bench.mbm.track_judge import judge_of, pairs_of_links
from onedemo.bench.robot.mesh_judge import MeshJudge, densely
from onedemo.configs.errors import BadConfig
from onedemo.planner.errors import BadModel, UnknownName
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import Obstacle, Sphere

LINK = """
  <link name="{name}"><collision><origin xyz="0.15 0 0"/><geometry><box size="0.3 0.04 0.04"/></geometry></collision>
  </link>"""
JOINT = """
  <joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/><origin xyz="{x} 0 0"/>
  <axis xyz="0 0 1"/><limit lower="-2" upper="2" velocity="2" effort="1"/></joint>"""
PARTS = (("base", "one", 0.0), ("one", "two", 0.3), ("two", "three", 0.3))


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> RobotFiles:
    """An arm of three links in a plane, and a finger that stands still, open."""
    text = '<robot name="flat">\n  <link name="base"/>' + "".join(LINK.format(name=child) for _, child, _ in PARTS)
    text += "".join(JOINT.format(name=f"j_{b}", parent=a, child=b, x=x) for a, b, x in PARTS)
    text += """
  <link name="tip"/>
  <joint name="tip_joint" type="fixed"><parent link="three"/><child link="tip"/><origin xyz="0.3 0 0"/></joint>
  <link name="finger"><collision><geometry><box size="0.02 0.02 0.02"/></geometry></collision></link>
  <joint name="slide" type="prismatic"><parent link="three"/><child link="finger"/><origin xyz="0.3 0 0"/>
  <axis xyz="0 1 0"/><limit lower="0" upper="0.05" velocity="1" effort="1"/></joint>
</robot>"""
    path = tmp_path_factory.mktemp("robot") / "flat.urdf"
    path.write_text(text)
    return RobotFiles(path, None, "tip", Pose.identity())


def ball(x: float, y: float, radius: float = 0.05) -> Obstacle:
    return Obstacle(Sphere(radius), Pose.from_position_quaternion([x, y, 0.0]), name="ball")


def problem(number: int, goal, obstacles=(), start=(0.0, 0.0, 0.0), slide: float = 0.05) -> Problem:
    names = ("j_one", "j_two", "j_three")
    starts = {**dict(zip(names, start, strict=True)), "slide": slide}
    return Problem("plane", number, tuple(obstacles), starts, dict(zip(names, goal, strict=True)))


PROBLEMS = [
    problem(1, (1.2, 0.3, 0.2)),
    problem(2, (1.2, 0.0, 0.0), [ball(0.6 * math.cos(1.2), 0.6 * math.sin(1.2))]),
    problem(3, (1.4, 0.4, 0.0), [ball(0.75 * math.cos(0.7), 0.75 * math.sin(0.7))]),
]


@pytest.fixture(scope="module")
def small(files):
    """The robot and the notes about it: capsules are fitted once."""
    return prepared(files, PROBLEMS)


@pytest.fixture
def track(files, small, monkeypatch) -> Track:
    monkeypatch.setattr(command, "read_problems", lambda: PROBLEMS)
    monkeypatch.setattr(command, "prepared", lambda files, problems: small)
    return Track(files, None, (), None, 0.005)


def test_the_track_is_solved_judged_and_kept(track, tmp_path, capsys):
    folder = tmp_path / "results"
    assert run_mbm(track._replace(count=2), folder) == 0
    first = (folder / "rows.jsonl").read_text()
    assert run_mbm(track, folder) == 0
    assert (folder / "rows.jsonl").read_text().startswith(first), "finished problems are not solved again"
    rows = json.loads((folder / "mbm.json").read_text())["rows"]
    ours = {row["number"]: row for row in rows if row["solver"] == OURS}
    assert not ours[1]["reason"] and not ours[3]["reason"] and ours[2]["reason"].startswith("goal in collision")
    assert all(row["contact"] is None and not is_unsound(row) for row in ours.values())
    assert all(row["gap"] == 0.0 and row["cpu"] > 0.0 for row in ours.values() if not row["reason"])
    assert ours[3]["clearance"] >= 0.005 - 1e-6
    text = (folder / "mbm.md").read_text()
    assert "| plane | onedemo | 2 of 3 | 1 | 0 | 0 |" in text and "| plane | 2 | goal in collision" in text
    with pytest.raises(BadConfig, match="distance: the folder holds results of another"):
        run_mbm(track._replace(distance=0.006), folder)


def test_a_line_torn_by_a_crash_is_solved_again(track, tmp_path):
    folder = tmp_path / "results"
    run_mbm(track._replace(count=1), folder, quiet=True)
    whole = (folder / "rows.jsonl").read_bytes()
    (folder / "rows.jsonl").write_bytes(whole[:-20])
    assert run_mbm(track._replace(count=1), folder, quiet=True) == 0
    again = (folder / "rows.jsonl").read_bytes()
    assert again.count(b"\n") == whole.count(b"\n")


def test_an_unsound_motion_ends_with_another_exit_code(track, tmp_path, monkeypatch):
    """Straight through the ball, and the judge must see it."""

    def solvers(robot, distance):
        return {OURS: lambda obstacles, start, goal: Answer(np.array([start, goal]), "", 0.001)}

    monkeypatch.setattr(command, "solvers_of", solvers)
    assert run_mbm(track, tmp_path / "results", quiet=True) == 1
    assert "ball" in (tmp_path / "results" / "mbm.md").read_text()


# The judge


@pytest.fixture(scope="module")
def judge(small) -> MeshJudge:
    return judge_of(small[0])


@for_all(st.floats(-2, 2), st.floats(-2, 2), st.floats(-1, 1), st.floats(-1, 1), max_examples=60)
def test_the_judge_finds_what_a_box_in_a_plane_touches(judge, one, two, x, y):
    """By the distance of a point from a rectangle, for a ball in the plane of the arm."""
    place, angle, hit = np.zeros(2), 0.0, False
    for turn in (one, two, 0.0):
        angle += turn
        along = np.array([math.cos(angle), math.sin(angle)])
        offset = np.array([x, y]) - place
        local = np.abs([offset @ along - 0.15, offset @ [-along[1], along[0]]]) - [0.15, 0.02]
        gap = float(np.linalg.norm(np.maximum(local, 0.0)) + min(local.max(), 0.0))
        if abs(gap - 0.05) < 1e-6:
            return
        hit |= gap < 0.05
        place = place + 0.3 * along
    tip = place + 0.05 * np.array([-math.sin(angle), math.cos(angle)])
    near_finger = np.linalg.norm(np.array([x, y]) - tip) < 0.05 + 0.02
    contact = judge.first_contact(np.array([[one, two, 0.0]]), [ball(x, y)])
    if contact is None:
        assert not hit
    elif contact.other == "ball" and contact.link != "finger":
        assert hit
    else:
        assert contact.link in ("one", "two", "three", "finger") and (near_finger or contact.other != "ball")


def test_the_judge_looks_between_the_points(judge):
    sweep = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    blocking = [ball(0.8, 0.0)]
    assert all(judge.first_contact(end[None], blocking) is None for end in sweep)
    contact = judge.first_contact(sweep, blocking)
    assert contact is not None and contact.other == "ball" and 50 < contact.sample < 120


def test_the_judge_sees_own_parts_and_open_fingers(judge):
    folded = np.array([[0.0, 2.0, 2.0]])
    contact = judge.first_contact(folded, [])
    assert contact is not None and {contact.link, contact.other} <= {"one", "two", "three", "finger"}
    at_finger = [ball(0.9, 0.05 + 0.01 + 0.006, radius=0.005)]
    assert judge.first_contact(np.zeros((1, 3)), at_finger) is None
    at_finger = [ball(0.9, 0.05 + 0.01 + 0.004, radius=0.005)]
    assert judge.first_contact(np.zeros((1, 3)), at_finger).link == "finger"


def test_the_judge_places_joints_that_turn_without_end(files, tmp_path):
    """Pinocchio describes them by cosine and sine."""
    endless = RobotFiles(tmp_path / "endless.urdf", None, "tip", Pose.identity())
    text = files.urdf.read_text().replace('name="j_two" type="revolute"', 'name="j_two" type="continuous"')
    endless.urdf.write_text(text)
    judge = judge_of(prepared(endless, PROBLEMS[:1])[0])
    for turn in (0.0, 1.0, -2.5):
        at = 0.3 + 0.2 * math.cos(turn), 0.2 * math.sin(turn)
        contact = judge.first_contact(np.array([[0.0, turn, 0.0]]), [ball(*at, radius=0.01)])
        assert contact is not None and (contact.link, contact.other) == ("two", "ball")
        assert judge.first_contact(np.array([[0.0, turn + 0.4, 0.0]]), [ball(*at, radius=0.01)]) is None


@for_all(st.lists(st.tuples(*[st.floats(-3, 3)] * 2), min_size=1, max_size=6), st.floats(0.01, 1), max_examples=50)
def test_between_dense_points_no_joint_moves_more_than_a_step(points, step):
    joints = np.array(points)
    dense = densely(joints, step)
    assert np.abs(np.diff(dense, axis=0)).max(initial=0.0) <= step * (1 + 1e-9)
    for row in joints:
        assert np.abs(dense - row).max(axis=1).min() < 1e-12
    length, whole = (np.abs(np.diff(each, axis=0)).sum() for each in (joints, dense))
    assert whole == pytest.approx(length)


def test_pairs_leave_out_neighbors_and_what_the_srdf_names(tmp_path):
    srdf = tmp_path / "some.srdf"
    srdf.write_text('<robot name="r"><disable_collisions link1="c" link2="a" reason="Never"/></robot>')
    links, neighbors = ["a", "a", "b", "c"], {frozenset("ab")}
    assert pairs_of_links(links, neighbors, None) == [(0, 3), (1, 3), (2, 3)]
    assert pairs_of_links(links, neighbors, srdf) == [(2, 3)]
    srdf.write_text("<robot")
    with pytest.raises(BadConfig, match=r"some\.srdf: SRDF"):
        pairs_of_links(links, neighbors, srdf)


# Words and choices


def test_limits_are_widened_to_the_problems_and_said(files):
    robot, notes = prepared(files, [*PROBLEMS, problem(4, (2.25, 0.0, 0.0))])
    assert robot.arm.upper[0] == 2.25 and robot.arm.lower[0] == -2.0
    assert [note for note in notes if "j_one: the file's upper limit 2 is widened to 2.25" in note]
    with pytest.raises(BadConfig, match=r"plane 4: slide: stands at 0.01, in the first problem at 0.05"):
        prepared(files, [*PROBLEMS, problem(4, (0.0, 0.0, 0.0), slide=0.01)])


def test_a_file_with_prefixes_that_nobody_declared_is_widened(files, tmp_path):
    path = tmp_path / "flat.urdf"
    path.write_text(files.urdf.read_text().replace("</robot>", "<sensor:camera/></robot>"))
    text, notes = widened(path, {"j_one": (-1.0, 2.5)})
    assert len(notes) == 1 and 'upper="2.5"' in text and "<sensor:camera" in text
    path.write_text(text.replace('lower="-2"', 'lower="x"'))
    with pytest.raises(BadModel, match=r"flat\.urdf: joint 'j_\w+': its limits are 'x' and '2"):
        widened(path, {"j_two": (-3.0, 3.0)})
    path.write_text("<robot")
    with pytest.raises(BadModel, match=r"flat\.urdf: URDF: cannot be read"):
        widened(path, {})


def test_scenes_are_chosen_by_name():
    every = read_problems()
    assert [each.key for each in chosen(every, ["cage", "box"], 2)] == [
        ("cage", 1), ("cage", 2), ("box", 1), ("box", 2)
    ]  # fmt: skip
    assert len(chosen(every, (), 15)) == 105
    with pytest.raises(UnknownName, match="unknown scene 'desk'; known: bookshelf_small"):
        chosen(every, ["desk"], None)


@pytest.mark.parametrize(
    "arguments, words",
    [
        ({"urdf": Path("nowhere.urdf"), "tool": "tip"}, "--urdf: nowhere.urdf: no such file"),
        ({"urdf": Path("nowhere.urdf")}, "--tool: is needed"),
    ],
)
def test_wrong_files_are_refused_by_their_option(arguments, words):
    with pytest.raises(BadConfig, match=words):
        robot_files(**arguments)


def test_the_base_is_seven_numbers(files):
    assert pose_numbers("0 0 1, 1 0 0 0") == [0, 0, 1, 1, 0, 0, 0]
    with pytest.raises(BadConfig, match="--base"):
        pose_numbers("zero")
    with pytest.raises(BadConfig, match="has 3 numbers"):
        robot_files(files.urdf, tool="tip", base=[0, 0, 1])
    assert robot_files(files.urdf, tool="tip", base=[0, 0, 1, 1, 0, 0, 0]).world_from_base.position[2] == 1.0


@pytest.mark.parametrize(
    "changed, unsound",
    [
        ({}, False),
        ({"contact": "hit"}, True),
        ({"refused_by_judge": "limits"}, True),
        ({"gap": 2e-3}, True),
        ({"gap": 5e-4}, False),
        ({"reason": "no path to the goal joints", "gap": None}, False),
    ],
)
def test_a_success_with_a_contact_a_refusal_or_another_end_is_unsound(changed, unsound):
    row = {**row_of("box", 1, OURS, Answer(np.zeros((2, 3)), "", 0.01), None, 0.0), **changed}
    assert is_unsound(row) == unsound
    (one, every) = summaries([row])
    assert one["scene"] == "box" and every["scene"] == "all" and one["unsound"] == every["unsound"] == int(unsound)


def test_what_our_body_refuses_is_no_bodys_time():
    refused = row_of("box", 1, OURS, Answer(None, "goal in collision: hand touches can", 0.001), None, None)
    theirs = row_of("box", 1, "ompl", Answer(None, "no way found", 9.0), None, None)
    solved = [
        row_of("box", 2, name, Answer(np.zeros((2, 3)), "", cpu), None, 0.0)
        for name, cpu in ((OURS, 0.02), ("ompl", 0.01))
    ]
    found = {each["solver"]: each for each in summaries([refused, theirs, *solved]) if each["scene"] == "all"}
    assert (
        found[OURS]["refused"] == 1
        and found[OURS]["unsolved"] == 0
        and found[OURS]["cpu_ms_median"] == pytest.approx(20.0)
    )
    assert found["ompl"]["cpu_ms_p95"] == pytest.approx(10.0)
    assert "| box | onedemo | 1 of 2 | 1 | 0 | 0 | 20.0 | 20.0 | – |" in page([refused, theirs, *solved], ["a note"])
