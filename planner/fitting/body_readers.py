"""Readers of robot models: capsules that contain an arm's collision geometry, from MuJoCo or URDF.

Not in the paper: the paper moves a point.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..models.model_report import ModelReport
from ..models.srdf import ignored_pieces, read_srdf
from ..robot.arm import Arm
from ..robot.body import Body
from .kept_bodies import kept_body_of
from .link_capsules import Split
from .mujoco_parts import parts_from_mujoco
from .robot_parts import PartsRequest, pieces_of_links
from .urdf_parts import parts_from_urdf


def body_from_mujoco(
    model: Any,
    arm: Arm,
    joint_names: Sequence[str] | None = None,
    *,
    split: Split = None,
    exact: bool = True,
    locked: Mapping[str, float] | None = None,
    visuals: bool = False,
) -> Body:
    """Cover the collision geometry of an arm, and of everything attached to the arm, in a compiled model.

    Static bodies between the world and the first joint count as the arm's base, in frame -1, whose coordinates are the
    world's; so do bodies that hang on the base by held joints. Bodies beside them, such as a pedestal, are obstacles.

    Args:
        model: `mujoco.MjModel`, read by its named fields; MuJoCo itself is not imported.
        arm: read from the same model.
        joint_names: of the arm in the model; default: those of the arm.
        split: number of capsules (1 to 3) of every piece, or of some pieces by name; default: as many as pay off.
        exact: add the convex hulls of all pieces, which decide where a capsule is close, and find out which parts can
            hit each other; False: capsules alone.
        locked: position [rad or m] of each joint to hold, by name or shell pattern, besides those that the arm holds:
            what hangs on them is placed there. Other joints on the arm's links are swept over their range.
        visuals: cover bodies of which no geom collides by those geoms.

    Returns:
        Capsules named "link0" (the base) to "link7" for seven joints, "hand" for everything welded to the last link and
        "fingers" for the parts that move on it, over their whole range.

    Raises:
        BadModel: unknown joints, another arm, or geometry that cannot be covered.
        UnknownName: a piece in `split` that the arm lacks.
    """
    read = parts_from_mujoco(model, arm, joint_names, PartsRequest(locked or {}, visuals))
    body, doubts = kept_body_of(read.robot, arm, split, exact=exact)
    _with(read.report, doubts).warn()
    return body


def body_from_urdf(
    path: str | Path,
    arm: Arm,
    *,
    package_dirs: Sequence[str | Path] | None = None,
    split: Split = None,
    exact: bool = True,
    locked: Mapping[str, float] | None = None,
    visuals: bool = False,
    srdf: str | Path | None = None,
) -> Body:
    """Cover the collision geometry of an arm, and of everything attached to the arm, in a URDF file.

    Args:
        path: URDF file.
        arm: read from the same file; its base pose is free.
        package_dirs: folders of the packages of `package://`; default: the folders above the file.
        split: see `body_from_mujoco`.
        exact: see `body_from_mujoco`.
        locked: see `body_from_mujoco`.
        visuals: cover links that have no <collision> by their <visual>.
        srdf: SRDF file: parts of which it exempts all links from collisions with all of the other's are not checked
            against each other.

    Returns:
        As `body_from_mujoco`; everything fixed to the root link is "link0".

    Raises:
        BadModel: no such file, missing meshes, no collision geometry, another arm, or an SRDF file of another robot.
        BadOption: an SRDF file with `exact=False`.
        UnknownName: a piece in `split` that the arm lacks.
    """
    read = parts_from_urdf(path, arm, package_dirs, PartsRequest(locked or {}, visuals))
    body, doubts = kept_body_of(read.robot, arm, split, exact=exact)
    _with(read.report, doubts).warn()
    if srdf is None:
        return body
    return body.ignoring(*sorted(ignored_pieces(read_srdf(srdf), pieces_of_links(read, arm.dof), srdf)))


def _with(report: ModelReport, doubts: tuple[str, ...]) -> ModelReport:
    """Return a report with further warnings."""
    return replace(report, warnings=(*report.warnings, *doubts))
