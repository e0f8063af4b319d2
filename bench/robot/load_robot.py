"""A robot's file in, arm and body out, for commands: URDF, or MJCF that MuJoCo compiles."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

from ...planner import Arm, Body, Pose
from ...planner.errors import BadModel, ModelWarning
from ...planner.fitting.kept_bodies import kept_body_of
from ...planner.fitting.link_capsules import body_of
from ...planner.fitting.mujoco_parts import parts_from_mujoco
from ...planner.fitting.robot_parts import PartsRequest, ReadRobot, pieces_of_links
from ...planner.fitting.urdf_parts import parts_from_urdf
from ...planner.models.model_report import UNSEEN, ModelReport
from ...planner.models.srdf import ignored_pieces, read_srdf
from ...planner.models.urdf_model import read_urdf
from ...planner.models.xml_tree import root_of
from .tool_choice import tool_of_mujoco, tool_of_urdf

KINDS = ("robot", "mujoco")
"""Root elements of URDF and of MJCF."""
UNKNOWN_SPEED = 1.0
"""Speed [rad/s or m/s] of joints whose file has none, where only their geometry is asked for."""


@dataclass(frozen=True)
class RobotRequest:
    """Request for a robot from a file.

    Attributes:
        file: URDF or MJCF file.
        tool: link or joint of a URDF, site or body of an MJCF file; None: the last one before fingers or branches.
        velocity_limits: largest joint speeds [rad/s or m/s]; None: those of the URDF.
        base: pose of a URDF's root link in the world; None: the origin.
        base_link: link, or body, before which all joints are held; None: the root.
        locked: position of each joint to hold [rad or m], by name or shell pattern.
        package_dirs: folders of the packages of a URDF's `package://`; None: the folders above the file.
        srdf: SRDF file with pairs of links that need not be checked against each other; None: none.
        visuals: cover links without collision geometry by their visual geometry.
    """

    file: Path
    tool: str | None = None
    velocity_limits: Any = None
    base: Pose | None = None
    base_link: str | None = None
    locked: Mapping[str, float] = field(default_factory=dict)
    package_dirs: Sequence[Path] | None = None
    srdf: Path | None = None
    visuals: bool = False


class LoadedRobot(NamedTuple):
    """A robot from a file.

    Attributes:
        arm: the arm; its report is that of arm and body.
        body: its capsules.
        parts: what the body was made of.
        tool: name of the tool frame.
        ignored: pairs of parts of the body that the SRDF exempts.
    """

    arm: Arm
    body: Body
    parts: ReadRobot
    tool: str
    ignored: tuple[tuple[str, str], ...]


class ReadFile(NamedTuple):
    """A robot's file that was read, before its geometry is covered.

    Attributes:
        arm: the arm.
        parts: what the body will be made of.
        tool: name of the tool frame.
        ignored: pairs of parts of the body that the SRDF exempts.
        visuals: whether links without collision geometry are covered by their visual geometry.
    """

    arm: Arm
    parts: ReadRobot
    tool: str
    ignored: tuple[tuple[str, str], ...]
    visuals: bool

    def covered(self, *, anew: bool = False) -> LoadedRobot:
        """Return the robot with its body; what is doubtful stands in the arm's report.

        Args:
            anew: fit the body, even if it was fitted before.

        Raises:
            BadModel: its geometry cannot be covered.
        """
        fit = body_of if anew else kept_body_of
        body, doubts = fit(self.parts.robot, self.arm, None)
        body = body.ignoring(*self.ignored)
        report = _merged(self.arm.report, self.parts.report, doubts, visuals=self.visuals)
        return LoadedRobot(replace(self.arm, report=report), body, self.parts, self.tool, self.ignored)


def load_robot(request: RobotRequest) -> LoadedRobot:
    """Read arm and body of a robot; what is doubtful stands in the arm's report.

    Raises:
        BadModel: the file, a name in the request, or the SRDF cannot be used.
    """
    return read_robot(request).covered()


def read_robot(request: RobotRequest) -> ReadFile:
    """Read a robot's file.

    Raises:
        BadModel: the file, a name in the request, or the SRDF cannot be used.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        arm, parts, tool = (_mujoco if kind_of(request.file) == "mujoco" else _urdf)(request)
    pairs = {} if request.srdf is None else read_srdf(request.srdf)
    ignored = sorted(ignored_pieces(pairs, pieces_of_links(parts, arm.dof), request.srdf or "") if pairs else ())
    return ReadFile(arm, parts, tool, tuple(ignored), request.visuals)


def kind_of(file: Path) -> str:
    """Return what a file describes a robot in: "robot" for URDF, "mujoco" for MJCF.

    Raises:
        BadModel: no such file, or neither.
    """
    if not file.is_file():
        raise BadModel(file, "robot", "no such file")
    found = root_of(file)
    if found not in KINDS:
        what = f"its root is <{found}>" if found else "it has no element"
        raise BadModel(file, "robot", f"is neither URDF nor MJCF: {what}, not <robot> or <mujoco>")
    return found


def _urdf(request: RobotRequest) -> tuple[Arm, ReadRobot, str]:
    tool = _chosen(request, tool_of_urdf(read_urdf(request.file))) if request.tool is None else request.tool
    arm = Arm.from_urdf(
        request.file,
        tcp_frame=tool,
        world_from_base=request.base,
        velocity_limits=request.velocity_limits,
        locked=request.locked,
        base_link=request.base_link,
    )
    parts = parts_from_urdf(request.file, arm, request.package_dirs, _parts_request(request, arm))
    return arm, parts, tool


def _mujoco(request: RobotRequest) -> tuple[Arm, ReadRobot, str]:
    from ...envs.mujoco_library import compiled_model

    try:
        model = compiled_model(request.file)
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise BadModel(request.file, "MJCF", f"cannot be compiled: {reason}") from None
    tool = _chosen(request, tool_of_mujoco(model)) if request.tool is None else request.tool
    is_site = any(model.site(k).name == tool for k in range(model.nsite))
    arm = Arm.from_mujoco(
        model,
        site=tool if is_site else None,
        body=None if is_site else tool,
        velocity_limits=UNKNOWN_SPEED if request.velocity_limits is None else request.velocity_limits,
        locked=request.locked,
        base_link=request.base_link,
        name=request.file.name,
    )
    return arm, parts_from_mujoco(model, arm, None, _parts_request(request, arm)), tool


def _chosen(request: RobotRequest, tool: str | None) -> str:
    """Return a tool frame that was chosen, if one could be."""
    if tool is None:
        raise BadModel(request.file, "tool", "there is no single longest chain of joints; name the tool")
    if not tool:
        raise BadModel(request.file, "tool", "the body at the end of the longest chain has no name; name the tool")
    return tool


def _parts_request(request: RobotRequest, arm: Arm) -> PartsRequest:
    """Return the request for the parts: joints before the tool are held by the arm already."""
    others = {name: value for name, value in request.locked.items() if name not in arm.report.held}
    return PartsRequest(others, request.visuals)


def _merged(arm: ModelReport, body: ModelReport, doubts: Sequence[str], *, visuals: bool) -> ModelReport:
    """Return the findings of both readers and of the fit; the body's reader knows more about geometry."""
    unused = dict.fromkeys((*body.unused, *(line for line in arm.unused if not (visuals and line.startswith(UNSEEN)))))
    return ModelReport(arm.source, {**arm.held, **body.held}, tuple(unused), (*arm.warnings, *body.warnings, *doubts))
