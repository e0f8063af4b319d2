"""Episodes of robosuite and robomimic in HDF5 files, played through the model that they hold.

A file has `data/NAME/states` (n, 1 + nq + nv), whose first column is the time, the attribute `model_file` with the MJCF
of the scene, and `actions` (n, k) with the gripper last. Only kinematics are taken from the model, so that the meshes
of the machine that recorded it are not needed.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np

from ...configs import BadConfig
from ...planner import Pose, PosePath
from ...planner.errors import BadDemonstration, UnknownName
from ...planner.recordings.gripper_signal import gripper_command
from ...planner.recordings.recording import Recording, blame_of
from ...planner.recordings.teleoperation import OSC_POSE, STEP, TURN, commanded_path

ENDINGS = (".hdf5", ".h5")
INSTALL = "needs h5py: pip install 'onedemo[hdf5]'"
UNUSED = ("asset", "actuator", "sensor", "tendon", "equality", "contact", "keyframe", "visual", "statistic", "custom")
"""Parts of a model that say nothing about where its bodies are."""
UNSEEN = ("geom", "camera", "light", "flexcomp", "skin", "composite", "plugin")
LOOKS = ("material", "mesh", "texture", "hfield")
TOOL_SITE = "grip_site"
UPRIGHT = 1.0 - 1e-6
"""First number of a quaternion from which its frame counts as not turned."""
MAX_MODEL = 20_000_000
"""Largest number of characters of a model."""


class _Episode(NamedTuple):
    name: str
    others: int
    states: np.ndarray
    actions: np.ndarray
    model: str
    arguments: dict[str, Any]


def recording_from_hdf5(path: Path, demo: str = "", hand: str = "") -> Recording:
    """Read an episode of a robosuite or robomimic file.

    Args:
        path: of the file.
        demo: name of the episode, like "demo_3"; "": the first one.
        hand: name of the site that is the tcp; "": the only one whose name ends with "grip_site".

    Raises:
        BadConfig: the extra `hdf5` is not installed.
        BadDemonstration: the file or one of its entries is invalid.
        UnknownName: no such episode or site.
    """
    episode = _episode(path, demo)
    model = _kinematics(path, episode)
    from ...envs.mujoco_library import mujoco

    data, where = mujoco.MjData(model), f"data/{episode.name}/states"
    states = episode.states
    if states.shape[1] not in (1 + model.nq + model.nv, 1 + model.nq + model.nv + model.na):
        reason = f"has {states.shape[1]} columns; the model needs {1 + model.nq + model.nv}: time, positions, speeds"
        raise BadDemonstration(path, where, reason)
    site = _tool(path, model, hand)
    own = _joints_above(model, int(model.site_bodyid[site]))
    objects, singles, notes = _scene(model, own)
    fixtures = list(_fixtures(model, int(model.site_bodyid[site])))
    tcp, poses = np.empty((len(states), 7)), np.empty((len(states), len(objects), 7))
    for k, row in enumerate(states):
        data.qpos[:] = row[1 : 1 + model.nq]
        mujoco.mj_kinematics(model, data)
        tcp[k, :3] = data.site_xpos[site]
        mujoco.mju_mat2Quat(tcp[k, 3:], data.site_xmat[site])
        for j, body in enumerate(objects.values()):
            poses[k, j, :3], poses[k, j, 3:] = data.xpos[body], data.xquat[body]
    still = {_label(model, body): Pose.from_position_quaternion(data.xpos[body], data.xquat[body]) for body in fixtures}
    path_of_hand = PosePath.from_vectors(tcp)
    gripper, about_gripper = gripper_command(
        episode.actions[:, -1], None, blame_of(path, f"data/{episode.name}/actions")
    )
    is_turned = abs(float(model.body_quat[_root(model, int(model.site_bodyid[site]))][0])) < UPRIGHT
    commanded, about_actions = _commanded(episode, path_of_hand, is_turned)
    chosen = f"{episode.name} of {1 + episode.others} episodes" if episode.others else episode.name
    return Recording(
        file=path,
        time=states[:, 0] - states[0, 0],
        hand=path_of_hand,
        tcp_frame=model.site(site).name,
        joints=states[:, 1 + model.jnt_qposadr[own]],
        other_joints={model.joint(j).name: states[:, 1 + int(model.jnt_qposadr[j])] for j in singles},
        gripper=gripper,
        objects={name: PosePath.from_vectors(poses[:, j]) for j, name in enumerate(objects)},
        fixtures=still,
        commanded=commanded,
        notes=(f"episode {chosen}", about_gripper, about_actions, *notes),
    )


def _episode(path: Path, demo: str) -> _Episode:
    try:
        import h5py
    except ImportError:
        raise BadConfig(path, "", INSTALL) from None
    if not path.is_file():
        raise BadDemonstration(path, "file", "is a folder" if path.is_dir() else "does not exist")
    try:
        with h5py.File(path, "r") as file:
            group: Any = file.get("data", {})
            if not len(group):
                raise BadDemonstration(path, "data", "is missing or empty; expected data/NAME/states and actions")
            names = sorted(group, key=lambda name: (len(name), name))
            if demo and demo not in names:
                raise UnknownName("episode", demo, names)
            name = demo or names[0]
            chosen = group[name]
            if "model_file" not in chosen.attrs:
                raise BadDemonstration(path, f"data/{name}", "lacks the attribute model_file, the MJCF of its scene")
            states, actions = (_numbers(path, chosen, name, key) for key in ("states", "actions"))
            if len(states) != len(actions) or len(states) < 2:
                reason = f"are {len(states)}, actions {len(actions)}; expected equally many, at least 2"
                raise BadDemonstration(path, f"data/{name}/states", reason)
            arguments = json.loads(group.attrs.get("env_args", "{}"))
            return _Episode(name, len(names) - 1, states, actions, str(chosen.attrs["model_file"]), arguments)
    except (OSError, ValueError, KeyError, AttributeError) as error:
        if isinstance(error, BadDemonstration | UnknownName):
            raise
        raise BadDemonstration(path, "file", f"is no readable HDF5 file ({str(error).splitlines()[0]})") from None


def _numbers(path: Path, group: Any, name: str, key: str) -> np.ndarray:
    where = f"data/{name}/{key}"
    if key not in group or not hasattr(group[key], "shape"):
        raise BadDemonstration(path, where, f"is missing; there are: {', '.join(group)}")
    value = np.asarray(group[key])
    if value.dtype.kind not in "fiu" or value.ndim != 2 or not value.shape[1]:
        raise BadDemonstration(path, where, f"is {value.dtype} of shape {value.shape}; expected numbers (n, k)")
    bad = np.argwhere(~np.isfinite(value))
    if len(bad):
        raise BadDemonstration(path, where, f"is not finite at index {int(bad[0][0])}")
    return value.astype(np.float64)


def _kinematics(path: Path, episode: _Episode) -> Any:
    """Return a MuJoCo model of the bodies, joints and sites of an episode's model alone."""
    from ...envs.mujoco_library import compiled_model

    where, text = f"data/{episode.name}: model_file", episode.model
    if len(text) > MAX_MODEL or "<!DOCTYPE" in text:
        raise BadDemonstration(path, where, "is too large, or no plain MJCF")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise BadDemonstration(path, where, f"is no XML: {error}") from None
    for parent in list(root.iter()):
        for child in list(parent):
            if child.tag in UNSEEN or (parent is root and child.tag in UNUSED):
                parent.remove(child)
    for element in root.iter():
        for key in LOOKS:
            element.attrib.pop(key, None)
    for old in root.findall("compiler"):
        angle = {key: old.attrib[key] for key in ("angle", "autolimits", "eulerseq") if key in old.attrib}
        old.attrib.clear()
        old.attrib.update(angle)
    # without geoms, bodies have no mass of their own
    ElementTree.SubElement(root, "compiler", boundmass="0.001", boundinertia="0.000001")
    for old in root.findall("option"):
        root.remove(old)
    try:
        return compiled_model(ElementTree.tostring(root, encoding="unicode"))
    except ValueError as error:
        raise BadDemonstration(path, where, str(error).strip().splitlines()[0]) from None


def _tool(path: Path, model: Any, hand: str) -> int:
    names = [model.site(k).name for k in range(model.nsite)]
    if hand:
        if hand not in names:
            raise UnknownName("site of the tcp", hand, names)
        return names.index(hand)
    found = [name for name in names if name.endswith(TOOL_SITE)]
    if len(found) != 1:
        reason = f"has {len(found)} sites {TOOL_SITE}: name the tcp with --hand; there are: {', '.join(names)}"
        raise BadDemonstration(path, "model_file", reason)
    return names.index(found[0])


def _joints_above(model: Any, body: int) -> list[int]:
    """Return the joints of one number from the world to a body, in order: those of the arm."""
    from ...envs.mujoco_library import mujoco

    found: list[int] = []
    singles = (int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE))
    while body > 0:
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        found += [j for j in reversed(range(first, first + count)) if int(model.jnt_type[j]) in singles]
        body = int(model.body_parentid[body])
    return found[::-1]


def _scene(model: Any, own: list[int]) -> tuple[dict[str, int], list[int], list[str]]:
    """Return the bodies of objects by name, other joints of one number, and notes about what is left out."""
    from ...envs.mujoco_library import mujoco

    objects, singles, notes = {}, [], []
    for j in range(model.njnt):
        if int(model.jnt_type[j]) == int(mujoco.mjtJoint.mjJNT_FREE):
            objects[_label(model, int(model.jnt_bodyid[j]))] = int(model.jnt_bodyid[j])
        elif int(model.jnt_type[j]) == int(mujoco.mjtJoint.mjJNT_BALL):
            notes.append(f"joint {model.joint(j).name!r} is a ball joint and is left out")
        elif j not in own:
            singles.append(j)
    return objects, singles, notes


def _fixtures(model: Any, hand: int) -> Iterator[int]:
    """Yield the bodies on the world that never move and carry no arm."""
    arm = _root(model, hand)
    for body in range(1, model.nbody):
        if model.body_parentid[body] == 0 and body != arm and not model.body_jntnum[body]:
            yield body


def _root(model: Any, body: int) -> int:
    """Return the body on the world that carries a body."""
    while body and model.body_parentid[body]:
        body = int(model.body_parentid[body])
    return body


def _label(model: Any, body: int) -> str:
    """Return the name of a body without robosuite's suffix."""
    return str(model.body(body).name).removesuffix("_main") or f"body{body}"


def _commanded(episode: _Episode, hand: PosePath, is_turned: bool) -> tuple[PosePath | None, str]:
    """Return the poses that the tcp was sent to, if the controller is known, and what was understood of the actions.

    Args:
        episode: the episode.
        hand: poses of the tcp when the actions were given.
        is_turned: the robot's base has other axes than the world.
    """
    width = episode.actions.shape[1]
    settings = _osc_pose(episode.arguments.get("env_kwargs", {}).get("controller_configs", {}))
    if width != OSC_POSE or settings is None or (is_turned and settings.get("input_ref_frame") == "base"):
        return None, f"of the {width} numbers of an action only the last is read, the gripper's"
    try:
        most = np.broadcast_to(np.asarray(settings.get("output_max", [STEP] * 3 + [TURN] * 3), dtype=np.float64), (6,))
    except (TypeError, ValueError):
        return None, "the controller's output_max is no list of six numbers: the commanded path is left out"
    path = commanded_path(hand, episode.actions[:, :6], float(most[0]), float(most[3]))
    return path, "actions are read as those of OSC_POSE: the commanded path is kept"


def _osc_pose(configs: Any) -> dict[str, Any] | None:
    """Return the settings of a controller OSC_POSE whose actions are differences, wherever they are nested."""
    if not isinstance(configs, dict):
        return None
    if configs.get("type") == "OSC_POSE":
        absolute = configs.get("control_delta") is False or configs.get("input_type", "delta") != "delta"
        return None if absolute or configs.get("input_ref_frame", "world") not in ("world", "base") else configs
    return next((found for value in configs.values() if (found := _osc_pose(value)) is not None), None)
