"""Every way that a demonstration file can be bad, made by a mutator from the shipped one."""

from __future__ import annotations

import dataclasses
import io
import os
import pickle
import zipfile

import numpy as np
import pytest

from onedemo.configs.shipped_files import shipped_demonstration
from onedemo.planner.errors import BadDemonstration, OneDemoError, UnknownName
from onedemo.planner.imitation.demonstration_files import REQUIRED, read_demonstration, save_demonstration
from onedemo.planner.imitation.demonstration_warnings import warnings_of


def shipped_arrays():
    with np.load(shipped_demonstration("stack"), allow_pickle=False) as data:
        return dict(data)


def change(key, index, value):
    def mutate(arrays):
        arrays[key] = arrays[key].copy()
        arrays[key][index] = value

    return mutate


def replace(key, value):
    return lambda arrays: arrays.update({key: value(arrays) if callable(value) else np.array(value)})


def drop(key):
    return lambda arrays: arrays.pop(key)


def scale(key, columns, factor):
    def mutate(arrays):
        arrays[key] = arrays[key].copy()
        arrays[key][... if columns is ... else (slice(None), columns)] *= factor

    return mutate


BAD = {
    "nan position": (change("poses", (7, 1), np.nan), "poses: is not finite at index 7"),
    "infinite position": (change("poses", (7, 1), np.inf), "poses: is not finite at index 7"),
    "nan time": (change("time", 3, np.nan), "time: is not finite at index 3"),
    "nan joint": (change("joint_positions", (5, 2), np.nan), "joint_positions: is not finite at index 5"),
    "nan gripper": (change("gripper", 2, np.nan), "gripper: is not finite at index 2"),
    "time goes back": (change("time", 4, 0.0), "time: does not increase at index 4"),
    "time stands": (lambda a: change("time", 9, a["time"][8])(a), "time: does not increase at index 9"),
    "long quaternion": (scale("poses", slice(3, 7), 1.01), "the quaternion at index .* has norm 1.01; expected 1"),
    "zero quaternion": (change("poses", (6, slice(3, 7)), 0.0), "the quaternion at index 6 has norm 0; expected 1"),
    "millimetres": (scale("poses", slice(0, 3), 1000.0), "m away; are the positions in cm or mm"),
    "table 100 m away": (change("poses", (11, 0), 100.0), "path: sample 11 is 100 m away"),
    "one sample": (lambda a: a.update(time=a["time"][:1], poses=a["poses"][:1]), "has 1 sample|has shape"),
    "no samples": (replace("poses", np.zeros((0, 7))), "poses|path|content"),
    "six columns": (replace("poses", lambda a: a["poses"][:, :6]), r"poses: has shape \(532, 6\); expected \(n, 7\)"),
    "shorter time": (replace("time", lambda a: a["time"][:-1]), r"time: has shape \(531,\); expected \(532,\)"),
    "shorter joints": (replace("joint_positions", lambda a: a["joint_positions"][:9]), "joint_positions: has shape"),
    "text as time": (replace("time", lambda a: a["time"].astype(str)), "time: is not an array of numbers"),
    "complex poses": (replace("poses", lambda a: a["poses"] + 0j), "poses: is not an array of numbers"),
    "nameless robot": (replace("robot", " "), "robot: ' ' is not a name of 1 to 100 characters"),
    "robot in two lines": (replace("robot", "R2\nD2"), r"robot: 'R2\\nD2' is not a name"),
    "unknown source": (replace("source", "dreamt"), "source: 'dreamt' is not one of teleoperated, kinesthetic"),
    "wrong units": (replace("units", "cm s deg xyzw"), "units: must be 'm s rad wxyz'; convert with"),
    "number as name": (replace("name", 3), "name: is not a text"),
    "newer version": (replace("format_version", 99), "format_version: is 99; this program reads 1"),
    "text version": (replace("format_version", "1"), "format_version: is 1; this program reads 1"),
    "unknown entry": (replace("colour", "red"), "colour: is unknown; allowed: "),
    "segment behind the end": (change("segment_ranges", (1, 1), 99999), "segment 'transfer': samples .* not within 0"),
    "segment backwards": (change("segment_ranges", (0, 1), 0), "segment 'approach': samples 0 to 0 are not within"),
    "segments overlap": (change("segment_ranges", (1, 0), 5), "begins at 5, before the one before has ended"),
    "doubled segment": (replace("segment_names", ["a", "a"]), "segments: names are not unique: a, a"),
    "one name less": (replace("segment_names", ["a"]), "does not have 1 entries as segment_names has"),
    "bad gripper word": (
        replace("segment_gripper", ["squeeze", "open"]),
        "gripper 'squeeze' is not one of close, open",
    ),
    "no segment ranges": (drop("segment_ranges"), "segment_ranges: is missing, although other segment entries"),
    "tilted reference": (change("segment_reference_poses", (0, 3), 9.0), "segment_reference_poses: the quaternion at"),
    "flat sizes": (replace("object_sizes", np.zeros((2, 2))), r"object_sizes: has shape \(2, 2\); expected \(2, 3\)"),
    "flat ranges": (replace("segment_ranges", [1, 2]), r"segment_ranges: is int64 of shape \(2,\); expected whole"),
    "float ranges": (replace("segment_ranges", [[0.0, 169.0], [170.0, 515.0]]), "segment_ranges: is float64 of shape"),
    "three ranges": (
        replace("segment_ranges", [[0, 9], [10, 20], [21, 30]]),
        "segment_ranges: does not have 2 entries",
    ),
    "numbers as segment names": (replace("segment_names", [1, 2]), "segment_names: is not a list of texts"),
    "single segment name": (replace("segment_names", "approach"), "segment_names: is not a list of texts"),
    "flat reference pose": (
        replace("segment_reference_poses", np.zeros(7)),
        "segment_reference_poses: is not an array",
    ),
    "reference 100 m away": (
        change("segment_reference_poses", (1, 0), 100.0),
        "segment 'transfer': the reference pose is 100 m away; is it in cm or mm",
    ),
    "unknown reference": (
        replace("segment_references", ["cubeX", "cubeB"]),
        "segment 'approach': reference 'cubeX' is not in object_names; allowed: cubeA, cubeB, ''",
    ),
    "unknown object in the hand": (replace("segment_held", ["", "cup"]), "segment 'transfer': held 'cup' is not in"),
    "negative size": (change("object_sizes", (1, 2), -0.05), "object_sizes: of 'cubeB' is .*; expected three positive"),
    "zero size": (change("object_sizes", (0, 0), 0.0), "object_sizes: of 'cubeA' is .*; expected three positive"),
    "doubled object": (
        replace("object_names", ["cubeA", "cubeA"]),
        "object_names: are not unique names: 'cubeA', 'cubeA'",
    ),
    "object names in a table": (
        replace("object_names", [["cubeA"], ["cubeB"]]),
        "object_names: is not a list of texts",
    ),
    "text sizes": (
        replace("object_sizes", lambda a: a["object_sizes"].astype(str)),
        "object_sizes: is not an array of",
    ),
    "six joints of a Panda": (
        replace("joint_positions", lambda a: a["joint_positions"][:, :6]),
        "joint_positions: has 6 columns; the Panda has 7 joints",
    ),
    "another number of object poses": (
        replace("object_paths", lambda a: a["object_paths"][:, :-1]),
        "object_paths of 'cubeA': has 531 poses; path has 532",
    ),
    "one object's path less": (
        replace("object_paths", lambda a: a["object_paths"][:1]),
        "object_paths: is for 1; there are 2 names: cubeA, cubeB",
    ),
    "object in millimetres": (
        replace("object_paths", lambda a: a["object_paths"] * [1e3, 1e3, 1e3, 1, 1, 1, 1]),
        "object_paths of 'cubeA': sample .* m away; are the positions in cm or mm",
    ),
    "nameless object paths": (drop("object_path_names"), "object_path_names: is missing, although object_paths is"),
    "no object paths": (drop("object_paths"), "object_paths: is missing, although object_path_names is there"),
    "flat object paths": (replace("object_paths", np.zeros((2, 7))), "object_paths: is not an array of numbers with 3"),
    "object that turns into none": (
        lambda a: change("object_paths", (0, 5, slice(3, 7)), 0.0)(a),
        "object_paths of 'cubeA': the quaternion at index 5 has norm 0",
    ),
    "nan in a finger": (change("other_joints", (3, 1), np.nan), "other_joints: is not finite at index 3"),
    "a finger less": (
        replace("other_joints", lambda a: a["other_joints"][:, :1]),
        "other_joints: is for 1; there are 2 names",
    ),
    "short fingers": (replace("other_joints", lambda a: a["other_joints"][:-1]), "other_joints of .*: has shape"),
    "short commands": (replace("commanded_poses", lambda a: a["commanded_poses"][:-1]), "commanded: has 531 poses"),
    "fixture that is an object": (
        lambda a: a.update(fixture_names=np.array(["cubeA"]), fixture_poses=a["poses"][:1]),
        "fixtures: 'cubeA' is among object_paths, too",
    ),
    "fixture 100 m away": (
        lambda a: a.update(fixture_names=np.array(["peg"]), fixture_poses=a["poses"][:1] + 100.0 * np.eye(7)[0]),
        "fixtures of 'peg': sample 0 is .* m away",
    ),
    "nanoseconds": (scale("time", ..., 1e9), "time: lasts 2.655e\\+10 s; is it in ms, us or ns"),
    "milliseconds": (scale("time", ..., 1e3), "time: lasts 26550 s; is it in ms, us or ns"),
    "minutes": (scale("time", ..., 60.0), "time: lasts 1593 s for a way of .* m: is it in ms, us or ns"),
    "text joints": (
        replace("joint_positions", lambda a: a["joint_positions"].astype(str)),
        "joint_positions: is not an array of numbers",
    ),
    "complex gripper": (replace("gripper", lambda a: a["gripper"] + 0j), "gripper: is not an array of numbers"),
    "text gripper": (replace("gripper", lambda a: a["gripper"].astype(str)), "gripper: is not an array of numbers"),
    **{
        f"no {key}": (drop(key), f"{key}: is missing; a demonstration holds: {', '.join(REQUIRED)}") for key in REQUIRED
    },
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_demonstration_is_refused_in_one_line_that_names_file_and_key(name, tmp_path):
    mutate, message = BAD[name]
    arrays = shipped_arrays()
    mutate(arrays)
    path = tmp_path / "bad.npz"
    np.savez(path, **arrays)
    with pytest.raises(BadDemonstration, match=message) as caught:
        read_demonstration(path)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(str(path))


@pytest.mark.parametrize("value", [["0", "1"], np.array([0j, 1j]), [None, 1.0]])
def test_a_demonstration_made_in_code_takes_real_numbers_only(value):
    demo = read_demonstration(shipped_demonstration("stack"))
    with pytest.raises(BadDemonstration, match="stack: time: is not an array of real numbers"):
        dataclasses.replace(demo, time=value)


def test_names_need_no_sizes_and_another_robot_may_be_the_teacher():
    demo = read_demonstration(shipped_demonstration("stack"))
    assert dataclasses.replace(demo, object_sizes={}).segments[0].reference == "cubeA"
    six = dataclasses.replace(demo, robot="UR5e", joint_positions=demo.joint_positions[:, :6])
    for robot in ("UR10", "our own arm, 2nd"):
        assert dataclasses.replace(six, robot=robot).robot == robot
    assert six.robot == "UR5e"
    assert not demo.object_sizes["cubeA"].flags.writeable


def test_a_demonstration_that_cannot_be_written_leaves_no_file(tmp_path, monkeypatch):
    demo = read_demonstration(shipped_demonstration("stack"))

    def full(file, **arrays):
        file.write(b"begun")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez_compressed", full)
    with pytest.raises(OSError, match="No space left"):
        save_demonstration(demo, tmp_path / "new.npz")
    assert list(tmp_path.iterdir()) == []


def npy(array) -> bytes:
    out = io.BytesIO()
    np.lib.format.write_array(out, np.asarray(array), allow_pickle=True)
    return out.getvalue()


class Attack:
    def __reduce__(self):
        return os.mkdir, ("attacked",)


def zipped(path, entries):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in entries:
            archive.writestr(name, content)


def announce(shape) -> bytes:
    out = io.BytesIO()
    np.lib.format.write_array_header_1_0(out, {"descr": "<f8", "fortran_order": False, "shape": shape})
    return out.getvalue()


FILES = {
    "empty": lambda path: path.write_bytes(b""),
    "text": lambda path: path.write_text("hello"),
    "pickle": lambda path: path.write_bytes(pickle.dumps(Attack())),
    "torn": lambda path: path.write_bytes(shipped_demonstration("stack").read_bytes()[:3000]),
    "folder": lambda path: path.mkdir(),
    "missing": lambda path: None,
    "object array": lambda path: zipped(path, [("time.npy", npy(np.array([Attack()], dtype=object)))]),
    "header bomb": lambda path: zipped(path, [("time.npy", announce((10**12,)))]),
    "zip bomb": lambda path: zipped(path, [("time.npy", announce((9_000_000,)) + bytes(72_000_000))]),
    "negative shape": lambda path: zipped(path, [("time.npy", announce((-5,)) + bytes(40))]),
    "not an array": lambda path: zipped(path, [("time.npy", b"hello")]),
    "outside": lambda path: zipped(path, [("../time.npy", npy(np.zeros(3)))]),
    "other entry": lambda path: zipped(path, [("run.py", b"import os")]),
}


@pytest.mark.parametrize("name", FILES)
def test_a_hostile_file_is_refused_and_never_runs(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "hostile.npz"
    FILES[name](path)
    with pytest.raises(BadDemonstration) as caught:
        read_demonstration(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "attacked").exists()


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_doubled_members_are_refused(tmp_path):
    zipped(tmp_path / "two.npz", [("time.npy", npy(np.zeros(3))), ("time.npy", npy(np.ones(3)))])
    with pytest.raises(BadDemonstration, match="stands in the file twice"):
        read_demonstration(tmp_path / "two.npz")


def test_random_damage_is_an_error_of_ours_or_harmless(tmp_path):
    data, rng, path = shipped_demonstration("stack").read_bytes(), np.random.default_rng(0), tmp_path / "damaged.npz"
    refused = 0
    for _ in range(150):
        damaged = bytearray(data)
        for position in rng.integers(0, len(data), rng.integers(1, 6)):
            damaged[position] = rng.integers(256)
        path.write_bytes(damaged)
        try:
            read_demonstration(path)
        except OneDemoError as error:
            refused += 1
            assert "\n" not in str(error)
    assert refused > 100


def test_saving_and_loading_keeps_everything(tmp_path):
    demo = read_demonstration(shipped_demonstration("stack"))
    save_demonstration(demo, tmp_path / "again.npz")
    again = read_demonstration(tmp_path / "again.npz")
    for key in ("name", "task", "robot", "tcp_frame", "source", "licence"):
        assert getattr(again, key) == getattr(demo, key)
    for key in ("time", "joint_positions", "gripper"):
        np.testing.assert_array_equal(getattr(again, key), getattr(demo, key))
    np.testing.assert_allclose(again.path.vectors, demo.path.vectors, atol=1e-15)
    assert [s.name for s in again.segments] == ["approach", "transfer"]
    for ours, theirs in zip(again.segments, demo.segments, strict=True):
        assert (ours.start, ours.stop, ours.reference, ours.held, ours.gripper) == (
            theirs.start,
            theirs.stop,
            theirs.reference,
            theirs.held,
            theirs.gripper,
        )
        assert ours.reference_pose.distance_to(theirs.reference_pose) < (1e-12, 1e-12)
    np.testing.assert_array_equal(again.object_sizes["cubeA"], [0.04] * 3)


def test_saving_and_loading_keeps_the_scene(tmp_path):
    demo = read_demonstration(shipped_demonstration("stack"))
    demo = dataclasses.replace(demo, fixtures={"table": demo.path[3], "shelf": demo.path[9]})
    save_demonstration(demo, tmp_path / "again.npz")
    again = read_demonstration(tmp_path / "again.npz")
    for key in ("object_paths", "fixtures", "other_joints"):
        assert list(getattr(again, key)) == list(getattr(demo, key)) and len(getattr(demo, key)) == 2
    for name, path in demo.object_paths.items():
        np.testing.assert_allclose(again.object_paths[name].vectors, path.vectors, atol=1e-15)
    for name, values in demo.other_joints.items():
        np.testing.assert_array_equal(again.other_joints[name], values)
    for name, pose in demo.fixtures.items():
        np.testing.assert_allclose(again.fixtures[name].vector, pose.vector, atol=1e-15)
    assert demo.commanded is not None and again.commanded is not None
    np.testing.assert_allclose(again.commanded.vectors, demo.commanded.vectors, atol=1e-15)


def test_rounded_quaternions_are_accepted_and_made_unit(tmp_path):
    arrays = shipped_arrays()
    arrays["poses"] = arrays["poses"].astype(np.float32).round(4)
    np.savez(tmp_path / "rounded.npz", **arrays)
    quaternions = read_demonstration(tmp_path / "rounded.npz").path.quaternions
    np.testing.assert_allclose(np.linalg.norm(quaternions, axis=1), 1, atol=1e-14)


def test_segments_are_found_by_name():
    demo = read_demonstration(shipped_demonstration("stack"))
    assert len(demo.segment_path("approach")) == demo.segment("approach").stop + 1
    with pytest.raises(UnknownName, match="known: approach, transfer"):
        demo.segment("pour")


def test_warnings_tell_of_pauses_and_tilt():
    text = "\n".join(warnings_of(read_demonstration(shipped_demonstration("stack"))))
    assert "pause of 0.9 s" in text
    assert "tilted" in text
