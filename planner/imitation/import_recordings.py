"""Import of raw recordings of human-guided robots as demonstrations."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import BadDemonstration, UnknownName
from ..geometry.pose import Pose, PosePath
from ..robot.arm import Arm
from .demonstration import Demonstration, Segment
from .demonstration_files import numbers, read_arrays, unit_poses
from .segmentation import dwells, gripper_events

METERS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
QUATERNIONS = {"wxyz": (0, 1, 2, 3), "xyzw": (3, 0, 1, 2)}
CUBES = {"cubeA": (0.04, 0.04, 0.04), "cubeB": (0.05, 0.05, 0.05)}
"""Full extents [m] of the cubes of robosuite 1.0's Stack task."""
TELEOPERATION_KEYS = ("t", "q", "actions", "obj_cubeA_jnt0", "obj_cubeB_jnt0")
REST = 0.005
"""Path length [m] below which a piece of a recording counts as standing still."""


def stack_from_teleoperation(path: str | Path, arm: Arm, *, name: str, licence: str) -> Demonstration:
    """Import the stacking of one cube on another from a teleoperation of robosuite 1.0's Stack task.

    The hand's path comes from the joint encoders by forward kinematics, the gripper from the recorded command; the
    object frames are those recorded: matching them to other objects is the task of a policy.

    Args:
        path: .npz with `t` (n,) [s], `q` (n, >= dof) [rad], `actions` (n, k) with the gripper last, `obj_*` (n, 7).
        arm: the recorded robot, with its recorded base pose.
        name: name of the demonstration.
        licence: of the data.

    Raises:
        BadDemonstration: the file or one of its entries is invalid.
    """
    path = Path(path)
    arrays = read_arrays(path)
    for key in TELEOPERATION_KEYS:
        if key not in arrays:
            raise BadDemonstration(path, key, f"is missing; a recording holds: {', '.join(TELEOPERATION_KEYS)}")
    time, q, actions = (numbers(path, key, arrays[key], width) for key, width in (("t", 1), ("q", 2), ("actions", 2)))
    cubes = {key: unit_poses(path, f"obj_{key}_jnt0", arrays[f"obj_{key}_jnt0"]) for key in CUBES}
    for key in TELEOPERATION_KEYS:
        if len(arrays[key]) != len(time):
            raise BadDemonstration(path, key, f"has {len(arrays[key])} samples; t has {len(time)}")
    if q.shape[1] < arm.dof:
        raise BadDemonstration(path, "q", f"has {q.shape[1]} columns; the {arm.name} has {arm.dof} joints")
    if len(time) < 2 or actions.shape[1] < 1:
        raise BadDemonstration(path, "actions", f"has shape {actions.shape}; expected 2 samples or more, gripper last")
    q, gripper = q[:, : arm.dof], np.sign(actions[:, -1])
    hand = PosePath(np.array([arm.fk(row).dq for row in q]))
    events = gripper_events(gripper)
    if len(events) != 2 or gripper[0] > 0:
        reason = f"the gripper changes {len(events)} times; expected one closing and one opening"
        raise BadDemonstration(path, "actions", reason)
    closing, opening = (int(event) for event in events)
    segments = (
        Segment("approach", 0, closing, "cubeA", Pose.from_vector(cubes["cubeA"][closing]), "", "close"),
        Segment("transfer", closing + 1, opening, "cubeB", Pose.from_vector(cubes["cubeB"][opening]), "cubeA", "open"),
    )
    try:
        return Demonstration(
            name=name,
            task="stack",
            robot=arm.name,
            tcp_frame="grip_site",
            source="teleoperated",
            licence=licence,
            time=time,
            path=hand,
            joint_positions=q,
            gripper=gripper,
            segments=segments,
            object_sizes={key: np.array(size) for key, size in CUBES.items()},
        )
    except BadDemonstration as error:
        raise BadDemonstration(path, error.key, error.reason) from None


def from_pose_table(
    path: str | Path,
    *,
    name: str,
    robot: str,
    rate: float,
    units: str = "m",
    quaternion: str = "wxyz",
    source: str = "kinesthetic",
    licence: str = "unknown",
) -> Demonstration:
    """Import rows of `x y z` and a quaternion at equal time steps; segments are cut where the hand rests.

    Args:
        path: .npy array (n, 7) or .csv with 7 columns, with or without a header line.
        name: name of the demonstration.
        robot: the robot that was recorded.
        rate: samples per second.
        units: of the positions: "m", "cm" or "mm".
        quaternion: order of the quaternion's columns: "wxyz" or "xyzw".
        source: "teleoperated", "kinesthetic" or "scripted".
        licence: of the data.

    Raises:
        UnknownName: another unit or quaternion order.
        BadDemonstration: the file or one of its entries is invalid.
    """
    path = Path(path)
    if units not in METERS:
        raise UnknownName("unit", units, METERS)
    if quaternion not in QUATERNIONS:
        raise UnknownName("quaternion order", quaternion, QUATERNIONS)
    if not 0 < rate < np.inf:
        raise BadDemonstration(path, "rate", f"{rate} is not a positive number of samples per second")
    table = _table(path)
    if table.ndim != 2 or table.shape[1] != 7:
        raise BadDemonstration(path, "table", f"has shape {table.shape}; expected (n, 7)")
    position, wxyz = table[:, :3] * METERS[units], table[:, 3:][:, QUATERNIONS[quaternion]]
    poses = unit_poses(path, "table", np.concatenate([position, wxyz], axis=1))
    if len(poses) < 2:
        raise BadDemonstration(path, "table", f"has {len(poses)} sample(s); at least 2 are needed")
    time, hand = np.arange(len(poses)) / rate, PosePath.from_vectors(poses)
    pieces = _moving_pieces(hand, dwells(time, hand))
    segments = tuple(Segment(f"motion{k + 1}", a, b) for k, (a, b) in enumerate(pieces))
    try:
        return Demonstration(name, "", robot, "tool", source, licence, time, hand, segments=segments)
    except BadDemonstration as error:
        raise BadDemonstration(path, error.key, error.reason) from None


def _table(path: Path) -> np.ndarray:
    if not path.is_file():
        raise BadDemonstration(path, "file", "does not exist")
    try:
        if path.suffix == ".npy":
            return numbers(path, "table", np.load(path, allow_pickle=False), 2)
        first = path.read_text(encoding="utf-8").split("\n", 1)[0]
        header = int(any(letter.isalpha() and letter not in "eE" for letter in first))
        return np.loadtxt(path, delimiter=",", skiprows=header, ndmin=2)
    except BadDemonstration:
        raise
    except (ValueError, EOFError, OSError, UnicodeDecodeError) as error:
        raise BadDemonstration(path, "table", f"cannot be read: {str(error).splitlines()[0]}") from None


def _moving_pieces(hand: PosePath, rests: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return the sample ranges between rests, without those that stand still."""
    edges = [0, *(edge for rest in rests for edge in rest), len(hand) - 1]
    lengths = hand.lengths()
    pairs = zip(edges[::2], edges[1::2], strict=True)
    return [(a, b) for a, b in pairs if b > a and lengths[b] - lengths[a] > REST]
