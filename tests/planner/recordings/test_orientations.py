"""Orientations in every convention, against pytransform3d and against the motion that was written."""

from __future__ import annotations

import numpy as np
import pytest
import pytransform3d.rotations as pr
from helpers.strategies import assert_same_pose, dqs, for_all, random_dq, st

from onedemo.planner.errors import BadDemonstration, OneDemoError
from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.recordings.orientations import from_rotations, from_three, is_rotation_word, matrix_order
from onedemo.planner.recordings.pose_columns import TableRequest
from onedemo.planner.recordings.pose_table import recording_from_table
from onedemo.planner.recordings.recording import blame_of

BLAME = blame_of("x.csv", "m")
SEQUENCES = [a + b + c for a in "xyz" for b in "xyz" for c in "xyz" if a != b != c]
WORDS = ["rotvec", "rpy", *SEQUENCES, *(each.upper() for each in SEQUENCES)]
COUNT = 12


def same_turn(one: np.ndarray, other: np.ndarray) -> None:
    assert abs(abs(float(one @ other)) - 1.0) < 1e-9


@for_all(st.sampled_from(WORDS), st.tuples(*[st.floats(-6.0, 6.0)] * 3), max_examples=120)
def test_three_numbers_turn_as_pytransform3d_says(word, numbers):
    assert is_rotation_word(word)
    (found,) = from_three(np.array([numbers]), word)
    if word == "rotvec":
        expected = pr.quaternion_from_compact_axis_angle(numbers)
    else:
        axes = "xyz" if word == "rpy" else word
        order = ["xyz".index(axis) for axis in axes.lower()]
        expected = pr.quaternion_from_euler(np.array(numbers), *order, extrinsic=axes.islower())
    same_turn(found, expected)


def test_roll_pitch_and_yaw_are_those_of_ros():
    """URDF: R = Rz(yaw) Ry(pitch) Rx(roll)."""
    turns = [pr.active_matrix_from_angle(axis, angle) for axis, angle in enumerate((0.3, -0.4, 0.5))]
    same_turn(
        from_three(np.array([[0.3, -0.4, 0.5]]), "rpy")[0], pr.quaternion_from_matrix(turns[2] @ turns[1] @ turns[0])
    )


@pytest.mark.parametrize("word", ["", "xy", "xxy", "xyy", "xYz", "RPY", "wxyz", "abc", "zyxz"])
def test_other_words_are_no_rotations(word):
    assert not is_rotation_word(word)


def numbered(poses: list[Pose], size: int, order: str) -> np.ndarray:
    rows, columns = {9: (3, 3), 12: (3, 4), 16: (4, 4)}[size]
    matrices = np.array([pose.matrix[:rows, :columns] for pose in poses])
    return (matrices if order == "rows" else matrices.transpose(0, 2, 1)).reshape(len(poses), size)


@for_all(st.lists(dqs(), min_size=2, max_size=5), st.sampled_from([9, 12, 16]), st.sampled_from(["rows", "columns"]))
def test_the_order_of_a_matrix_is_found_or_asked_about_and_never_guessed(values, size, order):
    numbers = numbered([Pose(value) for value in values], size, order)
    other = {"rows": "columns", "columns": "rows"}[order]
    assert matrix_order(numbers, order, BLAME) == order
    try:
        assert matrix_order(numbers, "", BLAME) == order
    except BadDemonstration as error:
        assert "say which by --matrix" in str(error)
        assert matrix_order(numbers, other, BLAME) == other
    else:
        with pytest.raises(BadDemonstration, match=f"written by {order}; --matrix {other} contradicts it"):
            matrix_order(numbers, other, BLAME)


@pytest.mark.parametrize("size", [12, 16])
@pytest.mark.parametrize("order", ["rows", "columns"])
def test_the_order_of_a_usual_pose_is_found(size, order):
    rng = np.random.default_rng(3)
    assert matrix_order(numbered([Pose(each) for each in random_dq(rng, 5)], size, order), "", BLAME) == order


@for_all(dqs(), st.integers(0, 8), st.floats(0.05, 1.0))
def test_what_is_no_rotation_is_refused_by_its_index(value, entry, off):
    good = Pose(value).rotation
    bad = good.copy().ravel()
    bad[entry] += off
    with pytest.raises(BadDemonstration, match="the rotation matrix at index 1 is off from orthonormal by"):
        from_rotations(np.array([good, bad.reshape(3, 3)]), BLAME)
    with pytest.raises(BadDemonstration, match="the matrix at index 0 mirrors"):
        from_rotations(np.array([-good, good]), BLAME)
    same_turn(from_rotations(good[None], BLAME)[0], Pose(value).quaternion)


MOTION = PosePath(np.array([Pose.from_position_quaternion([0.4 + 0.01 * k, -0.1, 0.5 - 0.02 * k],
    pr.quaternion_from_compact_axis_angle([2.0, 0.3 + 0.05 * k, 0.1 * k])).dq for k in range(COUNT)]))  # fmt: skip


def angles_of(path: PosePath, word: str) -> np.ndarray:
    """The numbers of a convention, by pytransform3d; Euler angles in the order of their axes."""
    if word == "rotvec":
        return np.array([pr.compact_axis_angle_from_quaternion(pose.quaternion) for pose in path])
    axes = "xyz" if word == "rpy" else word
    order = ["xyz".index(axis) for axis in axes.lower()]
    return np.array([pr.euler_from_quaternion(pose.quaternion, *order, axes.islower()) for pose in path])


@st.composite
def headers(draw):
    """A header, its numbers, the options that it needs, the word of the error without them ("" if none is needed)."""
    kind = draw(st.sampled_from(["three", "rpy", "rotvec", "quaternion", "matrix", "grid"]))
    owner, first = draw(st.sampled_from(["", "tcp_", "ee_"])), draw(st.integers(0, 1))
    mark = draw(st.sampled_from(["_{}", "[{}]", ".{}"]))

    def count(stem: str, numbers: int) -> list[str]:
        return [stem + mark.format(k + first) for k in range(numbers)]

    place, turn = MOTION.positions, MOTION.vectors[:, 3:]
    whole = draw(st.booleans())
    if kind in ("matrix", "grid"):
        order = draw(st.sampled_from(["rows", "columns"]))
        numbers = numbered(list(MOTION), draw(st.sampled_from([12, 16])), order if kind == "matrix" else "rows")
        stem = draw(st.sampled_from(["O_T_EE", f"{owner}pose", f"{owner}matrix", "T", "base_T_tool"]))
        if kind == "matrix":
            return count(stem, numbers.shape[1]), numbers, {}, "", ""
        return [f"{stem}_{k // 4 + first}{k % 4 + first}" for k in range(numbers.shape[1])], numbers, {}, "", ""
    numbered_place = count(f"{owner}{draw(st.sampled_from(['position', 'pos', 'p']))}", 3)
    if kind == "quaternion":
        order = draw(st.sampled_from(["wxyz", "xyzw"]))
        numbers = np.column_stack([place, turn if order == "wxyz" else turn[:, [1, 2, 3, 0]]])
        stem = draw(st.sampled_from(["orientation", "quat", "rot", "q"]))
        glued = [f"q{k + first}" for k in range(4)] if stem == "q" and not owner else count(f"{owner}{stem}", 4)
        names = count(draw(st.sampled_from([f"{owner}pose", "ee", "tcp"])), 7) if whole else [*numbered_place, *glued]
        return names, numbers, {"quaternion": order}, "--quaternion", ""
    word = {"rpy": "rpy", "rotvec": "rotvec"}.get(kind) or draw(st.sampled_from(WORDS))
    unit = draw(st.sampled_from(["", "rad", "deg"]))
    angles = angles_of(MOTION, word) * (180.0 / np.pi if unit == "deg" else 1.0)
    options = {"angles": unit} if unit else {}
    repeats = word not in ("rotvec", "rpy") and len(set(word)) < 3
    if kind == "three" and (whole or repeats):
        names = count(f"{owner}pose", 6) if whole else [*numbered_place, *count(f"{owner}euler", 3)]
        if word == "rotvec" and not whole:
            names = [*numbered_place, *count(f"{owner}rot", 3)]
        return names, np.column_stack([place, angles]), {**options, "rotation": word}, "--rotation", unit
    by_axis = angles
    if word not in ("rotvec", "rpy"):
        by_axis = angles[:, [word.lower().index(axis) for axis in "xyz"]]
    stems = {"three": "{}r{}", "rpy": "{}{}", "rotvec": "{}rotvec_{}"}[kind]
    axes = ("roll", "pitch", "yaw") if kind == "rpy" else "xyz"
    names = [*numbered_place, *(stems.format(owner, axis) for axis in axes)]
    needed = {**options, "rotation": word} if kind == "three" else options
    return names, np.column_stack([place, by_axis]), needed, "--rotation" if kind == "three" else "", unit


def written(folder, names, numbers):
    file = folder / "poses.csv"
    np.savetxt(file, numbers, delimiter=",", header=",".join(names), comments="", fmt="%.12g")
    return file


@for_all(headers(), max_examples=150)
def test_every_kind_of_orientation_is_read_or_its_flag_is_named(tmp_path_factory, drawn):
    names, numbers, options, flag, unit = drawn
    file = written(tmp_path_factory.mktemp("poses"), names, numbers)
    found = recording_from_table(file, TableRequest(rate=50.0, **options))
    assert_same_pose(found.hand.dqs, MOTION.dqs, 1e-7)
    if not flag and unit != "deg":
        assert_same_pose(recording_from_table(file, TableRequest(rate=50.0)).hand.dqs, MOTION.dqs, 1e-7)
        return
    with pytest.raises(BadDemonstration, match=flag or "in degrees. say --angles deg or rad") as caught:
        recording_from_table(file, TableRequest(rate=50.0))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "header, options, message",
    [
        ("x,y,z,roll,pitch,yaw", {"rotation": "rotvec"}, "is no rotation vector, by its names; --rotation rotvec"),
        ("x,y,z,rotvec_x,rotvec_y,rotvec_z", {"rotation": "rpy"}, "is a rotation vector, by its names; --rotation rpy"),
        ("x,y,z,roll,pitch,yaw", {"rotation": "zyz"}, "are angles about x, y and z; --rotation zyz turns about z"),
        ("x,y,z,roll,pitch,yaw", {"quaternion": "wxyz"}, "--quaternion: is given, and no column is of a quaternion"),
        ("x,y,z,roll,pitch,yaw", {"matrix": "rows"}, "--matrix: is given, and no column is of a matrix"),
        ("x,y,z,roll [deg],pitch [deg],yaw [deg]", {"angles": "rad"}, "angles are in deg there; --angles rad"),
        ("x,y,z,roll [deg],pitch [deg],yaw [rad]", {}, "the angles have the units deg, rad"),
        ("x,y,z,roll [mm],pitch [mm],yaw [mm]", {}, "angles are in 'mm'; allowed: rad, deg"),
        ("x,y,z,roll,pitch,heading", {}, "'heading' says nothing that is known"),
        ("x,y,z,rx,ry,gripper", {}, "the pose lacks rz"),
        ("x,y,z,euler_x,euler_y,euler_z", {}, "are Euler angles: say --rotation"),
        ("x,y,z,rx,ry,rz", {}, "may be a rotation vector .as of UR. or Euler angles: say --rotation rotvec, rpy, or"),
        ("x,y,z,rx,ry,rz", {"rotation": "RPY"}, "unknown rotation 'RPY'; known: rotvec, rpy, or three axes"),
        ("x,y,z,rx,ry,rz", {"matrix": "row"}, "unknown matrix order 'row'; known: rows, columns"),
        ("ee_0,ee_1,ee_2,ee_3,ee_4,gripper", {}, "'ee_0' is one of 5 numbers, which are no pose"),
        ("desired_0,desired_1,a,b,c,d", {}, "'desired_0' is a command, not what was measured; leave"),
        ("tcp_d_0,tcp_d_1,tcp_d_2,tcp_d_3,tcp_d_4,tcp_d_5", {}, "'tcp_d_0' is a command, not what was measured"),
        ("qd_0,qd_1,qd_2,qd_3,qd_4,qd_5", {}, "'qd_0' is neither a position nor a command of the gripper"),
    ],
)  # fmt: skip
def test_contradictions_and_gaps_are_one_line(header, options, message, tmp_path):
    file = written(tmp_path, header.split(","), np.tile([0.4, 0.1, 0.2, 0.1, 0.2, 0.3], (5, 1)))
    with pytest.raises(OneDemoError, match=message) as caught:
        recording_from_table(file, TableRequest(rate=50.0, **options))
    assert "\n" not in str(caught.value)


def test_two_orientations_of_one_pose_are_refused(tmp_path):
    names = ["x", "y", "z", "qw", "qx", "qy", "qz", "roll", "pitch", "yaw"]
    numbers = np.column_stack([MOTION.vectors, angles_of(MOTION, "rpy")])
    with pytest.raises(BadDemonstration, match="orientation is there twice, from 'qw' and 'roll' on; leave one out"):
        recording_from_table(written(tmp_path, names, numbers), TableRequest(rate=50.0))
    found = recording_from_table(
        written(tmp_path, names, numbers), TableRequest(rate=50.0, ignored=("roll", "pitch", "yaw"))
    )
    assert_same_pose(found.hand.dqs, MOTION.dqs, 1e-7)


@pytest.mark.parametrize("width", [6, 12, 16])
def test_without_a_header_matrices_are_read_and_angles_are_asked_about(width, tmp_path):
    file = tmp_path / "poses.txt"
    if width > 6:
        np.savetxt(file, numbered(list(MOTION), width, "columns"))
        options = {}
    else:
        np.savetxt(file, np.column_stack([MOTION.positions, angles_of(MOTION, "ZYX")]))
        with pytest.raises(BadDemonstration, match=r"a position and angles\? say --rotation; or joints"):
            recording_from_table(file, TableRequest(rate=50.0))
        options = {"rotation": "ZYX"}
    assert_same_pose(recording_from_table(file, TableRequest(rate=50.0, **options)).hand.dqs, MOTION.dqs, 1e-7)


def test_q0_to_q3_are_a_quaternion_only_where_a_position_lacks_one(tmp_path):
    turn, joints = ["q0", "q1", "q2", "q3"], np.tile([0.1, 0.2, 0.3, 0.4], (COUNT, 1))
    four = np.column_stack([MOTION.vectors[:, :3], MOTION.vectors[:, 3:]])
    said = TableRequest(rate=50.0, quaternion="wxyz")
    assert_same_pose(
        recording_from_table(written(tmp_path, ["x", "y", "z", *turn], four), said).hand.dqs, MOTION.dqs, 1e-7
    )
    both = written(tmp_path, ["x", "y", "z", "qw", "qx", "qy", "qz", *turn], np.column_stack([four, joints]))
    np.testing.assert_allclose(recording_from_table(both, TableRequest(rate=50.0)).joints, joints)


def test_counted_names_stand_for_many(tmp_path):
    numbers = np.column_stack([np.arange(COUNT) / 50.0, numbered(list(MOTION), 16, "columns")])
    file = tmp_path / "bare.csv"
    np.savetxt(file, numbers, delimiter=",")
    found = recording_from_table(file, TableRequest(columns=("t", "O_T_EE_0..15")))
    assert_same_pose(found.hand.dqs, MOTION.dqs, 1e-7)


@pytest.mark.parametrize("command", ["O_T_EE_d", "desired_pose", "target_tcp_pose", "tcp_cmd_pose"])
def test_a_command_beside_the_measured_pose_is_left_to_the_user(command, tmp_path):
    numbers = numbered(list(MOTION), 16, "columns")
    names = [f"{stem}_{k}" for stem in ("O_T_EE", command) for k in range(16)]
    file = written(tmp_path, names, np.column_stack([numbers, np.roll(numbers, 3, axis=0)]))
    with pytest.raises(BadDemonstration, match=f"'{command}_0' is a command, not what was measured; leave it out with"):
        recording_from_table(file, TableRequest(rate=50.0))
    found = recording_from_table(file, TableRequest(rate=50.0, ignored=(f"{command}_*",)))
    assert_same_pose(found.hand.dqs, MOTION.dqs, 1e-7)


@pytest.mark.parametrize("is_hand_numbered", [True, False])
@pytest.mark.parametrize("flag", ["quaternion", "rotation"])
def test_a_flag_is_for_the_poses_whose_names_say_less(flag, is_hand_numbered, tmp_path):
    """The named pose is in the other convention than the numbered one, which the flag is about."""
    said, named = {"quaternion": ("wxyz", ["qx", "qy", "qz", "qw"]), "rotation": ("rotvec", ["roll", "pitch", "yaw"])}[
        flag
    ]
    if flag == "quaternion":
        turns = [MOTION.vectors[:, 3:], MOTION.vectors[:, [4, 5, 6, 3]]]
    else:
        turns = [angles_of(MOTION, "rotvec"), angles_of(MOTION, "rpy")]
    first, second = ("tcp", "cup") if is_hand_numbered else ("cup", "tcp")
    names = [f"{first}_pose_{k}" for k in range(3 + turns[0].shape[1])]
    names += [f"{second}_{name}" for name in ["x", "y", "z", *named]]
    cup = MOTION.moved(Pose.from_yaw([0.2, 0.1, 0.0], 0.0))
    places = [MOTION.positions, cup.positions] if is_hand_numbered else [cup.positions, MOTION.positions]
    file = written(tmp_path, names, np.column_stack([places[0], turns[0], places[1], turns[1]]))
    found = recording_from_table(file, TableRequest(rate=50.0, **{flag: said}))
    assert_same_pose(found.hand.dqs, MOTION.dqs, 1e-7)
    assert_same_pose(found.objects["cup"].dqs, cup.dqs, 1e-7)


@pytest.mark.parametrize(
    "values, message",
    [
        ((0.1, 2.0, 0.3), "pitch is 2 at index 4, beyond pi/2: in degrees"),
        ((3.0, 1.0, 5.0), "yaw is 5 at index 4, beyond pi: in degrees"),
    ],
)
def test_few_degrees_are_asked_about(values, message, tmp_path):
    turns = np.zeros((len(MOTION), 3))
    turns[4:] = values
    file = written(tmp_path, ["x", "y", "z", "roll", "pitch", "yaw"], np.column_stack([MOTION.positions, turns]))
    with pytest.raises(BadDemonstration, match=f"roll pitch yaw: {message}. say --angles deg or rad"):
        recording_from_table(file, TableRequest(rate=50.0))
    recording_from_table(file, TableRequest(rate=50.0, angles="deg"))
