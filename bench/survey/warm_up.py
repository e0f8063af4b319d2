"""A robot of three boxes, measured before all others, so that no time counts the compilation of kernels."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

from .measured_robot import Counts, measured
from .robot_list import ListedRobot, RobotEntry

NAMES = ("base", "one", "two", "three")


def warm_up() -> None:
    """Load, cover and plan for a small robot."""
    with TemporaryDirectory() as folder:
        (Path(folder) / "robot.urdf").write_text(f'<robot name="r">{_links()}{_joints()}</robot>', encoding="utf-8")
        measured(ListedRobot(RobotEntry("boxes", "robot.urdf"), Path(folder), "", ""), Counts(200, 1))


def _links() -> str:
    shape = '<collision><origin xyz="0 0 0.15"/><geometry><box size="0.06 0.06 0.3"/></geometry></collision>'
    return "".join(f'<link name="{name}">{shape}</link>' for name in NAMES)


def _joints() -> str:
    limit = '<limit lower="-2.5" upper="2.5" effort="1" velocity="1"/>'
    return "".join(
        f'<joint name="to_{child}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0 0 0.34"/><axis xyz="0 1 0"/>{limit}</joint>'
        for parent, child in pairwise(NAMES)
    )
