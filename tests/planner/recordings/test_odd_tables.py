"""Tables as hostile as those that people have: read as they were meant, or refused in one line."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.arms import table_panda
from helpers.strategies import assert_same_pose, for_all, st

from onedemo.planner.errors import BadDemonstration
from onedemo.planner.geometry.pose import PosePath
from onedemo.planner.recordings.column_names import is_hand
from onedemo.planner.recordings.kinematic_check import joints_path
from onedemo.planner.recordings.pose_columns import TableRequest
from onedemo.planner.recordings.pose_table import recording_from_table

ARM, _, HOME = table_panda()
COUNT = 40
TIME = np.arange(COUNT) / 20.0
JOINTS = HOME + np.linspace(0.0, 0.3, COUNT)[:, None] * np.array([1.0, -1.0, 0.5, 1.0, 0.3, -0.4, 0.7])
MOTION = joints_path(ARM, JOINTS)
GRIP = np.where(np.arange(COUNT) > 20, 1.0, -1.0)
POSE = ("x", "y", "z", "qw", "qx", "qy", "qz")


def written(folder, columns: dict[str, np.ndarray], mark: str = ",", second: str = ""):
    rows = [mark.join(str(value) for value in row) for row in zip(*columns.values(), strict=True)]
    (folder / "odd.csv").write_text("\n".join([mark.join(columns), *([second] if second else []), *rows]))
    return folder / "odd.csv"


def pose(owner: str = "", vectors: np.ndarray = MOTION.vectors) -> dict[str, np.ndarray]:
    return {f"{owner}{name}": column for name, column in zip(POSE, vectors.T, strict=True)}


def read(file, **options):
    return recording_from_table(file, TableRequest(**options), ARM)


@pytest.mark.parametrize("mark", [",", ", ", ";", " ; ", "\t", "|", " | ", " ", "   "])
def test_any_usual_separator_separates(mark, tmp_path):
    found = read(written(tmp_path, {"t": TIME, **pose()}, mark))
    assert_same_pose(found.hand.dqs, MOTION.dqs, 1e-9)


@for_all(st.lists(st.sampled_from([-1.0, 1.0]), min_size=COUNT, max_size=COUNT))
def test_signs_of_quaternions_do_not_matter(tmp_path_factory, signs):
    vectors = MOTION.vectors.copy()
    vectors[:, 3:] *= np.array(signs)[:, None]
    found = read(written(tmp_path_factory.mktemp("signs"), {"t": TIME, **pose("", vectors)}))
    assert_same_pose(found.hand.dqs, MOTION.dqs, 1e-9)
    assert (np.sum(found.hand.dqs[1:, :4] * found.hand.dqs[:-1, :4], axis=1) > 0.0).all()


@pytest.mark.parametrize(
    "name, values, meant",
    [
        ("gripper_open", -GRIP, GRIP),
        ("gripper_open", (1.0 - GRIP) / 2.0, GRIP),
        ("gripper_open", (1.0 + GRIP) / 2.0, -GRIP),
        ("gripper_closed", (1.0 + GRIP) / 2.0, GRIP),
        ("gripper_closed", (1.0 - GRIP) / 2.0, -GRIP),
        ("gripper_closed", GRIP > 0.0, GRIP),
        ("gripper_width", 0.04 - 0.02 * GRIP, GRIP),
        ("gripper", GRIP, GRIP),
    ],
)
def test_what_the_name_of_the_gripper_says_decides(name, values, meant, tmp_path):
    file = written(tmp_path, {"t": TIME, **pose(), name: values})
    np.testing.assert_array_equal(read(file).gripper, meant)
    if name in ("gripper_open", "gripper_closed"):
        wrong = np.asarray(values, dtype=float)[meant < 0][0]
        with pytest.raises(BadDemonstration, match=r"by its name; --gripper-closed .* contradicts it"):
            read(file, closed=float(wrong))


@pytest.mark.parametrize(
    "owners, options, chosen",
    [
        (("",), {}, ""),
        (("right_",), {}, "right_"),
        (("cup_",), {}, "cup_"),
        (("cup_", "right_hand_"), {}, "right_hand_"),
        (("left_", "right_"), {"hand": "left"}, "left_"),
        (("left_", "right_"), {}, None),
        (("robot0_", "robot1_"), {}, None),
        (("", "left_hand_"), {}, None),
        (("cup_", "pot_"), {}, None),
        (("tcp_", "tool_holder_"), {}, "tcp_"),
    ],
)
def test_of_several_hands_the_user_says_which(owners, options, chosen, tmp_path):
    moved = {owner: MOTION.vectors + np.eye(7)[0] * 0.1 * k for k, owner in enumerate(owners)}
    columns = {"t": TIME, **{name: value for owner in owners for name, value in pose(owner, moved[owner]).items()}}
    file = written(tmp_path, columns)
    if chosen is None:
        with pytest.raises(
            BadDemonstration, match=r"which pose is the hand's\? say so with --hand, or .* --ignore '\w+_\*'"
        ):
            read(file, **options)
    else:
        found = read(file, **options)
        assert_same_pose(found.hand.dqs, PosePath.from_vectors(moved[chosen]).dqs, 1e-9)
        others = {owner.strip("_") for owner in owners if owner != chosen}
        assert set(found.objects) == {name for name in others if not (options and is_hand(name))}


def test_an_object_beside_joints_is_no_hand(tmp_path):
    cup = MOTION.vectors * [1, 1, 0.5, 1, 1, 1, 1]
    columns = {"t": TIME, **pose("cup_", cup), **{f"q{k}": JOINTS[:, k] for k in range(7)}}
    found = read(written(tmp_path, columns))
    assert_same_pose(found.hand.dqs, MOTION.dqs, 1e-9)
    assert found.is_computed and set(found.objects) == {"cup"}


def spoilt(k: slice, columns, value) -> np.ndarray:
    vectors = MOTION.vectors.copy()
    vectors[k, columns] = value
    return vectors


@pytest.mark.parametrize(
    "vectors, message",
    [
        (
            spoilt(slice(0, 5), slice(0, 7), [0, 0, 0, 1, 0, 0, 0]),
            r"jumps by .* m from sample 4 to 5, in 0.05 s: was it lost",
        ),
        (spoilt(slice(9, 10), slice(3, 7), [1, 0, 0, 0]), "jumps by .* rad from sample 8 to 9"),
        (spoilt(slice(9, 10), 0, MOTION.vectors[9, 0] + 0.5), "jumps by 0.5.* m from sample 8 to 9"),
        (spoilt(slice(9, 12), 1, np.nan), r"column 'y': is not finite at index 9 \(line 11\)"),
        (spoilt(slice(9, 12), slice(3, 7), 0.0), "the quaternion at index 9 has norm 0"),
    ],
)
def test_what_a_tracker_lost_is_refused_at_its_sample(vectors, message, tmp_path):
    with pytest.raises(BadDemonstration, match=message) as caught:
        read(written(tmp_path, {"t": TIME, **pose("", vectors)}))
    assert "\n" not in str(caught.value)


def test_a_rate_that_no_hand_moves_at_is_refused(tmp_path):
    file = written(tmp_path, pose())
    with pytest.raises(BadDemonstration, match=r"travels .* s, which no hand does: .*--rate"):
        read(file, rate=19000.0)
    read(file, rate=20.0)


@pytest.mark.parametrize("units", [";[mm];[mm];[mm];;;;", "s;mm;mm;mm;-;-;-;-", "[s];(mm);(mm);(mm);[-];[-];[-];[-]"])
def test_units_below_the_header_count(units, tmp_path):
    vectors = MOTION.vectors * [1000, 1000, 1000, 1, 1, 1, 1]
    found = read(written(tmp_path, {"t": TIME, **pose("", vectors)}, ";", units))
    assert_same_pose(found.hand.dqs, MOTION.dqs, 1e-9)


@pytest.mark.parametrize("sign", ["°", "deg", "degrees", "DEG"])
def test_signs_of_units_count(sign, tmp_path):
    columns = {"t": TIME, **{f"q{k + 1} [{sign}]": np.degrees(JOINTS[:, k]) for k in range(7)}}
    np.testing.assert_allclose(read(written(tmp_path, columns)).joints, JOINTS, atol=1e-12)
    with pytest.raises(BadDemonstration, match="says nothing that is known"):
        read(written(tmp_path, {"t": TIME, **{f"q{k + 1} [%]": JOINTS[:, k] for k in range(7)}}))


def test_joints_in_the_names_of_universal_robots_are_in_their_order(tmp_path):
    names = ["elbow", "shoulder_lift", "shoulder_pan", "wrist_1", "wrist_2", "wrist_3"]
    columns = {"t": TIME, **{f"{name}_joint": JOINTS[:, k] for k, name in enumerate(names)}, **pose()}
    np.testing.assert_allclose(read(written(tmp_path, columns)).joints, JOINTS[:, [2, 1, 0, 3, 4, 5]])
