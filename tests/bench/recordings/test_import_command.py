"""`onedemo demo import` and `demo check`, as users type them."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from onedemo.bench.cli import main
from onedemo.configs.shipped_files import shipped_demonstration
from onedemo.planner.imitation.demonstration_files import read_demonstration

RAW = Path(__file__).parents[4] / "shared/data/panda_teleop_stack.npz"
NAMES = ("x", "y", "z", "qw", "qx", "qy", "qz")
POSE_ROUNDING = 1e-14
"""Poses go through sines and cosines, whose last bits differ between machines."""


def called(monkeypatch, capsys, *arguments):
    """Exit code, standard output and error of the command in this process."""
    monkeypatch.setattr(sys, "argv", ["onedemo", *map(str, arguments)])
    with pytest.raises(SystemExit) as stopped:
        main()
    said = capsys.readouterr()
    return stopped.value.code, said.out, said.err


def stacking(folder: Path, joints: bool = False) -> Path:
    """The shipped stacking as a table of one's own: stamps in ms, millimeters, xyzw, a width, two blocks."""
    demo = read_demonstration(shipped_demonstration("stack"))
    columns = {"stamp_ms": 1e3 * demo.time}
    for owner, path in (("", demo.path), ("red_", demo.object_paths["cubeA"]), ("green_", demo.object_paths["cubeB"])):
        place, turn = path.vectors[:, :3] * 1e3, path.vectors[:, 3:]
        columns |= {f"{owner}{name}_mm": place[:, k] for k, name in enumerate("xyz")}
        columns |= {f"{owner}q{name}": turn[:, (k + 1) % 4] for k, name in enumerate("xyzw")}
    columns["gripper_width"] = np.where(demo.gripper > 0, 0.04, 0.08)
    if joints:
        columns |= {f"joint{k + 1}_deg": np.degrees(demo.joint_positions[:, k]) for k in range(7)}
    rows = [
        ";".join(f"{value:.10f}".replace(".", ",") for value in row) for row in np.column_stack(list(columns.values()))
    ]
    (folder / "mine.csv").write_text("\n".join([";".join(columns), *rows]))
    return folder / "mine.csv"


@pytest.mark.parametrize("joints", [False, True])
def test_a_table_of_one_s_own_becomes_a_demonstration_of_a_shipped_task(joints, tmp_path, monkeypatch, capsys):
    table, output = stacking(tmp_path, joints), tmp_path / "mine.npz"
    sizes = ["--size", "red=0.04,0.04,0.04", "--size", "green=0.05,0.05,0.05"]
    code, out, err = called(monkeypatch, capsys, "demo", "import", table, "-o", output, "--task", "stack", *sizes)
    assert (code, err) == (0, "")
    for words in ("time stamps are in ms", "positions are in mm, quaternions xyzw", "motions: approach, transfer"):
        assert words in out
    assert ("within the limits of the Panda; the path agrees with the joints to 0.0 mm" in out) == joints
    made, shown = read_demonstration(output), read_demonstration(shipped_demonstration("stack"))
    assert made.task == "stack" and set(made.object_paths) == {"red", "green"}
    for mine, theirs in zip(made.segments, shown.segments, strict=True):
        assert (mine.name, mine.start, mine.stop, mine.gripper) == (
            theirs.name, theirs.start, theirs.stop, theirs.gripper,
        )  # fmt: skip
        assert {"red": "cubeA", "green": "cubeB", "": ""}[mine.reference] == theirs.reference
        assert np.abs(mine.reference_pose.position - theirs.reference_pose.position).max() < 1e-9
    assert np.abs(made.path.positions - shown.path.positions).max() < 1e-9
    code, out, _ = called(monkeypatch, capsys, "demo", "check", output)
    assert code == 0
    for words in ("it points down, 10 deg off at first", "m/s in the median", "red (40 x 40 x 40 mm, is moved by 0."):
        assert words in out
    assert "ends relative to red, then the gripper closes" in out
    assert "carries red, ends relative to green, then the gripper opens" in out


@pytest.mark.slow
def test_a_table_of_one_s_own_stacks(tmp_path, monkeypatch, capsys):
    table, output = stacking(tmp_path), tmp_path / "mine.npz"
    assert called(monkeypatch, capsys, "demo", "import", table, "-o", output, "--task", "stack")[0] == 0
    run = ("run", "stack", f"demonstration={output}", "episodes=3", "video=false", "executor=serial", "-o", tmp_path)
    assert "3 of 3 succeeded" in called(monkeypatch, capsys, *run)[1]


@pytest.mark.skipif(not RAW.exists(), reason="the raw recording is not here")
def test_the_shipped_demonstration_is_what_its_command_makes(tmp_path, monkeypatch, capsys):
    output = tmp_path / "stack.npz"
    sizes = ["--size", "cubeA=0.04,0.04,0.04", "--size", "cubeB=0.05,0.05,0.05"]
    licence = ["--licence", "MIT, see LICENSE-robosuite.txt"]
    assert called(monkeypatch, capsys, "demo", "import", RAW, "-o", output, "--task", "stack", *sizes, *licence)[0] == 0
    made, shipped = np.load(output), np.load(shipped_demonstration("stack"))
    assert made.files == shipped.files
    for key in made.files:
        assert (made[key].dtype, made[key].shape) == (shipped[key].dtype, shipped[key].shape), key
        if key.endswith("poses") or key == "object_paths":
            np.testing.assert_allclose(made[key], shipped[key], rtol=0, atol=POSE_ROUNDING)
        else:
            np.testing.assert_array_equal(made[key], shipped[key], err_msg=key)


@pytest.mark.parametrize(
    "options, message",
    [
        (["--task", "shelve"], "the task needs approach, reach, lift, carry, insert, retreat; found are 2 motions ("),
        (
            ["--segment", "approach", "--segment", "put", "--segment", "go"],
            "segments: 3 are named; found are 2 motions",
        ),
        (["--segment", "approach,reference=blue"], "unknown reference of segment 'approach' 'blue'; known: red, green"),
        (["--size", "blue=1,1,1"], "--size: no object 'blue' was recorded; there are: red, green"),
        (["--size", "red=1,1"], "--size: 'red=1,1' does not give 3 numbers, like cup=0.06,0.06,0.1"),
        (["--task", "pour"], "the task needs carry; found are 2 motions (0.0 to 8.4 s, then the gripper closes; "),
        (["--size", "red=40,40,40"], "--size: 'red=40,40,40' is 40 m long: in mm? sizes are in m"),
        (["-o", "o.csv"], "--output: o.csv does not end in .npz"),
        (["--size", "red=1,-1,1"], "--size: 'red=1,-1,1' is not positive"),
        (["--place", "red=1,1,1"], "--place: 'red' is in the recording already"),
        (["--place", "peg=1,1,1,2,0,0,0"], "--place: the quaternion w x y z has norm 2; expected 1"),
        (["--tool", "0,0"], "--tool: '0,0' does not give 3 or 7 numbers"),
        (["--quaternion", "wxyz"], "qx qy qz qw is the order xyzw; --quaternion wxyz contradicts it"),
        (["--rate", "50"], "rate: is not needed: 'stamp_ms' holds the time stamps"),
        (["--time-unit", "s"], "'stamp_ms' are in ms there; --time-unit s contradicts it"),
        (["--cut", "often"], "unknown cut 'often'; known: auto, gripper, rests, none"),
        (["--demo", "demo_1"], "--demo: is for HDF5 files"),
        (["--source", "dreamt"], "source: 'dreamt' is not one of teleoperated, kinesthetic, scripted"),
    ],
)
def test_a_mistake_is_one_line(options, message, tmp_path, monkeypatch, capsys):
    code, out, err = called(
        monkeypatch, capsys, "demo", "import", stacking(tmp_path), "-o", tmp_path / "o.npz", *options
    )
    assert (code, out, len(err.strip().splitlines())) == (2, "", 1)
    assert message in err
    assert not (tmp_path / "o.npz").exists()


def joints_alone(folder: Path, scale: float = 1.0, rows: int | None = None) -> Path:
    """The shipped stacking's time and joints, and nothing else."""
    demo = read_demonstration(shipped_demonstration("stack"))
    table = np.column_stack([demo.time, scale * demo.joint_positions])[:rows]
    names = ",".join(["t", *(f"q{k}" for k in range(1, 8))])
    np.savetxt(folder / "joints.csv", table, delimiter=",", header=names, comments="")
    return folder / "joints.csv"


def test_joints_alone_are_not_compared_with_themselves(tmp_path, monkeypatch, capsys):
    code, out, _ = called(monkeypatch, capsys, "demo", "import", joints_alone(tmp_path), "-o", tmp_path / "o.npz")
    assert code == 0 and "agrees with the joints" not in out
    assert "the hand's path is that of the joints" in out and "the joints are within the limits of the Panda" in out


@pytest.mark.parametrize(
    "scale, options, message",
    [
        (180.0 / np.pi, [], "in degrees? say --angles deg"),
        (180.0 / np.pi / 15.0, [], "by the Panda: in degrees (--angles deg)? another robot (--robot), other joints or"),
        (1.0, ["--robot", "UR5e"], "has 7 joints and no pose of the hand; the UR5e has 6: say --robot"),
        (1.0, ["--robot", "Jaco"], "by the Jaco: another robot (--robot), other joints or zeros?"),
        (
            1.0,
            ["--time-unit", "ms"],
            "which no hand does: is the time in another unit (--time-unit, --rate)?",
        ),
        (1.0, ["--units", "mm"], "--units: is given, and no column is of a pose"),
    ],
)
def test_joints_that_the_robot_cannot_have_had_are_refused(scale, options, message, tmp_path, monkeypatch, capsys):
    table = joints_alone(tmp_path, scale)
    code, out, err = called(monkeypatch, capsys, "demo", "import", table, "-o", tmp_path / "o.npz", *options)
    assert (code, out, len(err.strip().splitlines())) == (2, "", 1)
    assert message in err
    assert not (tmp_path / "o.npz").exists()


def test_the_options_of_orientations_reach_the_table(tmp_path, monkeypatch, capsys):
    demo = read_demonstration(shipped_demonstration("stack"))
    vectors = [2.0 * np.arccos(w) * np.array(v) / np.linalg.norm(v) for w, *v in demo.path.vectors[:, 3:]]
    names = ",".join(["t", "x", "y", "z", "rx", "ry", "rz"])
    table = np.column_stack([demo.time, demo.path.positions, vectors])
    np.savetxt(tmp_path / "ur.csv", table, delimiter=",", header=names, comments="")
    arguments = ("demo", "import", tmp_path / "ur.csv", "-o", tmp_path / "o.npz")
    code, _, err = called(monkeypatch, capsys, *arguments)
    assert (code, len(err.strip().splitlines())) == (2, 1) and "say --rotation rotvec, rpy, or three axes" in err
    code, out, _ = called(monkeypatch, capsys, *arguments, "--rotation", "rotvec")
    assert code == 0 and "rotation vectors, taken to be in rad; the hand travels 0.833 m within 0.313 m" in out
    assert np.abs(read_demonstration(tmp_path / "o.npz").path.positions - demo.path.positions).max() < 1e-9
    for option in (["--rotation", "rpy"], ["--matrix", "rows"]):
        code, _, err = called(
            monkeypatch, capsys, "demo", "import", spoilt(tmp_path), "-o", tmp_path / "o.npz", *option
        )
        assert code == 2 and f"{option[0]}: is for tables of poses" in err


def spoilt(tmp_path, **changes) -> Path:
    arrays = dict(np.load(shipped_demonstration("stack")))
    np.savez(tmp_path / "spoilt.npz", **{**arrays, **{key: change(arrays[key]) for key, change in changes.items()}})
    return tmp_path / "spoilt.npz"


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"poses": lambda p: p[:, [0, 1, 2, 4, 5, 6, 3]]}, "poses: contradicts the joints: from sample "),
        ({"joint_positions": np.degrees}, "by the Panda: in degrees (--angles deg)?"),
        ({"joint_positions": lambda q: q + 0.3 * (np.arange(7) == 5)}, "poses: contradicts the joints: from sample "),
        ({"poses": lambda p: p * [9, 9, 9, 1, 1, 1, 1]}, "poses: moves over 2.8"),
        ({"time": lambda t: 1e9 * t}, "time: lasts 2.655e+10 s; is it in ms, us or ns?"),
        ({"time": lambda t: 1e3 * t}, "time: lasts 26550 s; is it in ms, us or ns?"),
        ({"time": lambda t: 60.0 * t}, "for a way of"),
    ],
)
@pytest.mark.parametrize("command", ["check", "run"])
def test_a_demonstration_that_contradicts_itself_is_refused(command, changes, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    file = spoilt(tmp_path, **changes)
    arguments = (
        ["demo", "check", file] if command == "check" else ["run", "stack", f"demonstration={file}", "episodes=1"]
    )
    code, out, err = called(monkeypatch, capsys, *arguments)
    assert (code, out, len(err.strip().splitlines())) == (2, "", 1)
    assert message in err


@pytest.mark.parametrize(
    "task, missing, message",
    [
        ("pour", ("object_names", "object_sizes"), "object_sizes: of 'source' is missing; this task needs"),
        ("shelve", ("gripper",), "gripper: says nothing about how the hand opens after 'insert'"),
    ],
)
def test_a_demonstration_without_what_a_task_looks_at_is_refused(task, missing, message, tmp_path, monkeypatch, capsys):
    arrays = {key: value for key, value in np.load(shipped_demonstration(task)).items() if key not in missing}
    np.savez(tmp_path / "bare.npz", **arrays)
    monkeypatch.chdir(tmp_path)
    code, _, err = called(monkeypatch, capsys, "run", task, "demonstration=bare.npz", "episodes=1")
    assert (code, len(err.strip().splitlines())) == (2, 1)
    assert message in err


def test_the_recording_itself_is_not_overwritten(tmp_path, monkeypatch, capsys):
    raw = spoilt(tmp_path)
    before = raw.read_bytes()
    code, _, err = called(monkeypatch, capsys, "demo", "import", raw, "-o", tmp_path / "." / raw.name)
    assert code == 2 and "is the recording itself, which would be lost" in err
    table = joints_alone(tmp_path)
    code, _, err = called(monkeypatch, capsys, "demo", "import", table, "-o", table)
    assert code == 2 and "does not end in .npz" in err and table.read_bytes()[:2] != b"PK"
    assert raw.read_bytes() == before


@pytest.mark.parametrize("ending, kind", [("json", "JSON"), ("bag", "a rosbag"), ("xlsx", "an Excel workbook")])
def test_a_file_of_another_kind_is_refused_by_its_kind(ending, kind, tmp_path, monkeypatch, capsys):
    (tmp_path / f"mine.{ending}").write_bytes(b"PK")
    code, _, err = called(monkeypatch, capsys, "demo", "import", tmp_path / f"mine.{ending}", "-o", tmp_path / "o.npz")
    assert code == 2 and f"is {kind}, which is not read: write it as .csv" in err


def test_pouring_without_glasses_is_refused_and_robots_are_named(tmp_path, monkeypatch, capsys):
    table = joints_alone(tmp_path)
    code, _, err = called(monkeypatch, capsys, "demo", "import", table, "-o", tmp_path / "o.npz", "--task", "pour")
    assert code == 2 and "needs the glasses source and target, and none was recorded" in err
    arguments = ("demo", "import", stacking(tmp_path), "-o", tmp_path / "o.npz", "--robot")
    code, out, _ = called(monkeypatch, capsys, *arguments, "Robby")
    assert code == 0 and "robot 'Robby' is unknown here, so nothing is compared with it; known: Panda" in " ".join(
        out.split()
    )
    assert called(monkeypatch, capsys, *arguments, "panda")[0] == 0
    assert read_demonstration(tmp_path / "o.npz").robot == "Panda"
