"""Teleoperations of simulators as .npz arrays: joints, objects, fixtures and what was commanded.

`t` (n,) [s]; `q` (n, m) with `joint_names`, the arm's first; `obj_NAME` and `ee_NAME` (n, 7) and `fix_NAME` (7,) world
poses x y z [m], wxyz; `actions` (n, k) with the gripper's command last, above 0 to close.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np

from ..errors import BadDemonstration, UnknownName
from ..geometry.pose import Pose, PosePath
from ..imitation.npz_arrays import numbers, read_arrays, texts, unit_poses
from ..robot.arm import Arm
from .column_names import GRIPPER, UR_JOINTS
from .gripper_signal import gripper_command
from .kinematic_check import base_in, checked_against_joints, joints_path
from .recording import Recording, blame_of
from .time_stamps import seconds_of

REQUIRED = ("t", "q", "actions")
PREFIXES = ("obj_", "ee_", "fix_")
KEYS = f"{', '.join(REQUIRED)}, joint_names, obj_NAME, fix_NAME, ee_NAME"
STEP, TURN = 0.05, 0.5
"""Motion [m] and rotation [rad] of an action 1 of robosuite's OSC_POSE, added to the tcp's pose then, in world axes."""
MAKES = {
    "panda": "Panda", "franka": "Panda", "fr3": "Panda", "iiwa": "IIWA", "lbr": "IIWA", "kuka": "IIWA",
    "sawyer": "Sawyer", "jaco": "Jaco", "ur5e": "UR5e", "kinova3": "Kinova3", "gen3": "Kinova3", "xarm7": "XArm7",
}  # fmt: skip
"""Words of joints' names that say whose joints they are: the robot's name."""
OSC_POSE = 7
"""Numbers of an action of OSC_POSE, with the gripper's."""


def recording_from_teleoperation(
    path: str | Path, arm: Arm, *, tcp_frame: str = "grip_site", ignored: Sequence[str] = (), time_unit: str = ""
) -> Recording:
    """Read a teleoperation. The hand's path is that of the joints, by forward kinematics, from where the base stood.

    Args:
        path: .npz file, see this module.
        arm: the recorded robot, with its recorded base pose.
        tcp_frame: name of the arm's tcp.
        ignored: patterns of keys to leave out.
        time_unit: of the stamps: "s", "ms", "us" or "ns"; "": what the numbers say.

    Raises:
        BadDemonstration: the file or one of its entries is invalid, or the joints contradict the recorded poses.
        UnknownName: a pattern that no key matches.
    """
    path = Path(path)
    arrays, notes = _left(path, read_arrays(path), ignored)
    _check_keys(path, arrays)
    time, q, actions = (numbers(path, key, arrays[key], width) for key, width in (("t", 1), ("q", 2), ("actions", 2)))
    _check_counts(path, arrays, len(time))
    time, about_time = seconds_of(time, time_unit, blame_of(path, "t"))
    joints, others, about_order = _joints(path, arrays, q, arm)
    hand = joints_path(arm, joints)
    gripper, about_gripper = gripper_command(actions[:, -1], None, blame_of(path, "actions"))
    objects = {_name(key): _poses(path, key, arrays[key]) for key in arrays if key.startswith("obj_")}
    fixtures = {_name(key): _poses(path, key, arrays[key][None])[0] for key in arrays if key.startswith("fix_")}
    for key in arrays:
        if key.startswith("ee_"):
            notes.append(f"{key} {checked_against_joints(path, key, _poses(path, key, arrays[key]), hand)}")
    hand, about_base = _in_world(path, arrays, hand)
    is_osc = actions.shape[1] == OSC_POSE
    known = "actions are read as robosuite's OSC_POSE: the commanded path is kept"
    notes.append(
        known if is_osc else f"of the {actions.shape[1]} numbers of an action only the last is read, the gripper's"
    )
    return Recording(
        file=path,
        time=time,
        hand=hand,
        tcp_frame=tcp_frame,
        joints=joints,
        other_joints=others,
        gripper=gripper,
        objects=objects,
        fixtures=fixtures,
        commanded=commanded_path(hand, actions[:, :6]) if is_osc else None,
        is_computed=True,
        notes=tuple(note for note in (about_time, about_gripper, about_order, *notes, about_base) if note),
    )


def _in_world(path: Path, arrays: dict[str, np.ndarray], hand: PosePath) -> tuple[PosePath, str]:
    """Return the hand's path in the world of the recorded poses, and a note if the base stands elsewhere in it."""
    key = next((key for key in arrays if key.startswith("ee_")), "")
    if not key:
        return hand, ""
    base = base_in(_poses(path, key, arrays[key]), hand)
    moved = 1e3 * base.position
    if not moved.any():
        return hand, ""
    by = f"({', '.join(f'{each:.0f}' for each in moved)}) mm"
    return hand.moved(
        base
    ), f"the robot's base stood {by} from its usual place, by {key}: the hand's path is moved there"


def _left(path: Path, arrays: dict[str, np.ndarray], ignored: Sequence[str]) -> tuple[dict[str, np.ndarray], list[str]]:
    """Return the arrays that the user does not leave out, and a note about each other one."""
    notes = []
    for pattern in ignored:
        out = [key for key in arrays if fnmatchcase(key, pattern)]
        if not out:
            raise UnknownName("key to ignore", pattern, arrays)
        notes += [f"{key} is left out, as said" for key in out]
        arrays = {key: value for key, value in arrays.items() if key not in out}
    return arrays, notes


def _check_keys(path: Path, arrays: dict[str, np.ndarray]) -> None:
    for key in REQUIRED:
        if key not in arrays:
            raise BadDemonstration(path, key, f"is missing; a recording holds: {KEYS}")
    for key in arrays:
        if key not in (*REQUIRED, "joint_names") and not key.startswith(PREFIXES):
            reason = f"is unknown; a recording holds: {KEYS}; leave it out with --ignore {key}"
            raise BadDemonstration(path, key, reason)


def _check_counts(path: Path, arrays: dict[str, np.ndarray], count: int) -> None:
    for key, value in arrays.items():
        if key != "joint_names" and not key.startswith("fix_") and len(value) != count:
            raise BadDemonstration(path, key, f"has {len(value)} samples; t has {count}")
    actions = arrays["actions"]
    if count < 2 or actions.shape[1] < 1:
        raise BadDemonstration(path, "actions", f"has shape {actions.shape}; expected 2 samples or more, gripper last")


def commanded_path(hand: PosePath, actions: np.ndarray, step: float = STEP, turn: float = TURN) -> PosePath:
    """Return the poses (n) that actions (n, 6) of robosuite's OSC_POSE sent the tcp to.

    Args:
        hand: n poses of the tcp when they were given.
        actions: motions, then rotation vectors, in world axes; entries are clipped to plus and minus 1.
        step: motion [m] of an entry 1.
        turn: rotation [rad] of an entry 1.
    """
    poses = []
    for pose, row in zip(hand, np.clip(actions, -1.0, 1.0), strict=True):
        turned = Pose.from_position_quaternion([0, 0, 0], _quaternion(turn * row[3:])) @ pose
        poses.append(Pose.from_position_quaternion(pose.position + step * row[:3], turned.quaternion).dq)
    return PosePath(np.array(poses))


def _quaternion(vector: np.ndarray) -> np.ndarray:
    """Return the quaternion wxyz of a rotation vector (3,) [rad]."""
    angle = float(np.linalg.norm(vector))
    axis = vector / angle if angle > 0.0 else np.zeros(3)
    return np.array([np.cos(0.5 * angle), *(np.sin(0.5 * angle) * axis)])


def _name(key: str) -> str:
    """Return the name of an object, without the prefix of its key and robosuite's suffix of its joint."""
    return re.sub(r"_j(oi)?nt\d*$", "", key.split("_", 1)[1])


def _poses(path: Path, key: str, value: np.ndarray) -> PosePath:
    return PosePath.from_vectors(unit_poses(path, key, value))


def _joints(
    path: Path, arrays: dict[str, np.ndarray], q: np.ndarray, arm: Arm
) -> tuple[np.ndarray, dict[str, np.ndarray], str]:
    """Return the joints (n, dof) of the arm, (n,) of each other joint by its name, and a note if they were sorted."""
    if q.shape[1] < arm.dof:
        raise BadDemonstration(path, "q", f"has {q.shape[1]} columns; the {arm.name} has {arm.dof} joints")
    names = [f"joint{k + 1}" for k in range(q.shape[1])]
    if "joint_names" in arrays:
        names = texts(path, "joint_names", arrays["joint_names"])
        if len(names) != q.shape[1] or len(set(names)) < len(names):
            reason = f"are {len(names)}, {len(set(names))} of them different; q has {q.shape[1]} columns"
            raise BadDemonstration(path, "joint_names", reason)
    mine = _arm_columns(names, arm.dof) or list(range(arm.dof))
    for name in (names[k] for k in mine):
        makes = {MAKES[word] for word in re.split(r"[^a-z0-9]+", name.lower()) if word in MAKES}
        if makes and arm.name.lower() not in {make.lower() for make in makes}:
            reason = f"{name!r} is a joint of the {makes.pop()} by its name, not of the {arm.name}: say --robot"
            raise BadDemonstration(path, "joint_names", reason)
    others = {name: q[:, k] for k, name in enumerate(names) if k not in mine}
    sorted_ = (
        f"q is sorted by joint_names, {names[mine[0]]} to {names[mine[-1]]}" if mine != list(range(arm.dof)) else ""
    )
    return q[:, mine], others, sorted_


def _arm_columns(names: list[str], dof: int) -> list[int]:
    """Return the columns of an arm's joints in order, by the numbers or words in their names; [] if they say none."""
    chains: dict[str, dict[int, int]] = {}
    for k, name in enumerate(names):
        low = name.lower()
        if GRIPPER & set(re.split(r"[^a-z]+", low)):
            continue
        word = next((j for j, each in enumerate(UR_JOINTS, 1) if re.search(rf"{each}(_joint)?$", low)), 0)
        number = re.search(r"\d+$", low)
        if word:
            stem, place = low.rsplit(UR_JOINTS[word - 1], 1)[0], word
        elif number:
            stem, place = low[: number.start()], int(number[0])
        else:
            continue
        chains.setdefault(stem, {})[place] = k
    whole = [chain for chain in chains.values() if set(chain) in (set(range(dof)), set(range(1, dof + 1)))]
    # of two arms the first one is recorded first
    whole.sort(key=lambda chain: min(chain.values()))
    return [whole[0][place] for place in sorted(whole[0])] if whole else []
