"""Tables of poses: one motion, written in every dialect, is read as one motion, or refused in one line."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.strategies import assert_same_pose, for_all, st

from onedemo.planner.errors import BadDemonstration, OneDemoError
from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.imitation.tsia import screw_path
from onedemo.planner.recordings.pose_columns import TableRequest
from onedemo.planner.recordings.pose_table import recording_from_table
from onedemo.planner.recordings.text_table import read_table

MOTION = screw_path(
    Pose.from_position_quaternion([0.4, -0.1, 0.5], [0.0, 1.0, 0.0, 0.0]),
    Pose.from_position_quaternion([0.1, 0.3, 0.2], [0.2, 0.8, 0.4, 0.4]),
    0.02,
)
GRIP = np.where(np.arange(len(MOTION)) > 9, 1.0, -1.0)
HELD = MOTION.with_tool(Pose.from_yaw([0.0, 0.02, 0.1], 0.3))
CUP = PosePath(np.array([HELD.dqs[max(k, 10)] for k in range(len(MOTION))]))
EPOCH = 1_403_638_522
STYLES = {
    "plain": ("{o}x {o}y {o}z", "{o}qw {o}qx {o}qy {o}qz"),
    "ros": (
        "{o}pose.position.x {o}pose.position.y {o}pose.position.z",
        "{o}orientation.w {o}orientation.x {o}orientation.y {o}orientation.z",
    ),
    "short": ("{o}px {o}py {o}pz", "{o}quat_w {o}quat_x {o}quat_y {o}quat_z"),
    "long": (
        "{o}position/x {o}position/y {o}position/z",
        "{o}rotation/w {o}rotation/x {o}rotation/y {o}rotation/z",
    ),
    "behind": ("{o}x_pos {o}y_pos {o}z_pos", "{o}q_w {o}q_x {o}q_y {o}q_z"),
    "humps": ("{o}posX {o}posY {o}posZ", "{o}quatW {o}quatX {o}quatY {o}quatZ"),
}
LENGTHS = {"m": 1.0, "cm": 100.0, "mm": 1000.0}
TIMES = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
GRIPPERS = {
    "gripper": (-1.0, 1.0),
    "gripper_width": (0.08, 0.03),
    "gripper_command": (0.0, 1.0),
    "finger_position": (0.0, 255.0),
}


def pose_names(style: str, owner: str, unit: str) -> tuple[list[str], list[str]]:
    place, turn = (text.format(o=owner).split() for text in STYLES[style])
    return ([f"{name} [{unit}]" for name in place] if unit else place), turn


@st.composite
def dialects(draw):
    """A text, the request that belongs to it, and what it must give: an object or none, a gripper or none."""
    unit, order, style = (
        draw(st.sampled_from(sorted(LENGTHS))),
        draw(st.sampled_from(["wxyz", "xyzw"])),
        draw(st.sampled_from(sorted(STYLES))),
    )
    in_header = draw(st.booleans())
    columns: dict[str, np.ndarray] = {}
    with_cup, grip = draw(st.booleans()), draw(st.sampled_from(["", *GRIPPERS]))
    for owner, path in (("", MOTION), ("cup_", CUP)):
        if owner and not with_cup:
            continue
        place, turn = pose_names(style, owner, unit if in_header else "")
        columns |= dict(zip(place, (path.vectors[:, :3] * LENGTHS[unit]).T, strict=True))
        turns = dict(zip(turn, path.vectors[:, 3:].T, strict=True))
        columns |= turns if order == "wxyz" else {name: turns[name] for name in [*turn[1:], turn[0]]}
    clock, stamped = draw(st.sampled_from(sorted(TIMES))), draw(st.booleans())
    seconds = np.arange(len(MOTION)) / 50.0
    if stamped:
        since = EPOCH if draw(st.booleans()) else 0
        stamps = np.array([round((since + second) * 1e9) for second in seconds]) / (1e9 / TIMES[clock])
        columns = {draw(st.sampled_from([f"time_{clock}", f"timestamp ({clock})", f"t [{clock}]"])): stamps} | columns
    if grip:
        columns[grip] = np.where(GRIP > 0.0, *GRIPPERS[grip][::-1])
    if draw(st.booleans()):
        columns = {draw(st.sampled_from(["", "index", "seq"])): np.arange(len(MOTION)) + 3.0} | columns
    mark, comma = draw(st.sampled_from([(",", False), (";", False), (";", True), ("\t", True), ("\t", False)]))
    rows = [[repr(float(value)) for value in row] for row in np.column_stack(list(columns.values()))]
    if comma:
        rows = [[word.replace(".", ",") for word in row] for row in rows]
    end = draw(st.sampled_from(["\n", "\r\n"]))
    remark = draw(st.sampled_from(["", "# recorded by hand\n"]))
    text = remark + end.join([mark.join(columns), *(mark.join(row) for row in rows)]) + end
    request = TableRequest(units="" if in_header else unit, rate=None if stamped else 50.0)
    return text, request, with_cup, grip


@for_all(dialects(), max_examples=60)
def test_one_motion_in_every_dialect_is_read_as_one_motion(tmp_path_factory, dialect):
    text, request, with_cup, grip = dialect
    file = tmp_path_factory.mktemp("dialect") / "motion.csv"
    file.write_bytes(text.encode())
    found = recording_from_table(file, request)
    assert_same_pose(found.hand.dqs, MOTION.dqs, 1e-9)
    np.testing.assert_allclose(found.time, np.arange(len(MOTION)) / 50.0, atol=2e-6)
    assert set(found.objects) == ({"cup"} if with_cup else set())
    if with_cup:
        assert_same_pose(found.objects["cup"].dqs, CUP.dqs, 1e-9)
    if grip:
        np.testing.assert_array_equal(found.gripper, GRIP)
    else:
        assert found.gripper is None


def written(tmp_path, text: str, name: str = "poses.csv"):
    file = tmp_path / name
    file.write_text(text)
    return file


def rows(header: str = "", mark: str = ",", order: tuple[int, ...] = (0, 1, 2, 3, 4, 5, 6), count: int = 8) -> str:
    lines = [mark.join(f"{value:.9f}" for value in MOTION.vectors[k][list(order)]) for k in range(count)]
    return "\n".join([*([header] if header else []), *lines]) + "\n"


HEADER = "x,y,z,qw,qx,qy,qz"
XYZW = (0, 1, 2, 4, 5, 6, 3)


@pytest.mark.parametrize(
    "text, request_, message",
    [
        (rows("x,y,z,qx,qy,qz,qw", order=XYZW), {"quaternion": "wxyz"}, "order xyzw; --quaternion wxyz contradicts it"),
        (rows("x [mm],y [mm],z [mm],qw,qx,qy,qz"), {"units": "cm"}, "in mm there; --units cm contradicts it"),
        (rows("x [mm],y [cm],z [mm],qw,qx,qy,qz"), {}, "x, y and z have the units cm, mm"),
        (rows("x,y,z,qw,qx,qy"), {}, "line 2: has 7 fields; the header has 6"),
        (rows("x,y,z,a,b,c,d"), {}, "'a' says nothing that is known; leave it out with --ignore 'a'"),
        (rows("x,y,z,qw,qx,qy,qy"), {}, "header: names 'qy' twice"),
        (rows("x,y,z,quat_0,quat_1,quat_2,quat_3"), {}, "numbers the quaternion's components: say --quaternion"),
        ("nan" + rows()[11:], {"quaternion": "wxyz"}, r"column 'x': is not finite at index 0 \(line 1\)"),
        ("n/a" + rows()[11:], {}, "line 1: column 1: 'n/a' is not a number"),
        (rows("x,y,z,qw,qx,qy,qz") + "1,2,oops,1,0,0,0\n", {}, "line 10: column 'z': 'oops' is not a number"),
        (rows("x,y,z,qw,qx,qy,qz") + "1,,3,1,0,0,0\n", {}, "line 10: column 'y': is empty"),
        (rows("x,y,z,qw,qx,qy,qz") + "1,2,3,1,0,0\n", {}, "line 10: has 6 fields; the header has 7"),
        (rows(HEADER) + "0,0,0,2,0,0,0\n", {}, "the quaternion at index 8 has norm 2"),
        (rows(HEADER), {"rate": None}, "rate: is needed, since no column holds time stamps"),
        (rows(HEADER), {"rate": 0.0}, "rate: 0.0 is not a positive number"),
        (rows(HEADER), {"rate": float("nan")}, "rate: nan is not a positive number"),
        (rows(HEADER), {"units": "inch"}, "unknown unit 'inch'; known: m, cm, mm"),
        (rows(HEADER), {"quaternion": "zyxw"}, "unknown quaternion order 'zyxw'; known: wxyz, xyzw"),
        (rows(HEADER), {"ignored": ("vel*",)}, r"unknown column to ignore 'vel\*'; known: x, y"),
        (rows(HEADER), {"columns": ("x", "y")}, "--columns: names 2; the file has 7 columns"),
        (rows(HEADER), {"time_unit": "ms"}, "--time-unit: is given, and no column is of a time stamp"),
        (rows(HEADER), {"closed": 1.0}, "--gripper-closed: is given, and no column is of a gripper"),
        (rows(count=1), {"quaternion": "wxyz"}, r"has 1 sample\(s\)"),
        (rows(), {}, "has 7 columns and no header: a position and a quaternion. say --quaternion wxyz or xyzw"),
        (rows("x [inch],y [inch],z [inch],qw,qx,qy,qz"), {}, "'x .inch.' is in inch; known units: m, cm, mm"),
        (rows("x_µm,y_µm,z_µm,qw,qx,qy,qz"), {}, "'x_µm' is in µm; known units"),
        (rows("x,y,z_mm,qw,qx,qy,qz"), {}, "x, y and z have the units none, mm"),
        (rows(HEADER), {"columns": ("x", "y", "z", "qx", "qy", "qz", "qw")}, "calls 'qx' what the header calls 'qw'"),
        ("", {}, "table: has no rows"),
        ("x,y,z,qw,qx,qy,qz\n", {}, "has a header, and no rows"),
        ("1,2,3\n1,2,3\n", {}, "has 3 columns and no header: name them"),
        ("0,4;0.1\n0,5;0.2\n", {}, "line 1: writes 0,4, line 1 0.1: what is the decimal mark"),
        (rows("cup_x,cup_y,cup_z,cup_qw,cup_qx,cup_qy,cup_qz,can_x", mark=","), {}, "line 2: has 7 fields"),
    ],
)  # fmt: skip
def test_what_cannot_be_understood_is_refused_in_one_line_that_names_file_and_place(text, request_, message, tmp_path):
    file = written(tmp_path, text)
    with pytest.raises(OneDemoError, match=message) as caught:
        recording_from_table(file, TableRequest(**{"rate": 50.0, **request_}))
    assert "\n" not in str(caught.value)


def test_eight_columns_are_those_of_tum_only_if_spaces_separate_them(tmp_path):
    stamped = np.column_stack([EPOCH + np.arange(8) / 50.0, MOTION.vectors[:8][:, XYZW]])
    lines = [[f"{value:.6f}" for value in row] for row in stamped]
    found = recording_from_table(written(tmp_path, "\n".join(map(" ".join, lines)), "tum.txt"), TableRequest())
    assert_same_pose(found.hand.dqs, MOTION.dqs[:8], 1e-5)
    assert any("as in files of TUM" in note for note in found.notes)
    named = "# timestamp tx ty tz qx qy qz qw\n" + "\n".join(map(" ".join, lines))
    assert_same_pose(recording_from_table(written(tmp_path, named), TableRequest()).hand.dqs, MOTION.dqs[:8], 1e-5)
    file = written(tmp_path, "\n".join(map(",".join, lines)))
    with pytest.raises(BadDemonstration, match="say --quaternion wxyz or xyzw"):
        recording_from_table(file, TableRequest())
    said = recording_from_table(file, TableRequest(quaternion="xyzw"))
    assert_same_pose(said.hand.dqs, MOTION.dqs[:8], 1e-5)


def stamped(stamps: np.ndarray) -> str:
    table = np.column_stack([stamps, MOTION.vectors[: len(stamps)]])
    return "\n".join(["stamp,x,y,z,qw,qx,qy,qz", *(csv(row) for row in table)])


def csv(row: np.ndarray) -> str:
    return ",".join(map(repr, row.tolist()))


@pytest.mark.parametrize("unit, step", [("ms", 20.0), ("us", 2e4), ("ns", 2e7)])
def test_stamps_in_an_unknown_unit_are_asked_about(unit, step, tmp_path):
    file = written(tmp_path, stamped(step * np.arange(8)))
    with pytest.raises(BadDemonstration, match=rf"no seconds: .*{unit} \(50 Hz\).*say so with --time-unit"):
        recording_from_table(file, TableRequest())
    np.testing.assert_allclose(recording_from_table(file, TableRequest(time_unit=unit)).time, np.arange(8) / 50.0)


@pytest.mark.parametrize("order, index", [([0, 1, 1, 2, 3], 2), ([0, 1, 2, 1, 3], 3)])
def test_stamps_that_stand_or_go_back_are_refused(order, index, tmp_path):
    file = written(tmp_path, stamped(np.array(order) / 50.0))
    with pytest.raises(BadDemonstration, match=f"column 'stamp': does not increase at index {index}"):
        recording_from_table(file, TableRequest())


def test_two_parts_of_a_stamp_are_one_time_and_the_message_s_own_stamp_wins(tmp_path):
    header = "secs,nsecs,frame_id,x,y,z,qw,qx,qy,qz"
    lines = [f"{EPOCH + k // 2},{(k % 2) * 500_000_000},world,{csv(MOTION.vectors[k])}" for k in range(8)]
    found = recording_from_table(written(tmp_path, "\n".join([header, *lines])), TableRequest())
    np.testing.assert_allclose(found.time, 0.5 * np.arange(8))
    assert "column 'frame_id' says 'world' in each row and is left out" in found.notes
    names = ["position.x", "position.y", "position.z", *(f"orientation.{axis}" for axis in "xyzw")]
    header = ",".join(["%time,field.header.seq,field.header.stamp", *(f"field.pose.{name}" for name in names)])
    stamps = [10**18 + k * 10**8 for k in range(8)]
    lines = [f"{t + 7 * 10**6},{k},{t},{csv(MOTION.vectors[k][list(XYZW)])}" for k, t in enumerate(stamps)]
    found = recording_from_table(written(tmp_path, "\n".join([header, *lines])), TableRequest())
    np.testing.assert_allclose(found.time, 0.1 * np.arange(8), atol=1e-6)
    assert_same_pose(found.hand.dqs, MOTION.dqs[:8], 1e-9)
    assert any("'field.header.seq' counts the rows" in note for note in found.notes)


def test_words_that_change_are_left_out_only_if_the_user_says_so(tmp_path):
    lines = [f"{'ab'[k % 2]},{csv(MOTION.vectors[k])}" for k in range(8)]
    file = written(tmp_path, "\n".join(["state,x,y,z,qw,qx,qy,qz", *lines]))
    with pytest.raises(BadDemonstration, match="column 'state' holds words, 'a' and 'b'; leave it out with --ignore"):
        recording_from_table(file, TableRequest(rate=50.0))
    found = recording_from_table(file, TableRequest(rate=50.0, ignored=("st*",)))
    assert "column 'state' is left out, as said" in found.notes


@pytest.mark.parametrize("name, words", [("time", "seconds, or other"), ("gripper", "numbers, like 0 open and 1")])
def test_words_in_the_place_of_numbers_are_not_to_be_thrown_away(name, words, tmp_path):
    text = "\n".join([f"{name},{HEADER}", *(f"{'ab'[k % 2]},{csv(MOTION.vectors[k])}" for k in range(8))])
    with pytest.raises(BadDemonstration, match=f"column '{name}' holds words like 'a'; {words}.* are read: convert it"):
        recording_from_table(written(tmp_path, text), TableRequest(rate=50.0))


def test_rows_of_several_frames_are_those_of_the_frame_that_the_user_names(tmp_path):
    lines = [f"{csv(MOTION.vectors[k // 2])},{('tool0', 'flange')[k % 2]}" for k in range(16)]
    file = written(tmp_path, "\n".join([f"{HEADER},child_frame_id", *lines]))
    for ignored in ((), ("child_frame_id",)):
        with pytest.raises(
            BadDemonstration, match="'child_frame_id' names several frames, flange, tool0: say by --hand"
        ):
            recording_from_table(file, TableRequest(rate=50.0, ignored=ignored))
    found = recording_from_table(file, TableRequest(rate=50.0, hand="tool0"))
    assert_same_pose(found.hand.dqs, MOTION.dqs[:8], 1e-9)
    assert "of 16 rows, the 8 are read in which 'child_frame_id' is 'tool0'" in found.notes


def test_an_array_of_matrices_is_a_table(tmp_path):
    matrices = np.array([pose.matrix for pose in MOTION])
    for name, array in (("rows", matrices), ("columns", matrices.transpose(0, 2, 1)), ("upper", matrices[:, :3])):
        np.save(tmp_path / f"{name}.npy", array)
        found = recording_from_table(tmp_path / f"{name}.npy", TableRequest(rate=50.0))
        assert_same_pose(found.hand.dqs, MOTION.dqs, 1e-9)


def test_arrays_of_numpy_are_tables_too(tmp_path):
    np.save(tmp_path / "plain.npy", MOTION.vectors)
    plain = recording_from_table(tmp_path / "plain.npy", TableRequest(rate=50.0, quaternion="wxyz"))
    assert_same_pose(plain.hand.dqs, MOTION.dqs, 1e-12)
    named = np.zeros(len(MOTION), dtype=[(name, "f8") for name in ("z", "y", "x", "qx", "qy", "qz", "qw")])
    for name, column in zip(("x", "y", "z", "qw", "qx", "qy", "qz"), MOTION.vectors.T, strict=True):
        named[name] = column
    np.save(tmp_path / "named.npy", named)
    assert_same_pose(recording_from_table(tmp_path / "named.npy", TableRequest(rate=50.0)).hand.dqs, MOTION.dqs, 1e-12)
    np.save(tmp_path / "cube.npy", np.zeros((2, 3, 7)))
    with pytest.raises(BadDemonstration, match="is float64 of shape"):
        recording_from_table(tmp_path / "cube.npy", TableRequest(rate=50.0))
    with pytest.raises(BadDemonstration, match="is a folder"):
        recording_from_table(tmp_path, TableRequest(rate=50.0))


def test_a_second_line_of_units_belongs_to_the_header(tmp_path):
    table = MOTION.vectors[:8] * [100.0, 100.0, 100.0, 1, 1, 1, 1]
    header = ["x;y;z;qw;qx;qy;qz", "[cm];[cm];[cm];-;-;-;-"]
    text = "\n".join([*header, *(csv(row).replace(",", ";") for row in table)])
    found = recording_from_table(written(tmp_path, text), TableRequest(rate=50.0))
    assert_same_pose(found.hand.dqs, MOTION.dqs[:8], 1e-9)


@for_all(st.binary(max_size=300), max_examples=150)
def test_any_bytes_are_a_table_or_one_line(tmp_path_factory, data):
    file = tmp_path_factory.mktemp("bytes") / "any.csv"
    file.write_bytes(data)
    try:
        assert len(read_table(file).columns) >= 1
    except BadDemonstration as error:
        assert "\n" not in str(error)


def test_the_tool_is_where_the_user_says(tmp_path):
    np.save(tmp_path / "flange.npy", MOTION.vectors)
    tool = Pose.from_position_quaternion([0.0, 0.0, 0.1034], [0.9238795325112867, 0.0, 0.0, -0.3826834323650898])
    found = recording_from_table(tmp_path / "flange.npy", TableRequest(rate=50.0, quaternion="wxyz", tool=tool))
    assert_same_pose(found.hand.dqs, PosePath(MOTION.dqs).with_tool(tool).dqs, 1e-9)
