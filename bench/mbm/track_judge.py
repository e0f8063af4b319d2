"""The judge of the track's motions: the meshes of the robot's URDF, without the pairs that the SRDF names."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

from ...configs import BadConfig
from ..robot.mesh_judge import MeshJudge
from ..robot.urdf_solids import UrdfSolids
from .robot import TrackRobot

OWN_EVERY = 4
"""Samples from one check of the robot's own parts to the next."""


def judge_of(robot: TrackRobot) -> MeshJudge:
    """Return the judge of a robot.

    Args:
        robot: its model is read anew, with Pinocchio.

    Raises:
        BadConfig: the model or its SRDF cannot be read, or a joint is not in it.
    """
    files = robot.files
    solids = UrdfSolids(files.urdf, robot.arm.joint_names, robot.others, files.world_from_base)
    own = pairs_of_links(solids.links, solids.neighbors(), files.srdf)
    return MeshJudge(solids, own, own_every=OWN_EVERY)


def pairs_of_links(links: Sequence[str], neighbors: set[frozenset[str]], srdf: Path | None) -> list[tuple[int, int]]:
    """Return the pairs of solids that are checked against each other.

    Args:
        links: of each solid.
        neighbors: pairs of links that a joint connects, or that move as one.
        srdf: file of the pairs that are not checked; None: only neighbors are left out.

    Raises:
        BadConfig: the file is no SRDF.
    """
    left_out = set(neighbors)
    if srdf is not None:
        try:
            found = ElementTree.parse(srdf).getroot().iter("disable_collisions")
        except ElementTree.ParseError as error:
            raise BadConfig(srdf, "SRDF", str(error)) from None
        left_out |= {frozenset((each.get("link1", ""), each.get("link2", ""))) for each in found}
    pairs = combinations(range(len(links)), 2)
    return [(i, j) for i, j in pairs if links[i] != links[j] and frozenset((links[i], links[j])) not in left_out]
